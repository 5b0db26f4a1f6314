"""What a drawing's depth should be: a depth photo, wherever it knows one; with its gradients."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.rasterizer.surface import DepthFrame
from shapeshift.training.heads.networks import KERNELS

# What light that comes through counts against depth.  Much of it makes soft edges hard: in short
# runs on the balls RGB lost 0.6 dB with 1 and nothing with 0.1; with 0 dark things stayed holes.
HOLE = 0.1


@dataclass(frozen=True)
class DepthTarget:
    """A depth photo on the device."""

    depth: Any  # (H, W) float32 metres along the view, 0 where none is known
    known: int  # how many pixels have one

    @property
    def bytes(self) -> int:
        return self.depth.nbytes


class DepthLoss:
    """The mean of |metres - coverage d| / d + HOLE transmittance over known depths d."""

    def __init__(self, device, size: tuple[int, int]) -> None:
        width, height = size
        self.device, self.size, self.known = device, size, 1
        self.kernels = device.program(KERNELS / "depth.cl")
        self.grad_metres, self.grad_transmittance = (
            device.empty((height, width)) for _ in range(2)
        )
        self.rows = device.empty(height)

    def target(self, depth: np.ndarray) -> DepthTarget:
        """(H, W) metres, 0 where none is known."""
        depth = np.ascontiguousarray(depth, np.float32)
        return DepthTarget(self.device.upload(depth), int((depth > 0).sum()))

    def compare(self, drawn: DepthFrame, target: DepthTarget, share: float) -> tuple:
        """Gradients (H, W) by metres and by transmittance of `share` times the loss."""
        width, height = self.size
        self.known = max(target.known, 1)
        self.device.launch(
            self.kernels["compare_depth"], height, 1, width, np.float32(share / self.known),
            np.float32(HOLE), target.depth, drawn.metres, drawn.frame.transmittance,
            self.grad_metres, self.grad_transmittance, self.rows,
        )  # fmt: skip
        return self.grad_metres, self.grad_transmittance

    def value(self) -> float:
        """The loss of the last `compare`, without its share."""
        return float(self.device.download(self.rows).sum(dtype=np.float64)) / self.known


@dataclass(frozen=True)
class DepthTerm:
    """What a step learns from a depth photo, and how much of it."""

    loss: DepthLoss
    target: DepthTarget
    share: float

    def compare(self, drawn: DepthFrame) -> tuple:
        """Gradients (H, W) by metres and by transmittance."""
        return self.loss.compare(drawn, self.target, self.share)
