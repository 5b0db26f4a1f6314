"""Culls of project.comp against the float64 oracle, reason by reason; thresholds met exactly."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.reference import gate_object, reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene
from tests.support.renderer.cull_scenes import FRONT, LIMITS, SCENES, THRESHOLDS, row_of
from tests.support.renderer.gl_models import read
from tests.support.renderer.reference_reasons import reference_counts, reference_reasons
from tests.support.splat_scenes import (
    FIELDS,
    alone,
    front_view,
    one_splat,
    only,
    random_layers,
    stereo_views,
    two_objects,
)

EYE = front_view().world_from_eye.position  # from where colours are seen


def seen(
    gpu: Gpu, scene: Scene, views: list[View], settings: RenderSettings, **order
) -> list[tuple[dict[str, int], np.ndarray, np.ndarray]]:
    """For each view: counts, records (N, 8) uint32, keys (N,) after one projection of all views."""
    counts = [o.model.splat_count for o in scene.objects]
    with Arena(gpu, counts) as arena:
        for i, obj in enumerate(scene.objects):
            object_from_world = np.linalg.inv(obj.world_from_object.matrix())
            splats = evaluate(obj.model, obj.x, (object_from_world @ [*EYE, 1])[:3])
            arena.write_geometry(i, splats.means, splats.scales, splats.wxyz, splats.opacity)
            arena.write_color(i, splats.color)
        nowhere = np.full((4, 4), np.nan)
        arena.set_poses(
            [o.world_from_object.matrix() if o.visible else nowhere for o in scene.objects]
        )
        projector = Projector(gpu)
        projector.project(arena, views, settings, **order)
        n = arena.count
        records = read(arena.records, np.uint32)[: 8 * n * len(views)].reshape(-1, 8)
        keys = read(arena.keys, np.uint32)[:n].copy()
        return [
            (projector.counts(arena, v), records[v * n : (v + 1) * n].copy(), keys)
            for v in range(len(views))
        ]


def drawn(keys: np.ndarray) -> np.ndarray:
    return np.flatnonzero(keys != layout.CULLED_KEY)


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("name", SCENES)
def test_counts_are_the_oracle_s(gpu, name, limits):
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    counts, _, keys = seen(gpu, scene, [view], settings)[0]
    reasons = reference_reasons(scene, view, settings)
    assert counts == reference_counts(scene, view, settings)
    assert sum(counts.values()) == scene.splat_count == len(reasons)
    np.testing.assert_array_equal(drawn(keys), np.flatnonzero(reasons == 0))


def test_the_scenes_show_every_reason():
    total = dict.fromkeys(("drawn", *CULL_REASONS), 0)
    for make in SCENES.values():
        for settings in LIMITS.values():
            for name, n in reference_counts(make(), front_view((160, 120)), settings).items():
                total[name] += n
    assert min(total.values()) > 100, total


@pytest.mark.parametrize("order", ["depth", "distance"])
@pytest.mark.parametrize("keep_outside", [False, True])
@pytest.mark.parametrize("limits", ["none", "all hard", "all soft"])
def test_two_views_at_once_are_two_views(gpu, order, keep_outside, limits):
    scene, views = two_objects(1500), stereo_views((120, 90))
    settings = replace(LIMITS[limits], order=order)
    centre = front_view().eye_from_world()
    how = {"sort_from_world": centre, "keep_outside": keep_outside}
    both = seen(gpu, scene, views, settings, **how)
    reasons = [reference_reasons(scene, view, settings) for view in views]
    keys = both[0][2]
    n = scene.splat_count
    for view, (counts, records, _), why in zip(views, both, reasons, strict=True):
        alone_counts, alone_records, _ = seen(gpu, scene, [view], settings, keep_outside=True)[0]
        assert counts == alone_counts == reference_counts(scene, view, settings)
        kept = drawn(keys)
        np.testing.assert_array_equal(records[kept], alone_records[kept])
        cutoff_sigmas = records[:, 7].view(np.float32)
        culled = np.intersect1d(kept, np.flatnonzero(why))
        assert len(culled) > 10 and not records[culled, 2:].any()  # no axes, no cutoff, no opacity
        assert (records[culled, :2].view(np.float32) < 0).all()
        assert (cutoff_sigmas[np.intersect1d(kept, np.flatnonzero(why == 0))] > 0).all()
    wanted = (reasons[0] != 1) if keep_outside else (reasons[0] == 0) | (reasons[1] == 0)
    np.testing.assert_array_equal(drawn(keys), np.flatnonzero(wanted))
    places = np.concatenate(
        [gate_object(o, views[0], settings, np.zeros(3)).place for o in scene.objects]
    )
    local = places @ centre[:3, :3].T + centre[:3, 3]
    truth = np.linalg.norm(local, axis=1) if order == "distance" else -local[:, 2]
    value = keys[wanted].view(np.float32)
    front = truth[wanted] > 1e-3
    np.testing.assert_allclose(value[front], truth[wanted][front], rtol=1e-5, atol=1e-6)
    assert (value > 0).all() and (value[~front] < 2e-3).all() and len(places) == n


def test_splats_behind_the_eye_keep_their_order_in_a_kept_one(gpu):
    z = np.linspace(-5, 5, 41)  # towards the eye's back
    layers = one_splat(
        means=np.stack([0 * z, 0 * z, z], axis=1), scales=np.full((41, 3), 0.01),
        wxyz=np.tile([1, 0, 0, 0], (41, 1)), opacity=np.full(41, 0.5), sh=np.zeros((41, 1, 3)),
    )  # fmt: skip
    _, _, keys = seen(gpu, alone(layers), [FRONT], RenderSettings(), keep_outside=True)[0]
    assert (np.diff(keys.astype(np.int64)) < 0).all()  # z grows, depth falls, all different
    assert len(drawn(keys)) == 41


@pytest.mark.parametrize("name", THRESHOLDS)
def test_a_threshold_met_exactly(gpu, name):
    layers, settings, want = THRESHOLDS[name]
    reasons = [
        ("drawn", *CULL_REASONS)[i] for i in reference_reasons(alone(layers), FRONT, settings)
    ]
    assert reasons == want.split()
    counts, _, keys = seen(gpu, alone(layers), [FRONT], settings)[0]
    assert counts == {name: reasons.count(name) for name in counts}
    assert drawn(keys).tolist() == [i for i, n in enumerate(reasons) if n == "drawn"]


@pytest.mark.parametrize(("part", "reason"), [(0.999, "footprint"), (1.001, "drawn")])
def test_footprint_on_both_sides(gpu, part, reason):
    reach = np.sqrt(2 * np.log(0.5 * 255)) * np.hypot(0.05 * 50, np.sqrt(0.3))  # pixels
    scene, settings = alone(one_splat(means=[[0, 0, -2]], opacity=[0.5])), RenderSettings(
        min_pixels=float(reach / part))  # fmt: skip
    assert seen(gpu, scene, [FRONT], settings)[0][0][reason] == 1
    assert reference_counts(scene, FRONT, settings)[reason] == 1


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-40, -1e-40, 0.0])
@pytest.mark.parametrize("limits", ["none", "all soft"])
def test_numbers_at_their_ends_count_as_in_the_oracle(gpu, name, value, limits):
    layers = only(random_layers(200, seed=4), np.arange(200))
    getattr(layers, name)[::3] = value
    scene, view = alone(layers), front_view((96, 96))
    counts, records, keys = seen(gpu, scene, [view], LIMITS[limits])[0]
    assert counts == reference_counts(scene, view, LIMITS[limits])
    assert np.isfinite(records[drawn(keys)][:, [0, 1, 6, 7]].view(np.float32)).all()


@pytest.mark.parametrize("limit", ["max_pixels", "max_distance", "min_pixels"])
def test_fade_multiplies_opacity_along_its_ramp(gpu, limit):
    place = np.stack([np.zeros(60), np.zeros(60), -np.linspace(1.0, 4.2, 60)], axis=1)
    scene = alone(row_of(place, 0.05, 0.8))
    at = {"max_pixels": 4.0, "max_distance": 4.0, "min_pixels": 5.0}[limit]
    settings = RenderSettings(fade=0.4, **{limit: at})
    _, records, keys = seen(gpu, scene, [FRONT], settings)[0]
    truth = gate_object(scene.objects[0], FRONT, settings, np.zeros(3))
    index = drawn(keys)
    np.testing.assert_array_equal(index, np.flatnonzero(truth.reason == 0))
    got = records[index][:, 6].view(np.float32)
    np.testing.assert_allclose(got, truth.opacity[index], atol=2e-3)
    assert 5 < len(index) < 60 and got.min() < 0.1 and got.max() == np.float32(0.8)
    cutoff_sigmas = records[index][:, 7].view(np.float32)
    np.testing.assert_allclose(cutoff_sigmas, np.sqrt(2 * np.log(255 * got)), atol=3e-3)


# What a splat of 0.8 does that crosses a limit by going away (or, for max_pixels, coming near).
CROSSINGS = {
    "max_distance": (4.0, np.linspace(2.9, 4.1, 61)),
    "max_pixels": (4.0, np.linspace(2.2, 1.1, 61)),  # one sigma of 5 cm at 50 px/m a 2 m
    "min_pixels": (5.0, np.linspace(1.8, 3.6, 61)),
}


@pytest.mark.parametrize("drawing", ["quads", "tiles", "reference"])
@pytest.mark.parametrize("limit", CROSSINGS)
def test_what_crosses_a_limit_fades_or_jumps(session_gpu, drawing, limit):
    """Bounds: 60 steps over a crossing change opacity 0.8 by at most 0.05 each where it fades,
    the place and size of the splat the rest; without fade the last picture has all of it.
    """
    at, distances = CROSSINGS[limit]
    scenes = [alone(row_of(np.array([[0, 0, -d]]), 0.05, 0.8)) for d in distances]
    steps = {}
    for fade in (0.0, 0.4):
        settings = RenderSettings(fade=fade, **{limit: at})
        images = pictures(session_gpu, drawing, scenes, FRONT, settings)
        assert images[0].max() > 0.5 and images[-1].max() == 0, "it crosses the limit"
        steps[fade] = max(np.abs(b - a).max() for a, b in pairwise(images))
    assert steps[0.0] > 0.5 and steps[0.4] < 0.09, steps


def pictures(gpu: Gpu, drawing: str, scenes: list, view: View, settings: RenderSettings) -> list:
    """(H, W, 4) of each scene by a drawing, or by the oracle."""
    if drawing == "reference":
        return [reference_image(scene, view, settings) for scene in scenes]
    made = []
    with gpu.ctx as ctx, Renderer(ctx, drawing, target="rgba32f") as renderer:
        renderer.settings = settings
        for scene in scenes:
            renderer.update(scene)
            renderer.draw([view])
            made.append(renderer.image().copy())
    return made


def turned(degrees: float) -> View:
    half = np.radians(degrees) / 2
    pose = Pose(np.zeros(3), np.array([np.cos(half), 0, np.sin(half), 0]))
    return replace(FRONT, world_from_eye=pose, tangents=(-2, 2, -1, 1))


def test_turning_the_head_keeps_the_order_by_distance(gpu):
    scene = alone(random_layers(2000, seed=8), world_from_object=Pose(np.array([0, 0, -2.5]),
                  np.array([1.0, 0, 0, 0])))  # fmt: skip
    orders = {}
    for order in ("depth", "distance"):
        settings = RenderSettings(order=order)
        keys = [
            seen(gpu, scene, [turned(a)], settings, keep_outside=True)[0][2] for a in (0, 3, 25)
        ]
        orders[order] = [np.argsort(k, kind="stable") for k in keys]
    straight, little, much = orders["distance"]
    # Of equal distances in float32 the rounding decides: a handful of neighbours swap.
    assert (straight != little).mean() < 0.01 and (straight != much).mean() < 0.01
    assert (orders["depth"][0] != orders["depth"][2]).mean() > 0.9


@pytest.mark.parametrize("drawing", ["quads", "tiles", "reference"])
def test_distance_and_depth_disagree_beside_the_axis(session_gpu, drawing):
    """One splat ahead at 2.2 m, one beside at 2.0 m of depth and 2.33 m away, overlapping."""
    pair = one_splat(
        means=[[0.75, 0, -2.2], [1.2, 0, -2.0]], scales=[[0.25] * 3] * 2, wxyz=[[1, 0, 0, 0]] * 2,
        opacity=[0.9, 0.9], sh=[[[1.7, -1.7, -1.7]], [[-1.7, -1.7, 1.7]]],
    )  # fmt: skip
    red_over_blue = {}
    for order in ("depth", "distance"):
        image = pictures(session_gpu, drawing, [alone(pair)], FRONT, RenderSettings(order=order))[0]
        red, _, blue, _ = image[50, 148]
        red_over_blue[order] = red / blue
    assert red_over_blue["depth"] < 0.7 and red_over_blue["distance"] > 1.1
