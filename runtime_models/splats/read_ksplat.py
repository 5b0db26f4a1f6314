"""The .ksplat format (GaussianSplats3D): sections of rows, whole or halved; SH degree 0 to 3.

A header of 4096 bytes, one of 1024 for each section, then for each section the lengths of its
partly filled buckets, the buckets' centres, and the rows; from level 1 on, places are 16 bits from
the centre of their bucket.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading, empty_splats

VERSION = b"\0\1"  # the first bytes: 0.1
HEADER_SIZE, SECTION_SIZE = 4096, 1024
HEADER = struct.Struct("<BB2xIIIIH14xff")  # version, sections' room, sections, splats' room,
#                                            splats, level, least and largest 8-bit harmonic
SECTION = struct.Struct("<IIIIfHxxII4x")
BUCKETS = struct.Struct("<IIH")  # full, partly filled; SH degree
BUCKETS_AT = 32
HARMONICS = (0, 9, 24, 45)  # numbers a splat beyond the first three, by SH degree; 3 is written
#                              by other converters, GaussianSplats3D itself stops at 2
UNPACKED = 64  # bytes a splat of what is needed on the way, without its harmonics
LAST_CODE, TELLING = 65534, 100  # from where a code is the last; splats that tell something
RANGE = 32767  # codes on either side of a bucket's centre, where a section does not say
BYTE_HARMONIC = 1.5  # largest 8-bit harmonic, where the header does not say


@dataclass(frozen=True)
class Header:
    level: int  # 0: floats; 1: halves; 2: halves, harmonics in bytes
    sections: int
    count: int  # splats
    least: float  # harmonic of byte 0
    most: float  # of byte 255
    file: str


@dataclass(frozen=True)
class SplatSection:
    count: int
    room: int  # rows, those that nothing was put in with them
    bucket_size: int  # splats of a full bucket
    block_m: float  # edge of a bucket
    range: int
    full: int  # buckets
    partly: int
    degree: int
    lengths_at: int  # bytes from the file's beginning
    centers_at: int
    rows_at: int
    end: int


def read_raw_ksplat(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0 to 3; as in COLMAP, y down.  Raises BadFile."""
    with path.open("rb") as file:  # what is none is not read as a whole to say so
        head = file.read(HEADER_SIZE)
    memory = reading.within(path).account
    if head[:2] == VERSION:
        memory.charge(path.stat().st_size, "its bytes")
    data = path.read_bytes() if head[:2] == VERSION else head
    header = read_header(data, path.name)
    sections = read_sections(data, header)
    degree = max((section.degree for section in sections), default=0)
    raw = RawSplats(
        **empty_splats(header.count, (degree + 1) ** 2, memory),
        file=path.name,
        format="ksplat",
        log_scales=False,
        logits=False,
        memory=memory,
    )
    raw.sh[:, 1:] = 0
    first = 0
    for section in sections:
        rows = slice(first, first + section.count)
        decoded = section.count * (UNPACKED + 4 * HARMONICS[section.degree])
        with memory.lend(decoded, f"{section.count:,} splats"):
            fill(raw, rows, data, header, section)
        first += section.count
        reading.report(f"reading {path.name}", first / header.count)
    memory.release(len(data))
    return raw


def fill(raw: RawSplats, rows: slice, data: bytes, header: Header, section: SplatSection) -> None:
    """Puts the splats of a section into their rows."""
    kind = row_of(header.level, section.degree)
    table = np.frombuffer(data, kind, section.count, section.rows_at)
    means = raw.means[rows]
    means[:] = table["mean"]
    if header.level:
        raw.findings = (*raw.findings, *thrown_to_ends(table["mean"], header.file))
        means -= section.range
        means *= section.block_m / 2 / section.range
        means += centers_of(data, header, section)
    raw.scales[rows], raw.wxyz[rows] = table["scale"], table["wxyz"]
    rgba = table["rgba"] / np.float32(255)
    raw.opacity[rows] = rgba[:, 3]
    raw.sh[rows, 0] = (rgba[:, :3] - np.float32(0.5)) / np.float32(C0)
    unpack_harmonics(table["sh"], header, raw.sh[rows])


def read_header(data: bytes, file: str) -> Header:
    """The main header, believable for so many bytes.  Raises BadFile."""
    if len(data) < HEADER_SIZE:
        raise BadFile(f"{file} has {len(data)} bytes, a .ksplat begins with {HEADER_SIZE}.")
    major, minor, sections, _, _, count, level, least, most = HEADER.unpack_from(data)
    if bytes((major, minor)) != VERSION:
        raise BadFile(f"{file} is .ksplat version {major}.{minor}; 0.1 is known.")
    if level > 2:
        raise BadFile(f"{file} has compression level {level}; a .ksplat has 0, 1 or 2.")
    if count == 0:
        raise BadFile(f"{file} has no splats.")
    if HEADER_SIZE + sections * SECTION_SIZE > len(data):
        raise BadFile(f"{file} has {len(data):,} bytes, too few for its {sections:,} sections.")
    least, most = least or -BYTE_HARMONIC, most or BYTE_HARMONIC
    if level == 2 and not -1e6 < least < most < 1e6:
        raise BadFile(f"{file} says that its harmonics lie from {least:g} to {most:g}.")
    return Header(level, sections, count, least, most, file)


def read_sections(data: bytes, header: Header) -> list[SplatSection]:
    """Those that hold splats, each with its parts inside the file.  Raises BadFile."""
    out, at = [], HEADER_SIZE + header.sections * SECTION_SIZE
    for i in range(header.sections):
        section = read_section(data, header, i, at)
        at = section.end
        out += [section] if section.count else []
    found = sum(section.count for section in out)
    if found != header.count:
        raise BadFile(
            f"{header.file} says that it has {header.count:,} splats, its sections {found:,}; its "
            "header is wrong."
        )
    return out


def read_section(data: bytes, header: Header, i: int, at: int) -> SplatSection:
    """The i-th, whose parts begin at byte `at`.  Raises BadFile."""
    begins = HEADER_SIZE + i * SECTION_SIZE
    count, room, bucket_size, buckets, block, center_size, steps, _ = SECTION.unpack_from(
        data, begins
    )
    full, partly, degree = BUCKETS.unpack_from(data, begins + BUCKETS_AT)
    what = f"{header.file}, section {i}"
    if degree >= len(HARMONICS):
        raise BadFile(f"{what} says SH degree {degree}; a .ksplat has 0 to 3.")
    if count > room:
        raise BadFile(f"{what} has {count:,} splats in room for {room:,}.")
    centers_at = at + 4 * partly
    rows_at = centers_at + center_size * buckets
    end = rows_at + room * row_of(header.level, degree).itemsize
    if end > len(data):
        raise BadFile(f"{what} ends at byte {end:,} of {len(data):,}: the file is cut off.")
    if header.level and count:
        if full + partly > buckets or center_size != 12:
            raise BadFile(
                f"{what} has {full} + {partly} buckets in room for {buckets}, {center_size} bytes "
                "each; a .ksplat has 12."
            )
        if not 0 < block < 1e18 or steps >= 1 << 24:
            raise BadFile(f"{what} has buckets of {block:g} m in {steps:,} steps.")
    return SplatSection(
        count, room, bucket_size, block, steps or RANGE, full, partly, degree, at, centers_at,
        rows_at, end,
    )  # fmt: skip


def row_of(level: int, degree: int) -> np.dtype:
    """One splat as it is filed."""
    place, number, harmonic = (("<f4",) * 3, ("<u2", "<f2", "<f2"), ("<u2", "<f2", "u1"))[level]
    return np.dtype(
        [
            ("mean", place, 3),
            ("scale", number, 3),
            ("wxyz", number, 4),
            ("rgba", "u1", 4),
            ("sh", harmonic, HARMONICS[degree]),
        ]
    )


def thrown_to_ends(codes: np.ndarray, file: str) -> list[Finding]:
    """What is said of codes (N, 3) of which an axis knows the two ends of its range alone.

    GaussianSplats3D's writer makes them of scenes that are flat in y or z.
    """
    ends = (codes == 0) | (codes >= LAST_CODE)
    lost = ends.all(0) & (codes == 0).any(0) & (codes != 0).any(0)
    if len(codes) < TELLING or not lost.any():
        return []
    axes = ", ".join(np.array(list("xyz"))[lost])
    what = f"{len(codes):,} splats lie at the ends of their blocks in {axes}, none between"
    done = "shown as filed; GaussianSplats3D's writer spoils flat scenes so, level 0 is right"
    return [Finding(what, len(codes), done, file=file, repaired=False)]


def centers_of(data: bytes, header: Header, section: SplatSection) -> np.ndarray:
    """(count, 3) metres: the centre of each splat's bucket.  Raises BadFile."""
    partly = np.frombuffer(data, "<u4", section.partly, section.lengths_at)
    buckets = section.full + section.partly
    centers = np.frombuffer(data, "<f4", 3 * buckets, section.centers_at).reshape(-1, 3)
    whole = section.full * section.bucket_size
    last = whole + np.cumsum(partly, dtype=np.uint64)  # after the last splat of each
    held = int(last[-1]) if section.partly else whole
    if not section.count <= held <= max(section.room, whole):
        raise BadFile(f"{header.file}: its buckets hold {held:,} of {section.count:,} splats.")
    splat = np.arange(section.count)
    bucket = np.searchsorted(last, splat, side="right") + section.full
    if section.full:
        bucket = np.where(splat < whole, splat // max(section.bucket_size, 1), bucket)
    return centers[bucket]


def unpack_harmonics(coded: np.ndarray, header: Header, out: np.ndarray) -> None:
    """Into out (n, M, 3), but for the first coefficient: in each band red, green, then blue."""
    values = coded.astype(np.float32)
    if header.level == 2:
        values *= (header.most - header.least) / 255
        values += header.least
    # Degree 3 is beyond GaussianSplats3D; gaussforge, which writes it, takes all bands as one.
    bands = {0: (), 9: (3,), 24: (3, 5), 45: (15,)}[coded.shape[1]]
    first = 1
    for size in bands:
        columns = 3 * (first - 1)
        part = values[:, columns : columns + 3 * size].reshape(-1, 3, size)
        out[:, first : first + size] = part.transpose(0, 2, 1)
        first += size
