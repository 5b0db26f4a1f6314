"""Features of splats, AdaIN in 32 numbers, and the colours that come of it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.evaluation.evaluate import ModelRenderer
from shapeshift.training.style_features import splat_features as carrying
from shapeshift.training.style_features.splat_features import (
    NUMBERS,
    StyleFeatures,
    StylePreview,
    adain,
    all_colors,
    bilinear,
    carry_features,
    draw_preview,
    recolor_rule,
    reduced,
    style_features,
    styled_colors,
    visible,
)
from shapeshift.training.styles.train_stop import dome_views
from tests.support.new_stops import framed_model
from tests.support.training.onnx_files import tiny_vgg

RNG = np.random.default_rng
GREY = (0.1, 0.1, 0.1)


@pytest.fixture(scope="module")
def scene():
    """Splats with NUMBERS features, which the principal axes keep whole."""
    means = RNG(0).normal(size=(300, 3)).astype(np.float32)
    rows = np.arange(0, 300, 2)
    features = RNG(1).normal(size=(150, NUMBERS)) @ RNG(2).normal(size=(NUMBERS, NUMBERS)) + 3
    return reduced(rows, means, features.astype(np.float32), RNG(3).random((150, 3)))


def test_all_numbers_are_kept_where_there_are_no_more(scene):
    features = RNG(1).normal(size=(150, NUMBERS)) @ RNG(2).normal(size=(NUMBERS, NUMBERS)) + 3
    np.testing.assert_allclose(scene.low @ scene.axes + scene.center, features, atol=1e-3)
    np.testing.assert_allclose(scene.axes @ scene.axes.T, np.eye(NUMBERS), atol=1e-5)
    spread = scene.low.std(axis=0)
    assert (np.diff(spread) <= 1e-3).all()  # the first axis is the longest
    assert (scene.neighbours[:, 0] == np.arange(150)).all()
    assert (scene.nearest[scene.rows] == np.arange(150)).all()


def test_adain_in_the_axes_is_the_papers_formula_in_the_features(scene):
    """f^t = sigma(F^s) (f - mu) / sigma + mu(F^s), 3SGS 2.2."""
    means, deviations = RNG(4).normal(size=NUMBERS), RNG(5).random(NUMBERS) + 0.5
    style = StyleFeatures(np.zeros((1, NUMBERS)), np.zeros((1, 3)), means, deviations)
    features = scene.low.astype(np.float64) @ scene.axes + scene.center
    wanted = deviations * (features - features.mean(0)) / features.std(0) + means
    found = adain(scene, style) @ scene.axes + scene.center
    np.testing.assert_allclose(found, wanted, atol=5e-3)  # 0.001 is added to deviations


def places(scene, colors):
    """A style whose features are the scene's own, with other colours."""
    features = scene.low @ scene.axes + scene.center
    return StyleFeatures(scene.low, colors, features.mean(axis=0), features.std(axis=0))


def test_a_style_with_the_scenes_own_features_gives_each_splat_its_place(scene):
    own = places(scene, RNG(6).random((150, 3)))
    found = styled_colors(replace(scene, neighbours=np.arange(150)[:, None]), own)
    np.testing.assert_allclose(found, own.colors, atol=1e-6)


def test_strength_goes_from_the_own_colours_to_the_styles(scene):
    style = places(scene, np.full((150, 3), 0.25))
    np.testing.assert_allclose(styled_colors(scene, style, 0.0), scene.colors, atol=1e-6)
    np.testing.assert_allclose(styled_colors(scene, style, 1.0), 0.25, atol=1e-6)
    half = (scene.colors + 0.25) / 2
    np.testing.assert_allclose(styled_colors(scene, style, 0.5), half, atol=1e-6)


def test_the_same_seed_picks_the_same_places(scene, monkeypatch):
    monkeypatch.setattr("shapeshift.training.style_features.splat_features.PLACES", 10)
    style = places(scene, RNG(6).random((150, 3)))
    first, again, other = (styled_colors(scene, style, seed=s) for s in (0, 0, 1))
    assert (first == again).all() and (first != other).any()


def test_what_no_view_sees_takes_the_nearest_colour(scene):
    colors = RNG(7).random((150, 3))
    every = all_colors(scene, colors)
    np.testing.assert_array_equal(every[scene.rows], colors)
    assert every.shape == (300, 3) and (every[1::2, None] == colors).all(axis=2).any(axis=1).all()


def test_bilinear_is_exact_on_a_plane_and_held_at_the_border():
    down, across = np.mgrid[:9, :12] + 0.5
    image = np.stack([across, down, 2 * across - down], axis=2)
    u, v = RNG(0).uniform(0.5, 11.5, 50), RNG(1).uniform(0.5, 8.5, 50)
    wanted = np.stack([u, v, 2 * u - v], axis=1)
    np.testing.assert_allclose(bilinear(image, u, v), wanted, atol=2e-3)
    np.testing.assert_allclose(bilinear(image, np.array([-5.0]), np.array([99.0])),
                               [[0.5, 8.5, -7.5]], atol=2e-3)  # fmt: skip


def test_what_lies_behind_or_outside_is_not_seen():
    view = dome_views(framed_model(50), 1, (64, 48))[0]
    camera, *_ = view.pinhole()
    inverse = np.linalg.inv(camera)
    at = np.array([[0, 0, 2.0], [0, 0, 2.02], [0, 0, 2.1], [0, 0, -2], [50, 0, 2], [0, 0, 1.9]])
    points = at @ inverse[:3, :3].T + inverse[:3, 3]
    u, v, seen = visible(points, view, np.full((48, 64), 2.0))
    assert seen.tolist() == [0, 1]  # 1 % behind what is seen still is, 5 % before or behind is not
    assert (u[0], v[0]) == pytest.approx((32, 24), abs=0.5)


@pytest.fixture(scope="module")
def carried(tmp_path_factory, device):
    """A small scene that a small VGG has looked at."""
    model = framed_model(200)
    vgg = tiny_vgg(tmp_path_factory.mktemp("vgg") / "vgg.onnx", channels=(4, 24, 24))
    views = dome_views(model, 5, (96, 72))
    return model, vgg, carry_features(device, model, 0.0, vgg, views, GREY)


def test_features_and_colours_of_a_scene(carried, device):
    model, vgg, scene = carried
    assert 100 < len(scene.rows) <= model.splat_count and scene.axes.shape == (NUMBERS, 48)
    assert np.isfinite(scene.low).all() and scene.low.std(axis=0)[0] > 0
    style = style_features(vgg, RNG(0).random((40, 50, 3)).astype(np.float32), scene)
    assert style.low.shape == (10 * 12, NUMBERS) and style.colors.shape == (120, 3)
    colors = all_colors(scene, styled_colors(scene, style))
    assert colors.shape == (model.splat_count, 3)
    assert 0.2 < colors.min() and colors.max() < 0.8  # means of 16 pixels, of 8 neighbours


def test_a_thumbnail_with_the_own_colours_is_the_renderers_picture(carried, device):
    model, _, _ = carried
    view = dome_views(model, 3, (64, 48))[1]
    renderer = ModelRenderer(device, model)
    renderer.set_control(0.0)
    wanted = np.clip(renderer.picture(view, GREY), 0, 1)
    own = renderer.evaluator.color(0.0, view.world_from_eye.position)
    np.testing.assert_array_equal(draw_preview(device, renderer, own, view, GREY), wanted)


def test_a_preview_of_a_stop_by_its_name(carried, device):
    model, vgg, scene = carried
    views = dome_views(model, 5, (96, 72))
    preview = StylePreview(device, model, "RGB", vgg, views, GREY)
    np.testing.assert_array_equal(preview.scene.low, scene.low)
    picture = np.full((24, 24, 3), 0.75, np.float32)
    colors = preview.colors(picture)
    np.testing.assert_allclose(colors, 0.75, atol=1e-6)
    np.testing.assert_allclose(preview.colors(picture, 0.0), all_colors(scene, scene.colors))
    shown = preview.draw(colors, views[0])
    assert shown.shape == (72, 96, 3) and 0.4 < shown.max() <= 0.7501
    splats = evaluate(model, 0.0, np.array([0.3, 0.5, 2.0]))
    made = recolor_rule(colors)(splats, None)
    there = splats.opacity > 0
    np.testing.assert_array_equal(made.color[there], colors[there])
    np.testing.assert_array_equal(made.color[~there], splats.color[~there])
    assert made.means is splats.means and made.opacity is splats.opacity


def test_views_that_see_nothing(carried, device, monkeypatch):
    model, vgg, _ = carried
    monkeypatch.setattr(carrying, "NEAR", -1.0)
    with pytest.raises(BadFile, match="see next to nothing of the scene"):
        carry_features(device, model, 0.0, vgg, dome_views(model, 1, (64, 48)), GREY)
