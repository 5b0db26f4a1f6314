"""How well a proxy covers an object in photos: silhouettes against masks (OWD, section 3.5)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.decomposition.partition import LabelledView
from shapeshift.rasterizer.evidence import SILENT
from shapeshift.scene.colliders.collider import Collider
from shapeshift.scene.colliders.collider_pieces import hull_faces
from shapeshift.scene.pose import View

FINER = 4  # times the picture's resolution that outlines are filled at
LEAST_PIXELS = 30  # of a mask, for a view to count


@dataclass(frozen=True)
class SilhouetteScore:
    """Over all pixels of all views that show the object."""

    views: int
    recall: float  # of the object's pixels, that the proxy covers
    iou: float


def silhouette(
    view: View, parts: Sequence[np.ndarray], faces: Sequence[np.ndarray] | None = None
) -> np.ndarray | None:
    """(H, W) bool: pixels whose centre one of the convex pieces (V, 3), world metres, covers.

    faces: (F, 3) of each, of pieces that are not convex.  None where a corner lies behind the near
    plane.
    """
    from PIL import Image, ImageDraw

    eye_from_world, fx, fy, cx, cy = view.pinhole()
    outlines = []
    for part in parts:
        x, y, z = (np.c_[part, np.ones(len(part))] @ eye_from_world.T).T[:3]
        if not (z > view.near).all():
            return None
        outlines.append(np.stack([fx * x / z + cx, fy * y / z + cy], 1))
    width, height = view.size
    covered = np.zeros((height, width), bool)
    if not sum(map(len, outlines)):
        return covered
    # No more of the picture is drawn than what the corners reach.
    every = np.concatenate(outlines)
    left, top = np.clip(np.floor(every.min(0)), 0, view.size).astype(int)
    right, bottom = np.clip(np.floor(every.max(0)) + 1, 0, view.size).astype(int)
    if not (left < right and top < bottom):
        return covered
    picture = Image.new("1", (int(right - left) * FINER, int(bottom - top) * FINER))
    pen = ImageDraw.Draw(picture)
    for at, rows in zip(outlines, faces or map(hull_faces, parts), strict=True):
        pixels = (at - (left, top)) * FINER - 0.5
        for face in pixels[np.asarray(rows)].reshape(len(rows), -1).tolist():
            pen.polygon(face, fill=1)
    covered[top:bottom, left:right] = np.array(picture)[FINER // 2 :: FINER, FINER // 2 :: FINER]
    return covered


def score_silhouettes(
    collider: Collider,
    world_from_part: np.ndarray,
    label: int,
    views: Sequence[LabelledView],
    as_mesh: bool = False,
) -> SilhouetteScore:
    """The proxy of the object of that label; world_from_part (4, 4).  as_mesh: by its mesh.

    Pixels where another object is seen say nothing: it may stand before this one.
    """
    turn, move = world_from_part[:3, :3], world_from_part[:3, 3]
    pieces = (collider.mesh.vertices,) if as_mesh else collider.parts
    parts = [part.astype(np.float64) @ turn.T + move for part in pieces]
    faces = [collider.mesh.faces] if as_mesh else [hull_faces(part) for part in parts]
    seen = both = either = count = 0
    for each in views:
        mask = each.labels == label
        if mask.sum() < LEAST_PIXELS:
            continue
        covered = silhouette(each.view, parts, faces)
        if covered is None:
            continue
        known = mask | (each.labels == 0)
        known &= each.labels != SILENT
        count += 1
        seen += int(mask.sum())
        both += int((mask & covered).sum())
        either += int(((mask | covered) & known).sum())
    return SilhouetteScore(count, both / max(seen, 1), both / max(either, 1))
