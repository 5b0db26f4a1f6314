"""Large splats: lists leave out what their ellipse misses, gradients do not notice."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import Projected, project
from shapeshift.rasterizer.raster import FORMS as RASTER_FORMS
from shapeshift.rasterizer.raster import defines_of, rasterize, rasterize_backward
from tests.support.renderer.rasterizer_scenes import (
    device,
    off_centre_camera,
    random_splats,
    upload,
)

FORMS = ("cpu", "gpu")
BOX = 2 << 24  # of a place, as in common/tiles.cl
LEAST = 1 / 255


def ellipses(centres, sigmas, turns, opacity=0.9) -> Projected:
    """Records on the screen: centres (N, 2) and sigmas (N, 2) in pixels, turns (N,) in radians."""
    count = len(centres)
    sigmas = np.asarray(sigmas, np.float64)
    cos, sin = np.cos(turns), np.sin(turns)
    turn = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1)  # (N, 2, 2)
    covariance = turn * (sigmas**2)[:, None, :] @ turn.transpose(0, 2, 1)
    conic = turn * (sigmas**-2.0)[:, None, :] @ turn.transpose(0, 2, 1)
    power_threshold = np.full(count, 2 * np.log(opacity / LEAST))
    extent = np.sqrt(power_threshold[:, None] * np.diagonal(covariance, axis1=1, axis2=2))
    rng = np.random.default_rng(0)
    record = np.column_stack(
        [centres, conic[:, 0, 0], conic[:, 0, 1], conic[:, 1, 1], np.full(count, opacity),
         rng.random((count, 3)), extent, power_threshold]
    ).astype(np.float32)  # fmt: skip
    d = device()
    return Projected(d.upload(record), d.upload(rng.uniform(1, 2, count).astype(np.float32)))


def pairs(tiles) -> set:
    """(tile, splat) of the lists."""
    d, cells = device(), tiles.grid[0] * tiles.grid[1]
    starts, intersections = d.download(tiles.starts), d.download(tiles.intersections)
    return {
        (tile, int(i))
        for tile in range(cells)
        for i in intersections[starts[tile] : starts[tile + 1]]
    }


def touched(projected: Projected, grid: tuple[int, int]) -> set:
    """(tile, splat) of every pixel that the float32 rule of the rasterizer colours."""
    record = device().download(projected.record)
    x = np.arange(16 * grid[0], dtype=np.float32) + np.float32(0.5)
    y = np.arange(16 * grid[1], dtype=np.float32)[:, None] + np.float32(0.5)
    found = set()
    for i, (mean_x, mean_y, a, b, c) in enumerate(record[:, :5]):
        dx, dy = x - mean_x, y - mean_y
        rows, columns = np.nonzero(a * dx * dx + 2 * b * dx * dy + c * dy * dy <= record[i, 11])
        found |= {(t, i) for t in np.unique(rows // 16 * grid[0] + columns // 16).tolist()}
    return found


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("longest", [40.0, 150.0, 900.0, 1e5])
@pytest.mark.parametrize("shape", [1.0, 0.2, 0.01, 1e-4])
def test_no_pixel_is_lost_and_few_tiles_are_listed_in_vain(form, longest, shape):
    rng, size, count = np.random.default_rng(int(longest)), (400, 300), 60
    least = np.maximum(longest * shape, 0.55)  # the low pass makes none thinner
    sigmas = np.column_stack([np.full(count, longest), np.full(count, least)])
    turns = np.r_[0, np.pi / 2, np.pi / 4, rng.uniform(0, np.pi, count - 3)]
    # Thin ones pass through the image, whose corners are the hard part.
    centres = rng.uniform((-30, -30), (430, 330), (count, 2))
    d, projected = device(), ellipses(centres, sigmas, turns)
    tiles = bin_tiles(d, projected, size, form)
    assert (d.download(tiles.tile_bounds)[:, 0] & BOX).any()
    listed, wanted = pairs(tiles), touched(projected, tiles.grid)
    assert len(listed) <= tiles.count

    assert listed >= wanted
    if longest < 1e4:  # beyond, rounding of the test itself decides
        assert len(listed) <= 1.25 * len(wanted) + count, (len(listed), len(wanted), tiles.count)


def test_thin_diagonal_splats_were_mostly_listed_in_vain():
    count = 20
    projected = ellipses(
        np.tile([[200.0, 150.0]], (count, 1)), np.tile([[60.0, 2.0]], (count, 1)),
        np.linspace(0.6, 0.9, count),
    )  # fmt: skip
    tiles = bin_tiles(device(), projected, (400, 300))
    assert len(pairs(tiles)) < 0.35 * tiles.count


@pytest.mark.parametrize("value", [0.0, 1e-38, 1e-30, 1e30, np.nan, np.inf])
@pytest.mark.parametrize("column", [2, 3, 4, 11])
@pytest.mark.parametrize("form", FORMS)
def test_both_kernels_agree_on_records_that_are_no_ellipses(form, column, value):
    """Lists hold what was counted: no tile's run is overwritten, each splat comes once a tile."""
    rng = np.random.default_rng(3)
    projected = ellipses(rng.uniform(0, 300, (50, 2)), np.full((50, 2), 90.0), rng.random(50))
    d = device()
    record = d.download(projected.record)
    record[::3, column] = value
    tiles = bin_tiles(d, Projected(d.upload(record), projected.depth), (300, 300), form)
    starts = d.download(tiles.starts)
    cells = tiles.grid[0] * tiles.grid[1]
    assert len(pairs(tiles)) == starts[cells] <= tiles.count


@pytest.mark.parametrize("form", FORMS)
def test_gradients_are_those_of_full_boxes(form):
    """Tiles that are left out give nothing, and what is in their slots is not added."""
    d, size = device(), (300, 200)
    splats, camera = random_splats(400, seed=2, scale=0.2), off_centre_camera(size)
    splats[3][:] *= 0.1  # nothing stops early
    projected = project(d, *upload(splats), camera, form=form)
    rng = np.random.default_rng(1)
    grad = d.upload(rng.normal(size=(3, size[1], size[0])).astype(np.float32))
    found = []
    for poison in (0.0, np.nan):
        tiles = bin_tiles(d, projected, size, form)
        assert len(pairs(tiles)) < 0.95 * tiles.count
        frame = rasterize(d, projected, tiles, size, form=form)
        slots = d.empty((tiles.count, 12))
        slots.fill(np.float32(poison))
        del slots  # back to the pool, from where the backward pass takes its own
        found.append(d.download(rasterize_backward(d, projected, tiles, frame, grad, form=form)))
        assert np.isfinite(found[-1]).all()
    np.testing.assert_array_equal(*found)


# Every pair of two of the four once or more.
LEFT_OUT = [
    ((8, 16)[(i // 3 + j) % 2], longest, shape, (0.004, 0.1, 0.9)[(i + j) % 3])
    for i, longest in enumerate((1.0, 4.0, 15.0, 100.0, 900.0, 1e5))
    for j, shape in enumerate((1.0, 0.3, 0.05, 1e-3, 1e-6))
]


@pytest.mark.parametrize(("lanes", "longest", "shape", "opacity"), LEFT_OUT)
def test_blocks_that_are_left_out_change_no_bit(lanes, longest, shape, opacity):
    """Within a tile, too: picture and gradients beside those of a pass over every block."""
    rng, size, count = np.random.default_rng(int(longest)), (120, 90), 150
    sigmas = np.tile([[longest, max(longest * shape, 0.55)]], (count, 1))
    centres = rng.uniform((-20, -20), (140, 110), (count, 2))
    turns = np.r_[0, np.pi / 2, np.pi / 4, 1e-4, rng.uniform(0, np.pi, count - 4)]
    projected = ellipses(centres, sigmas, turns, opacity)
    usual = replace(device(), lanes=lanes)
    every = replace(usual, programs={})
    path = RASTER_FORMS["cpu"][0]
    for more in ({}, {"ABSOLUTE": 1}):
        defines = defines_of(usual, "cpu") | more
        key = (str(path), tuple(sorted(defines.items())))
        every.programs[key] = device().program(path, **defines, EVERY_BLOCK=1)
    grad = device().upload(rng.normal(size=(3, size[1], size[0])).astype(np.float32))
    found = []
    for where in (usual, every):
        tiles = bin_tiles(where, projected, size, "cpu")
        frame = rasterize(where, projected, tiles, size, form="cpu")
        backward = rasterize_backward(where, projected, tiles, frame, grad, form="cpu")
        found.append([where.download(a) for a in (frame.image, frame.transmittance, backward)])
    assert found[0][1].min() < 1
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_cpu_form_goes_back_through_its_own_images_alone():
    """It goes by the blocks that its forward pass wrote down."""
    d, size = device(), (40, 30)
    projected = ellipses([[20, 15]], [[3, 2]], np.zeros(1))
    tiles = bin_tiles(d, projected, size)
    grad = d.zeros((3, size[1], size[0]))
    frame = rasterize(d, projected, tiles, size, form="cpu")
    with pytest.raises(ValueError, match="CPU form"):
        other = replace(frame, drawn_blocks=None)
        rasterize_backward(d, projected, tiles, other, grad, form="cpu")
