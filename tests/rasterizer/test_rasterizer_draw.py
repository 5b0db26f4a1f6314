"""Drawing for the screen (draw_cpu.cl) against float64 and the training kernels."""

import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.project import Camera, Projected, project
from shapeshift.rasterizer.raster import (
    MIN_TRANSMITTANCE,
    rasterize,
    rasterize_rgba,
    rasterize_rgba_views,
)
from tests.support.renderer.rasterizer_reference import project_reference, rasterize_reference
from tests.support.renderer.rasterizer_scenes import (
    as_double,
    device,
    off_centre_camera,
    psnr,
    random_splats,
    upload,
)

STOP = MIN_TRANSMITTANCE
BATCH = 32
SIZES = [(1, 1), (3, 40), (15, 17), (16, 16), (17, 15), (33, 8), (83, 45)]


def draw(splats: list, camera: Camera) -> np.ndarray:
    d = device()
    projected = project(d, *upload(splats), camera)
    return rasterize_rgba(d, projected, bin_tiles(d, projected, camera.size), camera.size)


def expected(splats: list, camera: Camera) -> np.ndarray:
    """(H, W, 4) float64."""
    image, through = rasterize_reference(
        *project_reference(*as_double(splats), camera), camera.size
    )
    return np.concatenate([image.transpose(1, 2, 0), 1 - through[..., None]], axis=2)


def check(splats: list, camera: Camera, least_db: float = 75) -> None:
    image, want = draw(splats, camera), expected(splats, camera)
    assert image.shape == want.shape and np.isfinite(image).all()
    assert psnr(image, want) >= least_db
    # A pixel on the threshold of 1/255 may fall either way in float32, one at the stop ends there.
    assert np.abs(image - want).max() <= 1 / 255 + STOP


@pytest.mark.parametrize("form", ["cpu", "gpu"])
@pytest.mark.parametrize("least", [1e-5, 1e-4, 1 / 2048, 1 / 64, 0.1])
def test_an_early_stop_costs_what_it_leaves_out_and_no_more(form, least):
    """Behind `least` of transmittance lies at most that much colour, in every pixel."""
    splats, camera = random_splats(400, seed=5, scale=0.3), off_centre_camera((60, 40))
    splats[3][:] = 0.9
    d = device()
    projected = project(d, *upload(splats), camera)
    binned = (projected, bin_tiles(d, projected, camera.size))
    whole = rasterize_rgba(d, *binned, camera.size, form, min_transmittance=1e-6).copy()
    short = rasterize_rgba(d, *binned, camera.size, form, min_transmittance=least)
    error = np.abs(short - whole).max()
    assert error <= least + 1e-6
    assert error > 0 or least < 1e-4  # the shortcut is taken


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("count", [0, 1, BATCH - 1, BATCH, BATCH + 1, 2 * BATCH + 1, 500])
def test_every_size_and_length_of_a_list_matches_float64(size, count):
    check(random_splats(count, seed=count + size[0], scale=0.2), off_centre_camera(size), 70)


class Used(Device):
    """A device whose memory holds what is not a number where nothing was written."""

    def empty(self, shape, dtype=np.float32):
        array = super().empty(shape, dtype)
        if array.size and dtype == np.float32:
            array.set(np.full(shape, np.nan, np.float32))
        return array


# Widths of whole cache lines, of whole blocks alone, and of neither.
@pytest.mark.parametrize("size", [(16, 16), (64, 48), (64, 41), (36, 33), (83, 45)])
@pytest.mark.parametrize("count", [0, 1])
def test_tiles_that_no_splat_reaches_are_nothing_in_every_pixel(size, count):
    splats, camera = random_splats(count, seed=3, scale=1e-3), off_centre_camera(size)
    d = device()
    used = Used(*(getattr(d, field.name) for field in fields(Device)))
    projected = project(d, *upload(splats), camera)
    tiles = bin_tiles(d, projected, size)
    lengths = np.diff(d.view(tiles.starts)[: tiles.grid[0] * tiles.grid[1] + 1])
    image = rasterize_rgba(used, projected, tiles, size)
    hit = np.repeat(np.repeat(lengths.reshape(tiles.grid[::-1]), 16, 0), 16, 1)[
        : size[1], : size[0]
    ]
    assert np.isfinite(image).all()
    assert (image[hit == 0] == 0).all()
    assert (hit == 0).any() or size == (16, 16)


@pytest.mark.parametrize("seed", range(6))
def test_needles_lose_no_pixel(seed):
    splats, camera = random_splats(60, seed), off_centre_camera((83, 45))
    splats[1][:] = [3.0, 2e-3, 2e-3]  # up to 100 px long in any direction, as thin as the low pass
    splats[3][:] = 0.9
    check(splats, camera, 70)


@pytest.mark.parametrize("scale", [1e-30, 1e-8, 1e3, 1e6])
def test_tiny_and_huge_splats(scale):
    check(random_splats(30, seed=8, scale=scale), off_centre_camera((50, 35)), 60)


def test_one_splat_over_all_tiles_and_nothing_behind_a_wall_of_them():
    splats, camera = random_splats(200, seed=3), off_centre_camera((100, 70))
    splats[0][:100] *= 0.01
    splats[1][:100] = 50.0
    splats[3][:100] = 0.98
    check(splats, camera, 60)


@pytest.mark.parametrize("size", SIZES)
def test_where_nothing_stops_it_is_the_picture_of_the_training_kernels(size):
    count = 700 if min(size) > 8 else 20
    splats, camera, d = random_splats(count, seed=7), off_centre_camera(size), device()
    splats[3][:] *= 0.2
    projected = project(d, *upload(splats), camera)
    tiles = bin_tiles(d, projected, size)
    frame = rasterize(d, projected, tiles, size)
    rgba = rasterize_rgba(d, projected, tiles, size)
    image, through = d.download(frame.image), d.download(frame.transmittance)
    assert through.min() > STOP
    np.testing.assert_allclose(rgba[..., :3], image.transpose(1, 2, 0), atol=1e-5)
    np.testing.assert_allclose(rgba[..., 3], 1 - through, atol=1e-5)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e-42, 3e38, 0.0])
@pytest.mark.parametrize("column", range(12))
def test_a_broken_record_spoils_no_other_tile(value, column):
    """Projection never leaves such records; memory stays safe and other tiles whole even so."""
    d, camera = device(), off_centre_camera((80, 48))
    splats = random_splats(80, seed=5)
    projected = project(d, *upload(splats), camera)
    tiles = bin_tiles(d, projected, camera.size)
    whole = rasterize_rgba(d, projected, tiles, camera.size).copy()
    record = d.download(projected.record)
    starts, lists = d.download(tiles.starts), d.download(tiles.intersections)
    bad = int(lists[0])
    record[bad, column] = value
    broken = Projected(d.upload(record), projected.depth)
    image = rasterize_rgba(d, broken, tiles, camera.size)
    for tile in range(tiles.grid[0] * tiles.grid[1]):
        if bad in lists[starts[tile] : starts[tile + 1]]:
            continue
        y, x = 16 * (tile // tiles.grid[0]), 16 * (tile % tiles.grid[0])
        here = np.s_[y : y + 16, x : x + 16]
        np.testing.assert_array_equal(image[here], whole[here])


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_views_drawn_together_are_bit_for_bit_those_drawn_alone(count):
    d, size, views = device(), (83, 45), []
    for seed in range(count):
        projected = project(d, *upload(random_splats(300, seed)), off_centre_camera(size))
        views.append((projected, bin_tiles(d, projected, size)))
    for image, view in zip(rasterize_rgba_views(d, views, size), views, strict=True):
        np.testing.assert_array_equal(image, rasterize_rgba(d, *view, size))


DRAWN_ELSEWHERE = """
import hashlib, sys
sys.path[:0] = [{root!r}, {tests!r}]
from tests.rasterizer.test_rasterizer_draw import draw, off_centre_camera, random_splats
image = draw(random_splats(9000, 1), off_centre_camera((200, 130)))
print(hashlib.sha256(image.tobytes()).hexdigest())
"""


def test_the_number_of_threads_does_not_change_a_bit():
    tests = Path(__file__).parents[1]
    script = DRAWN_ELSEWHERE.format(root=str(tests.parent), tests=str(tests))
    told = set()
    for threads in ("1", "2", "3"):
        # Two names of the same setting, of older and newer versions of PoCL.
        names = {"POCL_MAX_PTHREAD_COUNT": threads, "POCL_CPU_MAX_CU_COUNT": threads}
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=os.environ | names, capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        told.add(done.stdout)
    assert len(told) == 1
