"""Debug pictures of quads and tiles: their numbers are the frame's, their dots are in place."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.debug.debug import (
    REASON_COLORS,
    debug_legend,
    object_color,
    object_poses,
)
from shapeshift.renderer.debug.debug_map import classify, fit, heading
from shapeshift.renderer.reference import gate_object
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import CULL_REASONS, DEBUG_VIEWS, EDGES, RenderSettings
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.rotation import covariance
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.cull_scenes import FRONT, LIMITS, SCENES, row_of
from tests.support.renderer.reference_reasons import reference_reasons
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    poisoned,
    random_layers,
    stereo_views,
    two_objects,
)

DEBUG_NAMES = [name for name in DEBUG_VIEWS if name]

RENDERERS = EITHER_ON_GL

pytestmark = pytest.mark.usefixtures("ctx")
NAMES = ("drawn", *CULL_REASONS)


def shown(renderer: Renderer, scene: Scene, views: list[View], **settings):
    """(pictures, stats) of one frame."""
    renderer.settings = RenderSettings(**settings)
    renderer.update(scene)
    stats = renderer.draw(views)
    return [renderer.resolved(i) for i in range(len(views))], stats


def points_of(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What drawings give as splat_points, from the models."""
    splats = [evaluate(o.model, o.x, np.zeros(3)) for o in scene.objects]
    owner = np.repeat(np.arange(len(splats)), [len(s.means) for s in splats])
    rows = [np.c_[s.means, s.opacity] for s in splats]
    spread = [
        np.pad(covariance(s.scales.astype(float), s.wxyz.astype(float)), ((0, 0), (0, 2)))
        for s in splats
    ]
    join = (np.concatenate([*a, np.zeros((0, n))]) for a, n in ((rows, 4), (spread, 8)))
    mean_opacity, spread = (a.astype(np.float32) for a in join)
    return mean_opacity, owner, spread


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("name", SCENES)
def test_reasons_are_the_oracle_s(name, limits):
    scene, view, settings = SCENES[name](), front_view((160, 120)), LIMITS[limits]
    reason, pixel, depth = classify(points_of(scene), object_poses(scene), view, settings)
    np.testing.assert_array_equal(reason, reference_reasons(scene, view, settings))
    truth = [gate_object(o, view, settings, np.zeros(3)) for o in scene.objects if o.visible]
    drawn = reason == 0
    if drawn.any():
        wanted = np.concatenate([t.mean_px[t.reason == 0] for t in truth])
        np.testing.assert_allclose(pixel.T[drawn], wanted, atol=2e-2)
        wanted = np.concatenate([t.depth[t.reason == 0] for t in truth])
        np.testing.assert_allclose(depth[drawn], wanted, rtol=1e-5)


@pytest.mark.parametrize("name", ["culls", "birdseye"])
@pytest.mark.parametrize("limits", ["none", "all hard", "all soft", "nothing"])
def test_numbers_are_the_frame_s(renderer, name, limits):
    scene, views = two_objects(2400), stereo_views((120, 90))
    settings = {k: getattr(LIMITS[limits], k) for k in LIMITS[limits].__dataclass_fields__}
    told = [shown(renderer, scene, [view], **settings | {"debug": name})[1].debug for view in views]
    _, stats = shown(renderer, scene, [views[1]], **settings)
    assert {k: told[1][k] for k in NAMES} == {"drawn": stats.drawn, **stats.culled}
    assert stats.debug == {} and all(sum(t[k] for k in NAMES) == 2400 for t in told)
    rows = dict(debug_legend(name, replace(stats, debug=told[1])))
    assert (
        f"drawn: {stats.drawn:,}" in rows
        and rows[f"drawn: {stats.drawn:,}"] == (REASON_COLORS["drawn"])
    )


# Splats ahead of FRONT, far apart, one a reason; 50 pixels a metre at 2 m.
ONE_EACH = {
    "drawn": ((-1.5, 0.5, -2), 0.02, 0.5),
    "opacity": ((-0.9, 0.5, -2), 0.02, 0.001),
    "distance": ((-0.6, 1.0, -4), 0.02, 0.5),
    "size": ((0.3, 0.5, -2), 0.5, 0.5),
    "footprint": ((0.9, 0.5, -2), 0.0001, 0.5),
    "faded": ((0, 0, -2), 0.1198, 0.5),
}
EACH_LIMIT = {
    "max_pixels": 6.0,
    "max_distance": 3.0,
    "min_pixels": 2.0,
    "fade": 0.5,
    "low_pass": 0.0,
}


@pytest.mark.parametrize("size", [(200, 100), (960, 480)])
def test_dots_have_their_reason_s_colour_and_place(renderer, size):
    places, scales, opacity = zip(*ONE_EACH.values(), strict=True)
    scene = alone(row_of(np.array(places), np.array(scales), np.array(opacity)))
    view, part = replace(FRONT, size=size), size[0] / 200
    limits = EACH_LIMIT | {"max_pixels": 6.0 * part, "min_pixels": 2.0 * part}
    (picture,), stats = shown(renderer, scene, [view], debug="culls", **limits)
    assert {k: n for k, n in stats.debug.items() if n} == dict.fromkeys(ONE_EACH, 1.0)
    for name, (x, y, z) in zip(ONE_EACH, places, strict=True):
        column, row = int((x / -z + 1) * size[0] / 2), int((0.5 - y / -z) * size[1])
        pixel, want = picture[row, column], np.array(REASON_COLORS[name])
        brightness = np.linalg.norm(pixel) / np.linalg.norm(want)
        np.testing.assert_allclose(pixel / brightness, want, atol=0.02, err_msg=name)
        assert 0.4 < brightness <= 1.001
    painted = (np.ptp(picture, axis=2) > 0.05).sum()  # dots have colours, the rest is grey
    assert 6 <= painted <= 6 * 16


def test_from_above_left_is_left_and_ahead_is_up(renderer):
    places = np.array([[-1.0, 0, -3], [1.0, 0, -3], [0, 0, -6], [0, 0, 1.5]])
    scene = alone(row_of(places, 0.02, np.array([0.5, 0.5, 0.5, 0.5])))
    turned = Pose(np.array([4.0, 1.0, -2.0]), np.array([0.6, 0.0, 0.8, 0.0]))
    for pose in (FRONT.world_from_eye, turned):
        inside = Scene((replace(scene.objects[0], world_from_object=pose),))
        view = replace(FRONT, world_from_eye=pose, size=(240, 240), tangents=(-0.5, 0.5, -0.5, 0.5))
        (picture,), stats = shown(renderer, inside, [view], debug="birdseye")
        assert stats.debug["drawn"] == 3 and stats.debug["frustum"] == 1  # the one behind
        centre, scale = fit(places.T, np.zeros(3), (240, 240))  # in the eye's frame
        metres = stats.debug["metres"]
        assert metres == pytest.approx(240 * scale, rel=1e-5) and 7.5 < metres < 7.5 * 1.2
        assert np.abs(places[:, [0, 2]] - centre).max() < metres / 2, "all of it is on the map"
        for (x, _, z), name in zip(places, ("drawn",) * 3 + ("frustum",), strict=True):
            column, row = ((np.array([x, z]) - centre) * 240 / metres + 120).astype(int)
            spot = picture[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3)
            want = np.array(REASON_COLORS[name])
            cosine = (
                spot @ want / np.maximum(np.linalg.norm(spot, axis=1) * np.linalg.norm(want), 1e-6)
            )
            bright = np.linalg.norm(spot, axis=1) > 0.25
            assert (cosine[bright] > 0.995).any(), (name, x, z)


@pytest.mark.parametrize("target", [(0, -5, 0.001), (0, 5, 0.001), (3, 1, 2)])
def test_heading_is_a_level_rotation(target):
    view = replace(FRONT, world_from_eye=look_at(np.zeros(3), np.array(target), (0, 0.3, 1)))
    matrix = heading(view)[:3, :3]
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1) and matrix[1].tolist() == [0, 1, 0]


def test_depth_is_in_metres(renderer):
    places = np.array([[-1.0, 0, -2], [1.6, 0, -4]])
    scene = alone(row_of(places, np.array([0.2, 0.4]), 0.98))
    (picture,), stats = shown(renderer, scene, [FRONT], debug="depth")
    assert stats.debug["nearest"] == pytest.approx(2, rel=2e-3)
    assert stats.debug["farthest"] == pytest.approx(4, rel=2e-3)
    near, far = picture[50, 50], picture[50, 140]
    assert near.sum() > far.sum() + 0.5, "near is bright"
    texts = [text for text, _ in debug_legend("depth", stats)]
    assert texts[0].startswith("2") and texts[-1].startswith("4") and texts[2].startswith("3")


def test_objects_have_their_colours(renderer):
    ahead = one_splat(means=[[0, 0, -2]], scales=[[0.2] * 3], opacity=[0.95])
    aside = [Pose(np.array([x, 0.0, 0.0]), np.array([1.0, 0, 0, 0])) for x in (-1, 1)]
    scene = Scene((SceneObject("left", ahead, aside[0]), SceneObject("right", ahead, aside[1])))
    (picture,), stats = shown(renderer, scene, [FRONT], debug="object")
    assert stats.debug == {"left": 1.0, "right": 1.0}
    for i, column in enumerate((50, 150)):
        pixel = picture[50, column]
        wanted = np.array(object_color(i))  # but for the shade, which says how far away it is
        np.testing.assert_allclose(pixel / pixel.max(), wanted / wanted.max(), atol=5e-3)
    assert [row[1] for row in debug_legend("object", stats)] == [object_color(0), object_color(1)]


@pytest.mark.parametrize("limits", ["none", "all soft"])
def test_overdraw_counts_the_fragments(renderer, limits):
    scene, views = two_objects(700), stereo_views((90, 70))
    settings = LIMITS[limits]
    renderer.settings = settings
    renderer.update(scene)
    renderer.draw(views)
    for i, view in enumerate(views):
        got = renderer.drawing.overdraw(i, view, settings)
        want = fragments(scene, view, settings)
        assert got.shape == want.shape and want.max() > 4
        assert np.abs(got - want).max() <= 1 and (got != want).mean() < 0.01  # rounding at edges
    pictures, stats = shown(renderer, scene, views, debug="overdraw")
    assert stats.debug["largest"] == fragments(scene, views[0], RenderSettings()).max()
    row, column = np.unravel_index(fragments(scene, views[0], RenderSettings()).argmax(), (70, 90))
    np.testing.assert_allclose(pictures[0][row, column], debug_legend("overdraw")[-1][1], atol=1e-3)


def fragments(scene: Scene, view: View, settings: RenderSettings) -> np.ndarray:
    """(H, W) how many splats have alpha >= min_alpha there, in float64."""
    y, x = np.mgrid[: view.size[1], : view.size[0]] + 0.5
    number = np.zeros(y.shape)
    for obj in scene.objects:
        t = gate_object(obj, view, settings, np.zeros(3))
        for i in np.flatnonzero(t.reason == 0):
            dx, dy = x - t.mean_px[i, 0], y - t.mean_px[i, 1]
            (a, b), (_, c) = np.linalg.inv(t.covariance[i])
            r = a * dx * dx + 2 * b * dx * dy + c * dy * dy
            number += t.opacity[i] * np.exp(-r / 2) >= settings.min_alpha
    return number


@pytest.mark.parametrize("name", DEBUG_NAMES)
def test_the_picture_comes_back(renderer, name):
    scene, views = two_objects(500), stereo_views((64, 48))
    before, _ = shown(renderer, scene, views)
    pictures, _ = shown(renderer, scene, views, debug=name)
    after, stats = shown(renderer, scene, views)
    for i in range(2):
        assert pictures[i].shape == (48, 64, 3) and pictures[i].dtype == np.float32
        assert np.abs(pictures[i] - before[i]).max() > 0.1
        np.testing.assert_array_equal(before[i], after[i])
    assert stats.debug == {}


@pytest.mark.parametrize("name", DEBUG_NAMES)
def test_it_is_presented_as_resolved(renderer, session_gpu, name):
    view = front_view((64, 48))
    (picture,), _ = shown(
        renderer, two_objects(500), [view], debug=name, background=(0.3, 0.6, 0.9)
    )
    framebuffer = session_gpu.ctx.simple_framebuffer((64, 48), 4)
    renderer.present(framebuffer)
    got = np.frombuffer(framebuffer.read(components=3), np.uint8).reshape(48, 64, 3)[::-1]
    framebuffer.release()
    assert np.abs(got / 255 - np.clip(picture, 0, 1)).max() < 1.01 / 255


@pytest.mark.parametrize("name", DEBUG_NAMES)
@pytest.mark.parametrize("kind", ["empty", "hidden", "broken", "behind", "absent"])
def test_nothing_to_see_is_no_failure(renderer, name, kind):
    layers = random_layers(300)
    scene = {
        "empty": Scene(()),
        "hidden": alone(layers, visible=False),
        "broken": alone(poisoned(layers)[0]),
        "behind": alone(layers, world_from_object=Pose(np.array([0, 0, 50.0]), np.eye(4)[0])),
        "absent": alone(replace(layers, opacity=layers.opacity * 0)),
    }[kind]
    (picture,), stats = shown(renderer, scene, [front_view((48, 32))], debug=name)
    assert picture.shape == (32, 48, 3) and np.isfinite(picture).all()
    assert all(np.isfinite(n) for n in stats.debug.values())
    assert all(isinstance(text, str) and len(rgb) == 3 for text, rgb in debug_legend(name, stats))


def test_a_legend_without_numbers_and_without_a_view():
    assert debug_legend("") == []
    for name in DEBUG_NAMES:
        shown = name not in (
            "object",
            *EDGES,
        )  # numbers name objects; edges are the scene's colours
        assert (len(debug_legend(name)) >= 5) == shown
