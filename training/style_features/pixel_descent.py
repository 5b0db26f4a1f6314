"""Pictures for a new stop, by turns: descent on the pixels of what it shows, then steps towards it.

In one step pixels go far where a scene cannot, and the steps of training average what the views
disagree about: what they agree on stays.  Measured against the gradient of the same loss sent
straight into the splats, which moved them next to nowhere: docs/styles.md, "From a picture".
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shapeshift.training.styles.style_pictures import StyleView, Turns

# The colours of a style, colour by colour, so that they are the same from every view.

FLAT = 1e-5  # added to variances: a picture of one colour has none


@dataclass(frozen=True)
class ColorTransfer:
    """color -> matrix @ color + offset."""

    matrix: np.ndarray  # (3, 3)
    offset: np.ndarray  # (3,)

    def __call__(self, picture: np.ndarray) -> np.ndarray:
        """(..., 3) float32 display sRGB, clipped to 0..1."""
        return np.clip(picture @ self.matrix.T + self.offset, 0, 1).astype(np.float32)


def color_transfer(scene: np.ndarray, style: np.ndarray) -> ColorTransfer:
    """Gives colours (N, 3) the mean and the covariance of others (M, 3), moving them least.

    That is the Monge-Kantorovich map between normal distributions (Pitie and Kokaram 2007):
    A = S^-1/2 (S^1/2 T S^1/2)^1/2 S^-1/2 of the covariances S of the scene and T of the style.
    """
    before, after = (np.asarray(colors, np.float64).reshape(-1, 3) for colors in (scene, style))
    own, wanted = (np.cov(c, rowvar=False) + FLAT * np.eye(3) for c in (before, after))
    root, back = power(own, 0.5), power(own, -0.5)
    matrix = back @ power(root @ wanted @ root, 0.5) @ back
    return ColorTransfer(matrix, after.mean(axis=0) - matrix @ before.mean(axis=0))


def power(matrix: np.ndarray, exponent: float) -> np.ndarray:
    """Of a symmetric positive matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, FLAT**2) ** exponent) @ vectors.T


INSIDE = 0.9  # coverage of a pixel whose colour is the scene's own
FEWEST = 16  # pixels, of which a covariance can be told


Slope = Callable[[np.ndarray], tuple[float, np.ndarray]]


class PictureLoss(Protocol):
    """A loss of one view's picture that is small where the picture is in the style."""

    def at(self, view: StyleView) -> Slope:
        """For one descent: the value and the gradient (H, W, 3) by a picture (H, W, 3)."""
        ...


@dataclass(frozen=True)
class DescentSettings:
    """How far a picture goes at each turn."""

    descents: int = 4  # of the loss, at each turn
    rate: float = 0.04  # of sRGB 0..1: how far a pixel goes in one, root mean square
    colors_first: float = 0.25  # part of the run in which the style's colours alone are learnt
    views: int = 4  # at a time
    steps: int = 20  # of training a turn


class PixelDescent:
    """A StylePictures of any PictureLoss; `colors` (..., 3): the style's, which come first."""

    def __init__(
        self,
        loss: PictureLoss,
        colors: np.ndarray | None = None,
        settings: DescentSettings | None = None,
    ) -> None:
        self.loss, self.colors = loss, colors
        self.settings = settings or DescentSettings()
        self.transfer: ColorTransfer | None = None
        self.values: list[tuple[float, float]] = []  # the loss before and after, of each picture

    @property
    def turns(self) -> Turns:
        return Turns(self.settings.views, self.settings.steps)

    def make(self, views: Sequence[StyleView], done: float) -> list[np.ndarray]:
        """The pictures of a turn.  Raises BadFile where views are too small for the loss."""
        if self.colors is not None and self.transfer is None:
            self.transfer = transfer_to(views, self.colors)
        if self.transfer is not None and done < self.settings.colors_first:
            return [self.transfer(np.clip(view.source, 0, 1)) for view in views]
        return [self._descend(view) for view in views]

    def _descend(self, view: StyleView) -> np.ndarray:
        """The best picture of some steps, each half as far as before after one that was too far."""
        picture = np.clip(view.shown, 0, 1).astype(np.float32)
        covered = view.coverage[..., None]
        rate, best = self.settings.rate, (np.inf, picture, picture)  # value, picture, direction
        slope, first = self.loss.at(view), 0.0
        for i in range(self.settings.descents):
            value, gradient = slope(picture)
            first = value if i == 0 else first
            if value < best[0]:
                best = value, picture, direction(covered * gradient, view.coverage)
            else:
                rate /= 2
            picture = np.clip(best[1] - rate * best[2], 0, 1)
        self.values.append((first, best[0]))
        return picture


def direction(gradient: np.ndarray, coverage: np.ndarray) -> np.ndarray:
    """A gradient (H, W, 3) with the root mean square 1 over what is covered.

    The root of each number is taken: else a few pixels go far, at the rim, and all others nowhere.
    """
    evened = np.sign(gradient) * np.sqrt(np.abs(gradient))
    share = max(float(coverage.mean()), 1e-3)
    size = np.sqrt(np.mean(evened**2) / share)
    return (evened / max(float(size), 1e-12)).astype(np.float32)


def transfer_to(views: Sequence[StyleView], style: np.ndarray) -> ColorTransfer | None:
    """From the colours of what the views show of the scene to those of a picture.

    None where they show next to nothing.
    """
    inside = [np.clip(v.source, 0, 1)[v.coverage > INSIDE] for v in views]
    colors = np.concatenate(inside)
    return color_transfer(colors, style) if len(colors) >= FEWEST else None
