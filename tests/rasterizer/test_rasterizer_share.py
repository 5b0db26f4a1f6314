"""rasterizer/ backward, what growing reads: each splat's weight and its share of an error map."""

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize, rasterize_backward
from tests.support.renderer.rasterizer_reference import render_reference
from tests.support.renderer.rasterizer_scenes import (
    as_double,
    device,
    off_centre_camera,
    random_splats,
    upload,
)

FORMS = ("cpu", "gpu")


def records(splats: list, camera, grad_image, form: str, **extra) -> np.ndarray:
    """(N, 12) of rasterize_backward; a map in `extra` is uploaded."""
    d = device()
    projected = project(d, *upload(splats), camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    frame = rasterize(d, projected, tiles, camera.size, form=form)
    maps = {n: d.upload(v) if isinstance(v, np.ndarray) else v for n, v in extra.items()}
    grad = d.upload(grad_image)
    return d.download(rasterize_backward(d, projected, tiles, frame, grad, None, form, **maps))


def weights_reference(splats: list, camera) -> np.ndarray:
    """(N, H, W) alpha times transmittance of each splat: a picture where it alone has colour."""
    doubles = as_double(splats)
    found = []
    for i in range(len(doubles[0])):
        color = np.zeros_like(doubles[4])
        color[i] = 1
        found.append(render_reference((*doubles[:4], color), camera)[0][0])
    return np.array(found)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", [(37, 26), (16, 16), (15, 33), (1, 1)])
def test_share_and_weight_equal_the_sums_over_pixels(form, size):
    splats, camera = random_splats(40, seed=21, scale=0.15), off_centre_camera(size)
    rng = np.random.default_rng(3)
    error = rng.random(size[::-1]).astype(np.float32)
    grad = rng.normal(size=(3, *size[::-1])).astype(np.float32)
    got = records(splats, camera, grad, form, error=error, weight=True)
    weights = weights_reference(splats, camera)
    wanted = (weights * error).sum(axis=(1, 2))
    np.testing.assert_allclose(got[:, 9], wanted, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(got[:, 11], weights.sum(axis=(1, 2)), rtol=1e-5, atol=1e-5)
    assert not got[:, 10].any()


@pytest.mark.parametrize("form", FORMS)
def test_what_growing_reads_leaves_the_gradients_alone(form):
    size = (90, 70)
    splats, camera = random_splats(500, seed=8), off_centre_camera(size)
    rng = np.random.default_rng(0)
    error = rng.random(size[::-1]).astype(np.float32)
    grad = rng.normal(size=(3, *size[::-1])).astype(np.float32)
    plain = records(splats, camera, grad, form)
    both = records(splats, camera, grad, form, weight=True)
    share = records(splats, camera, grad, form, error=error, weight=True)
    np.testing.assert_allclose(both[:, :11], plain[:, :11], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(share[:, :9], plain[:, :9], rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(both[:, 11], share[:, 11])
    assert not plain[:, 11].any() and (both[:, 11] > 0).any()


@pytest.mark.parametrize("form", FORMS)
def test_behind_the_early_stop_a_splat_has_no_share(form):
    size = (32, 32)
    splats, camera = random_splats(3000, seed=6, scale=0.5, spread=0.2), off_centre_camera(size)
    splats[3][:] = 0.98
    splats[0][:5] = np.nan
    error = np.ones(size[::-1], np.float32)
    got = records(splats, camera, np.zeros((3, *size[::-1]), np.float32), form, error=error)
    assert np.isfinite(got).all() and not got[:5].any()
    total = got[:, 9].sum(dtype=np.float64)
    assert 0.9 * size[0] * size[1] < total <= size[0] * size[1] * (1 + 1e-5)
    assert (got[:, 9] == 0).mean() > 0.3
