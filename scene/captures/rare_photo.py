"""Photos that Pillow does not decode in our own process: rarer formats, and JPEGs of many scans."""

import re
from pathlib import Path

from PIL import Image, TiffImagePlugin, WebPImagePlugin  # noqa: F401  or all of them are loaded

from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.rare_photo_run import PACKINGS

MEGAPIXEL = 28 << 20  # bytes of memory a million pixels, in the process that decodes them
MOST_SCANS = 100  # of a JPEG: each goes over all of the picture; progressive ones have 10 or so
MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")  # in a JPEG, but for restarts
SCAN, END, BARE = 0xDA, 0xD9, (0xD8, 0x01)  # markers; BARE: without a length behind it
HEAD = 1 << 16  # bytes in which the first scan of most JPEGs begins


def is_rare(image: Image.Image) -> bool:
    """Whether an opened image is to be decoded behind the gate: a TIFF that is packed oddly."""
    return image.format == "TIFF" and image.info.get("compression") not in PACKINGS


def rare_photo(path: Path, most: int) -> tuple[Image.Image | None, tuple[int, int]]:
    """The image, decoded, and its size; None where it has more than `most` pixels.  BadFile."""
    memory = MEGAPIXEL * max(most >> 20, 8)
    told = ask("rare photo", path, [str(path.absolute()), most], memory=memory)
    width, height = told["size"]
    if "pixels" not in told:
        return None, (width, height)
    image = Image.frombytes(told["mode"], (width, height), told["pixels"])
    if told["palette"]:
        image.putpalette(told["palette"])
    for key in ("exif", "transparency"):
        if told[key] not in (None, b""):
            image.info[key] = told[key]
    image.format = told["format"]
    return image, (width, height)


def refuse_scans(image: Image.Image, path: Path) -> None:
    """Raises BadFile for a JPEG whose pixels are gone over more often than any camera's."""
    if image.format not in ("JPEG", "MPO"):
        return
    with path.open("rb") as file:
        if not image.info.get("progressive") and whole_first_scan(image, file.read(HEAD)):
            return  # its first scan holds all channels: further ones are not read
        file.seek(0)
        count = scans_of(file.read())
    if count > MOST_SCANS:
        raise BadFile(
            f"{path}: a JPEG of over {MOST_SCANS} scans, each over the whole picture; save it again"
        )


def whole_first_scan(image: Image.Image, head: bytes) -> bool:
    """Whether the first scan is there and holds all channels."""
    at = first_scan(head)
    return 0 < at and head[at + 2 : at + 3] == bytes([getattr(image, "layers", 0)])


def first_scan(data: bytes) -> int:
    """Where the length of the first scan's header stands; 0: nowhere."""
    at = 2
    while found := MARKER.search(data, at):
        at = found.end()
        if found[1][0] == SCAN:
            return at
        if found[1][0] not in BARE:
            at += int.from_bytes(data[at : at + 2], "big")
    return 0


def scans_of(data: bytes) -> int:
    """How many scans a JPEG has, of the first picture in it; one more than MOST_SCANS at most."""
    at, count = 2, 0
    while count <= MOST_SCANS and (found := MARKER.search(data, at)):
        at, kind = found.end(), found[1][0]
        if kind == END:
            break
        count += kind == SCAN
        if kind not in BARE:
            at += int.from_bytes(data[at : at + 2], "big")
    return count
