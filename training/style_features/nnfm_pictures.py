"""A new stop from a style picture: strokes by VGG16's features, colours by mean and covariance."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.training.style_features.pixel_descent import DescentSettings, PixelDescent
from shapeshift.training.style_features.vgg_style import StyleTerms, VggStyle
from shapeshift.training.styles.style_pictures import StyleView


class VggPictureLoss:
    """A PictureLoss: distance to the style's features, and to what the source stop shows."""

    def __init__(self, style: VggStyle) -> None:
        self.style = style
        self.contents: dict[int, dict[str, np.ndarray]] = {}  # of views, as float16

    def __call__(self, picture: np.ndarray, view: StyleView) -> tuple[float, np.ndarray]:
        if view.number not in self.contents:
            content = self.style.content_of(np.clip(view.source, 0, 1))
            self.contents[view.number] = {n: f.astype(np.float16) for n, f in content.items()}
        kept = {n: f.astype(np.float32) for n, f in self.contents[view.number].items()}
        losses, gradient = self.style(picture, kept)
        return self.style.weighted(losses), gradient


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
