"""view --section: what is opened is cut, in addition to what a scene file cuts itself."""

from dataclasses import replace

import pytest

from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import read_files
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.document.edits import MOST_SECTIONS
from shapeshift.scene.sections.section_texts import read_section
from tests.support.touch_scene import TOUCH


def opened(path):
    return read_files([path], lambda path, told: read_model(path), CameraReading(), None)


PLANE = read_section("plane:1,0,0,0.1")
BOX = read_section("box:0,0,0:1,1,1:hard")


def test_a_scene_without_a_file_is_cut_and_has_nothing_to_save():
    scene, edited = opened_scene(opened(DEMO), "", (PLANE, BOX))
    assert scene.objects[0].sections == (PLANE, BOX) == edited.file.sections
    assert not edited.unsaved and len(edited.history.steps) == 1


def test_a_scene_file_keeps_its_own_and_is_not_saved():
    found = opened(TOUCH)
    found = replace(found, file=replace(found.file, sections=(BOX,)))
    scene, edited = opened_scene(found, "", (PLANE,))
    assert edited.file.sections == (BOX, PLANE) and edited.unsaved
    assert all(obj.sections[-2:] == (BOX, PLANE) for obj in scene.objects)


def test_more_than_a_scene_file_has_are_refused():
    with pytest.raises(UsageError, match="--section: "):
        opened_scene(opened(DEMO), "", (PLANE,) * (MOST_SECTIONS + 1))
