"""Lines of COLMAP's text tables, whoever wrote them: any line ends, byte order mark, code page."""

import codecs
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import read_text_file
from shapeshift.runtime_models.model import BadFile

LONGEST_NAME = 4096  # bytes of an image's name
AGAIN = "copy or export it again"
WIDE = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
POSE_WORDS = 9  # of a line of images.txt before the name: a number, a pose, a camera
NUMERIC = b"0123456789.+-eE \t"  # of what a line of points consists; nan and inf are looked at
UNIT = 1e-2  # by which a quaternion's length may differ from 1, where nothing else tells


def lines_of(path: Path) -> list[bytes]:
    """Its lines in UTF-8, or in the code page that they are in.  Raises BadFile."""
    data = read_text_file(path)
    wide = WIDE.get(data[:2])
    if wide is None and len(data) > 3 and not any(data[1:64:2]):
        wide = "utf-16-le"  # as Windows writes it, without its mark
    if wide is not None:
        try:
            data = data.decode(wide).encode()
        except UnicodeError:
            raise not_text(path) from None
    if b"\0" in data:
        raise not_text(path)
    return data.removeprefix(codecs.BOM_UTF8).splitlines()  # of bytes: at \n, \r and \r\n alone


def not_text(path: Path) -> BadFile:
    return BadFile(f"{path} is not text, whatever its name says; {AGAIN}.")


def rows_of_table(path: Path) -> Iterator[tuple[str, list[bytes]]]:
    """Where each line that is neither empty nor a comment stands, for messages, and its words."""
    for line, text in enumerate(lines_of(path), 1):
        words = text.split()
        if words and not words[0].startswith(b"#"):
            yield f"{path}, line {line}", words


def image_rows(path: Path) -> Iterator[tuple[list[float], bytes]]:
    """Nine numbers and the name of each image in images.txt.

    COLMAP writes two lines an image, the second, of its points, often empty.  Empty lines get lost
    and doubled on the way, so that each line is told by what it holds.  Raises BadFile.
    """
    points_next = False  # whether the last image's may still come
    for line, text in enumerate(lines_of(path), 1):
        words = text.split(maxsplit=POSE_WORDS)
        if not words or words[0].startswith(b"#"):
            continue
        if points_next and is_points(words):
            points_next = False
            continue
        if len(words) <= POSE_WORDS or len(words[POSE_WORDS]) > LONGEST_NAME:
            raise BadFile(f"{path}, line {line}: 9 numbers and a name wanted; {AGAIN}.")
        yield numbers_of(words[:POSE_WORDS], f"{path}, line {line}"), words[POSE_WORDS].rstrip()
        points_next = True


def is_points(words: list[bytes]) -> bool:
    """Whether a line, split at most POSE_WORDS times, is one of points: x, y and a number each.

    An image whose name is numbers looks like that, too, but for the length of its quaternion.
    """
    rest = words[POSE_WORDS] if len(words) > POSE_WORDS else b""
    if rest.translate(None, NUMERIC) and not all(map(is_number, rest.split())):
        return False
    if not all(map(is_number, words[:POSE_WORDS])):
        return False
    if len(words) < POSE_WORDS:
        return len(words) % 3 == 0
    pose_like = words[0].isdigit() and words[8].isdigit()
    return not (pose_like and abs(math.hypot(*map(float, words[1:5])) - 1) <= UNIT)


def is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def numbers_of(words: list[bytes], where: str) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise BadFile(f"{where}: what should be numbers is not; {AGAIN}.")
    return values
