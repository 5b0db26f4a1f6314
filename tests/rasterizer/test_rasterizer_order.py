"""An order of splats and the lists made of it: both forms alike, to the last entry."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles, quantize_keys, sort_order, sort_pairs
from shapeshift.rasterizer.project import grid_of, project
from shapeshift.rasterizer.project_arena import SortFrames, project_arena
from tests.support.renderer.rasterizer_scenes import (
    arena,
    device,
    off_centre_camera,
    random_splats,
    upload,
)

SIZES = ((90, 50), (33, 70))  # pixels; no side is a whole number of tiles
COUNTS = (0, 1, 2, 255, 256, 257, 2047, 2048, 2049, 4111)  # around a group and a span of the sort


def lists_of(tiles, size: tuple[int, int]) -> list[list[int]]:
    across, down = grid_of(size)
    starts, entries = device().download(tiles.starts), device().download(tiles.intersections)
    return [entries[starts[t] : starts[t + 1]].tolist() for t in range(across * down)]


def projected_in(count: int, frames: int, keep_outside: bool = False):
    """Two views of splats of which some are absent, with one order or with one each."""
    splats = random_splats(count, seed=count)
    cameras = [off_centre_camera(size) for size in SIZES]
    mean_opacity, *others = arena(splats)
    rows = device().download(mean_opacity)
    rows[np.random.default_rng(count).random(count) < 0.2, 3] = -1
    sort = SortFrames(tuple(c.camera_from_world for c in cameras[:frames]), False, keep_outside)
    given = (device().upload(rows), *others, np.eye(4)[None], cameras)
    return project_arena(device(), *given, sort=sort)


@pytest.mark.parametrize("count", [*COUNTS, 256 * 2048 + 1])  # the last: two rounds of the scan
def test_pairs_are_sorted_as_numpy_sorts_them(count):
    rng = np.random.default_rng(count)
    anything = rng.integers(0, 2**32, count, dtype=np.uint32)
    cases = {  # keys, bits, base
        "all bits": (anything, 32, 0),
        "equal": (np.full(count, 0xFFFFFFFF, np.uint32), 32, 0),
        "few": (anything % 3 << np.uint32(7), 9, 0),
        "a range": (np.uint32(0x3F000001) + anything % 0xFFFFFF, 24, 0x3F000001),
        "no bits": (anything * 0, 0, 0),
    }
    for name, (keys, bits, base) in cases.items() if count < 5000 else [*cases.items()][3:4]:
        values = np.arange(count, dtype=np.int32)[::-1].copy()
        given = device().upload(keys), device().upload(values)
        got = [device().download(a) for a in sort_pairs(device(), *given, bits, base)]
        order = np.argsort(keys, kind="stable")
        np.testing.assert_array_equal(got[0], keys[order], name)
        np.testing.assert_array_equal(got[1], values[order], name)


@pytest.mark.parametrize("frames", [1, 2])
@pytest.mark.parametrize("keep_outside", [False, True])
@pytest.mark.parametrize("count", COUNTS)
def test_both_forms_sort_and_list_alike(count, frames, keep_outside):
    views = projected_in(count, frames, keep_outside)
    orders = {
        form: [sort_order(device(), view.in_tiles, form) for view in views[:frames]]
        for form in ("gpu", "cpu")  # the CPU form turns the table of counts into positions
    }
    for here, there in zip(*orders.values(), strict=True):
        np.testing.assert_array_equal(device().download(here), device().download(there))
    for i, (view, size) in enumerate(zip(views, SIZES, strict=True)):
        order = orders["cpu"][i % frames]
        made = [bin_tiles(device(), view, size, form, order) for form in ("gpu", "cpu")]
        assert lists_of(made[0], size) == lists_of(made[1], size)
        assert made[0].count == made[1].count
        found = [device().download(tiles.slots(device())) for tiles in made]
        np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("count", [0, 1, 2049])
def test_lists_of_hidden_tiles_are_empty_and_the_others_as_they_were(count, share):
    views, size = projected_in(count, 1), SIZES[0]
    across, down = grid_of(size)
    hidden = np.random.default_rng(count).random((down, across)) < share
    order = sort_order(device(), views[0].in_tiles, "gpu")
    whole = lists_of(bin_tiles(device(), views[0], size, "gpu", order), size)
    made = lists_of(bin_tiles(device(), views[0], size, "gpu", order, hidden), size)
    assert made == [[] if h else t for h, t in zip(hidden.ravel(), whole, strict=True)]


def test_the_order_is_that_of_the_depths_and_the_lists_those_of_the_other_projection():
    """numpy sorts the depths; `project`, with lists of its own, puts the same splats in them."""
    count, camera = 3000, off_centre_camera(SIZES[0])
    splats = random_splats(count, seed=8)
    view = project_arena(device(), *arena(splats), np.eye(4)[None], [camera])[0]
    order = device().download(sort_order(device(), view.in_tiles, "gpu"))
    depth = device().download(view.depth)
    # Not those that lie between the centres of pixels: they touch no tile.
    seen = np.flatnonzero(device().download(view.in_tiles.tile_bounds)[:, 0] > 0)
    np.testing.assert_array_equal(order, seen[np.argsort(depth[seen], kind="stable")])
    lists = lists_of(bin_tiles(device(), view, SIZES[0], "gpu", device().upload(order)), SIZES[0])
    other = bin_tiles(device(), project(device(), *upload(splats), camera), SIZES[0], "gpu")
    # Both projections round a little differently: a splat that ends at a tile's edge may differ.
    differ = sum(
        len(set(a) ^ set(b)) for a, b in zip(lists, lists_of(other, SIZES[0]), strict=True)
    )
    assert differ <= 1e-3 * sum(map(len, lists))


def test_steps_instead_of_keys_are_sorted_by_step_and_index():
    """quantize_keys leaves steps of 65535: of one step the lower index is first, in both forms."""
    view = projected_in(4111, 1)[0]
    quantize_keys(device(), view.in_tiles)
    pairs = device().download(view.in_tiles.pairs)
    count = device().download(view.in_tiles.status)[:, 0]
    chunk = view.in_tiles.chunk
    packed = np.concatenate([pairs[c * chunk :][:n] for c, n in enumerate(count)])
    order = device().download(sort_order(device(), view.in_tiles, "gpu"))
    np.testing.assert_array_equal(order, packed[np.argsort(packed[:, 1], kind="stable"), 0])


@pytest.mark.parametrize("size", [(45, 25), (640, 480)])
def test_the_same_order_on_another_grid(size):
    """As a picture of depth with fewer pixels takes it."""
    view = projected_in(2049, 1)[0]
    order = sort_order(device(), view.in_tiles, "gpu")
    for given in (view, replace(view, scratch=None)):
        lists = [lists_of(bin_tiles(device(), given, size, f, order), size) for f in ("gpu", "cpu")]
        assert lists[0] == lists[1] and any(lists[0])
