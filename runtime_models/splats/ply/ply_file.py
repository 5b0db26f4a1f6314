"""What a PLY file says of itself, checked against its size before anything of it is read."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.shapes import column_names
from shapeshift.runtime_models.splats.plain_splats import COLMAP_UP, RawSplats

TYPES = {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8", "uchar": "u1",
         "uint8": "u1", "char": "i1", "int8": "i1", "short": "i2", "int16": "i2", "ushort": "u2",
         "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"}  # fmt: skip
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "="}
DIGITS = re.compile(r"\d{1,15}", re.ASCII)
LARGEST_HEADER = 1 << 16  # bytes
VERTICAL = re.compile(r"vertical axis\b\s*[:=]?\s*(.*)", re.IGNORECASE)  # of nerfstudio
AXIS = re.compile(r"[+-]?[XYZ]")


@dataclass(frozen=True)
class Element:
    """One table of the file: `element vertex 20` and its properties."""

    name: str
    count: int
    row: np.dtype | None  # a field a property; None where a property is a list or unknown

    @property
    def layout(self) -> np.dtype:
        """The same of a table that has fields alone, as PlyHeader.find gives it."""
        assert self.row is not None
        return self.row

    def require(self, needed: tuple[str, ...], file: str) -> None:
        """Raises BadFile where a column is missing."""
        missing = [name for name in needed if name not in column_names(self.layout)]
        if missing:
            raise BadFile(
                f"{file} has no {missing[0]}: a point cloud or another format, not 3DGS splats; "
                "export it as a 3DGS PLY."
            )


@dataclass(frozen=True)
class PlyHeader:
    file: str  # for messages
    encoding: str  # one of ORDERS
    comments: tuple[str, ...]  # the texts of `comment` and `obj_info` lines
    elements: tuple[Element, ...]
    start: int  # bytes of the header
    size: int  # bytes of the file

    def find(self, name: str) -> tuple[Element, int]:
        """An element and the byte of the file where it begins; all its bytes are there.

        Raises BadFile where it is not, has lists, or comes after an element with lists; of an
        ASCII file, where it is not the first.
        """
        begins = self.start
        for element in self.elements:
            if element.name == name:
                return self._whole(element, begins), begins
            if element.row is None or self.encoding == "ascii":
                break
            begins += element.count * element.row.itemsize
        raise BadFile(
            f"{self.file} has the elements {[e.name[:40] for e in self.elements[:9]]}, wanted is "
            f"{name!r}, before any with lists; export it as a 3DGS PLY."
        )

    def _whole(self, element: Element, begins: int) -> Element:
        if element.row is None:
            raise BadFile(f"{self.file} has a property of a type that splats do not have.")
        if element.count == 0:
            raise BadFile(f"{self.file} holds no splats; export it again.")
        # A number in ASCII has a digit and a space at least; the last one needs no space.
        least = (
            2 * len(column_names(element.row)) if self.encoding == "ascii" else element.row.itemsize
        )
        room = self.size - begins + (self.encoding == "ascii")
        if room < element.count * least:
            raise BadFile(
                f"{self.file}: the header promises {element.count} splats of {least} bytes, the "
                f"file holds {max(room, 0) // least}; it is cut off or its header is wrong."
            )
        return element


def put_vertical_axis(raw: RawSplats, header: PlyHeader) -> None:
    """Sets what is up as a comment says, `Vertical Axis: z`; nothing where none does.

    A comment that names no axis, or several that name different ones, are a finding.
    """
    found = [VERTICAL.fullmatch(comment) for comment in header.comments]
    said = list(dict.fromkeys(each[1].strip().upper() for each in found if each is not None))
    if not said:
        return
    axes = {axis if len(axis) == 2 else f"+{axis}" for axis in said if AXIS.fullmatch(axis)}
    if len(axes) == 1 and all(AXIS.fullmatch(axis) for axis in said):
        (raw.up,) = axes
        what = f"its comment says that {raw.up} is up"
        done = f"read so; --up={COLMAP_UP} reads it as 3DGS writes its files"
    else:
        what = f"its comments name no one vertical axis ({', '.join(said)[:60] or 'nothing'})"
        done = f"read with {raw.up} up; --up names another"
    raw.findings = (*raw.findings, Finding(what, 0, done, file=raw.file, repaired=False))


def read_header(path: Path) -> PlyHeader:
    """What a PLY file says of itself.  Raises BadFile."""
    with path.open("rb") as file:
        head = file.read(LARGEST_HEADER)
    end = head.find(b"end_header")
    start = head.find(b"\n", end) + 1  # after end_header and its \n or \r\n
    if not head.startswith(b"ply") or end < 0 or start == 0:
        raise BadFile(f"{path.name} is no PLY file: its header is missing or never ends.")
    lines = [line.split() for line in head[:end].decode("utf-8", "replace").splitlines()]
    forms = [line[1] for line in lines if line[:1] == ["format"] and line[2:] == ["1.0"]]
    if len(forms) != 1 or forms[0] not in ORDERS:
        raise BadFile(f"{path.name} names none of PLY's formats: {', '.join(ORDERS)}, each 1.0.")
    return PlyHeader(
        path.name,
        forms[0],
        tuple(" ".join(line[1:]) for line in lines if line[:1] in (["comment"], ["obj_info"])),
        elements_of(lines, ORDERS[forms[0]], path.name),
        start,
        path.stat().st_size,
    )


def elements_of(lines: list[list[str]], order: str, file: str) -> tuple[Element, ...]:
    """The tables that the header's lines name, in their order."""
    found: list[tuple[str, int, list[list[str]]]] = []
    for line in lines:
        if line[:1] == ["element"]:
            if len(line) != 3 or not DIGITS.fullmatch(line[2]):
                raise BadFile(f"{file} does not say how many of an element there are.")
            if line[1] in [name for name, _, _ in found]:
                raise BadFile(f"{file} has the element {line[1][:40]!r} twice.")
            found.append((line[1], int(line[2]), []))
        elif line[:1] == ["property"]:
            if not found:
                raise BadFile(f"{file} has a property before any element; its header is wrong.")
            found[-1][2].append(line[1:])
    return tuple(Element(name, count, row_of(fields, order, file)) for name, count, fields in found)


def row_of(fields: list[list[str]], order: str, file: str) -> np.dtype | None:
    """The record of properties given as [type, name]; None where one is a list or unknown."""
    if any(len(field) != 2 or field[0] not in TYPES for field in fields):
        return None
    names = [name for _, name in fields]
    if len(set(names)) != len(names):
        raise BadFile(f"{file} names a property twice.")
    return np.dtype([(name, order + TYPES[kind]) for kind, name in fields])
