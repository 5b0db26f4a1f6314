"""VGG16's features of every splat of a scene, carried from the views that see it (3SGS 2.1), and
style pictures on a scene by them, without training.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize
from shapeshift.rasterizer.surface import rasterize_depth, surface
from shapeshift.runtime_models.model import AnchorModel, BadFile, Splats
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, camera_of
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.style_features.vgg_features import VggFeatures
from shapeshift.training.styles.style_rules import Rule, Surroundings
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


# Without training: AdaIN of every splat's 32 numbers, then its colour.
#
# 3SGS 2.2 and 2.3 (StyleGaussian).  What follows the features once a scene takes under a second a
# style, and the splats have one colour from everywhere, so there is nothing that could flicker.

TINY = 1e-3  # added to deviations before dividing by them
PLACES = 1500  # of the style picture that a splat may take its colour from
BLOCK = 8192  # splats whose likeness to these is looked at together


@dataclass(frozen=True)
class StyleFeatures:
    """A style picture in the same features."""

    low: np.ndarray  # (m, NUMBERS) of its places, in the scene's axes
    colors: np.ndarray  # (m, 3) display sRGB there
    means: np.ndarray  # (C,) of all its features
    deviations: np.ndarray  # (C,)


def style_features(vgg: Path, picture: np.ndarray, scene: SplatFeatures) -> StyleFeatures:
    """Of a picture (H, W, 3), at the places of the last layer.  Raises BadFile."""
    maps = VggFeatures(vgg, tuple(name for name, _ in LAYERS))(picture)
    last, pixels = LAYERS[-1]
    height, width = maps[last].shape[1:]
    down, across = (np.mgrid[:height, :width].reshape(2, -1) + 0.5) * pixels
    found = [bilinear(maps[n].transpose(1, 2, 0), across / s, down / s) for n, s in LAYERS]
    features = np.concatenate(found, axis=1)
    shrunk = picture[: height * pixels, : width * pixels].reshape(height, pixels, width, pixels, 3)
    low = (features - scene.center) @ scene.axes.T
    colors = shrunk.mean(axis=(1, 3)).reshape(-1, 3)
    return StyleFeatures(low, colors, features.mean(axis=0), features.std(axis=0))


def adain(scene: SplatFeatures, style: StyleFeatures) -> np.ndarray:
    """(n, 32): the splats' numbers with mean and deviation of the style's features (3SGS 2.2).

    In the principal axes, where that is one matrix: F = center + low A; A A^T = 1.
    """
    gain = style.deviations / (scene.deviation + TINY)
    matrix = (scene.axes * gain) @ scene.axes.T
    return scene.low @ matrix + (style.means - scene.center) @ scene.axes.T


def styled_colors(
    scene: SplatFeatures, style: StyleFeatures, strength: float = 1.0, seed: int = 0
) -> np.ndarray:
    """(n, 3) display sRGB: of each splat the colour of the style's nearest place, then the mean
    over its neighbours; strength 0..1 from its own colour.
    """
    moved = unit(adain(scene, style) - style.low.mean(axis=0))
    picked = np.random.default_rng(seed).permutation(len(style.low))[:PLACES]
    places = unit(style.low[picked] - style.low.mean(axis=0))
    best = np.concatenate(
        [np.argmax(moved[i : i + BLOCK] @ places.T, axis=1) for i in range(0, len(moved), BLOCK)]
    )
    colors = style.colors[picked][best][scene.neighbours].mean(axis=1)
    return ((1 - strength) * scene.colors + strength * colors).astype(np.float32)


def unit(rows: np.ndarray) -> np.ndarray:
    rows = rows.astype(np.float32)
    return rows / (np.linalg.norm(rows, axis=1, keepdims=True) + 1e-6)


def all_colors(scene: SplatFeatures, colors: np.ndarray) -> np.ndarray:
    """(N, 3) of every splat, of what no view sees that of the nearest one that is seen."""
    return np.clip(colors, 0, 1)[scene.nearest]


class StylePreview:
    """One stop of a scene, ready to be shown in any style: for thumbnails and a live strength."""

    def __init__(
        self, device, model: AnchorModel, stop: str, vgg: Path, views: Sequence[View],
        behind: Color, progress: Callable[[str, float], None] | None = None,
    ) -> None:  # fmt: skip
        """Carries the features, some 20 seconds of a core.  Raises BadFile."""
        x = next(each.x for each in model.stops if each.name == stop)
        self.device, self.vgg, self.behind = device, vgg, behind
        self.renderer = ModelRenderer(device, model)
        self.renderer.set_control(x)
        self.scene = carry_features(device, model, x, vgg, views, behind, progress)

    def colors(self, picture: np.ndarray, strength: float = 1.0, seed: int = 0) -> np.ndarray:
        """(N, 3) of every splat in the style of a picture (H, W, 3); under a second of a core."""
        style = style_features(self.vgg, picture, self.scene)
        return all_colors(self.scene, styled_colors(self.scene, style, strength, seed))

    def draw(self, colors: np.ndarray, view: View) -> np.ndarray:
        """(H, W, 3) float32 of the stop with these colours: a thumbnail."""
        return draw_preview(self.device, self.renderer, colors, view, self.behind)


def recolor_rule(colors: np.ndarray) -> Rule:
    """Colours (N, 3) as a rule for splats, so that a stop learns them without pictures."""

    def recolored(splats: Splats, near: Surroundings) -> Splats:
        return replace(splats, color=np.where(splats.opacity[:, None] > 0, colors, splats.color))

    return recolored


def draw_preview(
    device, renderer: ModelRenderer, colors: np.ndarray, view: View, behind: Color
) -> np.ndarray:
    """(H, W, 3) float32 of the renderer's stop with colours (N, 3) of its splats: a thumbnail."""
    color = device.upload(np.ascontiguousarray(colors, np.float32))
    projected = project(device, *renderer.geometry, color, camera_of(view))
    tiles = bin_tiles(device, projected, view.size)
    frame = rasterize(device, projected, tiles, view.size, behind)
    return np.clip(device.download(frame.image).transpose(1, 2, 0), 0, 1)
