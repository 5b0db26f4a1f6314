"""InitialPoints points out of clouds that somebody measured and out of depth photos."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import LEFT_HANDED, Capture
from shapeshift.scene.captures.capture_rules import turn_of_world
from shapeshift.scene.captures.read_las import read_las
from shapeshift.scene.captures.read_points import read_points
from shapeshift.training.first_anchors.hull import FINEST
from shapeshift.training.first_anchors.views import pixel_size
from shapeshift.training.photos import LoadedPhoto, sampled

MOST_POINTS = 100_000  # beyond it neither the first anchors nor their distance change
LASER = (".las", ".laz")
CLOUDS = (".ply", ".npz", *LASER)


def cloud_points(path: Path, capture: Capture, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """(P, 3) metres in our world, at most MOST_POINTS, and how many the file has.

    The file's axes are those of the capture's own files, so its points are turned as they are.
    """
    if path.suffix.lower() in LASER:
        points, count = read_las(path, MOST_POINTS)
    else:
        points = read_points(path)[0]
        count = len(points)
    if not (len(points) and np.isfinite(points).all()):
        raise BadFile(f"{path}: holds no points, or some that are no numbers; export it again.")
    up = capture.notes.get("up_in_file", (0.0, 1.0, 0.0))
    turn = turn_of_world(up, bool(capture.notes.get(LEFT_HANDED)), str(path))
    turned = subsampled(points, rng) @ turn[:3, :3].T
    return turned - np.array(capture.origin), count


def subsampled(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """MOST_POINTS of the points at random, in their order: dense places stay denser."""
    if len(points) <= MOST_POINTS:
        return points
    return points[np.sort(rng.choice(len(points), MOST_POINTS, replace=False))]


def depth_points(photos: list[LoadedPhoto], rng: np.random.Generator) -> np.ndarray:
    """(P, 3) metres where depth photos saw something, at most MOST_POINTS; (0, 3) without any.

    As on a hull, nothing is gained by anchors closer together than FINEST pixels: many photos
    measure the same surface, each pixel of each once.
    """
    deep = [photo for photo in sampled(photos) if photo.has_depth]
    known = sum(int(np.count_nonzero(known_depth(photo) > 0)) for photo in deep)
    share, found = min(1.0, MOST_POINTS / max(known, 1)), [np.zeros((0, 3))]
    for photo in deep:
        view, depth = photo.view, known_depth(photo)
        row, column = np.nonzero(depth > 0)
        kept = rng.random(len(row)) < share
        row, column = row[kept], column[kept]
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        z = depth[row, column].astype(np.float64)
        x, y = (column + 0.5 - cx) / fx * z, (row + 0.5 - cy) / fy * z
        in_camera = np.stack([x, y, z, np.ones_like(z)])
        found.append((np.linalg.inv(camera_from_world) @ in_camera)[:3].T)
    points = np.concatenate(found)
    return one_a_cell(points, FINEST * pixel_size(points, [photo.view for photo in deep]))


def one_a_cell(points: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """The first of the points (P, 3) in each cube, in their order.

    edge: (P,) metres of a cube where a point lies, rounded to powers of two so that neighbours
    share a grid; Inf, of what no photo shows: the point stays.
    """
    measured = np.flatnonzero(np.isfinite(edge))
    power = np.round(np.log2(edge[measured]))[:, None]
    keys = np.concatenate([power, np.floor(points[measured] / 2.0**power)], axis=1)
    _, first = np.unique(keys, axis=0, return_index=True)
    kept = ~np.isfinite(edge)
    kept[measured[first]] = True
    return points[kept]


def known_depth(photo: LoadedPhoto) -> np.ndarray:
    """(H, W) metres of a photo that has depth, 0 where it is not known."""
    return np.zeros(photo.view.size[::-1]) if (depth := photo.depth) is None else depth
