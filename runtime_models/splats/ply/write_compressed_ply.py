"""Plain splats to PlayCanvas's compressed PLY, in COLMAP's axes: inverse of read_compressed_ply."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.blocks import BLOCK, each_block
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order
from shapeshift.runtime_models.splats.operations.rotate_splats import HALF_TURN, rotator
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.read_compressed_ply import (
    BITS_11_10_11,
    BITS_8888,
    CHUNK,
    COLORS,
    PACKED,
    POSITIONS,
    SCALES,
    SH_SPAN,
)

LOG_SCALES = (-20.0, 20.0)  # 2e-9 m to 5e8 m, as the format's own writer cuts them


def write_compressed_ply(splats: PlainSplats, path: str | Path) -> None:
    """Atomic; sorted along the Z-curve, so that chunks are small and their codes fine.

    Half a code's step is lost: 1/4094 (y 1/2046) of a chunk's extent in place and logarithm of
    scale, 1/510 in opacity and of a chunk's range in colour, 7e-4 in a quaternion's entries, 1/64
    in the other harmonics (1/32 at their ends, which are -4 and 4).
    """
    order = morton_order(splats.means * np.diagonal(HALF_TURN).astype(np.float32))
    ranges, packed = chunks_and_splats(splats, order)
    rest = 3 * (splats.sh.shape[1] - 1)
    head = header(len(ranges), len(order), rest, splats.antialiased)
    write_whole(Path(path), records(head, ranges, packed, splats, order))


def records(
    head: bytes, ranges: np.ndarray, packed: np.ndarray, splats: PlainSplats, order: np.ndarray
) -> Iterator[bytes | memoryview]:
    """The bytes of the file, part after part."""
    yield head
    yield ranges.data
    yield packed.data
    for first in range(0, len(order) if splats.sh.shape[1] > 1 else 0, BLOCK):
        _, _, sh = in_file_axes(splats, order[first : first + BLOCK])
        rest = sh[:, 1:].transpose(0, 2, 1).reshape(len(sh), -1)  # all of red first
        yield np.clip((rest / SH_SPAN + 0.5) * 256, 0, 255).astype(np.uint8).tobytes()


def in_file_axes(
    splats: PlainSplats, order: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, quaternions and harmonics of the rows of `order`, turned back."""
    turned = splats.means[order], splats.wxyz[order], splats.sh[order]
    rotator(HALF_TURN, splats.sh.shape[1])(*turned)  # its own inverse
    return turned


def chunks_and_splats(splats: PlainSplats, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(chunks, 18) float32 ranges and (N, 4) words of the splats in that order."""
    count = len(order)
    ranges = np.empty((-(-count // CHUNK), 18), "<f4")
    packed = np.empty((count, 4), "<u4")
    origin = HALF_TURN @ np.array(splats.origin)  # metres, in the file's axes

    def fill(rows: slice, _: object) -> None:
        some = order[rows]
        means, wxyz, sh = in_file_axes(replace(splats, sh=splats.sh[:, :1]), some)
        logs = np.log(splats.scales[some]).clip(*LOG_SCALES)
        near = slice(rows.start // CHUNK, -(-rows.stop // CHUNK))  # blocks begin with a chunk
        parts = [ranged(means + origin), ranged(logs), ranged(sh[:, 0] * C0 + 0.5)]
        ranges[near] = np.concatenate([ends for ends, _ in parts], axis=1)
        places, sizes, shades = (shares for _, shares in parts)
        packed[rows, 0] = pack(places, BITS_11_10_11)
        packed[rows, 1] = pack_smallest_three(wxyz)
        packed[rows, 2] = pack(sizes, BITS_11_10_11)
        packed[rows, 3] = pack(np.column_stack([shades, splats.opacity[some]]), BITS_8888)

    with np.errstate(divide="ignore"):  # a scale of 0 has the smallest logarithm
        each_block(count, fill)
    return ranges, packed


def header(chunks: int, splats: int, rest: int, antialiased: bool) -> bytes:
    """The text at the beginning of the file."""
    lines = ["ply", "format binary_little_endian 1.0", "comment written by Shapeshift"]
    lines += ["comment SplatRenderMode: mip"] * antialiased
    lines += [f"element chunk {chunks}"]
    lines += [f"property float {name}" for name in POSITIONS + SCALES + COLORS]
    lines += [f"element vertex {splats}", *(f"property uint {name}" for name in PACKED)]
    if rest:
        lines += [f"element sh {splats}", *(f"property uchar f_rest_{i}" for i in range(rest))]
    return "\n".join([*lines, "end_header", ""]).encode()


def ranged(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(chunks, 6) float32 least and most of each chunk; (N, 3) shares 0..1 of the way between."""
    starts = np.arange(0, len(values), CHUNK)
    ends = [
        reduce.reduceat(values, starts).astype(np.float32) for reduce in (np.minimum, np.maximum)
    ]
    low, high = (np.repeat(end.astype(np.float64), CHUNK, axis=0)[: len(values)] for end in ends)
    span = high - low  # of what a reader sees: the ends are rounded to float32
    shares = (values - low) / np.where(span > 0, span, 1.0)
    return np.concatenate(ends, axis=1), shares.clip(0, 1)


def pack(shares: np.ndarray, bits: tuple[tuple[int, int], ...]) -> np.ndarray:
    """(N,) words of shares (N, k) in 0..1, rounded to the nearest code."""
    out = np.zeros(len(shares), np.uint32)
    for share, (shift, largest) in zip(shares.T, bits, strict=True):
        out |= np.rint(share * largest).astype(np.uint32) << np.uint32(shift)
    return out


def pack_smallest_three(wxyz: np.ndarray) -> np.ndarray:
    """(N,) words: 2 bits for which entry of a unit quaternion is the largest, 10 for each other."""
    largest = np.abs(wxyz).argmax(axis=1)
    rows = np.arange(len(wxyz))
    out = largest.astype(np.uint32)
    sign = np.where(wxyz[rows, largest] < 0, -1, 1)  # q and -q turn alike
    for step in (1, 2, 3):
        place = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[largest, step - 1]
        share = wxyz[rows, place] * sign * 0.5**0.5 + 0.5
        out = out << np.uint32(10) | np.rint(share * 1023).clip(0, 1023).astype(np.uint32)
    return out
