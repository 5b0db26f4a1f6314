"""Two stops at once, by a second knob on the same track: right of a line, or heat over shape."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeAlias

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.frame_stats import FrameStatsView
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.state.shown_scene import SplitState, name_of
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shown import FrameRequest, RightSide, Shown
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
from shapeshift.renderer.gl.over_picture import HeatOverShape
from shapeshift.renderer.gl.resolve import Resolve
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.scene import Scene

# Two pictures in one window: left of a line that the mouse moves is A, right of it B.

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


KEYS = (
    ("C", "another stop right of a line, on and off"),
    ("Shift+C", "heat over shape, on and off"),
    (", .", "move the line; or drag it"),
)


class Split(TwoPictures):
    """Draws what a `SplitState` asks for."""

    def __init__(
        self, window: Window, renderer: Renderer, split_state: SplitState, free: Box
    ) -> None:
        super().__init__(window, renderer, (free[0] + free[2]) / 2 / window.logical_size[0])
        self._state = split_state
        self._made: tuple = (None, 0.0, None)  # A's scene and x that B's scene was made of, and it
        self._over: HeatOverShape | None = None  # made when it is first wanted
        self._screen: moderngl.Framebuffer | None = None  # A's picture, where both are mixed

    def other(self, scene: Scene) -> Scene:
        """The scene at the other x; the same object until one of the two changes."""
        made_of, x, other = self._made
        if made_of is not scene or x != self._state.x:
            other = self._state.right(scene)
            self._made = (scene, self._state.x, other)
        return other

    def beside(
        self, scene: Scene, width: int, refuse: Callable[[BadFile], None]
    ) -> RightSide | None:
        """What is right of the line, where it parts the window at all."""
        if self._state.over or not 0 < self.cut < width:
            return None
        return RightSide(self.other(scene), self.cut, self._renderer, refuse)

    def draw(self, request: FrameRequest) -> None:
        """Lays the other x over the right part of the window, or mixes both.  Raises BadFile for no
        room.
        """
        if request.beside is not None:
            return  # both are there
        request = replace(request, scene=self.other(request.scene))
        if not self._state.over:
            self.draw_right(request)
            return
        heat, photo = self.draw_other(request), self._copy_of_screen()
        if not self._state.other_is_heat(self._made[0]):
            heat, photo = photo, heat
        self._over = self._over or HeatOverShape(Gpu(self._window.ctx))
        self._over.draw(photo, heat, self._window.screen(), self._state.detail)

    def _copy_of_screen(self) -> moderngl.Texture:
        """A's picture, which the window has already."""
        window = self._window
        if self._screen is None or self._screen.size != window.size:
            self._release_screen()
            self._screen = window.ctx.framebuffer([window.ctx.texture(window.size, 4)])
        window.ctx.copy_framebuffer(self._screen, window.screen())
        window.screen().use()
        (texture,) = self._screen.color_attachments
        return texture

    def _release_screen(self) -> None:
        if self._screen is not None:
            release_framebuffer(self._screen)
            self._screen = None

    def release(self) -> None:
        super().release()
        self._release_screen()
        if self._over is not None:
            self._over.release()


@contextmanager
def splitting(
    window: Window, state: EditorState, hooks: Hooks,
    free: Callable[[], Box], make_renderer: Callable[[], Renderer],
) -> Iterator[None]:  # fmt: skip
    """Adds the split view to a viewer; its renderer is made when it is first wanted."""
    split_state = state.split
    made: list[tuple[Split, Renderer]] = []  # of one, once it is wanted

    def split() -> Split:
        if not made:
            renderer = make_renderer()
            made.append((Split(window, renderer, split_state, free()), renderer))
        return made[0][0]

    def refuse(error: BadFile) -> None:
        split_state.on = False
        state.messages.fail(said("There is no room for a second picture: {error}", error=error))

    def draw(request: FrameRequest) -> None:
        split_state.on = split_state.shows(request.scene)
        if split_state.on:
            try:
                split().draw(request)
            except BadFile as error:
                refuse(error)

    def draw_marks(ui_scale: float) -> None:
        if split_state.on and made and not split_state.over:
            names = [f"{name}  {text}" for name, text in zip("AB", sides_of(state), strict=True)]
            split().draw_line(names, (theme.ACCENT, theme.SECOND), ui_scale)

    def handle_event(event: Event) -> bool:
        if isinstance(event, KeyDown) and event.key == glfw.KEY_C and not event.ctrl:
            for index in state.sliders[:1]:
                split_state.toggle(state.scene.objects[index], event.shift, state.shifts.get(index))
            return True
        has_line = split_state.on and bool(made) and not split_state.over
        return has_line and split().handle_line_event(event)

    def beside(scene: Scene, width: int) -> RightSide | None:
        wanted = split_state.shows(scene) and not state.settings.debug
        return split().beside(scene, width, refuse) if wanted else None

    hooks.over.append(draw)
    hooks.beside = beside
    hooks.marks.append(draw_marks)
    hooks.event_handlers.append(handle_event)
    hooks.keys["Two stops at once"] = list(KEYS)
    state.split.possible = True
    try:
        yield
    finally:
        split_state.on = split_state.possible = False
        hooks.over.remove(draw)
        hooks.beside = lambda scene, width: None
        hooks.marks.remove(draw_marks)
        hooks.event_handlers.remove(handle_event)
        for picture, renderer in made:
            picture.release()
            renderer.close()


def sides_of(state: EditorState) -> tuple[str, str]:
    """What is left and right of the line: a stop's name, else x."""
    names = [obj.name for obj in state.scene.objects]
    index = names.index(state.split.name)
    stops = state.stops(index)
    return name_of(state.scene.objects[index].slider_x, stops), name_of(state.split.x, stops)
