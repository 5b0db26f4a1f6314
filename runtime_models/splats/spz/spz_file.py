"""The .spz container (Niantic): its header, and its six streams, decompressed piece by piece.

Versions 1 to 3 are one gzip stream (or, raw, none) of a header of 16 bytes and the streams one
after another; version 4 is a plain header of 32 bytes, extensions, a table, and a zstd stream each.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import itemgetter

from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.model import BadFile

MAGIC = b"NGSP"
GZIP = b"\x1f\x8b"
LEGACY_HEADER = struct.Struct("<4sIIBBBB")  # magic, version, count, SH degree, bits, flags, 0
HEADER = struct.Struct("<4sIIBBBBI12x")  # the same with the number of streams, and where the table
TABLE_ROW = struct.Struct("<QQ")  # compressed, decompressed bytes of a stream
EXTENSION = struct.Struct("<II")  # type, bytes that follow
ANTIALIASED, EXTENSIONS = 1, 2  # flags
REST = (0, 3, 8, 15, 24)  # coefficients beyond the first, by SH degree
MOST_FRACTIONAL_BITS = 30

MOST_EXTENSION_BYTES = 1 << 16
PIECE = 1 << 16  # bytes of a gzip stream that are given to zlib at a time


@dataclass(frozen=True)
class SpzHeader:
    version: int
    count: int  # splats
    degree: int  # of spherical harmonics, 0 to 4
    fractional_bits: int  # of the places
    flags: int
    file: str  # for messages

    @property
    def widths(self) -> tuple[int, ...]:
        """Bytes a splat of places, alphas, colours, scales, rotations and harmonics."""
        place, rotation = (6 if self.version == 1 else 9), (4 if self.version >= 3 else 3)
        return place, 1, 3, 3, rotation, 3 * REST[self.degree]

    @property
    def sizes(self) -> tuple[int, ...]:
        """The same in bytes of all splats."""
        return tuple(self.count * width for width in self.widths)


class Spz:
    """A file's header, and its streams one after the other: take(size) gives their next bytes.

    The streams are places, alphas, colours, scales, rotations and harmonics.
    """

    def __init__(self, header: SpzHeader, source: "Inflate | Raw | Zstd", extensions: bytes | None):
        self.header, self._source, self._extensions, self._taken = header, source, extensions, 0
        self._last: bytes | bytearray = b""  # taken before the extensions

    def read(self, size: int) -> bytes | bytearray:
        """Exactly `size` bytes.  Raises BadFile."""
        part = self._source.read(size)
        self._taken += len(part)
        if len(part) < size:
            count, needed = self.header.count, sum(self.header.sizes)
            raise BadFile(
                f"{self.header.file} is cut off: {count:,} splats need {needed:,} bytes, not "
                f"{self._taken:,}."
            )
        if self._extensions is None and self.header.flags & EXTENSIONS:
            self._last = (self._last + part[-MOST_EXTENSION_BYTES:])[-MOST_EXTENSION_BYTES:]
        return part

    def extensions(self) -> dict[int, bytes]:
        """{type: content}; to be asked when all streams have been taken.  Raises BadFile."""
        data: bytes | bytearray | None = self._extensions
        if data is None:  # after the streams
            data = self._what_follows()
        return read_extensions(data) if self.header.flags & EXTENSIONS else {}

    def _what_follows(self) -> bytearray:
        """The first bytes after the streams.  Raises BadFile where the splats of another version,
        and whole records if any, take just as many as there are.

        The format's own writer puts the version that it is asked for over the body of another one.
        """
        header, size = self.header, sum(self.header.sizes)
        said = bool(header.flags & EXTENSIONS)
        ends = {v: sum(replace(header, version=v).sizes) - size for v in (1, 2, 3)}  # from ours
        least = -MOST_EXTENSION_BYTES if said else 1
        ends = {v: end for v, end in sorted(ends.items(), key=itemgetter(1)) if end >= least}
        kept = {v: bytearray(self._last[end:] if end < 0 else b"") for v, end in ends.items()}
        more, most = 0, max(ends.values()) + MOST_EXTENSION_BYTES if ends else 0
        while more < most and (part := self._source.read(min(PIECE, most - more))):
            for version, end in ends.items():
                after = part[max(end - more, 0) :]
                kept[version] += after[: MOST_EXTENSION_BYTES - len(kept[version])]
            more += len(part)
        whole = [version for version, rest in kept.items() if are_records(rest)]  # first the first
        as_many = [version for version, end in ends.items() if 0 < more == end]
        found = (whole or as_many or [header.version])[0]
        if found != header.version:
            raise BadFile(
                f"{header.file} says version {header.version} and has as many bytes as "
                f"{header.count:,} splats of version {found} take; its header is wrong, export it "
                "again."
            )
        return kept.get(found, bytearray())


def count_in(head: bytes, file: str) -> int:
    """The splats that a file of these first bytes says that it has.  Raises BadFile."""
    if head[:2] == GZIP:
        head = Inflate(head, file).read(LEGACY_HEADER.size)
    if len(head) < LEGACY_HEADER.size or head[:4] != MAGIC:
        raise BadFile(f"{file} does not begin with NGSP, as an .spz does.")
    return LEGACY_HEADER.unpack_from(head)[2]


def is_spz(head: bytes) -> bool:
    """Whether a file begins as one: plainly, or up to version 3 with a gzip stream of one.

    Version 4 is plain: in a gzip stream it was packed once more, as any other file may be.
    """
    if head[:2] == GZIP:
        try:
            head = zlib.decompressobj(31).decompress(head, 8)
        except zlib.error:
            return False
        return head[:4] == MAGIC and int.from_bytes(head[4:8], "little") < 4
    return head[:4] == MAGIC


def unpack_spz(data: bytes, file: str, memory: Account) -> Spz:
    """The container of a whole file in memory, nothing of it decompressed yet.  Raises BadFile.

    What decompressing takes by itself is charged; the splats are charged by their reader.
    """
    if data[:4] != MAGIC and data[:2] != GZIP:
        raise BadFile(f"{file} begins neither with NGSP nor as gzip, as an .spz does.")
    if data[:4] == MAGIC and int.from_bytes(data[4:8], "little") >= 4:
        return unpack_zstd(data, file, memory)
    return unpack_legacy(data, file)


def checked(header: SpzHeader) -> SpzHeader:
    """The header, believable.  Raises BadFile."""
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
    return header


def unpack_legacy(data: bytes, file: str) -> Spz:
    """Versions 1 to 3, compressed or raw."""
    inflate = Inflate(data, file) if data[:2] == GZIP else Raw(data)
    head = inflate.read(LEGACY_HEADER.size)
    if len(head) < LEGACY_HEADER.size or head[:4] != MAGIC:
        raise BadFile(f"{file}: its gzip stream does not begin with NGSP, as an .spz does.")
    _, version, count, degree, bits, flags, _ = LEGACY_HEADER.unpack(head)
    if version >= 4:
        raise BadFile(f"{file} is .spz version {version} inside gzip; 1 to 3 are there.")
    header = checked(SpzHeader(version, count, degree, bits, flags, file))
    return Spz(header, inflate, None)


class Raw:
    """Bytes as they are, taken piece by piece."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def read(self, size: int) -> bytes:
        part = self._data[self._at : self._at + size]
        self._at += len(part)
        return part


class Inflate:
    """A gzip stream, taken piece by piece: never more than is asked for."""

    def __init__(self, data: bytes, file: str) -> None:
        self._data, self._at, self._file = memoryview(data), 0, file
        self._zlib = zlib.decompressobj(31)

    def read(self, size: int) -> bytes:
        """`size` bytes, fewer at the end.  Raises BadFile."""
        parts, left = [], size
        while left and not self._zlib.eof:
            given: bytes | memoryview = self._zlib.unconsumed_tail
            if not given:
                given = self._data[self._at : self._at + PIECE]
                self._at += len(given)
            try:
                part = self._zlib.decompress(given, left)
            except zlib.error as error:
                raise BadFile(f"{self._file}: its gzip stream is broken ({error}).") from error
            if not part and not given:
                break  # cut off
            parts.append(part)
            left -= len(part)
        return b"".join(parts)


def unpack_zstd(data: bytes, file: str, memory: Account) -> Spz:
    """Version 4."""
    if len(data) < HEADER.size:
        raise BadFile(f"{file} is cut off in its header, {len(data)} bytes.")
    _, version, count, degree, bits, flags, streams, table = HEADER.unpack_from(data)
    header = checked(SpzHeader(version, count, degree, bits, flags, file))
    sizes = [size for size in header.sizes if size]
    at = table + streams * TABLE_ROW.size
    if streams != len(sizes) or table < HEADER.size or at > len(data):
        raise BadFile(
            f"{file} has {streams} streams and their table at byte {table}; SH degree {degree} "
            f"needs {len(sizes)} and {len(data):,} bytes are there."
        )
    packed_streams = []
    for i, size in enumerate(sizes):
        packed, unpacked = TABLE_ROW.unpack_from(data, table + i * TABLE_ROW.size)
        if unpacked != size or packed > len(data) - at:
            raise BadFile(
                f"{file}: stream {i} is said to be {packed:,} bytes that become {unpacked:,}; "
                f"{count:,} splats need {size:,}, and {len(data) - at:,} bytes are left."
            )
        packed_streams.append((memoryview(data)[at : at + packed], size))
        at += packed
    extensions = data[HEADER.size : table] if flags & EXTENSIONS else b""
    return Spz(header, Zstd(packed_streams, file, memory), extensions)


class Zstd:
    """Streams of zstd one after the other, taken piece by piece; a piece lies within one."""

    def __init__(self, packed: list[tuple[memoryview, int]], file: str, memory: Account) -> None:
        self._packed, self._file, self._opened = packed, file, 0
        self._memory, self._window = memory, 0  # bytes that the open stream looks back on
        self._at = self._size = 0  # decompressed bytes, of the stream that is open

    def read(self, size: int) -> bytearray:
        """`size` bytes.  Raises BadFile."""
        import zstandard

        if self._at == self._size:
            data, self._size = self._packed[self._opened]
            self._charge(data)
            self._stream = zstandard.ZstdDecompressor().stream_reader(data)
            self._opened, self._at = self._opened + 1, 0
        out, had = bytearray(size), 0
        what, more = f"{self._file}: stream {self._opened - 1}", b""
        try:
            while had < size and (read := self._stream.readinto(memoryview(out)[had:])):
                had += read
            self._at += had
            if self._at == self._size:
                more = self._stream.read(1)
        except zstandard.ZstdError as error:
            raise BadFile(f"{what} is broken ({error}).") from error
        if had < size or more:
            became = "more" if more else f"{self._at:,}"
            raise BadFile(f"{what} becomes {became} bytes, expected {self._size:,}.")
        return out

    def _charge(self, data: memoryview) -> None:
        """For the window of the next stream: a frame of some bytes may ask for 128 MB."""
        import zstandard

        try:
            frame = zstandard.get_frame_parameters(data)
        except zstandard.ZstdError as error:
            what = f"{self._file}: stream {self._opened}"
            raise BadFile(f"{what} is broken ({error}).") from error
        self._memory.release(self._window)
        self._window = frame.window_size
        self._memory.charge(self._window, "unpacking it")


def read_extensions(data: bytes | bytearray) -> dict[int, bytes]:
    """{type: content} of records back to back, as far as they are whole."""
    return {kind: bytes(data[at : at + size]) for kind, at, size in records(data)}


def are_records(data: bytes | bytearray) -> bool:
    """Whether it is whole records and zeros behind them; 0 is no type to begin with."""
    end, first = 0, 0
    for kind, at, size in records(data):
        end, first = at + size, first or kind
        if not first:
            return False
    return end > 0 and not any(data[end:])


def records(data: bytes | bytearray) -> Iterator[tuple[int, int, int]]:
    """(type, where its content begins, bytes of it) of each whole record."""
    at = 0
    while at + EXTENSION.size <= len(data):
        kind, size = EXTENSION.unpack_from(data, at)
        at += EXTENSION.size
        if size > len(data) - at:
            break
        yield kind, at, size
        at += size
