"""project against the float64 of renderer/reference.py; each gate at its threshold."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.reference import gate_object
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.model import Splats
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import SceneObject
from tests.support.renderer.gl_models import f32, make_layers, make_view, read

BLOCK = layout.WORKGROUP


def projected(
    gpu: Gpu,
    splats: Splats,
    view: View,
    settings: RenderSettings | None = None,
    pose: np.ndarray | None = None,
) -> dict:
    """counts, and of every drawn splat: index, depth, center, covariance, color, opacity, cut."""
    count = len(splats.means)
    with Arena(gpu, [count]) as arena:
        arena.write_geometry(0, splats.means, splats.scales, splats.wxyz, splats.opacity)
        arena.write_color(0, splats.color)
        arena.set_poses([np.eye(4) if pose is None else pose])
        projector = Projector(gpu)
        projector.project(arena, [view], settings or RenderSettings())
        keys = read(arena.keys, np.uint32)[:count]
        index = np.flatnonzero(keys != layout.CULLED_KEY)
        rows = read(arena.records, np.uint32, 8)[index]
        counts = projector.counts(arena)
    major, minor = halves(rows[:, 2]), halves(rows[:, 3])
    return {
        "counts": counts,
        "index": index,
        "depth": keys[index].view(np.float32),
        "center": rows[:, :2].copy().view(np.float32),
        "covariance": major[:, :, None] * major[:, None] + minor[:, :, None] * minor[:, None],
        "color": np.concatenate([halves(rows[:, 4]), halves(rows[:, 5])[:, :1]], axis=1),
        "opacity": rows[:, 6].copy().view(np.float32),
        "cutoff_sigmas": rows[:, 7].copy().view(np.float32),
    }


def halves(words: np.ndarray) -> np.ndarray:
    """(n, 2) float32 of (n,) uint32, as unpackHalf2x16."""
    return words.copy().view(np.float16).reshape(-1, 2).astype(np.float32)


def round_splats(means, scales=0.01, opacity=0.5) -> Splats:
    """Round grey splats."""
    means = f32(np.reshape(means, (-1, 3)))
    n = len(means)
    return Splats(
        means=means,
        scales=f32(np.broadcast_to(np.reshape(scales, (-1, 1)), (n, 3))),
        wxyz=f32(np.tile([1, 0, 0, 0], (n, 1))),
        opacity=f32(np.broadcast_to(opacity, n)),
        color=np.full((n, 3), 0.5, np.float32),
    )


FRONT = View(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-1, 1, -0.5, 0.5), 0.1, 100, (200, 100))


@pytest.mark.parametrize("n", [1, BLOCK - 1, BLOCK, BLOCK + 1, 3000])
@pytest.mark.parametrize("tangents", [(-0.6, 0.6, -0.45, 0.45), (-0.1, 0.7, -0.6, 0.05)])
def test_records_are_the_float64_projection(gpu, n, tangents):
    model = make_layers(n, 4, seed=n)
    view = make_view(tangents=tangents)
    pose = Pose(np.array([0.3, -0.2, 0.5]), np.array([0.8, 0.36, 0.0, 0.48]))
    eye = np.linalg.inv(pose.matrix()) @ [*view.world_from_eye.position, 1]
    got = projected(gpu, evaluate(model, 1.0, eye[:3]), view, pose=pose.matrix())
    obj = SceneObject("thing", model, pose, x=1.0)
    truth = gate_object(obj, view, RenderSettings(), view.world_from_eye.position)
    rows = np.flatnonzero(truth.reason == 0)
    np.testing.assert_array_equal(got["index"], rows)
    depth, mean_px, covariance = truth.depth, truth.mean_px, truth.covariance
    opacity, color = truth.opacity, truth.color
    np.testing.assert_allclose(got["depth"], depth[rows], atol=2e-6)
    np.testing.assert_allclose(got["opacity"], opacity[rows], rtol=1e-6)
    flipped = np.stack([mean_px[rows, 0], view.size[1] - mean_px[rows, 1]], axis=1)
    np.testing.assert_allclose(got["center"], flipped, atol=2e-3)
    np.testing.assert_allclose(got["color"], color[rows], atol=1e-3)
    expected = covariance[rows] * [[1, -1], [-1, 1]]  # y is up here
    size = np.trace(expected, axis1=1, axis2=2)[:, None, None]
    assert np.all(np.abs(got["covariance"] - expected) <= 2e-3 * size)
    np.testing.assert_allclose(
        got["cutoff_sigmas"], np.sqrt(2 * np.log(255 * opacity[rows])), atol=2e-3
    )
    assert sum(got["counts"].values()) == n and got["counts"]["drawn"] == len(rows)


def test_every_reason_is_counted_once(gpu):
    means = [
        (0, 0, -2),  # drawn
        (0, 0, -2),  # absent: opacity
        (0, 0, -60),  # distance
        (0, 0, 2),  # frustum: behind the eye
        (0, 0, -0.05),  # frustum: nearer than near
        (9, 0, -2),  # frustum: beside the image
        (0, 0, -3),  # size
    ]
    model = round_splats(means, [0.01] * 6 + [2.0], [0.5, -0.5, 0.5, 0.5, 0.5, 0.5, 0.5])
    settings = RenderSettings(max_distance=50, max_pixels=40)
    counts = projected(gpu, model, FRONT, settings)["counts"]
    assert counts == {
        "drawn": 1, "opacity": 1, "distance": 1, "frustum": 3, "size": 1,
        "footprint": 0, "faded": 0,
    }  # fmt: skip


def test_the_first_gate_that_fails_counts(gpu):
    model = round_splats([(0, 0, 60)], 5.0, -1.0)
    counts = projected(gpu, model, FRONT, RenderSettings(max_distance=50, max_pixels=1))["counts"]
    assert counts["opacity"] == 1 and sum(counts.values()) == 1


def around(value: float) -> np.ndarray:
    """The float32 below, at and above a value."""
    at = np.float32(value)
    return np.array([np.nextafter(at, -np.inf), at, np.nextafter(at, np.inf)], np.float32)


@pytest.mark.parametrize("min_alpha", [1 / 255, 0.25])
def test_opacity_at_the_threshold(gpu, min_alpha):
    settings = RenderSettings(min_alpha=min_alpha)
    got = projected(gpu, round_splats([(0, 0, -2)] * 3, opacity=around(min_alpha)), FRONT, settings)
    assert got["index"].tolist() == [1, 2]  # at the threshold it is drawn: alpha >= min_alpha
    assert np.all(got["cutoff_sigmas"] >= 0) and np.all(got["cutoff_sigmas"] < 1e-3)


def test_near_plane_and_distance_at_the_threshold(gpu):
    z = np.concatenate([around(0.1), around(50.0)])
    means = np.stack([0 * z, 0 * z, -z], axis=1)
    got = projected(gpu, round_splats(means, 1e-4), FRONT, RenderSettings(max_distance=50))
    assert got["index"].tolist() == [2, 3, 4]  # beyond near, not beyond 50


def test_size_on_both_sides_of_the_threshold(gpu):
    # One sigma at 2 m: scale * 100 px / 2 m, and the low-pass under the root.
    scales = np.sqrt(np.array([9.99, 10.01]) ** 2 - 0.3) / 50
    got = projected(
        gpu, round_splats([(0, 0, -2)] * 2, scales), FRONT, RenderSettings(max_pixels=10)
    )
    assert got["index"].tolist() == [0] and got["counts"]["size"] == 1


@pytest.mark.parametrize("field", ["means", "scales", "wxyz", "opacity", "color"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38])
def test_what_is_not_a_sane_number_is_culled(gpu, field, value):
    good = round_splats([(0, 0, -2)] * 4)
    rows = getattr(good, field).copy()
    rows[1] = value
    got = projected(gpu, replace(good, **{field: rows}), FRONT)
    harmless = field == "wxyz" and value == 3e38  # a direction all the same
    assert got["index"].tolist() == ([0, 1, 2, 3] if harmless else [0, 2, 3])
    for name in ("center", "covariance", "color", "opacity", "cutoff_sigmas", "depth"):
        assert np.isfinite(got[name]).all(), name


@pytest.mark.parametrize("value", [0.0, 1e-45, 1e-38, -0.01])
def test_flat_tiny_and_negative_scales_are_drawn(gpu, value):
    got = projected(gpu, round_splats([(0, 0, -2)], value), FRONT)
    assert got["counts"]["drawn"] == 1
    size = (value * 50) ** 2 + 0.3
    np.testing.assert_allclose(got["covariance"][0], np.eye(2) * size, rtol=2e-2, atol=2e-4)


def test_axes_larger_than_a_half_are_held(gpu):
    got = projected(gpu, round_splats([(0, 0, -2)], 1e5), FRONT)
    assert got["counts"]["drawn"] == 1
    axis = np.sqrt(np.linalg.eigvalsh(got["covariance"][0].astype(np.float64)))
    np.testing.assert_allclose(axis, layout.HALF_MAX, rtol=1e-3)


def test_long_thin_splats_keep_their_thin_axis(gpu):
    model = replace(round_splats([(0, 0, -2)]), scales=f32([[40.0, 1e-4, 1e-4]]))
    turned = replace(model, wxyz=f32([[np.cos(0.4), 0, 0, np.sin(0.4)]]))
    got = projected(gpu, turned, FRONT)
    thin = np.linalg.svd(got["covariance"][0].astype(np.float64))[1]
    np.testing.assert_allclose(np.sqrt(thin[0]), 40 * 50, rtol=2e-3)
    rows = projected(gpu, turned, FRONT, RenderSettings(low_pass=1.0))
    assert rows["counts"]["drawn"] == 1


def test_a_pose_of_nan_hides_and_no_low_pass_culls_flat_ones(gpu):
    model = round_splats([(0, 0, -2)] * 3, [0.01, 0.0, 0.01])
    hidden = projected(gpu, model, FRONT, pose=np.full((4, 4), np.nan))
    assert hidden["counts"]["drawn"] == 0 and sum(hidden["counts"].values()) == 3
    sharp = projected(gpu, model, FRONT, RenderSettings(low_pass=0.0))
    assert sharp["index"].tolist() == [0, 2]


def test_far_from_the_world_s_origin_nothing_trembles(gpu):
    model = evaluate(make_layers(500, 1), 1.0, np.zeros(3))
    near = projected(gpu, model, make_view())
    shift = np.eye(4)
    shift[:3, 3] = [5e5, -3e5, 4e5]  # metres
    view = make_view()
    moved = Pose(view.world_from_eye.position + shift[:3, 3], view.world_from_eye.wxyz)
    far = projected(gpu, model, replace(view, world_from_eye=moved), pose=shift)
    np.testing.assert_array_equal(near["index"], far["index"])
    np.testing.assert_allclose(near["center"], far["center"], atol=2e-3)
