"""Paths as desktops and shells hand them over: file:// addresses, a leading ~."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

SCHEME = "file:"
ASSETS = Path(__file__).resolve().parents[1] / "assets"  # what the program brought along
DEMO, TOUCH = ASSETS / "workshop.shift", ASSETS / "touch.scene.json"
LONGEST_NAME = 100  # letters, of a file that is named after a thing


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


def plain(path: Path | str) -> Path:
    """The same as a Path; a Path of an address has lost one of its slashes."""
    return Path(plain_path(str(path)))


def full(path: Path | str) -> str:
    """A path as it is told to people: from the root, so that it is found from everywhere."""
    return os.path.abspath(plain(path))


def file_name(text: str) -> str:
    """A name that is a file's on every system, of one that people or files have given a thing."""
    plain = "".join(c if c.isalnum() or c in " -_.,()+" else "_" for c in text)
    return plain.strip(" .")[:LONGEST_NAME] or "scene"


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
        """All beside the pictures; without these in Shapeshift, in the person's documents."""
        if pictures is None:
            import platformdirs

            pictures = platformdirs.user_documents_path() / "Shapeshift" / "pictures"
        pictures = pictures.absolute()
        return WorkFolders(pictures, pictures.parent / "scenes", pictures.parent / "exports")


def config_folder(environment: dict[str, str] | None = None, platform: str = sys.platform) -> Path:
    """Where this platform keeps settings of a program; the folder need not be there.

    XDG_CONFIG_HOME or ~/.config on Linux, %APPDATA% on Windows, ~/Library on macOS.
    """
    environment = dict(os.environ) if environment is None else environment
    if platform == "win32":
        base = environment.get("APPDATA") or os.path.expanduser("~/AppData/Roaming")
    elif platform == "darwin":
        base = os.path.expanduser("~/Library/Application Support")
    else:
        base = environment.get("XDG_CONFIG_HOME", "")
        if not os.path.isabs(base):  # the XDG rule: a relative one counts as unset
            base = os.path.expanduser("~/.config")
    return Path(base) / "shapeshift"
