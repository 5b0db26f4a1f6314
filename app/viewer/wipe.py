"""Two scenes in one window: left of a line that the mouse moves is A, right of it B."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from app.charts.comparison import MOST_DB, Comparison
from app.commands.compare_sides import SceneSide, open_side
from app.errors import UsageError
from app.panels import theme
from app.program import program
from app.viewer.readings import Readings
from app.viewer.shown import Shown, Wish, picture_key
from app.viewer.window import DoubleClick, Drag, Event, KeyDown, Press, Release
from renderer.gpu import Gpu
from renderer.renderer import Renderer
from renderer.resolve import Resolve
from scene.camera_list import moved
from scene.metrics import psnr
from scene.scene import Scene

if TYPE_CHECKING:
    from app.viewer.desktop import Options, Viewer

Vec = imgui.ImVec2
GRAB = 10.0  # logical pixels on either side of the line that take hold of it
STEP = 0.02  # of the window's width, for a press of , or .
MARGIN = 12.0  # logical pixels between the line and a name
KEYS = (
    (", .", "move the line of the wipe"),
    ("C", "wipe on, off"),
)
TOP = 14.0  # of the names, logical pixels from the window's upper edge


@contextmanager
def comparing(viewer: "Viewer", options: "Options") -> Iterator["Wipe | None"]:
    """Adds a wipe to the viewer where --compare asks for one.  Raises BadFile, UsageError."""
    if not options.compare:
        yield None
        return
    side = open_side(options.compare, options)
    if not isinstance(side, SceneSide):
        raise UsageError(
            f"--compare is {options.compare}, a folder of pictures; the viewer compares scenes, "
            f"`{program()} compare` also pictures."
        )
    drawing = viewer.renderer.backends["drawing"].split()[0]
    with Renderer(viewer.window.ctx, drawing) as renderer:
        wipe = Wipe(viewer, renderer, side)
        viewer.say("Drag the line, or press , and . for it; C takes it away")
        try:
            yield wipe
        finally:
            wipe.release()


class Wipe:
    """The line, B's picture, and how alike the two are at rest."""

    def __init__(self, viewer: "Viewer", renderer: Renderer, side: SceneSide) -> None:
        self._viewer, self._renderer, self._side = viewer, renderer, side
        self._shown = Shown(renderer, Readings(drawing=renderer.backends["drawing"]))
        self._resolve = Resolve(Gpu(viewer.window.ctx))
        self._target: moderngl.Framebuffer | None = None  # B's picture, as large as the window
        self._scene = side.subject.scene
        self._scene_file = viewer.stage.document.path  # that A is; None: models
        self._comparison = Comparison()
        self._waiting = False  # the picture has not rested long enough to be measured
        self._holding = False  # the mouse has the line
        self.on = True
        left, _, right, _ = viewer._free_wanted()
        self.part = float((left + right) / 2 / viewer.window.size[0])  # of the window's width
        hooks = viewer.hooks
        hooks.over.append(self.draw)
        hooks.marks.append(self.draw_marks)
        hooks.takes.append(self.take)
        hooks.status.append(self.status)
        hooks.keys += KEYS
        hooks.each_frame.append(lambda: self.on and self._waiting)

    @property
    def cut(self) -> int:
        """The first column of B, framebuffer pixels from the left."""
        return round(self.part * self._viewer.window.size[0])

    def draw(self, wish: Wish) -> None:
        """Lays B over the right part of the window, in which A's picture is."""
        if not self.on or not wish.scene.objects:
            return
        window = self._viewer.window
        (view,) = moved([wish.view], self._offset(wish.scene))
        same = Wish(self._scene_at(wish.scene), view, wish.settings, wish.moving)
        target = self._framebuffer(window.size)
        self._shown.draw(same, target, False)
        (texture,) = target.color_attachments
        screen, (width, height) = window.screen(), window.size
        screen.scissor = (self.cut, 0, width - self.cut, height)
        try:
            self._resolve.draw(texture, screen, (0.0, 0.0, 0.0))  # covers: its alpha is 1
        finally:
            screen.scissor = None
        self._measure(wish, same)

    def _offset(self, scene: Scene) -> np.ndarray:
        """(3,) metres from A's own coordinates to B's: both say where their zero lies."""
        model = None if self._scene_file else scene.objects[0].model
        of_a = np.array(getattr(model, "origin", (0.0, 0.0, 0.0)))
        return of_a - self._side.subject.origin

    def _scene_at(self, scene: Scene) -> Scene:
        """B at its own x where that was given, else at A's; the same object until x changes."""
        x = scene.objects[0].x
        if not self._side.stated and x != self._scene.objects[0].x:
            self._scene = self._side.subject.at(x)
        return self._scene

    def _framebuffer(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        if self._target is None or self._target.size != size:
            self._release_target()
            ctx = self._viewer.window.ctx
            self._target = ctx.framebuffer([ctx.texture(size, 4)])
            self._viewer.window.screen().use()
        return self._target

    def _measure(self, wish: Wish, same: Wish) -> None:
        """PSNR of the two whole pictures, once each time that they have come to rest."""
        key = (wish.scene, id(same.scene), *picture_key(wish.scene, wish.view, wish.settings)[1:])
        if self._comparison.due(key, time.perf_counter(), wish.moving):
            pictures = (self._viewer.renderer.resolved(0), self._renderer.resolved(0))
            self._comparison.measured(key, min(psnr(*pictures), MOST_DB))
        self._waiting = self._comparison.is_old(key)

    def status(self) -> str:
        if not self.on or self._waiting or self._comparison.db is None:
            return ""
        db = self._comparison.db
        return "A = B" if db == MOST_DB else f"A to B {db:.1f} dB"

    def take(self, event: Event) -> bool:
        """True for what concerns the line: dragging it, the keys , . and C."""
        window = self._viewer.window
        match event:
            case KeyDown(key=glfw.KEY_C):
                self.on = not self.on
            case KeyDown(key=glfw.KEY_COMMA | glfw.KEY_PERIOD as key) if self.on:
                self._move_to(self.part + (STEP if key == glfw.KEY_PERIOD else -STEP))
            case Press(button="left", x=x) | DoubleClick(x=x) if self.on and self._is_near(x):
                self._holding = isinstance(event, Press)
            case Drag(button="left", x=x) if self._holding:
                self._move_to(x / window.logical_size[0])
            case Release(button="left") if self._holding:
                self._holding = False
            case _:
                return False
        return True

    def _is_near(self, x: float) -> bool:
        window = self._viewer.window
        return abs(x - self.part * window.logical_size[0]) <= GRAB * window.ui_scale

    def _move_to(self, part: float) -> None:
        self.part = float(np.clip(part, 0.0, 1.0))

    def draw_marks(self, ui_scale: float) -> None:
        """The line and the two names beside it."""
        if not self.on:
            return
        window, draw = self._viewer.window, imgui.get_background_draw_list()
        width, height = window.logical_size
        x, margin = self.part * width, MARGIN * ui_scale
        draw.add_line(Vec(x, 0), Vec(x, height), theme.color(theme.TEXT, 0.9), 1.5 * ui_scale)
        draw.add_circle_filled(Vec(x, height / 2), 5 * ui_scale, theme.color(theme.TEXT, 0.9))
        scene = self._viewer.stage.scene
        of_a = scene.objects[0].name if scene.objects else ""
        of_a = self._scene_file.name if self._scene_file else of_a
        names = (f"A  {of_a}".rstrip(), f"B  {self._side.name}")
        for name, side in zip(names, (-1, 1), strict=True):
            size = imgui.calc_text_size(name)
            left = x + margin if side > 0 else x - margin - size.x
            self._name(draw, name, Vec(left, TOP * ui_scale), size, ui_scale)

    def _name(self, draw, name: str, at: Vec, size: Vec, ui_scale: float) -> None:
        pad = 5 * ui_scale
        low, high = Vec(at.x - pad, at.y - pad), Vec(at.x + size.x + pad, at.y + size.y + pad)
        draw.add_rect_filled(low, high, theme.color(theme.SURFACE, 0.8), pad)
        draw.add_text(at, theme.color(theme.TEXT), name)

    def _release_target(self) -> None:
        if self._target is not None:
            for texture in self._target.color_attachments:
                texture.release()
            self._target.release()
            self._target = None

    def release(self) -> None:
        self._release_target()
        self._resolve.release()
