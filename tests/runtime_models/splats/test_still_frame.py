"""Splats that move in time (SpacetimeGaussians' PLY): shown still, at time 0, and said so."""

import math

import numpy as np
import pytest

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.ply.read_ply import read_raw_ply
from shapeshift.runtime_models.splats.still_frame import still
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


@pytest.mark.parametrize("encoding", ["binary_little_endian", "ascii"])
def test_every_splat_is_where_it_is_at_time_0(tmp_path, encoding):
    rows = moving_rows(30)
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows, encoding=encoding), Reading())
    for i, row in enumerate(rows):
        for name, wanted in by_hand(row, 0.0).items():
            np.testing.assert_allclose(getattr(raw, name)[i], wanted, rtol=2e-5, atol=2e-5)
        colour = [row[f"f_dc_{c}"] for c in range(3)]  # 0..1, no harmonic
        np.testing.assert_allclose(0.5 + C0 * raw.sh[i, 0], colour, atol=1e-5)
    assert not raw.logits and not raw.extra
    (finding,) = raw.findings
    assert finding.what == "30 splats that move in time" and not finding.repaired
    assert finding.done == "shown still, at time 0 of 0 to 1"


def test_harmonics_stay_and_a_network_of_colours_is_left_out(tmp_path):
    rows = moving_rows(4, coefficients=4)
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    assert raw.sh.shape[1] == 4 and raw.sh[0, 0, 0] == np.float32(rows[0]["f_dc_0"])
    rows = moving_rows(4, ("f_dc_3", "f_dc_4", "f_dc_5", "f_t_0", "f_t_1", "f_t_2"))
    raw = read_raw_ply(write_rows(tmp_path / "b.ply", rows), Reading())
    assert raw.findings[0].done.endswith("without its network of colours") and not raw.extra


def test_some_of_the_columns_are_told_and_kept(tmp_path):
    rows = random_rows(4, [*names_of(1), "motion_0", "motion_1"])
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", rows), Reading())
    assert "but not all of them" in raw.findings[0].what and len(raw.extra) == 2
    assert raw.findings[0].done == "shown as they are filed, all times at once"


def test_a_scene_that_moves_opens_in_strict_too(tmp_path):
    """Nothing was repaired."""
    rng = np.random.default_rng(0)
    rows = [row | {"trbf_scale": 1.0, "trbf_center": 0.0} for row in moving_rows(200)]
    for row in rows:
        row.update({f"scale_{i}": -6 + float(rng.normal()) for i in range(3)})
    model = read_model(write_rows(tmp_path / "a.ply", rows), Reading(strict=True))
    assert model.splat_count == 200 and "move in time" in model.findings[0].what


def test_what_does_not_move_is_left_as_it_is(tmp_path):
    raw = read_raw_ply(write_rows(tmp_path / "a.ply", random_rows(3, names_of(1))), Reading())
    assert still(raw, 0.0) is raw and not raw.findings
