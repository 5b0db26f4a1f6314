"""Which anchors a lasso, a sphere, a colour, a histogram and the search for floaters mean."""

import time

import numpy as np
import pytest
from matplotlib.path import Path as Outline

from shapeshift.app.editor.state.parts.finder import in_box
from shapeshift.app.editor.state.parts.parts_lit import (
    BINS,
    BRIGHTNESS,
    DISTANCE,
    OPACITY,
    QUANTITIES,
    SIZE,
    AnchorNumbers,
    anchor_numbers,
    histogram_of,
    oklab,
)
from shapeshift.app.editor.state.parts.selecting import floaters, in_lasso, in_sphere, polygon_mask
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import SceneObject
from tests.support.desktop.desktop_stand import ball
from tests.support.splat_scenes import front_view, random_model

VIEW = front_view((90, 60), distance=3.0)
SHAPES = {
    "triangle": [(10.2, 5.1), (80.4, 20.3), (30.7, 55.9)],
    "star, which crosses itself": [(45, 2), (62, 55), (8, 22), (82, 22), (28, 55)],
    "beyond all edges": [(-200, -100), (300, -50), (200, 300), (-90, 250)],
    "two corners": [(3, 3), (50, 50)],
    "turned the other way": [(10, 10), (10, 50), (70, 50), (70, 10)],
}


@pytest.mark.parametrize("name", SHAPES)
def test_the_mask_of_a_lasso_is_what_matplotlib_says(name):
    """Its Path is by another hand; it counts turns, so a star's middle is the even-odd rule's."""
    outline = np.array(SHAPES[name], float)
    mask = polygon_mask(outline, (90, 60))
    middles = np.stack(np.meshgrid(np.arange(90) + 0.5, np.arange(60) + 0.5), -1).reshape(-1, 2)
    if "star" in name:  # once around, not twice
        assert not mask[30, 45] and mask[8, 45]
        return
    expected = Outline(outline).contains_points(middles).reshape(60, 90)
    wrong = mask != expected
    assert wrong.sum() <= 2 * len(outline)  # middles that lie on the very line


def test_a_rectangular_lasso_is_a_box():
    rng = np.random.default_rng(0)
    places = rng.normal(size=(5000, 3)) * 2
    places[:3] = np.nan, np.inf, -np.inf
    obj = SceneObject("a", ball(10), Pose(np.array([0.3, 0, 0]), np.array([1.0, 0, 0, 0])))
    box = (20, 10, 70, 45)
    outline = np.array([(20, 10), (70, 10), (70, 45), (20, 45)], float)
    lasso, exact = in_lasso(VIEW, places, obj, outline), in_box(VIEW, places, obj, box)
    assert 300 < exact.sum() < 4000 and not lasso[:3].any()
    assert np.count_nonzero(lasso != exact) <= 2  # float32 at the very edge
    assert not in_lasso(VIEW, places, obj, outline[:1]).any()
    assert not in_lasso(VIEW, np.zeros((0, 3)), obj, outline).any()


def test_a_sphere_is_a_distance():
    places = np.array([[0, 0, 0], [0.5, 0, 0], [0.5001, 0, 0], [np.nan, 0, 0]])
    assert in_sphere(places, np.zeros(3), 0.5).tolist() == [True, True, False, False]


def test_oklab_of_known_colours():
    """By the table of B. Ottosson's page: red is 0.62796, 0.22486, 0.12585."""
    known = oklab(np.array([[1, 1, 1], [0, 0, 0], [1, 0, 0], [np.nan, 0, 0]]))
    expected = [[1, 0, 0], [0, 0, 0], [0.62796, 0.22486, 0.12585], [0, 0, 0]]
    np.testing.assert_allclose(known, expected, atol=2e-4)


def test_numbers_of_anchors_are_those_of_their_splats():
    model, eye, x = random_model(40, per_anchor=5), np.array([0.0, 0, 4]), 0.3
    numbers, splats = anchor_numbers(model, x, eye), evaluate(model, x, eye)
    opacity = splats.opacity.reshape(40, 5)
    there = opacity > 0
    np.testing.assert_allclose(numbers.opacity, opacity.max(axis=1).clip(0), atol=1e-5)
    largest = np.where(there, splats.scales.max(axis=1).reshape(40, 5), 0).max(axis=1)
    np.testing.assert_allclose(numbers.size, largest, rtol=1e-4)
    one = np.flatnonzero(there.sum(axis=1) == 1)  # its colour is that of the one
    color = splats.color.reshape(40, 5, 3)[there & (there.sum(axis=1) == 1)[:, None]]
    np.testing.assert_allclose(numbers.oklab[one], oklab(color), atol=1e-3)


def numbers_of(size=None, opacity=None, places=None, count: int = 1000) -> AnchorNumbers:
    rng = np.random.default_rng(1)
    places = rng.normal(size=(count, 3)) if places is None else places
    size = np.exp(rng.normal(size=len(places)) - 4) if size is None else size
    opacity = rng.uniform(0, 1, len(places)) if opacity is None else opacity
    lab = oklab(rng.uniform(0, 1, (len(places), 3)))
    arrays = (np.asarray(a, np.float32) for a in (places, size, opacity, lab))
    return AnchorNumbers(ball(4), 0.0, *arrays)


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_histogram_counts_every_anchor_once(name):
    numbers = numbers_of()
    histogram = histogram_of(numbers, name)
    assert histogram.counts.sum() == 1000 and histogram.rows(0, BINS - 1).all()
    inner = histogram.edges.copy()
    inner[0], inner[-1] = -np.inf, np.inf
    expected, _ = np.histogram(numbers.quantity(name).astype(float), inner)
    assert np.abs(histogram.counts - expected).sum() <= 6  # float32 at an edge
    some = numbers.quantity(name) > np.median(numbers.quantity(name))
    assert histogram.counts_of(some).sum() == some.sum()
    upper = histogram.rows(BINS - 1, BINS // 2)  # from either side
    assert (numbers.quantity(name)[upper] >= 0.999 * histogram.edges[BINS // 2]).all()


def test_a_histogram_of_what_is_no_number_or_all_the_same():
    broken = numbers_of(size=np.array([np.nan, np.inf, 0.0, 0.01, 0.02] * 2), count=10)
    histogram = histogram_of(broken, SIZE)
    assert histogram.counts.sum() == 4 and not histogram.rows(0, BINS - 1)[:3].any()
    flat = numbers_of(size=np.full(10, 0.5), count=10)
    assert histogram_of(flat, SIZE).counts.sum() == 10
    for name in (OPACITY, BRIGHTNESS):
        ends = histogram_of(flat, name).edges
        assert (ends[0], ends[-1]) == (0.0, 1.0)
    empty = numbers_of(places=np.zeros((0, 3)))
    assert not histogram_of(empty, DISTANCE).counts.any()


def test_planted_floaters_are_found_and_little_else():
    """On a surface with a coarse far part: small groups in the air, and huge faint splats."""
    rng = np.random.default_rng(2)
    plane = np.c_[rng.uniform(-1, 1, (6000, 2)), rng.normal(size=6000) * 0.005]
    far = np.c_[rng.uniform(-6, 6, (700, 2)), np.full(700, -3.0)]  # large splats, far apart
    groups = np.repeat(rng.uniform((-1, -1, 0.4), (1, 1, 1.5), (40, 3)), 3, axis=0)
    groups += rng.normal(size=groups.shape) * 0.01
    haze = rng.uniform((-1, -1, 0.3), (1, 1, 1.5), (30, 3))
    places = np.concatenate([plane, far, groups, haze])
    size = np.repeat([0.01, 0.35, 0.01, 0.2], [6000, 700, 120, 30])
    opacity = np.repeat([0.9, 0.9, 0.5, 0.1], [6000, 700, 120, 30])
    found = floaters(numbers_of(size, opacity, places))
    assert found[6700:6820].mean() >= 0.9 and found[6820:].mean() >= 0.9
    assert found[:6000].sum() == 0 and found[6000:6700].mean() < 0.02


def test_floaters_of_few_or_broken_anchors():
    assert not floaters(numbers_of(count=5)).any()
    nowhere = numbers_of(places=np.full((50, 3), np.nan))
    assert not floaters(nowhere).any()
    assert not floaters(numbers_of(places=np.zeros((50, 3)))).any()  # all at one place


def test_a_million_are_chosen_before_a_hand_feels_it():
    """Processor time, once when the button is let go."""
    count = 1_000_000
    places = np.random.default_rng(3).normal(size=(count, 3)).astype(np.float32)
    obj = SceneObject("a", ball(4))
    turn = np.linspace(0, 2 * np.pi, 200)
    view = front_view((1280, 720), distance=5.0)
    outline = np.c_[640 + 300 * np.cos(turn), 360 + 200 * np.sin(turn)]
    start = time.thread_time()
    inside = in_lasso(view, places, obj, outline)
    spent = time.thread_time() - start
    assert 0.1 < inside.mean() < 0.9
    assert spent < 0.5  # 0.06 s on one core of 2026: a window that waited longer would be felt


def test_plain_splats_have_their_own_numbers():
    b = ball(30)
    numbers = anchor_numbers(b, 0.0, np.zeros(3))
    splats = PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh)
    np.testing.assert_array_equal(numbers.size, splats.scales.max(axis=1))
    assert numbers.alike(numbers.oklab[0], 0.01).all()
    assert not numbers.alike(oklab(np.array([[1.0, 0, 0]]))[0], 0.1).any()
