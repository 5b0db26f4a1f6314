"""Scaffold-GS and Octree-GS folders: read, turned once, and decoded as their own code does it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import Evaluator, evaluate, follows_eye
from shapeshift.runtime_models.model import BadFile, Octree, ScaffoldModel
from shapeshift.runtime_models.read_scene import describe, files_of, read_model
from shapeshift.runtime_models.rotation import covariance, rotation_matrices
from shapeshift.runtime_models.scaffold.evaluate_scaffold import drawn_anchors, views_of
from shapeshift.runtime_models.scaffold.read_scaffold import read_scaffold
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.splats.scaffold_scenes import decode_by_hand, random_raw, write_cloud, write_run

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"
VERSIONS = ("torch_1_12", "torch_2_15")
EYE = np.array([0.4, -0.3, -5.0])  # in the file's axes
CASES = {
    "plain": {},
    "one splat": {"k": 1},
    "one anchor": {"anchors": 1},
    "distance": {"distance": True},
    "appearance": {"appearance": 5},
    "bank": {"bank": True},
    "everything": {"bank": True, "distance": True, "appearance": 4},
    "octree": {"levels": 4, "anchors": 80},
    "octree with levels as input": {"levels": 4, "anchors": 80, "add_level": True},
    "octree with all": {
        "levels": 4, "anchors": 80, "add_level": True, "distance": True, "bank": True,
        "appearance": 3,
    },
}  # fmt: skip


def compare(model: ScaffoldModel, raw, eye: np.ndarray, rotation=None, **how) -> None:
    """The model seen from the turned eye is the decode by hand, turned."""
    rotation = ours_from_file("-Y") if rotation is None else rotation
    found = evaluate(model, 0.0, rotation @ eye)
    wanted = decode_by_hand(raw, eye, **how)
    there = wanted["opacity"] > 0
    assert np.array_equal(found.opacity > 0, there)
    assert there.any() or len(raw.anchors) == 1
    np.testing.assert_allclose(found.means, wanted["means"] @ rotation.T, atol=2e-6)
    np.testing.assert_allclose(found.opacity[there], wanted["opacity"][there], atol=2e-5)
    np.testing.assert_allclose(found.color[there], wanted["color"][there], atol=2e-5)
    np.testing.assert_allclose(found.scales[there], wanted["scales"][there], rtol=2e-5)
    turned = rotation @ rotation_matrices(wanted["wxyz"][there])
    np.testing.assert_allclose(rotation_matrices(found.wxyz[there]), turned, atol=1e-4)


@pytest.mark.parametrize("how", ["unite", "split"])
@pytest.mark.parametrize("case", CASES)
def test_decoded_as_by_hand(tmp_path, case, how):
    raw = random_raw(**CASES[case], seed=3)
    settings = f"Namespace(add_level={raw.add_level}, fork=2)"
    folder = write_run(raw, tmp_path / "run", how, settings)
    model = read_model(folder)
    assert isinstance(model, ScaffoldModel)
    row = 0 if not raw.levels else 10
    for eye in (EYE, np.array([3.0, 1, 2]), np.array([0.0, 0, -60.0])):
        compare(model, raw, eye, row=row)


def test_onnx_exported_beside_is_the_same(tmp_path):
    raw = random_raw(distance=True)
    compare(read_model(write_run(raw, tmp_path / "run", "onnx")), raw, EYE)


@pytest.mark.parametrize("rule", ["round", "floor", "ceil", "progressive"])
@pytest.mark.parametrize("any_gs", [False, True])
def test_levels_are_drawn_by_the_rule_of_the_run(tmp_path, rule, any_gs):
    """From near, from far and between; Octree-AnyGS keeps its distance in the header."""
    raw = random_raw(levels=5, anchors=150, seed=1)
    if any_gs:
        raw = replace(raw, levels={k: v for k, v in raw.levels.items() if k != "voxel"})
    folder = write_run(raw, tmp_path / "run")
    settings = f"kwargs: {{ fork: 2, dist2level: '{rule}', }}" if any_gs else ""
    if settings:
        (folder / "config.yaml").write_text(settings)
    else:
        (folder / "cfg_args").write_text(f"Namespace(dist2level='{rule}', fork=2, x='a=b')")
    model = read_model(folder)
    assert model.octree.rule == rule
    drawn = []
    for away in (0.5, 2, 4, 8, 16, 400):
        eye = np.array([0.0, 0, -away])
        compare(model, raw, eye, rule=rule, row=0)
        drawn.append(int(drawn_anchors(model.octree, ours_from_file("-Y") @ eye)[0].sum()))
    assert drawn[0] > drawn[-1] > 0
    assert drawn == sorted(drawn, reverse=True)


def test_levels_at_the_cell_and_at_distance_zero():
    octree = Octree(
        np.array([0, 1, 2, 3], np.float32),
        np.zeros(4, np.float32),
        np.zeros((4, 3), np.float32),
        8.0,
    )
    for away, levels in ((0, 4), (1, 4), (1.5, 3), (2, 3), (4, 2), (8, 1), (1e9, 1)):
        drawn, part = drawn_anchors(octree, np.array([away, 0, 0]))
        assert drawn.sum() == levels, away
        assert (part == 1).all()


@pytest.mark.parametrize("up", ["+Y", "-Z", "+X"])
def test_any_axis_up_and_upside_down(tmp_path, up):
    """Directions turn back for the networks and rotations after them, whatever the turn is."""
    raw = random_raw(bank=True, distance=True, seed=5)
    folder = write_run(raw, tmp_path / "run")
    for flip in (False, True):
        model = read_model(folder, Reading(up=up, flip=flip))
        compare(model, raw, EYE, ours_from_file(up, flip))


@pytest.mark.parametrize("version", VERSIONS)
def test_a_folder_by_torch_itself(tmp_path, version):
    """The fixtures that torch traced and saved: the networks of a small scene."""
    for fixture in (FIXTURES / version).glob("scaffold_*.pt"):
        shutil.copy(fixture, tmp_path / fixture.name.removeprefix("scaffold_"))
    raw = random_raw(k=2, features=8)
    write_cloud(raw, tmp_path / "point_cloud.ply")
    model = read_model(tmp_path)
    inputs = {name: mlp.inputs for name, mlp in model.networks.items()}
    view = ("feature", "direction")
    assert inputs == {
        "opacity": (*view, "distance"), "covariance": view, "color": view,
        "bank": ("direction", "distance"),
    }  # fmt: skip
    assert model.provenance["appearance"] == "row 0 of 12"
    splats = evaluate(model, 0.0, EYE)
    assert np.isfinite(splats.means).all()
    assert ((splats.color > 0) & (splats.color < 1))[splats.opacity > 0].all()


def test_found_from_the_run_its_cloud_and_the_folder_between(tmp_path):
    run = tmp_path / "ein Lauf ä"
    old, new = (run / "point_cloud" / f"iteration_{n}" for n in (7000, 30000))
    write_run(random_raw(seed=1), old)
    raw = random_raw(seed=2)
    write_run(raw, new, "split")
    (run / "cfg_args").write_text("Namespace(white_background=True)")
    sizes = sum(p.stat().st_size for p in new.iterdir())
    for path in (run, new, new / "point_cloud.ply", new / "cov_mlp.pt"):
        model = read_model(path)
        assert describe(model, path)["bytes"] == sizes
        compare(model, raw, EYE)
        assert model.provenance["background"] == (1.0, 1.0, 1.0)
    (run / "cfg_args").write_text("Namespace(white_background=True)", encoding="utf-16")
    assert read_model(new).provenance["background"] == (1.0, 1.0, 1.0)
    (run / "cfg_args").write_bytes(bytes(9))
    unread = read_model(new)
    assert "cfg_args is no text" in unread.findings[0].what
    assert "background" not in unread.provenance
    facts = describe(read_model(run), run)
    assert facts["bytes"] == sizes == sum(f.stat().st_size for f in files_of(model, new))
    assert facts["format"] == "Scaffold-GS"
    assert facts["anchors"] == 40
    assert facts["splats"] == 120
    assert facts["heads"]["covariance"] == {
        "layers": [11, 8, 21], "inputs": ["feature", "direction"], "activation": "none",
    }  # fmt: skip
    json.dumps(facts)


def test_rows_that_are_not_finite_are_dropped_or_refused(tmp_path):
    raw = random_raw(levels=3, anchors=60)
    for table, row in (("anchors", 3), ("features", 11), ("offsets", 12), ("log_scales", 30)):
        getattr(raw, table)[row] = {"log_scales": 1000.0}.get(table, np.nan)
    raw.log_scales[40] = -np.inf  # a splat without size: legal, shows nothing
    folder = write_run(raw, tmp_path / "run")
    model = read_model(folder)
    assert len(model.anchors) == 56
    assert [(f.count, f.rows, f.done) for f in model.findings] == [(4, (3, 11, 12, 30), "dropped")]
    bad = [3, 11, 12, 30]
    kept = {
        name: np.delete(getattr(raw, name), bad, axis=0)
        for name in ("anchors", "features", "offsets", "log_scales")
    }
    levels = raw.levels | {n: np.delete(raw.levels[n], bad) for n in ("level", "extra_level")}
    with np.errstate(all="ignore"):
        compare(model, replace(raw, **kept, levels=levels), EYE, row=0)
    with pytest.raises(BadFile, match="--strict"):
        read_model(folder, Reading(strict=True))
    raw.anchors[:] = np.nan
    write_cloud(raw, folder / "point_cloud.ply")
    with pytest.raises(BadFile, match="not one of 60 anchors"):
        read_model(folder)


def test_one_number_more_is_said_to_be_the_distance(tmp_path):
    """An octree's networks may take the level or the distance; without settings nothing tells."""
    raw = random_raw(levels=3, distance=True)
    model = read_model(write_run(raw, tmp_path / "run"))
    assert [f.done for f in model.findings] == ["read as the distance"]
    compare(model, raw, EYE, row=0)


@pytest.mark.parametrize("most", [1, 3, 100, 150, 240, 1000])
def test_a_budget_keeps_coarse_levels_first(tmp_path, most):
    raw = random_raw(levels=4, anchors=80)
    folder = write_run(raw, tmp_path / "run")
    whole, model = read_model(folder), read_model(folder, Reading(most_splats=most))
    assert model.splat_count <= max(most, 3)
    counts = np.bincount(whole.octree.level.astype(int)) * 3
    if counts[0] <= most:
        kept = np.bincount(model.octree.level.astype(int)) * 3
        assert np.array_equal(kept, counts[: len(kept)])  # whole levels
        assert model.splat_count + (counts[len(kept)] if most < 240 else 0) > min(most, 239)
    else:
        assert model.splat_count == max(most // 3, 1) * 3
    assert bool(model.findings) == (most < 240)


@pytest.mark.parametrize("levels", [0, 3])
def test_far_from_zero_it_has_a_zero_of_its_own(tmp_path, levels):
    """At 4,000 km a float32 has steps of a quarter metre: eyes and anchors are told apart here."""
    raw, place = random_raw(levels=levels, distance=not levels), np.array([4e6, -2e6, 8e5])
    raw = replace(raw, anchors=np.round(raw.anchors * 8) / 2)  # what float32 can hold there
    near = read_model(write_run(raw, tmp_path / "near"))
    far = read_model(write_run(replace(raw, anchors=raw.anchors + place), tmp_path / "far"))
    assert near.origin == (0, 0, 0)
    moved = np.array(far.origin) - ours_from_file("-Y") @ place
    assert np.abs(moved).max() < 100
    np.testing.assert_allclose(far.anchors + moved, near.anchors, atol=1e-4)
    eye = np.array([0.5, 0.2, 3.0])
    one, other = evaluate(near, 0.0, eye), evaluate(far, 0.0, eye - moved)
    np.testing.assert_allclose(other.opacity, one.opacity, atol=1e-4)
    assert far.findings[0].what.startswith("the scene lies far from zero")


def test_a_budget_keeps_the_anchors_that_show(tmp_path):
    raw = random_raw(anchors=100)
    raw.log_scales[::2, 3:] = -9.0  # every second anchor's splats are tiny
    folder = write_run(raw, tmp_path / "run")
    model = read_model(folder, Reading(most_splats=100))
    assert model.splat_count == 99
    big = read_scaffold(folder, Reading()).anchors[1::2]
    assert {tuple(a) for a in model.anchors} <= {tuple(a) for a in big}


def test_the_evaluator_keeps_one_look(tmp_path):
    """Colours and geometry of one eye run the opacities once; another eye gives other splats."""
    evaluator = Evaluator(read_model(write_run(random_raw(), tmp_path / "run")))
    assert follows_eye(evaluator.model)
    one = [a.copy() for a in evaluator.geometry(0.0, eye=EYE)]
    look = evaluator._scaffold.look(EYE)  # kept to spare time alone: results are the same
    evaluator.color(0.0, EYE)
    assert evaluator._scaffold.look(EYE.copy()) is look
    other = evaluator.geometry(0.0, eye=-EYE)
    assert not np.array_equal(one[3], other[3])
    assert np.array_equal(one[0], other[0])  # places alone do not depend on the eye
    again = evaluator.geometry(0.5, eye=EYE)
    for a, b in zip(one, again, strict=True):
        assert np.array_equal(a, b)
    for eye in (None, [np.nan, 0, 0], [1.0, 2]):
        with pytest.raises(ValueError, match="the eye is"):
            evaluator.geometry(0.0, eye=eye)


def test_at_the_anchor_itself_there_is_no_direction():
    view = views_of(np.array([[1, 2, 3], [1, 2, 4]], np.float32), np.array([1.0, 2, 3]))
    assert view.tolist() == [[0, 0, 0, 0], [0, 0, 1, 1]]


def test_covariances_do_not_see_the_sign_of_a_quaternion(tmp_path):
    raw = random_raw(seed=9)
    model = read_model(write_run(raw, tmp_path / "run"))
    found, wanted = evaluate(model, 0.0, ours_from_file("-Y") @ EYE), decode_by_hand(raw, EYE)
    there = found.opacity > 0
    mine = covariance(found.scales[there], found.wxyz[there])
    signs = np.array([1, -1, -1, 1, 1, 1])  # of xx xy xz yy yz zz under half a turn about x
    theirs = covariance(wanted["scales"][there], wanted["wxyz"][there]) * signs
    np.testing.assert_allclose(mine, theirs, atol=1e-6)
