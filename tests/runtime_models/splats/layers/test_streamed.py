"""Streamed SOG: which splats each level has, what a budget reads, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.sog.read_sog import read_raw_sog
from shapeshift.runtime_models.splats.sog.read_streamed import (
    finest_within,
    levels,
    read_streamed,
    read_tree,
    steps,
)
from tests.support.splats.sog_scenes import (
    COUNTS,
    random_sog,
    rewrite,
    write_folder,
    write_streamed,
    write_zip,
)


@pytest.fixture
def scene(tmp_path) -> Path:
    return write_streamed(tmp_path / "a scene")


def test_the_finest_level_is_read_and_has_its_files_splats(scene):
    layers = read_model(scene)
    raw = read_raw_sog(scene / "0_0", Reading())
    assert layers.splat_count == 400 and layers.stops[0].name == "a scene"
    # the first node's run comes first: the last two thirds of the file, then the first third
    order = np.r_[133:400, 0:133]
    assert np.array_equal(layers.means, raw.means[order] * np.array([1, -1, -1], np.float32))
    assert np.array_equal(layers.sh[:, 0], raw.sh[order, 0])
    assert layers.provenance["level"] == 0 and layers.provenance["level_splats"] == list(COUNTS)
    assert layers.findings == ()
    facts = describe(layers, scene)
    assert facts["level"] == 0 and facts["levels"] == dict(enumerate(COUNTS))


@pytest.mark.parametrize(
    ("budget", "level", "kept"),
    [(0, 0, 400), (400, 0, 400), (399, 1, 150), (150, 1, 150), (149, 2, 60), (20, 3, 20),
     (19, 3, 19), (1, 3, 1), (10**9, 0, 400)],
)  # fmt: skip
def test_a_budget_reads_the_finest_level_within_it(scene, budget, level, kept):
    layers = read_model(scene, Reading(most_splats=budget))
    assert layers.splat_count == kept and layers.provenance["level"] == level
    said = " ".join(f"{found.what} {found.done}" for found in layers.findings)
    assert (f"level {level} with {COUNTS[level]} is read" in said) == (level > 0)


def test_the_file_itself_is_the_same_as_its_folder(scene):
    ours, again = read_model(scene), read_model(scene / "lod-meta.json")
    assert np.array_equal(ours.means, again.means) and ours.stops == again.stops
    used = [scene / "lod-meta.json", *(scene / "0_0").iterdir()]
    size = sum(file.stat().st_size for file in used)
    assert (
        describe(ours, scene)["bytes"] == describe(again, scene / "lod-meta.json")["bytes"] == size
    )


def test_levels_come_coarsest_first_and_end_as_the_whole_is_read(scene):
    found = list(levels(scene, Reading()))
    assert [layers.splat_count for layers in found] == [20, 150, 400]  # 60 is not 4 times 20
    assert [layers.provenance["level"] for layers in found] == [3, 1, 0]
    whole = read_streamed(scene, Reading())
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        assert np.array_equal(getattr(found[-1], name), getattr(whole, name))
    assert [m.splat_count for m in levels(scene, Reading(most_splats=160))] == [20, 150]
    assert [m.splat_count for m in levels(scene, Reading(most_splats=5))] == [5]


def test_levels_share_one_origin_however_far_they_are(tmp_path, monkeypatch):
    from dataclasses import replace

    import shapeshift.runtime_models.splats.sog.read_streamed as module

    judge, turn = module.judge, iter([(1000.0, 0.0, -3.0), (1001.0, 2.0, -3.5), (0.0, 0.0, 0.0)])

    def far(raw, reading):
        plain, origin = judge(raw, reading), next(turn)
        return replace(plain, means=(plain.means - origin).astype(np.float32), origin=origin)

    scene = write_streamed(tmp_path / "far")
    near = list(levels(scene, Reading()))
    monkeypatch.setattr(module, "judge", far)
    found = list(levels(scene, Reading()))
    assert {layers.origin for layers in found} == {(1000.0, 0.0, -3.0)}
    for layers, wanted in zip(found, near, strict=True):
        assert np.abs(layers.means + np.array(layers.origin) - wanted.means).max() < 3e-4


def test_steps_grow_and_end_at_the_finest_within_the_budget():
    counts = (500_000, 250_000, 125_000, 31_000, 8406, 3000, 1873)
    assert steps(counts, 0) == [6, 4, 2, 0]
    assert steps(counts, 130_000) == [6, 4, 2] and steps(counts, 40_000) == [6, 4, 3]
    assert steps(counts, 1873) == [6] and steps(counts, 1) == [6]
    assert steps((5,), 0) == [0] and steps((0, 7, 0), 0) == [1]
    assert finest_within((0, 7, 0), 3) == 1


def test_a_level_of_several_files_and_an_environment_and_a_zip(scene):
    write_zip(scene / "sky.sog", *random_sog(30, bands=0, seed=9))

    def change(meta):
        meta["environment"] = "sky.sog"
        meta["tree"]["children"][1]["lods"]["0"] = {"file": 1, "offset": 10, "count": 100}

    layers = read_model(rewrite(scene, change))
    flip = np.array([1, -1, -1], np.float32)
    parts = [read_raw_sog(scene / "0_0", Reading()).means[133:400]]
    parts += [read_raw_sog(scene / "1_0", Reading()).means[10:110]]
    sky = read_raw_sog(scene / "sky.sog", Reading())
    assert np.array_equal(layers.means, np.concatenate([*parts, sky.means]) * flip)
    assert layers.sh.shape == (397, 4, 3) and not layers.sh[-30:, 1:].any()
    assert "sky.sog" in layers.provenance["files"]


def test_versions_that_differ_within_one_level_are_refused(scene):
    write_folder(scene / "1_0", *random_sog(150, version=1, bands=1))

    def change(meta):
        meta["tree"]["children"][1]["lods"]["0"] = {"file": 1, "offset": 0, "count": 100}

    with pytest.raises(BadFile, match="mixes versions"):
        read_model(rewrite(scene, change))


def lod(meta: dict, node: int = 0, level: str = "0") -> dict:
    return meta["tree"]["children"][node]["lods"][level]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: m.update(version=2), "version 2"),
        (lambda m: m.update(lodLevels=0), "'lodLevels' is .*; a whole number from 1 to 64"),
        (lambda m: m.update(lodLevels=10**9), "'lodLevels' is .*; a whole number from 1 to 64"),
        (lambda m: m.update(lodLevels=2), "level '2', it states 2"),
        (lambda m: m.update(filenames="0_0/meta.json"), "'filenames' is .*; a list of texts"),
        (lambda m: m.update(filenames=["0_0/meta.json", 5]), "'filenames' is .*; a list of texts"),
        (lambda m: m["filenames"].__setitem__(0, "../meta.json"), "none of its own"),
        (lambda m: m["filenames"].__setitem__(0, "/etc/passwd"), "none of its own"),
        (lambda m: m["filenames"].__setitem__(0, "9_0/meta.json"), "lacks '9_0/meta.json'"),
        (lambda m: m["filenames"].pop(), "names file 3"),
        (lambda m: m.update(environment=7), "environment"),
        (lambda m: m.update(environment="../sky.sog"), "none of its own"),
        (lambda m: m.pop("tree"), "no splats|node"),
        (lambda m: m.update(tree=[]), "node"),
        (lambda m: m.update(tree={}), "no splats"),
        (lambda m: m["tree"].update(children={}), "no splats"),
        (lambda m: m["tree"].update(children=[1]), "node"),
        (lambda m: m["tree"].update(lods=[1]), "node"),
        (lambda m: lod(m).update(count=-1), "file, offset and count"),
        (lambda m: lod(m).update(count=None), "file, offset and count"),
        (lambda m: lod(m).update(offset=2.5), "file, offset and count"),
        (lambda m: lod(m).update(count=268), "names others or some twice"),
        (lambda m: lod(m).update(offset=134), "names others or some twice"),
        (lambda m: lod(m).update(count=10**18), "names row 1,000,000,000,000,000,133 of a file"),
        (lambda m: lod(m, 1).update(count=400), "names others or some twice"),
        (lambda m: m["tree"].update(lods={"-1": lod(m)}), "level '-1'"),
        (lambda m: m["tree"].update(lods={"¹": lod(m)}), "level '¹'"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(scene, change, words):
    with pytest.raises(BadFile, match=words) as caught:
        read_model(rewrite(scene, change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 10**5, '{"a":' * 10**4, "\0\xff"])
def test_a_file_that_is_no_json(scene, text):
    (scene / "lod-meta.json").write_text(text)
    with pytest.raises(BadFile, match=r"JSON|one object in braces"):
        read_model(scene)


def test_a_tree_deeper_than_a_stack_is_walked(scene):
    def change(meta):
        tree = meta["tree"]
        for _ in range(400):
            tree = {"children": [tree]}
        meta["tree"] = tree

    assert read_model(rewrite(scene, change)).splat_count == 400


def test_the_real_playbot(data):
    folder = data / "splats_playcanvas" / "playbot"
    tree = read_tree(folder)
    assert tree.counts == (500_000, 250_000, 125_000, 31_000, 8406, 3000, 1873)
    layers = read_model(folder, Reading(most_splats=31_000))
    assert layers.splat_count == 31_000 and layers.sh.shape[1] == 9
    low, high = layers.means.min(0), layers.means.max(0)
    assert (np.ptp(layers.means, axis=0) > (1.9, 1.0, 1.9)).all()
    # turned into our axes: the ground lies at the lower end, the robot stands on it
    assert -0.06 < low[1] < 0 and 1.05 < high[1] < 1.1
