"""Raw outputs of the heads to Gaussians and back: bounded offsets, clipped scales."""

from dataclasses import dataclass

import numpy as np

from shapeshift.training.heads.networks import KERNELS, HeadLayout

REACH = 2.0  # voxels that a splat may lie away from its anchor along each axis
UNIT = 0.5  # voxels: the scale of a splat whose raw output is 0
SCALE_CLIP = (-6.0, 3.0)  # of the raw output, before exp; the same numbers stand in gaussians.cl


@dataclass(frozen=True)
class Gaussians:
    """Splats of every anchor on the device, or the gradients by them; N = A * k."""

    means: object  # (N, 3) metres
    scales: object  # (N, 3) metres, one sigma
    wxyz: object  # (N, 4) any length
    opacity: object  # (N,) below zero = absent
    color: object  # (N, 3) display sRGB 0..1

    def fields(self) -> tuple:
        return self.means, self.scales, self.wxyz, self.opacity, self.color


class Activation:
    """The heads' activations, forward and backward; voxel is eps of the anchor grid in metres."""

    def __init__(self, device, layout: HeadLayout, voxel: float) -> None:
        self.device, self.layout = device, layout
        self.kernels = device.program(KERNELS / "gaussians.cl", **layout.defines())
        self.reach, self.unit = np.float32(REACH * voxel), np.float32(UNIT * voxel)
        self.count = -1

    def resize(self, count: int) -> None:
        if count == self.count:
            return
        device, n, self.count = self.device, count * self.layout.splats, count
        shapes = ((n, 3), (n, 3), (n, 4), n, (n, 3))
        self.splats = Gaussians(*(device.empty(shape) for shape in shapes))
        self.grad_raw = device.empty((count, self.layout.raw_at[-1]))
        self.grad_anchors = device.empty((count, 3))

    def forward(self, raw, anchors) -> Gaussians:
        self.resize(len(anchors))
        rows = self.device.kind == "cpu"  # an anchor a work-item, else a splat
        items = self.count if rows else self.count * self.layout.splats
        self.device.launch(
            self.kernels["activate_rows" if rows else "activate"], items, 16 if rows else 64,
            items, self.reach, self.unit, raw, anchors, *self.splats.fields(),
        )  # fmt: skip
        return self.splats

    def backward(self, raw, grad: Gaussians):
        """(grad_raw (A, RAW), grad_anchors (A, 3)) of the last `forward`."""
        splats = self.splats
        self.device.launch(
            self.kernels["activate_backward"], self.count, 16,
            self.count, self.reach, self.unit, raw, splats.scales, splats.opacity, splats.color,
            *grad.fields(), self.grad_raw, self.grad_anchors,
        )  # fmt: skip
        return self.grad_raw, self.grad_anchors
