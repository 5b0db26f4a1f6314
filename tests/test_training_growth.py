"""Growing: what each strategy sums up, who comes and who goes, budgets, and small photos first."""

from dataclasses import replace

import numpy as np
import pytest
from test_training_gradients import BACKGROUND, LAYOUT, SIZE, VOXEL, situation

from shapeshift.rasterizer.reference import render_reference
from shapeshift.runtime_models.model import BadFile, ControlEncoding, Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.training.coarse import Coarse, smaller
from shapeshift.training.density.density import Evidence, Newcomers, Watch, newcomers
from shapeshift.training.density.density_budget import most_anchors, within
from shapeshift.training.density.density_grow import change, given, useless, weakest
from shapeshift.training.density.density_strategy import STRATEGIES
from shapeshift.training.drawing import camera_of
from shapeshift.training.export import model_of
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.reference import decode_reference
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import Step

RNG = np.random.default_rng
STOPS = (Stop("RGB", 0.0), Stop("Thermal", 1.0))


def learned(device, watch: Watch, weight: np.ndarray | None = None):
    """(evidence after one step, grad_record, its drawing's reference, photo) of a small scene."""
    parameters, control, view, rgba = situation(0)
    adam = Adam(device, parameters, {name: np.ones(1) for name in parameters})
    step, loss = Step(device, LAYOUT, VOXEL, adam), ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND, weight)
    evidence = Evidence(device, LAYOUT, len(parameters["anchors"]), watch)
    evidence.stop = watch.stops - 1
    drawing = step.draw(view, control, BACKGROUND)
    step.gradients(drawing, loss, target, 0.2, evidence=evidence)
    eye = view.world_from_eye.position
    splats = decode_reference(LAYOUT, parameters, control, eye, VOXEL)
    return evidence, splats, camera_of(view), rgba[..., :3] / 255


def picture_weights(splats: tuple, camera) -> np.ndarray:
    """(N, H, W) what each splat gives to each pixel, in float64."""
    count = len(splats[0])
    colors = np.eye(count)
    pictures = [
        render_reference((*splats[:4], np.repeat(colors[i][:, None], 3, 1)), camera)[0][0]
        for i in range(count)
    ]
    return np.array(pictures)


@pytest.mark.parametrize("masked", [False, True])
def test_the_share_of_the_error_equals_the_float64_reference(device, masked):
    weight = RNG(1).random(SIZE[::-1]).astype(np.float32) if masked else None
    watch = Watch(STRATEGIES["error"], stops=2, each=True, seen=True)
    evidence, splats, camera, photo = learned(device, watch, weight)
    image, _ = render_reference(splats, camera, BACKGROUND)
    error = np.abs(image.transpose(1, 2, 0) - photo).mean(axis=2)
    if masked:
        error = error * weight
    weights = picture_weights(splats, camera)
    wanted = (weights * error).sum(axis=(1, 2)) / (SIZE[0] * SIZE[1])
    state = evidence.state()
    first, second = np.split(state["evidence.gradient"], 2)  # of each stop
    assert not first.any()
    np.testing.assert_allclose(second[:, 0], wanted, rtol=1e-4, atol=1e-7)
    seen = state["evidence.seen"][1]
    np.testing.assert_allclose(
        seen[:, 0], weights.sum(axis=(1, 2)).reshape(-1, LAYOUT.splats).sum(1), rtol=1e-4, atol=1e-5
    )
    on_screen = second[:, 1].reshape(-1, LAYOUT.splats).max(1)
    np.testing.assert_array_equal(seen[:, 1], on_screen)
    assert state["evidence.stop_steps"].tolist() == [0, 1]


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize("seen", [False, True])
def test_every_strategy_sums_what_its_row_says(device, name, seen):
    layout, anchors = HeadLayout(splats=3), 17
    n = 3 * anchors
    evidence = Evidence(device, layout, anchors, Watch(STRATEGIES[name], seen=seen))
    pull, views, opacity = np.zeros(n), np.zeros(n), np.zeros(anchors)
    gives, watched = np.zeros(anchors), np.zeros(anchors)
    for turn in range(3):
        rng = RNG(turn)
        record, grad = rng.normal(size=(2, n, 12)).astype(np.float32)
        alpha = rng.uniform(-1, 1, n).astype(np.float32)
        evidence.add(*map(device.upload, (record, grad, alpha)), (40, 30))
        on = record[:, 9] > 0
        each = {
            "gradient": np.hypot(grad[:, 0], grad[:, 1]) * 20,
            "absgrad": np.hypot(grad[:, 9], grad[:, 10]) * 20,
            "error": grad[:, 9] / 1200,
        }[name]
        pull += np.where(on, each, 0)
        views += on
        opacity += np.maximum(alpha, 0).reshape(-1, 3).sum(1)
        gives += np.where(on, grad[:, 11], 0).reshape(-1, 3).sum(1)
        watched += on.reshape(-1, 3).any(1)
    state = evidence.state()
    found = state["evidence.gradient"]
    np.testing.assert_allclose(found[:, 0], pull, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(found[:, 1], views)
    np.testing.assert_allclose(state["evidence.opacity"], opacity, rtol=1e-5)
    assert ("evidence.seen" in state) == seen and state["evidence.steps"] == 3
    if seen:
        np.testing.assert_allclose(state["evidence.seen"][0, :, 0], gives, rtol=1e-4, atol=1e-5)
        np.testing.assert_array_equal(state["evidence.seen"][0, :, 1], watched)
    copy = Evidence(device, layout, anchors, Watch(STRATEGIES[name], seen=seen))
    copy.load(state)
    for key, value in copy.state().items():
        np.testing.assert_array_equal(value, state[key])


def test_pulls_of_each_stop_grow_where_that_stop_has_the_splat():
    anchors = np.zeros((1, 3), np.float32)
    means = [np.array([[0.6, 0, 0]]), np.array([[-0.6, 0, 0]])]  # k = 1, another place at each stop
    quiet, loud = np.array([[3.0, 30]]), np.array([[90.0, 30]])
    new = newcomers(anchors, means, [quiet, loud], 0.2, 1.0)
    assert (new.anchors[:, 0] < 0).all() and len(new.anchors)
    both = newcomers(anchors, means, [loud], 0.2, 1.0)
    assert (both.anchors[:, 0] < 0).any() and (both.anchors[:, 0] > 0).any()


@pytest.mark.parametrize(("pull", "grids", "cells"), [
    (1.5, 3, {1.0}), (3.0, 3, {1.0, 0.5}), (3.0, 1, {1.0}), (9.0, 3, {1.0, 0.5, 0.25}),
    (9.0, 2, {1.0, 0.5}), (0.9, 3, set()),
])  # fmt: skip
def test_finer_grids_take_a_stronger_pull(pull, grids, cells):
    """One splat between the nodes of all grids: each that its pull reaches gets its nearest."""
    mean = np.array([[0.64, 0.0, 0.0]])
    gradient = np.array([[pull * 30, 30]])
    far = np.array([[9.0, 0, 0]], np.float32)
    new = newcomers(far, [mean], [gradient], 1.0, 1.0, grids=grids)
    nearest = {round(0.64 / cell) * cell for cell in cells}
    assert set(np.round(new.anchors[:, 0], 5).tolist()) == nearest


def test_a_relative_pull_counts_in_means_of_what_was_on_screen():
    anchors = np.zeros((1, 3), np.float32)
    means = [np.array([[0.6, 0, 0], [0, 0.6, 0], [0, 0, 0.6], [1, 1, 1]])]
    gradient = np.array([[30.0, 30], [30, 30], [150, 30], [9999, 3]])  # the last: too rarely seen
    for unit in (1.0, 1e-9):  # of whatever size the error is
        new = newcomers(anchors, means, [gradient * (unit, 1)], 0.2, 2.0, relative=True)
        assert len(new.anchors) and np.allclose(new.anchors[0], [0, 0, 0.6])
        np.testing.assert_allclose(new.pull[0], 5 / (7 / 3) / 2, rtol=1e-6)
    nobody = newcomers(anchors, means, [np.zeros((4, 2))], 0.2, 2.0, relative=True)
    assert not len(nobody.anchors)


def test_at_most_so_many_newcomers():
    new = Newcomers(np.arange(12).reshape(4, 3), np.arange(4), np.array([1.0, 5, 2, 5]))
    assert new.at_most(2, by_pull=True).parents.tolist() == [1, 3]
    assert new.at_most(3, by_pull=True).parents.tolist() == [1, 2, 3]
    assert new.at_most(2, by_pull=False).parents.tolist() == [0, 1]
    assert new.at_most(9, by_pull=True).parents.tolist() == [0, 1, 2, 3]
    assert not len(new.at_most(-1, by_pull=False).anchors)


def seen_state(seen: np.ndarray, steps: int = 100) -> dict[str, np.ndarray]:
    return {
        "evidence.opacity": np.full(seen.shape[1], 1e6),
        "evidence.steps": np.array(steps),
        "evidence.seen": seen,
    }


def test_who_contributes_at_one_stop_stays():
    seen = np.array([
        [[50.0, 50], [0, 50], [0.5, 50], [0, 0], [0, 2]],
        [[0.0, 50], [50, 50], [0.5, 50], [0, 0], [0, 1]],
    ])  # (stops, anchors, sum and pictures)  # fmt: skip
    np.testing.assert_allclose(given(seen), [1, 1, 0.01, np.inf, np.inf])
    weight = TrainSettings(prune_weight=0.1)
    assert useless(seen_state(seen), 1, weight).tolist() == [False, False, True, False, False]
    views = TrainSettings(prune_views=0.04)
    assert useless(seen_state(seen), 1, views).tolist() == [False, False, False, True, True]
    assert not useless(seen_state(seen, steps=20), 1, replace(weight, prune_views=1.0)).any()


def test_the_weakest_make_room_and_the_needed_do_not():
    seen = np.array([[[5.0, 50], [1, 50], [9, 50], [0, 2]]])
    assert weakest(seen_state(seen), np.ones(4, bool), 2).tolist() == [1, 0]
    assert weakest(seen_state(seen), np.array([True, False, True, True]), 4).tolist() == [0, 2]


def test_a_change_keeps_the_cap_and_replaces(device):
    """Ten anchors in a row, the cap reached; one pulls, and the least given goes for it."""
    layout = HeadLayout(splats=1)
    anchors = np.array([[i, 0, 0] for i in range(10)], np.float32)
    means = [anchors.astype(float) + np.array([0, 0.5, 0])]
    evidence = Evidence(device, layout, 10, Watch(STRATEGIES["gradient"], seen=True))
    gradient = np.tile(np.float32([0.001, 60]), (10, 1))
    gradient[4] = (60, 60)
    seen = np.stack([np.arange(10, 0, -1), np.full(10, 60)], axis=1)[None].astype(np.float32)
    evidence.load({
        "evidence.gradient": gradient, "evidence.opacity": np.full(10, 60, np.float32),
        "evidence.steps": np.array(60), "evidence.seen": seen,
        "evidence.stop_steps": np.array([60]),
    })  # fmt: skip
    settings = TrainSettings(grow_threshold=0.9)
    keep, new = change(anchors, means, evidence, 0.1, 10, settings)
    assert keep.all() and not len(new.anchors)
    keep, new = change(anchors, means, evidence, 0.1, 11, settings)
    assert keep.all() and new.parents.tolist() == [4]
    np.testing.assert_allclose(new.anchors, [[4, 0.5, 0]], atol=1e-6)
    keep, new = change(anchors, means, evidence, 0.1, 10, replace(settings, grow_replace=0.1))
    assert np.flatnonzero(~keep).tolist() == [9] and new.parents.tolist() == [4]


@pytest.mark.parametrize("features", [1, 8, 33])
@pytest.mark.parametrize("max_mb", [0.08, 0.2])
def test_a_package_within_its_megabytes(tmp_path, features, max_mb):
    layout, encoding = HeadLayout(5, features, 32, 16), ControlEncoding(16, 1 / 15, 0.04)
    settings = TrainSettings(max_mb=max_mb, max_anchors=10**9, features=features)
    most = most_anchors(settings, layout, encoding, STOPS)
    rng = RNG(0)
    state = {
        "weights.value": rng.normal(size=layout.weights_at[-1]).astype(np.float32),
        "anchors.value": rng.normal(size=(most, 3)).astype(np.float32),
        "features.value": rng.normal(size=(most, -(-features // 8) * 8)).astype(np.float32),
    }  # noise, which does not compress
    model = model_of(state, layout, 0.1, encoding, STOPS, {"settings": settings.as_dict()})
    size = write_package(model, tmp_path / "a.shift")
    assert size <= max_mb * 1e6
    assert size > 0.8 * max_mb * 1e6  # and not much less than allowed
    capped = replace(settings, max_anchors=7)
    assert most_anchors(capped, layout, encoding, STOPS) == 7


def test_a_budget_that_holds_nothing_is_refused():
    layout, encoding = HeadLayout(), ControlEncoding(16, 1 / 15, 0.04)
    with pytest.raises(BadFile, match=r"--max-mb 0.001 leaves no room for anchors.*--hidden"):
        most_anchors(TrainSettings(max_mb=0.001), layout, encoding, STOPS)
    with pytest.raises(BadFile, match=r"start with 9 anchors, and --max-mb 0.1 holds 8"):
        within(np.zeros((9, 3)), 8, 0.1)
    assert len(within(np.zeros((9, 3)), 8, None)) == 9  # --max-anchors caps growing alone


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"growth": "magic"}, "one of gradient, absgrad, error"), ({"coarse": 3}, "power of two"),
        ({"coarse": 0}, "coarse is 0"), ({"coarse_until": 1.1}, "coarse_until is 1.1"),
        ({"max_mb": float("nan")}, "max_mb is nan"), ({"grow_threshold": 0.0}, "grow_threshold is"),
        ({"grow_replace": 2.0}, "share"), ({"prune_weight": -1.0}, "prune_weight is -1.0"),
        ({"prune_views": float("nan")}, "prune_views"),
    ],
)  # fmt: skip
def test_settings_of_growing_that_cannot_be_are_refused(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        TrainSettings(**changes)


def test_sizes_of_photos_over_a_run():
    coarse = Coarse(4, 0.4, {})
    at = [coarse.factor(f) for f in (0, 0.19, 0.2, 0.39, 0.4, 0.7, 1.0)]
    assert at == [4, 4, 2, 2, 1, 1, 1] and coarse.factors == [1, 2, 4]
    assert {Coarse(1).factor(f) for f in (0, 0.1, 0.9)} == {1}
    assert {Coarse(8, 0.0, {}).factor(f) for f in (0, 0.1)} == {1}


def photo_of(rgba: np.ndarray, weight=None) -> LoadedPhoto:
    _, _, view, _ = situation(0)
    return LoadedPhoto(view.resized(rgba.shape[1::-1]), "RGB", rgba, weight, "p")


def test_a_smaller_photo_has_the_mean_colours():
    rgba = RNG(0).integers(0, 256, (64, 48, 4)).astype(np.uint8)
    weight = RNG(1).random((64, 48)).astype(np.float32)
    half = smaller(photo_of(rgba, weight), 2)
    assert half.view.size == (24, 32) and half.rgba.shape == (32, 24, 4)
    blocks = rgba.reshape(32, 2, 24, 2, 4).astype(float)
    alpha = blocks[..., 3:] / 255
    laid = (blocks[..., :3] * alpha).mean(axis=(1, 3))
    for background in ((0, 0, 0), (1, 1, 1)):  # laid over anything it looks like the large one
        over = laid / 255 + (1 - alpha.mean(axis=(1, 3))) * np.array(background)
        np.testing.assert_allclose(half.over(background), over, atol=0.006)
    np.testing.assert_allclose(half.weight, weight.reshape(32, 2, 24, 2).mean((1, 3)), rtol=1e-5)
    odd = smaller(photo_of(rgba[:33, :35]), 2)
    assert odd.view.size == (18, 16)
    tiny = photo_of(rgba[:20, :20])
    assert smaller(tiny, 2) is tiny  # 10 pixels would say nothing


def test_small_photos_are_made_once_and_dropped_when_their_time_is_over():
    photo = photo_of(np.full((64, 64, 4), 255, np.uint8))
    coarse = Coarse(4, 0.4, {})
    assert coarse.photo(photo, 4) is coarse.photo(photo, 4)
    coarse.photo(photo, 2)
    coarse.drop(2)
    assert [key[2] for key in coarse.made] == [2]
    assert coarse.photo(photo, 1) is photo
