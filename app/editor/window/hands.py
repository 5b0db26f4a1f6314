"""What hands do: keys, mouse and dropped files, one event at a time."""

from collections.abc import Callable
from pathlib import Path

import glfw
import numpy as np

from shapeshift.app.editor.state.arrange import all_go_to_stop, step_stop, step_x
from shapeshift.app.editor.state.camera.camera import FAST, SLOW, Push
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.answers import Answers
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.window import (
    DoubleClick,
    Drag,
    Drop,
    Event,
    KeyDown,
    Press,
    Release,
    Wheel,
    Window,
)
from shapeshift.scene.pick import Hit

VIEWS = {  # of the numeric keypad, as Blender has them; the second with Ctrl
    glfw.KEY_KP_1: ("front", "back"),
    glfw.KEY_KP_3: ("right", "left"),
    glfw.KEY_KP_7: ("top", "bottom"),
}
FLIES = "Flying: W A S D Q E move, a drag looks about. V orbits."
ORBITS = "Orbiting: a drag turns about the scene. V flies."
TURN = 0.006  # radians a logical pixel of mouse movement
LOOK = 0.003


class InputActions:
    """Lets input act; `open_soon` takes the files that are dropped."""

    def __init__(
        self, window: Window, state: EditorState, viewpoint: Viewpoint, hooks: Hooks,
        open_soon: Callable[[tuple[Path, ...]], None],
    ) -> None:  # fmt: skip
        self._window, self._state, self._viewpoint = window, state, viewpoint
        self._hooks, self._open_soon = hooks, open_soon
        self._pivot: np.ndarray | None = None  # (3,) metres, that a drag turns about
        self.pushes: list[Callable[[], Push]] = []  # what sticks and caps ask for
        self._answers = Answers(window, state, viewpoint, hooks)

    def handle_event(self, event: Event) -> None:
        """Lets one input event act; a key that changes nothing is answered."""
        if isinstance(event, KeyDown):
            self._answers.key(event, self._act)
        else:
            self._act(event)

    def _act(self, event: Event) -> None:
        if any(handle(event) for handle in self._hooks.event_handlers):
            return
        viewpoint = self._viewpoint
        if isinstance(event, Wheel | DoubleClick):
            viewpoint.leave_camera()
        camera = viewpoint.camera
        height = self._window.logical_size[1]
        match event:
            case KeyDown():
                self.press_key(event)
            case Press() | Drag() | Release() if self.works_on_regions(event):
                pass
            case Drag() if viewpoint.steps.at_camera or viewpoint.flown is not None:
                viewpoint.leave_camera()
                self._act(event)
            case Drag(button="middle") | Drag(button="right") if self.pans(event):
                camera.pan(-event.dx / height, event.dy / height)
            case Press(button="left"):
                self._pivot = self._pressed_point(event)
            case Drag():
                rate = LOOK if camera.flying else TURN
                yaw, pitch = -event.dx * rate, -event.dy * rate
                if self._pivot is None or event.button != "left":
                    camera.turn(yaw, pitch)
                else:
                    camera.turn_about(self._pivot, yaw, pitch)
            case Wheel():
                camera.dolly(event.notches)
            case DoubleClick():
                hit = self.point_at(event.x, event.y)
                if hit is not None:
                    camera.focus(hit.point)
            case Drop():
                self._open_soon(event.paths)

    def _pressed_point(self, event: Press) -> np.ndarray | None:
        """(3,) metres: what lies where the mouse was pressed, if drags are to turn about that."""
        camera = self._viewpoint.camera
        if not camera.about_pointer or camera.flying:
            return None
        hit = self.point_at(event.x, event.y)
        return None if hit is None else hit.point

    def press_key(self, event: KeyDown) -> None:
        """Keys that act once; the held ones are asked for in `push`."""
        state, viewpoint = self._state, self._viewpoint
        match event.key:
            case glfw.KEY_N | glfw.KEY_P:
                viewpoint.step_to_camera(1 if event.key == glfw.KEY_N else -1)
            case glfw.KEY_K:
                viewpoint.keep_view()
            case glfw.KEY_V:
                viewpoint.toggle_flying()
                state.say(said(FLIES if viewpoint.camera.flying else ORBITS))
            case glfw.KEY_F if event.shift:
                viewpoint.go_home()
            case glfw.KEY_F:
                viewpoint.frame_all()
            case key if key in VIEWS:
                viewpoint.look_from(VIEWS[key][event.ctrl])
            case glfw.KEY_KP_5:
                viewpoint.toggle_orthographic()
            case glfw.KEY_SPACE:
                state.toggle_play()
            case glfw.KEY_LEFT | glfw.KEY_RIGHT:
                direction = 1 if event.key == glfw.KEY_RIGHT else -1
                (step_stop if event.shift else step_x)(state, direction)
            case glfw.KEY_H | glfw.KEY_TAB:
                state.overlay = not state.overlay
            case glfw.KEY_F12:
                state.save_picture = True
            case glfw.KEY_G:
                state.next_debug_view(-1 if event.shift else 1)
            case glfw.KEY_L if state.scene.objects:
                state.say(said("Lens on" if state.toggle_lens() else "Lens off"))
            case glfw.KEY_ESCAPE:
                state.regions.placing = False
                state.regions.choose(-1)
            case key if glfw.KEY_1 <= key <= glfw.KEY_9:
                all_go_to_stop(state, key - glfw.KEY_1)

    @property
    def push(self) -> Push:
        """The movement keys that are held now, else a stick, else a cap."""
        held = self._window.held
        slow = held(glfw.KEY_LEFT_CONTROL) or held(glfw.KEY_RIGHT_CONTROL)
        keys = Push(
            right=held(glfw.KEY_D) - held(glfw.KEY_A),
            up=held(glfw.KEY_E) - held(glfw.KEY_Q),
            forward=held(glfw.KEY_W) - held(glfw.KEY_S),
            pace=FAST if self.shift else SLOW if slow else 1.0,
        )
        asked = [keys, *(push() for push in self.pushes)]
        return next((push for push in asked if push.any), keys)

    @property
    def shift(self) -> bool:
        held = self._window.held
        return bool(held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT))

    def pans(self, drag: Drag) -> bool:
        return drag.button == "middle" or not self._viewpoint.camera.flying

    def point_at(self, x: float, y: float) -> Hit | None:
        """What lies under a place of the picture, logical pixels from the top left."""
        width, height = self._window.logical_size
        view = self._viewpoint.view()
        left, right, low, high = view.tangents
        across, up = left + (right - left) * x / width, high + (low - high) * y / height
        direction = view.world_from_eye.matrix()[:3, :3] @ np.array([across, up, -1.0])
        return self._state.pick(view, direction, 2 * (right - left) / width)

    @property
    def is_painting(self) -> bool:
        """Whether the mouse is a brush now: B is held."""
        return bool(self._window.held(glfw.KEY_B)) and bool(self._state.scene.objects)

    @property
    def is_erasing(self) -> bool:
        return self.shift

    def works_on_regions(self, event: Press | Drag | Release) -> bool:
        """Places or paints with the left button, where that is on; True: it was for that."""
        state, regions = self._state, self._state.regions
        if event.button != "left":
            return False
        if isinstance(event, Release):
            return True
        if self.is_painting:
            window = self._window
            density = window.size[0] / max(window.logical_size[0], 1)  # the view's pixels are finer
            cursor = (event.x * density, event.y * density)
            radius = regions.brush * window.ui_scale * density
            state.paint(self._viewpoint.view(), cursor, radius, self.is_erasing)
            return True
        if isinstance(event, Press):
            regions.holding = regions.placing and regions.current is not None
        if not regions.holding:
            return False
        hit = self.point_at(event.x, event.y)
        if hit is not None:
            regions.place(hit.point, hit.index, state.scene.objects)
            regions.placing = False
        return True
