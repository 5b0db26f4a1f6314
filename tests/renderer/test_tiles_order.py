"""Orders kept over frames, quantised keys, and frames that allocate nothing: the tiles."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.gl.sort_check import quantize, stable_order
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import (
    alone,
    front_view,
    psnr_db,
    random_layers,
    stereo_views,
    two_objects,
)


def orbit(degrees: float, size=(120, 90)) -> View:
    angle = np.radians(degrees)
    eye = 4 * np.array([np.sin(angle), 0.2, np.cos(angle)])
    return View(look_at(eye, (0, 0, 0)), (-0.3, 0.3, -0.225, 0.225), 0.05, 50, size)


def film(renderer: Renderer, scene: Scene, views: list, **settings) -> list[FrameStats]:
    renderer.settings = RenderSettings(**settings)
    renderer.update(scene)
    told = []
    for group in views:
        told.append(renderer.draw(group if isinstance(group, list) else [group]))
    return told


def test_the_sort_policy_is_told(renderer):
    scene = two_objects(2000)
    told = film(renderer, scene, [orbit(0)] * 5, resort_frames=3)
    assert [(s.sorts, s.order_age) for s in told] == [(1, 0), (0, 1), (0, 2), (1, 0), (0, 1)]
    told = film(renderer, scene, [stereo_views()] * 2, resort_frames=2)
    assert [(s.sorts, s.order_age) for s in told] == [(1, 0), (0, 1)]
    told = film(renderer, scene, [stereo_views()] * 2, stereo_sort="each")
    assert [(s.sorts, s.order_age) for s in told] == [(2, 0), (2, 0)]


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_a_kept_order_of_an_unmoved_view_draws_the_same_bits(renderer, order):
    scene = two_objects(4000)
    film(renderer, scene, [orbit(10)], order=order)
    exact = renderer.image().copy()
    for _ in range(2):
        film(renderer, scene, [orbit(10)] * 2, order=order, resort_frames=0)
        np.testing.assert_array_equal(renderer.image(), exact)


@pytest.mark.parametrize("stereo", [False, True])
def test_a_stale_order_is_a_little_wrong_and_lacks_nothing(renderer, stereo):
    scene = two_objects(4000)
    views = [stereo_views() if stereo else [orbit(0)], [orbit(180)]]
    views[1] = (
        views[1] * len(views[0])
        if not stereo
        else [
            View(look_at((0.0, 0.4, -4.0), (0, 0, 0)), v.tangents, v.near, v.far, v.size)
            for v in views[0]
        ]
    )
    told = film(renderer, scene, views, resort_frames=0)
    assert [s.sorts for s in told] == [1, 0]
    behind = renderer.image().copy()
    film(renderer, scene, views[1:])
    exact = renderer.image()
    # Every splat is there from behind, too: coverage does not depend on the order.
    np.testing.assert_allclose(behind[..., 3], exact[..., 3], atol=2e-3)
    assert 10 < psnr_db(behind, exact) < 40, "front and back are the wrong way round"


def test_splats_outside_the_view_of_the_sort_are_in_the_order(renderer):
    scene = two_objects(3000)
    aside = replace(orbit(0), tangents=(0.3, 0.9, -0.2, 0.2))
    film(renderer, scene, [aside, orbit(0)], resort_frames=0)
    kept = renderer.image().copy()
    film(renderer, scene, [orbit(0)])
    np.testing.assert_array_equal(kept, renderer.image())  # the same line of sight: the same order


def test_changes_of_the_scene_sort_anew(renderer):
    layers, settings = random_layers(2000, layers=3), {"resort_frames": 0}
    scene, view = alone(layers, x=1.0), orbit(0)
    assert [s.sorts for s in film(renderer, scene, [view] * 2, **settings)] == [1, 0]
    assert [s.sorts for s in film(renderer, alone(layers, x=0.5), [view] * 2, **settings)] == [1, 0]
    turned = Pose(np.zeros(3), np.array([0.8, 0.6, 0, 0]))
    moved = Scene((SceneObject("thing", layers, turned, x=0.5),))
    assert [s.sorts for s in film(renderer, moved, [view] * 2, **settings)] == [1, 0]
    more = Scene((*moved.objects, SceneObject("other", random_layers(10))))
    assert [s.sorts for s in film(renderer, more, [view] * 2, **settings)] == [1, 0]
    assert psnr_db(renderer.image(), reference_image(more, view)) > 80


def test_limits_may_change_under_a_kept_order(renderer):
    scene, views = two_objects(3000), [orbit(0)] * 2
    film(renderer, scene, views, resort_frames=0)
    told = film(renderer, scene, views, resort_frames=0, max_pixels=2.0, fade=0.5)
    assert [s.sorts for s in told] == [0, 0]
    settings = RenderSettings(max_pixels=2.0, fade=0.5)
    assert psnr_db(renderer.image(), reference_image(scene, views[0], settings)) > 80


def test_an_order_by_distance_outlives_a_turn_of_the_head(renderer):
    scene, here = two_objects(3000), front_view((96, 96), distance=2.0)
    turned = replace(here, world_from_eye=look_at(here.world_from_eye.position, (0.5, 0.3, 0.2)))
    how = {"order": "distance", "resort_frames": 0, "resort_degrees": 1.0}
    told = film(renderer, scene, [here, turned], **how)
    assert [s.sorts for s in told] == [1, 0]
    kept = renderer.image().copy()
    film(renderer, scene, [turned], order="distance")
    np.testing.assert_array_equal(kept, renderer.image())
    further = replace(turned, world_from_eye=look_at((0.4, 0.8, 2.2), (0.5, 0.3, 0.2)))
    told = film(renderer, scene, [here, turned, further], **how)
    assert [s.sorts for s in told] == [1, 0, 1]


def orders_of(renderer: Renderer) -> np.ndarray:
    """What the sort left on the device: of equal keys a picture does not tell the order."""
    drawing = renderer.drawing
    return drawing.device.download(drawing._orders[0]).astype(np.uint32)


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_sixteen_bit_keys_are_the_order_of_quantize(renderer, order):
    scene, view = alone(random_layers(5000)), orbit(30)
    film(renderer, scene, [view], order=order, key_bits=16)
    quantised = orders_of(renderer)
    drawing = renderer.drawing
    status = drawing.device.download(drawing._projected[0].scratch.status)
    assert (status[:, 3] <= 65534).all()
    film(renderer, scene, [view], order=order)
    exact = orders_of(renderer)
    mean = drawing.splat_points()[0][:, :3].astype(np.float64)
    at = mean @ view.eye_from_world()[:3, :3].T + view.eye_from_world()[:3, 3]
    depth = np.linalg.norm(at, axis=1) if order == "distance" else -at[:, 2]
    keys = np.full(len(mean), 0xFFFFFFFF, np.uint32)
    keys[exact] = depth[exact].astype(np.float32).view(np.uint32)
    wanted = stable_order(quantize(keys), 16)[: len(exact)]
    assert sorted(quantised) == sorted(exact)
    # Float rounding may put a splat into the next step: nearly all stand where numpy puts them.
    assert (quantised == wanted).mean() > 0.98
    assert not np.array_equal(quantised, exact), "steps are coarser than floats"
    film(renderer, scene, [view], order=order, key_bits=16)
    want = reference_image(scene, view, RenderSettings(order=order))
    assert psnr_db(renderer.image(), want) > 60


def test_two_hundred_frames_of_change_allocate_nothing(renderer):
    """x, camera, limits, order and sort policy change; arena, pool and counts do not."""
    layers = random_layers(3000, layers=3)
    drawing = renderer.drawing
    settings = [
        RenderSettings(),
        RenderSettings(max_pixels=4.0, min_pixels=1.0, fade=0.3),
        RenderSettings(order="distance", resort_frames=4),
        RenderSettings(key_bits=16),
        RenderSettings(min_alpha=0.05, max_distance=4.2),
    ]

    def frame(i: int) -> tuple[int, int]:
        renderer.settings = settings[i % len(settings)]
        renderer.update(alone(layers, x=float(np.sin(0.1 * i) ** 2)))
        views = stereo_views((120, 90)) if i % 3 == 0 else [orbit(2.0 * i)]
        stats = renderer.draw(views)
        return stats.splats, stats.drawn + sum(stats.culled.values())

    for i in range(200):  # the pool has met lists of every length by then
        assert frame(i) == (3000, 3000)
    managed, allocations = drawing.device.pool.managed_bytes, drawing.allocations
    for i in range(200):
        assert frame(i) == (3000, 3000)
    assert drawing.device.pool.managed_bytes == managed
    assert drawing.allocations == allocations


def test_closing_gives_the_memory_back():
    try:
        renderer = Renderer(None)
    except NoDevice as reason:
        pytest.skip(str(reason))
    pool = renderer.drawing.device.pool
    pool.free_held()
    before = pool.managed_bytes
    film(renderer, alone(random_layers(50_000)), [orbit(0)])
    assert pool.managed_bytes > before + 50_000 * 100
    image = renderer.image()
    renderer.close()
    del image
    pool.free_held()
    assert pool.managed_bytes <= before + 10_000


@pytest.mark.parametrize("order", ["depth", "distance"])
def test_the_price_of_a_stale_order_is_told_and_paid_by_no_frame(renderer, order):
    scene, views = two_objects(3000), [orbit(0), orbit(25)]
    told = film(renderer, scene, views, order=order, resort_frames=0)
    kept, counts = renderer.image().copy(), renderer.drawing.counts()
    exact = reference_image(scene, views[1], RenderSettings(order=order))
    db = renderer.stale_order_db([views[1]])
    assert db == pytest.approx(psnr_db(kept[..., :3], exact[..., :3]), abs=0.05)
    assert 15 < db < 45
    np.testing.assert_array_equal(renderer.image(), kept)
    assert renderer.drawing.counts() == counts
    after = renderer.draw([views[1]])
    assert (told[1].order_age, after.sorts, after.order_age) == (1, 0, 2)
    np.testing.assert_array_equal(renderer.image(), kept)
    assert renderer.stale_order_db([views[0]]) == np.inf, "the view it was sorted for"


def test_a_sorted_frame_has_no_price(renderer):
    film(renderer, two_objects(500), [orbit(0)])
    assert renderer.stale_order_db([orbit(40)]) == np.inf
    stereo = stereo_views((64, 48))
    film(renderer, two_objects(500), [stereo])
    assert renderer.stale_order_db(stereo) == np.inf
