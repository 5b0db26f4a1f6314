"""Paths as people, desktops and shells hand them over: relative, file:// addresses, a leading ~."""

import os
import sys
import sysconfig
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from urllib.parse import unquote

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models import program

SCHEME = "file:"
ASSETS = Path(__file__).resolve().parents[1] / "assets"  # what the program brought along
DEMO = ASSETS / "workshop.shift"  # as it was trained, in one piece
TOUCH = ASSETS / "demo.scene.json"  # the same with things that were cut out of it
LONGEST_NAME = 100  # letters, of a file that is named after an object
MAC_DATA = "~/Library/Application Support"
STANDARD_STREAM = "-"  # stands for one where a file is wanted
# Settings of libraries that people give as paths.
PATHS_IN_ENVIRONMENT = ("XR_RUNTIME_JSON", "OCL_ICD_VENDORS", "POCL_CACHE_DIR", "TMPDIR")


def plain_path(text: str, windows: bool = sys.platform == "win32") -> str:
    """The path that a text means; what is neither an address nor begins with ~ stays as it is."""
    if text.lower().startswith(SCHEME):
        rest = text[len(SCHEME) :]
        if rest.startswith("//"):  # file://host/path: of this machine, whatever it is called
            host, slash, path = rest[2:].partition("/")
            rest = slash + path if slash else host
        rest = unquote(rest)
        drive = rest[1:3]
        return rest[1:] if windows and len(drive) == 2 and drive[1] == ":" else rest
    if text == "~" or text.startswith(("~/", "~" + os.sep)):
        return os.path.expanduser(text)
    return text


def plain(path: str | os.PathLike[str]) -> Path:
    """The same as a Path that begins where the program was started.

    A Path of an address has lost one of its slashes.  Raises UsageError of what is no path.
    """
    text = os.fspath(path) if isinstance(path, str | os.PathLike) else None
    if not isinstance(text, str):
        raise UsageError(f"{path!r} is no path; a text or a pathlib.Path is wanted.")
    path, start = Path(plain_path(text)), program.started_in
    return path if start is None or str(path) == STANDARD_STREAM else start / path


def has_left() -> bool:
    """Whether the program is one of its own, which has left the folder that it was started in."""
    return program.started_in is not None


def leave_current_folder() -> None:
    """Makes the program's own folder the current one; plain() still begins in the one before.

    What lies in the current folder, perhaps one of downloads, is data and no part of the program.
    Libraries see that otherwise: linkers that OpenCL drivers call take libgcc_s.so.1 from there,
    matplotlib its settings, Windows DLLs, and other Pythons the modules that they import.
    """
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ.pop("PYTHONPATH", None)
    root = Path(__file__).resolve().parents[1]
    try:
        start = Path.cwd()
    except FileNotFoundError:  # deleted meanwhile: whatever is relative lies nowhere
        start = Path(os.sep, "a folder that was deleted")
    program.started_in = start
    if str(start) not in {str(root), *sysconfig.get_paths().values()}:
        sys.path[:] = [entry for entry in sys.path if entry not in ("", str(start))]
    for name in PATHS_IN_ENVIRONMENT:
        if given := os.environ.get(name):
            os.environ[name] = str(start / given) + os.sep * given.endswith(os.sep)
    os.chdir(root)


def begin_at_start(value):
    """The same with each Path in it, also in tuples and dataclasses, made plain()."""
    if isinstance(value, Path):
        return plain(value)
    if isinstance(value, tuple):
        return tuple(map(begin_at_start, value))
    if is_dataclass(value) and not isinstance(value, type):
        found = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
        return replace(value, **{name: begin_at_start(part) for name, part in found.items()})
    return value


def full(path: Path | str) -> str:
    """A path as it is shown to people: from the root, so that it is found from everywhere."""
    return os.path.abspath(plain(path))


def file_name(text: str) -> str:
    """A name that is a file's on every system, of one that people or files have given an object."""
    plain = "".join(c if c.isalnum() or c in " -_.,()+" else "_" for c in text)
    return plain.strip(" .")[:LONGEST_NAME] or "scene"


def what_replaced(argument: str) -> str:
    """What is said of a word of the command line that earlier programs knew; "": of all others."""
    if argument == "--touch":
        return "--touch is no longer an option: the demo, which opens without it, can be touched."
    path = plain(argument)
    if path.name not in ("touch.scene.json", "touch.jsonl") or not is_bundled(path):
        return ""
    return (
        f"{path.name} is no longer bundled: the demo, {TOUCH.name}, can be touched; that example "
        "of reactions lies in the folder examples of a checkout."
    )


def is_bundled(path: Path) -> bool:
    """Whether it lies in what the program brought along, also by a link."""
    return path.resolve().is_relative_to(ASSETS.resolve())


@dataclass(frozen=True)
class WorkFolders:
    """Where what a person makes goes: absolute, and not there before something is written."""

    pictures: Path
    scenes: Path
    exports: Path

    @staticmethod
    def of(pictures: Path | None = None) -> "WorkFolders":
        """All next to the pictures; without these in Shapeshift, in the person's documents."""
        if pictures is None:
            import platformdirs

            pictures = platformdirs.user_documents_path() / "Shapeshift" / "pictures"
        pictures = pictures.absolute()
        return WorkFolders(pictures, pictures.parent / "scenes", pictures.parent / "exports")


def data_folder(environment: dict[str, str] | None = None, platform: str = sys.platform) -> Path:
    """Where this platform keeps a program's own data; the folder need not be there.

    XDG_DATA_HOME or ~/.local/share on Linux, %APPDATA% on Windows, ~/Library on macOS.
    """
    names = {"win32": ("APPDATA", "~/AppData/Roaming"), "darwin": ("", MAC_DATA)}
    name, usual = names.get(platform, ("XDG_DATA_HOME", "~/.local/share"))
    base = (dict(os.environ) if environment is None else environment).get(name, "")
    return Path(base if os.path.isabs(base) else os.path.expanduser(usual)) / "shapeshift"


def config_folder(environment: dict[str, str] | None = None, platform: str = sys.platform) -> Path:
    """Where this platform keeps settings of a program; the folder need not be there.

    XDG_CONFIG_HOME or ~/.config on Linux, %APPDATA% on Windows, ~/Library on macOS.
    """
    environment = dict(os.environ) if environment is None else environment
    if platform == "win32":
        base = environment.get("APPDATA") or os.path.expanduser("~/AppData/Roaming")
    elif platform == "darwin":
        base = os.path.expanduser(MAC_DATA)
    else:
        base = environment.get("XDG_CONFIG_HOME", "")
        if not os.path.isabs(base):  # the XDG rule: a relative one counts as unset
            base = os.path.expanduser("~/.config")
    return Path(base) / "shapeshift"
