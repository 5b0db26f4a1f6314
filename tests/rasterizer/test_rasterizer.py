"""rasterizer/ forward: both forms against the float64 twin, at the sizes and values that break."""

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.project import LEAST_ALPHA, Camera, project
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.rasterizer.raster import rasterize, rasterize_rgba, rasterize_rgba_views
from tests.support.renderer.rasterizer_reference import project_reference, rasterize_reference
from tests.support.renderer.rasterizer_scenes import (
    arena,
    as_double,
    device,
    off_centre_camera,
    psnr,
    random_splats,
    upload,
)

FORMS = ("cpu", "gpu")
BACKGROUND = (0.2, 0.5, 0.9)


def draw(splats: list, camera: Camera, form: str = "cpu", background=BACKGROUND) -> tuple:
    d = device()
    projected = project(d, *upload(splats), camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    frame = rasterize(d, projected, tiles, camera.size, background, form)
    return d.download(frame.image), d.download(frame.transmittance), projected, tiles


def expected(splats: list, camera: Camera, background=BACKGROUND) -> tuple:
    return rasterize_reference(
        *project_reference(*as_double(splats), camera), camera.size, background
    )


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "size", [(1, 1), (15, 16), (16, 15), (17, 17), (33, 8), (75, 66), (8, 49), (128, 64)]
)
def test_image_matches_float64(size, form):
    splats, camera = random_splats(200, seed=sum(size)), off_centre_camera(size)
    image, through, *_ = draw(splats, camera, form)
    want_image, want_through = expected(splats, camera)
    assert image.shape == (3, size[1], size[0]) and through.shape == size[::-1]
    assert psnr(image, want_image) >= 75
    # A pixel on the threshold of 1/255 may fall either way in float32; the stop leaves < 1e-4.
    assert np.abs(image - want_image).max() <= 1 / 255
    # Where nothing was stopped early only float32 rounding is left.
    clear = want_through > 2e-4
    assert not clear.any() or np.median(np.abs(image - want_image)[:, clear]) <= 1e-6
    assert psnr(through, want_through) >= 75


@pytest.mark.parametrize("form", FORMS)
def test_dense_and_large_splats_match_float64(form):
    splats, camera = random_splats(3000, seed=3, scale=0.15), off_centre_camera((130, 90))
    image, *_ = draw(splats, camera, form)
    assert psnr(image, expected(splats, camera)[0]) >= 70


@pytest.mark.parametrize("form", FORMS)
def test_records_and_depths_match_float64(form):
    splats, camera = random_splats(500, seed=5), off_centre_camera((75, 66))
    d = device()
    projected = project(d, *upload(splats), camera, form=form)
    record, depth = project_reference(*as_double(splats), camera)
    got = d.download(projected.record)
    seen = record[:, 9] > 0
    assert 0 < seen.sum() < len(seen)
    np.testing.assert_array_equal(got[:, 9] > 0, seen)
    np.testing.assert_allclose(got[seen], record[seen], rtol=2e-5, atol=2e-5)
    np.testing.assert_allclose(d.download(projected.depth), depth.astype(np.float32), rtol=1e-6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 2047, 2048, 2049, 9000])
def test_lists_are_complete_sorted_and_stable(count, form):
    splats, camera = random_splats(count, seed=count), off_centre_camera((100, 70))
    splats[0][: count // 3] = splats[0][:1]  # equal depths: the order of the indices decides
    d = device()
    projected = project(d, *upload(splats), camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    depth, record = d.download(projected.depth), d.download(projected.record)
    visible = np.flatnonzero(d.download(tiles.tile_bounds)[:, 0] >= 1 << 24) if count else []
    wanted = np.argsort(depth, kind="stable")
    wanted = wanted[np.isin(wanted, visible)]
    np.testing.assert_array_equal(d.download(tiles.order), wanted)

    starts, intersections = d.download(tiles.starts), d.download(tiles.intersections)
    rank = np.full(count, -1)
    rank[wanted] = np.arange(len(wanted))
    assert starts[0] == 0 and starts[tiles.grid[0] * tiles.grid[1]] <= tiles.count
    touched = set()
    for tile in range(tiles.grid[0] * tiles.grid[1]):
        here = intersections[starts[tile] : starts[tile + 1]]
        assert np.all(np.diff(rank[here]) > 0)  # near to far, each splat once
        touched |= {(tile, i) for i in here.tolist()}
    assert touched >= pixels_touched(record, tiles.grid)
    assert len(touched) == starts[tiles.grid[0] * tiles.grid[1]]


def pixels_touched(record: np.ndarray, grid: tuple[int, int]) -> set:
    """(tile, splat) of every pixel of the image that a splat colours, by looking at all of them."""
    x, y = np.arange(16 * grid[0]) + 0.5, np.arange(16 * grid[1])[:, None] + 0.5
    found = set()
    for i in np.flatnonzero(record[:, 9] > 0):
        mean_x, mean_y, a, b, c = record[i, :5].astype(np.float64)
        dx, dy = x - mean_x, y - mean_y
        rows, columns = np.nonzero(a * dx * dx + 2 * b * dx * dy + c * dy * dy <= record[i, 11])
        found |= {(t, int(i)) for t in np.unique(rows // 16 * grid[0] + columns // 16).tolist()}
    return found


@pytest.mark.parametrize("size", [(75, 66), (300, 200), (16, 16)])
def test_both_forms_make_the_same_lists(size):
    camera, d = off_centre_camera(size), device()
    projected = project(d, *upload(random_splats(5000, seed=1, scale=0.1)), camera)
    one, other = (bin_tiles(d, projected, size, form) for form in FORMS)
    assert one.count == other.count > 0
    cells = one.grid[0] * one.grid[1]
    listed = d.download(one.starts)[cells]
    assert 0 < listed <= one.count
    for name, length in (("order", None), ("starts", cells + 1), ("intersections", listed)):
        np.testing.assert_array_equal(
            d.download(getattr(one, name))[:length], d.download(getattr(other, name))[:length]
        )


def test_a_wide_range_of_depths_takes_more_passes_and_stays_exact():
    splats = random_splats(6000, seed=2)
    splats[0][:, 2] = np.geomspace(1e-3, 1e6, 6000).astype(np.float32)[::-1]
    splats[0][:, :2] *= 0.4 * splats[0][:, 2:]
    splats[1][:] = 0.02 * splats[0][:, 2:]
    camera, d = Camera(np.eye(4), 90.0, 90.0, 32.0, 32.0, (64, 64), 1e-4), device()
    projected = project(d, *upload(splats), camera)
    depth = d.download(projected.depth)
    for form in FORMS:
        tiles = bin_tiles(d, projected, camera.size, form)
        order, visible = d.download(tiles.order), d.download(tiles.tile_bounds)[:, 0] >= 1 << 24
        assert len(order) > 4000
        wanted = np.argsort(depth, kind="stable")
        np.testing.assert_array_equal(order, wanted[visible[wanted]])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e-42, 3e38, -3e38, 0.0])
@pytest.mark.parametrize("group", range(5))
def test_broken_numbers_are_left_out_and_harm_nobody(group, value):
    splats, camera = random_splats(40, seed=9), off_centre_camera((40, 40))
    splats[group].reshape(40, -1)[::4, 0] = value
    image, through, projected, _ = draw(splats, camera)
    assert np.isfinite(image).all() and np.isfinite(through).all()
    d = device()
    for other in (projected, project_arena(d, *arena_of_any(splats), np.eye(4)[None], [camera])[0]):
        record, depth = d.download(other.record), d.download(other.depth)
        drawn = record[:, 9] > 0
        assert np.isfinite(record[drawn]).all() and np.all(depth[drawn] < 1e30)
        np.testing.assert_array_equal(depth[~drawn], np.float32(1e30))
    if not np.isfinite(value):
        assert not (d.download(projected.record)[::4, 9] > 0).any()
        keep = np.arange(40) % 4 != 0
        alone, *_ = draw([a[keep] for a in splats], camera)
        np.testing.assert_array_equal(image, alone)


def arena_of_any(splats: list) -> list:
    with np.errstate(all="ignore"):
        return arena(splats)


@pytest.mark.parametrize("form", FORMS)
def test_opacity_at_the_threshold_and_below_is_absent(form):
    splats, camera = random_splats(6, seed=4, scale=0.2, spread=0.1), off_centre_camera((48, 48))
    least = np.float32(LEAST_ALPHA)
    splats[3][:] = [least, np.nextafter(least, 0), np.nextafter(least, 1), 0, -1, 0.5]
    image, _, projected, tiles = draw(splats, camera, form)
    assert (device().download(projected.record)[:, 9] > 0).tolist() == [0, 0, 1, 0, 0, 1]
    alone, *_ = draw([a[5:] for a in splats], camera, form)
    assert np.abs(image - alone).max() <= 1.01 / 255
    assert 5 in device().download(tiles.order)


def test_behind_and_exactly_at_the_near_plane_is_culled():
    splats = random_splats(4, seed=4)
    splats[0][:] = [[0, 0, -1], [0, 0, 0], [0, 0, 0.5], [0, 0, np.nextafter(np.float32(0.5), 1)]]
    camera = Camera(np.eye(4), 40.0, 40.0, 20.0, 20.0, (40, 40), 0.5)
    _, _, projected, _ = draw(splats, camera)
    assert (device().download(projected.record)[:, 9] > 0).tolist() == [False, False, False, True]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("scale", [1e-30, 1e-8, 1e3, 1e6])
def test_tiny_and_huge_scales_match_float64(form, scale):
    splats, camera = random_splats(30, seed=8, scale=scale), off_centre_camera((50, 35))
    image, *_ = draw(splats, camera, form)
    assert psnr(image, expected(splats, camera)[0]) >= 60


def test_a_long_thin_splat_keeps_its_width():
    splats = random_splats(1, seed=8)
    splats[0][:] = 0
    splats[1][:] = [50.0, 1e-6, 1e-6]  # 1500 px long, as thin as the low pass lets it
    splats[2][:] = [0.9, 0.1, 0.2, 0.4]
    splats[3][:] = 0.9
    camera = off_centre_camera((90, 90))
    assert psnr(draw(splats, camera)[0], expected(splats, camera)[0]) >= 60


@pytest.mark.parametrize("form", FORMS)
def test_the_early_stop_ends_lists_and_does_not_show(form):
    splats, camera = random_splats(4000, seed=6, scale=0.5, spread=0.2), off_centre_camera((64, 48))
    splats[3][:] = 0.98
    d = device()
    projected = project(d, *upload(splats), camera, form=form)
    tiles = bin_tiles(d, projected, camera.size, form)
    frame = rasterize(d, projected, tiles, camera.size, BACKGROUND, form)
    cells = tiles.grid[0] * tiles.grid[1]
    starts, ends = d.download(tiles.starts), d.download(frame.tile_ends)
    assert np.all(ends >= starts[:cells]) and np.all(ends <= starts[1 : cells + 1])
    assert (ends < starts[1 : cells + 1]).mean() > 0.5
    want, _ = rasterize_reference(*project_reference(*as_double(splats), camera), camera.size)
    black = rasterize(d, projected, tiles, camera.size, (0, 0, 0), form)
    assert np.abs(d.download(black.image) - want).max() <= 2e-4


@pytest.mark.parametrize("form", FORMS)
def test_rgba_is_the_same_image_premultiplied(form):
    splats, camera = random_splats(700, seed=7), off_centre_camera((83, 45))
    splats[3][:] *= 0.2  # nothing stops early: drawing stops a little sooner than training
    image, through, projected, tiles = draw(splats, camera, form, (0, 0, 0))
    rgba = rasterize_rgba(device(), projected, tiles, camera.size, form)
    assert rgba.shape == (45, 83, 4) and not rgba.flags.writeable
    np.testing.assert_allclose(rgba[..., :3], image.transpose(1, 2, 0), atol=2e-6)
    np.testing.assert_allclose(rgba[..., 3], 1 - through, atol=2e-6)


def test_images_that_are_held_are_not_written_over():
    camera, d = off_centre_camera((83, 45)), device()
    held, copies = [], []
    for seed in range(4):
        projected = project(d, *upload(random_splats(300, seed)), camera)
        rgba = rasterize_rgba(d, projected, bin_tiles(d, projected, camera.size), camera.size)
        held.append(rgba)
        copies.append(rgba.copy())
    for a, b in zip(held, copies, strict=True):
        np.testing.assert_array_equal(a, b)


def test_splat_order_in_memory_does_not_matter_but_for_equal_depths():
    splats, camera = random_splats(500, seed=12), off_centre_camera((60, 40))
    shuffled = np.random.default_rng(0).permutation(500)
    one, *_ = draw(splats, camera)
    other, *_ = draw([a[shuffled] for a in splats], camera)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_several_views_are_the_same_as_each_alone(count, form):
    d, size, views = device(), (83, 45), []
    for seed in range(count):
        camera = off_centre_camera(size)
        projected = project(d, *upload(random_splats(300, seed)), camera)
        views.append((projected, bin_tiles(d, projected, size, form)))
    together = rasterize_rgba_views(d, views, size, form)
    assert len(together) == count
    for image, view in zip(together, views, strict=True):
        np.testing.assert_array_equal(image, rasterize_rgba(d, *view, size, form))
