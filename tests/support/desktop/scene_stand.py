"""A viewer on files that were opened, and real hands that leave nothing held."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles, read_files
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.camera_list import CameraReading
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.real_hands import RealHands


def read(path: Path) -> OpenedFiles:
    return read_files([path], lambda path, told: read_model(path), CameraReading(), None)


def viewer_on(window, renderer, found: OpenedFiles, pictures: Path, x: str = "") -> Viewer:
    """Without bodies: a collider of a large scene takes ten seconds."""
    state = EditorState(read_model)
    scene, edited = opened_scene(found, x)
    state.open_sources(found.sources, scene, None, edited)
    state.bodies.follow = lambda edited: None
    viewer = Viewer(window, renderer, state, Options(pictures=pictures))
    run_frames(viewer, 4)
    return viewer


def viewer_on_wall(window, renderer, wall: Path, x: str = "") -> Viewer:
    """For tools of inspection: the sections above theirs are closed."""
    viewer = viewer_on(window, renderer, read(wall), wall.parent / "work" / "pictures", x)
    viewer.shell.actions.sections.update({"Stops": False, "Look": False, "Views": False})
    run_frames(viewer, 4)
    return viewer


@contextmanager
def hands_on(viewer, display: str, start: tuple[float, float] = (600, 20)) -> Iterator[RealHands]:
    """Begin at a place, and end on the picture with no button or key held."""
    with RealHands(viewer, display) as hands:
        hands.move(*start)
        yield hands
        hands.button(False)
        for name in ("Shift_L", "Alt_L", "Control_L", "b"):
            hands.hold_key(name, False)
        hands.move(600, 20)
