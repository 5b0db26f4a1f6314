"""PlayCanvas's compressed PLY (SuperSplat): splats in chunks of 256, 16 bytes each, SH beside."""

import re
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import column_names
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading, empty_splats
from shapeshift.runtime_models.splats.ply.ply_file import (
    PlyHeader,
    put_vertical_axis,
    read_header,
)
from shapeshift.runtime_models.splats.ply.read_ply import progress_of

CHUNK = 256  # splats that share one row of ranges
POSITIONS = ("min_x", "min_y", "min_z", "max_x", "max_y", "max_z")
SCALES = tuple(f"{end}_scale_{axis}" for end in ("min", "max") for axis in "xyz")
COLORS = ("min_r", "min_g", "min_b", "max_r", "max_g", "max_b")  # absent in older files: 0 to 1
PACKED = ("packed_position", "packed_rotation", "packed_scale", "packed_color")
BITS_11_10_11 = ((21, 2047), (11, 1023), (0, 2047))  # (shift, largest code) of x, y, z
BITS_8888 = ((24, 255), (16, 255), (8, 255), (0, 255))
SH_SPAN = 8.0  # coefficients are coded from -4 to 4
REST = (9, 24, 45)  # f_rest columns of SH degree 1 to 3
CHUNK_ELEMENT = re.compile(rb"^element[ \t]+chunk\b", re.MULTILINE)


def has_chunks(head: bytes, path: Path) -> bool:
    """Whether a file is a compressed PLY: by its element `chunk`, whatever it is called."""
    header = head.partition(b"end_header")[0]
    return header[:3] == b"ply" and bool(CHUNK_ELEMENT.search(header))


def read_raw_compressed_ply(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3.  Raises BadFile."""
    header = read_header(path)
    ranges, packed = chunks_and_splats(path, header)
    rest = harmonics_of(path, header, len(packed))  # (N, 3, M - 1) bytes
    memory = reading.within(path).account
    raw = RawSplats(
        **empty_splats(len(packed), 1 + rest.shape[2], memory),
        file=path.name,
        format="compressed PLY",
        logits=False,
        antialiased="splatrendermode: mip" in [comment.lower() for comment in header.comments],
        memory=memory,
    )
    colored = set(COLORS) <= set(column_names(ranges.dtype))

    def decode(rows: slice, _: object) -> None:
        words = packed[rows]
        near = ranges[rows.start // CHUNK : -(-rows.stop // CHUNK)]  # blocks begin with a chunk
        places, sizes = (
            unpack(words[name], BITS_11_10_11) for name in ("packed_position", "packed_scale")
        )
        *shades, raw.opacity[rows] = unpack(words["packed_color"], BITS_8888)
        within(places, near, POSITIONS, raw.means[rows])
        within(sizes, near, SCALES, raw.scales[rows])
        unpack_smallest_three(words["packed_rotation"], raw.wxyz[rows])
        color = np.stack(shades, axis=1)
        if colored:
            within(shades, near, COLORS, color)
        raw.sh[rows, 0] = (color - 0.5) / C0
        raw.sh[rows, 1:] = harmonics(rest[rows])

    with np.errstate(invalid="ignore", over="ignore"):  # ranges of NaN or Inf are for the judge
        each_block(len(packed), decode, progress_of(path, reading))
    put_vertical_axis(raw, header)
    return raw


def chunks_and_splats(path: Path, header: PlyHeader) -> tuple[np.ndarray, np.ndarray]:
    """The records of the elements `chunk` and `vertex`, with the columns that are needed."""
    ranges = records(path, header, "chunk", POSITIONS + SCALES, np.float32)
    packed = records(path, header, "vertex", PACKED, np.uint32)
    wanted = -(-len(packed) // CHUNK)
    if len(ranges) != wanted:
        raise BadFile(
            f"{path.name} has {len(ranges)} chunks, {len(packed)} splats need {wanted}; its header "
            "is wrong, export it again."
        )
    return ranges, packed


def records(
    path: Path, header: PlyHeader, name: str, columns: tuple[str, ...], kind: type
) -> np.ndarray:
    """(N,) records of an element, mapped; its `columns` are of that kind.  Raises BadFile."""
    if header.encoding == "ascii":
        raise BadFile(f"{path.name} is an ASCII PLY, a compressed one is binary; convert it.")
    element, begins = header.find(name)
    for column in columns:
        if (
            column not in column_names(element.layout)
            or element.layout[column].newbyteorder("=") != kind
        ):
            raise BadFile(
                f"{path.name}: its element {name} has no {column} of {np.dtype(kind)}, as a "
                "compressed PLY has; export it again."
            )
    return np.memmap(path, element.layout, "r", begins, (element.count,))


def harmonics_of(path: Path, header: PlyHeader, count: int) -> np.ndarray:
    """(N, 3, M - 1) bytes of the harmonics beyond degree 0, mapped: red, then green, then blue."""
    rows = [element.row for element in header.elements if element.name == "sh"]
    if not rows:
        return np.empty((count, 3, 0), np.uint8)
    found = () if rows[0] is None else column_names(rows[0])
    names = tuple(f"f_rest_{i}" for i in range(len(found)))
    if len(names) not in REST or found != names:
        raise BadFile(f"{path.name}: its element sh has not 9, 24 or 45 columns f_rest_0, ...")
    codes = records(path, header, "sh", names, np.uint8)
    if len(codes) != count:
        raise BadFile(f"{path.name} has {count} splats, but harmonics of {len(codes)}.")
    return codes.view(np.uint8).reshape(count, 3, -1)


def harmonics(codes: np.ndarray) -> np.ndarray:
    """(N, M - 1, 3) coefficients of bytes (N, 3, M - 1): the middle of a bin, the ends exact."""
    count, _, width = codes.shape
    by_coefficient = np.arange(3 * width).reshape(3, width).T.reshape(-1)
    near = codes.reshape(count, 3 * width).take(
        by_coefficient, axis=1
    )  # far quicker than a transpose
    out = near.astype(np.float32)
    out -= np.float32(127.5)
    out *= np.float32(SH_SPAN / 256)  # a power of two: exact
    np.copyto(out, np.float32(-SH_SPAN / 2), where=near == 0)
    np.copyto(out, np.float32(SH_SPAN / 2), where=near == 255)
    return out.reshape(count, width, 3)


def unpack(packed: np.ndarray, bits: tuple[tuple[int, int], ...]) -> list[np.ndarray]:
    """k arrays (N,) float32 in 0..1 of words (N,) with k codes each."""
    return [
        ((packed >> shift) & largest).astype(np.float32) / np.float32(largest)
        for shift, largest in bits
    ]


def within(
    shares: list[np.ndarray], ranges: np.ndarray, names: tuple[str, ...], out: np.ndarray
) -> None:
    """out (N, 3): values at shares 0..1 of the way from the least to the most of their chunk."""
    whole = len(out) // CHUNK * CHUNK  # the last chunk may be a part of one
    for axis, share in enumerate(shares):
        low, high = ranges[names[axis]], ranges[names[axis + 3]]
        for part, wide in ((slice(0, whole), CHUNK), (slice(whole, None), len(out) - whole)):
            if wide and len(out[part]):
                near = slice(part.start // CHUNK, -(-len(out[: part.stop]) // CHUNK))
                way = share[part].reshape(-1, wide)
                ends = low[near, None] * (1 - way) + high[near, None] * way
                out[part, axis] = ends.reshape(-1)


def unpack_smallest_three(packed: np.ndarray, out: np.ndarray) -> None:
    """out (N, 4) wxyz: 2 bits say which entry is the largest, 10 bits each hold the others."""
    small = unpack(packed, ((20, 1023), (10, 1023), (0, 1023)))
    small = [(share - np.float32(0.5)) * np.float32(2**0.5) for share in small]
    from_smallest_three(small, packed >> 30, out)


def from_smallest_three(
    small: list[np.ndarray],
    largest: np.ndarray,
    out: np.ndarray,
    columns: tuple[int, int, int, int] = (0, 1, 2, 3),
) -> None:
    """out (N, 4): quaternions of three entries in order, (N,) each, and which one is left out.

    columns: where in `out` each of the four entries belongs.
    """
    a, b, c = small
    rest = a * a
    rest += b * b
    rest += c * c
    np.subtract(np.float32(1), rest, out=rest)
    np.maximum(rest, 0, out=rest)
    np.sqrt(rest, out=rest)
    first, second, third, last = (-(largest == entry).astype(np.int32) for entry in range(4))
    out[:, columns[0]] = blend(a, rest, first)
    out[:, columns[1]] = blend(blend(b, rest, second), a, first)
    out[:, columns[2]] = blend(blend(b, rest, third), c, last)
    out[:, columns[3]] = blend(c, rest, last)


def blend(off: np.ndarray, on: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(N,) floats: `on` where the mask (N,) int32 has all bits, `off` where it has none.

    By bits: numpy's where() jumps at each number, and which entry is the largest is chance.
    """
    word = np.dtype(f"i{off.itemsize}")
    words = off.view(word) ^ on.view(word)
    words &= mask
    words ^= off.view(word)
    return words.view(off.dtype)
