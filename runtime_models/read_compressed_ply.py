"""PlayCanvas's compressed PLY (SuperSplat): splats in chunks of 256, 16 bytes each, SH beside."""

import re
from pathlib import Path

import numpy as np

from runtime_models.blocks import each_block
from runtime_models.model import BadFile
from runtime_models.plain_splats import RawSplats, Reading
from runtime_models.ply_file import PlyHeader, read_header
from runtime_models.read_ply import teller
from runtime_models.spherical_harmonics import C0

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
    count = len(packed)
    raw = RawSplats(
        means=np.empty((count, 3), np.float32),
        scales=np.empty((count, 3), np.float32),
        wxyz=np.empty((count, 4), np.float32),
        opacity=np.empty(count, np.float32),
        sh=np.empty((count, 1 + rest.shape[2], 3), np.float32),
        file=path.name,
        format="compressed PLY",
        logits=False,
        antialiased="splatrendermode: mip" in [comment.lower() for comment in header.comments],
    )
    coefficient = harmonic_of_code()

    def decode(rows: slice, _: object) -> None:
        words = packed[rows]
        near = ranges[rows.start // CHUNK : -(-rows.stop // CHUNK)]  # blocks begin with a chunk
        raw.means[rows] = within(unpack(words["packed_position"], BITS_11_10_11), near, POSITIONS)
        raw.scales[rows] = within(unpack(words["packed_scale"], BITS_11_10_11), near, SCALES)
        raw.wxyz[rows] = unpack_smallest_three(words["packed_rotation"])
        shown = unpack(words["packed_color"], BITS_8888)  # (n, 4) 0..1
        raw.opacity[rows] = shown[:, 3]
        colored = set(COLORS) <= set(ranges.dtype.names)
        color = within(shown[:, :3], near, COLORS) if colored else shown[:, :3]
        raw.sh[rows, 0] = (color - 0.5) / C0
        raw.sh[rows, 1:] = coefficient[rest[rows]].transpose(0, 2, 1)

    with np.errstate(invalid="ignore", over="ignore"):  # ranges of NaN or Inf are for the judge
        each_block(count, decode, teller(path, reading), block=8 * CHUNK)
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
        if column not in (element.row.names or ()) or element.row[column].newbyteorder("=") != kind:
            raise BadFile(
                f"{path.name}: its element {name} has no {column} of {np.dtype(kind)}, as a "
                "compressed PLY has; export it again."
            )
    return np.memmap(path, element.row, "r", begins, (element.count,))


def harmonics_of(path: Path, header: PlyHeader, count: int) -> np.ndarray:
    """(N, 3, M - 1) bytes of the harmonics beyond degree 0, mapped: red, then green, then blue."""
    rows = [element.row for element in header.elements if element.name == "sh"]
    if not rows:
        return np.empty((count, 3, 0), np.uint8)
    names = tuple(f"f_rest_{i}" for i in range(len(rows[0] or ())))
    if len(names) not in REST or rows[0].names != names:
        raise BadFile(f"{path.name}: its element sh has not 9, 24 or 45 columns f_rest_0, ...")
    codes = records(path, header, "sh", names, np.uint8)
    if len(codes) != count:
        raise BadFile(f"{path.name} has {count} splats, but harmonics of {len(codes)}.")
    return codes.view(np.uint8).reshape(count, 3, -1)


def harmonic_of_code() -> np.ndarray:
    """(256,) the coefficient that each byte stands for: the middle of its bin, the ends exact."""
    share = (np.arange(256) + 0.5) / 256
    share[[0, 255]] = 0, 1
    return ((share - 0.5) * SH_SPAN).astype(np.float32)


def unpack(packed: np.ndarray, bits: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(N, k) float32 in 0..1 of words (N,) with k codes each."""
    codes = [((packed >> shift) & largest) / np.float32(largest) for shift, largest in bits]
    return np.stack(codes, 1, dtype=np.float32)


def within(shares: np.ndarray, ranges: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """(N, 3) values at shares 0..1 of the way from the least to the most of their chunk."""
    table = np.stack([ranges[name] for name in names], 1)  # (chunks, 6)
    ends = np.repeat(table, CHUNK, axis=0)[: len(shares)]
    return ends[:, :3] * (1 - shares) + ends[:, 3:] * shares


def unpack_smallest_three(packed: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz: 2 bits say which entry is the largest, 10 bits each hold the others."""
    small = [(packed >> shift) & 1023 for shift in (20, 10, 0)]
    small = (np.stack(small, 1, dtype=np.float32) / 1023 - 0.5) * np.float32(2**0.5)
    return from_smallest_three(small, packed >> 30)


def from_smallest_three(small: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions of three entries in order (N, 3) and which one is left out (N,)."""
    rest = np.sqrt(np.maximum(0, 1 - (small * small).sum(1)))
    places = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[largest]  # (N, 3)
    out = np.empty((len(small), 4), np.float32)
    np.put_along_axis(out, places, small, axis=1)
    np.put_along_axis(out, largest[:, None].astype(np.intp), rest[:, None], axis=1)
    return out
