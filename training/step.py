"""One training step in order: heads, Gaussians, project, bin, rasterize, loss, and all back."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.calibration.pose_refinement import PoseGradient
from shapeshift.training.density.densification_stats import DensificationStats
from shapeshift.training.drawing import Color, DrawnView, draw_splats, splats_backward
from shapeshift.training.heads.gaussians import Activation, Gaussians
from shapeshift.training.heads.networks import HeadLayout, Heads
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss, Target
from shapeshift.training.losses.min_opacity import SHARE, add_min_opacity_gradient
from shapeshift.training.losses.min_scale import MinScale
from shapeshift.training.losses.normal_loss import ShapeTerm

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
        min_opacity_share: float = SHARE,
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
