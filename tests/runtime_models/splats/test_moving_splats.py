"""Splats that move in time (SpacetimeGaussians' PLY): opened as time, exact at every x."""

import math

import numpy as np
import pytest

from shapeshift.runtime_models.bake import bake
from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.rotation import rotation_matrices
from shapeshift.runtime_models.splats.moving_splats import with_motion_columns
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply
from tests.support.splats.ply_files import names_of, random_rows, write_rows

MOVING = [
    "trbf_center", "trbf_scale", *(f"motion_{i}" for i in range(9)),
    *(f"omega_{i}" for i in range(4)),
]  # fmt: skip


def moving_rows(count: int, more: tuple[str, ...] = (), coefficients: int = 1) -> list[dict]:
    return random_rows(count, [*names_of(coefficients), *MOVING, *more])


def by_hand(row: dict, t: float) -> dict:
    """Li et al. 2024, equations 5 to 8, number by number."""
    since = t - row["trbf_center"]
    place = [
        row["xyz"[axis]] + sum(row[f"motion_{3 * n + axis}"] * since ** (n + 1) for n in range(3))
        for axis in range(3)
    ]
    fade = math.exp(-((since / math.exp(row["trbf_scale"])) ** 2))
    return {
        "means": place,
        "wxyz": [row[f"rot_{i}"] + row[f"omega_{i}"] * since for i in range(4)],
        "opacity": fade / (1 + math.exp(-row["opacity"])),
    }


def whole_rows(count: int, coefficients: int = 1) -> list[dict]:
    """As a recording has them: of centimetres, seen for a tenth of the time and more."""
    rng = np.random.default_rng(count)
    rows = moving_rows(count, coefficients=coefficients)
    for row in rows:
        row.update({f"scale_{i}": -5 + 0.3 * float(rng.normal()) for i in range(3)})
        row.update(trbf_center=float(rng.random()), trbf_scale=float(rng.uniform(-2.3, 1)))
        row.update({f"motion_{i}": 0.3 * float(rng.normal()) for i in range(9)})
    return rows


@pytest.mark.parametrize("encoding", ["binary_little_endian", "ascii"])
@pytest.mark.parametrize("x", [0.0, 0.37, 1.0])
def test_every_splat_is_where_it_is_at_any_time(tmp_path, encoding, x):
    """By hand in float64; the file's y points down and its z away, ours up and near."""
    rows = whole_rows(40)
    model = read_model(write_rows(tmp_path / "a.ply", rows, encoding=encoding), Reading())
    assert [(stop.name, stop.x) for stop in model.stops] == [("Start", 0.0), ("End", 1.0)]
    assert not model.extra and not model.findings
    shown = evaluate(model, x, np.array([0.0, 0.0, 9.0]))
    ours = np.diag([1.0, -1.0, -1.0])
    for i, row in enumerate(rows):
        wanted = by_hand(row, x)
        np.testing.assert_allclose(shown.means[i], ours @ wanted["means"], rtol=2e-6, atol=2e-6)
        np.testing.assert_allclose(shown.opacity[i], wanted["opacity"], rtol=2e-5, atol=1e-7)
        turn = rotation_matrices(np.array([wanted["wxyz"]]) / np.linalg.norm(wanted["wxyz"]))[0]
        found = rotation_matrices(shown.wxyz[i : i + 1].astype(np.float64))[0]
        np.testing.assert_allclose(found, ours @ turn, atol=2e-5)
        colour = [row[f"f_dc_{c}"] for c in range(3)]  # 0..1, no harmonic
        np.testing.assert_allclose(0.5 + C0 * model.sh[i, 0], colour, atol=1e-5)


def test_splats_may_have_times_of_their_own(tmp_path):
    model = read_model(write_rows(tmp_path / "a.ply", whole_rows(5)), Reading())
    xs = np.linspace(0, 1, 5).astype(np.float32)
    each = evaluate(model, xs, np.zeros(3))
    for i, x in enumerate(xs):
        one = evaluate(model, float(x), np.zeros(3))
        np.testing.assert_allclose(each.means[i], one.means[i], atol=1e-6)
        np.testing.assert_allclose(each.opacity[i], one.opacity[i], atol=1e-6)


def test_rows_up_and_exports_keep_the_motion(tmp_path):
    path = write_rows(tmp_path / "a.ply", whole_rows(30))
    model, turned = read_model(path, Reading()), read_model(path, Reading(up="+Z"))
    picked = model.with_rows(np.array([7, 3]))
    eye, ours = np.zeros(3), np.diag([1.0, -1.0, -1.0])
    z_up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    at = evaluate(model, 0.8, eye).means
    np.testing.assert_array_equal(evaluate(picked, 0.8, eye).means, at[[7, 3]])
    np.testing.assert_allclose(evaluate(turned, 0.8, eye).means, at @ ours.T @ z_up.T, atol=1e-6)
    baked = bake(model, 0.8)
    there = evaluate(model, 0.8, eye).opacity >= 1 / 255
    assert baked.motion is None and 0 < there.sum() < 30
    np.testing.assert_allclose(baked.means, at[there], atol=1e-6)
    assert describe(model, path)["stops"][1]["name"] == "End"


def test_harmonics_stay_and_a_network_of_colours_is_refused(tmp_path):
    rows = moving_rows(4, coefficients=4)
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    assert raw.sh.shape[1] == 4 and raw.sh[0, 0, 0] == np.float32(rows[0]["f_dc_0"])
    rows = moving_rows(4, ("f_dc_3", "f_dc_4", "f_dc_5", "f_t_0", "f_t_1", "f_t_2"))
    with pytest.raises(BadFile, match="a network makes the colours"):
        read_model(write_rows(tmp_path / "b.ply", rows), Reading())


BROKEN = [
    ("motion_4", math.nan), ("motion_0", math.inf), ("trbf_center", math.nan),
    ("trbf_center", 1e30), ("trbf_scale", math.nan), ("omega_2", -math.inf), ("motion_8", 1e12),
]  # fmt: skip
ODD = [  # legal: seen at its centre alone, and always
    ("trbf_scale", -math.inf), ("trbf_scale", -1e30), ("trbf_scale", math.inf),
    ("trbf_scale", 1e30), ("trbf_center", -40.0), ("omega_0", 0.0),
]  # fmt: skip


def test_motions_that_are_not_finite_go_and_odd_ones_stay_finite(tmp_path):
    rows = whole_rows(len(BROKEN) + len(ODD) + 3)
    for row, (name, value) in zip(rows, [*BROKEN, *ODD], strict=False):
        row[name] = value
    model = read_model(write_rows(tmp_path / "a.ply", rows), Reading())
    assert model.splat_count == len(ODD) + 3
    (finding,) = model.findings
    assert finding.what == "7 splats with a motion that is not finite" and finding.repaired
    for x in (0.0, 0.5, 1.0):
        shown = evaluate(model, x, np.zeros(3))
        for values in (shown.means, shown.wxyz, shown.opacity):
            assert np.isfinite(values).all()
    with pytest.raises(BadFile, match="--strict repairs nothing"):
        read_model(tmp_path / "a.ply", Reading(strict=True))


@pytest.mark.parametrize("count", [1, 2])
def test_a_file_of_none_but_broken_motions_is_one_sentence(tmp_path, count):
    rows = moving_rows(count)
    for row in rows:
        row["trbf_scale"] = math.nan
    with pytest.raises(BadFile, match=rf"a\.ply: not one of {count} splats? can be drawn, as "):
        read_model(write_rows(tmp_path / "a.ply", rows), Reading())


def test_a_quaternion_that_passes_zero_is_one_of_length_1(tmp_path):
    rows = whole_rows(2)
    rows[0].update(rot_0=1.0, rot_1=0.0, rot_2=0.0, rot_3=0.0, omega_0=-2.0, omega_1=0.0,
                   omega_2=0.0, omega_3=0.0, trbf_center=0.0)  # fmt: skip
    model = read_model(write_rows(tmp_path / "a.ply", rows), Reading())
    np.testing.assert_allclose(np.linalg.norm(evaluate(model, 0.5, np.zeros(3)).wxyz, axis=1), 1)


def test_some_of_the_columns_are_told_and_kept(tmp_path):
    rows = random_rows(4, [*names_of(1), "motion_0", "motion_1"])
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    assert "but not all of them" in raw.findings[0].what and len(raw.extra) == 2
    assert raw.findings[0].done == "shown as they are filed, all times at once"


def test_several_files_that_move_are_layers_that_stand(tmp_path):
    for name in ("layer0.ply", "layer1.ply"):
        write_rows(tmp_path / name, whole_rows(6))
    model = read_model(tmp_path, Reading())
    assert model.motion is None and len(model.stops) == 2
    alone = read_model(tmp_path / "layer0.ply", Reading())
    np.testing.assert_allclose(model.means[:6], evaluate(alone, 0.0, np.zeros(3)).means, atol=1e-6)
    assert "shown still, at time 0" in model.findings[0].done


def test_what_does_not_move_is_left_as_it_is(tmp_path):
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", random_rows(3, names_of(1))), Reading())
    assert with_motion_columns(raw) is raw and not raw.findings
