"""Full, overlay, background and isolated: which objects are seen, and in which colours."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile, ObjectLabel
from shapeshift.runtime_models.parts import part_of
from shapeshift.scene.four_views import FOUR_VIEWS, color_of, has_objects, shown_as
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Painted
from tests.support.models import make_random_model
from tests.support.splat_scenes import front_view

VIEW = front_view((96, 72), distance=3.0)
COUNT = 60
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def whole() -> SceneObject:
    """A package with two objects, opened as one."""
    labels = np.repeat(np.array([0, 1, 2], np.uint8), COUNT // 3)
    objects = (ObjectLabel(1, "mug"), ObjectLabel(2, "can"))
    return SceneObject(
        "room", replace(make_random_model(COUNT, k=3), labels=labels, objects=objects)
    )


def parted() -> Scene:
    """The same as a scene file has it."""
    model = whole().model
    names = ("background", "mug", "can")
    parts = [part_of(model, label) for label in range(3)]
    return Scene(
        tuple(
            SceneObject(name, part, Pose(np.array(place), UPRIGHT), label=label)
            for label, (name, (part, place)) in enumerate(zip(names, parts, strict=True))
        )
    )


def picture(scene: Scene) -> np.ndarray:
    with Renderer(None) as renderer:
        renderer.update(scene)
        renderer.draw([VIEW])
        return renderer.image().copy()


def seen(scene: Scene) -> list[str]:
    return [obj.name for obj in scene.objects if obj.visible]


def test_of_a_scene_of_objects():
    scene = parted()
    assert shown_as(scene, "full") is scene and has_objects(scene)
    assert seen(shown_as(scene, "background")) == ["background"]
    assert seen(shown_as(scene, "isolated")) == ["mug", "can"]
    assert seen(shown_as(scene, "isolated", "can")) == ["can"]
    overlay = shown_as(scene, "overlay")
    assert seen(overlay) == ["background", "mug", "can"]
    assert [obj.tint and obj.tint.color for obj in overlay.objects] == [
        None, color_of(1), color_of(2),
    ]  # fmt: skip
    for show in FOUR_VIEWS:  # nothing is decoded anew
        models = [obj.model for obj in shown_as(scene, show).objects]
        assert all(a is b.model for a, b in zip(models, scene.objects, strict=True))
    hidden = replace(scene.objects[1], visible=False)
    assert seen(shown_as(Scene((scene.objects[0], hidden)), "isolated")) == []


@pytest.mark.parametrize("show", FOUR_VIEWS)
def test_a_package_as_a_whole_looks_as_its_parts_do(show):
    one, parts = Scene((whole(),)), parted()
    a, b = picture(shown_as(one, show)), picture(shown_as(parts, show))
    assert a[..., 3].max() > 0.3
    np.testing.assert_allclose(a, b, atol=2e-3)  # poses in a file have six decimals
    if show == "isolated":
        for name in ("mug", "can"):
            one_alone = picture(shown_as(one, show, name))
            np.testing.assert_allclose(one_alone, picture(shown_as(parts, show, name)), atol=2e-3)
        with pytest.raises(BadFile, match="it has 0, 1 mug, 2 can"):
            shown_as(one, show, "spanner")


def test_background_and_isolated_are_the_full_one_taken_apart():
    """Opacities only: what neither shows is not there."""
    scene = parted()
    full, rest, things = (picture(shown_as(scene, s))[..., 3] for s in ("full", *FOUR_VIEWS[2:]))
    np.testing.assert_allclose(1 - full, (1 - rest) * (1 - things), atol=1e-3)


def test_a_scene_without_objects_is_the_same_in_all_but_isolated():
    scene = Scene((SceneObject("room", make_random_model(10, k=3)),))
    assert not has_objects(scene)
    for show in ("full", "overlay", "background"):
        assert shown_as(scene, show) is scene
    assert seen(shown_as(scene, "isolated")) == []
    assert shown_as(Scene(()), "isolated").objects == ()
    with pytest.raises(ValueError, match="no view 'solo'; choose full, overlay"):
        shown_as(scene, "solo")


def test_paint_goes_along_with_its_anchors():
    obj = whole()
    weight = np.arange(COUNT) / COUNT
    obj = replace(obj, selectors=(Painted(weight, 1.0),))
    (shown,) = shown_as(Scene((obj,)), "isolated", "can").objects
    np.testing.assert_array_equal(shown.selectors[0].weight, weight[40:].astype(np.float32))


def test_colours_of_labels_are_told_apart():
    colors = np.array([color_of(label) for label in range(1, 13)])
    apart = np.linalg.norm(colors[:, None] - colors[None], axis=2)
    assert apart[~np.eye(12, dtype=bool)].min() > 0.15 and colors.max(axis=1).min() > 0.7
