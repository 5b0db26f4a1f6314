"""Splats to a frame and a frame's gradients to splats, with depth where that is asked for."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

from shapeshift.rasterizer.bin import Tiles, bin_tiles
from shapeshift.rasterizer.project import Camera, Projected, project, project_backward
from shapeshift.rasterizer.raster import RasterFrame, rasterize, rasterize_backward
from shapeshift.rasterizer.surface import (
    DepthFrame,
    rasterize_depth,
    rasterize_depth_backward,
    surface,
    surface_backward,
)
from shapeshift.scene.pose import View
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.losses.surface_losses import ShapeTerm

Color = tuple[float, float, float]
Timed = Callable[[str], AbstractContextManager]  # of a pass, by its name


@dataclass(frozen=True)
class DrawnView:
    """A drawn view with what the way back needs; device arrays."""

    camera: Camera
    splats: Gaussians
    projected: Projected
    tiles: Tiles
    frame: RasterFrame
    depth: DepthFrame | None = None  # the same frame with its depth, where that was asked for

    @property
    def depth_frame(self) -> DepthFrame:
        """The frame with its depth.  Raises ValueError where it was drawn without."""
        if self.depth is None:
            raise ValueError("the view was drawn without depth")
        return self.depth


def camera_of(view: View) -> Camera:
    return Camera(*view.pinhole(), view.size, view.near, view.widest_tangents())


def untimed(name: str) -> AbstractContextManager:
    return nullcontext()


def draw_splats(
    device, splats: Gaussians, view: View, background: Color, with_depth: bool = False,
    timed: Timed = untimed,
) -> DrawnView:  # fmt: skip
    """The view of splats over a background."""
    camera, depth = camera_of(view), None
    with timed("project"):
        projected = project(device, *splats.fields(), camera)
    with timed("bin"):
        tiles = bin_tiles(device, projected, view.size)
    if not with_depth:
        with timed("rasterize"):
            frame = rasterize(device, projected, tiles, view.size, background)
    else:
        with timed("surface"):
            surfaces = surface(device, *splats.fields()[:3], camera, projected)
        with timed("rasterize"):
            depth = rasterize_depth(device, projected, tiles, surfaces, view.size, background)
            frame = depth.frame
    return DrawnView(camera, splats, projected, tiles, frame, depth)


def splats_backward(
    device, drawing: DrawnView, grad_image, depth: ShapeTerm | None = None, timed: Timed = untimed,
    **asked: Any,
) -> tuple[Gaussians, object]:  # fmt: skip
    """Gradients of the splats and (N, 12) of the records by those of the image.

    depth: what is to be learned from a depth photo or a normal map, for a drawing that has depth.
    asked: what rasterize_backward is to give besides them.
    """
    drawn = None if depth is None else drawing.depth_frame
    with timed("rasterize backward"):
        if depth is None or drawn is None:
            grad_record = rasterize_backward(
                device, drawing.projected, drawing.tiles, drawing.frame, grad_image, None, **asked
            )
        else:
            by_metres, by_through = depth.compare(drawn)
            grad_record, by_surface = rasterize_depth_backward(
                device, drawing.projected, drawing.tiles, drawn, grad_image, by_through,
                by_metres, **asked,
            )  # fmt: skip
    fields, camera = drawing.splats.fields(), drawing.camera
    with timed("project backward"):
        grad = Gaussians(*project_backward(device, *fields, camera, drawing.projected, grad_record))
        if drawn is not None:
            surface_backward(
                device, *fields[:3], camera, drawing.projected, drawn.surface, by_surface,
                grad.fields()[:3],
            )  # fmt: skip
    return grad, grad_record
