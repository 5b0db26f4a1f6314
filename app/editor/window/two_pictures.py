"""Two pictures in one window: left of a line that the mouse moves is A, right of it B."""

from collections.abc import Sequence
from typing import TypeAlias

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.window.shown import FrameRequest, Shown
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Event,
    KeyDown,
    Press,
    Release,
    Window,
)
from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.renderer.gl.resolve import Resolve
from shapeshift.renderer.renderer import Renderer

Vec: TypeAlias = imgui.ImVec2
Rgb = tuple[float, float, float]
GRAB = 10.0  # logical pixels on either side of the line that take hold of it
STEP = 0.02  # of the window's width, for a press of , or .
MARGIN = 12.0  # logical pixels between the line and a name
TOP = 14.0  # of the names, logical pixels from the window's upper edge


class TwoPictures:
    """The line, and B's picture beside A's, which the window has already."""

    def __init__(self, window: Window, renderer: Renderer, part: float) -> None:
        self._window, self._renderer = window, renderer
        self._shown = Shown(renderer, FrameStatsView(drawing=renderer.backends["drawing"]))
        self._resolve = Resolve(Gpu(window.ctx))
        self._target: moderngl.Framebuffer | None = None  # B's picture, as large as the window
        self._holding = False  # the mouse has the line
        self.part = part  # where the line is, of the window's width

    @property
    def cut(self) -> int:
        """The first column of B, framebuffer pixels from the left."""
        return round(self.part * self._window.size[0])

    def draw_other(self, request: FrameRequest) -> moderngl.Texture:
        """B's picture, as large as the window."""
        target = self._framebuffer(self._window.size)
        self._shown.draw(request, target, False)
        (texture,) = target.color_attachments
        return texture

    def draw_right(self, request: FrameRequest) -> None:
        """Lays B over the right part of the window."""
        window, texture = self._window, self.draw_other(request)
        screen, (width, height) = window.screen(), window.size
        screen.scissor = (self.cut, 0, width - self.cut, height)
        try:
            self._resolve.draw(texture, screen, (0.0, 0.0, 0.0))  # covers: its alpha is 1
        finally:
            screen.scissor = None

    def _framebuffer(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._target is None or self._target.size != size:
            self._release_target()
            ctx = self._window.ctx
            self._target = ctx.framebuffer([ctx.texture(size, 4)])
            self._window.screen().use()
        return self._target

    def handle_line_event(self, event: Event) -> bool:
        """True for what moves the line: dragging it, the keys , and ."""
        match event:
            case KeyDown(key=glfw.KEY_COMMA | glfw.KEY_PERIOD as key):
                self._move_to(self.part + (STEP if key == glfw.KEY_PERIOD else -STEP))
            case Press(button="left", x=x) | DoubleClick(x=x) if self._is_near(x):
                self._holding = isinstance(event, Press)
            case Drag(button="left", x=x) if self._holding:
                self._move_to(x / self._window.logical_size[0])
            case Release(button="left") if self._holding:
                self._holding = False
            case _:
                return False
        return True

    def _is_near(self, x: float) -> bool:
        window = self._window
        return abs(x - self.part * window.logical_size[0]) <= GRAB * window.ui_scale

    def _move_to(self, part: float) -> None:
        self.part = float(np.clip(part, 0.0, 1.0))

    def draw_line(self, names: Sequence[str], inks: Sequence[Rgb], ui_scale: float) -> None:
        """The line and the two names beside it, each in its ink."""
        draw = imgui.get_background_draw_list()
        width, height = self._window.logical_size
        x, margin = self.part * width, MARGIN * ui_scale
        draw.add_line(Vec(x, 0), Vec(x, height), theme.color(theme.TEXT, 0.9), 1.5 * ui_scale)
        draw.add_circle_filled(Vec(x, height / 2), 5 * ui_scale, theme.color(theme.TEXT, 0.9))
        for name, ink, side in zip(names, inks, (-1, 1), strict=True):
            size = imgui.calc_text_size(name)
            left = x + margin if side > 0 else x - margin - size.x
            _draw_name(name, ink, Vec(left, TOP * ui_scale), size, ui_scale)

    def _release_target(self) -> None:
        if self._target is not None:
            release_framebuffer(self._target)
            self._target = None

    def release(self) -> None:
        """What of the GPU is its own; the renderer belongs to its maker."""
        self._release_target()
        self._resolve.release()


def _draw_name(name: str, ink: Rgb, at: imgui.ImVec2, size: imgui.ImVec2, ui_scale: float) -> None:
    pad, draw = 5 * ui_scale, imgui.get_background_draw_list()
    low, high = Vec(at.x - pad, at.y - pad), Vec(at.x + size.x + pad, at.y + size.y + pad)
    draw.add_rect_filled(low, high, theme.color(theme.SURFACE, 0.8), pad)
    draw.add_text(at, theme.color(ink), name)
