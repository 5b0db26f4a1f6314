"""--show: its words and refusals, and that an object cut out still changes with the slider."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.decomposition.show_views import read_show, show_objects
from shapeshift.app.drawing import open_renderer
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.model import ObjectLabel
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.four_views import FOUR_VIEWS
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import make_random_model
from tools.synthetic.labels import LABELS, OBJECTS, label_map, labels_of_places

WHOLE = make_random_model(anchors=60)
WHOLE = replace(
    WHOLE,
    labels=np.resize(np.array([0, 1, 3], np.uint8), 60),
    objects=(ObjectLabel(1, "mug"), ObjectLabel(3, "cup")),
)
ONE = Scene((SceneObject("room", WHOLE, x=0.3),))
PLAIN = make_random_model(anchors=5)
FILE = Scene(
    (
        SceneObject("background", PLAIN, label=0),
        SceneObject("mug", PLAIN, label=1),
        SceneObject("1", PLAIN, label=2, visible=False),
        SceneObject("cup", PLAIN, label=3),
    )
)


def seen(scene: Scene) -> list[str]:
    return [obj.name for obj in scene.objects if obj.visible]


def test_words_are_read():
    assert [read_show(word) for word in FOUR_VIEWS] == [(word, "") for word in FOUR_VIEWS]
    assert read_show("isolated:a:b") == ("isolated", "a:b")
    for text in ("", "all", "Full", "isolated:", "background:mug", "full:"):
        with pytest.raises(UsageError, match="is no view; expected full, overlay"):
            read_show(text)


def test_one_labelled_model_by_name_or_label():
    assert show_objects(ONE, "full") is ONE
    for name in ("cup", "3"):
        (alone,) = show_objects(ONE, f"isolated:{name}").objects
        assert np.array_equal(alone.model.anchors, WHOLE.anchors[WHOLE.labels == 3])
        assert alone.x == 0.3


def test_one_object_of_a_scene_file_also_a_hidden_one():
    assert seen(show_objects(FILE, "background")) == ["background"]
    assert seen(show_objects(FILE, "isolated")) == ["mug", "cup"]
    assert seen(show_objects(FILE, "isolated:3")) == ["cup"]
    assert seen(show_objects(FILE, "isolated:1")) == ["1"]  # a name before a label


def test_scenes_without_objects_and_unknown_names_are_told():
    plain = Scene((SceneObject("room", PLAIN),))
    for show in FOUR_VIEWS[1:]:
        with pytest.raises(UsageError, match="has no objects beside a background"):
            show_objects(plain, show)
    for scene in (ONE, FILE):
        with pytest.raises(UsageError, match=r"bowl.*it has .*mug"):
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
