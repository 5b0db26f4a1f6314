"""Pictures painted for a few views and carried by depth to all others, so that views agree.

A network paints every view anew: its strokes lie elsewhere in each, and a stop that learns all of
them learns their mean, without strokes.  Here each place of the scene takes its colours from the
first key view that sees it; only what none of them sees is painted in a view of its own.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import BROKEN, open_image
from shapeshift.training.styles.image_network import resized
from shapeshift.training.styles.style_pictures import StylePictures, StyleView, Turns

KEY_VIEWS = 8  # 16 were no better (docs/styles.md); a dome's first ones lie far apart
NEAR_ENOUGH = 0.012  # of a depth: a place that another view sees so near is the same place
COVERED = 0.5  # of a pixel from which it has a depth
WELL_COVERED = 0.9  # of a pixel whose colour is carried on
RIM = 1  # pixels of a picture's edge that are not carried


class CarriedPictures:
    """A StylePictures: another one's pictures of key views, seen from all views."""

    turns = Turns()

    def __init__(self, painter: StylePictures, key_views: int = KEY_VIEWS) -> None:
        self.painter, self.key_views = painter, key_views

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        painted = self.painter.make(views, done)
        keys: list[tuple[StyleView, np.ndarray]] = []
        out = []
        for view, own in zip(views, painted, strict=True):
            picture, free = own.copy(), np.ones(view.coverage.shape, bool)
            for other, carried in keys:
                colors, seen = colors_from(view, other, carried)
                seen &= free
                picture[seen] = colors[seen]
                free &= ~seen
            if len(keys) < self.key_views:
                keys.append((view, picture))
            out.append(picture)
        return out


def colors_from(
    view: StyleView, other: StyleView, picture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) colours of what a view sees, taken from another view's picture, and where that view
    sees the same (H, W) bool.
    """
    u, v, depth = places_in(view, other)
    height, width = other.coverage.shape
    inside = (u > RIM) & (u < width - RIM) & (v > RIM) & (v < height - RIM)
    seen = inside & (view.coverage > COVERED) & (depth > 0)
    same = np.abs(sampled(other.depth_m, u, v) - depth) < NEAR_ENOUGH * depth
    seen &= same & (sampled(other.coverage, u, v) > WELL_COVERED)
    return sampled(picture, u, v), seen


def places_in(view: StyleView, other: StyleView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W) u, v in pixels of another view, and depth in metres there, of what a view sees."""
    height, width = view.depth_m.shape
    eye_from_world, fx, fy, cx, cy = view.view.pinhole()
    other_from_world, gx, gy, hx, hy = other.view.pinhole()
    rows, columns = np.mgrid[:height, :width] + 0.5
    depth = view.depth_m
    points = np.stack(
        [(columns - cx) / fx * depth, (rows - cy) / fy * depth, depth, np.ones_like(depth)], axis=-1
    )  # (H, W, 4) metres, of the eye's frame as pinhole() has it
    there = points @ (other_from_world @ np.linalg.inv(eye_from_world)).T
    ahead = np.maximum(there[..., 2], 1e-6)
    return there[..., 0] / ahead * gx + hx, there[..., 1] / ahead * gy + hy, there[..., 2]


def sampled(table: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(H, W) or (H, W, C) of a table at places in pixels, bilinear; outside, its edge."""
    height, width = table.shape[:2]
    x = np.clip(np.nan_to_num(u) - 0.5, 0, width - 1)
    y = np.clip(np.nan_to_num(v) - 0.5, 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    left, top = np.maximum(left, 0), np.maximum(top, 0)
    right, low = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = (x - left).astype(np.float32), (y - top).astype(np.float32)
    if table.ndim == 3:
        across, down = across[..., None], down[..., None]
    upper = (1 - across) * table[top, left] + across * table[top, right]
    lower = (1 - across) * table[low, left] + across * table[low, right]
    return (1 - down) * upper + down * lower


# Pictures that another program has made of a scene's views instead, one a camera.

ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff")
LEAST_PX, MOST_PX = 16, 4096  # a side


class PictureFiles:
    """A StylePictures: the files of a folder."""

    turns = Turns()

    def __init__(self, files: Sequence[Path]) -> None:
        """A file for each view of the run, in their order."""
        self.files = list(files)

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        return [resized(read_picture(self.files[v.number]), v.view.size) for v in views]


def files_for(folder: Path, names: Sequence[str]) -> list[Path]:
    """The picture of each camera: that of its name, or, of as many files, those in order.

    Raises BadFile where there is not one for each.
    """
    if not folder.is_dir():
        raise BadFile(
            f"{folder} is no folder; --pictures names one with a picture for each camera."
        )
    files = sorted(f for f in folder.iterdir() if f.suffix.lower() in ENDINGS and f.is_file())
    by_name = {file.stem: file for file in files}
    stems = [Path(name).stem for name in names]
    if all(stems) and all(stem in by_name for stem in stems):
        return [by_name[stem] for stem in stems]
    if len(files) == len(names):
        return files
    missing = next((stem for stem in stems if stem and stem not in by_name), "")
    hint = f"; there is none for '{missing}'" if missing else ""
    raise BadFile(
        f"{folder} holds {len(files)} pictures for {len(names)} cameras{hint}; name each as its "
        "camera, or give one for each in the order of their names."
    )


def read_picture(path: Path) -> np.ndarray:
    """(H, W, 3) float32 display sRGB of a picture of LEAST_PX to MOST_PX a side.  BadFile."""
    if not path.is_file():
        raise BadFile(f"{path} is no file; a picture is wanted.")
    with open_image(path) as image:
        width, height = image.size
        if not (LEAST_PX <= min(width, height) and max(width, height) <= MOST_PX):
            raise BadFile(
                f"{path} has {width}x{height} pixels; {LEAST_PX} to {MOST_PX} a side are wanted."
            )
        try:
            return np.asarray(image.convert("RGB"), np.float32) / 255
        except BROKEN as error:
            raise BadFile(f"{path} is broken ({error}); a whole picture is wanted.") from None
