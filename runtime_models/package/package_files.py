"""The files of a package, out of a folder or a zip; sizes are checked before anything is read."""

import zipfile
from collections.abc import Callable
from pathlib import Path

from shapeshift.runtime_models.colors.light_harmonics import channels_of
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.files.zip_files import is_zip, opened_zip, read_member
from shapeshift.runtime_models.model import AnchorModel, BadFile

FORMAT = "shapeshift 1"
FRAMES_FORMAT = "shapeshift 2"  # the same, and anchors.npz holds the anchors' own frames
LIGHT_FORMAT = "shapeshift 3"  # and it holds their light by direction; frames or not
COLOR_LIGHT_FORMAT = "shapeshift 4"  # the same, of red, green and blue each
FORMATS = (FORMAT, FRAMES_FORMAT, LIGHT_FORMAT, COLOR_LIGHT_FORMAT)
LIT = {LIGHT_FORMAT: 1, COLOR_LIGHT_FORMAT: 3}  # channels of the anchors' light; of others none
MANIFEST = "scene.json"
ANCHORS = "anchors.npz"
LIGHT = "light"  # the array in it of the anchors' light, and the colour network's input
LABELS = "labels"  # the array in it that says which object each anchor is of
WHOLE = f"a package is {MANIFEST}, {ANCHORS} and five ONNX files"

LARGEST = {MANIFEST: 16 << 20, ANCHORS: 4 << 30}  # bytes, unpacked
LARGEST_NETWORK = 256 << 20  # bytes; five of 64 MB would draw one frame a minute


def format_name(model: AnchorModel) -> str:
    """What the manifest of its package names."""
    if model.light is not None:
        return LIGHT_FORMAT if channels_of(model.light) == LIT[LIGHT_FORMAT] else COLOR_LIGHT_FORMAT
    return FORMAT if model.frames is None else FRAMES_FORMAT


def open_package(path: Path, memory: Account) -> Callable[[str], bytes]:
    """read(name) -> bytes of one file of the package at `path`, charged.  Both raise BadFile."""
    if path.is_dir():
        return lambda name: read_from_folder(path, name, memory)
    if not is_zip(path):
        raise BadFile(f"{path} is not a package: it is no zip, or it is cut off; copy it again.")
    return lambda name: read_from_zip(path, name, memory)


def refuse_large(path: Path, name: str, size: int) -> None:
    limit = LARGEST.get(name, LARGEST_NETWORK)
    if size > limit:
        raise BadFile(f"{path}: {name} has {size:,} bytes, at most {limit:,} are read.")


def read_from_folder(path: Path, name: str, memory: Account) -> bytes:
    file = path / name
    if not file.is_file():
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    refuse_large(path, name, file.stat().st_size)
    memory.charge(file.stat().st_size, name)
    return file.read_bytes()


def read_from_zip(path: Path, name: str, memory: Account) -> bytes:
    """Nothing is unpacked to disk; the stated size bounds what is read, and the CRC is checked."""
    with opened_zip(path, str(path), memory) as archive:
        entry = find_entry(archive, path, name)
        refuse_large(path, name, entry.file_size)
        return read_member(archive, entry, str(path), memory)


def find_entry(archive: zipfile.ZipFile, path: Path, name: str) -> zipfile.ZipInfo:
    """At the top, or in the one folder that holds a manifest: zipping a folder keeps its name."""
    entries = archive.infolist()
    tops = {e.filename[: -len(MANIFEST)] for e in entries if e.filename.endswith(MANIFEST)}
    tops = {top for top in tops if top == "" or (top.count("/") == 1 and top.endswith("/"))}
    top = "" if "" in tops or len(tops) != 1 else tops.pop()
    found = [e for e in entries if e.filename == top + name]
    if not found:
        raise BadFile(f"{path} lacks {name}; {WHOLE}.")
    if len(found) > 1:
        raise BadFile(f"{path} holds {name} {len(found)} times; write it again.")
    return found[0]
