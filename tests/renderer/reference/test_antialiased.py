"""Antialiased scenes (Mip-Splatting): the oracle by hand, tiles and counts by the oracle."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.debug.debug import object_poses
from shapeshift.renderer.debug.debug_map import classify
from shapeshift.renderer.reference import gate_object, reference_image
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.antialiased_scenes import (
    CASES,
    LIMITS,
    SCENES,
    check_eyes,
    check_frame,
    decoded_all,
    thin,
)
from tests.support.renderer.reference_reasons import (
    project_object,
    reference_counts,
    reference_reasons,
)
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    psnr_db,
    random_layers,
)

STRAIGHT = View(
    Pose(np.array([0, 0, 4.0]), np.array([1.0, 0, 0, 0])), (-0.25, 0.25, -0.25, 0.25), 0.05, 50,
    (64, 64),
)  # fmt: skip


def test_the_opacity_of_one_splat_is_what_the_formula_says():
    """A disc of s pixels: det is s^4, with 0.3 px^2 it is (s^2 + 0.3)^2."""
    for scale in (1e-4, 0.003, 0.01, 0.05, 0.2):
        model = replace(one_splat(scales=[[scale] * 3]), antialiased=True)
        _, _, covariance, opacity, _ = project_object(
            alone(model).objects[0], STRAIGHT, RenderSettings(min_alpha=1e-6), np.array([0, 0, 4])
        )
        pixels2 = (scale * 32) ** 2  # 64 pixels are 0.5 at 1 m, so 32 a metre at 4 m
        np.testing.assert_allclose(covariance[0], np.eye(2) * (pixels2 + 0.3), rtol=1e-6)
        np.testing.assert_allclose(opacity, 0.8 * pixels2 / (pixels2 + 0.3), rtol=1e-5)


def test_a_splat_gives_the_same_light_however_small_it_is():
    """The sum of alpha is opacity 2 pi sqrt(det): the low pass spreads it and adds none."""
    fine = RenderSettings(min_alpha=1e-6)
    for scale in ((0.02, 0.02, 0.02), (0.004, 0.03, 0.01), (0.05, 0.002, 0.02)):
        sums = {}
        for antialiased in (True, False):
            model = replace(one_splat(scales=[scale], opacity=[0.3]), antialiased=antialiased)
            sums[antialiased] = reference_image(alone(model), STRAIGHT, fine)[..., 3].sum()
        wanted = 0.3 * 2 * np.pi * (scale[0] * 32) * (scale[1] * 32)
        assert sums[True] == pytest.approx(wanted, rel=0.01)
        assert sums[False] > 1.2 * wanted


def test_what_the_filter_leaves_below_the_least_alpha_counts_as_faded():
    """The gate "opacity" asks the model's; extents and gates after it take what is left."""
    scales = [[1e-4] * 3, [0.05] * 3, [1e-4] * 3]
    model = replace(
        one_splat(
            means=[[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], scales=scales, opacity=[0.8, 0.8, 0.001],
            wxyz=[[1, 0, 0, 0]] * 3, sh=[[[1.0] * 3]] * 3,
        ),
        antialiased=True,
    )  # fmt: skip
    told = reference_counts(alone(model), STRAIGHT)
    assert told == dict(drawn=1, opacity=1, distance=0, frustum=0, size=0, footprint=0, faded=1)
    plain = reference_counts(alone(replace(model, antialiased=False)), STRAIGHT)
    assert (plain["drawn"], plain["faded"]) == (2, 0)


@pytest.mark.parametrize("name, limits", CASES)
def test_tiles_draw_and_count_as_the_oracle(renderer, name, limits):
    check_frame(renderer, name, limits, 80)


def test_the_filter_shows(renderer):
    """Without it the same splats are far too bright: what the flag is for."""
    scene, view = alone(thin(3000, 5)), front_view((160, 120))
    plain = alone(replace(scene.objects[0].model, antialiased=False))
    assert psnr_db(reference_image(scene, view), reference_image(plain, view)) < 25


@pytest.mark.parametrize("limits", ["none", "soft"])
def test_both_eyes_have_an_opacity_of_their_own(renderer, limits):
    check_eyes(renderer, limits, 80)


@pytest.mark.parametrize("name, limits", CASES)
def test_reasons_of_the_debug_pictures_are_the_oracle_s(renderer, name, limits):
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    renderer.settings = settings
    renderer.update(decoded_all(scene))
    renderer.update(scene)
    renderer.draw([view])
    points = renderer.drawing.splat_points()
    flags = tuple(obj.model.antialiased for obj in scene.objects)
    reason, _, _ = classify(points, object_poses(scene), view, settings, flags)
    off = np.count_nonzero(reason != reference_reasons(scene, view, settings))
    assert off <= (2 if name == "flat ones" else 0)


def test_a_plain_object_is_not_touched_by_its_neighbour(renderer):
    """Beside an antialiased object far away its picture is the same, bit for bit."""
    view, plain = front_view((160, 120)), random_layers(1003, 1)
    away = Pose(np.array([0, 0, 900.0]), np.array([1.0, 0, 0, 0]))
    images = []
    for antialiased in (False, True):
        beside = replace(thin(50), antialiased=antialiased)
        renderer.settings = RenderSettings()
        renderer.update(Scene((SceneObject("a", plain), SceneObject("b", beside, away))))
        renderer.draw([view])
        images.append(renderer.image().copy())
    np.testing.assert_array_equal(*images)


def test_files_say_it_and_the_scene_keeps_it(tmp_path):
    layers = thin(20)
    arrays = [getattr(layers, name) for name in ("means", "scales", "wxyz", "opacity", "sh")]
    plain = PlainSplats(*arrays, antialiased=True)
    write_ply(plain, tmp_path / "a.ply")
    write_spz(plain, tmp_path / "a.spz")
    text = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "mip.ply").write_bytes(text.replace(b"antialiased 1", b"SplatRenderMode: mip"))
    (tmp_path / "no.ply").write_bytes(text.replace(b"antialiased 1", b"SplatRenderMode: default"))
    for name, want in {"a.ply": True, "mip.ply": True, "no.ply": False, "a.spz": True}.items():
        assert read_plain(tmp_path / name).antialiased is want, name
        model = read_model(tmp_path / name, Reading())
        assert model.antialiased is want, name
        assert describe(model, tmp_path / name).get("antialiased", False) is want, name


def test_layers_that_differ_in_it_are_told_of(tmp_path):
    layers = thin(20)
    arrays = [getattr(layers, name) for name in ("means", "scales", "wxyz", "opacity", "sh")]
    for i, antialiased in enumerate((False, True)):
        write_ply(PlainSplats(*arrays, antialiased=antialiased), tmp_path / f"layer{i}.ply")
    model = read_model(tmp_path, Reading())
    assert model.antialiased
    assert model.findings[-1].done == "all are drawn so"


def test_the_oracle_does_not_stumble_over_what_is_flat():
    """A determinant of 0: all of it is faded away, nothing is not a number."""
    flat = replace(one_splat(scales=[[0.05, 0, 0]]), antialiased=True)
    found = gate_object(alone(flat).objects[0], STRAIGHT, RenderSettings(), np.array([0, 0, 4]))
    assert found.opacity[0] == pytest.approx(0, abs=1e-6)
    assert reference_counts(alone(flat), STRAIGHT)["faded"] == 1
