"""VGG16's features of every splat of a scene, carried from the views that see it (3SGS 2.1)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from shapeshift.rasterizer.surface import rasterize_depth, surface
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, camera_of
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.style_features.vgg_features import VggFeatures
from shapeshift.training.styles.train_stop import dome_views

LAYERS = (("relu2_1", 2), ("relu3_1", 4))  # and how many pixels a side each place of them has
NUMBERS = 32  # of a splat, as in the paper: of 384 they keep some 85 % of the variance
NEIGHBOURS = 8  # of a splat, itself among them
SEEN = 0.05  # opacity of a splat that is looked for in the views
NEAR = 0.015  # of the depth: that far behind what is seen, a splat still is
VIEWS, VIEW_SIZE = 12, (320, 240)
FITTED = 6000  # splats whose features tell the principal axes


@dataclass(frozen=True)
class SplatFeatures:
    """What is known of the splats that a view sees, n of N, at one stop."""

    rows: np.ndarray  # (n,) of all splats
    nearest: np.ndarray  # (N,) for every splat, the nearest one of these n
    neighbours: np.ndarray  # (n, K) of each, nearest first, itself among them
    colors: np.ndarray  # (n, 3) display sRGB, as the views see them
    low: np.ndarray  # (n, NUMBERS) float32: features = center + low @ axes
    axes: np.ndarray  # (NUMBERS, C)
    center: np.ndarray  # (C,) the mean of all features
    deviation: np.ndarray  # (C,)


def scene_views(model: AnchorModel) -> list[View]:
    """From where the splats of a scene are looked at: 12 views, in which next to all are seen."""
    return dome_views(model, VIEWS, VIEW_SIZE)


def carry_features(
    device, model: AnchorModel, x: float, vgg: Path, views: Sequence[View], behind: Color,
    progress: Callable[[str, float], None] | None = None,
) -> SplatFeatures:  # fmt: skip
    """Of the stop at x: the mean of what the views see at each splat, none where it is hidden.

    The affine map of 3SGS from 32 numbers to all is the principal axes, in closed form.  Raises
    BadFile where the views see next to nothing of the scene.
    """
    renderer, network = ModelRenderer(device, model), VggFeatures(vgg, tuple(n for n, _ in LAYERS))
    renderer.set_control(x)
    means, _, _, opacity = (np.asarray(a, np.float32) for a in renderer.evaluator.geometry(x))
    alive = np.flatnonzero(opacity.ravel() > SEEN)
    total, count = None, np.zeros(len(alive), np.int32)
    colors = np.zeros((len(alive), 3))
    for i, view in enumerate(views):
        if progress:
            progress("features of the splats", i / len(views))
        picture, depth = drawn(device, renderer, view, behind)
        u, v, seen = visible(means[alive], view, depth)
        maps = network(picture)
        found = [bilinear(maps[n].transpose(1, 2, 0), u[seen] / s, v[seen] / s) for n, s in LAYERS]
        features = np.concatenate(found, axis=1)
        total = np.zeros((len(alive), features.shape[1]), np.float32) if total is None else total
        total[seen] += features
        colors[seen] += bilinear(picture, u[seen], v[seen])
        count[seen] += 1
    there = np.flatnonzero(count)
    if total is None or len(there) < NEIGHBOURS + NUMBERS:
        raise BadFile("the views see next to nothing of the scene; choose other --cameras.")
    each = count[there, None]
    return reduced(alive[there], means, total[there] / each, colors[there] / each)


def reduced(
    rows: np.ndarray, means: np.ndarray, features: np.ndarray, colors: np.ndarray
) -> SplatFeatures:
    """With the features (n, C) in their principal axes, and who is near to whom."""
    center, deviation = features.mean(axis=0), features.std(axis=0)
    picked = np.random.default_rng(0).permutation(len(features))[:FITTED]
    away = features[picked] - center
    _, vectors = np.linalg.eigh(away.T @ away)
    axes = np.ascontiguousarray(vectors[:, ::-1][:, :NUMBERS].T, np.float32)
    tree = cKDTree(means[rows])
    _, neighbours = tree.query(means[rows], k=NEIGHBOURS)
    _, nearest = tree.query(means)
    low = ((features - center) @ axes.T).astype(np.float32)
    return SplatFeatures(
        rows, nearest, neighbours, colors.astype(np.float32), low, axes, center, deviation
    )


def drawn(
    device, renderer: ModelRenderer, view: View, behind: Color
) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) picture and (H, W) metres along the view's axis of the scene."""
    projected, tiles, frame = renderer.draw(view, behind)
    means, scales, wxyz, _ = renderer.geometry
    surfaces = surface(device, means, scales, wxyz, camera_of(view), projected)
    depth = rasterize_depth(device, projected, tiles, surfaces, view.size)
    coverage = 1 - device.download(depth.frame.transmittance)
    picture = np.clip(device.download(frame.image).transpose(1, 2, 0), 0, 1)
    metres = device.download(depth.metres) / np.maximum(coverage, 1e-6)
    return np.ascontiguousarray(picture), metres


def visible(
    means: np.ndarray, view: View, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of points (n, 3): pixel columns and rows, and which of them nothing hides."""
    camera, fx, fy, cx, cy = view.pinhole()
    at = means @ camera[:3, :3].T + camera[:3, 3]
    z = np.maximum(at[:, 2], 1e-6)
    u, v = at[:, 0] / z * fx + cx, at[:, 1] / z * fy + cy
    width, height = view.size
    inside = (at[:, 2] > 0) & (u > 1) & (u < width - 1) & (v > 1) & (v < height - 1)
    seen = np.flatnonzero(inside)
    metres = bilinear(depth[..., None], u[seen], v[seen])[:, 0]
    return u, v, seen[np.abs(metres - z[seen]) < NEAR * z[seen]]


def bilinear(image: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n, C) of an image (H, W, C) at columns u and rows v, pixel centres at +0.5."""
    height, width = image.shape[:2]
    u, v = np.clip(u - 0.5, 0, width - 1.001), np.clip(v - 0.5, 0, height - 1.001)
    x, y = u.astype(int), v.astype(int)
    a, b = (u - x)[:, None], (v - y)[:, None]
    x1, y1 = np.minimum(x + 1, width - 1), np.minimum(y + 1, height - 1)
    upper = (1 - a) * image[y, x] + a * image[y, x1]
    return (1 - b) * upper + b * ((1 - a) * image[y1, x] + a * image[y1, x1])
