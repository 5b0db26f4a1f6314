"""Another scene compared with the open one: a line parts the two pictures, PSNR is shown."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import glfw
import numpy as np

from shapeshift.app.charts.comparison import MOST_DB, Comparison
from shapeshift.app.commands.compare_sides import SceneSide, open_side
from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shown import FrameRequest, picture_key
from shapeshift.app.editor.window.two_pictures import TwoPictures
from shapeshift.app.editor.window.window import Event, KeyDown, Window
from shapeshift.app.errors import UsageError
from shapeshift.app.program import program
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.cameras.camera_list import moved
from shapeshift.scene.metrics import psnr
from shapeshift.scene.scene import Scene

KEYS = (
    (", .", "move the line of the wipe"),
    ("C", "wipe on, off"),
)


@contextmanager
def comparing(
    window: Window, renderer: Renderer, state: EditorState, hooks: Hooks, options: Options,
    free: Callable[[], Box],
) -> Iterator["Wipe"]:  # fmt: skip
    """Adds a wipe over what `renderer` has drawn, in the middle of what is `free` of the window,
    logical pixels.  Raises BadFile, UsageError.
    """
    side = open_side(options.compare, options)
    if not isinstance(side, SceneSide):
        raise UsageError(
            f"--compare is {options.compare}, a folder of pictures; the viewer compares scenes, "
            f"`{program()} compare` also pictures."
        )
    drawing = renderer.backends["drawing"].split()[0]
    with Renderer(window.ctx, drawing) as other:
        wipe = Wipe(window, (renderer, other), state, side, free())
        wipe.attach(hooks)
        state.say(said("Drag the line, or press , and . for it; C takes it away"))
        try:
            yield wipe
        finally:
            wipe.release()


class Wipe(TwoPictures):
    """B is another scene, seen by A's camera; how alike the two are is measured at rest."""

    def __init__(
        self, window: Window, renderers: tuple[Renderer, Renderer], state: EditorState,
        side: SceneSide, free: Box,
    ) -> None:  # fmt: skip
        """`renderers` are A's, which the window has, and B's."""
        super().__init__(window, renderers[1], (free[0] + free[2]) / 2 / window.logical_size[0])
        self._of_a, self._state, self._side = renderers[0], state, side
        self._scene = side.subject.scene
        self._scene_file = state.edited.path  # that A is; None: models
        self._comparison = Comparison()
        self._waiting = False  # the picture has not rested long enough to be measured
        self.on = True

    def attach(self, hooks: Hooks) -> None:
        hooks.over.append(self.draw)
        hooks.marks.append(self.draw_marks)
        hooks.event_handlers.append(self.handle_event)
        hooks.status.append(self.status)
        hooks.keys["Comparing"] = list(KEYS)
        hooks.each_frame.append(lambda: self.on and self._waiting)

    def draw(self, request: FrameRequest) -> None:
        """Lays B over the right part of the window, in which A's picture is."""
        if not self.on or not request.scene.objects:
            return
        (view,) = moved([request.view], self._offset(request.scene).tolist())
        same = FrameRequest(self._scene_at(request.scene), view, request.settings, request.moving)
        self.draw_right(same)
        self._measure(request, same)

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

    def _measure(self, request: FrameRequest, same: FrameRequest) -> None:
        """PSNR of the two whole pictures, once each time that they have come to rest."""
        key = (
            request.scene,
            id(same.scene),
            *picture_key(request.scene, request.view, request.settings)[1:],
        )
        if self._comparison.due(key, time.perf_counter(), request.moving):
            pictures = (self._of_a.resolved(0), self._renderer.resolved(0))
            self._comparison.measured(key, min(psnr(*pictures), MOST_DB))
        self._waiting = self._comparison.is_old(key)

    def status(self) -> str:
        if not self.on or self._waiting or self._comparison.db is None:
            return ""
        db = self._comparison.db
        return "A = B" if db == MOST_DB else said("A to B {db:.1f} dB", db=db)

    def handle_event(self, event: Event) -> bool:
        """True for what concerns the line: dragging it, the keys , . and C."""
        if isinstance(event, KeyDown) and event.key == glfw.KEY_C:
            self.on = not self.on
            return True
        return self.on and self.handle_line_event(event)

    def draw_marks(self, ui_scale: float) -> None:
        """The line and the two names beside it."""
        if not self.on:
            return
        scene = self._state.scene
        of_a = scene.objects[0].name if scene.objects else ""
        of_a = self._scene_file.name if self._scene_file else of_a
        names = (f"A  {of_a}".rstrip(), f"B  {self._side.name}")
        self.draw_line(names, (theme.TEXT, theme.TEXT), ui_scale)
