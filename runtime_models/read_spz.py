"""The .spz format (Niantic), versions 1 to 4: 16 to 64 bytes a splat, compressed; SH 0 to 3."""

from pathlib import Path

import numpy as np

from runtime_models.model import BadFile, Finding
from runtime_models.plain_splats import RawSplats, Reading
from runtime_models.spz_file import ANTIALIASED, REST, Spz, is_spz, unpack_spz

COLOR_SCALE = 0.15  # of the first coefficient: code / 255 = 0.5 + 0.15 f
AXES_EXTENSION = 0xADBE0003  # Adobe's: which axes the places are in
NAMED_AXES = (
    "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF",
    "LFD", "RFD", "LFU", "RFU", "LBD", "RBD", "LBU", "RBU",
)  # fmt: skip
SMALL = np.float32(0.5**0.5 / 511)  # of a code of the smallest three


def has_spz_mark(head: bytes, path: Path) -> bool:
    """Whether a file is an .spz, by its first bytes."""
    return is_spz(head)


def read_raw_spz(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3.  Raises BadFile."""
    return read_spz_bytes(path.read_bytes(), path.name, reading)


def read_spz_bytes(data: bytes, file: str, reading: Reading) -> RawSplats:
    """The same of a file in memory; x right, y up, z back, if no extension says otherwise."""
    reading.tell(f"decompressing {file}", 0.0)
    spz = unpack_spz(data, file)
    reading.tell(f"reading {file}", 0.6)
    findings: list[Finding] = []
    up = axis_up(spz, findings)
    _, alphas, colors, scales, _, _ = spz.streams
    sh = unpack_harmonics(spz, findings)
    sh[:, 0] = (codes(colors, 3) / np.float32(255) - np.float32(0.5)) / np.float32(COLOR_SCALE)
    return RawSplats(
        means=unpack_places(spz),
        scales=codes(scales, 3) / np.float32(16) - np.float32(10),
        wxyz=unpack_rotations(spz),
        opacity=(codes(alphas, 1) / np.float32(255))[:, 0],
        sh=sh,
        file=file,
        format=f"spz v{spz.header.version}",
        logits=False,
        up=up,
        antialiased=bool(spz.header.flags & ANTIALIASED),
        findings=tuple(findings),
    )


def codes(stream: memoryview, columns: int) -> np.ndarray:
    """(N, columns) uint8 of a stream."""
    return np.frombuffer(stream, np.uint8).reshape(-1, columns)


def unpack_places(spz: Spz) -> np.ndarray:
    """(N, 3) float32, exact: 24 bits, or half floats in version 1."""
    stream = spz.streams[0]
    if spz.header.version == 1:
        return np.frombuffer(stream[:-1], "<f2").reshape(-1, 3).astype(np.float32)
    # A word at every third byte: pushing the fourth one out leaves the code, with its sign.
    words = np.ndarray(3 * spz.header.count, "<i4", stream, strides=(3,))
    out = ((words << 8) >> 8).astype(np.float32)
    out *= np.float32(0.5**spz.header.fractional_bits)
    return out.reshape(-1, 3)


def unpack_rotations(spz: Spz) -> np.ndarray:
    """(N, 4) wxyz, unit but for rounding: of x y z, or (from version 3) of the smallest three."""
    stream = spz.streams[4]
    out = np.empty((spz.header.count, 4), np.float32)
    if spz.header.version < 3:
        xyz = codes(stream, 3) / np.float32(127.5) - np.float32(1)
        out[:, 1:] = xyz
        out[:, 0] = np.sqrt(np.maximum(0, 1 - (xyz * xyz).sum(1)))
        return out
    words = np.frombuffer(stream, "<u4")
    largest = words >> 30  # 0 to 3: x, y, z or w
    total = np.zeros(len(words), np.float32)
    for step, shift in enumerate((20, 10, 0)):
        code = words >> np.uint32(shift)
        value = (code & 511).astype(np.float32) * SMALL
        value[(code & 512) > 0] *= -1
        total += value * value
        entry = step + (largest <= step)  # the step-th of those that are not the largest
        out[np.arange(len(words)), (entry + 1) % 4] = value
    rest = np.sqrt(np.maximum(0, 1 - total))
    out[np.arange(len(words)), (largest + 1) % 4] = rest
    return out


def unpack_harmonics(spz: Spz, findings: list[Finding]) -> np.ndarray:
    """(N, M, 3) coefficients, the first not filled in; of degree 4 those up to degree 3."""
    there = REST[spz.header.degree]
    kept = min(there, REST[3])
    if kept < there:
        what = f"{there - kept} coefficients of SH degree 4 a splat"
        findings.append(
            Finding(what, 0, "left out, degree 3 is drawn", file=spz.header.file, repaired=False)
        )
    sh = np.empty((spz.header.count, 1 + kept, 3), np.float32)
    if kept:
        coded = codes(spz.streams[5], 3 * there).reshape(-1, there, 3)
        np.subtract(coded[:, :kept], np.float32(128), out=sh[:, 1:], dtype=np.float32)
        sh[:, 1:] /= 128
    return sh


def axis_up(spz: Spz, findings: list[Finding]) -> str:
    """The file's axis that points up.  Raises BadFile for axes that are a mirror image."""
    told = spz.extensions.get(AXES_EXTENSION, b"")
    others = [kind for kind in spz.extensions if kind != AXES_EXTENSION]
    if others:
        what = f"extensions {', '.join(f'{kind:#010x}' for kind in others)}"
        findings.append(Finding(what, 0, "not looked at", file=spz.header.file, repaired=False))
    number = int.from_bytes(told, "little") if len(told) == 4 else 0
    if not 1 <= number <= len(NAMED_AXES):
        return "+Y"
    axes = NAMED_AXES[number - 1]
    if not right_handed(axes):
        raise BadFile(
            f"{spz.header.file} has the axes {axes}, a mirror image of ours; write it again with "
            "RUB, the format's own."
        )
    place = next(i for i, letter in enumerate(axes) if letter in "UD")
    return ("+" if axes[place] == "U" else "-") + "XYZ"[place]


def right_handed(axes: str) -> bool:
    """Whether axes such as RUB (right, up, back) are a right-handed frame."""
    directions = {"R": (0, 1), "L": (0, -1), "U": (1, 1), "D": (1, -1), "B": (2, 1), "F": (2, -1)}
    frame = np.zeros((3, 3))
    for row, letter in enumerate(axes):
        column, sign = directions[letter]
        frame[row, column] = sign
    return np.linalg.det(frame) > 0
