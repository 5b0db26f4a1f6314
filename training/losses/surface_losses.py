"""Which way a drawing's surfaces should look: a normal map, with its gradients by the depth drawn.

Two neighbouring pixels of one surface lie along it, so the way from one to the other is square to
its normal.  That needs no normal of the drawing, and no distance: a normal map says how a surface
lies, not where.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.rasterizer.surface import DepthFrame
from shapeshift.scene.pose import View
from shapeshift.training.heads.networks import KERNELS

# What a drawing's depth should be: a depth photo, wherever it knows one; with its gradients.

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


# Cosine between the normals of two neighbours from which they lie on one surface; less is a crease
# or an edge.  The same number stands in normals.cl, in steps of 1 / 127.
ALIKE = 0.9


@dataclass(frozen=True)
class NormalTarget:
    """A normal map on the device, and the camera that sees it."""

    normals: Any  # (H, W, 4) int8: 127 times the direction, eye axes, and 1 where it is known
    camera: tuple[float, float, float, float]  # fx, fy, cx, cy, pixels
    known: int  # pairs of neighbours that lie on one surface

    @property
    def bytes(self) -> int:
        return self.normals.nbytes


def pairs_of(normals: np.ndarray) -> int:
    """How many pairs of neighbours of (H, W, 4) int8 lie on one surface."""
    whole, count = normals.astype(np.int32), 0
    for one, other in ((whole[:, :-1], whole[:, 1:]), (whole[:-1], whole[1:])):
        both = (one[..., 3] > 0) & (other[..., 3] > 0)
        cosine = (one[..., :3] * other[..., :3]).sum(axis=2)
        count += int((both & (cosine >= round(ALIKE * 127 * 127))).sum())
    return count


class NormalLoss:
    """The mean of |e| / (1 + |e|) over pairs of neighbours on one surface.

    e = n . (p2 - p1) / (z |r2 - r1|): n the mean of their normals, p = z r where their rays r meet
    what is drawn, z the mean of both depths below the line.  It is the slope by which the drawing
    leaves the surface; a jump of the depth, which many a prior draws over, counts 1 and pulls
    little.  Pixels that are covered by less than a half count 0.
    """

    def __init__(self, device, size: tuple[int, int]) -> None:
        width, height = size
        self.device, self.size, self.known = device, size, 1
        self.kernels = device.program(KERNELS / "normals.cl")
        self.grad_metres, self.grad_transmittance = (
            device.empty((height, width)) for _ in range(2)
        )
        self.rows = device.empty(height)

    def target(self, normals: np.ndarray, view: View) -> NormalTarget:
        """(H, W, 4) int8 as load_normals gives them, of a photo with that view."""
        whole = np.ascontiguousarray(normals, np.int8)
        _, fx, fy, cx, cy = view.pinhole()
        return NormalTarget(self.device.upload(whole), (fx, fy, cx, cy), pairs_of(whole))

    def compare(
        self, drawn: DepthFrame, target: NormalTarget, share: float, others: tuple | None = None
    ) -> tuple:
        """Gradients (H, W) by metres and by transmittance of `share` times the loss.

        others: such of another loss, to which these are added.
        """
        width, height = self.size
        self.known = max(target.known, 1)
        by_metres, by_through = others or (self.grad_metres, self.grad_transmittance)
        self.device.launch(
            self.kernels["compare_normals"], height, 1, width, height,
            np.float32(share / self.known), int(others is not None),
            *(np.float32(number) for number in target.camera), target.normals, drawn.metres,
            drawn.frame.transmittance, by_metres, by_through, self.rows,
        )  # fmt: skip
        return by_metres, by_through

    def value(self) -> float:
        """The loss of the last `compare`, without its share."""
        return float(self.device.download(self.rows).sum(dtype=np.float64)) / self.known


@dataclass(frozen=True)
class NormalTerm:
    """What a step learns from a normal map, and how much of it; and from depth beside it."""

    loss: NormalLoss
    target: NormalTarget
    share: float
    depth: DepthTerm | None = None

    def compare(self, drawn: DepthFrame) -> tuple:
        """Gradients (H, W) by metres and by transmittance."""
        others = None if self.depth is None else self.depth.compare(drawn)
        return self.loss.compare(drawn, self.target, self.share, others)


ShapeTerm = DepthTerm | NormalTerm
