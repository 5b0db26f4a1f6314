"""Parts of a labelled model against the whole: each splat is in one part, and stays what it is."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.lod.average_anchors import average_anchors
from shapeshift.runtime_models.model import (
    AnchorFrames,
    AnchorModel,
    BadFile,
    CoarserAnchors,
    ObjectLabel,
    SplatLayers,
    Stop,
)
from shapeshift.runtime_models.parts import find_label, frame_points, name_of, part_of, splat_labels
from tests.support.models import make_random_model

WHOLE = make_random_model(anchors=60)
WHOLE = replace(
    WHOLE,
    labels=np.resize(np.array([0, 1, 3, 3], np.uint8), 60),
    objects=(ObjectLabel(1, "mug"), ObjectLabel(3, "7"), ObjectLabel(9, "absent")),
)


def layers(count: int = 40) -> SplatLayers:
    rng = np.random.default_rng(3)
    f = np.float32
    return SplatLayers(
        rng.normal(size=(count, 3)).astype(f), np.full((count, 3), 0.1, f),
        np.tile(f([1, 0, 0, 0]), (count, 1)), rng.uniform(size=count).astype(f),
        rng.normal(size=(count, 4, 3)).astype(f), np.zeros(count, np.int32), (Stop("a", 0.0),),
        labels=np.resize(np.array([0, 300, 2], np.int32), count), origin=(5.0, 6.0, 7.0),
        extra={"heat": np.arange(count, dtype=f)},
    )  # fmt: skip


def levelled() -> AnchorModel:
    """WHOLE with two coarser levels."""
    coarser = []
    for cell, pixels in ((0.8, 60.0), (1.6, 20.0)):
        one = average_anchors(WHOLE, cell)
        columns = (one.anchors, one.features, one.frames, one.labels, one.light)
        coarser.append(CoarserAnchors(*columns, cell, pixels))
    return WHOLE.with_coarser(tuple(coarser))


def test_levels_of_a_part_are_its_rows_of_each_level_at_as_many_pixels_a_metre():
    whole, ones = levelled(), np.ones(60)
    for label in (0, 1, 3):
        part, place = part_of(whole, label)
        assert len(part.coarser) == 2
        assert len(part.levels[2].anchors) <= len(part.levels[1].anchors) < len(part.anchors)
        metres = [frame_points(m.anchors, ones[: len(m.anchors)])[1] for m in (part, whole)]
        for mine, theirs, one in zip(part.levels[1:], whole.levels[1:], part.coarser, strict=True):
            rows = splat_labels(theirs) == label
            found, expected = evaluate(mine, 0.3, EYE), evaluate(theirs, 0.3, EYE)
            assert np.abs(found.means + place - expected.means[rows]).max() < 1e-5
            assert np.allclose(found.opacity, expected.opacity[rows], atol=1e-5)
            assert set(mine.labels) == {label}
            wanted = next(two.from_pixels for two in whole.coarser if two.cell_m == one.cell_m)
            assert one.from_pixels / metres[0] == pytest.approx(
                wanted / metres[1],
                rel=1e-6,  # anchors are moved in float32
            )
    none, _ = part_of(WHOLE, 1)
    assert none.coarser == ()


def test_a_part_without_rows_at_a_level_has_the_levels_before_it():
    whole = levelled()
    first, second = whole.coarser
    gone = second.labels != 1
    few = replace(
        second, anchors=second.anchors[gone], features=second.features[gone],
        labels=second.labels[gone], frames=AnchorFrames(
            second.frames.scales[gone], second.frames.wxyz[gone]
        ),
    )  # fmt: skip
    whole = whole.with_coarser((first, few))
    assert len(part_of(whole, 1)[0].coarser) == 1 and len(part_of(whole, 3)[0].coarser) == 2


EYE = np.array([0.3, 2.0, 1.0], np.float32)


def color_from(model, x, eye):
    return Evaluator(model).color(x, np.float32(eye))


@pytest.mark.parametrize("x", [0.0, 0.3, 1.0])
def test_parts_put_back_are_the_whole(x):
    whole, k = evaluate(WHOLE, x, EYE), WHOLE.splats_per_anchor
    seen = 0
    for label in (0, 1, 3):
        part, place = part_of(WHOLE, label)
        rows = splat_labels(WHOLE) == label
        found = evaluate(part, x, EYE)
        assert np.abs(found.means + place - whole.means[rows]).max() < 1e-6
        for name in ("scales", "wxyz", "opacity"):
            # The product of fewer rows may be summed in another order.
            assert np.allclose(
                getattr(found, name), getattr(whole, name)[rows], rtol=1e-4, atol=1e-6
            )
        # Directions are taken from the eye to the anchor: both have moved.
        moved = color_from(part, x, EYE - place)
        assert np.allclose(moved, color_from(WHOLE, x, EYE)[rows], atol=1e-5)
        seen += part.splat_count
        assert part.networks is WHOLE.networks and set(part.labels) == {label}
        if label:
            assert np.abs(part.anchors.mean(0)).max() < 1e-6
    assert place != (0, 0, 0) and seen == WHOLE.splat_count == 60 * k
    assert part_of(WHOLE, 0)[1] == (0, 0, 0)


def test_parts_of_plain_splats_keep_every_column():
    whole = layers()
    part, place = part_of(whole, 300)
    rows = whole.labels == 300
    assert np.allclose(part.means + place, whole.means[rows], atol=1e-6)
    assert np.allclose(part.origin, np.add(whole.origin, place))  # the file's zero stays known
    assert np.array_equal(part.extra["heat"], whole.extra["heat"][rows])
    assert part.splat_count == rows.sum() and (part.labels == 300).all()


def test_a_part_is_found_by_label_or_name():
    assert [find_label(WHOLE, part, "a") for part in (0, 1, "mug", "3", 3)] == [0, 1, 1, 3, 3]
    assert find_label(WHOLE, "7", "a") == 3  # a name before a number
    assert find_label(layers(), 300, "a") == find_label(layers(), "300", "a") == 300
    assert (name_of(WHOLE, 3), name_of(WHOLE, 0), name_of(layers(), 2)) == ("7", "", "")


@pytest.mark.parametrize("part", [7, 255, "cup", "absent", 9, "", "-1"])
def test_a_part_that_is_not_there_says_what_is(part):
    with pytest.raises(BadFile) as failure:
        find_label(WHOLE, part, "room.shift")
    assert str(failure.value) == f"nothing of room.shift is {part!r}; it has 0, 1 mug, 3 7."


def test_models_without_labels_have_no_parts():
    for model in (make_random_model(), replace(layers(), labels=None)):
        assert splat_labels(model) is None
        with pytest.raises(BadFile, match="a has no labels of objects, so no parts"):
            find_label(model, 0, "a")


def test_labels_that_do_not_fit_are_refused_where_a_model_is_made():
    for values, words in (
        ({"labels": WHOLE.labels[:3]}, "shape"),
        ({"labels": WHOLE.labels.astype(np.int32)}, "int32"),
        ({"labels": None}, "no anchor has labels"),
        ({"objects": ()}, "the label 1, which no object has"),
        ({"objects": (*WHOLE.objects, ObjectLabel(4, "mug"))}, "two objects have the name mug"),
        ({"objects": (*WHOLE.objects, ObjectLabel(1, "x"))}, "two objects have the label 1"),
        ({"objects": (*WHOLE.objects, ObjectLabel(255, "x"))}, "expected 1 to 254"),
    ):
        with pytest.raises(ValueError, match=words):
            replace(WHOLE, **values)


def test_the_debug_view_colours_every_splat_by_its_anchors_label():
    from shapeshift.renderer.debug.debug import label_ranks, object_counts
    from shapeshift.scene.scene import Scene, SceneObject

    labels, ranks = label_ranks(WHOLE)
    assert labels == [3, 0, 1]  # the commonest first
    assert np.array_equal(np.array(labels)[ranks], splat_labels(WHOLE))
    counts = object_counts(Scene((SceneObject("room", WHOLE),)), [WHOLE.splat_count])
    k = WHOLE.splats_per_anchor
    assert counts == {"room, 7": 30 * k, "room, label 0": 15 * k, "room, mug": 15 * k}
