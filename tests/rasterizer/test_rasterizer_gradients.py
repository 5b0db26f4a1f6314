"""rasterizer/ backward: against float64 finite differences, and the same bits every time."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import Camera, project, project_backward
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from shapeshift.rasterizer.surface import rasterize_depth, rasterize_depth_backward, surface
from tests.support.renderer.rasterizer_reference import finite_differences, render_reference
from tests.support.renderer.rasterizer_scenes import (
    GROUPS,
    as_double,
    device,
    off_centre_camera,
    random_splats,
    upload,
)

ROOT = Path(__file__).resolve().parents[2]
FORMS = ("cpu", "gpu")
BACKGROUND = (0.2, 0.5, 0.9)
# Small: a pixel that crosses 1/255 within the step would jump; float64 leaves 1e-8 of the loss.
STEP = 1e-8


def gradients(
    splats: list, camera, grad_image, grad_through, form: str = "cpu", absolute: bool = True
) -> tuple:
    """The five gradients and the records' (N, 12)."""
    d = device()
    on_device = upload(splats)
    projected = project(d, *on_device, camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    frame = rasterize(d, projected, tiles, camera.size, BACKGROUND, form)
    grads = [d.upload(g) if g is not None else None for g in (grad_image, grad_through)]
    grad_record = rasterize_backward(d, projected, tiles, frame, *grads, form, absolute)
    back = project_backward(d, *on_device, camera, projected, grad_record, form)
    return [d.download(g) for g in back], d.download(grad_record)


def random_gradients(size: tuple[int, int], seed: int = 0) -> tuple:
    rng = np.random.default_rng(seed)
    width, height = size
    return (
        rng.normal(size=(3, height, width)).astype(np.float32),
        rng.normal(size=(height, width)).astype(np.float32),
    )


def loss_of(splats: list, group: int, camera, grad_image, grad_through):
    """The scalar whose gradients are asked for, as a function of one group of parameters."""
    doubles = as_double(splats)

    def loss(values: np.ndarray) -> float:
        changed = [*doubles[:group], values, *doubles[group + 1 :]]
        image, through = render_reference(tuple(changed), camera, BACKGROUND)
        return float((image * grad_image).sum() + (through * grad_through).sum())

    return loss


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("group", range(5), ids=GROUPS)
def test_every_gradient_matches_finite_differences(group, form):
    size = (37, 26)
    splats, camera = random_splats(14, seed=21, scale=0.15), off_centre_camera(size)
    upstream = random_gradients(size)
    got, _ = gradients(splats, camera, *upstream, form)
    loss = loss_of(splats, group, camera, *upstream)
    want = finite_differences(loss, as_double(splats)[group], 1e-7)
    error = np.linalg.norm(got[group] - want) / np.linalg.norm(want)
    assert error <= 1e-5, f"{GROUPS[group]}: {error:.1e}"


def beside_its_axis(size: tuple[int, int], widest: tuple[float, float] | None) -> Camera:
    """One whose picture does not hold its axis: tangents 0.4 to 1.02 across, -1.1 to -0.67 up."""
    return Camera(np.eye(4), 60.0, 60.0, -24.0, 66.0, size, 0.05, widest)


def splats_around_a_clamp(camera: Camera) -> tuple[list, np.ndarray]:
    """Long splats before and beside that picture; (N, 2) bool: held by the clamp across, along."""
    rng = np.random.default_rng(5)
    splats = random_splats(24, seed=5, scale=0.25)
    z = rng.uniform(0.7, 2.0, 24)
    tangents = rng.uniform((0.0, -1.9), (1.9, 0.0), (24, 2))
    splats[0][:] = np.column_stack([tangents * z[:, None], z])
    least_x, most_x, least_y, most_y = camera.limits()
    x, y = tangents.T
    return splats, np.column_stack([(x < least_x) | (x > most_x), (y < least_y) | (y > most_y)])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("group", range(5), ids=GROUPS)
@pytest.mark.parametrize("widest", [None, (0.6, 0.7)], ids=["own", "whole"])
def test_gradients_within_and_beyond_the_clamp_of_an_off_centre_picture(group, form, widest):
    """The place of a splat that the clamp holds no longer moves the slope of its projection."""
    size = (37, 26)
    camera = beside_its_axis(size, widest)
    splats, held = splats_around_a_clamp(camera)
    upstream = random_gradients(size)
    got, record = gradients(splats, camera, *upstream, form)
    drawn = np.abs(record[:, 2:5]).max(axis=1) > 0
    for mine in (held[:, 0], held[:, 1], ~held.any(axis=1)):
        assert np.count_nonzero(drawn & mine) >= 2, "a splat on either side of each clamp"
    loss = loss_of(splats, group, camera, *upstream)
    want = finite_differences(loss, as_double(splats)[group], 1e-7)
    error = np.linalg.norm(got[group] - want) / np.linalg.norm(want)
    assert error <= 1e-5, f"{GROUPS[group]}: {error:.1e}"


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("group", range(5), ids=GROUPS)
@pytest.mark.parametrize("size", [(75, 66), (16, 17), (15, 33)])
def test_directional_derivatives_of_many_splats(group, form, size):
    splats, camera = random_splats(300, seed=2), off_centre_camera(size)
    splats[3][:] *= 0.4  # nothing stops early: the float64 twin does not
    upstream = random_gradients(size, seed=5)
    got, _ = gradients(splats, camera, *upstream, form)
    start = as_double(splats)[group]
    direction = np.random.default_rng(1).normal(size=start.shape) * np.abs(start).mean()
    loss = loss_of(splats, group, camera, *upstream)
    want = (loss(start + STEP * direction) - loss(start - STEP * direction)) / (2 * STEP)
    have = float((got[group].astype(np.float64) * direction).sum())
    scale = np.linalg.norm(got[group]) * np.linalg.norm(direction) / np.sqrt(direction.size)
    assert abs(have - want) <= 1e-5 * max(scale, abs(want))


@pytest.mark.parametrize("form", FORMS)
def test_without_a_gradient_of_the_transmittance_it_counts_as_zero(form):
    size = (40, 30)
    splats, camera = random_splats(100, seed=4), off_centre_camera(size)
    grad_image, _ = random_gradients(size)
    one, _ = gradients(splats, camera, grad_image, None, form)
    other, _ = gradients(splats, camera, grad_image, np.zeros(size[::-1], np.float32), form)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_both_forms_agree_record_by_record():
    size = (90, 70)
    splats, camera = random_splats(2000, seed=8), off_centre_camera(size)
    splats[3][:] *= 0.1
    (_, one), (_, other) = (
        gradients(splats, camera, *random_gradients(size), form) for form in FORMS
    )
    for slot in range(11):
        error = np.linalg.norm(one[:, slot] - other[:, slot]) / np.linalg.norm(one[:, slot])
        assert error <= 1e-5, slot


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16, 17])
def test_the_last_few_splats_project_as_in_a_longer_list(count):
    """Eight lie in a vector; what is left is read and written by itself, to the same bits."""
    d, camera = device(), off_centre_camera((90, 70))
    splats = random_splats(24, seed=3)
    grad = np.random.default_rng(2).normal(size=(24, 12)).astype(np.float32)
    found = []
    for n in (24, count):
        arrays = upload([a[:n] for a in splats])
        projected = project(d, *arrays, camera)
        back = project_backward(d, *arrays, camera, projected, d.upload(grad[:n]))
        found.append([d.download(a) for a in (projected.record, projected.depth, *back)])
    for whole, part in zip(*found, strict=True):
        np.testing.assert_array_equal(part, whole[:count])


@pytest.mark.parametrize("with_depth", [False, True])
@pytest.mark.parametrize("size", [(90, 70), (16, 16), (17, 1), (3, 33)])
@pytest.mark.parametrize(("thinner", "bound"), [(0.1, 1e-5), (1.0, 1e-4)])
def test_blocks_of_eight_and_sixteen_pixels_give_the_same(size, with_depth, thinner, bound):
    """Another order of sums where nothing stops early (thinner).  Else wider blocks go on for
    their neighbours' sake where less light is left than STOP, 1e-5, of a colour or a depth."""
    splats, camera = random_splats(2000, seed=8, scale=0.05), off_centre_camera(size)
    splats[3][:] *= thinner
    images, records = [], []
    for lanes in (8, 16):
        d = replace(device(), lanes=lanes)
        arrays = upload(splats)
        projected = project(d, *arrays, camera)
        tiles = bin_tiles(d, projected, size)
        upstream = [d.upload(g) for g in random_gradients(size)]
        if with_depth:
            surfaces = surface(d, *arrays[:3], camera, projected)
            drawn = rasterize_depth(d, projected, tiles, surfaces, size, BACKGROUND)
            back = rasterize_depth_backward(d, projected, tiles, drawn, *upstream, upstream[1])
            images.append([drawn.frame.image, drawn.frame.transmittance, drawn.metres])
            records.append([*back])
        else:
            frame = rasterize(d, projected, tiles, size, BACKGROUND)
            back = rasterize_backward(d, projected, tiles, frame, *upstream, weight=True)
            images.append([frame.image, frame.transmittance])
            records.append([back])
    depth = projected.depth.get()
    most = (1.0, 1.0, depth[depth < 1e30].max())  # of what one splat can give to a pixel
    for one, other, at_most in zip(*images, most, strict=False):
        np.testing.assert_allclose(one.get(), other.get(), rtol=1e-6, atol=1e-5 * at_most)
    for one, other in zip(*records, strict=True):
        error = np.linalg.norm(one.get() - other.get(), axis=0)
        assert np.all(error <= bound * np.linalg.norm(one.get(), axis=0))


def test_absolute_sums_bound_the_gradients_of_the_mean():
    size = (90, 70)
    splats, camera = random_splats(500, seed=8), off_centre_camera(size)
    _, record = gradients(splats, camera, *random_gradients(size))
    assert np.all(record[:, 9:11] >= np.abs(record[:, :2]) * (1 - 1e-4) - 1e-6)
    assert (record[:, 9:11] > 2 * np.abs(record[:, :2])).mean() > 0.3  # signs do cancel


@pytest.mark.parametrize("form", FORMS)
def test_absolute_sums_can_be_left_out(form):
    size = (40, 30)
    splats, camera = random_splats(100, seed=4), off_centre_camera(size)
    _, whole = gradients(splats, camera, *random_gradients(size), form)
    _, part = gradients(splats, camera, *random_gradients(size), form, absolute=False)
    np.testing.assert_allclose(part[:, :9], whole[:, :9], rtol=1e-5, atol=1e-6)
    assert whole[:, 9:11].any() and not part[:, 9:].any()


@pytest.mark.parametrize("form", FORMS)
def test_the_early_stop_costs_no_more_than_rounding(form):
    """Opaque splats in many layers: most intersections lie behind the stop, the twin has none."""
    size = (60, 44)
    splats, camera = random_splats(400, seed=6, scale=0.25, spread=0.3), off_centre_camera(size)
    splats[3][:] = np.maximum(splats[3], 0.5)
    upstream = random_gradients(size)
    got, _ = gradients(splats, camera, *upstream, form)
    loss = loss_of(splats, 4, camera, *upstream)  # linear in the colours: any step is exact
    direction = np.random.default_rng(1).normal(size=splats[4].shape)
    start = as_double(splats)[4]
    want = (loss(start + direction) - loss(start - direction)) / 2
    have = float((got[4].astype(np.float64) * direction).sum())
    assert abs(have - want) <= 1e-5 * np.linalg.norm(got[4]) * np.sqrt(direction.size)


def test_culled_splats_and_those_behind_the_stop_have_zero_gradients():
    size = (32, 32)
    splats, camera = random_splats(3000, seed=6, scale=0.5, spread=0.2), off_centre_camera(size)
    splats[3][:] = 0.98
    splats[0][:5] = np.nan
    got, record = gradients(splats, camera, *random_gradients(size))
    assert np.isfinite(record).all() and all(np.isfinite(g).all() for g in got)
    assert not record[:5].any() and not any(g[:5].any() for g in got)
    assert (record == 0).all(axis=1).mean() > 0.3


@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize("form", FORMS)
def test_none_and_one_splat(count, form):
    size = (17, 15)
    splats, camera = random_splats(count, seed=3, scale=0.3, spread=0.1), off_centre_camera(size)
    got, record = gradients(splats, camera, *random_gradients(size), form)
    assert [g.shape for g in got] == [a.shape for a in splats]
    assert record.shape == (count, 12) and (count == 0 or np.abs(record).max() > 0)


def test_a_zero_quaternion_is_culled_and_any_length_gives_the_same_image():
    size = (40, 30)
    splats, camera = random_splats(60, seed=4), off_centre_camera(size)
    upstream = random_gradients(size)
    one, record = gradients(splats, camera, *upstream)
    splats[2] = splats[2] * np.float32(2.0**70)
    other, same = gradients(splats, camera, *upstream)
    np.testing.assert_array_equal(record, same)
    np.testing.assert_allclose(other[2] * 2.0**70, one[2], rtol=1e-5, atol=1e-7)
    splats[2][:] = 0
    _, none = gradients(splats, camera, *upstream)
    assert not none.any()


FINGERPRINT = """
import hashlib, sys
sys.path.insert(0, "tests")
import numpy as np
from tests.rasterizer.test_rasterizer_gradients import *
size = (200, 136)
splats, camera = random_splats(9000, seed=8), off_centre_camera(size)
for form in FORMS:
    got, record = gradients(splats, camera, *random_gradients(size), form)
    print(hashlib.sha256(b"".join(a.tobytes() for a in [*got, record])).hexdigest())
"""


def test_the_same_bits_over_runs_and_thread_counts():
    prints = []
    for threads in ("1", "2", "2", "5"):
        run = subprocess.run(
            [sys.executable, "-c", FINGERPRINT],
            cwd=ROOT,
            env={**os.environ, "POCL_MAX_PTHREAD_COUNT": threads, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=True,
        )
        prints.append(run.stdout.split())
    assert len(prints[0]) == 2 and all(p == prints[0] for p in prints)
