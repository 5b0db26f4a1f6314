"""INRIA's 3DGS PLY to plain splats, block by block: the file is never in memory as a whole."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import RawIOBase
from pathlib import Path
from typing import BinaryIO

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0, COEFFICIENTS
from shapeshift.runtime_models.files.blocks import block_of, each_block
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.lint.lint_rows import UNSEEN, row_findings
from shapeshift.runtime_models.lint.lint_whole import LARGEST_SCENE, MIN_ALPHA
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.shapes import column_names, column_offset
from shapeshift.runtime_models.splats.moving_splats import with_motion_columns
from shapeshift.runtime_models.splats.plain_splats import (
    RawSplats,
    Reading,
    empty_splats,
    fourth_degree,
)
from shapeshift.runtime_models.splats.ply.ply_file import (
    Element,
    PlyHeader,
    put_vertical_axis,
    read_header,
)

PLACE = ("x", "y", "z")
SCALES = ("scale_0", "scale_1", "scale_2")
QUATERNION = ("rot_0", "rot_1", "rot_2", "rot_3")
DIRECT = ("f_dc_0", "f_dc_1", "f_dc_2")
RGB = ("red", "green", "blue")  # where there is no DIRECT
SHAPES = (*PLACE, "opacity", *SCALES[:2], *QUATERNION)  # without scale_2: discs
GEOMETRY = (*SHAPES, *DIRECT)
NORMAL = ("nx", "ny", "nz")  # written by habit, all zero
FLAT = 1e-3  # a disc's third scale, of the smaller of its two: thinner than any pixel shows
FOURTH = 25  # coefficients of SH degree 4
TEXT = 1 << 20  # bytes of an ASCII file read at a time


def read_raw_ply(path: Path, reading: Reading) -> RawSplats:
    """Splats of a 3DGS PLY of SH degree 0 to 4, binary or ASCII; of 4, 3 is drawn.  BadFile."""
    header = read_header(path)
    vertex, begins = header.find("vertex")
    shades = shades_in(column_names(vertex.layout))
    vertex.require(SHAPES if shades else GEOMETRY, path.name)
    said = {name.rstrip(":=").lower(): value.lower() for name, value in sayings(header)}
    memory = reading.within(path).account
    splats = Columns(
        vertex, harmonics_of(column_names(vertex.layout), path.name), path.name, said, memory
    )
    if header.encoding == "ascii":
        read_text(path, begins, splats, reading)
    else:
        read_records(path, begins, splats, reading)
    splats.tell_left_out()
    put_vertical_axis(splats.raw, header)
    take_filter_3d(splats.raw)
    return with_motion_columns(splats.raw)


def shades_in(names: tuple[str, ...]) -> tuple[str, ...]:
    """The columns of the colours where there are no harmonics."""
    return () if set(DIRECT) & set(names) or not set(RGB) <= set(names) else RGB


def sayings(header: PlyHeader) -> Iterator[tuple[str, str]]:
    """The header's comments of two words: `antialiased 1`, `SplatRenderMode: mip`."""
    for comment in header.comments:
        if len(words := comment.split()) == 2:
            yield words[0], words[1]


def harmonics_of(names: tuple[str, ...], file: str) -> list[str]:
    """The columns of M x 3 coefficients, all channels of one coefficient together."""
    rest = [name for name in names if name.startswith("f_rest_")]
    count = len(rest) // 3 + 1
    if len(rest) % 3 or count not in (*COEFFICIENTS, FOURTH):
        raise BadFile(f"{file} has {len(rest)} f_rest columns, expected 0, 9, 24, 45 or 72.")
    if set(rest) != {f"f_rest_{i}" for i in range(len(rest))}:
        raise BadFile(f"{file}: its {len(rest)} f_rest columns are not numbered from 0 on.")
    # channel-major in the file: all of red, then green, then blue
    kept = min(count, COEFFICIENTS[-1])
    order = [f"f_rest_{c * (count - 1) + j}" for j in range(kept - 1) for c in range(3)]
    return [*DIRECT, *order]


def left_out_of(names: tuple[str, ...]) -> list[str]:
    """The columns of SH degree 4, where there are such."""
    rest = FOURTH - 1
    if f"f_rest_{3 * rest - 1}" not in names:
        return []
    least = COEFFICIENTS[-1] - 1
    return [f"f_rest_{c * rest + j}" for j in range(least, rest) for c in range(3)]


class Columns:
    """The arrays of a file's splats, filled by blocks of its records."""

    def __init__(
        self, vertex: Element, harmonics: list[str], file: str, said: dict, memory: Account
    ) -> None:
        names, kinds, n = column_names(vertex.layout), vertex.layout, vertex.count
        self.row = vertex.layout
        self.count = n
        self.plain = all(kinds[name] == np.dtype("<f4") for name in names)
        self.flat = SCALES[2] not in names or said.get("splatrendermode") == "2dgs"
        scales = SCALES[:2] if self.flat else SCALES
        exact = any(kinds[axis].itemsize > 4 for axis in PLACE)
        findings: tuple[Finding, ...] = ()
        if self.flat:
            done = f"read as flat splats, {FLAT:g} as thick as wide"
            findings = (Finding("2D splats, with two scales each", n, done, (), file, False),)
        self.raw = RawSplats(
            **empty_splats(n, len(harmonics) // 3, memory, exact),
            file=file,
            format="ply",
            antialiased=said.get("antialiased") == "1" or said.get("splatrendermode") == "mip",
            findings=findings,
            memory=memory,
        )
        raw = self.raw
        self.shades = shades_in(names)
        self.targets = [  # (the columns, the array with a row of them)
            *([] if self.shades else [(harmonics, raw.sh.reshape(n, -1))]),
            (PLACE, raw.means),
            (scales, raw.scales[:, : len(scales)]),
            (QUATERNION, raw.wxyz),
            (("opacity",), raw.opacity[:, None]),
        ]
        self.places = [  # where they are in a row of floats
            np.array([column_offset(kinds, name) // 4 for name in columns])
            for columns, _ in self.targets
        ]
        self.left_out = left_out_of(names)  # of SH degree 4
        self.shares = np.zeros(2)  # squares of what they have, and of all harmonics that vary
        used = {n for columns, _ in self.targets for n in columns} | {SCALES[2], *self.shades}
        used |= set(self.left_out)
        self.kept = [name for name in names if name not in used]
        memory.charge(n * sum(kinds[name].itemsize for name in self.kept), "its other columns")

    def fill(self, rows: slice, table: np.ndarray) -> None:
        """Puts records of the file into some rows."""
        floats = table.view("<f4").reshape(len(table), -1) if self.plain else None
        for (names, array), places in zip(self.targets, self.places, strict=True):
            into = array[rows]
            if floats is None or not into.flags.c_contiguous:
                for i, name in enumerate(names):
                    into[:, i] = table[name]
            else:
                # 3 times as fast as assigning strided columns; "raise" would go by a copy
                np.take(floats, places, axis=1, out=into, mode="clip")
        if self.left_out:
            self.count_left_out(table, self.raw.sh[rows, 1:])
        if self.flat:
            scales = self.raw.scales[rows]
            scales[:, 2] = scales[:, :2].min(axis=1) + np.float32(np.log(FLAT))
        for channel, name in enumerate(self.shades):
            kind = table.dtype[name]
            most = np.iinfo(kind).max if kind.kind in "iu" else 1.0
            self.raw.sh[rows, 0, channel] = (table[name] / np.float32(most) - 0.5) / C0
        for name in self.kept:
            self.keep(name, rows, table[name])

    def count_left_out(self, table: np.ndarray, kept: np.ndarray) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            parts = [np.square(table[name].astype(np.float64)) for name in self.left_out]
            fourth = float(sum(np.nansum(part) for part in parts))
            self.shares += fourth, fourth + float(np.nansum(np.square(kept, dtype=np.float64)))

    def tell_left_out(self) -> None:
        """A finding about SH degree 4, with its part of all that varies with direction."""
        if self.left_out:
            found = fourth_degree(
                len(self.left_out) // 3, self.shares[0], self.shares[1], self.raw.file
            )
            self.raw.findings = (*self.raw.findings, found)

    def keep(self, name: str, rows: slice, column: np.ndarray) -> None:
        """A column that is not of the splats; normals only when one of them is not zero."""
        extra = self.raw.extra
        if name in NORMAL and name not in extra and not np.asarray(column != 0).any():
            return
        if name not in extra:
            extra.setdefault(name, np.zeros(self.count, column.dtype.newbyteorder("=")))
        extra[name][rows] = column


def read_records(path: Path, begins: int, splats: Columns, reading: Reading) -> None:
    """Fills the columns from a binary file, several blocks at once."""
    size, block = splats.row.itemsize, block_of(splats.row.itemsize)

    @contextmanager
    def opened() -> Iterator[tuple[RawIOBase, np.ndarray]]:
        with path.open("rb", buffering=0) as file:
            yield file, np.empty(block, splats.row)

    def work(rows: slice, own: tuple[RawIOBase, np.ndarray]) -> None:
        file, table = own[0], own[1][: rows.stop - rows.start]
        file.seek(begins + rows.start * size)
        # Not a memoryview of the records: those may have names that it does not know how to read.
        if read_fully(file, table.view(np.uint8).data) < table.nbytes:
            raise BadFile(f"{path.name} became shorter while it was read; is it still written?")
        splats.fill(rows, table)

    each_block(splats.count, work, progress_of(path, reading), opened, block)


def read_fully(file: RawIOBase, into: memoryview) -> int:
    """Bytes read; fewer than asked for only at the end of the file."""
    done = 0
    while done < len(into) and (more := file.readinto(into[done:])):
        done += more
    return done


def read_text(path: Path, begins: int, splats: Columns, reading: Reading) -> None:
    """Fills the columns from an ASCII file."""
    width, first, pending = len(column_names(splats.row)), 0, np.empty(0)
    progress = progress_of(path, reading)
    with path.open("rb") as file:
        file.seek(begins)
        for values in numbers(file, path.name):
            pending = np.concatenate([pending, values])
            count = min(len(pending) // width, splats.count - first)
            if not count:
                continue
            table = np.empty(count, splats.row)
            part = pending[: count * width].reshape(count, width)
            with np.errstate(over="ignore", invalid="ignore"):
                for i, name in enumerate(column_names(splats.row)):
                    table[name] = part[:, i]
            splats.fill(slice(first, first + count), table)
            pending, first = pending[count * width :], first + count
            progress(first / splats.count)
            if first == splats.count:
                return
    raise BadFile(
        f"{path.name}: the header promises {splats.count} splats, the file holds {first}; "
        "it is cut off or its header is wrong."
    )


def numbers(file: BinaryIO, name: str) -> Iterator[np.ndarray]:
    """The numbers of a text, float64, a part at a time.  Raises BadFile."""
    rest = b""
    while block := file.read(TEXT):
        text = rest + block
        cut = max(text.rfind(b"\n"), text.rfind(b" "), text.rfind(b"\t")) + 1
        text, rest = text[:cut].strip(), text[cut:]
        if len(rest) > TEXT:
            raise BadFile(f"{name} is an ASCII PLY and has a word of {len(rest)} bytes.")
        if text:
            yield parse(text, name)
    if rest.strip():
        yield parse(rest.strip(), name)


def parse(text: bytes, name: str) -> np.ndarray:
    try:
        return np.fromstring(text, sep=" ")
    except ValueError:
        raise BadFile(f"{name} is an ASCII PLY and has words that are no numbers.") from None


def progress_of(path: Path, reading: Reading) -> Callable[[float], None]:
    return lambda part: reading.report(f"reading {path.name}", part)


# Mip-Splatting's 3D filter: a column of a PLY, without which its splats are far too thin.
#
# Mip-Splatting, Gaussian Opacity Fields and RaDe-GS save scales and opacities as they are before
# the filter, and the filter beside them, in metres.

COLUMN = "filter_3D"


def take_filter_3d(raw: RawSplats) -> None:
    """Takes the column, where there is one, into scales and opacities, and out of `raw.extra`.

    sigma' = sqrt(sigma^2 + f^2) along each axis, opacity' = opacity sqrt(prod sigma^2 / prod
    sigma'^2) (Yu et al. 2024, equation 9).  A filter that is no size leaves no scale behind, which
    the judge drops; that, signs, and splats that become too faint to be drawn are findings.
    """
    column = raw.extra.pop(COLUMN, None)
    if column is None:
        return
    hidden = np.zeros(len(column), bool)

    def work(rows: slice, _: None) -> None:
        filed = column[rows].astype(np.float64)
        filed[~(np.abs(filed) <= LARGEST_SCENE)] = np.nan
        logs = raw.scales[rows].astype(np.float64)
        wider = 0.5 * np.logaddexp(2 * logs, np.log(np.square(filed))[:, None])
        thinner = (logs - wider).sum(axis=1)  # the logarithm of how much fainter
        thinner[np.isneginf(logs).any(axis=1) & np.isneginf(wider).any(axis=1)] = 0
        log_before = -np.logaddexp(0, -raw.opacity[rows].astype(np.float64))  # of the opacity
        log_opacity = log_before + thinner
        least = np.log(MIN_ALPHA)
        hidden[rows] = (log_before >= least) & (log_opacity < least)
        raw.scales[rows] = wider
        raw.opacity[rows] = log_opacity - np.log(-np.expm1(log_opacity))

    with np.errstate(all="ignore"):  # odd numbers are for the judge
        each_block(len(raw.means), work)
        size = np.abs(column) <= LARGEST_SCENE
        told = (
            (~size, f"a {COLUMN} that is no size in metres", "they have no size"),
            (size & (column < 0), f"a negative {COLUMN}", "read without its sign"),
            (hidden, f"a {COLUMN} that leaves them too faint to be seen", UNSEEN),
        )
    median = float(np.median(np.abs(column[size]))) if size.any() else 0.0  # squares are taken
    what = f"Mip-Splatting's filter beside the splats ({COLUMN}, half of it over {median:.3g} m)"
    done = "taken into sizes and opacities, as its own viewer does; exports have it in them"
    found = [Finding(what, 0, done, file=raw.file, repaired=False)]
    for rows, what, done in told:
        found += row_findings(what, np.flatnonzero(rows), done, raw)
    raw.findings = (*raw.findings, *found)
