"""What hands do to the viewer: keys, mouse and dropped files, one event at a time."""

from typing import TYPE_CHECKING

import glfw
import numpy as np

from shapeshift.app.editor.panels.sections.camera_panel import (
    keep_view,
    move_camera,
    step_to_camera,
)
from shapeshift.app.editor.state.arrange import step_stop, step_x
from shapeshift.app.editor.state.camera.camera import FAST, SLOW, Push
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

if TYPE_CHECKING:
    from shapeshift.app.editor.window.viewer import Viewer

VIEWS = {  # of the numeric keypad, as Blender has them; the second with Ctrl
    glfw.KEY_KP_1: ("front", "back"),
    glfw.KEY_KP_3: ("right", "left"),
    glfw.KEY_KP_7: ("top", "bottom"),
}
TURN = 0.006  # radians a logical pixel of mouse movement
LOOK = 0.003


def take(viewer: "Viewer", event: Event) -> None:
    """Lets one input event act."""
    if any(takes(event) for takes in viewer.hooks.takes):
        return
    if isinstance(event, Wheel | DoubleClick):
        viewer.leave_camera()
    camera = viewer.camera
    height = viewer.window.logical_size[1]
    match event:
        case KeyDown():
            press_key(viewer, event)
        case Press() | Drag() | Release() if works_on_regions(viewer, event):
            pass
        case Drag() if viewer.steps.standing:
            viewer.leave_camera()
            take(viewer, event)
        case Drag(button="middle") | Drag(button="right") if pans(viewer, event):
            camera.pan(-event.dx / height, event.dy / height)
        case Drag():
            rate = LOOK if camera.flying else TURN
            camera.turn(-event.dx * rate, -event.dy * rate)
        case Wheel():
            camera.dolly(event.notches)
        case DoubleClick():
            hit = point_at(viewer, event.x, event.y)
            if hit is not None:
                camera.focus(hit.point)
        case Drop():
            viewer.open_soon(event.paths)


def press_key(viewer: "Viewer", event: KeyDown) -> None:
    """Keys that act once; the held ones are asked for in `push`."""
    state = viewer.state
    match event.key:
        case glfw.KEY_N | glfw.KEY_P:
            step_to_camera(viewer, 1 if event.key == glfw.KEY_N else -1)
        case glfw.KEY_K:
            keep_view(viewer)
        case glfw.KEY_V | glfw.KEY_F if viewer.steps.standing:
            viewer.leave_camera()
            press_key(viewer, event)
        case glfw.KEY_V:
            move_camera(viewer, "Fly")
        case glfw.KEY_F:
            move_camera(viewer, "First view" if event.shift else "Frame all")
        case key if key in VIEWS:
            viewer.leave_camera()
            viewer.camera.look_from(VIEWS[key][event.ctrl])
        case glfw.KEY_SPACE:
            state.toggle_play()
        case glfw.KEY_LEFT | glfw.KEY_RIGHT:
            direction = 1 if event.key == glfw.KEY_RIGHT else -1
            (step_stop if event.shift else step_x)(state, direction)
        case glfw.KEY_H | glfw.KEY_TAB:
            viewer.overlay = not viewer.overlay
        case glfw.KEY_F12:
            viewer.save_picture = True
        case glfw.KEY_G:
            state.next_debug_view(-1 if event.shift else 1)
        case glfw.KEY_L:
            viewer.say(f"Lens {'on' if state.toggle_lens() else 'off'}")
        case glfw.KEY_ESCAPE:
            state.regions.placing = False
            state.regions.choose(-1)
        case key if glfw.KEY_1 <= key <= glfw.KEY_9:
            state.go_to_stop(key - glfw.KEY_1)


def push(window: Window) -> Push:
    """The movement keys that are held now."""
    held = window.held
    fast = held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT)
    slow = held(glfw.KEY_LEFT_CONTROL) or held(glfw.KEY_RIGHT_CONTROL)
    return Push(
        right=held(glfw.KEY_D) - held(glfw.KEY_A),
        up=held(glfw.KEY_E) - held(glfw.KEY_Q),
        forward=held(glfw.KEY_W) - held(glfw.KEY_S),
        pace=FAST if fast else SLOW if slow else 1.0,
    )


def pans(viewer: "Viewer", drag: Drag) -> bool:
    return drag.button == "middle" or not viewer.camera.flying


def point_at(viewer: "Viewer", x: float, y: float) -> Hit | None:
    """What lies under a place of the picture, logical pixels from the top left."""
    width, height = viewer.window.logical_size
    view = viewer.view()
    left, right, low, high = view.tangents
    in_eye = np.array([left + (right - left) * x / width, high + (low - high) * y / height, -1.0])
    direction = view.world_from_eye.matrix()[:3, :3] @ in_eye
    return viewer.state.pick(view, direction, 2 * (right - left) / width)


def is_painting(viewer: "Viewer") -> bool:
    """Whether the mouse is a brush now: B is held."""
    return bool(viewer.window.held(glfw.KEY_B)) and bool(viewer.state.scene.objects)


def is_erasing(viewer: "Viewer") -> bool:
    held = viewer.window.held
    return bool(held(glfw.KEY_LEFT_SHIFT) or held(glfw.KEY_RIGHT_SHIFT))


def works_on_regions(viewer: "Viewer", event: Press | Drag | Release) -> bool:
    """Places or paints with the left button where that is on; True when the event was for it."""
    regions = viewer.state.regions
    if event.button != "left":
        return False
    if isinstance(event, Release):
        return True
    if is_painting(viewer):
        window = viewer.window
        density = window.size[0] / max(window.logical_size[0], 1)  # the view's pixels are finer
        cursor = (event.x * density, event.y * density)
        radius = regions.brush * window.ui_scale * density
        viewer.state.paint(viewer.view(), cursor, radius, is_erasing(viewer))
        return True
    if isinstance(event, Press):
        regions.holding = regions.placing and regions.current is not None
    if not regions.holding:
        return False
    hit = point_at(viewer, event.x, event.y)
    if hit is not None:
        regions.place(hit.point, hit.index, viewer.state.scene.objects)
        regions.placing = False
    return True
