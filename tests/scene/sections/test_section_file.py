"""Sections as values, as rows of a scene file and as text; what is none gets one sentence."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop import Stop
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, scene_of
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.cut import inside_of
from shapeshift.scene.sections.section import (
    BoxShape,
    PlaneShape,
    SceneSection,
    carried_section,
    flipped,
    held_by,
    moved_shape,
)
from shapeshift.scene.sections.section_texts import read_section
from tests.support.splat_scenes import random_layers

TURN = Pose(np.array([0.3, -0.2, 0.5]), np.array([0.5, -0.5, 0.5, 0.5]))
STOPS = (Stop("RGB", 0.0), Stop("Bone", 1.0))
SECTIONS = (
    SceneSection(shape=PlaneShape((0.6, 0.0, 0.8), 0.25)),
    SceneSection(shape=PlaneShape((0.0, 1.0, 0.0), -1.5), edge="soft", width_m=0.05, enabled=False),
    SceneSection(shape=BoxShape((1.0, 2.0, 3.0), (0.1, 0.2, 0.3)), edge="hard", beyond=0.5),
    SceneSection(
        shape=BoxShape((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.5, 0.5, 0.5, 0.5)),
        beyond=StopWeights((("layer 0", 0.25), ("layer 1", 0.75))), edge="hard", space="object",
    ),
)  # fmt: skip


def written(tmp_path, **more) -> dict:
    path = tmp_path / "a.scene.json"
    path.write_text(json.dumps({"format": "shapeshift-scene 1", **more}))
    return path


def test_what_is_written_is_read_again(tmp_path):
    item = SceneItem(name="a", model="a.ply", sections=SECTIONS)
    file = SceneFile(folder=tmp_path, items=(item,), sections=SECTIONS[:3])
    write_scene_file(file, tmp_path / "b.scene.json")
    read = read_scene_file(tmp_path / "b.scene.json")
    assert read.sections == SECTIONS[:3] and read.items[0].sections == SECTIONS
    write_scene_file(read, tmp_path / "c.scene.json")
    texts = [(tmp_path / name).read_bytes() for name in ("b.scene.json", "c.scene.json")]
    assert texts[0] == texts[1]


def test_what_is_left_out_is_usual_and_an_object_has_its_own_frame(tmp_path):
    plane = {"plane": [0, 2, 0, 1]}
    row = {"name": "a", "model": "a.ply", "sections": [plane]}
    read = read_scene_file(written(tmp_path, sections=[plane], objects=[row]))
    (of_scene,), (own,) = read.sections, read.items[0].sections
    assert of_scene == SceneSection(shape=PlaneShape((0, 1, 0), 0.5), edge="capped", space="world")
    assert own.space == "object" and own.shape == of_scene.shape
    scene = scene_of(read, {"a": random_layers(3)})
    assert scene.objects[0].sections == (own, of_scene)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ({}, "section 1: wants either 'plane' or 'box'."),
        ({"plane": [1, 0, 0, 0], "box": {}}, "section 1: wants either 'plane' or 'box'."),
        ({"plane": [1, 0, 0]}, "'plane' is [1, 0, 0]"),
        ({"plane": [0, 0, 0, 1]}, "the normal is (0, 0, 0); a direction, not zero, is wanted."),
        ({"plane": [1, 0, 0, 1e9]}, "within 1e+06 is wanted."),
        ({"box": {"centre": [0, 0, 0], "half": [1, 0, 1]}}, "three metres above 0 are wanted."),
        ({"box": {"centre": [0, 0, 0], "half": [1, 1, 1], "wxyz": [1, 1, 0, 0]}}, "length 1"),
        ({"box": {"centre": [0, 0, 0]}}, "'half' is missing"),
        ({"plane": [1, 0, 0, 0], "edge": "sharp"}, "'capped' or 'hard' or 'soft'"),
        ({"plane": [1, 0, 0, 0], "edge": "soft"}, "a soft edge wants width_m above 0"),
        ({"plane": [1, 0, 0, 0], "width_m": 0.1}, "width_m is of a soft edge"),
        ({"plane": [1, 0, 0, 0], "beyond": 1.5}, "'beyond'"),
        ({"plane": [1, 0, 0, 0], "space": "object"}, "'space'"),
        ({"plane": [1, 0, 0, 0], "colour": 1}, "'colour' is no key here"),
    ],
)
def test_what_is_no_section_is_one_sentence_that_names_it(tmp_path, row, words):
    with pytest.raises(BadFile) as error:
        read_scene_file(written(tmp_path, sections=[row]))
    assert words in str(error.value) and "\n" not in str(error.value)


def test_seventeen_sections_are_too_many(tmp_path):
    rows = [{"plane": [1, 0, 0, 0]}] * 17
    read_scene_file(written(tmp_path, sections=rows[:16]))
    with pytest.raises(BadFile, match="17 rows; at most 16"):
        read_scene_file(written(tmp_path, sections=rows))


def test_sections_as_text():
    assert read_section("plane:0,0,2,1") == SceneSection(shape=PlaneShape((0, 0, 1), 0.5))
    soft = read_section("plane:1,0,0,-0.5:soft:0.1:beyond=bone", STOPS)
    assert (soft.edge, soft.width_m, soft.beyond) == ("soft", 0.1, 1.0)
    box = read_section("box:0,1,0:1,2,3:hard:beyond=RGB:0.5,Bone:0.5", STOPS)
    assert box.shape == BoxShape((0, 1, 0), (1, 2, 3)) and box.edge == "hard"
    assert box.beyond == StopWeights((("RGB", 0.5), ("Bone", 0.5)))
    for text in (
        "", "ball:1", "plane", "plane:1,0,0", "plane:a,b,c,d", "plane:1,0,0,0:round",
        "plane:nan,0,0,0",
        "plane:1,0,0,0:soft", "plane:1,0,0,0:hard:1", "box:0,0,0", "box:0,0,0:1,1,-1",
        "plane:1,0,0,0:beyond=Skin", "box:0,0,0:1,1,inf", "plane:1,0,0,0\n:x",
    ):  # fmt: skip
        with pytest.raises(ValueError) as error:
            read_section(text, STOPS)
        assert "\n" not in str(error.value) and len(str(error.value)) < 400


def test_frames_and_hands():
    """A place is inside of a moved section where it was inside before."""
    rng = np.random.default_rng(0)
    places = rng.normal(size=(500, 3))
    matrix = TURN.matrix()
    moved = places @ matrix[:3, :3].T + matrix[:3, 3]
    for section in SECTIONS[:3]:
        before = inside_of(section.half_spaces, places)
        carried = carried_section(section, TURN)
        np.testing.assert_allclose(inside_of(carried.half_spaces, moved), before, atol=1e-5)
        held = held_by(section, TURN)
        assert held == carried and held.space == "world"
        # Of an object that stands so, a section of the world in the object's frame.
        own = carried.half_spaces_of(TURN)
        np.testing.assert_allclose(inside_of(own, places), before, atol=1e-5)
    fixed = SECTIONS[3]
    assert carried_section(fixed, TURN) is fixed
    np.testing.assert_array_equal(fixed.half_spaces_of(TURN), fixed.half_spaces)
    plane = SECTIONS[0].shape
    both = [inside_of(SceneSection(shape=s).half_spaces, places) for s in (plane, flipped(plane))]
    np.testing.assert_allclose(both[0], -both[1], atol=1e-6)
    turned = moved_shape(SECTIONS[2].shape, TURN)
    signed = np.abs((moved - turned.centre) @ turned.axes) - turned.half
    np.testing.assert_allclose(
        inside_of(SceneSection(shape=turned).half_spaces, moved), -signed.max(axis=1), atol=1e-5
    )
