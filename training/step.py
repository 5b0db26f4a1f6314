"""One training step in order: heads, Gaussians, project, bin, rasterize, loss, and all back."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from shapeshift.rasterizer.project import LEAST_ALPHA, LOW_PASS, Camera
from shapeshift.scene.pose import View
from shapeshift.training.calibration.pose_refinement import PoseGradient
from shapeshift.training.densify import DensificationStats
from shapeshift.training.drawing import Color, DrawnView, draw_splats, splats_backward
from shapeshift.training.heads.gaussians import Activation, Gaussians
from shapeshift.training.heads.networks import KERNELS, HeadLayout, Heads
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import (
    MIN_OPACITY_SHARE,
    ImageLoss,
    MinScale,
    Target,
    add_min_opacity_gradient,
)
from shapeshift.training.losses.surface_losses import ShapeTerm

SAME_STOP = 1e-6  # of Psi: between its own and a blend's rounding


class TrainingStep:
    """Draws the model that an optimiser holds and learns from a target."""

    def __init__(
        self, device, layout: HeadLayout, voxel: float, adam: Adam,
        controls: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """controls: (stops, d) Psi of each stop, where anchors have base colours for each."""
        self.device, self.layout, self.adam, self.controls = device, layout, adam, controls
        self.heads = Heads(device, layout)
        self.activation = Activation(device, layout, voxel)
        self.rows = None  # (R,) int32 on the device: the anchors of the last drawing; None: all
        self.gathered: dict[str, object] = {}  # what the optimiser has of these, by kernels' names
        self.groups: dict[str, str] = {}  # from which of its groups that is
        self.min_scale: MinScale | None = None  # where splats have a least size
        self.pose_gradient: PoseGradient | None = None  # where poses are refined
        self.ms: dict[str, float] | None = None  # of each pass, summed; a dict switches it on ...
        self.clock = time.perf_counter  # ... by this clock, seconds

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        start = self.clock()
        yield
        if self.ms is not None:
            self.device.queue.finish()
            self.ms[name] = self.ms.get(name, 0.0) + 1e3 * (self.clock() - start)

    def decode(self, control: np.ndarray, eye: np.ndarray, rows=None) -> Gaussians:
        """The splats of the model, or of some `rows` (R,) of its anchors alone.

        They are decoded for Psi `control` (d,), or (5, d) one a head, and seen from `eye` (3,)
        metres.
        """
        adam, self.rows = self.adam, rows
        with self.timed("heads"):
            self.groups = self.groups_at(control)
            self.gathered = {name: adam.gather(g, rows) for name, g in self.groups.items()}
            raw = self.heads.forward(
                adam["weights"], self.gathered["anchors"], self.gathered["features"], control, eye
            )
        with self.timed("activate"):
            return self.activation.forward(raw, self.gathered, eye)

    def groups_at(self, control: np.ndarray) -> dict[str, str]:
        """The optimiser's groups that a drawing at Psi `control` reads, by the kernels' names.

        Raises ValueError for colours between stops, where anchors have base colours for each.
        """
        names = ("anchors", "features", *self.layout.own)
        groups, of_color = dict(zip(names, names, strict=True)), self.layout.color_groups
        if len(of_color) > 1:
            assert self.controls is not None
            away = np.abs(self.controls - np.atleast_2d(control)[-1]).max(axis=1)
            if not away.min() < SAME_STOP:
                raise ValueError("base colours are those of a stop, and this is between two")
            groups["colors"] = of_color[int(away.argmin())]
        return groups

    def draw(
        self, view: View, control: np.ndarray, background: Color, with_depth: bool = False,
        rows=None,
    ) -> DrawnView:  # fmt: skip
        splats = self.decode(control, view.world_from_eye.position, rows)
        return draw_splats(self.device, splats, view, background, with_depth, self.timed)

    def gradients(
        self,
        drawing: DrawnView,
        loss: ImageLoss,
        target: Target,
        stats: DensificationStats | None = None,
        depth: ShapeTerm | None = None,
        min_opacity_share: float = MIN_OPACITY_SHARE,
    ) -> dict[str, object]:
        """Gradients of the loss by what the optimiser holds, under its names.

        Where the drawing had some anchors alone, so do the gradients of groups with a row for each.
        """
        device = self.device
        with self.timed("loss"):
            grad_image = loss.compare(drawing.frame.image, target)
        watched = stats is not None
        grad, grad_record = splats_backward(
            device, drawing, grad_image, depth, self.timed, absolute=watched, weight=watched
        )
        with self.timed("density"):
            if stats is not None:
                record, opacity = drawing.projected.record, drawing.splats.opacity
                stats.add(record, grad_record, opacity, drawing.camera.size, self.rows)
        with self.timed("heads backward"):
            if min_opacity_share:
                add_min_opacity_gradient(device, drawing.splats, grad, min_opacity_share)
            if self.min_scale is not None:
                self.min_scale.add_gradient(drawing.splats, grad, self.rows)
            grads = self.backward(grad)
        if self.pose_gradient is not None:
            with self.timed("pose"):
                self.pose_gradient.collect(drawing, grad, grads["anchors"])
        return grads

    def backward(self, grad: Gaussians) -> dict[str, object]:
        """The gradients by what the optimiser holds of those by the last splats decoded."""
        there = self.gathered
        grad_raw, found = self.activation.backward(self.heads.raw, there, grad)
        weights, features = self.heads.backward(
            self.adam["weights"], there["anchors"], there["features"], grad_raw, found["anchors"]
        )
        own = {self.groups[name]: grad_own for name, grad_own in found.items()}
        return {"weights": weights, "features": features} | own

    def update(self, grads: dict[str, object], rate_scale: float) -> None:
        """Groups without a gradient, base colours of other stops, rest."""
        with self.timed("adam"):
            self.adam.step(grads, rate_scale, dict.fromkeys(self.layout.per_anchor, self.rows))


# Turns a run back when it dies: loss not finite, or nothing left to see.

LEAST_VISIBLE = 0.01  # of the largest share of splats that this modality has had on screen
LEAST_CONTRAST = 0.3  # of the contrast to the background of the photo, or of the first picture
IN_A_ROW = 3  # checks that show nothing: one alone may be a camera inside of something
PROBATION = 8  # checks after a rollback, over which the mean loss has to come down to ...
GAINED = 0.6  # ... this share of an untrained model's
GUARD_EVERY = 5  # rounds between checks; a round is one step of every modality
SNAPSHOT_EVERY = 100  # steps
KEPT = 3  # snapshots


class DivergenceGuard:
    """Keeps the last healthy states.  When `is_healthy` is False, `rollback` gives one of them.

    A collapse can begin before it shows, so a second rollback soon after goes one snapshot further.
    """

    def __init__(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [state]
        self.first_loss: dict[str, float] = {}  # of each modality
        self.most: dict[str, tuple[float, float]] = {}  # visible and contrast of each modality
        self.rollbacks = 0
        self.empty = 0  # checks in a row
        self.gains: list[float] | None = None  # losses over first losses since the rollback
        self.grace = 0  # checks before these count

    def observe(self, modality: str, loss: float, visible: float, contrast: float) -> None:
        """What a picture of a modality has; the first time, of the untrained or resumed model.

        visible: the share of all splats that are on screen, 0..1.  contrast: the picture's mean
        contrast to the background over its photo's; splats that have shrunk to black dots are on
        screen, but show nothing.
        """
        before = self.most.get(modality, (0.0, 0.0))
        self.most[modality] = (max(before[0], visible), max(before[1], min(contrast, 1.0)))
        self.first_loss.setdefault(modality, loss)

    def is_healthy(self, modality: str, loss: float, visible: float, contrast: float) -> bool:
        """Whether the run may go on.  After a rollback, that takes a falling loss as well."""
        self.observe(modality, loss, visible, contrast)
        most_visible, most_contrast = self.most[modality]
        enough = visible > LEAST_VISIBLE * most_visible
        enough = enough and contrast > LEAST_CONTRAST * most_contrast
        self.empty = 0 if enough else self.empty + 1
        improves = True
        if self.grace:
            self.grace -= 1
        elif self.gains is not None:
            self.gains.append(loss / self.first_loss[modality])
            if len(self.gains) == PROBATION:
                improves = bool(np.mean(self.gains) < GAINED)
                self.gains = None
        return bool(np.isfinite(loss)) and self.empty < IN_A_ROW and improves

    @property
    def stable(self) -> bool:
        """Whether the last checks were good, so that a state is worth keeping."""
        return self.empty == 0 and self.gains is None

    def save_snapshot(self, state: dict[str, np.ndarray]) -> None:
        self.snapshots = [*self.snapshots, state][-KEPT:]

    def rollback(self, grace: int = 0) -> dict[str, np.ndarray]:
        """The newest snapshot, which is given up unless it is the last one left.

        grace: checks that a warm-up takes before the loss has to come down.
        """
        self.rollbacks += 1
        self.empty, self.gains, self.grace = 0, [], grace
        return self.snapshots.pop() if len(self.snapshots) > 1 else self.snapshots[0]


# Which anchors a training step runs: those that its view can show at its stop.
#
# What lies out of view, or is absent at the stop, has no gradient. It is found by a sphere about
# each anchor that holds what its splats showed when it last ran at that stop; every LOOK-th step
# of a stop runs all anchors, so that what has changed since comes back.

LOOK = 10  # steps of a stop: one of them runs all anchors
# A pixel more on each side than the screen filter widens the most opaque splat.
MARGIN_PX = np.float32(np.sqrt(2 * np.log(1 / LEAST_ALPHA) * LOW_PASS) + 1)


class Visibility:
    """The spheres of A anchors at every stop, and whose turn it is to be looked at."""

    def __init__(self, device, anchors_count: int, stops: int, splats: int) -> None:
        self.device, self.count, self.splats = device, anchors_count, splats
        self.kernels = device.program(KERNELS / "visibility.cl")
        # metres; infinite: nothing is known, below zero: absent
        self.reach = [device.upload(np.full(anchors_count, np.inf, np.float32))] * stops
        self.reach = [array.copy() for array in self.reach]
        self.visits = [0] * stops
        self.everything = device.upload(np.arange(anchors_count, dtype=np.int32))

    def visible_rows(self, stop: int, camera: Camera, anchors):
        """(R,) int32 on the device: which anchors (A, 3) a step at a stop has to run; None: all.

        At least one, so that there is something to launch.
        """
        self.visits[stop] += 1
        if self.visits[stop] % LOOK == 1:
            return None
        device = self.device
        seen = device.empty(self.count, np.uint8)
        device.launch(
            self.kernels["find_visible"], self.count, 64,
            self.count, *camera.size, float(camera.near), MARGIN_PX,
            device.constants(camera.packed()), anchors, self.reach[stop], seen,
        )  # fmt: skip
        rows = np.flatnonzero(device.view(seen)).astype(np.int32)
        if len(rows) == self.count:
            return None
        return device.upload(rows if len(rows) else np.zeros(1, np.int32))

    def update_reach(self, stop: int, rows, anchors, splats: Gaussians) -> None:
        """What anchors (R, 3), the `rows` of a step at a stop, reach with their splats (R * k)."""
        rows = self.everything if rows is None else rows
        self.device.launch(
            self.kernels["measure_reach"], len(rows), 64,
            len(rows), self.splats, LEAST_ALPHA, rows, anchors, splats.means, splats.scales,
            splats.opacity, self.reach[stop],
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """reach (stops, A) metres and visits (stops,): with it a run goes on to the same bits."""
        return {
            "visibility.reach": np.stack([self.device.download(r) for r in self.reach]),
            "visibility.visits": np.array(self.visits),
        }

    def load(self, state: dict[str, np.ndarray]) -> None:
        self.reach = [self.device.upload(reach) for reach in state["visibility.reach"]]
        self.visits = state["visibility.visits"].tolist()
