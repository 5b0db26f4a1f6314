"""One training step of plain splats: the same projection, rasterizer and loss as the anchors'."""

from typing import Any

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.drawing import Color, DrawnView, draw_splats, splats_backward
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss, Target
from shapeshift.training.losses.surface_losses import ShapeTerm

# What the optimiser holds of N splats of degree n: means (N, 3) metres, scales (N, 3) logarithms of
# one sigma, wxyz (N, 4) any length, opacity (N,) logits, base (N, 3) first coefficient of the
# harmonics, rest (N, (n + 1)^2 - 1, 3) the others.
GROUPS = ("means", "scales", "wxyz", "opacity", "base", "rest")
REST = (0, 3, 8, 15)  # coefficients after the first, of degree 0 to 3


class PlainDensificationStats:
    """Sums over the steps since the last change: each splat's screen gradient, and visits."""

    def __init__(self, device, count: int) -> None:
        self.device, self.count = device, count
        self.kernel = device.program(KERNELS / "plain.cl", REST=0)["accumulate"]
        self.sums = device.zeros((count, 2))

    def add(self, record, grad_record, width: int) -> None:
        self.device.launch(
            self.kernel, self.count, 64, self.count, width / 2, record, grad_record, self.sums
        )


class PlainStep:
    """Draws the splats that an optimiser holds and learns from a target."""

    def __init__(self, device, adam: Adam, sh_degree: int) -> None:
        self.device, self.adam = device, adam
        self.rest = REST[sh_degree]
        self.kernels = device.program(KERNELS / "plain.cl", REST=self.rest)
        self.used = self.rest  # coefficients that count
        self.count = -1

    def resize(self, count: int) -> None:
        if count == self.count:
            return
        device, self.count = self.device, count
        self.scales, self.color = device.empty((count, 3)), device.empty((count, 3))
        self.opacity = device.empty(count)
        self.grad_rest = device.zeros((count, self.rest, 3))

    def decode(self, eye: np.ndarray) -> Gaussians:
        """The splats as they look from `eye` (3,) metres."""
        adam = self.adam
        self.resize(len(adam["means"]))
        self.eye = [np.float32(v) for v in eye]
        self.device.launch(
            self.kernels["activate"], self.count, 64, self.count, self.used, *self.eye,
            adam["means"], adam["scales"], adam["opacity"], adam["base"], self.coefficients(),
            self.scales, self.opacity, self.color,
        )  # fmt: skip
        return Gaussians(adam["means"], self.scales, adam["wxyz"], self.opacity, self.color)

    def coefficients(self):
        """The buffer of `rest`; of degree 0, which has none, one that is not read."""
        return self.adam["rest"] if self.rest else self.adam["base"]

    def draw(self, view: View, background: Color, with_depth: bool = False) -> DrawnView:
        splats = self.decode(view.world_from_eye.position)
        return draw_splats(self.device, splats, view, background, with_depth)

    def gradients(
        self,
        drawing: DrawnView,
        loss: ImageLoss,
        target: Target,
        stats: PlainDensificationStats | None = None,
        depth: ShapeTerm | None = None,
    ) -> dict[str, Any]:
        """Gradients of the loss by what the optimiser holds, under its names."""
        device, splats = self.device, drawing.splats
        grad_image = loss.compare(drawing.frame.image, target)
        grad, grad_record = splats_backward(device, drawing, grad_image, depth, absolute=False)
        if stats is not None:
            stats.add(drawing.projected.record, grad_record, drawing.camera.size[0])
        grad_rest = self.grad_rest if self.rest else grad.color
        device.launch(
            self.kernels["activate_backward"], self.count, 64, self.count, self.used, *self.eye,
            splats.means, self.coefficients(), splats.scales, splats.opacity, splats.color,
            grad.means, grad.scales, grad.opacity, grad.color, grad_rest,
        )  # fmt: skip
        return dict(zip(GROUPS, (*grad.fields(), self.grad_rest), strict=True))
