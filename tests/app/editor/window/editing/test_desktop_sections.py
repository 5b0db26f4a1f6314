"""Sections in the real window: made, dragged by their handles, undone, saved, by real X events."""

import json

import numpy as np
import pytest

from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.sections.section import BoxShape, PlaneShape
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.objects_stand import place_of


@pytest.fixture
def viewer(splats_viewer):
    return splats_viewer


def places(viewer) -> dict:
    """Logical pixels of the handles, by their keys."""
    return {handle.key: place_of(viewer, handle.place) for handle in viewer.sections.handles()}


def along_x(place: np.ndarray, metres: float) -> np.ndarray:
    return place + np.array([metres, 0.0, 0.0])


def test_the_key_makes_a_plane_whose_dot_is_dragged_undone_and_saved(viewer, hands, tmp_path):
    state, tool = viewer.state, viewer.sections
    hands.key("o", "Shift_L")
    (section,) = state.edited.file.sections
    assert tool.on and isinstance(section.shape, PlaneShape) and section.edge == "capped"
    assert state.scene.objects[0].sections == (section,) and section.space == "world"
    start, camera = places(viewer)[0], viewer.viewpoint.view().eye_from_world()
    # The plane is across x; along x in the picture its dot goes by as many metres as a point would.
    goal = place_of(viewer, along_x(tool.handles()[0].place, 0.1))
    hands.drag(start, goal)
    (moved,) = state.edited.file.sections
    pixel_m = 0.1 / np.hypot(*np.subtract(goal, start))
    assert moved.shape.offset_m - section.shape.offset_m == pytest.approx(0.1, abs=1.5 * pixel_m)
    assert moved.shape.normal == section.shape.normal
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), camera)
    assert viewer.objects.unsaved and state.scene.objects[0].sections == (moved,)
    hands.key("z", "Control_L")  # one step for the whole drag
    assert state.edited.file.sections == (section,)
    hands.key("y", "Control_L")
    assert state.edited.file.sections == (moved,)
    write_scene_file(state.edited.file, tmp_path / "cut.scene.json")
    assert read_scene_file(tmp_path / "cut.scene.json").sections == (moved,)
    row = json.loads((tmp_path / "cut.scene.json").read_text())["sections"]
    assert row == [{"plane": [*moved.shape.normal, moved.shape.offset_m]}]
    hands.key("Delete")
    assert state.edited.file.sections == () == state.scene.objects[0].sections and not tool.on


def test_the_arrow_turns_the_plane_and_a_drag_beside_it_turns_the_camera(viewer, hands):
    tool = viewer.sections
    hands.key("o", "Shift_L")
    pivot, before = tool.pivot, np.array(tool.shape.normal)
    x, y = places(viewer)["turn"]
    hands.drag((x, y), (x, y - 60))
    after = np.array(tool.shape.normal)
    assert after @ before < 0.99 and after[1] > 0.1
    np.testing.assert_allclose(tool.pivot, pivot, atol=2e-6)  # about its middle, as files round
    camera = viewer.viewpoint.view().eye_from_world()
    free = viewer.layout.free
    hands.drag((free[2] - 40, free[3] - 40), (free[2] - 90, free[3] - 60))
    run_frames(viewer, 30)
    assert np.abs(viewer.viewpoint.view().eye_from_world() - camera).max() > 1e-3
    hands.key("Escape")
    assert not tool.on and len(viewer.state.edited.file.sections) == 1


def test_a_face_of_a_box_moves_alone_and_of_an_object_it_goes_with_it(viewer, hands):
    state, tool = viewer.state, viewer.sections
    state.chosen = state.scene.objects[0].name
    tool.add(plane=False)
    run_frames(viewer, 3)
    box = tool.shape
    assert isinstance(box, BoxShape) and state.edited.file.sections == ()
    assert state.edited.file.items[0].sections[0].space == "object"
    start, handle = places(viewer)[0], tool.handles()[0]
    hands.drag(start, place_of(viewer, along_x(handle.place, 0.2)))
    grown = tool.shape
    low, high = (np.array(b.centre) - b.half for b in (box, grown))
    np.testing.assert_allclose(high, low, atol=2e-6)  # the side opposite stays
    assert grown.half[0] - box.half[0] == pytest.approx(0.1, abs=0.01)
    assert grown.half[1:] == box.half[1:]
    assert state.scene.objects[0].sections == state.edited.file.items[0].sections
    state.chosen = ""
