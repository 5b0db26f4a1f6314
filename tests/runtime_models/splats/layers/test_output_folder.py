"""Run folders and thermal pairs: the layouts that trainers write, and names that say thermal."""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, files_of, read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.read_output_folder import newest_cloud, thermal_pair
from shapeshift.runtime_models.stop_names import guess_kind, is_thermal_name
from tests.support.splats.layer_folders import put, splats, with_thermal_harmonics

PAIRS = [
    ("point_cloud_color/iteration_900/point_cloud.ply",
     "point_cloud_thermal/iteration_900/point_cloud.ply"),
    ("point_cloud.ply", "thermal_point_cloud.ply"),
    ("rgb.ply", "ir.ply"),
    ("rgb/a.ply", "thermal/b.ply"),
    ("rgb/point_cloud/iteration_7/point_cloud.ply",
     "LWIR/point_cloud/iteration_7/point_cloud.ply"),
    ("visible/ply/point_cloud_6999.ply", "flir boson/ply/point_cloud_29999.ply"),
]  # fmt: skip


@pytest.mark.parametrize(("color", "thermal"), PAIRS)
def test_a_colour_and_a_thermal_cloud_become_two_stops(tmp_path, color, thermal):
    put(tmp_path / color, 3), put(tmp_path / thermal, 5, coefficients=9)
    model = read_model(tmp_path)
    assert [(s.name, s.x, s.kind) for s in model.stops] == [
        ("RGB", 0.0, "rgb"), ("Thermal", 1.0, "thermal"),
    ]  # fmt: skip
    assert model.mode == "exclusive" and np.bincount(model.layer).tolist() == [3, 5]
    np.testing.assert_array_equal(model.weights(0.25), np.array([0.75, 0.25], np.float32))
    alone = read_plain(tmp_path / thermal)
    np.testing.assert_array_equal(model.means[3:], alone.means)
    np.testing.assert_array_equal(model.sh[3:], alone.sh)
    sizes = sum((tmp_path / name).stat().st_size for name in (color, thermal))
    assert describe(model, tmp_path)["bytes"] == sizes


def test_the_user_has_the_last_word_on_the_mode(tmp_path):
    put(tmp_path / "rgb.ply", 2), put(tmp_path / "thermal.ply", 2)
    assert read_model(tmp_path, Reading("cumulative")).mode == "cumulative"
    assert read_model(tmp_path, Reading("exclusive")).mode == "exclusive"


@pytest.mark.parametrize(
    "names",
    [("a.ply", "b.ply"), ("thermal1.ply", "thermal2.ply"), ("rgb.ply", "thermal.ply", "x.ply")],
)
def test_other_plies_stay_layers_that_add_up(tmp_path, names):
    for name in names:
        put(tmp_path / name, 2)
    assert thermal_pair(tmp_path) is None
    model = read_model(tmp_path)
    assert model.mode == "cumulative"
    assert [s.name for s in model.stops] == sorted(name[:-4] for name in names)


def test_the_newest_cloud_of_a_run_is_opened_and_its_points_are_not(tmp_path):
    run = tmp_path / "my run é"
    for number, count in (("7000", 2), ("30000", 4), ("best", 6), ("9000", 8)):
        put(run / f"point_cloud/iteration_{number}/point_cloud.ply", count)
    (run / "input.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n")
    (run / "cameras.json").write_text("[]")
    model = read_model(run)
    assert model.splat_count == 4 and [s.name for s in model.stops] == ["my run é"]
    assert describe(model, run)["step"] == "30000"
    assert [f.what for f in model.findings] == ["its run has splats of steps 7000, 9000 as well"]
    (file,) = files_of(model, run)
    assert file == newest_cloud(run) == run / "point_cloud/iteration_30000/point_cloud.ply"


@pytest.mark.parametrize("folder, form", [
    ("point_cloud", "iteration_{}/point_cloud.ply"), ("ply", "point_cloud_{}.ply"),
])  # fmt: skip
def test_the_folder_of_a_run_s_clouds_is_opened_at_its_newest(tmp_path, folder, form):
    """Not as layers.  Of many steps the last few are named."""
    for step in range(0, 80, 10):
        put(tmp_path / folder / form.format(step), 2 + step)
    model = read_model(tmp_path / folder)
    assert model.splat_count == 72 and model.findings[0].done == "70 is read"
    assert "of steps 2 more and 20, 30, 40, 50, 60 as well" in model.findings[0].what


def test_clouds_of_a_pair_of_different_steps_are_said(tmp_path):
    put(tmp_path / "point_cloud_color/iteration_9/point_cloud.ply", 3)
    put(tmp_path / "point_cloud_thermal/iteration_7/point_cloud.ply", 3)
    model = read_model(tmp_path)
    assert describe(model, tmp_path)["step"] == "9 and 7"
    assert model.findings[-1].what == "its two clouds are of steps 9 and 7"


def test_one_half_of_a_thermal_run_opens_alone(tmp_path):
    put(tmp_path / "point_cloud_thermal/iteration_1/point_cloud.ply", 3)
    model = read_model(tmp_path)
    assert model.splat_count == 3 and len(model.stops) == 1


@pytest.mark.parametrize("coefficients", [1, 4, 16])
def test_thermal_harmonics_in_one_ply_become_a_second_stop(tmp_path, coefficients):
    path = tmp_path / "point_cloud.ply"
    thermal = with_thermal_harmonics(path, 7, coefficients)
    model = read_model(path)
    assert [s.kind for s in model.stops] == ["rgb", "thermal"] and model.mode == "exclusive"
    color, other = model.layer == 0, model.layer == 1
    for name in ("means", "scales", "wxyz", "opacity"):
        array = getattr(model, name)
        np.testing.assert_array_equal(array[color], array[other])
    # The twin of the turn: the same numbers filed as a cloud of their own.
    twin = splats(7, 1, coefficients)
    signs = read_file_sh(tmp_path, twin, thermal)
    np.testing.assert_allclose(model.sh[other], signs, atol=1e-6)
    assert not np.allclose(model.sh[other], model.sh[color])
    assert "t_dc_0" not in model.extra


def read_file_sh(folder: Path, twin: PlainSplats, thermal: np.ndarray) -> np.ndarray:
    """Our harmonics of a PLY whose own ones, in its axes, are `thermal`."""
    from dataclasses import replace

    from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_half_turn

    write_ply(rotate_half_turn(replace(twin, sh=thermal)), folder / "twin.ply")
    return read_plain(folder / "twin.ply").sh


def test_thermal_harmonics_of_an_odd_number_are_refused(tmp_path):
    path = tmp_path / "a.ply"
    with_thermal_harmonics(path, 2)
    path.write_bytes(path.read_bytes().replace(b"t_rest_8", b"t_xest_8"))
    with pytest.raises(BadFile, match="3, 12, 27 or 48"):
        read_model(path)


@pytest.mark.parametrize(
    ("name", "thermal"),
    [("thermal", True), ("Thermo_01", True), ("LWIR", True), ("ir", True), ("scan-IR.ply", True),
     ("flir", True), ("infrared", True), ("chair.ply", False), ("first", False), ("rgb", False),
     ("air", False), ("point_cloud.ply", False)],
)  # fmt: skip
def test_names_that_say_thermal(name, thermal):
    assert is_thermal_name(name) == thermal
    assert (guess_kind(name, 2) == "thermal") == thermal
