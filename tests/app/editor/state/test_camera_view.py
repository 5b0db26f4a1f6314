"""A camera's view is kept while it holds, and no longer."""

import numpy as np
import pytest

from shapeshift.app.editor.state.camera.camera import EditorCamera
from shapeshift.scene.cameras.framing import orbit_path

SIZE, FREE = (640, 480), (100.0, 0.0, 640.0, 400.0)
CENTRE = np.array([0.1, 0.4, -0.2])


def camera() -> EditorCamera:
    return EditorCamera(orbit_path(1, CENTRE, 2.0, SIZE)[0], CENTRE, 2.0)


def set_to(name: str, value: float | bool):
    return lambda cam: setattr(cam, name, value)


def anew(cam: EditorCamera) -> EditorCamera:
    """The same camera, which has never been asked."""
    other = camera()
    other.__dict__.update(cam.__dict__ | {"_eye_view": None, "_parallel_view": None})
    return other


CHANGES = {
    "turn": lambda cam: cam.turn(0.2, 0.1),
    "part of the way": lambda cam: (cam.turn(0.2, 0.1), cam.step(0.05)),
    "dolly": lambda cam: (cam.dolly(2), cam.step(5.0)),
    "fov_y": set_to("fov_y", 0.3),
    "near_m": set_to("near_m", 0.7),
    "radius": set_to("radius", 3.0),
    "orthographic": set_to("orthographic", True),
    "flight": lambda cam: (setattr(cam, "orthographic", True), cam.toggle_flying()),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("parallel", [False, True])
def test_it_is_as_if_it_were_made_anew_each_time(change, parallel):
    def changed() -> EditorCamera:
        cam = camera()
        cam.orthographic = parallel
        cam.view(SIZE, FREE)  # before the change, and kept
        CHANGES[change](cam)
        return cam

    asked = changed()
    for size, free in ((SIZE, FREE), (SIZE, None), ((320, 480), FREE), (SIZE, FREE)):
        got, want = asked.view(size, free), anew(asked).view(size, free)
        assert (got.tangents, got.near, got.far, got.size) == (
            want.tangents, want.near, want.far, want.size,
        )  # fmt: skip
        np.testing.assert_array_equal(got.world_from_eye.matrix(), want.world_from_eye.matrix())


@pytest.mark.parametrize("parallel", [False, True])
def test_it_is_the_same_view_until_something_changes(parallel):
    cam = camera()
    cam.orthographic = parallel
    view = cam.view(SIZE, FREE)
    cam.step(0.1)  # nothing lags behind
    assert cam.view(SIZE, FREE) is view
    cam.turn(0.2, 0.0)
    cam.step(0.01)
    assert cam.view(SIZE, FREE) is not view
