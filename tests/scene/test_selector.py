"""Selectors: weights against the plain distance to a shape, borders, spaces, several at once."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import Pace, StopWeights
from shapeshift.scene.control import control_key, control_of, covered
from shapeshift.scene.pose import Pose, look_at
from shapeshift.scene.scene import SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Painted, Sphere
from shapeshift.scene.selectors.selector_texts import read_selector
from tests.support.models import make_random_model
from tests.support.splat_scenes import random_layers

TURNED = tuple(np.array([0.8, 0.2, -0.4, 0.4]) / np.linalg.norm([0.8, 0.2, -0.4, 0.4]))
EYE = look_at(np.array([0.2, 0.3, 2.5]), np.array([0.1, 0.0, 0.0]))
LENS = {"position": EYE.position, "wxyz": EYE.wxyz}
SHAPES = [
    Box(centre=(0.1, 0, -0.2), half=(0.3, 0.5, 0.2), wxyz=TURNED, x=1.0, border=0.3),
    Sphere(centre=(0.2, 0.1, 0), radius=0.4, x=1.0, border=0.3),
    HalfSpace(point=(0, 0.1, 0), normal=(1, 2, 3), x=1.0, border=0.3),
    Lens(**LENS, half_angle=0.15, x=1.0, border=0.3),
    Lens(**LENS, tangents=(-0.2, 0.05, -0.1, 0.15), x=1.0, border=0.3),
]
PLACES = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))


def is_inside(shape, place: np.ndarray) -> bool:
    """The slow twin: one place, in words."""
    if isinstance(shape, Sphere):
        return math.dist(place, shape.centre) <= shape.radius
    if isinstance(shape, HalfSpace):
        return (
            sum(n * (p - q) for n, p, q in zip(shape.normal, place, shape.point, strict=True)) <= 0
        )
    pose = Pose(np.array(getattr(shape, "centre", None) or shape.position), np.array(shape.wxyz))
    x, y, z = (np.linalg.inv(pose.matrix()) @ np.append(place, 1.0))[:3]
    if isinstance(shape, Box):
        return all(abs(n) <= half for n, half in zip((x, y, z), shape.half, strict=True))
    if shape.half_angle is not None:
        return z < 0 and math.hypot(x, y) <= -z * math.tan(shape.half_angle)
    left, right, down, up = shape.tangents
    return z < 0 and left <= x / -z <= right and down <= y / -z <= up


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_inside_is_one_and_far_outside_nothing(shape):
    inside = np.array([is_inside(shape, place) for place in PLACES])
    hard = replace(shape, border=0.0).weights(PLACES)
    weights = shape.weights(PLACES)
    assert 5 < inside.sum() < len(PLACES) - 5
    np.testing.assert_array_equal(hard, inside)
    assert (weights[inside] == 1).all() and weights.dtype == np.float32
    assert ((weights >= 0) & (weights <= 1)).all() and (weights[~inside] < 1).all()
    assert ((weights > 0) & (weights < 1)).sum() > 50 and (weights == 0).sum() > 50


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_no_weight_changes_faster_than_the_border_allows(shape):
    """A smooth step of width b rises by 1.5 / b a metre at most: no jump, no kink that shows."""
    step = np.random.default_rng(1).normal(size=PLACES.shape)
    step *= 1e-3 / np.linalg.norm(step, axis=1, keepdims=True)
    change = np.abs(shape.weights(PLACES + step) - shape.weights(PLACES))
    assert change.max() <= 1e-3 * 1.5 / shape.border * 1.01


def test_the_border_is_half_way_through_half_way():
    sphere = Sphere(centre=(0, 0, 0), radius=1.0, x=1.0, border=0.5)
    at = np.array([[1.0, 0, 0], [1.25, 0, 0], [1.5, 0, 0], [1.125, 0, 0]])
    np.testing.assert_allclose(sphere.weights(at), [1, 0.5, 0, 1 - 0.15625], atol=1e-7)


@pytest.mark.parametrize("border", [0.0, 0.3])
def test_what_is_nowhere_is_in_no_selector(border):
    nowhere = np.array([[math.nan, 0, 0], [0, 0, math.inf], [math.nan] * 3])
    with np.errstate(invalid="ignore"):
        for shape in SHAPES[:2]:
            assert not replace(shape, border=border).weights(nowhere).any()


def slow_control(obj: SceneObject, places: np.ndarray) -> np.ndarray:
    """control_of, one anchor after the other in float64."""
    out = []
    pose = obj.world_from_object.matrix()
    for i, place in enumerate(places.astype(np.float64)):
        x = obj.x
        for selector in obj.selectors:
            at = place if selector.space == "object" else pose[:3, :3] @ place + pose[:3, 3]
            if isinstance(selector, Painted):
                weight = float(selector.weight[i])
            else:
                weight = float(selector.weights(at[None])[0])
            x = x * (1 - weight) + selector.x * weight
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("model", [make_random_model(300), random_layers(300)], ids=["A", "N"])
def test_control_is_mixed_in_turn_a_later_selector_above(model):
    places = model.anchors if hasattr(model, "anchors") else model.means
    painted = Painted(np.random.default_rng(2).uniform(size=len(places)), 0.7)
    pose = Pose(np.array([0.4, 0, 0]), np.array(TURNED))
    selectors = (SHAPES[2], painted, replace(SHAPES[1], x=0.25, space="world"), SHAPES[0])
    obj = SceneObject("thing", model, pose, 0.1, selectors=selectors)
    x = control_of(obj)
    assert x.dtype == np.float32 and x.shape == (len(places),) and x.min() >= 0 and x.max() <= 1
    np.testing.assert_allclose(x, slow_control(obj, places), atol=1e-6)
    alone = control_of(replace(obj, selectors=(*selectors, Painted(np.ones(len(places)), 0.5))))
    assert alone == 0.5


def test_a_border_leads_from_outside_to_inside_without_a_third_stop():
    stops = tuple(Stop(name, x) for name, x in (("a", 0.0), ("b", 0.4), ("c", 0.5), ("d", 1.0)))
    model = replace(make_random_model(400), stops=stops)
    ball = Sphere(centre=(0, 0, 0), radius=0.3, border=0.6, x=1.0)
    obj = SceneObject("thing", model, x=0.0, selectors=(ball,))
    inside, rows = ball.weights(model.anchors), control_of(obj)
    assert rows.shape == (400, 4) and rows.dtype == np.float32
    np.testing.assert_allclose(rows, np.stack([1 - inside, 0 * inside, 0 * inside, inside], 1))
    assert ((inside > 0.1) & (inside < 0.9)).sum() > 50  # there is a border to speak of
    # A later one over it, from whatever is there, and one that is a blend itself.
    blend = StopWeights((("b", 0.25), ("d", 0.75)))
    half = HalfSpace(point=(0, 0, 0), normal=(1, 0, 0), border=0.2, x=blend)
    over = control_of(replace(obj, selectors=(ball, half)))
    share = half.weights(model.anchors)[:, None]
    np.testing.assert_allclose(over, rows * (1 - share) + share * [0, 0.25, 0, 0.75], atol=1e-6)
    whole = Painted(np.ones(400), blend)
    assert control_of(replace(obj, selectors=(ball, whole))) == blend


def test_a_border_follows_the_pace_of_its_pair():
    pace = (Pace("RGB", "Thermal", (0, 0.1, 1)),)
    model = replace(make_random_model(300), pace=pace)
    ball = Sphere(centre=(0, 0, 0), radius=0.3, border=0.6, x=1.0)
    x = control_of(SceneObject("thing", model, x=0.0, selectors=(ball,)))
    weights, inside = model.blend.weights(x)[:, 1], ball.weights(model.anchors)
    np.testing.assert_allclose(weights, np.interp(inside, [0, 0.5, 1], [0, 0.1, 1]), atol=1e-6)


def test_how_much_lies_in_any_of_several():
    obj = SceneObject("thing", make_random_model(50))
    some = [Painted(np.random.default_rng(i).uniform(size=50), 0.5) for i in range(2)]
    wanted = 1 - (1 - some[0].weight) * (1 - some[1].weight)
    np.testing.assert_allclose(covered(obj, some), wanted, atol=1e-7)
    assert not covered(obj, ()).any()


def test_an_object_has_no_blend_of_stops_that_its_model_has_not():
    bone = StopWeights((("Bone", 1.0),))
    for changes in ({"x": bone}, {"selectors": (Painted(np.ones(5), bone),)}):
        with pytest.raises(ValueError, match="no stop 'Bone'; there are RGB, Thermal"):
            SceneObject("thing", make_random_model(5), **changes)


def test_what_selects_nothing_costs_nothing():
    obj = SceneObject("thing", make_random_model(50), x=0.3)
    away = Sphere(centre=(90, 0, 0), radius=1, x=1.0)
    assert control_of(obj) == 0.3 == control_of(replace(obj, selectors=(away,)))


def test_a_moved_object_passes_through_what_stands_in_the_world():
    model = make_random_model(100)
    in_world = HalfSpace(point=(0, 0, 0), normal=(1, 0, 0), x=1.0, space="world")
    here = SceneObject("thing", model, selectors=(in_world,))
    moved = replace(here, world_from_object=Pose(np.array([0.2, 0, 0]), np.array([1.0, 0, 0, 0])))
    np.testing.assert_array_equal(control_of(here), model.anchors[:, 0] <= 0)
    np.testing.assert_array_equal(control_of(moved), model.anchors[:, 0] + 0.2 <= 0)
    assert control_key(here) != control_key(moved)
    fixed = replace(in_world, space="object")
    assert control_key(replace(here, selectors=(fixed,))) == control_key(
        replace(moved, selectors=(fixed,))
    )


def test_selectors_compare_by_value():
    one, other = (Sphere(centre=np.array([1, 2, 3]), radius=1, x=0.5) for _ in range(2))
    assert one == other and one != replace(one, x=0.25) and one != replace(one, centre=(1, 2, 4))
    weight = np.array([0, 1, 0.5])
    assert Painted(weight, 0.5) == Painted(weight.copy(), 0.5) != Painted(weight[::-1], 0.5)
    assert Painted.of([1, 2], 4, 0.5) == Painted(np.array([0, 1, 1, 0], bool), 0.5)


@pytest.mark.parametrize("x", [-0.001, 1.001, math.nan, math.inf])
def test_x_outside_0_to_1_is_refused_by_value(x):
    for make in (
        lambda: Sphere(centre=(0, 0, 0), radius=1, x=x),
        lambda: Painted(np.zeros(3), x),
        lambda: SceneObject("thing", make_random_model(2), x=x),
    ):
        with pytest.raises(ValueError, match=f"x = {x}; from 0 to 1"):
            make()


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Sphere(centre=(0, 0), radius=1, x=0), "centre = .*3 finite numbers"),
        (lambda: Sphere(centre=(0, 0, 0), radius=math.nan, x=0), "radius = nan"),
        (lambda: Sphere(centre=(0, 0, 0), radius=1, x=0, border=-1), "border = -1"),
        (lambda: Sphere(centre=(0, 0, 0), radius=1, x=0, space="eye"), "space = eye"),
        (lambda: Box(centre=(0, 0, 0), half=(1, 1, -1), x=0), "half = "),
        (lambda: Box(centre=(0, 0, 0), half=(1, 1, 1), wxyz=(0, 0, 0, 0), x=0), "quaternion"),
        (lambda: HalfSpace(point=(0, 0, 0), normal=(0, 0, 0), x=0), "normal = .*not zero"),
        (lambda: Lens(**LENS, x=0), "either half_angle or tangents"),
        (lambda: Lens(**LENS, half_angle=1.6, x=0), "half_angle = 1.6"),
        (lambda: Lens(**LENS, tangents=(1, 0, 0, 1), x=0), "left < right"),
        (lambda: Painted(np.array([0, 2]), 0), "0 to 1"),
        (lambda: Painted(np.zeros(3), 0).weights(np.zeros((4, 3))), "3 weights for 4 anchors"),
    ],
)
def test_what_is_no_selector_is_refused_in_a_sentence(make, told):
    with pytest.raises(ValueError, match=told):
        make()


def test_text():
    stops = make_random_model(1).stops
    assert read_selector("sphere:1,2,3:0.5:1:0.1") == Sphere(
        centre=(1, 2, 3), radius=0.5, x=1, border=0.1
    )
    assert read_selector("box:1,2,3:4,5,6:thermal", stops) == Box(
        centre=(1, 2, 3), half=(4, 5, 6), x=1
    )
    assert read_selector("half:0,0,0:0,2,0:0.5").normal == (0, 1, 0)
    lens = read_selector("lens:10:1:0.2", eye=EYE)
    assert lens == Lens(**LENS, half_angle=math.radians(10), x=1, border=0.2)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("ball:0,0,0:1:1", "begins with 'ball'; sphere, box, half, lens"),
        ("sphere:0,0,0:1", "has 2 parts after 'sphere'; write sphere:x,y,z"),
        ("sphere:0,0,0:1:1:0:0", "has 5 parts"),
        ("sphere:0,a,0:1:1", "could not convert"),
        ("sphere:0,0:1:1", "3 finite numbers"),
        ("sphere:0,0,0:1,2:1", "radius is 2 numbers"),
        ("sphere:0,0,0:1:2", "x = 2.0; from 0 to 1"),
        ("sphere:0,0,0:1:nan", "x = nan"),
        ("sphere:0,0,0:1:warm", r"X is 'warm'; a number from 0 to 1 or a stop \(RGB, Thermal\)"),
        ("sphere:0,0,0:1:1:inf", "border = inf"),
        ("lens:95:1", "half_angle"),
    ],
)
def test_text_that_is_no_selector(text, told):
    with pytest.raises(ValueError, match=told):
        read_selector(text, make_random_model(1).stops)
