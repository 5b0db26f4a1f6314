"""A new stop from a style picture: strokes by VGG16's features, colours by mean and covariance."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.training.style_features.pixel_descent import DescentSettings, PixelDescent, Slope
from shapeshift.training.style_features.vgg_style import StyleTerms, VggStyle
from shapeshift.training.styles.style_pictures import StyleView

SHOWN = 0.02  # coverage from which on a pixel belongs to what is looked at
MARGIN = 8  # pixels about it
ROUND = 32  # sides of a part are multiples of it: every size wants a network of its own


class VggPictureLoss:
    """A PictureLoss: distance to the style's features, and to what the source stop shows.

    Only the part of a picture in which the scene is goes through the network.
    """

    def __init__(self, style: VggStyle) -> None:
        self.style = style
        self.contents: dict[int, dict[str, np.ndarray]] = {}  # of views, as float16

    def at(self, view: StyleView) -> Slope:
        part = covered_part(view.coverage)
        content = self._content(view, part)

        def slope(picture: np.ndarray) -> tuple[float, np.ndarray]:
            gradient = np.zeros(picture.shape, np.float32)
            losses, gradient[part] = self.style(picture[part], content)
            return self.style.weighted(losses), gradient

        return slope

    def _content(self, view: StyleView, part: tuple[slice, slice]) -> dict[str, np.ndarray]:
        if view.number not in self.contents:
            content = self.style.content_of(np.clip(view.source[part], 0, 1))
            self.contents[view.number] = {n: f.astype(np.float16) for n, f in content.items()}
        return {n: f.astype(np.float32) for n, f in self.contents[view.number].items()}


def covered_part(coverage: np.ndarray) -> tuple[slice, slice]:
    """The rows and columns of a picture that show something; the whole where nothing is shown."""
    found = []
    for axis, side in enumerate(coverage.shape):
        there = np.flatnonzero((coverage > SHOWN).any(axis=1 - axis))
        if not len(there):
            return slice(0, coverage.shape[0]), slice(0, coverage.shape[1])
        length = there[-1] + 1 - there[0] + 2 * MARGIN
        length = min(-(-length // ROUND) * ROUND, side)
        first = (there[0] + there[-1] + 1 - length) // 2
        first = min(max(first, 0), side - length)
        found.append(slice(int(first), int(first + length)))
    return found[0], found[1]


def nnfm_pictures(
    vgg: Path,
    styles: Sequence[np.ndarray],
    terms: StyleTerms | None = None,
    settings: DescentSettings | None = None,
    seed: int = 0,
) -> PixelDescent:
    """A StylePictures of style pictures (H, W, 3) and a VGG16 file.  Raises BadFile."""
    loss = VggPictureLoss(VggStyle(vgg, styles, terms, seed))
    colors = np.concatenate([picture.reshape(-1, 3) for picture in styles])
    return PixelDescent(loss, colors, settings)
