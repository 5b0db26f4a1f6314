"""The pictures of both eyes, and what is drawn behind their splats and over them.

Of each eye there is one, or a wide one and a sharp inset.
"""

from collections.abc import Sequence

import moderngl

from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import View
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.floor import Floor
from shapeshift.vr.frame import SIDES
from shapeshift.vr.openxr.layers import QuadPicture
from shapeshift.vr.overlay import Overlay
from shapeshift.vr.play_space import raised
from shapeshift.vr.scene_depth import EyeDepth, SceneDepth
from shapeshift.vr.see_through import SeeThrough
from shapeshift.vr.shown import Inset, part_of_whole

DEPTH_SCALE = 0.5  # of an eye's width and height: edges of a hand behind a splat are soft anyway


class Eyes:
    """Our own picture of each view: RGBA8, display-encoded; use it in a `with`."""

    def __init__(self, ctx: moderngl.Context, sizes: Sequence[tuple[int, int]]) -> None:
        self.floor, self.overlay, self.panel = Floor(ctx), Overlay(ctx), PanelPicture(ctx)
        self.see_through = SeeThrough(ctx)
        self._ctx = ctx
        self.framebuffers: list[moderngl.Framebuffer] = []
        self._depths: list[SceneDepth] = []
        self.fit(sizes)

    def fit(self, sizes: Sequence[tuple[int, int]]) -> None:
        """Pictures of (width, height) pixels, one a view; those there are stay where they fit."""
        if [framebuffer.size for framebuffer in self.framebuffers] == [*sizes]:
            return
        old = list(zip(self.framebuffers, self.textures, strict=True))
        ctx = self._ctx
        self.framebuffers = [ctx.framebuffer([ctx.texture(size, 4)]) for size in sizes]
        self._depths += [SceneDepth(ctx) for _ in sizes[len(self._depths) :]]
        if old:
            self.framebuffers[0].use()  # one of the old ones may be bound
        for framebuffer, texture in old:
            framebuffer.release()
            texture.release()

    @property
    def textures(self) -> list[moderngl.Texture]:
        return [framebuffer.color_attachments[0] for framebuffer in self.framebuffers]

    def depths(self, renderer: Renderer, scale: float) -> list[EyeDepth]:
        """How deep the splats of the frame just drawn are; scale: metres of the world a metre of
        the room.
        """
        drawing, made = renderer.drawing, self._depths[: len(self.framebuffers)]
        return [each.of(drawing.presentable_depth(i), scale) for i, each in enumerate(made)]

    def inset(self, play_views: Sequence[View]) -> Inset | None:
        """What the left eye sees sharp, within its wide picture, where it has a place there."""
        left = len(SIDES)
        place = part_of_whole(play_views[left]) if len(play_views) > left else None
        return Inset(self.textures[left], place) if place is not None else None

    def write_depth(
        self, i: int, framebuffer: moderngl.Framebuffer, play_view: View, depth: EyeDepth,
        drawn: Drawn,
    ) -> None:  # fmt: skip
        """How deep a view's picture is, hands among its splats, for the compositor."""
        self._depths[i].write(framebuffer, play_view, depth)
        self.overlay.write_depth(framebuffer, play_view, drawn)

    def fill_panel(self, play_views: Sequence[View], drawn: Drawn) -> None:
        """Once the pictures are handed over: the panel into its hole, for the mirror and PNGs."""
        if drawn.panel is not None and drawn.panel.apart:
            for framebuffer, view in zip(self.framebuffers, play_views, strict=True):
                self.overlay.show_behind(framebuffer, view, drawn.panel)

    def __enter__(self) -> "Eyes":
        return self

    def __exit__(self, *failure) -> None:
        self.floor.release()
        self.see_through.release()
        self.overlay.release()
        self.panel.release()
        for depth in self._depths:
            depth.release()
        for framebuffer, texture in zip(self.framebuffers, self.textures, strict=True):
            framebuffer.release()
            texture.release()


def quad_of(drawn: Drawn, lift_m: float = 0.0) -> QuadPicture | None:
    """The panel as a layer of its own, where it is one, in the runtime's room, which ours is
    raised over.
    """
    panel = drawn.panel
    if panel is None or not panel.apart:
        return None
    pose = raised(panel.play_from_panel, -lift_m)
    return QuadPicture(panel.texture, panel.version, pose, panel.size_m)
