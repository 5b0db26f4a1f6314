"""From which size on a coarser level may stand for a package: measured on pictures of both."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.scene.cameras.framing import frame_points, orbit_path
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject

PICTURE = (640, 360)  # pixels, of which the model has a part in the middle
VIEWS = 4  # about it
TURN = 0.3  # radians: of the first
LEAST_DB = {"stops": 40.0, "between": 36.0}  # of a level where it begins, to all there is
MOST_CHANGE = 6.0  # of 255, in the mean of the model's pixels, as one level follows another
WHERE = {"stops": "at stops", "between": "between them"}  # in words
COVERED = 0.02  # of a pixel, from which on it is the model's
STEP = 2**0.25  # from one size that is tried to the next ...
TRIES = 8  # ... so often: down to 0.3 times the first
MOST_DB = 200.0  # of pictures that are equal

Pictures = dict[str, list[tuple[np.ndarray, np.ndarray]]]  # colours and coverage, by where x stood


@dataclass(frozen=True)
class LevelErrors:
    """A level against the whole model, at one size."""

    pixels: float  # the diameter of the model's bounds
    db: dict[str, float]  # by where x stood: PSNR over the pictures, against all there is
    change: float  # of 255: against the level before it, in the mean of the model's pixels

    @property
    def good(self) -> bool:
        return not self.lacks

    @property
    def lacks(self) -> list[str]:
        """What keeps it from being good, each with the bound."""
        found = [
            f"{self.db[at]:.1f} dB {WHERE[at]} ({LEAST_DB[at]:.0f} wanted)"
            for at in self.db if not self.db[at] >= LEAST_DB[at]
        ]  # fmt: skip
        if not self.change <= MOST_CHANGE:
            found.append(
                f"a switch changes its pixels by {self.change:.1f}/255 (at most {MOST_CHANGE:.0f})"
            )
        return found


class LevelMeter:
    """Draws the levels of a model by tiles, at one size after another."""

    def __init__(self, model: AnchorModel) -> None:
        self.model = replace(model, coarser=())
        self.centre, self.radius = frame_points(model.anchors, np.ones(len(model.anchors)))
        xs = sorted(stop.x for stop in model.stops) or [0.0]
        self.xs = {"stops": xs}
        if len(xs) > 1:
            self.xs["between"] = [(a + b) / 2 for a, b in pairwise(xs)]
        self.renderer = Renderer(None, "tiles")

    def views(self, pixels: float, count: int = VIEWS) -> list[View]:
        """On a circle about the model, from where its bounds have that diameter."""
        (probe,) = orbit_path(1, self.centre, self.radius, PICTURE, distance=2 * self.radius)
        _, right, _, up = probe.tangents
        away = self.radius / pixels * max(PICTURE[0] / right, PICTURE[1] / up)
        path = (count, self.centre, self.radius, PICTURE)
        return orbit_path(*path, distance=away, start=TURN)

    def pictures(self, model: AnchorModel, pixels: float) -> Pictures:
        """Of all views, at the stops and half-way between them."""
        found: Pictures = {at: [] for at in self.xs}
        for at, xs in self.xs.items():
            for x in xs:
                self.renderer.update(Scene((SceneObject("model", model, x=x),)))
                for view in self.views(pixels):
                    self.renderer.draw([view])
                    colors, alpha = self.renderer.resolved(), self.renderer.image()[..., 3]
                    found[at].append((colors.copy(), alpha.copy()))
        return found

    def errors(
        self, level: AnchorModel, before: AnchorModel, pixels: float, whole: Pictures | None = None
    ) -> LevelErrors:
        """A level against the model, of which `whole` are the pictures, and the level before it."""
        whole = whole or self.pictures(self.model, pixels)
        mine = self.pictures(level, pixels)
        last = whole if before is self.model else self.pictures(before, pixels)
        db = {at: psnr_of(mine[at], whole[at]) for at in whole}
        return LevelErrors(pixels, db, max(change_of(mine[at], last[at]) for at in whole))

    def largest_good(self, level: AnchorModel, before: AnchorModel, below: float) -> LevelErrors:
        """The errors at the largest size up to `below` where the level is good; at the smallest
        that was tried, where it is good at none.
        """
        for number in range(TRIES):
            if (found := self.errors(level, before, below / STEP**number)).good:
                break
        return found

    def __enter__(self) -> "LevelMeter":
        return self

    def __exit__(self, *failure) -> None:
        self.renderer.close()


def psnr_of(
    one: list[tuple[np.ndarray, np.ndarray]], other: list[tuple[np.ndarray, np.ndarray]]
) -> float:
    """dB over all pictures together."""
    squares = [
        np.square(np.clip(a, 0, 1) - np.clip(b, 0, 1), dtype=np.float64).mean()
        for (a, _), (b, _) in zip(one, other, strict=True)
    ]
    return float(min(-10 * np.log10(max(np.mean(squares), 1e-30)), MOST_DB))


def change_of(
    one: list[tuple[np.ndarray, np.ndarray]], other: list[tuple[np.ndarray, np.ndarray]]
) -> float:
    """Of 255: the mean difference of the pixels that either covers, over all pictures."""
    found = [0.0]
    for (a, alpha), (b, beta) in zip(one, other, strict=True):
        covered = np.maximum(alpha, beta) >= COVERED
        if covered.any():
            found.append(255 * float(np.abs(a - b)[covered].mean()))
    return float(np.mean(found[1:] or found))
