"""Densification: what is summed up, who comes and who goes, budgets, and small photos first."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.training.densify import (
    GRAD2D_THRESHOLD,
    LEAST_STEPS,
    DensificationStats,
    NewAnchors,
    absent_as_nan,
    anchor_cap,
    densify_and_prune,
    largest_gradient,
    least_contributing,
    mean_contribution,
    new_anchors,
    resize_optimizer_state,
    transparent_anchors,
)
from shapeshift.training.drawing import camera_of
from shapeshift.training.export import model_of
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from tests.support.renderer.rasterizer_reference import render_reference
from tests.support.training.reference import decode_reference
from tests.support.training.situations import BACKGROUND, LAYOUT, SIZE, VOXEL, situation

RNG = np.random.default_rng
STOPS = (Stop("RGB", 0.0), Stop("Thermal", 1.0))


def test_what_a_splat_gives_equals_the_float64_reference(device):
    """One step of a small scene at the second of two stops."""
    parameters, control, view, rgba = situation(0)
    adam = Adam(device, parameters, {name: np.ones(1) for name in parameters})
    step, loss = TrainingStep(device, LAYOUT, VOXEL, adam), ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND)
    stats = DensificationStats(device, LAYOUT, len(parameters["anchors"]), 2)
    stats.stop = 1
    drawing = step.draw(view, control, BACKGROUND)
    step.gradients(drawing, loss, target, stats=stats)
    eye = view.world_from_eye.position
    splats = decode_reference(LAYOUT, parameters, control, eye, VOXEL)
    weights = picture_weights(splats, camera_of(view)).sum(axis=(1, 2))
    first, second = stats.state()["densify.contribution"]
    assert not first.any() and weights.max() > 1
    wanted = weights.reshape(-1, LAYOUT.splats).sum(1)
    np.testing.assert_allclose(second[:, 0], wanted, rtol=1e-4, atol=1e-5)
    views = stats.state()["densify.grad2d"][..., 1].sum(0).reshape(-1, LAYOUT.splats)
    np.testing.assert_array_equal(second[:, 1], views.max(1))


def picture_weights(splats: tuple, camera) -> np.ndarray:
    """(N, H, W) what each splat gives to each pixel, in float64."""
    count = len(splats[0])
    colors = np.eye(count)
    pictures = [
        render_reference((*splats[:4], np.repeat(colors[i][:, None], 3, 1)), camera)[0][0]
        for i in range(count)
    ]
    return np.array(pictures)


@pytest.mark.parametrize("some", [False, True])
def test_sums_over_the_steps(device, some):
    """All anchors, or another choice of them every step."""
    layout, anchors = HeadLayout(splats=3), 17
    stats = DensificationStats(device, layout, anchors, 2)
    grad2d, opacity = np.zeros((2, 17, 3, 2)), np.zeros((17, 2))
    contribution = np.zeros((2, 17, 2))
    for turn in range(4):
        rng = RNG(turn)
        rows = np.sort(rng.choice(17, 9, replace=False)) if some else np.arange(17)
        n = 3 * len(rows)
        record, grad = rng.normal(size=(2, n, 12)).astype(np.float32)
        alpha = rng.uniform(-1, 1, n).astype(np.float32)
        stats.stop = turn % 2
        asked = device.upload(rows.astype(np.int32)) if some else None
        stats.add(*map(device.upload, (record, grad, alpha)), (40, 30), asked)
        on = (record[:, 9] > 0).reshape(-1, 3)
        screen = np.hypot(grad[:, 9], grad[:, 10]).reshape(-1, 3) * 20
        grad2d[turn % 2, rows] += np.stack([np.where(on, screen, 0), on], axis=-1)
        opacity[rows] += np.stack(
            [np.maximum(alpha, 0).reshape(-1, 3).sum(1), np.ones(len(rows))], axis=-1
        )
        gives = np.where(on, grad[:, 11].reshape(-1, 3), 0).sum(1)
        contribution[turn % 2, rows] += np.stack([gives, on.any(1)], axis=-1)
    state = stats.state()
    wanted = grad2d.reshape(2, -1, 2)
    np.testing.assert_allclose(state["densify.grad2d"], wanted, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(state["densify.opacity"], opacity, rtol=1e-5)
    np.testing.assert_allclose(state["densify.contribution"], contribution, rtol=1e-4, atol=1e-5)
    assert state["densify.steps"] == 4
    copy = DensificationStats(device, layout, anchors, 2)
    copy.load(state)
    for key, value in copy.state().items():
        np.testing.assert_array_equal(value, state[key])


def grad2d_of(*strengths: float, views: int = 30) -> np.ndarray:
    """(1, N, 2) of DensificationStats; strengths in thresholds."""
    return np.array([[[views * GRAD2D_THRESHOLD * s, views] for s in strengths]])


def test_a_splat_pulls_as_hard_as_at_the_stop_that_asks_most():
    views = np.array([[30, 30], [7, 4], [11, 0], [10, 0], [5, 5], [1, 10], [0, 0], [4, 7]]).T
    means = np.array([[1, 3], [4, 2], [2, 9], [2, 9], [2, 2], [5, 2], [7, 7], [5, 2]]).T
    found = largest_gradient(np.stack([views * means, views], axis=-1).astype(np.float32))
    # Four views of five that a stop needs: four fifths of the mean.  Ten in all are too few.
    np.testing.assert_allclose(found, [3, 4, 2, 0, 0, 2, 0, 4])
    alone = RNG(0).uniform(0, 40, (1, 50, 2)).astype(np.float32)
    mean = np.where(alone[0, :, 1] > 10, alone[0, :, 0] / alone[0, :, 1], 0)
    np.testing.assert_array_equal(largest_gradient(alone), mean)  # of one stop: the mean


def test_new_anchors_stand_free_under_the_splats_that_pull():
    anchors = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    sizes = np.array([0.2, 0.2])
    means = np.array([[0.02, 0, 0], [0.6, 0, 0], [1.01, 0, 0], [1.3, 0.3, 0]])  # k = 2
    new = new_anchors(anchors, sizes, [means], grad2d_of(3, 3, 3, 0.99))
    np.testing.assert_allclose(new.anchors, [[0.6, 0, 0]], atol=1e-6)  # the others' cubes are taken
    assert new.parents.tolist() == [0]
    strong = new_anchors(anchors, sizes, [means], grad2d_of(3, 2, 3, 4))
    assert strong.parents.tolist() == [1, 0]  # the strongest first
    assert not len(new_anchors(anchors, sizes, [means], grad2d_of(3, 3, 3, 3, views=10)).anchors)


def test_one_anchor_a_cube_of_the_size_that_it_will_have():
    far = np.array([[9.0, 0, 0]], np.float32)
    places = np.stack([np.linspace(0.01, 0.99, 50), np.zeros(50), np.zeros(50)], axis=1)
    for size, cubes in ((2.0, 1), (1.0, 2), (0.5, 4), (0.25, 8)):
        new = new_anchors(far, np.array([size]), [places], grad2d_of(*[2] * 50))
        assert len(new.anchors) == cubes, size


def test_an_anchor_comes_where_the_stop_is_that_shows_the_splat():
    anchors, sizes = np.array([[9.0, 0, 0]], np.float32), np.ones(1)
    here, there = np.array([[0.6, 0, 0]]), np.array([[-0.6, 0, 0]])
    both = new_anchors(anchors, sizes, [here, there], grad2d_of(2))
    np.testing.assert_allclose(sorted(both.anchors[:, 0]), [-0.6, 0.6], rtol=1e-6)
    absent = absent_as_nan(here, np.array([1 / 255]))
    assert new_anchors(anchors, sizes, [absent, there], grad2d_of(2)).anchors[0, 0] < 0
    assert not len(new_anchors(anchors, sizes, [absent], grad2d_of(2)).anchors)


def test_a_splat_very_far_away_breaks_nothing():
    anchors, sizes = np.array([[0.0, 0, 0]], np.float32), np.full(1, 1e-3)
    places = np.array([[1e9, 0, 0], [0.5, 0, 0], [-1e9, 0, 0]])
    new = new_anchors(anchors, sizes, [places], grad2d_of(2, 3, 4))
    assert np.isfinite(new.anchors).all() and new.parents.tolist() == [0] * len(new.anchors)


def test_anchors_that_show_nothing_go():
    opacity = np.array([[0.0, 50], [100, 50], [0.4, 50], [0, 2], [0, 3]])
    assert transparent_anchors(opacity, 100, 2).tolist() == [True, False, True, False, True]
    assert not transparent_anchors(opacity, LEAST_STEPS - 1, 2).any()


def test_who_contributes_at_one_stop_stays():
    contribution = np.array([
        [[50.0, 50], [0, 50], [0.5, 50], [0, 0], [0, 2]],
        [[0.0, 50], [50, 50], [0.5, 50], [0, 0], [0, 1]],
    ])  # (stops, anchors, sum and pictures)  # fmt: skip
    np.testing.assert_allclose(mean_contribution(contribution), [1, 1, 0.01, np.inf, np.inf])


def test_the_weakest_make_room_and_the_needed_do_not():
    contribution = np.array([[[5.0, 50], [1, 50], [9, 50], [0, 2]]])
    assert least_contributing(contribution, np.ones(4, bool), 2).tolist() == [1, 0]
    assert least_contributing(contribution, np.array([True, False, True, True]), 4).tolist() == [
        0,
        2,
    ]


def forty(pulling: dict[int, float]) -> tuple:
    """Forty anchors of one splat in a row: (anchors, sizes, means, stats); 39 gives least."""
    anchors = np.array([[i, 0, 0] for i in range(40)], np.float32)
    strengths = np.full(40, 0.1)
    strengths[list(pulling)] = list(pulling.values())
    stats = {
        "densify.grad2d": grad2d_of(*strengths, views=60), "densify.steps": np.array(60),
        "densify.opacity": np.full((40, 2), 60.0),
        "densify.contribution": np.stack([np.arange(40, 0, -1), np.full(40, 60)], axis=1)[None],
    }  # fmt: skip
    return anchors, np.full(40, 0.2), [anchors.astype(float) + np.array([0, 0.5, 0])], stats


def test_a_change_keeps_the_cap_and_moves_the_least_given():
    keep, new = densify_and_prune(*forty({4: 9.0}), 41)
    assert keep.all() and new.parents.tolist() == [4]
    np.testing.assert_allclose(new.anchors, [[4, 0.5, 0]], atol=1e-6)
    keep, new = densify_and_prune(*forty({4: 9.0}), 40)
    assert np.flatnonzero(~keep).tolist() == [39] and new.parents.tolist() == [4]
    keep, new = densify_and_prune(
        *forty(dict.fromkeys(range(30, 40), 2.0)), 40
    )  # a twentieth at most
    assert np.flatnonzero(~keep).tolist() == [38, 39] and new.parents.tolist() == [30, 31]
    keep, new = densify_and_prune(*forty({}), 40)
    assert keep.all() and not len(new.anchors)


def test_a_model_of_which_nothing_shows_keeps_its_anchors():
    anchors, sizes, means, stats = forty({})
    stats["densify.opacity"] = np.tile([0.0, 60], (40, 1))
    assert densify_and_prune(anchors, sizes, means, stats, 40)[0].all()


def test_a_change_of_the_state_keeps_the_others_moments():
    layout = HeadLayout(attributes=("frame", "color", "light"))
    state = {"weights.value": np.ones(3)}
    for name, width in (
        ("anchors", 3),
        ("features", 8),
        ("frames", 7),
        ("colors", 3),
        ("light", 24),
    ):
        for part in ("value", "mean", "square"):
            state[f"{name}.{part}"] = RNG(0).normal(size=(4, width)).astype(np.float32)
    new = NewAnchors(np.full((2, 3), 9, np.float32), np.array([3, 0]))
    keep = np.array([True, False, True, True])
    out = resize_optimizer_state(state, layout.per_anchor, keep, new)
    np.testing.assert_array_equal(out["features.mean"][:3], state["features.mean"][keep])
    for name in ("features", "colors", "light"):
        value = out[f"{name}.value"][3:]
        np.testing.assert_array_equal(value, state[f"{name}.value"][[3, 0]])
    frames, parents = out["frames.value"][3:], state["frames.value"][[3, 0]]
    np.testing.assert_allclose(np.exp(frames[:, :3]), np.exp(parents[:, :3]) / 2, rtol=1e-6)
    np.testing.assert_array_equal(frames[:, 3:], parents[:, 3:])
    assert not out["anchors.square"][3:].any() and (out["anchors.value"][3:] == 9).all()
    assert out["weights.value"] is state["weights.value"]


@pytest.mark.parametrize("features", [1, 8, 33])
@pytest.mark.parametrize("max_mb", [0.08, 0.2])
@pytest.mark.parametrize("lit", [False, True])
def test_a_package_within_its_megabytes(tmp_path, features, max_mb, lit):
    attributes = ("frame", "color", "light") if lit else ("frame", "color")
    layout = HeadLayout(5, features, 32, 16, attributes=attributes)
    encoding = ControlEncoding(16, 1 / 15, 0.04)
    settings = TrainSettings(max_mb=max_mb, max_anchors=10**9, features=features)
    most = anchor_cap(settings, layout, encoding, STOPS)
    rng = RNG(0)
    state = {
        "weights.value": rng.normal(size=layout.weights_at[-1]).astype(np.float32),
        "anchors.value": rng.normal(size=(most, 3)).astype(np.float32),
        "features.value": rng.normal(size=(most, -(-features // 8) * 8)).astype(np.float32),
        "frames.value": rng.normal(size=(most, 7)).astype(np.float32),
        "colors.value": rng.normal(size=(most, 3)).astype(np.float32),
        "light.value": rng.normal(size=(most, 24)).astype(np.float32),
    }  # noise, which does not compress
    model = model_of(state, layout, 0.1, encoding, STOPS, {"settings": settings.as_dict()})
    size = write_package(model, tmp_path / "a.shift")
    assert size <= max_mb * 1e6
    assert size > 0.8 * max_mb * 1e6  # and not much less than allowed
    capped = replace(settings, max_anchors=7)
    assert anchor_cap(capped, layout, encoding, STOPS) == 7


def test_a_budget_that_holds_nothing_is_refused():
    layout, encoding = HeadLayout(), ControlEncoding(16, 1 / 15, 0.04)
    with pytest.raises(BadFile, match=r"--max-mb 0.001 leaves no room.*the setting hidden"):
        anchor_cap(TrainSettings(max_mb=0.001), layout, encoding, STOPS)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"max_anchors": 0}, "max_anchors is 0"),
        ({"max_mb": float("nan")}, "max_mb is nan"), ({"grow_every": 0}, "grow_every is 0"),
    ],
)  # fmt: skip
def test_settings_of_growing_that_cannot_be_are_refused(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        TrainSettings(**changes)
