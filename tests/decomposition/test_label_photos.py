"""From prompts in a photo to label maps of all, on the demo: right, interrupted, and refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pyopencl")

from shapeshift.decomposition.judge import BEST, FEW, MOST_VIEWS, judge, views_to_ask
from shapeshift.decomposition.label_photos import PhotoLabelling, best_of, choose_photos, with_click
from shapeshift.decomposition.masks.journal import open_journal
from shapeshift.decomposition.masks.label_maps import SILENT, write_label_map
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs, PhotoPrompt
from shapeshift.decomposition.masks.work_photos import find_photo, work_photos
from shapeshift.decomposition.segment_scene import SegmentedPart
from shapeshift.decomposition.walk_objects import (
    heights_of,
    places_of,
    walk_objects,
    with_labels,
)
from shapeshift.rasterizer.device import NoDevice
from shapeshift.runtime_models.model import AnchorModel, BadFile, ObjectLabel, Stop
from tests.support.decomposition.demo_photos import (
    COUNT,
    SIZE,
    TrueSegmenter,
    box_of_object,
    demo,
    true_maps,
    write_demo_capture,
)
from tools.synthetic.labels import LABELS, labels_of_places

NAMES = ("cabinet", "motor", "mug")


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    try:
        demo()
    except NoDevice as error:
        pytest.skip(str(error))
    capture = write_demo_capture(tmp_path_factory.mktemp("capture"))
    return work_photos(capture, demo().model.stops)


def largest(label: int) -> int:
    """The view that shows most of it."""
    return int(np.argmax([(labels == label).sum() for labels in true_maps()[1]]))


@pytest.fixture(scope="module")
def specs(photos) -> ObjectSpecs:
    objects = []
    for name in NAMES:
        label = LABELS[name]
        view = largest(label)
        said = PhotoPrompt(photos[view].name, box_of_object(view, label))
        objects.append(ObjectSpec(label, name, (said,)))
    return ObjectSpecs(photos[0].photo.path.parents[1], tuple(objects))


def labelling(photos, specs, folder, **more) -> PhotoLabelling:
    segmenter = more.pop("segmenter", None) or TrueSegmenter([p.pixels() for p in photos])
    return PhotoLabelling(demo(), photos, specs, segmenter, open_journal(folder, {"a": 1}), **more)


def test_one_box_an_object_labels_all_photos(photos, specs, tmp_path):
    """Two of the segmenter's three answers are wrong, and it is surer of them."""
    work = labelling(photos, specs, tmp_path / "work")
    work.run()
    found = work.labels()
    assert len(found.maps) == COUNT and set(found.counts) == {s.label for s in specs.objects}
    for spec in specs.objects:
        counts = found.counts[spec.label]
        assert counts.given == 1 and sum(vars(counts).values()) == COUNT
        for labels, true in zip(found.maps, true_maps()[1], strict=True):
            one, other = labels == spec.label, true == spec.label
            if one.any():  # taken: then it is the true one, but for what another object overlaps
                assert (one & other).sum() / (one | other).sum() > 0.9
    assert sum(c.accepted for c in found.counts.values()) >= 8
    assert set(np.unique(found.maps)) <= {0, SILENT, *(s.label for s in specs.objects)}


def test_who_is_interrupted_goes_on_and_ends_alike(photos, specs, tmp_path):
    whole = labelling(photos, specs, tmp_path / "whole")
    whole.run()
    steps = []

    def stop(what: str, done: int, of: int) -> None:
        steps.append(done)
        if len(steps) == 11:
            raise KeyboardInterrupt

    first = labelling(photos, specs, tmp_path / "work", progress=stop)
    with pytest.raises(KeyboardInterrupt):
        first.run()
    part = first.labels()  # what is done so far
    assert len(part.maps) == 3 and len(part.counts) == 2
    again = labelling(photos, specs, tmp_path / "work")
    assert again.journal.resumed >= 6
    again.run()
    assert again.segmenter.asked < whole.segmenter.asked - 10
    for one, other in zip(again.labels().maps, whole.labels().maps, strict=True):
        np.testing.assert_array_equal(one, other)
    assert again.labels().counts == whole.labels().counts
    third = labelling(photos, specs, tmp_path / "work")
    third.run()
    assert third.segmenter.asked == third.segmenter.encoded == 0


def test_other_inputs_begin_anew_and_other_files_stay(tmp_path):
    journal = open_journal(tmp_path / "work", {"a": 1})
    journal.write(3, 7, Candidate(np.eye(4, dtype=bool), 0.5))
    journal.write(3, 8, None)
    same = open_journal(tmp_path / "work", {"a": 1})
    assert same.resumed == 2 and same.known(3, 8) and not same.known(3, 9)
    (found,) = same.candidates(3, 7, (4, 4))
    assert (found.mask == np.eye(4)).all() and found.score == 0.5
    assert same.candidates(3, 8, (4, 4)) == []
    with pytest.raises(BadFile, match="not of its photo's size"):
        same.candidates(3, 7, (4, 5))
    (tmp_path / "work/3/decisions.json").write_text(json.dumps({"7": "x", "y": 1, "8": None}))
    assert open_journal(tmp_path / "work", {"a": 1}).taken == {3: {8: None}}
    assert open_journal(tmp_path / "work", {"a": 2}).resumed == 0
    assert not (tmp_path / "work/3").exists()
    (tmp_path / "work/mine.txt").write_text("kept")
    with pytest.raises(BadFile, match="holds something else"):
        open_journal(tmp_path / "work", {"a": 3})
    (tmp_path / "other").mkdir()
    assert open_journal(tmp_path / "other", {"a": 3}).resumed == 0  # killed as it was made
    assert (tmp_path / "other/inputs.json").is_file()
    (tmp_path / "third/3").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "third")
    (tmp_path / "file").touch()
    for name in ("third", "link", "file"):
        with pytest.raises(BadFile, match="holds something else"):
            open_journal(tmp_path / name, {"a": 3})


def test_masks_of_other_programs_are_given_as_they_are(photos, specs, tmp_path):
    """A label PNG of the photo's size, and one of twice it; no segmenter is asked about them."""
    label = LABELS["mug"]
    view = largest(label)
    write_label_map(true_maps()[1][view], tmp_path / "a.png")
    write_label_map(true_maps()[1][view].repeat(2, 0).repeat(2, 1), tmp_path / "b.png")
    for name in ("a.png", "b.png"):
        said = PhotoPrompt(photos[view].name, mask=name, mask_label=label)
        mug = ObjectSpecs(tmp_path, (ObjectSpec(label, "mug", (said,)),))
        work = labelling(photos, mug, tmp_path / name[0])
        given = work.given(mug.objects[0], None)
        np.testing.assert_array_equal(given[view], true_maps()[1][view] == label)


def test_without_a_network_the_walk_labels_anchors(photos, specs):
    """Boxes in one photo each; the truth is the nearest solid of the ray tracer's scene."""
    labels, masks = walk_objects(demo(), photos, specs)
    assert labels.dtype == np.int32 and labels.shape == (demo().count,)
    assert set(masks) == {spec.label for spec in specs.objects}
    from shapeshift.decomposition.masks.anchor_walk import nodes_of

    nodes = nodes_of(demo().model, np.array([0, 0.6, 1.8], np.float32))
    true = labels_of_places(nodes.means)[0]
    for spec in specs.objects:
        one, other = labels[nodes.rows] == spec.label, true == spec.label
        assert (one & other).sum() / (one | other).sum() > 0.55, spec.name


def test_with_true_masks_the_walk_is_nearly_the_truth(photos, specs, tmp_path):
    objects = []
    for spec in specs.objects:
        view = largest(spec.label)
        write_label_map(true_maps()[1][view], tmp_path / f"{spec.label}.png")
        said = PhotoPrompt(photos[view].name, mask=f"{spec.label}.png", mask_label=spec.label)
        objects.append(replace(spec, prompts=(said,)))
    labels, _ = walk_objects(demo(), photos, ObjectSpecs(tmp_path, tuple(objects)))
    from shapeshift.decomposition.masks.anchor_walk import nodes_of

    nodes = nodes_of(demo().model, np.array([0, 0.6, 1.8], np.float32))
    true = labels_of_places(nodes.means)[0]
    found = []
    for spec in specs.objects:
        one, other = labels[nodes.rows] == spec.label, true == spec.label
        found.append((one & other).sum() / (one | other).sum())
    assert np.mean(found) > 0.85 and min(found) > 0.75


def test_prompts_that_cannot_be_meant(photos, specs, tmp_path):
    def refused(spec: ObjectSpec, word: str) -> None:
        objects = ObjectSpecs(tmp_path, (spec,))
        with pytest.raises(BadFile, match=word):
            labelling(photos, objects, tmp_path / "work").run()
        with pytest.raises(BadFile, match=word):
            walk_objects(demo(), photos, objects)

    good = specs.objects[0].prompts[0]
    refused(ObjectSpec(1, "a"), "has no prompt")
    refused(ObjectSpec(1, "a", (replace(good, photo="rgb/00.png"),)), "did you mean 'rgb/00")
    refused(ObjectSpec(1, "a", (replace(good, photo="zzz"),)), "the first one is 'rgb/000.png'")
    refused(ObjectSpec(1, "a", (replace(good, box=(0, 0, 193, 5)),)), "193, 5 lies outside of")
    refused(ObjectSpec(1, "a", (PhotoPrompt(good.photo, mask="none.png"),)), "missing")


def test_a_photo_is_found_by_its_path_or_its_own_name(photos):
    assert find_photo(photos, "rgb/003.png", "x") == find_photo(photos, "003.png", "x") == 3
    twice = [*photos, replace(photos[3], name="other/003.png")]
    assert find_photo(twice, "rgb/003.png", "x") == 3
    with pytest.raises(BadFile, match="2 photos are called so"):
        find_photo(twice, "003.png", "x")


def test_photos_to_ask_about_hold_those_with_prompts_and_lie_apart(photos, specs):
    named = {prompt.photo for spec in specs.objects for prompt in spec.prompts}
    for most in (1, 4, 6, 99):
        chosen = choose_photos(photos, specs, most)
        assert named <= {photo.name for photo in chosen}
        assert len(chosen) == min(max(most, len(named)), COUNT)
        assert [p.name for p in chosen] == sorted(p.name for p in chosen)
    thermal = [*photos[:4], *(replace(p, stop=Stop("Thermal", 0.5)) for p in photos[4:])]
    first = ObjectSpecs(
        specs.folder,
        (replace(specs.objects[0], prompts=(PhotoPrompt("rgb/001.png", (0, 0, 9, 9)),)),),
    )
    assert {p.stop.name for p in choose_photos(thermal, first)} == {"RGB"}


def test_the_answer_that_agrees_with_the_person():
    left, right = np.zeros((4, 8), bool), np.zeros((4, 8), bool)
    left[:, :4], right[:, 4:] = True, True
    answers = [Candidate(left, 0.9), Candidate(right, 0.5)]
    assert best_of(answers, Prompt()) is answers[0]
    assert best_of(answers, Prompt(inside=np.array([[6, 1.0]]))) is answers[1]
    assert best_of(answers, Prompt(outside=np.array([[1, 1.0]]))) is answers[1]
    assert best_of(answers, Prompt(box=(4, 0, 8, 4))) is answers[1]
    assert best_of([Candidate(np.zeros((4, 8), bool), 1.0)], Prompt()) is None
    assert best_of([Candidate(np.ones((4, 8), bool), 1.0)], Prompt()) is None


def test_a_capture_of_other_stops_is_refused(photos, tmp_path):
    from shapeshift.scene.captures.capture import Capture

    capture = Capture(tmp_path, (Stop("RGB", 0.0),), (photos[0].photo,))
    with pytest.raises(BadFile, match="photos of 'RGB' belong to no stop"):
        work_photos(capture, (Stop("Bone", 0.0), Stop("Skin", 1.0)))
    assert work_photos(capture, (Stop("Bone", 0.0), Stop("RGB", 1.0)))[0].stop.x == 1.0
    assert photos[0].view.size == SIZE


def test_heights_tell_the_bench_from_what_stands_on_it(photos, specs):
    """The truth is the ray tracer's: the bench's top is a plane, the mug stands on it; with nothing
    flat around there are none."""
    from shapeshift.decomposition.masks.anchor_walk import nodes_of

    spec = next(spec for spec in specs.objects if spec.name == "mug")
    view = largest(spec.label)
    photo, true = photos[view], true_maps()[1][view]
    nodes = nodes_of(demo().model, np.array([0, 0.6, 1.8], np.float32))
    left, top, right, bottom = spec.prompts[0].box or (0, 0, 0, 0)
    prompt = Prompt((left, top, right, bottom))
    places = places_of(demo(), photo.view, 0.0, nodes)
    (height,) = heights_of(places, photo.view, [prompt], nodes)
    assert height is not None and height.dtype == np.uint8 and height.shape == true.shape
    box = np.s_[int(top) : int(bottom), int(left) : int(right)]
    mug, bench = height[box][true[box] == spec.label], height[box][true[box] == 0]
    assert np.percentile(mug, 20) > np.percentile(bench, 80)
    none = replace(nodes, means=np.random.default_rng(0).uniform(-1, 1, nodes.means.shape))
    scattered = places_of(demo(), photo.view, 0.0, none)
    assert heights_of(scattered, photo.view, [prompt], none) == [None]
    assert heights_of(places, photo.view, [], nodes) == []


def test_photos_that_were_used_are_asked_only_without_others(photos):
    used = {photos[0].photo.path, photos[3].photo.path}
    chosen = views_to_ask(photos, used)
    assert len({p.name for p in chosen}) == MOST_VIEWS and not used & {p.photo.path for p in chosen}
    assert len(views_to_ask(photos, {p.photo.path for p in photos})) == MOST_VIEWS
    assert [p.name for p in views_to_ask(photos[:2], used)] == [photos[1].name]
    heat = next(stop for stop in demo().model.stops if stop.is_measured)
    assert views_to_ask([replace(photos[0], stop=heat)], set()) == views_to_ask([], set()) == []


def test_the_demos_mug_is_doubted_where_it_holds_bench(photos):
    """Cut by the ray tracer's truth, and with the bench within 12 cm of its middle: its
    agreement falls, and the reason is named; too little of it says nothing."""
    model, name = demo().model, "mug"
    assert isinstance(model, AnchorModel)
    label = LABELS[name]
    right = np.where(labels_of_places(model.anchors)[0] == label, label, 0).astype(np.int32)
    middle = model.anchors[right > 0].mean(0)
    near = np.hypot(*(model.anchors - middle)[:, [0, 2]].T) < 0.12
    wrong = np.where(near & (np.abs(model.anchors[:, 1]) < 0.02), label, right).astype(np.int32)

    def asked(labels: np.ndarray, pixels: float = FEW, views=photos):
        cut = with_labels(model, labels, (ObjectLabel(label, name),))
        part = SegmentedPart(ObjectSpec(label, name), 1, int((labels > 0).sum()), pixels)
        (found,) = judge(demo().device, cut, [part], views, set[Path]())
        assert found.name == name
        return found

    good, bad = asked(right), asked(wrong)
    assert good.agreement > 0.8 and good.doubt == "" and BEST <= good.photos <= MOST_VIEWS
    assert bad.agreement < good.agreement - 0.1
    assert bad.doubt == "holds a piece of what it stands on"
    few = asked(right, 23.0)
    assert np.isnan(few.agreement) and few.doubt == "too little seen: 23 pixels"
    alone = asked(right, views=[])
    assert np.isnan(alone.agreement) and alone.doubt == "no other photo shows it"
    assert judge(demo().device, model, [], photos, set()) == ()


def test_a_box_alone_gets_a_click_where_the_thing_is_deepest():
    """A red ring on blue: the middle of its box is blue; clicks of a person stay as they are."""
    rows, columns = np.mgrid[:80, :100]
    away = np.hypot(rows - 40, columns - 50)
    ring = (away < 28) & (away > 14)
    image = np.where(ring[..., None], (200, 30, 30), (30, 60, 180)).astype(np.uint8)
    box = (22.0, 12.0, 79.0, 69.0)
    (click,) = with_click(image, Prompt(box)).inside
    assert 17 < np.hypot(click[1] - 40.5, click[0] - 50.5) < 25  # deepest is 21, half a width off
    said = Prompt(box, np.array([[30.0, 40.0]]))
    assert with_click(image, said) is said and with_click(image, Prompt(text="a ring")).box is None
