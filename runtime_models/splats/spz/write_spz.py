"""Plain splats to the .spz format (Niantic), versions 2 to 4: the inverse of read_spz."""

import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.blocks import BLOCK
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.splats.operations.rotate_splats import (
    HALF_TURN,
    rotator,
    signs_of_harmonics,
)
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.spz.read_spz import COLOR_SCALE
from shapeshift.runtime_models.splats.spz.spz_axes import FORMAT_AXES, PLY_AXES, axes_extension
from shapeshift.runtime_models.splats.spz.spz_file import (
    ANTIALIASED,
    EXTENSIONS,
    HEADER,
    LEGACY_HEADER,
    MAGIC,
    REST,
    TABLE_ROW,
)

FINEST_BITS = 16  # of a metre, 15 micrometres: finer ones only make the file larger
LARGEST_CODE = (1 << 23) - 1  # of a place
LEVEL = 12  # of zstd, as the format's own writer
VERSIONS = (2, 3, 4)
AXES = {"ply": PLY_AXES, "rub": FORMAT_AXES}  # that can be written, by an option's name


def write_spz(splats: PlainSplats, path: str | Path, version: int = 3, axes: str = "ply") -> None:
    """Atomic.  Raises ValueError where the places do not fit.

    axes: "ply", x right, y down, z forward, as most of today's programs write and read them, or
    "rub", x right, y up, z back, as the format's text says.  The file says which, by an extension
    that programs without it pass over (docs/formats.md: who reads what).

    Half a code's step is lost: 2**-17 m in place (more in scenes wider than 256 m), 1/32 in the
    logarithm of a scale (4.5e-5 m to 379 m; those beyond are held there), 1/510 in opacity, 1/76
    in the first harmonic (0.3 / 25.5), 1/256 in the others (held within -1 to 127/128), 7e-4 in a
    quaternion's entries (version 2: 1/255).
    """
    if version not in VERSIONS:
        raise ValueError(f".spz version {version} was asked for; {VERSIONS} are written.")
    if axes not in AXES:
        raise ValueError(f".spz axes {axes!r} were asked for; {', '.join(AXES)} are written.")
    degree = REST.index(splats.sh.shape[1] - 1)
    count, bits = len(splats.means), fractional_bits(splats, path)
    flags = EXTENSIONS | (ANTIALIASED if splats.antialiased else 0)
    head = (MAGIC, version, count, degree, bits, flags)
    turn = HALF_TURN if axes == "ply" else np.eye(3)
    streams: list[Iterable[bytes]] = [
        blocks_of(rows_of, count) for rows_of in streams_of(splats, bits, version, turn)
    ]
    contain = deflated if version < 4 else compressed
    write_whole(Path(path), contain(head, streams, axes_extension(AXES[axes])))


def streams_of(
    splats: PlainSplats, bits: int, version: int, turn: np.ndarray
) -> list[Callable[[slice], np.ndarray]]:
    """The codes of some rows, for each of the streams, after a half turn (3, 3), or none."""
    pack_rotations = pack_smallest_three if version >= 3 else pack_first_three
    signs, origin = turn.diagonal(), np.array(splats.origin)
    of_harmonics = signs_of_harmonics(signs, splats.sh.shape[1])[1:, None]
    rotate_rows, no_places = rotator(turn, 1), np.empty((0, 3), np.float32)

    def places(rows: slice) -> np.ndarray:
        return pack_places((splats.means[rows].astype(np.float64) + origin) * signs, bits)

    def rotations(rows: slice) -> np.ndarray:
        wxyz = splats.wxyz[rows].copy()
        rotate_rows(no_places, wxyz, splats.sh[:0, :1])
        return pack_rotations(wxyz)

    def scales(rows: slice) -> np.ndarray:
        with np.errstate(divide="ignore"):  # a scale of 0 has the smallest code
            return as_bytes((np.log(splats.scales[rows]) + 10) * 16)

    def colors(rows: slice) -> np.ndarray:
        return as_bytes((splats.sh[rows, 0] * np.float32(COLOR_SCALE) + np.float32(0.5)) * 255)

    return [
        places,
        lambda rows: as_bytes(splats.opacity[rows] * 255),
        colors,
        scales,
        rotations,
        lambda rows: as_bytes(splats.sh[rows, 1:] * of_harmonics * 128 + 128),
    ]


def blocks_of(rows_of: Callable[[slice], np.ndarray], count: int) -> Iterator[bytes]:
    """The bytes of a stream, a block of splats at a time."""
    for first in range(0, count, BLOCK):
        yield rows_of(slice(first, first + BLOCK)).tobytes()


def deflated(head: tuple, streams: list[Iterable[bytes]], extensions: bytes) -> Iterator[bytes]:
    """The container of versions 2 and 3: one gzip stream of it all, never whole in memory."""
    packer = zlib.compressobj(6, zlib.DEFLATED, 31)
    yield packer.compress(LEGACY_HEADER.pack(*head, 0))
    for stream in streams:
        yield from map(packer.compress, stream)
    yield packer.compress(extensions)
    yield packer.flush()


def compressed(head: tuple, streams: list[Iterable[bytes]], extensions: bytes) -> Iterator[bytes]:
    """The container of version 4.  Its table of sizes stands first, so all that is compressed is
    in memory, and one stream as it was: zstd packs a little worse piece by piece.
    """
    import zstandard

    rows, packed = [], []
    for stream in streams:
        whole = bytearray()
        for part in stream:
            whole += part
        if whole:
            packed.append(zstandard.ZstdCompressor(level=LEVEL).compress(whole))
            rows.append(TABLE_ROW.pack(len(packed[-1]), len(whole)))
    table = HEADER.size + len(extensions)
    yield b"".join([HEADER.pack(*head, len(rows), table), extensions, *rows])
    yield from packed


def fractional_bits(splats: PlainSplats, path: str | Path) -> int:
    """The most bits below the metre with which places fit 24.  Raises ValueError."""
    ends = np.stack([splats.means.min(axis=0), splats.means.max(axis=0)])  # NaN stays
    farthest = float(np.abs(ends.astype(np.float64) + splats.origin).max())
    if not farthest <= LARGEST_CODE:
        raise ValueError(
            f"{path} cannot be written: the splats lie up to {farthest:.3g} m from the origin, an "
            f".spz reaches {LARGEST_CODE:,} m; move the scene, or write a PLY."
        )
    bits = FINEST_BITS
    while bits and round(farthest * 2**bits) > LARGEST_CODE:
        bits -= 1
    step, size = 2.0**-bits, float(np.median(splats.scales.max(axis=1)))
    if bits < 12 and step > size:
        raise ValueError(
            f"{path} cannot be written: splats up to {farthest:,.0f} m from the origin leave steps "
            f"of {step:.3g} m in an .spz, and half the splats are smaller than {size:.3g} m; move "
            "the scene to the origin."
        )
    return bits


def pack_places(places: np.ndarray, bits: int) -> np.ndarray:
    """(N, 9) uint8: 24 bits each, in little endian."""
    whole = np.rint(places * 2.0**bits).astype("<i4")
    return whole.view(np.uint8).reshape(-1, 3, 4)[:, :, :3].reshape(-1, 9)


def as_bytes(values: np.ndarray) -> np.ndarray:
    """uint8 of the nearest code, the ends for what lies beyond."""
    return np.rint(values).clip(0, 255).astype(np.uint8)


def pack_first_three(wxyz: np.ndarray) -> np.ndarray:
    """(N, 3) uint8: x y z of unit quaternions with w >= 0."""
    upright = wxyz[:, 1:] * np.where(wxyz[:, :1] < 0, -1, 1)  # q and -q turn alike
    return as_bytes(upright * 127.5 + 127.5)


def pack_smallest_three(wxyz: np.ndarray) -> np.ndarray:
    """(N,) words: 2 bits for which of x y z w is the largest, a sign and 9 bits for each other."""
    xyzw = wxyz[:, (1, 2, 3, 0)]
    rows = np.arange(len(xyzw))
    largest = np.abs(xyzw).argmax(axis=1)
    xyzw *= np.where(xyzw[rows, largest] < 0, -1, 1)[:, None]  # q and -q turn alike
    out = largest.astype("<u4")
    for step in range(3):
        value = xyzw[rows, step + (largest <= step)]
        code = np.rint(np.abs(value) * (511 * 2**0.5)).clip(0, 511).astype("<u4")
        out = out << 10 | (value < 0).astype("<u4") << 9 | code
    return out
