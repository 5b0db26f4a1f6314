"""The four views: which parts of a scene each draws, and that an object cut out still changes."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.drawing import open_renderer
from shapeshift.app.paths import DEMO
from shapeshift.renderer.show_modes import SHOW_MODES, read_show_mode, show_objects
from shapeshift.runtime_models.model import ObjectLabel
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.training.synthetic.labels import LABELS, OBJECTS, label_map, labels_of_places
from tests.support.models import make_random_model

WHOLE = make_random_model(anchors=60)
WHOLE = replace(
    WHOLE,
    labels=np.resize(np.uint8([0, 1, 3]), 60),
    objects=(ObjectLabel(1, "mug"), ObjectLabel(3, "cup")),
)
HALF = np.sqrt(0.5)
POSE = Pose(np.array([1.0, 2, 3]), np.array([HALF, 0, HALF, 0]))
ONE = Scene((SceneObject("room", WHOLE, POSE, x=0.3),))
FILE = Scene(
    (
        SceneObject("background", WHOLE, label=0),
        SceneObject("mug", WHOLE, label=1),
        SceneObject("2", WHOLE, label=2, visible=False),
        SceneObject("cup", WHOLE, label=3),
    )
)


def names(scene: Scene) -> list[str]:
    return [obj.name for obj in scene.objects]


def test_modes_are_read():
    assert [read_show_mode(mode) for mode in SHOW_MODES] == [(mode, "") for mode in SHOW_MODES]
    assert read_show_mode("isolated:a:b") == ("isolated", "a:b")
    for text in ("", "all", "Full", "isolated:", "background:mug", "full:"):
        with pytest.raises(ValueError, match="is no view of objects; expected full, overlay"):
            read_show_mode(text)


def test_one_labelled_model_is_shown_by_its_labels():
    assert show_objects(ONE, "full") is ONE
    assert names(show_objects(ONE, "background")) == ["label 0"]
    assert names(show_objects(ONE, "isolated")) == ["mug", "cup"]
    for name in ("cup", "3"):
        assert names(show_objects(ONE, f"isolated:{name}")) == ["cup"]
    parts = [*show_objects(ONE, "background").objects, *show_objects(ONE, "isolated").objects]
    assert all(part.x == 0.3 for part in parts)
    # Each anchor is in one part, in the world where it was.
    found = np.concatenate([
        p.model.anchors @ p.world_from_object.matrix()[:3, :3].T + p.world_from_object.position
        for p in parts
    ])  # fmt: skip
    wanted = WHOLE.anchors @ POSE.matrix()[:3, :3].T + POSE.position
    order = np.argsort(WHOLE.labels, kind="stable")
    assert np.abs(found - wanted[order]).max() < 1e-5
    (tinted,) = show_objects(ONE, "overlay").objects
    assert tinted.model is WHOLE
    assert np.array_equal(tinted.tint.strength > 0, WHOLE.labels > 0)
    assert len(np.unique(tinted.tint.color[WHOLE.labels > 0], axis=0)) == 2


def test_of_a_scene_file_each_object_is_one():
    assert names(show_objects(FILE, "background")) == ["background"]
    assert names(show_objects(FILE, "isolated")) == ["mug", "2", "cup"]
    (hidden,) = show_objects(FILE, "isolated:2").objects  # a name before a label, also a hidden one
    assert hidden.name == "2" and hidden.visible
    assert names(show_objects(FILE, "isolated:3")) == ["cup"]
    tints = [obj.tint for obj in show_objects(FILE, "overlay").objects]
    assert tints[0] is None and len({tint.color for tint in tints[1:]}) == 3


def test_scenes_without_objects_and_unknown_names_are_told():
    plain = Scene((SceneObject("room", make_random_model()),))
    for mode in SHOW_MODES[1:]:
        with pytest.raises(ValueError, match="has no labels of objects and is no scene file"):
            show_objects(plain, mode)
    for scene in (ONE, FILE):
        with pytest.raises(ValueError, match=r"bowl.*it has .*mug"):
            show_objects(scene, "isolated:bowl")


def test_the_isolated_motor_still_opens():
    model = read_model(DEMO)
    labels = labels_of_places(model.anchors.astype(np.float64))[0]
    objects = tuple(ObjectLabel(i, name) for i, name in enumerate(OBJECTS, 1))
    model, size = replace(model, labels=labels, objects=objects), (192, 108)
    view, pictures = default_view(model, size), {}
    with open_renderer("none", "tiles") as (renderer, _):
        for x in (0.0, 1.0):
            for mode in ("full", "isolated:motor"):
                scene = Scene((SceneObject("room", model, x=x),))
                renderer.update(show_objects(scene, mode))
                renderer.draw([view])
                pictures[mode, x] = np.array(renderer.resolved(0))[..., :3]
    for x in (0.0, 1.0):
        its = label_map(view, x) == LABELS["motor"]
        # Its middle, away from edges where what is behind shines through.
        inner = its.copy()
        for axis in (0, 1):
            for step in (-2, -1, 1, 2):
                inner &= np.roll(its, step, axis)
        assert inner.sum() > 500
        same = np.abs(pictures["isolated:motor", x] - pictures["full", x]).max(axis=2)
        assert np.median(same[inner]) < 0.02
        assert pictures["isolated:motor", x][~its].mean() < 0.1 * pictures["full", x][its].mean()
    closed, opened = (pictures["isolated:motor", x] for x in (0.0, 1.0))
    changed = np.abs(closed - opened).max(axis=2) > 0.15
    assert changed.sum() > 200  # the housing is off: windings and rotor
