"""project_arena, the drawing form of projection: against `project`, its gates and its counts."""

import numpy as np
import pytest
from rasterizer_scenes import arena, as_double, device, off_centre_camera, random_splats, upload

from rasterizer.project import Camera, project
from rasterizer.project_arena import Limits, project_arena
from rasterizer.reference import project_reference


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


def test_every_gate_counts_what_it_keeps_out_once():
    splats, camera, d = random_splats(1000, seed=5), off_centre_camera((60, 40)), device()
    splats[3][::10] = -0.5
    splats[1][5::50] = 0.4
    limits = {"max_pixels": 6.0, "max_distance": 3.2}
    got = project_arena(d, *arena(splats), np.eye(4)[None], [camera], Limits(**limits))[0]
    counts, drawn = got.culled(d), (d.download(got.record)[:, 9] > 0)
    assert sum(counts.values()) + drawn.sum() == 1000
    assert counts["opacity"] == 100
    assert min(counts[gate] for gate in ("distance", "frustum", "size")) > 0

    record, _ = project_reference(*as_double(splats), camera)
    p = splats[0] @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
    a, b, c = record[:, 2], record[:, 3], record[:, 4]
    least = (a + c) / 2 - np.hypot((a - c) / 2, b)  # of the conic: 1 / sigma^2 of the long axis
    keep = (record[:, 9] > 0) & (np.linalg.norm(p, axis=1) <= 3.2) & (least >= 1 / 36)
    np.testing.assert_array_equal(drawn, keep)


def test_a_higher_least_alpha_shrinks_the_splats():
    splats, camera, d = random_splats(200, seed=6), off_centre_camera((60, 40)), device()
    faint = project_arena(d, *arena(splats), np.eye(4)[None], [camera])[0]
    strong = project_arena(d, *arena(splats), np.eye(4)[None], [camera], Limits(min_alpha=0.2))[0]
    a, b = d.download(faint.record), d.download(strong.record)
    both = (a[:, 9] > 0) & (b[:, 9] > 0)
    assert both.sum() > 50 and np.all(b[both, 9] < a[both, 9])
    assert not (b[splats[3] <= 0.2, 9] > 0).any()
