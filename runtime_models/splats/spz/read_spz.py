"""The .spz format (Niantic), versions 1 to 4: 16 to 64 bytes a splat, compressed; SH 0 to 3."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import (
    RawSplats,
    Reading,
    empty_splats,
    fourth_degree,
)
from shapeshift.runtime_models.splats.ply.read_compressed_ply import from_smallest_three
from shapeshift.runtime_models.splats.spz.spz_axes import (
    AXES_EXTENSION,
    Axes,
    axes_of,
    axes_said,
    put_axes,
)
from shapeshift.runtime_models.splats.spz.spz_file import (
    ANTIALIASED,
    REST,
    SpzHeader,
    is_spz,
    unpack_spz,
)

COLOR_SCALE = 0.15  # of the first coefficient: code / 255 = 0.5 + 0.15 f
SMALL = np.float32(0.5**0.5 / 511)  # of a code of the smallest three
SIGNED = np.outer((1, -1), np.arange(512, dtype=np.float32) * SMALL).astype(np.float32).ravel()


def has_spz_mark(head: bytes, path: Path) -> bool:
    """Whether a file is an .spz, by its first bytes."""
    return is_spz(head)


def read_raw_spz(path: Path, reading: Reading, axes: str = "") -> RawSplats:
    """Splats of SH degree 0 to 3.  Raises BadFile.

    axes: what they are in where no extension says otherwise; "" where nobody tells (spz_axes.py).
    """
    reading = reading.within(path)
    with reading.account.lend(path.stat().st_size, "its bytes"):
        return read_spz_bytes(path.read_bytes(), path.name, reading, axes, reading.outer or path)


def read_spz_bytes(
    data: bytes, file: str, reading: Reading, axes: str = "", path: Path | None = None
) -> RawSplats:
    """The same of a file in memory; path: where it lies, where cameras may lie beside it."""
    memory = reading.within(Path(file), len(data)).account
    spz = unpack_spz(data, file, memory)
    header = spz.header
    count, there = header.count, REST[header.degree]
    kept = min(there, REST[3])
    raw = RawSplats(
        **empty_splats(count, 1 + kept, memory),
        file=file,
        format=f"spz v{header.version}",
        logits=False,
        antialiased=bool(header.flags & ANTIALIASED),
        usual=header.version > 1,  # whole numbers alone; version 1 has half floats
        memory=memory,
    )
    shares = np.zeros(2)  # squares of harmonics of degree 4, and of all that vary
    streams = zip(header.widths, decoders(raw, header, shares), strict=True)
    for number, (width, decode) in enumerate(streams):
        reading.report(f"reading {file}", number / len(header.widths))
        for first in range(0, count if width else 0, BLOCK):  # one after the other, as they lie
            rows = slice(first, min(first + BLOCK, count))
            stream = spz.read(width * (rows.stop - first))
            decode(rows, np.frombuffer(stream, np.uint8).reshape(-1, width))
    extensions, findings = spz.extensions(), []
    others = [f"{kind:#010x}" for kind in extensions if kind != AXES_EXTENSION]
    if others:
        what = f"extensions {', '.join(others)}"
        findings.append(Finding(what, 0, "not looked at", file=file, repaired=False))
    if kept < there:
        findings.append(fourth_degree(there - kept, shares[0], shares[1], file))
    raw.findings = tuple(findings)
    if axes and not axes_said(extensions):
        found = Axes(axes, "as what it lies in says", True)
    else:
        found = axes_of(raw, header.version, extensions, path)
    put_axes(raw, found, bool(reading.up))
    return raw


def decoders(
    raw: RawSplats, header: SpzHeader, shares: np.ndarray
) -> tuple[Callable[[slice, np.ndarray], None], ...]:
    """For each of the streams, what fills in some rows from their codes (n, width) uint8."""

    def places(rows: slice, codes: np.ndarray) -> None:
        raw.means[rows] = unpack_places(codes, header)

    def alphas(rows: slice, codes: np.ndarray) -> None:
        raw.opacity[rows] = codes[:, 0] / np.float32(255)

    def colors(rows: slice, codes: np.ndarray) -> None:
        shades = codes.ravel().astype(np.float32)
        shades /= np.float32(255)
        shades -= np.float32(0.5)
        shades /= np.float32(COLOR_SCALE)
        for channel in range(3):  # a long run each: numpy is slow at runs of three
            raw.sh[rows, 0, channel] = shades[channel::3]

    def scales(rows: slice, codes: np.ndarray) -> None:
        sizes = raw.scales[rows]
        np.multiply(codes, np.float32(1 / 16), out=sizes)
        sizes -= np.float32(10)

    def rotations(rows: slice, codes: np.ndarray) -> None:
        unpack = unpack_first_three if header.version < 3 else unpack_smallest_three
        unpack(codes, raw.wxyz[rows])

    def harmonics(rows: slice, codes: np.ndarray) -> None:
        kept = 3 * (raw.sh.shape[1] - 1)  # of degree 4 those up to degree 3
        values = codes[:, :kept].astype(np.float32)
        values -= np.float32(128)
        values *= np.float32(1 / 128)
        raw.sh[rows].reshape(len(codes), -1)[:, 3:] = values
        if codes.shape[1] > kept:
            fourth = (codes[:, kept:].astype(np.float64) - 128) / 128
            left_out = float(np.square(fourth).sum())
            shares[:] += left_out, left_out + float(np.square(values, dtype=np.float64).sum())

    return places, alphas, colors, scales, rotations, harmonics


def unpack_places(codes: np.ndarray, header: SpzHeader) -> np.ndarray:
    """(n, 3) float32, exact: 24 bits each, or half floats in version 1."""
    if header.version == 1:
        return codes.view("<f2").astype(np.float32)
    # The code is on top of its word, with its sign; the byte below belongs to the code before.
    data = np.zeros(codes.size + 1, np.uint8)
    data[1:] = codes.ravel()
    words = np.ndarray((len(codes), 3), "<i4", data, strides=(9, 3)) & np.int32(-256)
    return np.multiply(words, np.float32(0.5 ** (header.fractional_bits + 8)), dtype=np.float32)


def unpack_first_three(codes: np.ndarray, out: np.ndarray) -> None:
    """out (n, 4) wxyz, unit but for rounding, of x y z."""
    xyz = codes / np.float32(127.5) - np.float32(1)
    out[:, 1:] = xyz
    out[:, 0] = np.sqrt(np.maximum(0, 1 - (xyz * xyz).sum(1)))


def unpack_smallest_three(codes: np.ndarray, out: np.ndarray) -> None:
    """out (n, 4) wxyz: 2 bits for which of x y z w is left out, 1 + 9 bits for each other."""
    words = codes.view("<u4")[:, 0]
    small = []
    for shift in (20, 10, 0):
        code = (words >> np.uint32(shift)) & np.uint32(1023)
        small.append(np.take(SIGNED, code.astype(np.intp), mode="clip"))
    from_smallest_three(small, words >> np.uint32(30), out, columns=(1, 2, 3, 0))
