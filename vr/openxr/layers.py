"""What a frame hands to the runtime's compositor: both eyes, how deep they are, and the panel.

The panel is a layer of its own below the eyes, which have a hole where it is seen: so it is as
sharp as its own pixels at any size of the eyes' pictures, and what is nearer still hides it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import moderngl
import numpy as np

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import FAR_M, NEAR_M
from shapeshift.vr.openxr.graphics import (
    DEPTH_FORMATS,
    DepthSwapchain,
    NoDepth,
    Swapchain,
    SwapchainFormat,
    choose_format,
)
from shapeshift.vr.openxr.hands import posef_of
from shapeshift.vr.openxr.instance import DEPTH_LAYER, Instance
from shapeshift.vr.shown import Blit

WriteDepth = Callable[[int, moderngl.Framebuffer], None]  # of an eye: NEAR_M is 0 and FAR_M is 1


@dataclass(frozen=True)
class QuadPicture:
    """A flat picture in the room that the compositor places itself."""

    texture: moderngl.Texture  # display sRGB, opaque, row 0 below
    version: int  # another one whenever the picture is
    play_from_quad: Pose
    size_m: tuple[float, float]


class FrameLayers:
    """The runtime's images of a session; `sizes` of the eyes' pictures, `depth`: the format of
    their depths, "" for none.  Both are known after it was closed or lost, too: reports have them.
    """

    def __init__(
        self,
        instance: Instance,
        session: Any,
        ctx: moderngl.Context,
        sizes: Sequence[tuple[int, int]],
        pixels: SwapchainFormat,
    ) -> None:
        self._instance, self._xr, self._session, self._ctx = instance, instance.xr, session, ctx
        self.pixels, self._shown = pixels, Blit(ctx)
        self.keep = False  # read the runtime's images back into the next two
        self.kept: list[np.ndarray] = []  # (H, W, 4) an eye
        self.kept_depth: list[np.ndarray] = []  # (H, W) an eye
        self.last: list[str] = []  # names of what the last frame handed over
        self._eyes = [Swapchain(instance, session, ctx, size, pixels) for size in sizes]
        self.sizes = list(sizes)
        self._depths = self._open_depths()
        self.depth = self._depths[0].pixels.name if self._depths else ""
        self._deep: list[Any] = []  # of the last frame
        self._panel: Swapchain | None = None
        self._panel_version: int | None = None  # that lies in it

    def _open_depths(self) -> list[DepthSwapchain]:
        """None where the runtime or the driver takes no depth: frames go without."""
        if DEPTH_LAYER not in self._instance.extensions:
            return []
        offered = [int(each) for each in self._xr.enumerate_swapchain_formats(self._session)]
        made: list[DepthSwapchain] = []
        try:
            pixels = choose_format(offered, formats=DEPTH_FORMATS)
            for size in self.sizes:
                chain = DepthSwapchain(self._instance, self._session, self._ctx, size, pixels)
                made.append(chain)
        except (ValueError, NoDepth):
            for chain in made:
                chain.close()
            return []
        return made

    def hand_over(
        self,
        textures: Sequence[moderngl.Texture],
        views: Sequence[Any],
        space: Any,
        write_depth: WriteDepth | None,
        quad: QuadPicture | None,
        see_through: bool,
    ) -> list[Any]:
        """The frame's layers, the farthest first; they live as long as the list does.

        views: the runtime's, of this frame.  see_through: alpha of the eyes is for what lies behind
        them, the panel or the room itself.
        """
        xr, self.last = self._xr, ["room"] if see_through else []
        layers: list[Any] = []
        if quad is not None:
            layers.append(self._quad_layer(quad, space))
        deep = self._fill_depths(write_depth)
        self.kept = []
        projected = []
        for i, (chain, texture, view) in enumerate(zip(self._eyes, textures, views, strict=True)):
            picture = chain.show(texture, self._shown, self.keep)
            if picture is not None:
                self.kept.append(picture)
            behind = deep[i] if deep else None
            each = xr.CompositionLayerProjectionView(view.pose, view.fov, chain.whole, next=behind)
            projected.append(each)
        flags = xr.CompositionLayerFlags
        flag = flags.BLEND_TEXTURE_SOURCE_ALPHA_BIT if quad or see_through else flags.NONE
        self._deep = deep  # the views point at them
        layers.append(xr.CompositionLayerProjection(flag, space, views=projected))
        self.last += ["eyes"]
        return layers

    def _fill_depths(self, write_depth: WriteDepth | None) -> list[Any]:
        """What is chained to each eye's view; none where there is no depth."""
        xr, self.kept_depth = self._xr, []
        if not self._depths or write_depth is None:
            return []
        deep = []
        for i, chain in enumerate(self._depths):
            kept = chain.fill(partial(write_depth, i), self.keep)
            if kept is not None:
                self.kept_depth.append(kept)
            info = xr.CompositionLayerDepthInfoKHR(chain.whole, 0.0, 1.0, NEAR_M, FAR_M)
            deep.append(info)
        self.last.append("depth")
        return deep

    def _quad_layer(self, quad: QuadPicture, space: Any) -> Any:
        xr = self._xr
        size = quad.texture.size
        if self._panel is None or self._panel.size != size:
            if self._panel is not None:
                self._panel.close()
            made = (self._instance, self._session, self._ctx, size, self.pixels)
            self._panel, self._panel_version = Swapchain(*made), None
        if self._panel_version != quad.version:
            self._panel.show(quad.texture, self._shown)
            self._panel_version = quad.version
        self.last.append("panel")
        return xr.CompositionLayerQuad(
            xr.CompositionLayerFlags.NONE, space, xr.EyeVisibility.BOTH, self._panel.whole,
            posef_of(quad.play_from_quad), xr.Extent2Df(*quad.size_m),
        )  # fmt: skip

    def close(self) -> None:
        """Gives all back, also what was lost with the runtime."""
        for chain in (*self._eyes, *self._depths, *([self._panel] if self._panel else [])):
            chain.close()
        self._eyes, self._depths, self._panel = [], [], None
        self._shown.release()
