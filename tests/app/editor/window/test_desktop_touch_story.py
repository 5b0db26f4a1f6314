"""The bundled scene touched by a mouse as a person would: carry, shoot, throw, put back."""

from importlib.util import find_spec
from itertools import pairwise

import glfw
import numpy as np
import pytest

from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.objects_stand import SHIFT, button, key, mouse, obj, place_of

absent = [name for name in ("rapier3d", "coacd") if find_spec(name) is None]
pytestmark = pytest.mark.skipif(bool(absent), reason=f"not installed: {', '.join(absent)}")


@pytest.fixture
def viewer(playing_viewer):
    return playing_viewer


def place(viewer, name: str) -> np.ndarray:
    return obj(viewer, name).world_from_object.position


def glide(viewer, points: list, steps: int = 12) -> None:
    """The mouse goes evenly through places of the picture."""
    for start, end in pairwise(points):
        for part in np.linspace(0, 1, steps + 1)[1:]:
            mouse(viewer, *(np.array(start) + part * (np.array(end) - start)))


def test_a_person_plays_with_the_bundled_scene(viewer):
    world = viewer.state.world
    start = {name: place(viewer, name).copy() for name in ("cube", "ball", "ring")}
    assert not world.paused and "Drag an object" in viewer.state.messages.note
    run_frames(viewer, 10)

    rim = place(viewer, "ring") + np.array([0.06, 0.015, 0.0])
    up, over = (place_of(viewer, rim + np.array([x, 0.1, 0.0])) for x in (0.0, 0.23))
    mouse(viewer, *place_of(viewer, rim))
    button(viewer, True)
    assert world.held("mouse") == "ring" and viewer.state.chosen == "ring"
    glide(viewer, [place_of(viewer, rim), up])
    assert place(viewer, "ring")[1] > start["ring"][1] + 0.05
    run_frames(viewer, 25)
    assert obj(viewer, "ring").x == 1.0  # hot: it was taken
    glide(viewer, [up, over])
    run_frames(viewer, 10)  # a hand that rests throws nothing
    button(viewer, False)
    run_frames(viewer, 60)
    assert obj(viewer, "ring").x == 0.0  # cold: it came to the plate
    assert 0.19 < place(viewer, "ring")[0] < 0.37 and world.held("mouse") is None

    mouse(viewer, *place_of(viewer, place(viewer, "ball")))
    key(viewer, glfw.KEY_X)
    run_frames(viewer, 25)
    assert obj(viewer, "ball").x == 1.0  # confetti
    assert viewer.touch.reactions[0] == "ball: hit by a ray, now confetti"

    at = place_of(viewer, place(viewer, "cube"))
    high = (at[0] + 10, at[1] - 150)
    mouse(viewer, *at)
    button(viewer, True)
    glide(viewer, [at, high])
    lifted = place(viewer, "cube")[1]
    assert lifted > start["cube"][1] + 0.1
    button(viewer, False)
    run_frames(viewer, 60)
    assert place(viewer, "cube")[1] < lifted - 0.1
    assert obj(viewer, "cube").x > 0.0  # it struck the table: ice

    key(viewer, glfw.KEY_R)
    for name, at in start.items():
        np.testing.assert_allclose(place(viewer, name), at, atol=0.01)
    assert [obj(viewer, name).x for name in ("cube", "ball", "ring")] == [0.0, 0.0, 0.5]
    assert not viewer.state.edited.unsaved  # play is no edit


def test_steps_by_hand_and_turning_with_shift(viewer):
    world = viewer.state.world
    key(viewer, glfw.KEY_T, SHIFT)
    steps = world.steps
    key(viewer, glfw.KEY_T, SHIFT)
    assert world.paused and world.steps == steps + 1
    key(viewer, glfw.KEY_T)
    at = place_of(viewer, place(viewer, "cube"))
    mouse(viewer, *at)
    button(viewer, True)
    glide(viewer, [at, (at[0], at[1] - 120)], steps=6)
    for _ in range(3):
        viewer.window.on_scroll(None, 0, 1)
        run_frames(viewer, 3)
    away = np.linalg.norm(place(viewer, "cube") - viewer.viewpoint.camera.position)
    assert away > np.linalg.norm(np.array([-0.22, 0.05, 0.05]) - viewer.viewpoint.camera.position)
    viewer.window.on_key(None, glfw.KEY_ESCAPE, 0, glfw.PRESS, 0)
    run_frames(viewer, 2)
    assert world.held("mouse") is None
