"""Which Python the locked packages come for: this one, another that is here, or none.

launch.py asks before anything is made.  Standard library alone, and no syntax that Python 3.6 does
not have; started by itself, this file prints what Python it is, see `describe`.
"""

import glob
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LOCKS = ("requirements.lock", "requirements-test.lock")
ANSWER_S = 20  # seconds that another Python has to say what it is
SYSTEMS = {"linux": "Linux", "win": "Windows", "macos": "macOS"}
OLDEST = {"linux": "glibc {} or newer", "macos": "macOS {} or newer"}


def describe():
    """What a lock is asked about: kind of Python, version, kind of machine, version of its system,
    and whether environments can be made; five words.
    """
    kind = sys.implementation.name
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        kind += "-free-threaded"  # wheels for it are others
    machine, system = platform.machine(), "-"
    if os.name == "nt":
        place = sysconfig.get_platform()  # win-amd64; of the Python, not of the machine
    elif sys.platform == "darwin":
        place, system = "macos-" + machine, platform.mac_ver()[0] or "-"
    else:
        library, version = platform.libc_ver()
        place = sys.platform + "-" + machine + ("" if sys.maxsize > 2**32 else "-32-bit")
        if sys.platform.startswith("linux") and library != "glibc":
            place += "-without-glibc"
        else:
            system = version or "-"
    return [kind, "%d.%d" % sys.version_info[:2], place, system, has_ensurepip()]


def has_ensurepip():
    """Debian ships it apart from Python."""
    try:
        import ensurepip  # noqa: F401
    except ImportError:
        return "no-venv"
    return "venv"


def read_fits(testing):
    """Kind of machine -> (oldest version of its system, Pythons), as the locks in use have it."""
    found = []
    for name in LOCKS if testing else LOCKS[:1]:
        with open(os.path.join(ROOT, name), encoding="utf-8") as lock:
            lines = re.findall(r"^# fits (\S+) ?([\d.]*): (.*)$", lock.read(), re.M)
        found.append({place: (oldest, pythons.split()) for place, oldest, pythons in lines})
    fits = {}
    for place in found[0]:
        if all(place in each for each in found):
            oldest = max((each[place][0] for each in found), key=numbers)
            in_all = [p for p in found[0][place][1] if all(p in each[place][1] for each in found)]
            fits[place] = (oldest, in_all)
    return fits


def numbers(version):
    """To compare versions by."""
    return [int(part) for part in re.findall(r"\d+", version)]


def fits_here(described, fits):
    """Whether the locked packages come for a Python that is described."""
    kind, version, place, system, _ = described
    oldest, pythons = fits.get(place, ("", []))
    old = numbers(system) < numbers(oldest) if system != "-" else False
    return kind == "cpython" and version in pythons and not old


def candidates(pythons):
    """Commands that may start one of these, the newest version first."""
    for version in sorted(pythons, key=numbers, reverse=True):
        if os.name == "nt":
            yield ["py", "-" + version]
            short = "Python" + version.replace(".", "")
            for top in ("LOCALAPPDATA", "PROGRAMFILES"):
                parts = ["Programs", "Python"] if top == "LOCALAPPDATA" else []
                yield [os.path.join(os.environ.get(top, "C:\\"), *parts + [short, "python.exe"])]
        name = "python" + version + (".exe" if os.name == "nt" else "")
        yield [os.path.join(os.path.dirname(os.path.realpath(sys.executable)), name)]
        if shutil.which(name):
            yield [shutil.which(name)]
        for pattern in version_folders(version):
            for path in sorted(glob.glob(pattern), key=numbers, reverse=True):
                yield [path]


def version_folders(version):
    """Where programs that bring Pythons keep them: pyenv and uv, and macOS its frameworks."""
    home = os.path.expanduser("~")
    pyenv = os.environ.get("PYENV_ROOT") or os.path.join(home, ".pyenv")
    data = os.environ.get("XDG_DATA_HOME") or os.path.join(home, ".local", "share")
    windows_data = os.path.join(os.environ.get("APPDATA", home), "uv", "python")
    if os.name == "nt":
        folders = [(pyenv, "pyenv-win", "versions", version + ".*"),
                   (pyenv, "versions", version + ".*"),
                   (windows_data, "cpython-" + version + ".*")]  # fmt: skip
        return [os.path.join(*parts + ("python.exe",)) for parts in folders]
    folders = [(pyenv, "versions", version + ".*"),
               (data, "uv", "python", "cpython-" + version + ".*"),
               ("/Library/Frameworks/Python.framework/Versions", version),
               ("/opt/homebrew", ), ("/usr/local", )]  # fmt: skip
    return [os.path.join(*parts + ("bin", "python" + version)) for parts in folders]


def ask(command):
    """(path, description) of the Python that a command starts; None: it starts none."""
    if os.path.isabs(command[0]) and not os.path.exists(command[0]):
        return None
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    environment["PYTHON_MANAGER_AUTOMATIC_INSTALL"] = "false"  # of Windows' py: only what is here
    try:
        said = subprocess.run(
            command + ["-I", os.path.abspath(__file__)], env=environment, cwd=ROOT,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            timeout=ANSWER_S, check=True,
        ).stdout.decode(errors="replace")  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    lines = said.splitlines()
    return (lines[0], lines[1].split()) if len(lines) == 2 and len(lines[1].split()) == 5 else None


def another_python(fits):
    """The path of the newest Python here that fits, first of those that can make environments."""
    second = None
    for command in candidates({p for _, pythons in fits.values() for p in pythons}):
        answer = ask(command)
        if answer is None or not fits_here(answer[1], fits):
            continue
        if answer[1][4] == "venv":
            return answer[0]
        second = second or answer[0]
    return second


def why_none(described, fits):
    """One sentence for a machine on which nothing fits."""
    kind, version, place, system, _ = described
    oldest, pythons = fits.get(place, ("", []))
    if not pythons:
        offered = ", ".join(sorted(named(each) for each in fits))
        return ("Shapeshift's packages come for %s, and this Python is one for %s; start it with a "
                "Python for one of those." % (offered, named(place)))  # fmt: skip
    if system != "-" and numbers(system) < numbers(oldest):
        wanted = OLDEST[place.split("-")[0]].format(oldest)
        return "Shapeshift's packages need %s, this system has %s; take a newer system." % (
            wanted, system)  # fmt: skip
    first, last = (pick(pythons, key=numbers) for pick in (min, max))
    this = version if kind == "cpython" else "%s %s" % (kind, version)
    start = "`py -%s launch.py`" % last if os.name == "nt" else "`python%s launch.py`" % last
    return ("Shapeshift needs Python %s to %s, this is %s, and no other was found here; install "
            "Python %s beside it and start %s." % (first, last, this, last, start))  # fmt: skip


def named(place):
    """linux-x86_64 as people write it."""
    system, _, machine = place.partition("-")
    system = SYSTEMS[system] if system in SYSTEMS else system
    return (system + " " + machine.replace("amd64", "x86-64")).strip()


def choose_python(testing):
    """None: this Python fits; else the path of another that does.  ValueError, a sentence: none."""
    fits, described = read_fits(testing), describe()
    if fits_here(described, fits):
        return None
    other = another_python(fits)
    if other is None:
        raise ValueError(why_none(described, fits))
    return other


if __name__ == "__main__":
    print(sys.executable)
    print(" ".join(describe()))
