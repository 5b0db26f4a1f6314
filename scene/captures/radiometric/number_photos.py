"""Photos that are numbers and no picture: grids in .npy and CSV files, and FLIR's radiometric JPEG.

A radiometric JPEG (R-JPEG) is a picture for people with the camera's own numbers in APP1 segments
that begin with "FLIR": records of a directory "FFF", one with the raw numbers, one with what makes
temperatures of them by Planck's law.  flyr (EUPL 1.2, an optional extra) knows them; it works
behind the gate, flir_run.py.
"""

import math
import re
import struct
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.files.npy import BAD_HEADER
from shapeshift.runtime_models.files.plain_text import path_end
from shapeshift.runtime_models.gate.gate import ask
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.program import install_words
from shapeshift.scene.captures.radiometric.dji_photo import ADVICE, converter, dji_celsius, is_dji
from shapeshift.scene.captures.radiometric.no_value import resized_numbers

GRIDS = (".npy", ".csv")
JPEGS = (".jpg", ".jpeg", ".jfif")
MOST_NUMBERS = 1 << 24  # the largest thermal cameras have a million
NUMBER = 12  # bytes of memory a number of a grid
RAW = 40  # the same of a radiometric JPEG
TEXT = 40  # bytes of memory a letter of a CSV file, while it is split
MOST_BYTES = 1 << 26  # of a CSV or a radiometric JPEG
# Words that programs write into a cell where nothing was measured, in small letters.
NO_NUMBER = frozenset(
    ("", "-", "--", "---", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "nodata", "no data")
)
# And forms of such words: errors of spreadsheets in any language (#VALUE!, #DIV/0!, #¿NOMBRE?,
# #N/D, Err:502), what Microsoft's C writes for NaN and Inf (1.#QNAN, -1.#IND00, -nan(ind)), what
# lies beyond a camera's range (>150), and signs that fill a cell.
NO_NUMBER_FORM = re.compile(
    r"#[¡¿]?[^\W\d_][^\W_/]*(/0)?[!?]|#[^\W\d_]/[^\W\d_]!?|#nv|err(or)?:\d+"
    r"|[+-]?1[.,]#(qnan|snan|ind|inf)\d*|[+-]?nan(\([\w# ]*\))?|[+-]?∞"
    r"|n\.? ?[ad]\.?|[<>]=? ?[+-]?\d+([.,]\d+)?|-[-. ]*|\*+|#+|\?+"
)
HEAD_LINES = 20  # of words that programs write before a grid
FLIR = re.compile(rb"\xff\xe1..FLIR\x00", re.DOTALL)  # where such a segment begins
# Of FLIR's segments and of the directory in them; ExifTool documents both.
FLIR_HEAD, MOST_RECORDS, CAMERA_INFO = 8, 256, 32
SATURATED = 168  # bytes into the record of the camera: its largest temperature, then its smallest
LOOKED_AT = 1 << 16  # bytes of a JPEG: the first segment begins before
PNG_SIZE = re.compile(rb"\x89PNG\r\n\x1a\n....IHDR(....)(....)", re.DOTALL)
ASPECT = 0.02  # by how much the numbers may be wider or narrower than their picture


def open_grid(path: Path) -> Image.Image:
    """The numbers of a .npy or CSV file as a picture of mode F.  Raises BadFile, FileNotFoundError.

    NaN stays: nothing was measured there.
    """
    values = _npy(path) if path.suffix.lower() == ".npy" else _csv(path)
    return Image.fromarray(np.array(values, np.float32))


def _npy(path: Path) -> np.ndarray:
    try:
        values = np.load(path, mmap_mode="r", allow_pickle=False)
    except FileNotFoundError:
        raise
    except (ValueError, OSError, OverflowError, EOFError, *BAD_HEADER):
        raise BadFile(f"{path_end(path)}: no .npy of plain numbers; save it again") from None
    is_grid = isinstance(values, np.ndarray) and values.ndim == 2 and values.dtype.kind in "fui"
    if not is_grid or not 0 < values.size <= MOST_NUMBERS:
        raise BadFile(
            f"{path_end(path)}: {getattr(values, 'shape', '?')!s:.40} of "
            f"{getattr(values, 'dtype', '?')!s:.20}; a photo is (rows, columns) of numbers"
        )
    Memory().of(path).charge(NUMBER * values.size, f"{values.size:,} numbers")
    return values


def _csv(path: Path) -> np.ndarray:
    """Lines of numbers between commas, semicolons or tabs; with semicolons or tabs a comma is a
    decimal point.  Lines of words before them are left out.  Cells without a number are NaN.
    """
    where, size = path_end(path), path.stat().st_size
    if not 0 < size <= MOST_BYTES:
        raise BadFile(f"{where}: {size:,} bytes; a grid of numbers has 1 to {MOST_BYTES:,}")
    Memory().of(path).charge(TEXT * size, f"{size:,} letters")
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    rows: list[np.ndarray] = []
    lines: list[int] = []
    used: list[int] = []  # cells of each row up to the last one that is not blank
    words, head = False, (0, "")
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip(" \r"):
            continue
        row, filled = _row(line)
        if not any(used) and filled == 1 == len(_cells(line)) and _is_no_number(line):
            row = None  # a line of **** or ---- in the head
        if row is None and not any(used) and number <= HEAD_LINES:
            rows, lines, used, words, head = [], [], [], True, (number, line)
            continue
        if row is None:
            raise _no_numbers(where, number, line)
        if filled or not words or any(used):  # blanks between words and numbers are no row
            rows.append(row)
            lines.append(number)
            used.append(filled)
    width = _width([len(row) for row in rows], used)
    cells = _cells(head[1])
    if width == len(cells) < 2 * sum(map(_is_number, cells)) and _is_number(cells[0]):
        raise _no_numbers(where, *head)  # a row of the grid, and no head as "y,1,2,3" is one
    for row, number in zip(rows, lines, strict=True):
        if len(row) < width:
            raise BadFile(f"{where}: line {number} is not {width} numbers; save the grid again")
    if len(rows) < 2 or width < 2:
        raise BadFile(f"{where}: no grid of numbers; lines of numbers with commas are wanted")
    return np.stack([row[:width] for row in rows])


def _width(cells: list[int], used: list[int]) -> int:
    """Columns of a grid whose rows have so many cells, the last ones perhaps blank.

    One blank column at the end is what programs leave that write a comma after every number; more
    of them, in all rows alike, are pixels without a value.
    """
    widest = max(used, default=0)
    return cells[0] if len(set(cells)) == 1 and cells[0] > widest + 1 else widest


def _row(line: str) -> tuple[np.ndarray | None, int]:
    """The numbers of a line, NaN where a cell has none, and how many cells there are up to the last
    that is not blank; None: there are other words.
    """
    cells = _cells(line)
    filled = max((i for i, cell in enumerate(cells, 1) if cell), default=0)
    try:
        return np.array([math.nan if c.lower() in NO_NUMBER else float(c) for c in cells]), filled
    except ValueError:
        pass
    try:
        return np.array([math.nan if _is_no_number(c) else float(c) for c in cells]), filled
    except ValueError:
        return None, filled


def _no_numbers(where: str, number: int, line: str) -> BadFile:
    strange = next((c for c in _cells(line) if not (_is_number(c) or _is_no_number(c))), "")
    return BadFile(
        f"{where}: line {number} is not numbers between commas, it holds {strange[:40]!r}; save it "
        "again, or leave a cell empty where nothing was measured"
    )


def _cells(line: str) -> list[str]:
    between = next((sign for sign in ";\t" if sign in line), ",")
    line = line.replace(",", ".") if between != "," else line
    return [cell.strip() for cell in line.split(between)]


def _is_no_number(cell: str) -> bool:
    """Whether a cell says that nothing was measured."""
    word = cell.strip("\"' ").lower()
    return word in NO_NUMBER or NO_NUMBER_FORM.fullmatch(word) is not None


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def is_radiometric(path: Path) -> bool:
    """Whether a file is a JPEG with a FLIR or DJI camera's own numbers."""
    return _is_flir(path) or (path.suffix.lower() in JPEGS and is_dji(path))


def _is_flir(path: Path) -> bool:
    if path.suffix.lower() not in JPEGS:
        return False
    try:
        with path.open("rb") as file:
            return FLIR.search(file.read(LOOKED_AT)) is not None
    except OSError:
        return False


def cannot_read_radiometric(path: Path) -> str:
    """What is to be installed for the temperatures of such a photo; "": nothing."""
    if is_dji(path):
        return "" if converter() else ADVICE
    return "" if find_spec("flyr") is not None else f"for degrees: {install_words('thermal')}"


def radiometric_celsius(path: Path, size: tuple[int, int]) -> np.ndarray:
    """(H, W) float32 °C of a radiometric JPEG, in the size (W, H) of its picture.

    Emissivity, distance and air are those that the camera was set to.  Raises BadFile.
    """
    celsius = dji_celsius(path) if is_dji(path) else read_radiometric(path)[0]
    height, width = celsius.shape
    if not celsius.size:
        raise BadFile(f"{path_end(path)}: it has {width}x{height} thermal numbers; copy it again")
    if not abs(width * size[1] / (height * size[0]) - 1) <= ASPECT:
        raise BadFile(
            f"{path_end(path)}: {width}x{height} numbers in a picture of {size[0]}x{size[1]}; both "
            "must show the same field of view"
        )
    return celsius if (width, height) == size else resized_numbers(celsius, size)


def read_radiometric(path: Path) -> tuple[np.ndarray, dict[str, float]]:
    """(H, W) float32 °C of a radiometric JPEG as its camera was set, and to what, by flyr's names.

    Raises BadFile.
    """
    where = path_end(path)
    if is_dji(path):
        raise BadFile(f"{where}: a DJI camera's settings are not read; say them")
    if find_spec("flyr") is None:
        raise BadFile(
            f"{where}: a radiometric JPEG; {install_words('thermal')} installs what reads its "
            "temperatures"
        )
    data = path.read_bytes() if path.stat().st_size <= MOST_BYTES else b""
    sides = [
        [int.from_bytes(side, "big") for side in found.groups()]
        for found in PNG_SIZE.finditer(data)
    ]
    if not data or any(width * height > MOST_NUMBERS for width, height in sides):
        raise BadFile(f"{where}: more numbers than a thermal camera has; copy it again")
    most = max([len(data) // 2, *(width * height for width, height in sides)])
    Memory().of(path).charge(RAW * most, f"{most:,} numbers")
    low, high = saturation_kelvin(data)
    found = ask("thermal photo", path, [str(path.absolute()), low, high])
    return found["celsius"], found["settings"]


def saturation_kelvin(jpeg: bytes) -> tuple[float, float]:
    """Where a FLIR camera's numbers end, as its JPEG states; all temperatures where it does not.

    ExifTool's CameraTemperatureMinSaturated and CameraTemperatureMaxSaturated.
    """
    nothing, held, start = (-math.inf, math.inf), b"", 2
    while jpeg[start : start + 1] == b"\xff" and jpeg[start + 1 : start + 2] == b"\xe1":
        end = start + 2 + int.from_bytes(jpeg[start + 2 : start + 4], "big")
        segment, start = jpeg[start + 4 : end], max(end, start + 4)
        held += segment[FLIR_HEAD:] if segment.startswith(b"FLIR\0") else b""
    try:
        first, count = struct.unpack_from(">II", held, 24)
        for number in range(min(count, MOST_RECORDS)):
            kind, _, _, _, at = struct.unpack_from(">HHIII", held, first + 32 * number)
            if kind == CAMERA_INFO:
                order = ">" if held[at : at + 2] == b"\0\2" else "<"
                high, low = struct.unpack_from(f"{order}ff", held, at + SATURATED)
                return (low, high) if 0 < low < high < math.inf else nothing
    except struct.error:
        pass
    return nothing
