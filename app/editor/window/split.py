"""Two stops at once, by a second knob on the same track: right of a line, or heat over shape."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import glfw
import moderngl

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.state.split_state import SplitState, name_of
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shown import Beside, FrameRequest
from shapeshift.app.editor.window.two_pictures import TwoPictures
from shapeshift.app.editor.window.window import Event, KeyDown, Window
from shapeshift.renderer.gl.gpu import Gpu, release_framebuffer
from shapeshift.renderer.gl.heat_over_shape import HeatOverShape
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.scene import Scene

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

    def beside(self, scene: Scene, width: int, refuse: Callable[[BadFile], None]) -> Beside | None:
        """What is right of the line, where it parts the window at all."""
        if self._state.over or not 0 < self.cut < width:
            return None
        return Beside(self.other(scene), self.cut, self._renderer, refuse)

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

    def beside(scene: Scene, width: int) -> Beside | None:
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
