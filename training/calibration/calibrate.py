"""Where the second camera of a rig really sits, from the photos.

Another modality's photos make a shape; then six numbers are looked for with which that shape shows
the modality's photos best.  Small photos lead near, photos of the size of the training to the end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import LEAST_ALPHA, Projected, project, project_backward
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import View
from shapeshift.training.baselines.plain import one_modality
from shapeshift.training.calibration.extrinsics import (
    ExtrinsicOffset,
    about_pivot,
    offset_of_matrix,
    offset_view,
    pose_gradient,
    rigid,
    slope_about_pivot,
)
from shapeshift.training.drawing import camera_of
from shapeshift.training.first_anchors.views import distance_of
from shapeshift.training.photos import BLACK, LoadedPhoto, read
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

# How bright each splat is in a modality is solved for at every offset of its cameras, by conjugate
# gradients: brightness that was fitted at one offset would hold the cameras there.  It changes with
# the side from which one looks: what is hot glows less at a grazing angle, which else would look
# like an edge that lies elsewhere.  Photos count as grey.
GRAY = 6  # of a record's numbers: the first of its colour's three
FIRST_GRAY = 0.3
SIDES = 4  # numbers of a splat's brightness: one from all basis, and how it changes with the side
LEAST_SEEN = 0.01  # pixels: splats that fill less in all photos change no faster than at this
# means (N, 3), scales (N, 3), wxyz (N, 4), opacity (N,) on the device, metres
Shape = tuple[Any, Any, Any, Any]
Answer = Callable[[int, np.ndarray], np.ndarray]  # of a photo and a picture (H, W): a gradient


class ShapeResiduals:
    """Splats of one shape before the photos of one modality, at one offset of its cameras."""

    def __init__(
        self, device, shape: Shape, photos: list[LoadedPhoto], behind: float, distance: float
    ) -> None:
        """behind: brightness of the background.  distance: metres to what is looked at."""
        self.device, self.shape, self.photos = device, shape, photos
        self.behind, self.distance = behind, distance
        self.count = shape[0].shape[0]
        self.gray = np.zeros((self.count, SIDES))  # see `basis`
        self.gray[:, 0] = FIRST_GRAY
        self.means = device.download(shape[0]).astype(np.float64)
        self.wanted = [
            p.over((behind, behind, behind)).mean(axis=2, dtype=np.float32) for p in photos
        ]
        self.weights = [np.float32(1) if p.weight is None else p.weight for p in photos]
        self.values = sum(
            float(np.broadcast_to(weight, wanted.shape).sum(dtype=np.float64))
            for weight, wanted in zip(self.weights, self.wanted, strict=True)
        )
        self.pace: np.ndarray | None = None

    def step(self, six: np.ndarray) -> np.ndarray:
        """(4, 4) of a turn (3,) radians about what is looked at and a shift (3,) as a share of
        the distance.
        """
        return about_pivot(six, self.distance)

    def move_cameras(self, eye_from_found: np.ndarray) -> None:
        """Put all cameras `eye_from_found` (4, 4) away from their stated poses."""
        self.views = [offset_view(photo.view, eye_from_found) for photo in self.photos]
        blank = self.device.zeros((self.count, 3))
        self.tiles = [
            bin_tiles(self.device, self.projected(view, blank), view.size) for view in self.views
        ]
        if self.pace is None:  # what A^T A does to ones bounds its eigenvalues
            ones = np.zeros_like(self.gray)
            ones[:, 0] = 1
            self.pace = np.maximum(self.normal_product(ones)[:, :1], LEAST_SEEN)

    def view_basis(self, photo: LoadedPhoto) -> np.ndarray:
        """(N, 4) 1 and the direction to each splat from where the photo is said to be taken; by
        an offset that turns by next to nothing.  Times `gray` and summed: how bright it looks.
        """
        way = self.means - photo.view.world_from_eye.position
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        return np.concatenate([np.ones((self.count, 1)), way], axis=1)

    def projected(self, view: View, color) -> Projected:
        means, scales, wxyz, opacity = self.shape
        return project(self.device, means, scales, wxyz, opacity, color, camera_of(view))

    def normal_product(self, gray: np.ndarray) -> np.ndarray:
        """(N, 4) A^T A gray, where A draws splats of that brightness in all photos."""
        return self.adjoint(gray, 0.0, lambda i, picture: picture * self.weights[i])

    def residual(self, i: int, picture: np.ndarray) -> np.ndarray:
        """What a picture lacks of a photo, by how much that counts."""
        return (self.wanted[i] - picture) * self.weights[i]

    def adjoint(
        self, gray: np.ndarray, behind: float, answer: Answer, by_step: np.ndarray | None = None
    ) -> np.ndarray:
        """(N, 4) the gradient by `gray` of what `answer` says of every photo's picture, summed.

        by_step: (6,) to which the gradient by `step` is added.
        """
        device, by_gray = self.device, np.zeros_like(gray)
        for i, (view, tiles) in enumerate(zip(self.views, self.tiles, strict=True)):
            basis = self.view_basis(self.photos[i])
            bright = (basis * gray).sum(axis=1, keepdims=True).astype(np.float32)
            color = device.upload(bright.repeat(3, axis=1))
            projected = self.projected(view, color)
            frame = rasterize(device, projected, tiles, view.size, (behind, behind, behind))
            grad = np.zeros(frame.image.shape, np.float32)
            grad[0] = answer(i, device.view(frame.image)[0])
            record = rasterize_backward(
                device, projected, tiles, frame, device.upload(grad), absolute=False
            )
            by_gray += device.view(record)[:, GRAY, None] * basis
            if by_step is not None:
                by_step += self.step_gradient(view, color, projected, record)
        return by_gray

    def step_gradient(self, view: View, color, projected: Projected, record) -> np.ndarray:
        """(6,) gradient by `step` of what the gradients of one view's records say."""
        means, scales, wxyz, opacity = self.shape
        by_means, _, by_wxyz, *_ = project_backward(
            self.device, means, scales, wxyz, opacity, color, camera_of(view), projected, record
        )
        means, wxyz, *by = map(self.device.view, (means, wxyz, by_means, by_wxyz))
        return slope_about_pivot(pose_gradient(view, means, wxyz, *by), self.distance)

    def solve_brightness(self, steps: int) -> None:
        """Brings `gray` nearer to what shows the photos best from where the cameras stand."""
        gradient = self.adjoint(self.gray, self.behind, self.residual)
        nearer = gradient / self.pace
        way, size = nearer.copy(), np.vdot(gradient, nearer)
        for _ in range(steps):
            moved = self.normal_product(way)
            curve = np.vdot(way, moved)
            if not curve > 0:  # nothing is left to explain
                return
            self.gray = self.gray + size / curve * way
            gradient -= size / curve * moved
            nearer, before = gradient / self.pace, size
            size = np.vdot(gradient, nearer)
            way = nearer + size / before * way

    def cost_and_gradient(self) -> tuple[float, np.ndarray]:
        """Half the mean square error from where the cameras stand, and its (6,) gradient by
        `step`; that of the best brightness, too, which has no gradient of its own.
        """
        cost, by_step = 0.0, np.zeros(6)

        def over(i: int, picture: np.ndarray) -> np.ndarray:
            nonlocal cost
            error = -self.residual(i, picture)
            cost += 0.5 * float((error * (picture - self.wanted[i])).sum(dtype=np.float64))
            return error

        self.adjoint(self.gray, self.behind, over, by_step)
        return cost / self.values, by_step / self.values


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
