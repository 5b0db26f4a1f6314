"""Colliders that were made before, kept beside the scene: read in a millisecond, not made in ten s.

A file is a digest of what follows, then counts, then the arrays: what does not fit its digest is
damaged and counts as absent.
"""

import hashlib
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from runtime_models.whole_file import write_whole
from scene.triangle_mesh import TriangleMesh

FOLDER = ".shapeshift-colliders"
MARK = b"shapeshift collider 1\n"
MOST_BYTES = 16 << 20  # of one file: 2,500 faces and 16 hulls take 60 kB
MOST_FILES = 256  # in a folder; the ones not used for longest go first
Made = tuple[tuple[np.ndarray, ...], TriangleMesh]


def content_key(settings: str, *arrays: np.ndarray | bytes) -> str:
    """A name for what a collider is made of and how."""
    digest = hashlib.sha256(MARK + settings.encode())
    for array in arrays:
        if isinstance(array, np.ndarray):
            digest.update(f"{array.shape}{array.dtype.str}".encode())
            array = np.ascontiguousarray(array).data
        digest.update(array)
    return digest.hexdigest()[:40]


def find_kept(key: str, beside: Path | None) -> Made | None:
    """The collider of a key from beside the scene or from the user's folder; None where absent."""
    for folder in folders(beside):
        path = folder / f"{key}.collider"
        try:
            if not 0 < path.stat().st_size <= MOST_BYTES:
                continue
            data = path.read_bytes()
        except OSError:
            continue
        made = unpack(data)
        if made is not None:
            try:
                os.utime(path)  # used: the last to be removed
            except OSError:
                pass  # of a folder that is only to be read, and is never tidied from here
            return made
    return None


def keep(key: str, made: Made, beside: Path | None) -> Path | None:
    """Written into the first folder that takes it; where it lies, None where nothing does."""
    data = pack(made)
    for folder in folders(beside):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(folder / f"{key}.collider", data)
            remove_oldest(folder)
        except OSError:
            continue
        return folder / f"{key}.collider"
    return None


def folders(beside: Path | None) -> list[Path]:
    """Where colliders are kept: beside the scene if it has a place, and a folder of the user's."""
    own = [] if beside is None else [beside / FOLDER]
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or tempfile.gettempdir())
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return [*own, base / "shapeshift" / "colliders"]


def remove_oldest(folder: Path) -> None:
    """Leaves MOST_FILES of our files in a folder."""
    files = sorted(folder.glob("*.collider"), key=lambda path: path.stat().st_mtime)
    for path in files[: max(0, len(files) - MOST_FILES)]:
        path.unlink(missing_ok=True)


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
    if len(body) % 4 or not 1 <= count <= len(body) // 4 - 3:
        return None
    sizes = [3 * int(n) for n in np.frombuffer(body, "<u4", count, 12)]
    numbers = np.frombuffer(body, "<f4", offset=12 + 4 * count)
    if len(numbers) != 3 * vertices + 3 * faces + sum(sizes):
        return None
    ends = np.cumsum([3 * vertices, 3 * faces, *sizes[:-1]])
    shown, rows, *hulls = np.split(numbers, ends)
    try:
        mesh = TriangleMesh(shown.reshape(-1, 3), rows.view("<i4").reshape(-1, 3))
    except ValueError:  # of one that was written by something else
        return None
    return tuple(hull.reshape(-1, 3) for hull in hulls), mesh
