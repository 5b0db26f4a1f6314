"""project_arena, the drawing form of projection: against `project`, its gates and its counts."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.project import CULL_REASONS, LEAST_ALPHA, Camera, project
from shapeshift.rasterizer.project_arena import Limits, SortFrames, project_arena
from shapeshift.rasterizer.reference import rotations
from tests.support.renderer.rasterizer_reference import project_reference
from tests.support.renderer.rasterizer_scenes import (
    arena,
    as_double,
    device,
    off_centre_camera,
    random_splats,
    upload,
)


def turned(seed: int) -> np.ndarray:
    """(4, 4) world_from_object."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    out = np.eye(4)
    out[:3, :3] = q * np.sign(np.linalg.det(q))
    out[:3, 3] = [0.1, -0.2, 0.3]
    return out


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 100, 4097])
def test_arena_projects_as_project_does(count):
    splats, camera, d = random_splats(count), off_centre_camera((90, 50)), device()
    one = project(d, *upload(splats), camera)
    other = project_arena(d, *arena(splats), np.eye(4)[None], [camera])[0]
    a, b = d.download(one.record), d.download(other.record)
    np.testing.assert_array_equal(a[:, 9] > 0, b[:, 9] > 0)
    seen = a[:, 9] > 0
    np.testing.assert_allclose(b[seen], a[seen], rtol=2e-4, atol=2e-4)
    np.testing.assert_allclose(d.download(other.depth), d.download(one.depth), rtol=1e-6)


def test_each_splat_follows_its_own_object():
    splats, camera, d = random_splats(203, seed=3), off_centre_camera((90, 50)), device()
    poses = np.stack([turned(s) for s in range(5)])
    mean_opacity, covariance, color, _ = arena(splats)
    index = np.sort(np.random.default_rng(1).integers(0, 5, 203)).astype(np.int32)
    index[:20] = np.arange(20) % 5  # and mixed within a vector
    rows = poses[:, :3].reshape(5, 12)
    got = project_arena(d, mean_opacity, covariance, color, d.upload(index), rows, [camera])[0]
    for k, pose in enumerate(poses):
        moved = Camera(
            camera.camera_from_world @ pose, camera.fx, camera.fy, camera.cx, camera.cy,
            camera.size, camera.near,
        )  # fmt: skip
        record, _ = project_reference(*as_double(splats), moved)
        mine = index == k
        seen = mine & (record[:, 9] > 0)
        np.testing.assert_array_equal(d.download(got.record)[mine, 9] > 0, seen[mine])
        np.testing.assert_allclose(d.download(got.record)[seen], record[seen], rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 15, 16, 17, 31, 33, 257, 4111])
def test_vectors_of_eight_and_of_sixteen_give_the_same_bits(count):
    """All that a projection leaves, of two views with colours of their own, where some splats are
    not numbers, some are absent or behind, and objects meet within a vector.
    """
    d, cameras = device(), [off_centre_camera((90, 50)), off_centre_camera((33, 70))]
    rng = np.random.default_rng(count)
    mean_opacity, covariance, color, _ = (d.download(a) for a in arena(random_splats(count, 5)))
    for array in (mean_opacity, covariance, color):
        array[rng.integers(0, max(1, count), count // 9), rng.integers(0, 3)] = np.nan
    mean_opacity[rng.random(count) < 0.2, 3] = -1
    index = d.upload(np.sort(rng.integers(0, 3, count)).astype(np.int32))
    arrays = [d.upload(a) for a in (mean_opacity, covariance, color)]
    poses = np.stack([turned(seed) for seed in range(3)])
    made = []
    for lanes in (8, 16):
        both = project_arena(
            replace(d, lanes=lanes), *arrays, index, poses, cameras,
            antialiased=(True, False, True), second_color=d.upload(color[::-1]),
        )  # fmt: skip
        made.append([])
        for one in both:
            tiles, record = one.in_tiles, d.download(one.record)
            record[record[:, 9] <= 0] = 0  # of what is culled the extent alone is said
            status = d.download(tiles.status)
            firsts = [tiles.chunk * i for i in range(len(status))]
            pairs = d.download(tiles.pairs)
            kept = [pairs[i : i + n] for i, n in zip(firsts, status[:, 0], strict=True)]
            rest = (one.depth, one.culled_counts, tiles.tile_bounds, tiles.table)
            made[-1] += [record, status, *kept, *map(d.download, rest)]
    for eight, sixteen in zip(*made, strict=True):
        assert eight.tobytes() == sixteen.tobytes()
    assert count < 257 or len(made[0][2]) > 50


def ramp(room: np.ndarray, band: float) -> np.ndarray:
    return np.clip(room / band, 0, 1) if 0 < band < np.inf else np.ones_like(room)


def gates_reference(splats: list, camera: Camera, limits: Limits) -> tuple[np.ndarray, np.ndarray]:
    """The plain twin in float64: which gate stops each splat (6: none does), faded opacity."""
    means, scales, wxyz, opacity, _ = as_double(splats)
    p = means @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
    distance, z = np.linalg.norm(p, axis=1), p[:, 2]
    least_x, most_x, least_y, most_y = camera.limits()
    with np.errstate(all="ignore"):
        x, y = np.clip(p[:, 0] / z, least_x, most_x), np.clip(p[:, 1] / z, least_y, most_y)
        zero = np.zeros_like(z)
        jacobian = np.stack([camera.fx / z, zero, -camera.fx * x / z, zero, camera.fy / z,
                             -camera.fy * y / z], axis=1).reshape(-1, 2, 3)  # fmt: skip
        axes = rotations(wxyz) * scales[:, None, :]
        half = jacobian @ camera.camera_from_world[:3, :3] @ axes
        sigma = half @ half.transpose(0, 2, 1) + limits.low_pass * np.eye(2)
        a, b, c = sigma[:, 0, 0], sigma[:, 0, 1], sigma[:, 1, 1]
        major = np.sqrt((a + c) / 2 + np.hypot((a - c) / 2, b))
        k = np.sqrt(2 * np.log(opacity / limits.min_alpha))
        at = np.stack([camera.fx * p[:, 0] / z + camera.cx, camera.fy * p[:, 1] / z + camera.cy])
        reach = k * np.sqrt([a, c])
    large, far, least = limits.max_pixels, limits.max_distance, limits.min_pixels
    faded = opacity * ramp(large - major, limits.fade * large)
    faded *= ramp(far - distance, limits.fade * far)
    faded *= ramp(k * major - least, limits.fade * least)
    width, height = camera.size
    on_screen = np.all((at + reach > 0) & (at - reach < [[width], [height]]), axis=0)
    gates = [
        opacity >= limits.min_alpha,
        distance <= far,
        (z > camera.near) & on_screen,
        major <= large,
        k * major >= least,
        faded >= limits.min_alpha,
    ]
    stopped = np.argmin([*gates, np.zeros_like(z)], axis=0)  # the first that is not passed
    return stopped, np.where(stopped == 6, faded, 0)


LIMITS = [
    Limits(),
    Limits(max_pixels=6.0, max_distance=3.2),
    Limits(min_pixels=9.0),
    Limits(min_alpha=0.1, max_pixels=8.0, min_pixels=6.0, low_pass=0.0),
    Limits(max_pixels=9.0, max_distance=3.6, min_pixels=5.0, fade=0.4),
    Limits(max_pixels=7.0, fade=1.0),
    Limits(min_pixels=6.0, fade=0.1),
    Limits(max_pixels=0.0),
    Limits(max_pixels=1e300, max_distance=1e300, min_pixels=1e300),
    Limits(fade=0.5),
]


@pytest.mark.parametrize("limits", LIMITS, ids=range(len(LIMITS)))
def test_every_gate_counts_what_it_keeps_out_once(limits):
    splats, camera, d = random_splats(1003, seed=5), off_centre_camera((60, 40)), device()
    splats[3][::10] = -0.5
    splats[1][5::50] = 0.4
    stopped, opacity = gates_reference(splats, camera, limits)
    got = project_arena(d, *arena(splats), np.eye(4)[None], [camera], limits)[0]
    record, counts = d.download(got.record), got.culled(d)
    assert list(counts) == list(CULL_REASONS)
    assert list(counts.values()) == [np.count_nonzero(stopped == gate) for gate in range(6)]
    drawn = stopped == 6
    np.testing.assert_array_equal(record[:, 9] > 0, drawn)
    np.testing.assert_array_equal(d.download(got.depth) < 1e30, drawn)
    np.testing.assert_allclose(record[drawn, 5], opacity[drawn], rtol=2e-3, atol=1e-5)
    power_threshold = 2 * np.log(record[drawn, 5].astype(np.float64) / limits.min_alpha)
    np.testing.assert_allclose(record[drawn, 11], power_threshold, rtol=1e-4, atol=1e-5)
    tile_bounds = d.download(got.scratch.tile_bounds)
    assert not tile_bounds[~drawn].any()


def test_the_limits_of_this_test_stop_something_at_every_gate():
    splats, camera = random_splats(1003, seed=5), off_centre_camera((60, 40))
    splats[3][::10] = -0.5
    stopped = np.stack([gates_reference(splats, camera, limits)[0] for limits in LIMITS])
    assert set(stopped.ravel()) == set(range(7))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38, 1e25])
@pytest.mark.parametrize("group", range(5))
def test_what_is_not_finite_stops_at_the_gate_that_all_back_ends_name(group, value):
    splats, camera, d = random_splats(9, seed=2, spread=0.1), off_centre_camera((60, 40)), device()
    splats[group].reshape(9, -1)[4, 0] = value
    with np.errstate(all="ignore"):
        got = project_arena(d, *arena(splats), np.eye(4)[None], [camera])[0]
    reason = {0: "distance", 1: "size", 2: "size", 3: "opacity", 4: "size"}[group]
    if group == 3 and np.isfinite(value):
        reason = "size" if value > 1e30 else None  # 1e25 is opaque, the reach of 3e38 no float
    if group == 2 and not np.isnan(value):
        return  # the test's own packing turns it into NaN or an axis
    expected = {name: int(name == reason) for name in CULL_REASONS}
    assert got.culled(d) == expected


@pytest.mark.parametrize("count", [1, 7, 8, 9, 4099])
def test_two_views_in_one_launch_equal_each_alone(count):
    splats, d = random_splats(count), device()
    left, right = off_centre_camera((90, 50)), off_centre_camera((90, 50))
    right.camera_from_world[0, 3] -= 0.3
    inputs, limits = arena(splats), Limits(max_pixels=8, fade=0.3)
    both = project_arena(d, *inputs, np.eye(4)[None], [left, right], limits)
    for camera, got in zip((left, right), both, strict=True):
        alone = project_arena(d, *inputs, np.eye(4)[None], [camera], limits)[0]
        assert got.culled(d) == alone.culled(d)
        depth = d.download(alone.depth)
        np.testing.assert_array_equal(d.download(got.depth), depth)
        drawn = depth < 1e30
        np.testing.assert_array_equal(
            d.download(got.record)[drawn], d.download(alone.record)[drawn]
        )
        for name in ("tile_bounds", "status"):
            one, other = (d.download(getattr(p.scratch, name)) for p in (got, alone))
            np.testing.assert_array_equal(one, other)


def keys_of(device, found) -> tuple[np.ndarray, np.ndarray]:
    """(splats, keys) as the chunks hold them, in the order of the splats."""
    pairs, status = device.download(found.pairs), device.download(found.status)
    rows = [pairs[c * found.chunk :][:n] for c, n in enumerate(status[:, 0])]
    packed = np.concatenate(rows)
    return packed[:, 0], packed[:, 1]


def floats_of(keys: np.ndarray) -> np.ndarray:
    """The floats whose sortable bits these are."""
    bits = np.where(keys >> 31 == 1, keys ^ np.uint32(1 << 31), ~keys)
    return bits.astype(np.uint32).view(np.float32)


@pytest.mark.parametrize("by_distance", [False, True])
@pytest.mark.parametrize("keep_outside", [False, True])
def test_keys_are_depth_or_distance_in_the_sort_frame(by_distance, keep_outside):
    splats, d = random_splats(3000, spread=2.0), device()
    splats[3][::7] = -1
    left, right = off_centre_camera((90, 50)), off_centre_camera((90, 50))
    right.camera_from_world[0, 3] -= 0.5
    centre = left.camera_from_world.copy()
    centre[0, 3] -= 0.25
    sort = SortFrames((centre,), by_distance, keep_outside)
    both = project_arena(d, *arena(splats), np.eye(4)[None], [left, right], None, sort)
    assert both[0].scratch.pairs is both[1].scratch.pairs
    splat, key = keys_of(d, both[0].scratch)
    np.testing.assert_array_equal(splat, np.unique(splat))  # in order, once each
    touched = [d.download(p.scratch.tile_bounds)[:, 0] > 0 for p in both]
    expected = splats[3] >= LEAST_ALPHA if keep_outside else touched[0] | touched[1]
    np.testing.assert_array_equal(splat, np.flatnonzero(expected))
    p = as_double(splats)[0][splat] @ centre[:3, :3].T + centre[:3, 3]
    value = np.linalg.norm(p, axis=1) if by_distance else p[:, 2]
    np.testing.assert_allclose(floats_of(key), value, rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(
        np.argsort(key, kind="stable"), np.argsort(floats_of(key), kind="stable")
    )
    assert keep_outside == (value.min() < 0) or by_distance
    table = d.download(both[0].scratch.table)
    np.testing.assert_array_equal(table.sum(0), np.bincount(key & 0xFFF, minlength=4096))
    for one in both:
        status = d.download(one.scratch.status)
        assert (status[:, 2].min(), status[:, 3].max()) == (key.min(), key.max())


def test_without_sort_frames_nothing_is_entered():
    splats, camera, d = random_splats(100), off_centre_camera((90, 50)), device()
    got = project_arena(d, *arena(splats), np.eye(4)[None], [camera], None, SortFrames(()))[0]
    assert got.scratch.pairs is None and got.scratch.table is None
    assert d.download(got.scratch.status)[:, 0].sum() == 0
    with_keys = project_arena(d, *arena(splats), np.eye(4)[None], [camera])[0]
    np.testing.assert_array_equal(
        d.download(got.scratch.status)[:, 1], d.download(with_keys.scratch.status)[:, 1]
    )


def test_what_it_cannot_do_is_said():
    splats, camera, d = random_splats(10), off_centre_camera((90, 50)), device()
    with pytest.raises(ValueError, match="1 or 2 views and 0, 1 or as many sort frames"):
        project_arena(d, *arena(splats), np.eye(4)[None], [camera] * 3)


def test_a_higher_least_alpha_shrinks_the_splats():
    splats, camera, d = random_splats(200, seed=6), off_centre_camera((60, 40)), device()
    faint = project_arena(d, *arena(splats), np.eye(4)[None], [camera])[0]
    strong = project_arena(d, *arena(splats), np.eye(4)[None], [camera], Limits(min_alpha=0.2))[0]
    a, b = d.download(faint.record), d.download(strong.record)
    both = (a[:, 9] > 0) & (b[:, 9] > 0)
    assert both.sum() > 50 and np.all(b[both, 9] < a[both, 9])
    assert not (b[splats[3] <= 0.2, 9] > 0).any()
