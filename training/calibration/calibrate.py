"""Where the second camera of a rig really sits, from the photos.

Another modality's photos make a shape; then six numbers are looked for with which that shape shows
the modality's photos best.  Small photos lead near, photos of the size of the training to the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.baselines.plain import one_modality
from shapeshift.training.calibration.extrinsics import ExtrinsicOffset, offset_of_matrix, rigid
from shapeshift.training.calibration.residuals import Shape, ShapeResiduals
from shapeshift.training.first_anchors.views import distance_of
from shapeshift.training.photos import BLACK, read
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.backgrounds import choose_background
from shapeshift.training.supervision.still_background import STILL_PHOTOS, chosen, still_share
from shapeshift.training.train import Trainer

STEPS = 2000  # of training the shape
MOST_SIDE = 400  # pixels of a photo that the offset is found from
SOLVE, SOLVE_FIRST = 5, 13  # steps at each offset that is tried, and at a level's first
PROBE = 0.004  # radians, and shares of the distance: 0.3 to 2 pixels
MOST_STEP = 0.03  # of each of the six numbers, at once
LEAST_STEP = 1e-5  # a step of less ends a level
LEAST_CURVE = 0.01  # of the largest: less curvature, or one downwards, counts as that
ReportProgress = Callable[[str, float], None]  # what is done now, and how far it is, 0..1


@dataclass(frozen=True)
class PyramidLevel:
    smaller: int  # sides of the photos are divided by this
    photos: int  # at most, spread evenly
    tries: int  # offsets at most
    probe: bool  # whether the curvature is measured, or that of the level before is used


PYRAMID = (
    PyramidLevel(4, 36, 12, True),
    PyramidLevel(2, 36, 10, True),
    PyramidLevel(1, 36, 8, True),
    PyramidLevel(1, 72, 3, False),
)


def calibrate(
    device,
    capture: Capture,
    settings: TrainSettings,
    modality: str,
    steps: int = STEPS,
    levels: tuple[PyramidLevel, ...] = PYRAMID,
    report: ReportProgress = lambda what, done: None,
) -> ExtrinsicOffset:
    """The offset of a modality's cameras.  Raises BadFile where there is nothing to hold it to."""
    shape = shape_for(device, capture, settings, modality, steps, report)
    return search(device, capture, settings, modality, shape, levels, report)


def shape_for(
    device,
    capture: Capture,
    settings: TrainSettings,
    modality: str,
    steps: int,
    report: ReportProgress,
) -> Shape:
    """What another modality's photos show, as splats on the device.  Raises BadFile."""
    other = reference_of(capture, modality)
    if not capture.of(modality, "train"):
        raise BadFile(f"{capture.folder}: modality '{modality}' has no training photos.")
    _, factor = factors_of(capture, modality, other.name, settings.downscale or 1)
    alone = one_modality(capture, other.name)
    return shape_of(device, alone, shape_settings(settings, steps, factor), report)


def search(
    device,
    capture: Capture,
    settings: TrainSettings,
    modality: str,
    shape: Shape,
    levels: tuple[PyramidLevel, ...],
    report: ReportProgress,
) -> ExtrinsicOffset:
    """The offset of a modality's cameras with which a shape shows its photos best."""
    photos = capture.of(modality, "train")
    other = reference_of(capture, modality)
    factor, _ = factors_of(capture, modality, other.name, settings.downscale or 1)
    distance = distance_of([photo.view for photo in photos])
    offset, inverse = np.eye(4), None
    residuals: ShapeResiduals | None = None
    first: ShapeResiduals | None = None
    for number, level in enumerate(levels):
        report(f"cameras of {modality}", number / len(levels))
        loaded = [
            read(photo, factor * level.smaller, settings.masks)
            for photo in chosen(photos, level.photos)
        ]
        background = choose_background(settings.background, capture.background, loaded)
        behind = float(np.mean(background or BLACK))
        finer = ShapeResiduals(device, shape, loaded, behind, distance)
        if residuals is not None:
            finer.gray = residuals.gray
        residuals = finer
        first = first or residuals
        offset, inverse = descend(residuals, offset, None if level.probe else inverse, level.tries)
    return offset_of_matrix(rigid(offset), gain_db(first, offset) if first else 0.0)


def still_warning(capture: Capture, settings: TrainSettings, modality: str) -> str:
    """What a person should know where something stands still in a modality's photos; "": nothing.

    It is not left out of them: found by itself in small photos of two turntables and not in those
    of a third, it made the offset better once and worse once.  docs/training.md, "A turntable".
    """
    photos = capture.of(modality, "train")
    if not photos:
        return ""  # which calibrate refuses
    factor = max(settings.downscale or 1, -(-max(photos[0].view.size) // MOST_SIDE))
    share = still_share([read(p, factor, settings.masks) for p in chosen(photos, STILL_PHOTOS)])
    if not share:
        return ""
    return (
        f"{modality}: {share:.0%} of its photos' pixels show the same in all of them, while their "
        "cameras turn; --calibrate does not leave that out, and may end far away: give masks of "
        "the subject (docs/training.md)."
    )


def reference_of(capture: Capture, modality: str) -> Stop:
    """The modality whose cameras are taken as right: visible light, else the nearest by x.

    Raises BadFile where there is no such modality, or no other one.
    """
    names = [stop.name for stop in capture.stops]
    if modality not in names:
        raise BadFile(
            f"{capture.folder}: no modality '{modality}' to calibrate; it has {', '.join(names)}."
        )
    if len(names) < 2:
        raise BadFile(
            f"{capture.folder}: '{modality}' is its only modality; an offset of a rig's camera is "
            "found against another one."
        )
    x = capture.stops[names.index(modality)].x
    others = [stop for stop in capture.stops if stop.name != modality]
    return min(others, key=lambda stop: (stop.kind != "rgb", abs(stop.x - x)))


def factors_of(capture: Capture, modality: str, other: str, downscale: int) -> tuple[int, int]:
    """What the sides of two modalities' photos are divided by: pixels of the same angle, since
    splats that were trained at one size are a little too thick at another.
    """
    views = [next(p.view for p in capture.photos if p.modality == n) for n in (modality, other)]
    focal, other_focal = (view.pinhole()[1] for view in views)
    factor = max(downscale, -(-max(views[0].size) // MOST_SIDE))
    return factor, max(round(other_focal * factor / focal), 1)


def shape_settings(settings: TrainSettings, steps: int, factor: int) -> TrainSettings:
    """Those of the run that makes the shape: as asked for, but of one modality, without growing."""
    return replace(
        settings, iterations=steps, seconds=None, grow=False, blended_shapes=0.0,
        view_dependent=False, downscale=factor,
    )  # fmt: skip


def shape_of(device, capture: Capture, settings: TrainSettings, report: ReportProgress) -> Shape:
    """Means, scales, wxyz and opacity on the device of what a capture of one modality shows."""
    (stop,) = capture.stops
    trainer = Trainer(device, capture, settings)
    for now in trainer.steps():
        report(f"shape from {stop.name}", now.fraction)
    splats = trainer.step.decode(trainer.control(stop.name), np.zeros(3))
    arrays = [device.download(array) for array in splats.fields()[:4]]
    there = arrays[3] > LEAST_ALPHA
    for array in arrays:
        there &= np.isfinite(array.reshape(len(array), -1)).all(axis=1)
    if not there.any():
        raise BadFile(
            f"{capture.folder}: the photos of '{stop.name}' gave no shape to hold the cameras to."
        )
    return tuple(device.upload(array[there]) for array in arrays)


def curvature(residuals: ShapeResiduals, offset: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """(6, 6) how the slope changes with each of the six numbers; positive definite."""
    gray, rows = residuals.gray, []
    for way in PROBE * np.eye(6):
        residuals.gray = gray
        residuals.move_cameras(offset @ residuals.step(way))
        residuals.solve_brightness(SOLVE)
        rows.append((residuals.cost_and_gradient()[1] - slope) / PROBE)
    residuals.gray = gray
    values, axes = np.linalg.eigh((np.array(rows) + np.array(rows).T) / 2)
    values = np.abs(values)
    return axes * np.maximum(values, LEAST_CURVE * values.max()) @ axes.T


def descend(
    residuals: ShapeResiduals, offset: np.ndarray, inverse: np.ndarray | None, tries: int
) -> tuple[np.ndarray, np.ndarray]:
    """(offset, inverse curvature) after BFGS from those; None: the curvature is measured first."""
    residuals.move_cameras(offset)
    residuals.solve_brightness(SOLVE_FIRST)
    cost, slope = residuals.cost_and_gradient()
    if inverse is None:
        inverse = np.linalg.inv(curvature(residuals, offset, slope))
    for _ in range(tries):
        way = -inverse @ slope
        way *= min(1.0, MOST_STEP / np.abs(way).max()) if way.any() else 1.0
        if not np.abs(way).max() > LEAST_STEP:
            break
        gray, tried = residuals.gray, offset @ residuals.step(way)
        residuals.move_cameras(tried)
        residuals.solve_brightness(SOLVE)
        cost_there, slope_there = residuals.cost_and_gradient()
        inverse = bfgs_update(inverse, way, slope_there - slope)
        if cost_there < cost:
            offset, cost, slope = tried, cost_there, slope_there
        else:
            residuals.gray = gray
    return offset, inverse


def bfgs_update(inverse: np.ndarray, way: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The inverse curvature with what a step showed of it; where it bends down, smaller steps."""
    along = way @ change
    if not along > 0:
        return inverse / 4
    left = np.eye(6) - np.outer(way, change) / along
    return left @ inverse @ left.T + np.outer(way, way) / along


def gain_db(residuals: ShapeResiduals, offset: np.ndarray) -> float:
    """How much better the photos are shown from `offset` than from the stated poses."""
    costs = []
    for where in (np.eye(4), offset):
        residuals.gray = np.zeros_like(residuals.gray)
        residuals.move_cameras(where)
        residuals.solve_brightness(SOLVE_FIRST)
        costs.append(residuals.cost_and_gradient()[0])
    before, now = np.maximum(costs, 1e-30)
    return float(10 * np.log10(before / now))
