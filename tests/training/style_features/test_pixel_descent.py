"""Colours of a style, and pictures by turns of descent on their pixels."""

from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.training.style_features.named_styles import MADE_STYLES
from shapeshift.training.style_features.nnfm_pictures import nnfm_pictures
from shapeshift.training.style_features.pixel_descent import (
    DescentSettings,
    PixelDescent,
    color_transfer,
)
from shapeshift.training.styles.style_pictures import StyleView, Turns
from tests.support.training.onnx_files import tiny_vgg

RNG = np.random.default_rng


def colors(seed, count=500):
    """Correlated ones well inside 0..1, so that nothing is clipped."""
    mix = RNG(seed).uniform(0.2, 1, (3, 3))
    return 0.5 + 0.02 * (RNG(seed).normal(size=(count, 3)) @ mix)


def test_the_transfer_gives_mean_and_covariance_of_the_style():
    scene, style = colors(1), colors(2)
    moved = color_transfer(scene, style)(scene)
    np.testing.assert_allclose(moved.mean(axis=0), style.mean(axis=0), atol=1e-6)
    # 1e-5 is what is added to the variances
    np.testing.assert_allclose(np.cov(moved.T), np.cov(style.T), atol=2e-5)


def test_the_transfer_moves_colors_least():
    """The optimal map between normal distributions is symmetric with positive eigenvalues."""
    found = color_transfer(colors(1), colors(2)).matrix
    np.testing.assert_allclose(found, found.T, atol=1e-9)
    assert (np.linalg.eigvalsh(found) > 0).all()
    np.testing.assert_allclose(color_transfer(colors(1), colors(1)).matrix, np.eye(3), atol=1e-9)


def test_a_style_or_a_scene_of_one_color():
    flat = np.full((100, 3), 0.25)
    np.testing.assert_allclose(color_transfer(colors(1), flat)(colors(1)), 0.25, atol=0.05)
    assert np.isfinite(color_transfer(flat, colors(1))(flat)).all()


def view_of(number, shown, coverage=None, source=None):
    coverage = np.ones(shown.shape[:2], np.float32) if coverage is None else coverage
    return StyleView(number, None, shown if source is None else source, coverage, coverage, shown)


def squared(wanted):
    """A PictureLoss whose best picture is known."""

    def slope(picture):
        return float(((picture - wanted) ** 2).sum()), 2 * (picture - wanted)

    return SimpleNamespace(at=lambda view: slope)


def test_descent_reaches_a_known_picture_and_never_goes_up():
    wanted = RNG(1).uniform(0.2, 0.8, (8, 9, 3)).astype(np.float32)
    descent = PixelDescent(squared(wanted), settings=DescentSettings(descents=60, rate=0.1))
    (made,) = descent.make([view_of(0, np.full((8, 9, 3), 0.5, np.float32))], 0.5)
    ((before, after),) = descent.values
    assert after < 0.01 * before and abs(made - wanted).max() < 0.05
    assert made.dtype == np.float32


def test_what_is_not_covered_stays():
    shown = RNG(2).uniform(0.2, 0.8, (8, 9, 3)).astype(np.float32)
    coverage = np.zeros((8, 9), np.float32)
    coverage[2:4, 3:5] = 1
    descent = PixelDescent(squared(np.ones(3)), settings=DescentSettings())
    (made,) = descent.make([view_of(0, shown, coverage)], 0.5)
    assert (made[coverage == 0] == shown[coverage == 0]).all()
    assert (made[coverage == 1] > shown[coverage == 1]).all()
    (made,) = descent.make([view_of(0, shown, np.zeros((8, 9), np.float32))], 0.5)
    assert (made == shown).all()


def test_colors_come_first_and_from_all_views_alike():
    style = colors(5).reshape(50, 10, 3)
    descent = PixelDescent(squared(0.5), style, DescentSettings(colors_first=0.25))
    sources = [colors(s, 72).reshape(8, 9, 3).astype(np.float32) for s in (1, 2)]
    views = [view_of(i, source) for i, source in enumerate(sources)]
    made = descent.make(views, 0.0)
    moved = np.concatenate([m.reshape(-1, 3) for m in made])
    np.testing.assert_allclose(moved.mean(axis=0), style.reshape(-1, 3).mean(axis=0), atol=1e-5)
    assert not descent.values
    again = descent.make([view_of(7, sources[0])], 0.24)
    np.testing.assert_array_equal(again[0], made[0])
    descent.make(views, 0.25)
    assert len(descent.values) == 2


def test_views_that_show_nothing_have_no_colors_to_move():
    empty = np.zeros((8, 9), np.float32)
    descent = PixelDescent(squared(0.5), colors(5), DescentSettings())
    view = view_of(0, np.full((8, 9, 3), 0.1, np.float32), empty)
    assert np.isfinite(descent.make([view], 0.0)[0]).all() and descent.transfer is None


def test_turns_are_as_asked_and_the_same_seed_makes_the_same_pictures(tmp_path):
    vgg, style = tiny_vgg(tmp_path / "vgg.onnx"), MADE_STYLES["swirl"](32, 0)
    settings = DescentSettings(views=2, steps=7)
    runs = []
    for _ in range(2):
        made = nnfm_pictures(vgg, [style], settings=settings)
        assert made.turns == Turns(2, 7)
        views = [view_of(i, RNG(i).random((32, 40, 3)).astype(np.float32)) for i in range(2)]
        runs.append([*made.make(views, 0.0), *made.make(views, 0.5)])
        assert all(after < before for before, after in made.values)
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", MADE_STYLES)
def test_made_styles_are_pictures_of_our_own(name):
    draw = MADE_STYLES[name]
    picture = draw(64, 0)
    assert picture.shape == (64, 64, 3) and picture.dtype == np.float32
    assert picture.min() >= 0 and picture.max() <= 1 and picture.std() > 0.05
    np.testing.assert_array_equal(picture, draw(64, 0))
    assert abs(picture - draw(64, 1)).max() > 0.1
