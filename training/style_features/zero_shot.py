"""Style pictures on a scene without training: AdaIN of every splat's 32 numbers, then its colour.

3SGS 2.2 and 2.3 (StyleGaussian).  What follows the features once a scene takes under a second a
style, and the splats have one colour from everywhere, so there is nothing that could flicker.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize
from shapeshift.runtime_models.model import AnchorModel, Splats
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, camera_of
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.style_features.splat_features import (
    LAYERS,
    SplatFeatures,
    bilinear,
    carry_features,
)
from shapeshift.training.style_features.vgg_features import VggFeatures
from shapeshift.training.styles.style_rules import Rule, Surroundings

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
