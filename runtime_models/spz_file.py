"""The .spz container (Niantic): its header, and its six streams decompressed within bounds.

Versions 1 to 3 are one gzip stream (or, raw, none) of a header of 16 bytes and the streams one
after another; version 4 is a plain header of 32 bytes, extensions, a table, and a zstd stream each.
"""

import struct
import zlib
from dataclasses import dataclass

from runtime_models.model import BadFile

MAGIC = b"NGSP"
GZIP = b"\x1f\x8b"
LEGACY_HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, SH degree, bits, flags, 0
HEADER = struct.Struct("<4sIIBBBBI12x")  # the same with the number of streams, and where the table
TABLE_ROW = struct.Struct("<QQ")  # compressed, decompressed bytes of a stream
EXTENSION = struct.Struct("<II")  # type, bytes that follow
ANTIALIASED, EXTENSIONS = 1, 2  # flags
REST = (0, 3, 8, 15, 24)  # coefficients beyond the first, by SH degree
MOST_FRACTIONAL_BITS = 30

# A header may claim no more than this: real scenes pack 2 to 8 times, flat test data up to 30.
MOST_RATIO = 32  # decompressed bytes a byte of the file
ALWAYS_FREE = 1 << 24  # decompressed bytes that any file may have
MOST_EXTENSION_BYTES = 1 << 16


@dataclass(frozen=True)
class SpzHeader:
    version: int
    count: int  # splats
    degree: int  # of spherical harmonics, 0 to 4
    fractional_bits: int  # of the places
    flags: int
    file: str  # for messages

    @property
    def sizes(self) -> tuple[int, ...]:
        """Bytes of places, alphas, colours, scales, rotations and harmonics."""
        place, rotation = (6 if self.version == 1 else 9), (4 if self.version >= 3 else 3)
        return tuple(self.count * n for n in (place, 1, 3, 3, rotation, 3 * REST[self.degree]))


@dataclass(frozen=True)
class Spz:
    """A file's streams, and whatever else it holds."""

    header: SpzHeader
    streams: tuple[memoryview, ...]  # places (and one byte more, so that a word fits at each
    #                                  code), alphas, colours, scales, rotations, harmonics
    extensions: dict[int, bytes]


def is_spz(head: bytes) -> bool:
    """Whether a file begins as one: plainly, or with a gzip stream of one."""
    if head[:2] == GZIP:
        try:
            head = zlib.decompressobj(31).decompress(head, len(MAGIC))
        except zlib.error:
            return False
    return head[:4] == MAGIC


def unpack_spz(data: bytes, file: str) -> Spz:
    """The container of a whole file in memory.  Raises BadFile."""
    if data[:4] != MAGIC and data[:2] != GZIP:
        raise BadFile(f"{file} begins neither with NGSP nor as gzip, as an .spz does.")
    if data[:4] == MAGIC and int.from_bytes(data[4:8], "little") >= 4:
        return unpack_zstd(data, file)
    return unpack_legacy(data, file)


def checked(header: SpzHeader, size: int) -> SpzHeader:
    """The header, believable for a file of `size` bytes.  Raises BadFile."""
    file = header.file
    if not 1 <= header.version <= 4:
        raise BadFile(f"{file} is .spz version {header.version}; 1 to 4 are known.")
    if header.degree >= len(REST):
        raise BadFile(f"{file} says SH degree {header.degree}; an .spz has 0 to 4.")
    if header.fractional_bits > MOST_FRACTIONAL_BITS:
        raise BadFile(
            f"{file} says {header.fractional_bits} fractional bits; an .spz has 0 to "
            f"{MOST_FRACTIONAL_BITS}."
        )
    if header.count == 0:
        raise BadFile(f"{file} has no splats.")
    needed = sum(header.sizes)
    if needed > max(MOST_RATIO * size, ALWAYS_FREE):
        raise BadFile(
            f"{file} says that it has {header.count:,} splats, {needed:,} bytes, out of {size:,}: "
            f"more than {MOST_RATIO} times as many; its header is wrong."
        )
    return header


def unpack_legacy(data: bytes, file: str) -> Spz:
    """Versions 1 to 3, compressed or raw."""
    inflate = Inflate(data, file) if data[:2] == GZIP else Raw(data)
    head = inflate.take(LEGACY_HEADER.size)
    if len(head) < LEGACY_HEADER.size or head[:4] != MAGIC:
        raise BadFile(f"{file}: its gzip stream does not begin with NGSP, as an .spz does.")
    _, version, count, degree, bits, flags, _ = LEGACY_HEADER.unpack(head)
    if version >= 4:
        raise BadFile(f"{file} is .spz version {version} inside gzip; 1 to 3 are there.")
    header = checked(SpzHeader(version, count, degree, bits, flags, file), len(data))
    needed = sum(header.sizes)
    body = inflate.take(needed)
    if len(body) < needed:
        raise BadFile(
            f"{file} is cut off: {count:,} splats need {needed:,} bytes, not {len(body):,}."
        )
    streams, at = [], 0
    for size in header.sizes:
        streams.append(memoryview(body)[at : at + size + (at == 0)])
        at += size
    rest = inflate.take(MOST_EXTENSION_BYTES)
    extensions = read_extensions(rest) if flags & EXTENSIONS else {}
    return Spz(header, tuple(streams), extensions)


class Raw:
    """Bytes as they are, taken piece by piece."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, size: int) -> bytes:
        part = self._data[self._at : self._at + size]
        self._at += len(part)
        return part


class Inflate:
    """A gzip stream, taken piece by piece: never more than is asked for."""

    def __init__(self, data: bytes, file: str) -> None:
        self._data, self._file, self._zlib = data, file, zlib.decompressobj(31)

    def take(self, size: int) -> bytes:
        """`size` bytes, fewer at the end.  Raises BadFile."""
        try:
            part = self._zlib.decompress(self._data, size)
        except zlib.error as error:
            raise BadFile(f"{self._file}: its gzip stream is broken ({error}).") from error
        self._data = self._zlib.unconsumed_tail
        return part


def unpack_zstd(data: bytes, file: str) -> Spz:
    """Version 4."""
    if len(data) < HEADER.size:
        raise BadFile(f"{file} is cut off in its header, {len(data)} bytes.")
    _, version, count, degree, bits, flags, streams, table = HEADER.unpack_from(data)
    header = checked(SpzHeader(version, count, degree, bits, flags, file), len(data))
    sizes = [size for size in header.sizes if size]
    at = table + streams * TABLE_ROW.size
    if streams != len(sizes) or table < HEADER.size or at > len(data):
        raise BadFile(
            f"{file} has {streams} streams and their table at byte {table}; SH degree {degree} "
            f"needs {len(sizes)} and {len(data):,} bytes are there."
        )
    parts = []
    for i, size in enumerate(sizes):
        packed, unpacked = TABLE_ROW.unpack_from(data, table + i * TABLE_ROW.size)
        if unpacked != size or packed > len(data) - at:
            raise BadFile(
                f"{file}: stream {i} is said to be {packed:,} bytes that become {unpacked:,}; "
                f"{count:,} splats need {size:,}, and {len(data) - at:,} bytes are left."
            )
        part = decompress_zstd(memoryview(data)[at : at + packed], size, f"{file}: stream {i}")
        parts.append(part if i == 0 else part[:-1])
        at += packed
    parts += [memoryview(b"")] * (len(header.sizes) - len(parts))
    extensions = read_extensions(data[HEADER.size : table]) if flags & EXTENSIONS else {}
    return Spz(header, tuple(parts), extensions)


def decompress_zstd(packed: memoryview, size: int, what: str) -> memoryview:
    """Exactly `size` bytes, and a zero.  Raises BadFile."""
    import zstandard

    view, at = memoryview(bytearray(size + 1)), 0
    try:
        with zstandard.ZstdDecompressor().stream_reader(packed) as stream:
            while at < size and (read := stream.readinto(view[at:size])):
                at += read
            more = stream.read(1)
    except zstandard.ZstdError as error:
        raise BadFile(f"{what} is broken ({error}).") from error
    if at < size or more:
        raise BadFile(f"{what} becomes {'more' if more else f'{at:,}'} bytes, expected {size:,}.")
    return view


def read_extensions(data: bytes) -> dict[int, bytes]:
    """{type: content} of records back to back, as far as they are whole."""
    found, at = {}, 0
    while at + EXTENSION.size <= len(data):
        kind, size = EXTENSION.unpack_from(data, at)
        at += EXTENSION.size
        if size > len(data) - at:
            break
        found[kind] = data[at : at + size]
        at += size
    return found
