"""One training step in order: heads, Gaussians, project, bin, rasterize, loss, and all back."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from rasterizer.bin import bin_tiles
from rasterizer.project import Camera, project, project_backward
from rasterizer.raster import rasterize, rasterize_backward
from rasterizer.surface import (
    DepthFrame,
    rasterize_depth,
    rasterize_depth_backward,
    surface,
    surface_backward,
)
from scene.pose import View
from training.density import Evidence
from training.depth_loss import DepthWish
from training.gaussians import Activation, Gaussians
from training.losses import ImageLoss, Target, regularise
from training.networks import HeadLayout, Heads
from training.optimizer import Adam
from training.rise import draw_up

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Drawing:
    """A drawn view with what the way back needs; device arrays."""

    camera: Camera
    splats: Gaussians
    projected: object
    tiles: object
    frame: object
    depth: DepthFrame | None = None  # the same frame with its depth, where that was asked for


def camera_of(view: View) -> Camera:
    return Camera(*view.pinhole(), view.size, view.near)


class Step:
    """Draws the model that an optimiser holds and learns from a target."""

    def __init__(self, device, layout: HeadLayout, voxel: float, adam: Adam) -> None:
        self.device, self.adam = device, adam
        self.heads = Heads(device, layout)
        self.activation = Activation(device, layout, voxel)
        self.ms: dict[str, float] | None = None  # of each pass, summed; a dict switches it on

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        if self.ms is not None:
            self.device.queue.finish()
            self.ms[name] = self.ms.get(name, 0.0) + 1e3 * (time.perf_counter() - start)

    def decode(self, control: np.ndarray, eye: np.ndarray) -> Gaussians:
        """The model's splats for Psi `control` (d,) seen from `eye` (3,) metres."""
        adam = self.adam
        with self.timed("heads"):
            raw = self.heads.forward(
                adam["weights"], adam["anchors"], adam["features"], control, eye
            )
        with self.timed("activate"):
            return self.activation.forward(raw, adam["anchors"])

    def draw(
        self, view: View, control: np.ndarray, background: Color, with_depth: bool = False
    ) -> Drawing:
        splats = self.decode(control, view.world_from_eye.position)
        camera = camera_of(view)
        with self.timed("project"):
            projected = project(self.device, *splats.fields(), camera)
        with self.timed("bin"):
            tiles = bin_tiles(self.device, projected, view.size)
        if with_depth:
            return self._draw_depth(camera, splats, projected, tiles, background)
        with self.timed("rasterize"):
            frame = rasterize(self.device, projected, tiles, view.size, background)
        return Drawing(camera, splats, projected, tiles, frame)

    def _draw_depth(
        self, camera: Camera, splats: Gaussians, projected, tiles, background: Color
    ) -> Drawing:
        geometry = splats.fields()[:3]
        with self.timed("surface"):
            surfaces = surface(self.device, *geometry, camera, projected)
        with self.timed("rasterize"):
            drawn = rasterize_depth(
                self.device, projected, tiles, surfaces, camera.size, background
            )
        return Drawing(camera, splats, projected, tiles, drawn.frame, drawn)

    def gradients(
        self,
        drawing: Drawing,
        loss: ImageLoss,
        target: Target,
        ssim_share: float,
        opacity_share: float = 0.0,
        scale_share: float = 0.0,
        evidence: Evidence | None = None,
        depth: DepthWish | None = None,
        revive: float = 0.0,
    ) -> dict[str, object]:
        """Gradients of the loss by weights, anchors and features, as the optimiser names them."""
        device, adam = self.device, self.adam
        with self.timed("loss"):
            grad_image = loss.compare(drawing.frame.image, target, ssim_share)
        with self.timed("rasterize backward"):
            asked = {} if evidence is None else evidence.asks(drawing.frame.image, target)
            if depth is None:
                grad_record = rasterize_backward(
                    device, drawing.projected, drawing.tiles, drawing.frame, grad_image, None,
                    **asked,
                )  # fmt: skip
            else:
                by_metres, by_through = depth.loss.compare(drawing.depth, depth.target, depth.share)
                grad_record, by_surface = rasterize_depth_backward(
                    device, drawing.projected, drawing.tiles, drawing.depth, grad_image,
                    by_through, by_metres, **asked,
                )  # fmt: skip
        with self.timed("project backward"):
            grad = Gaussians(
                *project_backward(
                    device, *drawing.splats.fields(), drawing.camera, drawing.projected, grad_record
                )
            )
            if depth is not None:
                surface_backward(
                    device, *drawing.splats.fields()[:3], drawing.camera, drawing.projected,
                    drawing.depth.surface, by_surface, grad.fields()[:3],
                )  # fmt: skip
        with self.timed("density"):
            if evidence is not None:
                record, opacity = drawing.projected.record, drawing.splats.opacity
                evidence.add(record, grad_record, opacity, drawing.camera.size)
        with self.timed("heads backward"):
            if opacity_share or scale_share:
                regularise(device, drawing.splats, grad, opacity_share, scale_share)
            if revive:
                draw_up(device, drawing.splats, grad, revive)
            grad_raw, grad_anchors = self.activation.backward(self.heads.raw, grad)
            weights, features = self.heads.backward(
                adam["weights"], adam["anchors"], adam["features"], grad_raw, grad_anchors
            )
        return {"weights": weights, "anchors": grad_anchors, "features": features}

    def update(self, grads: dict[str, object], rate_scale: float) -> None:
        with self.timed("adam"):
            self.adam.step(grads, rate_scale)
