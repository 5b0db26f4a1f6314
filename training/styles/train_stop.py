"""A new stop learns: step by step towards pictures, or splat by splat towards what a rule says."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.runtime_models.model import AnchorModel
from shapeshift.scene.cameras.framing import (
    FOV_Y,
    default_view,
    fit_distance,
    frame_points,
    orbit_path,
    view_from,
)
from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, draw_splats
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.losses.losses import ImageLoss, Target
from shapeshift.training.styles.stop_trainer import StopTrainer
from shapeshift.training.styles.style_pictures import StylePictures, StyleView

Progress = Callable[[str, float], None]  # what is done, and how much of the run, 0..1
NO_CONTROL = np.zeros(1)  # the new stop is the only one that is drawn
BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class PictureRun:
    """How a stop learns from pictures."""

    steps: int = 400
    strength: float = 1.0  # 0..1: of the style; the rest is what the source stop shows
    background: Color = BLACK  # behind everything


def train_on_pictures(
    trainer: StopTrainer,
    views: Sequence[View],
    pictures: StylePictures,
    run: PictureRun,
    progress: Progress | None = None,
) -> float:
    """Lets the stop learn what `pictures` shows; the mean loss over the last tenth of the steps."""
    report = progress or (lambda what, done: None)
    rng = np.random.default_rng([trainer.settings.seed, 23])
    first = [look(trainer, i, view, run.background) for i, view in enumerate(views)]
    losses = {view.size: ImageLoss(trainer.device, view.size) for view in views}
    found: list[float] = []
    for numbers, begin, end in turns(pictures, len(views), run.steps):
        report("pictures of the style", begin / run.steps)
        now = [
            look_again(trainer, first[i], run.background) if begin else first[i] for i in numbers
        ]
        made = pictures.make(now, begin / run.steps)
        targets = [
            target_of(trainer, losses, view, picture, run)
            for view, picture in zip(now, made, strict=True)
        ]
        for step in range(begin, end):
            i = int(rng.integers(len(numbers)))
            loss = losses[now[i].view.size]
            drawing = trainer.step.draw(now[i].view, NO_CONTROL, run.background)
            grads = trainer.step.gradients(drawing, loss, targets[i], min_opacity_share=0)
            trainer.update(grads, step / run.steps)
            if step >= 0.9 * run.steps:
                found.append(loss.value())
            report("steps towards the pictures", (step + 1) / run.steps)
    return float(np.mean(found)) if found else 0.0


def turns(pictures: StylePictures, views: int, steps: int) -> Iterator[tuple[list[int], int, int]]:
    """(numbers of views, first step, step after the last) of every turn of a run."""
    at_once = min(pictures.turns.views or views, views)
    each = pictures.turns.steps or steps
    for turn, begin in enumerate(range(0, steps, each)):
        numbers = [(turn * at_once + i) % views for i in range(at_once)]
        yield numbers, begin, min(begin + each, steps)


def look(trainer: StopTrainer, number: int, view: View, background: Color) -> StyleView:
    """What is seen from a view before the first step: the source stop."""
    device = trainer.device
    drawing = trainer.step.draw(view, NO_CONTROL, background, with_depth=True)
    picture = picture_of(device, drawing)
    coverage = 1 - device.download(drawing.frame.transmittance)
    depth = device.download(drawing.depth_frame.metres) / np.maximum(coverage, 1e-6)
    if trainer.inside is not None:
        coverage = region_coverage(trainer, trainer.inside, drawing.splats, view)
    return StyleView(number, view, picture, coverage, depth, picture)


def look_again(trainer: StopTrainer, first: StyleView, background: Color) -> StyleView:
    """The same view with what the new stop shows by now."""
    drawing = trainer.step.draw(first.view, NO_CONTROL, background)
    shown = picture_of(trainer.device, drawing)
    return StyleView(first.number, first.view, first.source, first.coverage, first.depth_m, shown)


def picture_of(device, drawing) -> np.ndarray:
    """(H, W, 3) float32 of a drawn view."""
    return np.ascontiguousarray(device.download(drawing.frame.image).transpose(1, 2, 0))


def region_coverage(
    trainer: StopTrainer, inside: np.ndarray, splats: Gaussians, view: View
) -> np.ndarray:
    """(H, W) 0..1: how much of each pixel comes from splats that may change."""
    each = trainer.layout.splats * 3
    white = np.repeat(inside.astype(np.float32), each).reshape(-1, 3)
    fields = splats.fields()[:4]
    marked = Gaussians(*fields, trainer.device.upload(white))
    drawing = draw_splats(trainer.device, marked, view, BLACK)
    return trainer.device.download(drawing.frame.image)[0].copy()


def target_of(
    trainer: StopTrainer, losses: dict, view: StyleView, picture: np.ndarray, run: PictureRun
) -> Target:
    """A picture as what the loss compares with: laid over what may not change."""
    # At its rim the scene is partly the background, in the picture of a style as well; about a
    # region stands what the source stop shows.
    whole = trainer.inside is None
    beside = np.asarray(run.background, np.float32) if whole else view.source
    covered = view.coverage[..., None]
    styled = covered * np.clip(np.nan_to_num(picture), 0, 1) + (1 - covered) * beside
    image = run.strength * styled + (1 - run.strength) * view.source
    rgba = np.full((*image.shape[:2], 4), 255, np.uint8)
    rgba[..., :3] = np.rint(255 * np.clip(image, 0, 1))
    return losses[view.view.size].target(trainer.device.upload(rgba), run.background)


# From where a new stop is looked at while it learns: a dome about the scene, or given cameras.

GOLDEN = 0.618034  # of a turn between two views: any number of them is spread evenly
LOW, HIGH = 0.05, 0.9  # sines of the dome's elevations: from level to 64 degrees
FAR, NEAR = 1.0, 0.7  # of the distance that shows the whole scene, in turns
ASIDE, ABOVE = 0.9, 0.35  # radians about a known first look, either way, where there is one


def dome_views(model: AnchorModel, count: int, size: tuple[int, int]) -> list[View]:
    """`count` views of the model, spread over a dome about its bounds.

    Of a model that knows a first look (a room, or one side of something) they are spread about it.
    """
    if "view" in model.provenance:
        return views_about(model, count, size)
    centre, radius = frame_points(model.anchors, np.ones(len(model.anchors), np.float32))
    whole = fit_distance(radius, size)
    out = []
    for i in range(count):
        height = LOW + (HIGH - LOW) * ((i + 0.5) * 2**0.5 % 1)
        away = whole * (FAR, NEAR)[i % 2]
        out += orbit_path(
            1, centre, radius, size, elevation=float(np.arcsin(height)), distance=away,
            start=2 * np.pi * (GOLDEN * i % 1),
        )  # fmt: skip
    return out


def views_about(model: AnchorModel, count: int, size: tuple[int, int]) -> list[View]:
    """Views on the target of the model's first look, from about where that one stands."""
    first = default_view(model, size)
    _, radius = frame_points(model.anchors, np.ones(len(model.anchors), np.float32))
    eye = np.array(model.provenance["view"]["eye"], float)
    target = np.array(model.provenance["view"]["target"], float)
    x, y, z = eye - target
    away = float(np.linalg.norm(eye - target))
    azimuth, elevation = np.arctan2(x, z), np.arcsin(np.clip(y / away, -1, 1))
    fov_y = float(model.provenance["view"].get("fov_y", FOV_Y))
    out = [first]
    for i in range(1, count):
        turn = azimuth + ASIDE * (2 * (GOLDEN * i % 1) - 1)
        up = np.clip(elevation + ABOVE * (2 * ((i + 0.5) * 2**0.5 % 1) - 1), -1.4, 1.4)
        direction = np.array([np.sin(turn) * np.cos(up), np.sin(up), np.cos(turn) * np.cos(up)])
        distance = away * (FAR, NEAR)[i % 2]
        out.append(view_from(target + distance * direction, target, radius, size, fov_y))
    return out


def resized_views(views: Sequence[View], longest: int) -> list[View]:
    """The same views in pictures whose longer side has at most so many pixels."""
    out = []
    for view in views:
        width, height = view.size
        factor = min(1.0, longest / max(width, height))
        size = max(round(width * factor), 1), max(round(height * factor), 1)
        out.append(view if size == view.size else view.resized(size))
    return [replace(view) for view in out]
