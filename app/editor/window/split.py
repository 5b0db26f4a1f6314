"""Two stops at once: the scene at another x right of a line, by a second knob on the same track."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import glfw

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.layout import Box
from shapeshift.app.editor.state.split_state import SplitState, name_of
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.shown import FrameRequest
from shapeshift.app.editor.window.two_pictures import TwoPictures
from shapeshift.app.editor.window.window import Event, KeyDown, Window
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile

KEYS = (
    ("C", "another stop right of a line, on and off"),
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

    def draw(self, request: FrameRequest) -> None:
        """Lays the other x over the right part of the window.  Raises BadFile for no room."""
        scene, x, other = self._made
        if scene is not request.scene or x != self._state.x:
            other = self._state.right(request.scene)
            self._made = (request.scene, self._state.x, other)
        self.draw_right(replace(request, scene=other))


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

    def draw(request: FrameRequest) -> None:
        split_state.on = split_state.on and any(
            obj.name == split_state.name for obj in request.scene.objects
        )
        if not split_state.on:
            return
        try:
            split().draw(request)
        except BadFile as error:
            split_state.on = False
            state.messages.fail(f"There is no room for a second picture: {error}")

    def draw_marks(ui_scale: float) -> None:
        if split_state.on and made:
            names = [f"{name}  {text}" for name, text in zip("AB", sides_of(state), strict=True)]
            split().draw_line(names, (theme.ACCENT, theme.SECOND), ui_scale)

    def handle_event(event: Event) -> bool:
        if isinstance(event, KeyDown) and event.key == glfw.KEY_C and not event.ctrl:
            index = next(iter(state.sliders), None)
            if index is not None:
                split_state.toggle(state.scene.objects[index])
            return True
        return split_state.on and bool(made) and split().handle_line_event(event)

    hooks.over.append(draw)
    hooks.marks.append(draw_marks)
    hooks.event_handlers.append(handle_event)
    hooks.keys["Two stops at once"] = list(KEYS)
    state.split.possible = True
    try:
        yield
    finally:
        split_state.on = split_state.possible = False
        hooks.over.remove(draw)
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
