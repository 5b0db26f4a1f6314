"""The first start: system libraries by apt, .venv by venv and pip; mended where it was cut short.

Standard library alone.  Nothing of the current folder, which may be a folder of downloads, is
found by a process that is started here: Python runs with -I, and every tool in another folder.
"""

import ctypes
import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
WINDOWS = os.name == "nt"
PYTHON = VENV / ("Scripts/python.exe" if WINDOWS else "bin/python")
UNFINISHED = "unfinished"  # a file in .venv while it is changed; left there by a set-up that died
INSTALL_LOG = "install.log"  # in .venv: all that pip said the last time
PATIENCE_S = 60.0  # a line of progress so often
FAR_BYTE = 1 << 30  # of this file, where Windows locks: no byte that anybody reads

# Shared library -> the Debian package that brings it, for drawing without a GPU and for windows.
LIBRARIES = {
    "libEGL.so.1": "libegl1",
    "libEGL_mesa.so.0": "libegl-mesa0",
    "libGL.so.1": "libgl1",
    "libOSMesa.so.8": "libosmesa6",
    "libX11.so.6": "libx11-6",
    "libXcursor.so.1": "libxcursor1",
    "libXrandr.so.2": "libxrandr2",
    "libXi.so.6": "libxi6",
    "libXinerama.so.1": "libxinerama1",
    "libgomp.so.1": "libgomp1",
}
OPENCL_PACKAGE = "pocl-opencl-icd"
OPENCL_LOCK = "requirements-opencl.lock"  # a driver for Linux x86-64, half as fast as Debian's

# Settings of pip that would put packages elsewhere than into .venv.
PIP_ELSEWHERE = ("PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_USER", "PIP_PYTHON", "PIP_DRY_RUN")
# What pip says when it failed -> what that means; the first that fits is shown.
PIP_REASONS = (
    (r"No space left on device", "the disk is full; make room and start again"),
    (r"CERTIFICATE_VERIFY_FAILED|SSLError", "the certificate of the package index is not trusted "
     "here (a proxy or a wrong clock may be why)"),
    (r"connection broken|NewConnectionError|Max retries|ConnectTimeout|ReadTimeout|ProxyError|"
     r"timed out|ConnectionResetError", "the package index cannot be reached; check the network "
     "or the proxy and start again"),
    (r"DO NOT MATCH THE HASHES[^\n]*\n(?:[^\n]*\n)*?\s*(\S+==\S+)", "what came as {} is not a file "
     "that the lock names, so nothing was installed: it was changed in the index or on its way"),
    (r"(?:pinned with ==|--require-hashes mode)[^\n]*\n\s*(\S+)", "the lock lacks {}; "
     "tools/packaging/lock.py makes it anew"),
    (r"No matching distribution found for (\S+)", "the package index has no {} for Python "
     f"{sys.version_info[0]}.{sys.version_info[1]} on {sys.platform} {platform.machine()}"),
    (r"(?:Failed building wheel for|Failed to build|metadata-generation-failed)(?: '?([\w.-]+))?",
     "{} has to be built here, and that failed; a compiler or its headers may lack"),
    (r"(?:conflicting dependencies|ResolutionImpossible)", "it wants other versions of packages "
     "than those that are installed here, and these stay as they are"),
)  # fmt: skip


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def stop(text: str) -> NoReturn:
    say(text)
    raise SystemExit(2)


# System libraries


def has_library(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def has_opencl() -> bool:
    """An OpenCL driver is registered with the system (pip's wheel registers with pyopencl)."""
    if WINDOWS or sys.platform == "darwin":
        return True  # comes with the GPU driver; the program says so where it is missing
    return any(Path("/etc/OpenCL/vendors").glob("*.icd"))


def missing_packages(testing: bool) -> list[str]:
    """Debian packages whose library or program is not here."""
    if not sys.platform.startswith("linux"):
        return []
    missing = [package for library, package in LIBRARIES.items() if not has_library(library)]
    if not any(Path("/usr").glob("lib*/**/dri/*_dri.so")):
        missing.append("libgl1-mesa-dri")
    if not has_opencl():
        missing.append(OPENCL_PACKAGE)
    if testing and not shutil.which("Xvfb"):
        missing.append("xvfb")  # the window tests draw into it
    if not has_venv():
        missing.append(f"python{sys.version_info[0]}.{sys.version_info[1]}-venv")
    return missing


def has_venv() -> bool:
    try:
        import ensurepip  # noqa: F401  Debian ships it apart from Python
    except ImportError:
        return False
    return True


def install_packages(packages: list[str]) -> None:
    """By apt when that is possible, else one line that says what to install."""
    line = "apt-get install -y --no-install-recommends " + " ".join(packages)
    if not (shutil.which("apt-get") and os.geteuid() == 0):
        say(f"Shapeshift needs system libraries that are not here. Install them with: sudo {line}")
        return
    say(f"Installing system libraries: {' '.join(packages)}")
    run_quietly(["apt-get", "update", "-qq"])
    if run_quietly(line.split()) != 0:
        say(f"apt-get could not install them all; to see why, run: {line}")


def run_quietly(command: list[str]) -> int:
    """The exit code of a tool that asks nothing and prints only what goes wrong."""
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL, cwd="/", env=environment)
    return done.returncode


# The environment.  It is whole where a stamp says so and the mark of a change is absent.


def requirement_files(testing: bool) -> list[Path]:
    names = ["requirements.lock"] + (["requirements-test.lock"] if testing else [])
    return [ROOT / name for name in names]


def digest(testing: bool) -> str:
    """Changes when a requirement, this file or the Python changes: then the set-up runs again."""
    files = [*requirement_files(testing), Path(__file__)]
    return hashlib.sha256(
        b"".join(f.read_bytes() for f in files) + sys.version.encode()
    ).hexdigest()


def stamp_file(testing: bool) -> Path:
    return VENV / ("ready-test" if testing else "ready")


def is_ready(testing: bool) -> bool:
    if not PYTHON.exists() or (VENV / UNFINISHED).exists():
        return False
    try:
        return stamp_file(testing).read_bytes() == digest(testing).encode()
    except OSError:
        return False


def make_environment(testing: bool) -> None:
    """Make .venv with the locked packages, unless it is there already."""
    made = not is_ready(testing)
    if made:
        with one_at_a_time() as lock:
            if not is_ready(testing):  # else another start has made it meanwhile
                if missing := missing_packages(testing):
                    install_packages(missing)
                make_venv(lock)
                install_requirements(testing, lock)
    if made or testing:  # those who run the tests also add files
        write_stubs()


@contextmanager
def one_at_a_time() -> Iterator[int | None]:
    """Waits until no other start changes .venv; gives a handle that stands for the turn.

    The system takes the lock back when the last process that has the handle ends, however it
    ends: no lock is ever stale, and pip keeps its turn when it outlives the start that called it.
    None on a file system without locks.
    """
    with open(Path(__file__), "rb") as file:
        announced = False
        while (taken := try_lock(file.fileno())) is False:
            if not announced:
                say("Another start is setting up; waiting for it.")
            announced = True
            time.sleep(0.2)
        yield file.fileno() if taken else None


def try_lock(handle: int) -> bool | None:
    """True: locked until the handle is closed; False: somebody else has it; None: cannot be."""
    try:
        if sys.platform == "win32":  # the form of WINDOWS that a type checker knows
            import msvcrt

            os.lseek(handle, FAR_BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return None
    return True


def run_python(python: Path | str, *words: str, lock: int | None, **more: Any) -> subprocess.Popen:
    """A Python that sees nothing of the current folder or of PYTHON* settings."""
    keep = () if WINDOWS or lock is None else (lock,)
    command = [str(python), "-I", *words]
    return subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL, pass_fds=keep, **more)


def make_venv(lock: int | None) -> None:
    """Make .venv, or mend it: one that a start left half-made when it died is made anew."""
    half_made, finished = (VENV / UNFINISHED).exists(), stamp_file(False).exists()
    if finished and not half_made and has_pip(lock):
        return
    if half_made or finished:
        say("The Python environment in .venv is damaged or was never finished: making it anew")
        empty_venv()
    else:
        say("First start: making the Python environment in .venv")
        VENV.mkdir(exist_ok=True)
        if not (VENV / "pyvenv.cfg").exists():  # else made by somebody's hand: only added to
            (VENV / UNFINISHED).touch()
    if not has_pip(lock):
        call_venv(lock)


def call_venv(lock: int | None) -> None:
    """The standard library's venv, which also gives pip to an environment that lacks it."""
    python = getattr(sys, "_base_executable", sys.executable)  # not that of .venv itself
    quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with run_python(python, "-m", "venv", str(VENV), lock=lock, **quiet) as venv:
        said = venv.communicate()[0].decode(errors="replace").split("\n")
    if venv.returncode != 0:
        release = ".".join(map(str, sys.version_info[:2]))
        why = next((line.strip() for line in reversed(said) if line.strip()), "no reason given")
        if re.search(r"No space left|Errno 28", " ".join(said)):
            stop(f"The disk of {VENV} is full; make room and start again.")
        stop(
            f"Python could not make a virtual environment in {VENV} ({printable(why)}); install "
            f"its venv module (Debian: apt-get install python{release}-venv) or delete that folder."
        )


def has_pip(lock: int | None) -> bool:
    if not PYTHON.exists():
        return False
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return run_python(PYTHON, "-m", "pip", "--version", lock=lock, **quiet).wait() == 0


def empty_venv() -> None:
    """Everything out of .venv; the mark stays, so that this may be cut short as well."""
    if VENV.is_symlink():
        stop(f"{VENV} is a link to an environment that is damaged; delete the link or mend it.")
    (VENV / UNFINISHED).touch()
    for entry in VENV.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        elif entry.name != UNFINISHED:
            entry.unlink()


def install_requirements(testing: bool, lock: int | None) -> None:
    """By pip; .venv is marked as unfinished as long as pip may be in the middle of something."""
    wanted = [word for f in requirement_files(testing) for word in ("-r", str(f))]
    if not has_opencl() and sys.platform == "linux" and platform.machine() == "x86_64":
        say("No system OpenCL driver: using the slower one from the package index.")
        wanted += ["-r", str(ROOT / OPENCL_LOCK)]
    say("Installing the Python packages (once, about a minute)")
    finished = stamp_file(False).exists()
    if finished:
        (VENV / UNFINISHED).touch()
    log = VENV / INSTALL_LOG
    code = run_pip(["install", "--require-hashes", *wanted], lock, log)
    if code != 0:
        if finished and code > 0:  # pip has given up in order: what was there before still works
            (VENV / UNFINISHED).unlink()
        stop(f"pip could not install the requirements: {pip_reason(code, log)}.")
    for level in {False, testing}:
        stamp_file(level).write_text(digest(level))
    (VENV / UNFINISHED).unlink(missing_ok=True)


def say_still(line: str) -> None:
    say(f"Still at it: {line}")


def run_pip(
    words: list[str], lock: int | None, log: Path, python: Path = PYTHON, temporary: str = "",
    hear: Callable[[str], None] = say_still, every_s: float = PATIENCE_S,
) -> int:  # fmt: skip
    """pip's exit code; what it says goes into a file, and `hear` gets a line of it now and then."""
    environment = {k: v for k, v in os.environ.items() if k not in PIP_ELSEWHERE}
    if temporary:  # where pip and those that it calls leave what they do not need for long
        environment |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), temporary)
    words = ["-m", "pip", *words, "--disable-pip-version-check", "--no-input"]
    with log.open("wb") as file:
        output = {"stdout": file, "stderr": subprocess.STDOUT, "env": environment}
        pip = run_python(python, *words, lock=lock, **output)
        try:
            while True:
                try:
                    return pip.wait(every_s)
                except subprocess.TimeoutExpired:
                    hear(pip_said(r"^ *(Collecting|Downloading|Building|Installing) .*", log))
        except KeyboardInterrupt:
            pip.terminate()
            pip.wait()
            raise


def pip_said(pattern: str, log: Path) -> str:
    """The last line of pip's that fits."""
    text = log.read_text(errors="replace")
    found = [line for line in text.splitlines() if re.search(pattern, line)]
    return printable(found[-1].strip()) if found else "pip has said nothing yet"


def printable(line: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in line)[:120]


def pip_reason(code: int, log: Path) -> str:
    """Why pip failed, in words, and where all of its own words lie."""
    text = log.read_text(errors="replace")
    where = f"all that pip said is in {log}"
    if code < 0:
        return f"it was ended by signal {-code}, start again ({where})"
    for pattern, meaning in PIP_REASONS:
        if found := re.search(pattern, text):
            named = (group or "a package" for group in found.groups())
            return f"{meaning.format(*named)} ({where})"
    return f"{pip_said('^ERROR:', log).removeprefix('ERROR: ').rstrip('.')} ({where})"


# What editors see.  Running, shapeshift/__init__.py finds the folders beside it; an editor or a
# type checker runs nothing, and reads stubs (PEP 561): shapeshift-stubs/renderer/renderer.pyi in
# .venv says `from renderer.renderer import *`, which leads to the file in the checkout itself, so
# that each definition is one.  No program imports a name with a hyphen.


def write_stubs() -> None:
    """Bring .venv's stubs to what the checkout has; only what changed is written."""
    for site in [*VENV.glob("lib/python*/site-packages"), *VENV.glob("Lib/site-packages")][:1]:
        folder = site / "shapeshift-stubs"
        try:
            texts = stub_texts()
            for old in sorted(folder.rglob("*.py*")):
                if old.relative_to(folder).as_posix() not in texts:
                    old.unlink(missing_ok=True)  # another start does the same
            for name, text in texts.items():
                stub = folder / name
                if not stub.exists() or stub.read_text(encoding="utf-8") != text:
                    stub.parent.mkdir(parents=True, exist_ok=True)
                    stub.write_text(text, encoding="utf-8")
        except (OSError, ValueError, KeyError) as error:  # the program starts without them
            say(f"Editors will not follow imports: {error}.")


def stub_texts() -> dict[str, str]:
    """Path below shapeshift-stubs -> text, for all modules that do not lie in shapeshift/."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders = set(project["tool"]["setuptools"]["package-dir"].values()) - {"shapeshift"}
    face = ROOT / "shapeshift" / "__init__.pyi"
    # Some read no other face beside this one; all that is typed may lead to what is no stub.
    texts = {face.name: face.read_text(encoding="utf-8"), "py.typed": ""}
    for path in sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        name = path.relative_to(ROOT).with_suffix("")
        module = ".".join(name.parts).removesuffix(".__init__")
        own = re.findall(  # of the module, which a star leaves out
            r"^(?:(?:async )?def |class )?(_[a-zA-Z]\w*)(?=[(:]| = )",
            path.read_text(encoding="utf-8"), re.M,
        )  # fmt: skip
        lines = [f"from {module} import *"]
        lines += [f"from {module} import {one} as {one}" for one in sorted(set(own))]
        texts[f"{name.as_posix()}.pyi"] = "\n".join(lines) + "\n"
    return texts
