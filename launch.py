#!/usr/bin/env python3
"""The one door to Shapeshift: `python3 launch.py [command] ...`.

Uses the standard library alone.  On first use it makes the environment in .venv (and, as root on
Debian or Ubuntu, installs the few system libraries); later starts go straight to app/cli.py.
`python3 launch.py` opens the viewer, `python3 launch.py test` runs the tests, `--help` lists all.
"""

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
WINDOWS = os.name == "nt"
PYTHON = VENV / ("Scripts/python.exe" if WINDOWS else "bin/python")
OLDEST_PYTHON = (3, 11)

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
# Answered without the environment, by whatever Python started this.
ASKING = ("-h", "--help", "help", "--version")
TEST_HELP = """usage: python3 launch.py test [file] [options of pytest]

Runs the tests; the first time it installs what they need into .venv.

  --slow                long trainings, large sweeps and sessions of a headset, too
  -k WORDS              only tests whose names have these words
  -x                    stop at the first that fails
  -q, -v                say less, say more
  --regenerate          make the golden pictures anew
  tests/test_cli.py     only the tests of a file

All others, once they are installed: .venv/bin/python -m pytest --help"""
OPENCL_PACKAGE = "pocl-opencl-icd"
OPENCL_WHEEL = "pocl-binary-distribution==3.0"  # Linux x86-64 only, half as fast as Debian's


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def stop(text: str) -> None:
    say(text)
    raise SystemExit(2)


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
    quiet = {
        "stdout": subprocess.DEVNULL,
        "env": {**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
    }
    subprocess.run(["apt-get", "update", "-qq"], check=False, **quiet)
    if subprocess.run(line.split(), check=False, **quiet).returncode != 0:
        say(f"apt-get could not install them all; to see why, run: {line}")


def requirement_files(testing: bool) -> list[Path]:
    names = ["requirements.txt"] + (["requirements-test.txt"] if testing else [])
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
    stamp = stamp_file(testing)
    return PYTHON.exists() and stamp.exists() and stamp.read_text() == digest(testing)


def make_environment(testing: bool) -> None:
    """Make .venv with the pinned requirements, unless it is there already."""
    if is_ready(testing):
        return
    if missing := missing_packages(testing):
        install_packages(missing)
    if not PYTHON.exists():
        say("First start: making the Python environment in .venv")
        if subprocess.run([sys.executable, "-m", "venv", str(VENV)], check=False).returncode != 0:
            stop(
                "Python could not make a virtual environment; install its venv module "
                f"(Debian: apt-get install python{sys.version_info[0]}.{sys.version_info[1]}-venv)."
            )
    say("Installing the Python packages (once, about a minute)")
    install = [str(PYTHON), "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    wanted = [word for f in requirement_files(testing) for word in ("-r", str(f))]
    if not has_opencl() and sys.platform == "linux" and platform.machine() == "x86_64":
        say("No system OpenCL driver: using the slower one from the package index.")
        wanted.append(OPENCL_WHEEL)
    if subprocess.run(install + wanted, check=False).returncode != 0:
        stop(
            "pip could not install the requirements (see above); check the network and start again."
        )
    for level in {False, testing}:
        stamp_file(level).write_text(digest(level))


def hand_over(arguments: list[str], python: Path = PYTHON) -> int:
    """Run in the environment; on POSIX this process becomes the program, so signals reach it."""
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [str(ROOT)] + [p for p in [os.environ.get("PYTHONPATH")] if p]
    )
    command = [str(python), *arguments]
    if not WINDOWS:
        os.execv(command[0], command)
    child = subprocess.Popen(command)
    while True:
        try:
            return child.wait()
        except KeyboardInterrupt:
            continue  # the child has it too and decides


def main(arguments: list[str]) -> int:
    if sys.version_info < OLDEST_PYTHON:
        found = ".".join(map(str, sys.version_info[:3]))
        stop(f"Shapeshift needs Python 3.11 or newer, this is {found}; start it with that.")
    testing = arguments[:1] == ["test"]
    if testing and set(arguments[1:]) & {"-h", "--help"}:
        print(TEST_HELP)
        return 0
    if arguments and arguments[0] in ASKING and len(arguments) == 1:
        return hand_over(["-m", "app.cli", *arguments], Path(sys.executable))
    try:
        make_environment(testing)
    except KeyboardInterrupt:
        stop("Interrupted; the set-up continues at the next start.")
    if testing:
        os.chdir(ROOT)
        return hand_over(["-m", "pytest", *arguments[1:]])
    return hand_over(["-m", "app.cli", *arguments])


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
