"""project: splats in the world -> ellipses on the screen, and back; the only culling gate."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device

if TYPE_CHECKING:
    from pyopencl.array import Array

KERNELS = Path(__file__).parent / "kernels"
# Floats a splat: mean x y | conic a b c | opacity | r g b | half extents x y | power threshold
RECORD = 12
LEAST_ALPHA = 1 / 255  # below it a pixel is not drawn (3DGS)
LOW_PASS = 0.3  # px^2 added to the screen covariance (EWA, as 3DGS)
CLAMP = 1.3  # the Jacobian's x/z and y/z stay within this many times the widest tangents (3DGS)
LEAST_CHUNK = 2048  # splats: less is not worth a work-item
WIDTH = {"cpu": 8, "gpu": 1}  # splats a work-item of `project`
GROUP = 64  # work-items
CULL_REASONS = ("opacity", "distance", "frustum", "size", "footprint", "faded")  # gates in order


@dataclass(frozen=True)
class Camera:
    """A pinhole with OpenCV axes; of a View:
    Camera(*view.pinhole(), view.size, view.near, view.widest_tangents()).
    """

    camera_from_world: np.ndarray  # (4, 4); x right, y down, z forward, metres
    fx: float  # pixels
    fy: float
    cx: float  # pixels; anywhere, row 0 on top
    cy: float
    size: tuple[int, int]  # width, height, pixels
    near: float  # metres: drawn where z > near
    # Largest |x/z| and |y/z| of the centred picture that this one is a part of; None: the smallest.
    widest: tuple[float, float] | None = None

    def limits(self) -> tuple[float, float, float, float]:
        """Least and most x/z, least and most y/z that the Jacobian sees.

        About the axis, so that a part of a picture is what it is in the whole; of a centred picture
        3DGS's limits.
        """
        width, height = self.size
        x = max(self.cx, width - self.cx) / self.fx
        y = max(self.cy, height - self.cy) / self.fy
        x, y = (CLAMP * t for t in self.widest or (x, y))
        return -x, x, -y, y

    def packed(self) -> np.ndarray:
        """(20,) float32 as kernels/common/camera.cl reads it."""
        rows = np.asarray(self.camera_from_world, np.float64)[:3].ravel()
        lens = (self.fx, self.fy, self.cx, self.cy)
        return np.concatenate([rows, lens, self.limits()]).astype(np.float32)


TILE = 16  # pixels
LOW_BITS = 12  # of a depth key: the first pass of the sort, counted while the tiles are found


@dataclass(frozen=True)
class TileScratch:
    """Where splats lie in the grid of tiles: what find_tile_bounds and project_arena
    leave for `bin`.
    """

    tile_bounds: "Array"  # (N, 2) uint32: see kernels/common/tiles.cl
    # None where an order from before is used: nothing is to be sorted.
    pairs: "Array | None"  # (N, 2) uint32 splat and sort key of the visible, at each chunk's start
    table: "Array | None"  # (chunks, 1 << LOW_BITS) int32 histograms of the keys' low digit
    status: "Array"  # (chunks, 4) uint32: pairs, intersections, least and most key
    chunk: int  # splats a chunk
    grid: tuple[int, int]  # tiles across, tiles down

    @staticmethod
    def empty(device: Device, count: int, grid: tuple[int, int]) -> "TileScratch":
        """Arrays to be filled for `count` splats, in as many chunks as keep the device busy."""
        chunks = chunks_of(device, count)
        return TileScratch(
            device.empty((count, 2), np.uint32),
            device.empty((count, 2), np.uint32),
            device.empty((chunks, 1 << LOW_BITS), np.int32),
            device.empty((chunks, 4), np.uint32),
            -(-count // chunks),
            grid,
        )

    def arrays(self) -> tuple:
        return self.tile_bounds, self.pairs, self.table, self.status


def chunks_of(device: Device, count: int) -> int:
    """How many work-items share `count` splats in the CPU form."""
    return max(1, min(2 * device.units, count // LEAST_CHUNK))


def grid_of(size: tuple[int, int]) -> tuple[int, int]:
    """Tiles across and down that cover an image."""
    return (-(-size[0] // TILE), -(-size[1] // TILE))


@dataclass(frozen=True)
class Projected:
    """Splats on the screen.  Both arrays lie on the device."""

    record: "Array"  # (N, 12) float32, see kernels/common/record.cl; extents <= 0: culled
    depth: "Array"  # (N,) float32 metres along the view, 1e30 where culled
    low_pass: float = LOW_PASS  # px^2
    culled_counts: "Array | None" = None  # (chunks, 6) int32, CULL_REASONS
    scratch: TileScratch | None = None  # in the grid of the camera's image
    unseen: "Array | None" = None  # (C,) int32: clusters left out, as find_unseen.cl has them

    @property
    def in_tiles(self) -> TileScratch:
        """`scratch`, where project_arena made it."""
        assert self.scratch is not None
        return self.scratch

    def culled(self, device: Device) -> dict[str, int]:
        """How many splats each gate kept out; empty where it was not counted."""
        if self.culled_counts is None:
            return {}
        totals = device.view(self.culled_counts).sum(axis=0, dtype=np.int64)
        return dict(zip(CULL_REASONS, totals.tolist(), strict=True))


def project(
    device: Device, means, scales, wxyz, opacity, color,
    camera: Camera, low_pass: float = LOW_PASS, form: str | None = None,
) -> Projected:  # fmt: skip
    """Screen ellipses and depths of N splats given as device arrays, float32.

    means (N, 3) world metres, scales (N, 3) metres, wxyz (N, 4) of any length, opacity (N,),
    color (N, 3).  Culled: opacity at most 1/255, z not beyond near, off the screen, not finite.
    form: "cpu" or "gpu", by default the device's kind.
    """
    count = means.shape[0]
    record, depth = device.empty((count, RECORD)), device.empty(count)
    wide = WIDTH[form or device.kind]
    kernel = device.program(KERNELS / "project.cl", WIDTH=wide)["project"]
    width, height = camera.size
    device.launch(
        kernel, -(-count // wide), GROUP,
        count, width, height, float(camera.near), LEAST_ALPHA, float(low_pass),
        device.constants(camera.packed()), means, scales, wxyz, opacity, color, record, depth,
    )  # fmt: skip
    return Projected(record, depth, low_pass)


def project_backward(
    device: Device, means, scales, wxyz, opacity, color,
    camera: Camera, projected: Projected, grad_record, form: str | None = None,
) -> tuple:  # fmt: skip
    """Gradients (means, scales, wxyz, opacity, color) from grad_record (N, 12), device arrays."""
    count = means.shape[0]
    grads = tuple(device.empty(a.shape) for a in (means, scales, wxyz, opacity, color))
    wide = WIDTH[form or device.kind]
    kernel = device.program(KERNELS / "project.cl", WIDTH=wide)["project_backward"]
    device.launch(
        kernel, -(-count // wide), GROUP,
        count, float(projected.low_pass), device.constants(camera.packed()), means, scales, wxyz,
        projected.record, grad_record, *grads,
    )  # fmt: skip
    return grads
