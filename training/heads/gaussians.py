"""Raw outputs of the heads to Gaussians and back: bounded offsets, clipped scales."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shapeshift.training.heads.networks import ATTRIBUTE_WIDTH, KERNELS, HeadLayout

if TYPE_CHECKING:
    from pyopencl.array import Array

REACH = 2.0  # voxels that a splat may lie away from its anchor along each axis
UNIT = 0.5  # voxels: the scale of a splat whose raw output is 0
SCALE_CLIP = (-6.0, 3.0)  # of the raw output, before exp; the same numbers stand in gaussians.cl


@dataclass(frozen=True)
class Gaussians:
    """Splats of every anchor on the device, or the gradients by them; N = A * k."""

    means: "Array"  # (N, 3) metres
    scales: "Array"  # (N, 3) metres, one sigma
    wxyz: "Array"  # (N, 4) any length
    opacity: "Array"  # (N,) below zero = absent
    color: "Array"  # (N, 3) display sRGB 0..1

    def fields(self) -> "tuple[Array, Array, Array, Array, Array]":
        return self.means, self.scales, self.wxyz, self.opacity, self.color


class Activation:
    """The heads' activations, forward and backward; voxel is eps of the anchor grid in metres."""

    def __init__(self, device, layout: HeadLayout, voxel: float) -> None:
        self.device, self.layout = device, layout
        self.nothing = device.zeros(1)  # in the place of what anchors do not have
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
        self.grad_attributes = {
            name: device.empty((count, self.layout.widths[name])) for name in self.layout.own
        }

    def attributes_of(self, rows: dict[str, Any]) -> tuple:
        """Frames, base colours and light of a step's anchors, or what stands in their place."""
        return tuple(rows.get(name, self.nothing) for name in ATTRIBUTE_WIDTH)

    def forward(self, raw, rows: dict[str, Any], eye: np.ndarray) -> Gaussians:
        """The splats seen from an eye (3,) in metres.

        `rows`: what the step's anchors have, a row each, with the base colours of its stop.
        """
        self.resize(len(rows["anchors"]))
        self.eye = [np.float32(v) for v in eye]
        by_row = self.device.kind == "cpu"  # an anchor a work-item, else a splat
        items = self.count if by_row else self.count * self.layout.splats
        self.device.launch(
            self.kernels["activate_rows" if by_row else "activate"], items, 16 if by_row else 64,
            items, self.reach, self.unit, *self.eye, raw, rows["anchors"],
            *self.attributes_of(rows), *self.splats.fields(),
        )  # fmt: skip
        return self.splats

    def backward(self, raw, rows: dict[str, Any], grad: Gaussians) -> tuple:
        """(grad_raw (A, RAW), by group those of `rows` but the features) of the last `forward`."""
        splats, (frames, _, light) = self.splats, self.attributes_of(rows)
        self.device.launch(
            self.kernels["activate_backward"], self.count, 16,
            self.count, self.reach, self.unit, *self.eye, raw, rows["anchors"], frames, light,
            splats.scales, splats.opacity, splats.color, *grad.fields(), self.grad_raw,
            self.grad_anchors, *self.attributes_of(self.grad_attributes),
        )  # fmt: skip
        return self.grad_raw, {"anchors": self.grad_anchors} | self.grad_attributes
