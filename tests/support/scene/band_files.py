"""TIFFs of several bands, written here byte by byte: any order, layout, predictor and packing."""

import struct
import zlib
from pathlib import Path

import numpy as np

LETTERS = {"H": (3, "H"), "I": (4, "I"), "Q": (16, "Q"), "s": (2, "s")}
NONE, DEFLATE = 1, 8


def write_bands(
    path: Path, bands: np.ndarray, *, beside: bool = False, order: str = "<", big: bool = False,
    packing: int = NONE, predictor: int = 1, tile: tuple[int, int] | None = None, strip: int = 5,
    no_data: str = "", pages: bool = False, more: dict | None = None,
) -> Path:  # fmt: skip
    """bands (S, H, W).  beside: samples of a pixel together; tile: width and height, multiples of
    16; pages: a page a band; more: tags as (letter, values) that replace those of the picture.
    """
    form = {"order": order, "big": big}
    tags, blocks, at = [], [], 16 if big else 8
    for part in [band[None] for band in bands] if pages else [bands]:
        made = _blocks(part, beside, order, packing, predictor, tile, strip)
        places = list(at + np.cumsum([0, *map(len, made[:-1])]))
        blocks += made
        at += sum(map(len, made))
        tags.append(_tags(part, beside, packing, predictor, tile, strip, no_data, places, made))
    data, start = b"".join(blocks), at
    heads = b""
    for number, each in enumerate(tags):
        last = number == len(tags) - 1
        heads += _page(each | (more or {}), start + len(heads), last, **form)
    mark = {"<": b"II", ">": b"MM"}[order]
    if big:
        head = mark + struct.pack(order + "HHHQ", 43, 8, 0, start)
    else:
        head = mark + struct.pack(order + "HI", 42, start)
    path.write_bytes(head + data + heads)
    return path


def _blocks(bands, beside, order, packing, predictor, tile, strip) -> list[bytes]:
    """Strips or tiles, packed: of all samples together, or of one band after the other."""
    groups = [np.moveaxis(bands, 0, 2)] if beside else [band[..., None] for band in bands]
    out = []
    for group in groups:
        height, width, _ = group.shape
        wide, high = tile or (width, strip)
        for y in range(0, height, high):
            for x in range(0, width, wide):
                block = group[y : y + high, x : x + wide]
                if tile:
                    room = ((0, high - len(block)), (0, wide - block.shape[1]), (0, 0))
                    block = np.pad(block, room)
                data = _predicted(block, order, predictor)
                out.append(zlib.compress(data) if packing == DEFLATE else data)
    return out


def _predicted(block, order, predictor) -> bytes:
    if predictor == 2:
        block = np.diff(block, axis=1, prepend=np.zeros_like(block[:, :1]))
    if predictor == 3:
        size, (rows, wide, samples) = block.dtype.itemsize, block.shape
        high_first = np.ascontiguousarray(block, block.dtype.newbyteorder(">"))
        byte = high_first.view(np.uint8)
        planes = np.moveaxis(byte.reshape(rows, wide * samples, size), 2, 1).reshape(rows, -1)
        steps = planes.reshape(rows, -1, samples)
        return np.diff(steps, axis=1, prepend=np.zeros_like(steps[:, :1])).tobytes()
    return block.astype(block.dtype.newbyteorder(order)).tobytes()


def _tags(bands, beside, packing, predictor, tile, strip, no_data, places, blocks) -> dict:
    count, height, width = bands.shape
    kind = {"u": 1, "i": 2, "f": 3}[bands.dtype.kind]
    tags = {
        256: ("I", [width]), 257: ("I", [height]), 258: ("H", [8 * bands.dtype.itemsize] * count),
        259: ("H", [packing]), 262: ("H", [1]), 277: ("H", [count]),
        284: ("H", [1 if beside else 2]), 317: ("H", [predictor]), 339: ("H", [kind] * count),
    }  # fmt: skip
    lengths = [len(block) for block in blocks]
    if tile:
        tags |= {322: ("I", [tile[0]]), 323: ("I", [tile[1]]), 324: ("I", places),
                 325: ("I", lengths)}  # fmt: skip
    else:
        tags |= {273: ("I", places), 278: ("I", [strip]), 279: ("I", lengths)}
    if no_data:
        tags[42113] = ("s", [no_data.encode() + b"\0"])
    return tags


def _page(tags: dict, at: int, last: bool, order: str, big: bool) -> bytes:
    """A page's table at a place of the file, with what does not fit into it behind it."""
    row, word = (20, "Q") if big else (12, "I")
    room = 8 if big else 4
    behind = at + (8 if big else 2) + row * len(tags) + room
    rows, more = b"", b""
    for tag, (letter, values) in sorted(tags.items()):
        kind, form = LETTERS[letter]
        text = letter == "s"
        data = values[0] if text else struct.pack(f"{order}{len(values)}{form}", *values)
        if len(data) > room:
            field, more = struct.pack(order + word, behind + len(more)), more + data
        else:
            field = data.ljust(room, b"\0")
        count = len(data) if text else len(values)
        rows += struct.pack(order + "HH" + word, tag, kind, count) + field
    head = struct.pack(order + ("Q" if big else "H"), len(tags))
    following = 0 if last else behind + len(more)
    return head + rows + struct.pack(order + word, following) + more
