"""What the tests of objects in the window share: a viewer on the touch scene, scripted hands."""

import time
from pathlib import Path

import glfw
import numpy as np

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.panels.outlines import pixels
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles
from tests.support.desktop.desktop_stand import PlainRenderer, ball, run_frames
from tests.support.touch_scene import TOUCH as TOUCH

NAMES = ["background", "cube", "ball", "ring", "plate"]


def viewer_of(window, found: OpenedFiles, folder: Path) -> Viewer:
    state = EditorState(lambda path: ball())
    scene, edited = opened_scene(found)
    state.open_sources(found.sources, scene, None, edited)
    viewer = Viewer(window, PlainRenderer(window.ctx), state, Options(pictures=folder / "pictures"))
    viewer.files.read = lambda path, told: ball()
    viewer.set_title()
    run_frames(viewer, 4)
    end = time.monotonic() + 120  # a cold cache of colliders
    while viewer.state.bodies.busy and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)
    return viewer


def names(viewer) -> list[str]:
    return [obj.name for obj in viewer.state.scene.objects]


def obj(viewer, name: str):
    return viewer.state.scene.objects[names(viewer).index(name)]


def place_of(viewer, point) -> tuple[float, float]:
    """Logical pixels of a point (3,) of the world."""
    view = viewer.viewpoint.view()
    in_eye = (view.eye_from_world() @ np.append(point, 1.0))[:3]
    return tuple(pixels(view, in_eye, viewer.window.logical_size))


def mouse(viewer, x: float, y: float) -> None:
    viewer.window.on_cursor(None, x, y)
    run_frames(viewer, 2)


def button(viewer, down: bool) -> None:
    viewer.window.on_button(None, 0, glfw.PRESS if down else glfw.RELEASE, 0)
    run_frames(viewer, 2)


def release(viewer) -> None:
    button(viewer, False)
    mouse(viewer, 1.0, 1.0)


def click(viewer, point) -> None:
    mouse(viewer, *place_of(viewer, point))
    button(viewer, True)
    button(viewer, False)


def drag(viewer, start, end, steps: int = 8) -> None:
    mouse(viewer, *start)
    button(viewer, True)
    for part in np.linspace(0, 1, steps + 1)[1:]:
        mouse(viewer, *(np.array(start) + part * (np.array(end) - start)))
    button(viewer, False)


def key(viewer, key: int, mods: int = 0) -> None:
    for action in (glfw.PRESS, glfw.RELEASE):
        viewer.window.on_key(None, key, 0, action, mods)
        run_frames(viewer, 2)


CTRL, SHIFT = glfw.MOD_CONTROL, glfw.MOD_SHIFT


def viewer_is_over(viewer, place) -> bool:
    mouse(viewer, *place)
    return viewer.gizmo.under_mouse


def until_added(viewer) -> None:
    end = time.monotonic() + 20
    run_frames(viewer, 1)
    while viewer.polling and time.monotonic() < end:
        run_frames(viewer, 1)
        time.sleep(0.005)
    run_frames(viewer, 2)
