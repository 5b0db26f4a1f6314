"""Scenes in blocks: one model of several, the folder on disk, and what is refused of it."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.blocks.block_model import BlockModel, joined, one_network
from shapeshift.runtime_models.blocks.read_blocks import (
    BlockBox,
    BlockList,
    ListedBlock,
    read_block_list,
    read_blocks,
    turned,
)
from shapeshift.runtime_models.blocks.write_blocks import write_blocks
from shapeshift.runtime_models.evaluate import Evaluator, evaluate
from shapeshift.runtime_models.eyes import EYES
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import describe, files_of, read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.models import make_random_model, with_light

INF = math.inf
LEFT = BlockBox((-INF, -INF, -INF), (0.1, INF, INF))
RIGHT = BlockBox((0.1, -INF, -INF), (INF, INF, INF))
EYE = np.array([0.3, 0.4, 2.0])
FIELDS = ("means", "scales", "wxyz", "opacity", "color")


def halves():
    """Two models of 60 anchors each, of other weights; the second has more hidden units."""
    parts = {}
    for seed, (name, box) in enumerate((("0.shift", LEFT), ("1.shift", RIGHT))):
        model = make_random_model(200, 3, seed, features=8, hidden=(16 + 4 * seed,))
        parts[name] = model.with_anchors(np.flatnonzero(box.holds(model.anchors))[:60])
    return parts


@pytest.fixture
def folder(tmp_path):
    parts = halves()
    blocks = tuple(
        ListedBlock(n, b) for n, b in zip(parts, (LEFT, RIGHT), strict=True)
    )  # fmt: skip
    listed = BlockList(0.0, blocks, None, parts["0.shift"].stops)
    write_blocks(listed, parts, tmp_path / "a.blocks")
    return tmp_path / "a.blocks"


@pytest.mark.parametrize("x", [0.0, 0.3, 1.0])
def test_a_scene_in_blocks_is_its_parts_one_after_the_other(folder, x):
    """To the bit: each anchor is decoded by its own networks and no other's."""
    whole = read_model(folder)
    parts = [evaluate(read_package(folder / f"{n}.shift"), x, EYE) for n in range(2)]
    found = evaluate(whole, x, EYE)
    for name in FIELDS:
        expected = np.concatenate([getattr(part, name) for part in parts])
        assert np.array_equal(getattr(found, name), expected), name


@pytest.mark.parametrize("x", [0.0, 0.3, 1.0])
def test_one_set_of_networks_draws_the_same(folder, x):
    """The oracle of the runs: ReLU shuts the units of other blocks, which then add exact zeros."""
    whole = read_blocks(folder)
    one = one_network(whole)
    assert not isinstance(one, BlockModel)
    found, expected = evaluate(one, x, EYE), evaluate(whole, x, EYE)
    for name in FIELDS:
        difference = np.abs(getattr(found, name) - getattr(expected, name)).max()
        assert difference <= 2e-6, name  # sums of the same numbers in another order


def test_the_kept_evaluator_colours_what_is_seen_and_each_anchor_at_its_own_x(folder):
    model = read_blocks(folder)
    evaluator, x = Evaluator(model, keep=True), np.linspace(0, 1, len(model.anchors))
    rows = np.repeat(np.arange(len(x)), model.splats_per_anchor)
    geometry = [array.copy() for array in evaluator.geometry(x)]
    again = evaluator.geometry(x)
    assert all(np.array_equal(a, b) for a, b in zip(geometry, again, strict=True))
    for anchor in (0, 59, 60, 119):
        alone = Evaluator(model.with_anchors(np.array([anchor])), fold=False)
        mine = [array[rows == anchor] for array in geometry]
        for a, b in zip(mine, alone.geometry(float(x[anchor])), strict=True):
            assert np.allclose(a, b, atol=2e-6)
    seen = np.zeros(len(x), bool)
    seen[[3, 70]] = True
    out = np.full((model.splat_count, 3), -1, np.float32)
    colors, every = evaluator.color(0.5, EYE, seen, out), evaluator.color(0.5, EYE)
    assert colors is out and (colors[~seen[rows]] == -1).all()
    assert np.allclose(colors[seen[rows]], every[seen[rows]], atol=2e-6)


def test_colours_along_a_direction_are_each_block_s_own(folder):
    """What baking asks for: a direction for each anchor, decoded by its own block, to the bit."""
    whole, parts = read_model(folder), [read_package(folder / f"{n}.shift") for n in range(2)]
    along = np.random.default_rng(3).normal(size=(len(whole.anchors), 3)).astype(np.float32)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    cut = len(parts[0].anchors)
    wanted = [
        Evaluator(part).color_along(0.4, rows)
        for part, rows in zip(parts, (along[:cut], along[cut:]), strict=True)
    ]
    np.testing.assert_array_equal(Evaluator(whole).color_along(0.4, along), np.concatenate(wanted))
    assert np.ptp(np.concatenate(wanted), axis=0).min() > 0.01  # else any direction would do


@pytest.mark.parametrize("order", ["as they are", "backwards", "one by one", "none"])
def test_any_rows_keep_their_networks(folder, order):
    model = read_blocks(folder)
    count = len(model.anchors)
    rows = {
        "as they are": np.arange(count), "backwards": np.arange(count)[::-1],
        "one by one": np.arange(count).reshape(2, -1).T.ravel(), "none": np.zeros(0, int),
    }[order]  # fmt: skip
    few = model.with_anchors(rows)
    assert (
        len(few.runs) == {"as they are": 2, "backwards": 2, "one by one": count, "none": 0}[order]
    )
    if len(rows):
        whole = evaluate(model, 0.2, EYE).color.reshape(count, -1)
        assert np.allclose(evaluate(few, 0.2, EYE).color.reshape(count, -1), whole[rows], atol=2e-6)


def test_it_is_said_and_written_as_one_scene(folder, tmp_path):
    model = read_model(folder / "blocks.json")
    facts = describe(model, folder)
    assert facts["format"] == "shapeshift-blocks 1" and facts["anchors_of_blocks"] == [60, 60]
    assert {file.name for file in files_of(model, folder)} == {"blocks.json", "0.shift", "1.shift"}
    write_package(model, tmp_path / "one.shift", "exact")
    one = read_model(tmp_path / "one.shift")
    assert one.features.shape[1] == 8 + 2 and "files" not in one.provenance
    expected = evaluate(model, 0.7, EYE)
    assert np.allclose(evaluate(one, 0.7, EYE).color, expected.color, atol=2e-6)


def test_writing_again_gives_the_same_bytes_and_foreign_folders_stay(folder, tmp_path):
    listed = read_block_list(folder)
    parts = {name: read_package(folder / name) for name in listed.files}
    write_blocks(listed, parts, tmp_path / "b.blocks")
    for file in folder.iterdir():
        assert file.read_bytes() == (tmp_path / "b.blocks" / file.name).read_bytes()
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(BadFile, match=r"notes\.txt"):
        write_blocks(listed, parts, folder)
    assert (folder / "notes.txt").read_text() == "mine"


def test_what_stands_on_a_cut_belongs_to_one_block():
    at = np.array([[0.1, 0, 0], [np.nextafter(0.1, 0), 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
    assert LEFT.holds(at).tolist() == [False, True, False, False]
    assert RIGHT.holds(at).tolist() == [True, False, False, False]  # the last has no end at all
    assert LEFT.holds(at, margin=0.01).tolist() == [True, True, False, False]


def test_a_turned_frame_is_a_turn_about_the_vertical():
    rng = np.random.default_rng(0)
    places = rng.normal(size=(50, 3))
    found = turned(places, 30)
    assert np.allclose(np.linalg.norm(found, axis=1), np.linalg.norm(places, axis=1))
    assert np.array_equal(found[:, 1], places[:, 1])
    way = turned(np.array([[math.cos(math.radians(30)), 0, -math.sin(math.radians(30))]]), 30)
    assert np.allclose(way, [[1, 0, 0]])
    assert np.array_equal(turned(places, 0), places)


def changed(folder, **facts):
    """The list with some facts changed; None: left out."""
    data = json.loads((folder / "blocks.json").read_text()) | facts
    text = json.dumps({key: value for key, value in data.items() if value is not None})
    (folder / "blocks.json").write_text(text)


def row(file="0.shift", low=(None,) * 3, high=(0.1, None, None), **more):
    return {"file": file, "low": list(low), "high": list(high)} | more


def second(**more):
    return row("1.shift", (0.1, None, None), (None,) * 3, **more)


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"format": "shapeshift-blocks 2"}, "shapeshift-blocks 2"),
        ({"format": None}, "'format' is missing"),
        ({"blocks": []}, "at least one block"),
        ({"blocks": {}}, "a list of objects"),
        ({"blocks": [row(low=(float("nan"), None, None)), second()]}, "3 numbers"),
        ({"blocks": [row(high=(float("inf"), None, None)), second()]}, "3 numbers"),
        ({"blocks": [row(high=(1e10, None, None)), second()]}, "3 numbers"),
        ({"blocks": [row(high=(0.1, None)), second()]}, "3 numbers"),
        ({"blocks": [row(low=(0.1, None, None)), second()]}, "which is no box"),
        ({"blocks": [row(high=(0.2, None, None)), second()]}, "overlap"),
        ({"blocks": [row(), row()]}, "one package twice"),
        ({"blocks": [row("../0.shift"), second()]}, "in the same folder"),
        ({"blocks": [row("/etc/0.shift"), second()]}, "in the same folder"),
        ({"blocks": [row("a\\0.shift"), second()]}, "in the same folder"),
        ({"blocks": [row("0.ply"), second()]}, "in the same folder"),
        ({"blocks": [row("7.shift"), second()]}, "which is not in"),
        ({"blocks": [row(extra=1), second()]}, "'extra' is no key"),
        ({"far": "0.shift"}, "one package twice"),
        ({"far": 3}, "'far' is 3"),
        ({"turn_degrees": 91}, "from -90 to 90"),
        ({"turn_degrees": float("nan")}, "from -90 to 90"),
        ({"stops": None}, "stops"),
        ({"stops": [{"name": "RGB", "x": 0.0, "kind": "rgb"}]}, "other stops than 0.shift"),
        ({"colour": 1}, "'colour' is no key"),
    ],
)
def test_each_field_is_checked_in_one_sentence(folder, facts, said):
    changed(folder, **facts)
    with pytest.raises(BadFile, match=re.escape(said)) as refused:
        read_model(folder)
    assert "\n" not in str(refused.value)


def test_a_link_that_leads_out_is_refused(folder, tmp_path):
    (folder / "0.shift").rename(tmp_path / "elsewhere.shift")
    (folder / "0.shift").symlink_to(tmp_path / "elsewhere.shift")
    with pytest.raises(BadFile, match="leads out"):
        read_model(folder)


def test_blocks_of_two_trainings_are_refused(folder):
    other = replace(make_random_model(40, 4, 5, features=8), stops=halves()["0.shift"].stops)
    write_package(other, folder / "1.shift")
    with pytest.raises(BadFile, match=re.escape("other splats an anchor")):
        read_model(folder)


@pytest.mark.parametrize("channels", [(0, 3), (1, 0), (1, 3)])
def test_blocks_of_other_light_are_refused(channels):
    each = [with_light(m, channels=c) if c else m
            for m, c in zip(halves().values(), channels, strict=True)]  # fmt: skip
    with pytest.raises(BadFile, match="a and b have other light by direction"):
        joined(each, ["a", "b"])


@pytest.mark.parametrize("channels", [1, 3])
def test_blocks_with_light_are_one_package_with_it(channels):
    each = [with_light(model, channels=channels) for model in halves().values()]
    whole = joined(each, ["a", "b"])
    eye = np.array([0.3, 1.0, 2.5])
    want = np.concatenate([Evaluator(model).color(0.4, eye) for model in each])
    for found in (whole, one_network(whole)):
        np.testing.assert_allclose(Evaluator(found).color(0.4, eye), want, atol=1e-5)


def test_anchors_beside_their_box_are_kept_and_told(folder):
    changed(folder, blocks=[row(high=(-0.2, None, None)), second()])
    model = read_blocks(folder)
    (finding,) = model.findings
    assert len(model.anchors) == 120 and not finding.repaired
    assert finding.count == (halves()["0.shift"].anchors[:, 0] >= -0.2).sum()


def test_the_whole_folder_has_one_account(folder):
    with pytest.raises(BadFile, match="memory"):
        read_model(folder, Reading(memory_gb=1e-4))


def test_up_and_flip_are_refused_as_of_every_package(folder):
    with pytest.raises(BadFile, match="leave out --up"):
        read_model(folder, Reading(flip=True))


def test_joined_models_say_which_blocks_do_not_fit():
    one, other = halves().values()
    with pytest.raises(BadFile, match="other stops"):
        joined([one, replace(other, stops=other.stops[:1])], ["a", "b"])
    labels = np.zeros(len(other.anchors), np.uint8)
    with pytest.raises(BadFile, match="b has labels"):
        joined([one, replace(other, labels=labels)], ["a", "b"])
    with pytest.raises(ValueError, match="name the blocks 0 to 2"):
        whole = joined([one, other], ["a", "b"])
        replace(whole, block=np.minimum(np.arange(len(whole.anchors)), 2).astype(np.int32))


def test_a_scene_in_blocks_has_the_eyes_of_all_blocks():
    """Each block knows those that saw it alone; one without any changes nothing."""
    one, other = halves().values()
    here, there = [[0.0, 1.0, 2.0], [0.5, 1.0, 2.0]], [[9.0, 1.0, 2.0]]
    models = [replace(m, provenance={EYES: e}) for m, e in ((one, here), (other, there))]
    whole = joined(models, ["a", "b"])
    assert sorted(whole.provenance[EYES]) == here + there
    assert sorted(one_network(whole).provenance[EYES]) == here + there
    assert joined([models[0], other], ["a", "b"]).provenance[EYES][0] in here
    assert EYES not in joined([one, other], ["a", "b"]).provenance
