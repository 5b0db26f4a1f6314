"""Colliders that were made before, in the user's cache: read in a millisecond, not made in ten s.

A file is a digest of what follows, then counts, then the arrays: what does not fit its digest, or
is more than a collider may be, is damaged and made anew.
"""

import hashlib
import os
import re
import stat
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.user_cache import cache_folder
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh

FOLDER = "colliders"
MARK = b"shapeshift collider 1\n"
NAME = re.compile(r"[0-9a-f]{64}\.collider")
MOST_BYTES = 16 << 20  # of one file: 2,500 faces and 16 hulls take 60 kB
MOST_ALL = 256 << 20  # bytes of all files; the ones not used for longest go first
MOST_PARTS, MOST_CORNERS = 64, 1 << 10  # of a collider, of a hull; more were never written
BINARY = getattr(os, "O_BINARY", 0)  # of Windows
Made = tuple[tuple[np.ndarray, ...], TriangleMesh]


def content_key(settings: str, *arrays: np.ndarray | bytes) -> str:
    """A name for what a collider is made of and how: a SHA-256 in hex."""
    digest = hashlib.sha256(MARK + settings.encode())
    for array in arrays:
        if isinstance(array, np.ndarray):
            digest.update(f"{array.shape}{array.dtype.str}".encode())
            digest.update(np.ascontiguousarray(array).data)
        else:
            digest.update(array)
    return digest.hexdigest()


def read_cached(key: str) -> Made | None:
    """The collider of a key; None where there is none that can be used."""
    try:
        path = cache_folder(FOLDER) / f"{key}.collider"
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | BINARY)
        with open(handle, "rb") as file:
            state = os.fstat(handle)
            if not (stat.S_ISREG(state.st_mode) and 0 < state.st_size <= MOST_BYTES):
                return None
            made = unpack(file.read())
        if made is not None:
            os.utime(path)  # used: the last to be removed
    except OSError:
        return None
    return made


def write_cached(key: str, made: Made) -> Path | None:
    """Writes it; where it lies, None where nothing can be written."""
    try:
        folder = cache_folder(FOLDER)
        write_whole(folder / f"{key}.collider", pack(made))
        remove_oldest(folder)
    except OSError:
        return None
    return folder / f"{key}.collider"


def remove_oldest(folder: Path) -> None:
    """Leaves MOST_ALL bytes of our files in the folder."""
    files = []
    for path in folder.iterdir():
        state = path.lstat()
        if NAME.fullmatch(path.name) and stat.S_ISREG(state.st_mode):
            files.append((state.st_mtime, state.st_size, path))
    over = sum(size for _, size, _ in files) - MOST_ALL
    for _, size, path in sorted(files):
        if over <= 0:
            return
        path.unlink(missing_ok=True)
        over -= size


def pack(made: Made) -> bytes:
    """The bytes of a file."""
    hulls, mesh = made
    counts = [len(hulls), len(mesh.vertices), len(mesh.faces), *map(len, hulls)]
    body = b"".join(
        [
            np.array(counts, "<u4").tobytes(),
            mesh.vertices.astype("<f4").tobytes(),
            mesh.faces.astype("<i4").tobytes(),
            *[hull.astype("<f4").tobytes() for hull in hulls],
        ]
    )
    return MARK + hashlib.sha256(body).digest() + body


def unpack(data: bytes) -> Made | None:
    """What such bytes hold; None where they are not what was written."""
    head, digest, body = data[: len(MARK)], data[len(MARK) : len(MARK) + 32], data[len(MARK) + 32 :]
    if head != MARK or len(body) < 12 or hashlib.sha256(body).digest() != digest:
        return None
    count, vertices, faces = (int(n) for n in np.frombuffer(body, "<u4", 3))
    if len(body) % 4 or not 1 <= count <= min(len(body) // 4 - 3, MOST_PARTS):
        return None
    sizes = [3 * int(n) for n in np.frombuffer(body, "<u4", count, 12)]
    if not all(12 <= size <= 3 * MOST_CORNERS for size in sizes):  # a hull has four corners
        return None
    numbers = np.frombuffer(body, "<f4", offset=12 + 4 * count)
    if len(numbers) != 3 * vertices + 3 * faces + sum(sizes):
        return None
    places = np.delete(numbers, np.s_[3 * vertices : 3 * (vertices + faces)])  # without the faces
    if not np.isfinite(places).all() or vertices < 4 or faces < 4:
        return None
    ends = np.cumsum([3 * vertices, 3 * faces, *sizes[:-1]])
    shown, rows, *hulls = np.split(numbers, ends)
    try:
        mesh = TriangleMesh(shown.reshape(-1, 3), rows.view("<i4").reshape(-1, 3))
    except ValueError:  # of one that was written by something else
        return None
    return tuple(hull.reshape(-1, 3) for hull in hulls), mesh
