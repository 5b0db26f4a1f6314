"""Files made wrong: bytes, numbers in text, JSON by its structure, and what lies inside archives.

A step is (how, where, what), small whole numbers that hypothesis draws; it always does the same to
the same bytes.
"""

import gzip
import io
import json
import struct
import warnings
import zipfile
import zlib

RAW_KINDS = 11
SPECIAL_INTEGERS = (0, 1, 2, 127, 255, 256, 65535, 1 << 24, (1 << 31) - 1, 1 << 31, (1 << 32) - 1,
                    1 << 40, (1 << 63) - 1, (1 << 64) - 1)  # fmt: skip
SPECIAL_FLOATS = (0.0, -0.0, -1.0, 1e-45, 1e30, 3.4e38, float("inf"), float("-inf"), float("nan"))
SPECIAL_TEXTS = (
    b"0", b"-1", b"1", b"2147483648", b"4294967295", b"18446744073709551615", b"1e308", b"nan",
    b"inf", b"", b"9" * 40, b"0x10", b"../x", b"\xff", b"1.5", b"00",
)  # fmt: skip
DEEP = 3000  # levels of nesting
SPECIAL_VALUES = (
    None, True, False, -1, 0, 1, 2**31, 2**32 - 1, 2**63, 10**400, 1e308, -1e308, 1e-320,
    float("nan"), float("inf"), "", "x", "../../etc/passwd", "/etc/passwd", "\x00",
    "é" * 300, "é" * 150, "\ud800",
    "\n", [], {}, [[]], [None], {"a": 1}, [0] * 50, ["x"] * 20, 0.5, [1, 2, 3], [1e308] * 16,
)  # fmt: skip


def mutate(data: bytes, steps: list[tuple[int, int, int]], kind: str = "") -> bytes:
    """The bytes after all steps; `kind` says how to look inside: json, zip, gzip, glb, spz4."""
    for step in steps:
        inside = INSIDE.get(kind)
        # every third step takes the whole as bytes, also where its inside is known
        data = (
            bytes_changed(data, step) if inside is None or step[0] % 3 == 0 else inside(data, step)
        )
    return data


def bytes_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    how, where, what = step
    how = how // 3 % RAW_KINDS
    at = where % max(len(data), 1) if how != 8 else where % max(min(len(data), 400), 1)
    size = 1 + what % 64
    other = (where * 7919 + what) % max(len(data), 1)
    match how:
        case 0:
            return data[:at] + bytes([(data[at] if data else 0) ^ 1 << what % 8]) + data[at + 1 :]
        case 1:
            return data[:at] + bytes([what % 256]) + data[at + 1 :]
        case 2:
            return data[:at]
        case 3:
            return data[:at] + bytes((what + i) % 256 for i in range(size)) + data[at:]
        case 4:
            return data[:at] + data[at + size :]
        case 5:
            number = SPECIAL_INTEGERS[what % len(SPECIAL_INTEGERS)]
            packed = struct.pack("<Q", number)[: (4, 8, 2, 1)[what // 16 % 4]]
            return data[:at] + packed + data[at + len(packed) :]
        case 6:
            number = SPECIAL_FLOATS[what % len(SPECIAL_FLOATS)]
            packed = struct.pack("<f" if what // 16 % 2 else "<d", number)
            return data[:at] + packed + data[at + len(packed) :]
        case 7:  # two blocks change places
            low, high = sorted((at, other))
            high = max(high, low + size)
            a, b = data[low : low + size], data[high : high + size]
            return data[:low] + b + data[low + size : high] + a + data[high + size :]
        case 8:
            return number_replaced(data, at, SPECIAL_TEXTS[what % len(SPECIAL_TEXTS)])
        case 9:  # a block twice
            return data[: at + size] + data[at : at + size] + data[at + size :]
        case _:  # the same word everywhere
            word = data[at : at + 4]
            return (
                data.replace(word, struct.pack("<I", SPECIAL_INTEGERS[what % 11])) if word else data
            )


def number_replaced(data: bytes, at: int, text: bytes) -> bytes:
    """The first decimal number from `at` on becomes the text."""
    start = at
    while start < len(data) and not 48 <= data[start] <= 57:
        start += 1
    end = start
    while end < len(data) and 48 <= data[end] <= 57:
        end += 1
    return data[:start] + text + data[end:]


def json_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    """One place of the structure: its value swapped for another, dropped, doubled or nested."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return bytes_changed(data, step)
    how, where, what = step
    places = list(places_of(tree))
    if not places:
        return json.dumps(SPECIAL_VALUES[what % len(SPECIAL_VALUES)]).encode()
    holder, key = places[where % len(places)]
    match how // 3 % 6:
        case 0 | 1 | 2:
            holder[key] = SPECIAL_VALUES[what % len(SPECIAL_VALUES)]
        case 3:
            del holder[key]
        case 4:
            other, name = places[(where * 31 + what) % len(places)]
            holder[key] = json.loads(json.dumps(other[name]))
        case _:
            holder[key] = "@nested@"
            text = json.dumps(tree)
            deep = ("[" * DEEP + "]" * DEEP) if what % 2 else '{"a":' * DEEP + "0" + "}" * DEEP
            return text.replace('"@nested@"', deep).encode()
    return json.dumps(tree).encode()


def places_of(tree):
    """(holder, key) of every value, outer ones first."""
    waiting = [tree] if isinstance(tree, dict | list) else []
    while waiting:
        holder = waiting.pop(0)
        keys = holder.keys() if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            yield holder, key
            if isinstance(holder[key], dict | list):
                waiting.append(holder[key])


def kind_of(name: str) -> str:
    """How to look inside a file of that name."""
    endings = {".json": "json", ".npz": "zip", ".shift": "zip", ".sog": "zip", ".pt": "zip",
               ".pth": "zip", ".glb": "glb", ".gltf": "json"}  # fmt: skip
    return next((kind for ending, kind in endings.items() if name.endswith(ending)), "")


def zip_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    """One member changed, or renamed, and zipped again, so that the sum over it is right."""
    how, where, what = step
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except (zipfile.BadZipFile, OSError, ValueError, RuntimeError, NotImplementedError, EOFError,
            zlib.error):  # fmt: skip
        return bytes_changed(data, step)
    if not members:
        return bytes_changed(data, step)
    number = where % len(members)
    name, content = members[number]
    if what % 29 == 0:
        members[number] = (("../" + name, "/" + name, "x" + name, name + "\\..")[how % 4], content)
    elif what % 31 == 0:
        members.append(members[number])
    elif what % 37 == 0:
        del members[number]
    else:
        inner = (how // 3 if how % 2 else how, where // len(members) + where, what)
        members[number] = (name, mutate(content, [inner], kind_of(name)))
    out = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if what % 5 == 0 else zipfile.ZIP_STORED
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", method) as archive:
        warnings.simplefilter("ignore")  # equal names are what is wanted
        for each, body in members:
            archive.writestr(zipfile.ZipInfo(each), body, method)
    return out.getvalue()


def gzip_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    try:
        inner = zlib.decompressobj(31).decompress(data, 1 << 24)
    except zlib.error:
        return bytes_changed(data, step)
    how, where, what = step
    where = where % 32 if what % 2 else where  # half of them in the header
    return gzip.compress(bytes_changed(inner, (how, where, what)), 1, mtime=0)


def spz4_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    """A stream of version 4 changed inside and packed again, its sizes stated anew."""
    import zstandard

    from shapeshift.runtime_models.splats.spz.spz_file import HEADER, TABLE_ROW

    how, where, what = step
    try:
        *_, streams, table = HEADER.unpack_from(data)
        rows = [TABLE_ROW.unpack_from(data, table + i * TABLE_ROW.size) for i in range(streams)]
    except struct.error:
        return bytes_changed(data, step)
    at, parts = table + streams * TABLE_ROW.size, []
    for packed, _ in rows:
        try:
            parts.append(zstandard.ZstdDecompressor().decompress(data[at : at + packed], 1 << 20))
        except (zstandard.ZstdError, MemoryError, OverflowError):
            return bytes_changed(data, step)
        at += packed
    if not parts:
        return bytes_changed(data, step)
    number = where % len(parts)
    changed = bytes_changed(parts[number], (how, where // len(parts), what))
    parts[number] = changed
    packed = [zstandard.ZstdCompressor().compress(part) for part in parts]
    sizes = [len(part) for part in parts]
    if what % 3 == 0:  # the table still says what it said
        sizes = [size for _, size in rows]
    table_bytes = b"".join(TABLE_ROW.pack(len(p), s) for p, s in zip(packed, sizes, strict=True))
    return data[:table] + table_bytes + b"".join(packed)


def glb_changed(data: bytes, step: tuple[int, int, int]) -> bytes:
    """The JSON of a GLB changed by its structure, all lengths stated anew."""
    if len(data) < 20 or data[:4] != b"glTF":
        return bytes_changed(data, step)
    (size,) = struct.unpack_from("<I", data, 12)
    text, rest = data[20 : 20 + size], data[20 + size :]
    if step[2] % 4 == 0:
        rest = bytes_changed(rest, step)
    else:
        text = json_changed(text, step)
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    return head + text + rest


INSIDE = {
    "json": json_changed,
    "zip": zip_changed,
    "gzip": gzip_changed,
    "spz4": spz4_changed,
    "glb": glb_changed,
}
