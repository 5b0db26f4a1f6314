"""Which anchors a training step leaves out: never one that the view shows, at its stop."""

import numpy as np
import pytest

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.drawing import camera_of, draw_splats
from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.step import LOOK, TrainingStep, Visibility
from tests.support.renderer.rasterizer_reference import render_reference
from tests.support.training.situations import BACKGROUND, LAYOUT, SIZE, VOXEL, situation

RNG = np.random.default_rng
K = 3
PICTURE = (64, 48)


def cloud(seed: int, count: int = 600) -> tuple[np.ndarray, tuple]:
    """Anchors (A, 3) all about the eye, and their splats: small, large, absent, far off."""
    rng = RNG(seed)
    anchors = rng.normal(size=(count, 3)) * rng.choice([0.5, 3, 12], (count, 1))
    n = count * K
    means = np.repeat(anchors, K, axis=0) + rng.normal(0, 0.3, (n, 3))
    scales = np.exp(rng.uniform(-5, 0.5, (n, 3)))
    wxyz = rng.normal(size=(n, 4))
    opacity = np.repeat(rng.uniform(-0.5, 1, count), K) + rng.normal(0, 0.1, n)
    opacity[:K] = 1 / 255  # exactly the threshold is not drawn
    fields = (means, scales, wxyz, np.clip(opacity, -1, 1), rng.random((n, 3)))
    return anchors.astype(np.float32), tuple(f.astype(np.float32) for f in fields)


def view_from(seed: int, size: tuple[int, int] = PICTURE) -> View:
    rng = RNG(seed)
    eye = look_at(rng.normal(size=3), rng.normal(size=3) * 4)
    return View(eye, perspective(rng.uniform(0.3, 2.2), size), 0.05, 100.0, size)


def known(device, anchors: np.ndarray, splats: tuple) -> tuple[Visibility, object, Gaussians]:
    """A Visibility that has looked at these splats of all anchors once, at the second stop."""
    found = Visibility(device, len(anchors), 2, K)
    there, drawn = device.upload(anchors), Gaussians(*map(device.upload, splats))
    found.visits[1] = 1
    found.update_reach(1, None, there, drawn)
    return found, there, drawn


def chosen(device, found: Visibility, stop: int, view: View, anchors) -> np.ndarray:
    rows = found.visible_rows(stop, camera_of(view), anchors)
    return np.arange(found.count) if rows is None else device.download(rows)


@pytest.mark.parametrize("size", [PICTURE, (7, 5), (300, 9)])
@pytest.mark.parametrize("seed", range(12))
def test_who_is_left_out_has_no_splat_on_the_screen(device, seed, size):
    anchors, splats = cloud(seed)
    found, there, drawn = known(device, anchors, splats)
    view = view_from(seed, size)
    rows = chosen(device, found, 1, view, there)
    record = device.download(draw_splats(device, drawn, view, BACKGROUND).projected.record)
    shown = np.flatnonzero((record[:, 9] > 0).reshape(-1, K).any(axis=1))
    assert np.isin(shown, rows).all()
    assert len(rows) < 0.8 * len(anchors)  # and many are: the test is not one of nothing


@pytest.mark.parametrize("seed", range(3))
def test_the_float64_picture_of_the_rest_is_that_of_all(device, seed):
    anchors, splats = cloud(seed, 60)
    found, there, _ = known(device, anchors, splats)
    view = view_from(seed)
    rows = chosen(device, found, 1, view, there)
    kept = np.isin(np.repeat(np.arange(len(anchors)), K), rows)
    camera = camera_of(view)
    whole, part = (
        render_reference(tuple(f[mask] for f in splats), camera)[0]
        for mask in (np.ones_like(kept), kept)
    )
    np.testing.assert_array_equal(part, whole)
    assert not kept.all()


def test_every_tenth_step_of_a_stop_runs_all_and_stops_count_apart(device):
    anchors, splats = cloud(1)
    found = Visibility(device, len(anchors), 2, K)
    there, drawn = device.upload(anchors), Gaussians(*map(device.upload, splats))
    camera, ran = camera_of(view_from(1)), {0: [], 1: []}
    for turn in range(2 * LOOK + 1):
        for stop in (0, 1) if turn % 2 else (1,):
            rows = found.visible_rows(stop, camera, there)
            if rows is None:
                found.update_reach(stop, None, there, drawn)
            ran[stop].append(rows is None)
    assert [i for i, everything in enumerate(ran[1]) if everything] == [0, LOOK, 2 * LOOK]
    assert [i for i, everything in enumerate(ran[0]) if everything] == [0]


def test_what_is_absent_at_a_stop_is_left_out_there_alone(device):
    anchors, splats = cloud(2)
    found, there, _ = known(device, anchors, splats)
    none = splats[3] * 0
    found.update_reach(
        0, None, there, Gaussians(*map(device.upload, (*splats[:3], none, splats[4])))
    )
    found.visits[0] = 1
    view = view_from(2)
    assert chosen(device, found, 0, view, there).tolist() == [0]  # something has to be launched
    assert len(chosen(device, found, 1, view, there)) > 20


def test_an_anchor_of_no_place_is_not_left_out(device):
    anchors, splats = cloud(3)
    found, _, _ = known(device, anchors, splats)
    broken = anchors.copy()
    broken[[5, 7]] = np.nan
    assert np.isin([5, 7], chosen(device, found, 1, view_from(3), device.upload(broken))).all()


def test_state_goes_on_to_the_same_choices(device):
    anchors, splats = cloud(4)
    found, there, _ = known(device, anchors, splats)
    copy = Visibility(device, len(anchors), 2, K)
    copy.load(found.state())
    for turn in range(LOOK + 2):
        view = view_from(turn)
        ours, theirs = (chosen(device, v, 1, view, there) for v in (found, copy))
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("rows", [[0, 2, 3], [1], [0, 1, 2, 3, 4]])
def test_a_step_of_some_anchors_has_their_gradients_and_moves_nothing_else(device, rows):
    """Anchors that the view does not show give nothing to the picture: without them it is the same.

    The others stand a hundred metres behind the eye.
    """
    parameters, control, view, rgba = situation(0)
    rest = np.setdiff1d(np.arange(5), rows)
    parameters["anchors"][rest] += view.world_from_eye.position.astype(np.float32) * 30
    rates = {name: np.full(1, 0.01) for name in parameters}
    found = {}
    for some in (False, True):
        adam = Adam(device, {n: a.copy() for n, a in parameters.items()}, rates)
        step, loss = TrainingStep(device, LAYOUT, VOXEL, adam), ImageLoss(device, SIZE)
        asked = device.upload(np.array(rows, np.int32)) if some else None
        target = loss.target(device.upload(rgba), BACKGROUND)
        drawing = step.draw(view, control, BACKGROUND, rows=asked)
        image = device.download(drawing.frame.image)
        grads = step.gradients(drawing, loss, target, min_opacity_share=0.0)
        by_group = {name: device.download(array).copy() for name, array in grads.items()}
        step.update(grads, 1.0)
        found[some] = image, by_group, adam.state()
    (image, whole, moved), (same, part, apart) = found[False], found[True]
    np.testing.assert_array_equal(image, same)
    for name in LAYOUT.per_anchor:
        assert not whole[name][rest].any()
        np.testing.assert_array_equal(part[name], whole[name][rows])
        for what in ("value", "mean", "square"):
            np.testing.assert_array_equal(apart[f"{name}.{what}"], moved[f"{name}.{what}"])
        np.testing.assert_array_equal(apart[f"{name}.value"][rest], parameters[name][rest])
    # The networks' gradients are the same sums in other chunks: a few units in the last place.
    scale = np.abs(whole["weights"]).max()
    np.testing.assert_allclose(part["weights"], whole["weights"], atol=2e-6 * scale)
