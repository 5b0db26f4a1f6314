"""Scenes of XGrids' LCC and LCC2, made by hand: no writer of them is to be had."""

import json
import struct
from pathlib import Path

import numpy as np

RANGES = {
    "scale": ([0.001, 0.002, 0.003], [0.4, 0.5, 0.6]), "shcoef": ([-2, -1, -3], [1, 2, 3]),
    "envscale": ([0.01, 0.01, 0.01], [5, 6, 7]), "envshcoef": ([-1, -1, -1], [1, 1, 1.5]),
}  # fmt: skip


def random_rows(count: int, seed: int = 0) -> tuple[bytes, bytes]:
    """(32 bytes, 64 bytes) a splat: itself, and its harmonics."""
    rng = np.random.default_rng(seed)
    splats, rest = b"", b""
    for _ in range(count):
        splats += struct.pack("<3f", *rng.normal(0, 2, 3)) + bytes(rng.integers(1, 255, 4).tolist())
        splats += struct.pack("<3H", *rng.integers(0, 65536, 3))
        splats += struct.pack("<I", quaternion(rng)) + bytes(6)
        rest += struct.pack("<16I", *rng.integers(0, 1 << 32, 15), 0)
    return splats, rest


def quaternion(rng: np.random.Generator) -> int:
    """A unit quaternion as three entries of 10 bits and which one is left out, the largest."""
    xyzw = rng.normal(size=4)
    xyzw /= np.linalg.norm(xyzw)
    largest = int(np.abs(xyzw).argmax())
    xyzw *= np.sign(xyzw[largest])
    small = [n for i, n in enumerate(xyzw) if i != largest]
    codes = [round((n / 2**0.5 + 0.5) * 1023) for n in small]
    return largest << 30 | codes[2] << 20 | codes[1] << 10 | codes[0]


def write_lcc(
    folder: Path,
    cells: tuple[tuple[int, ...], ...] = ((5, 2), (0, 0), (7, 3)),
    harmonics: bool = True,
    environment: int = 3,
) -> Path:
    """meta.lcc and its files; cells: of each how many splats of each level, the finest first.

    The last cell lies first in data.bin, behind a gap: places are what index.bin says.
    """
    folder.mkdir(parents=True, exist_ok=True)
    levels = len(cells[0])
    data, rest = bytes(96), bytes(192)
    index: dict[int, bytes] = {}
    for number in reversed(range(len(cells))):
        record = struct.pack("<2h", number, -number)
        for level, count in enumerate(cells[number]):
            record += struct.pack("<iqi", count, len(data), 32 * count)
            splats, more = random_rows(count, 10 * number + level)
            data, rest = data + splats, rest + more
        index[number] = record
    put(folder / "index.bin", b"".join(index[i] for i in range(len(cells))))
    put(folder / "data.bin", data)
    names = list(RANGES)  # also where there are no harmonics
    meta = {
        "version": "5.0", "totalLevel": levels, "fileType": "Quality" if harmonics else "Portable",
        "splats": [sum(cell[level] for cell in cells) for level in range(levels)],
        "attributes": [{"name": n, "min": RANGES[n][0], "max": RANGES[n][1]} for n in names],
    }  # fmt: skip
    if harmonics:
        put(folder / "shcoef.bin", rest)
    if environment:
        splats, more = random_rows(environment, 99)
        rows = [
            splats[32 * i : 32 * i + 32] + (more[64 * i : 64 * i + 64] if harmonics else b"")
            for i in range(environment)
        ]
        put(folder / "environment.bin", b"".join(rows))
    return put(folder / "meta.lcc", json.dumps(meta).encode())


def put(path: Path, data: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def write_lcc2(
    folder: Path, chunks: dict[str, bytes], levels: list[list[int]], far: int | None = None,
    old: bool = False, ending: str = ".sog",
) -> Path:  # fmt: skip
    """meta.lcc2 and its chunks; levels: of each, the finest first, which of the chunks it shows."""
    for name, data in chunks.items():
        put(folder / name, data)
    depth = len(levels)

    def nodes(level: int) -> list[dict]:
        below = nodes(level - 1) if level else []
        out = [{"data": {"3dgs": {"name": i}}} for i in levels[level]]
        if below:
            out[0]["child"] = {str(i): node for i, node in enumerate(below)} if old else below
        return out

    names = [f"/{n.removesuffix('.sog')}" if old else n for n in chunks]
    root = {"files" if old else "splatFiles": names, "child": nodes(depth - 1)}
    if far is not None:
        root["data"] = {"env": {"name": far}}
    counts = {"total_splats": 0, "lod_3dgs_info": [0] * depth, "lod_level": depth}
    if not old:
        counts = {"totalSplats": 0, "lodSplats": [0] * depth, "totalLevels": depth}
        counts["splatType"] = ending
    text = json.dumps(counts | {"root": root})
    if old:
        text = text[:-1] + ", }"  # as its exporters left it
    return put(folder / "meta.lcc2", text.encode())
