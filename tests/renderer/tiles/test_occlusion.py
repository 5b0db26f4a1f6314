"""Clusters behind what is drawn are left out: pictures stay the same to the bit."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.clusters import CLUSTER, Occluders, bound_clusters
from shapeshift.rasterizer.device import NoDevice, open_device
from shapeshift.rasterizer.project_arena import project_arena
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles import arena as arena_module
from shapeshift.renderer.tiles import occlusion
from shapeshift.renderer.tiles.inputs import bin_view, camera_of
from shapeshift.renderer.tiles.occlusion import moved, widest
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.pose import HiddenMesh, Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import only, psnr_db, random_layers
from tests.support.streamed_scenes import open_levels, rest, write_levels

SIZE = (112, 80)  # 7 x 5 tiles
LEAST = 1 / 255


@pytest.fixture
def at_once(monkeypatch):
    """Boxes from the first frame on, of any scene; depths noted and asked for in each."""
    with suppress(NoDevice):  # the renderer says so itself
        if open_device().kind != "cpu":
            pytest.skip("tiles on a GPU leave out what no view sees, not what is hidden")
    for name, value in (("RESTS", 0), ("LEAST_SPLATS", 0)):
        monkeypatch.setattr(arena_module, name, value)
    monkeypatch.setattr(occlusion, "LEAST_SPLATS", -(10**9))


def walls(count: int = 6, each: int = 8 * CLUSTER, seed: int = 0, layers: int = 1) -> SplatLayers:
    """Opaque walls one behind the other from z = 0 on, half a metre apart, each with a window."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.5, 1.5, (2, count, each))
    for wall in range(count):  # what would fill its window stands at its rim
        centre = rng.uniform(-0.8, 0.8, 2)
        inside = np.hypot(x[wall] - centre[0], y[wall] - centre[1]) < 0.25
        x[wall, inside] += 0.6
        order = np.lexsort((y[wall], np.floor(1.5 * x[wall])))  # clusters are parts of a wall
        x[wall], y[wall] = x[wall, order], y[wall, order]
    z = -0.5 * np.arange(count)[:, None] + 0.01 * rng.normal(size=(count, each))
    means = np.stack([x, y, z], -1).reshape(-1, 3)
    n = len(means)
    scales = rng.uniform(0.05, 0.12, (n, 3)) * (1, 1, 0.05)
    wxyz = np.column_stack([np.ones(n), 0.03 * rng.normal(size=(n, 3))])
    sh = rng.uniform(-1, 1, (n, 4, 3)) * np.array([1, 0.2, 0.2, 0.2])[:, None]
    stops = tuple(Stop(f"stop {i}", i / max(1, layers - 1)) for i in range(layers))
    arrays = [a.astype(np.float32) for a in (means, scales, wxyz, rng.uniform(0.6, 1, n), sh)]
    return SplatLayers(*arrays, (np.arange(n) % layers).astype(np.int32), stops)


def view_at(eye, target, size=SIZE, wide: float = 0.6) -> View:
    tall = wide * size[1] / size[0]
    return View(
        look_at(np.array(eye), np.array(target)), (-wide, wide, -tall, tall), 0.05, 50, size
    )


def beside(view: View, metres: float = 0.05) -> View:
    pose = view.world_from_eye
    return replace(
        view, world_from_eye=Pose(pose.position + metres * pose.matrix()[:3, 0], pose.wxyz)
    )


class Film:
    """Frames of a scene with and without what is behind, in the same renderer's two lives."""

    def __init__(self, renderer) -> None:
        self.renderer = renderer
        self.hidden: list[int] = []
        self.redrawn: list[int] = []

    def frames(self, allowed: bool, film: list) -> list:
        renderer, told = self.renderer, []
        renderer.update(Scene(()))
        renderer.drawing.allocate([])
        hiding = renderer.drawing.occlusion = occlusion.Occlusion()
        hiding.allowed = allowed
        for scene, views, settings in film:
            renderer.settings = settings
            renderer.update(scene)
            stats = renderer.draw(views)
            told.append([renderer.image(i).copy() for i in range(len(views))])
            assert stats.drawn + sum(stats.culled.values()) + stats.hidden == scene.splat_count
            assert min(stats.drawn, stats.hidden, *stats.culled.values()) >= 0
            if allowed:
                self.hidden.append(stats.hidden)
                self.redrawn.append(hiding.redrawn)
        return told

    def check(self, film: list) -> None:
        off, on = self.frames(False, film), self.frames(True, film)
        for number, (want, got) in enumerate(zip(off, on, strict=True)):
            for a, b in zip(want, got, strict=True):
                np.testing.assert_array_equal(a, b, err_msg=f"frame {number}")


def anywhere(rng: np.random.Generator, size=SIZE) -> View:
    """Before, between or behind the walls, at some place among them."""
    eye = rng.uniform((-0.6, -0.6, -3), (0.6, 0.6, 1.5))
    target = rng.uniform((-1, -1, -2.5), (1, 1, 0))
    return view_at(eye, target, size, float(rng.choice([0.3, 0.6, 1.5])))


def steps(count: int) -> list[View]:
    """A walk to the first wall, its head turning."""
    return [
        view_at((0.02 * i, 0, 1.4 - 0.03 * i), (0.3 * np.sin(0.4 * i), 0.1, -1))
        for i in range(count)
    ]


@pytest.mark.parametrize("eyes", [1, 2])
def test_a_walk(renderer, at_once, eyes):
    scene = Scene((SceneObject("walls", walls()),))
    film = [(scene, [v, beside(v)][:eyes], RenderSettings()) for v in steps(16)]
    made = Film(renderer)
    made.check(film)
    # The first frame knows no depths; of six walls most are behind the first two.
    assert made.hidden[0] == 0 and min(made.hidden[1:]) > scene.splat_count / 4


SETTINGS = {
    "plain": {}, "each": {"stereo_sort": "each"}, "one sort": {"stereo_sort": "shared"},
    "limits": {"max_distance": 3.0, "min_pixels": 1.5, "max_pixels": 40.0, "fade": 0.3},
    "half": {"render_scale": 0.5}, "early": {"min_transmittance": 0.1},
    "late": {"min_transmittance": 1e-6},
}  # fmt: skip


@pytest.mark.parametrize("eyes", [1, 2])
@pytest.mark.parametrize("name", SETTINGS)
def test_jumps(renderer, at_once, name, eyes, monkeypatch):
    """A view anywhere after a view anywhere, of other sizes.  Half of the guesses are lies: all of
    a scene is hidden, or what lies behind some depth in some tiles.
    """
    rng = np.random.default_rng(len(name) + eyes)
    number = 0

    def guess(depths, before, now):
        nonlocal number
        number += 1  # an eye a call
        honest = moved(depths, before, now)
        lie = rng.choice([0.0, 0.5, 2.0, 9.0], honest.shape) + rng.uniform(0, 0.1, honest.shape)
        return [honest, np.zeros_like(lie), lie, np.where(lie > 2, np.inf, lie)][
            (number - 1) // eyes % 4
        ]

    monkeypatch.setattr(occlusion, "moved", guess)
    scene = Scene((SceneObject("walls", walls(seed=eyes)),))
    film = []
    for frame in range(24):
        view = anywhere(rng, SIZE if frame % 8 < 5 else (65, 33))
        film.append((scene, [view, beside(view)][:eyes], RenderSettings(**SETTINGS[name])))
    made = Film(renderer)
    made.check(film)
    # One guess of four hides everything that is not before the near plane.
    assert sum(h > 0 for h in made.hidden) > 3 and sum(r > 0 for r in made.redrawn) > 3


def test_eyes_that_look_apart(renderer, at_once):
    """Each has an order of its own, and what hides in one is seen in the other."""
    scene = Scene((SceneObject("walls", walls()),))
    film = []
    for i in range(10):
        left = view_at((0.01 * i, 0, 1), (-0.5, 0, -1))
        film.append((scene, [left, view_at((0.02 * i, 0.1, 1.2), (0.9, 0, -1))], RenderSettings()))
    made = Film(renderer)
    made.check(film)
    assert max(made.hidden) > 0


def test_what_moves_between_frames(renderer, at_once):
    """x of layers, poses, objects that come, go and hide, a mesh of hidden pixels, a cut."""
    rng = np.random.default_rng(3)
    first, second = walls(layers=2), only(random_layers(900, 4, 4), np.arange(900))
    mesh = HiddenMesh(np.array([[[-2, -2], [0, -2], [-2, 0]]]))
    film = []
    for number in range(14):
        turn = np.array([1, 0.05, 0, 0]) * (1 if number % 3 else -1)
        pose = Pose(np.array([0, 0, 0.1 * (number % 5)]), turn / np.linalg.norm(turn))
        objects = [SceneObject("a", first, pose, x=(number // 4) / 3)]
        if number % 4 != 3:
            objects.append(SceneObject("b", second, visible=number % 3 != 1))
        view = steps(14)[number] if number != 9 else anywhere(rng)
        view = replace(view, hidden=mesh if number % 2 else None)
        for _ in range(2):  # the second of them rests
            film.append((Scene(tuple(objects)), [view], RenderSettings()))
    made = Film(renderer)
    made.check(film)
    assert max(made.hidden) > 0


@pytest.mark.parametrize("front", [31, 32, 33, 63, 64, 65, 96])
def test_lists_that_end_with_and_within_a_batch(renderer, at_once, front, monkeypatch):
    """So many splats before one bright cluster, after which just less than 1e-4 is left: a tile is
    done, but a batch of 32 is blended to its end, and so are those of the cluster that it holds.
    """
    monkeypatch.setattr(occlusion, "moved", lambda depths, before, now: np.full((5, 7), 2.4))
    n, pad = front + CLUSTER, CLUSTER - front % CLUSTER  # rows that are absent: clusters are whole
    means = np.zeros((n, 3))
    means[:, 2] = np.where(np.arange(n) < front, 0, -1) - 0.01 * np.arange(n) / n
    opacity = np.full(n, 1 - 0.9e-4 ** (1 / front))  # wide splats: alike in all pixels
    opacity[front:] = 0.9
    color = np.zeros((n, 1, 3))
    color[front:] = 1.5
    parts = (means, np.full((n, 3), 30.0), np.eye(4)[np.zeros(n, int)], opacity, color)
    arrays = [np.insert(a, np.full(pad, front), a[0], axis=0).astype(np.float32) for a in parts]
    arrays[3][front : front + pad] = -1
    model = SplatLayers(*arrays, np.zeros(n + pad, np.int32), (Stop("all", 1.0),))
    scene = Scene((SceneObject("fog", model),))
    view = view_at((0, 0, 2), (0, 0, 0), wide=0.1)
    made = Film(renderer)
    made.check([(scene, [view], RenderSettings()) for _ in range(3)])
    assert made.hidden == [0, CLUSTER, CLUSTER]
    again = 0 if front % 32 == 0 else 35
    assert made.redrawn == [0, again, again]


def test_pictures_are_the_oracle_s(renderer, at_once):
    """Against float64, which leaves nothing out; 1e-4 of transmittance is 80 dB."""
    scene = Scene((SceneObject("walls", walls(4)),))
    renderer.drawing.occlusion = occlusion.Occlusion()
    renderer.settings = RenderSettings()
    renderer.update(scene)
    for view in steps(3):
        stats = renderer.draw([view])
        want = reference_image(scene, view, renderer.settings)
        assert psnr_db(renderer.image(0), want) > 80
    assert stats.hidden >= scene.splat_count / 4


def test_boxes_reach_all_tiles_of_their_splats(device):
    """Each splat in a tile's list lies in a cluster that is said to reach it; any views."""
    rng = np.random.default_rng(5)
    model = walls(4)
    count = len(model.means)
    covariance = np.zeros((count, 8), np.float32)
    covariance[:, [0, 3, 5]] = model.scales**2
    arena = [
        np.column_stack([model.means, model.opacity]).astype(np.float32), covariance,
        np.zeros(count, np.int32),
    ]  # fmt: skip
    mean_opacity, covariance, index = (device.upload(a) for a in arena)
    color = device.zeros((count, 4))
    boxes = bound_clusters(device, mean_opacity, covariance, index, LEAST)
    seen = 0
    for _ in range(20):
        view = anywhere(rng)
        given = Occluders.of(device, [np.full((5, 7), np.inf)], boxes.bounds.shape[0])
        (projected,) = project_arena(
            device, mean_opacity, covariance, color, index, np.eye(4)[None], [camera_of(view)],
            clusters=replace(boxes, occluders=given),
        )  # fmt: skip
        from shapeshift.rasterizer.bin import sort_order

        tiles = bin_view(device, projected, view, sort_order(device, projected.in_tiles))
        starts, lists = device.download(tiles.starts), device.download(tiles.intersections)
        reached = device.download(given.reached)[0]
        assert not device.download(given.hidden).any()  # nothing hides behind what is not done
        for tile in range(35):
            left, right, top, bottom = reached[lists[starts[tile] : starts[tile + 1]] // CLUSTER].T
            column, row = tile % 7, tile // 7
            assert ((left <= column) & (column < right) & (top <= row) & (row < bottom)).all()
            seen += len(left)
    assert seen > 1000


def test_the_nearest_box_that_was_left_out(device):
    """One splat a cluster, at depths that are known, behind and before a limit of 2 m."""
    rows = np.zeros((3 * CLUSTER, 4), np.float32)
    rows[::CLUSTER] = [[0, 0, 1.9, 1], [0, 0, 2.1, 1], [0, 0, 5, 1]]
    covariance = np.zeros((len(rows), 8), np.float32)
    covariance[:, [0, 3, 5]] = 1e-6
    arena = [device.upload(a) for a in (rows, covariance, np.zeros(len(rows), np.int32))]
    boxes = bound_clusters(device, *arena, LEAST)
    given = Occluders.of(device, [np.full((5, 7), 2.0)], 3)
    view = View(look_at(np.zeros(3), np.array([0, 0, 1])), (-0.5, 0.5, -0.4, 0.4), 0.1, 9, SIZE)
    (projected,) = project_arena(
        device, arena[0], arena[1], device.zeros((len(rows), 4)), arena[2], np.eye(4)[None],
        [camera_of(view)], clusters=replace(boxes, occluders=given),
    )  # fmt: skip
    assert device.download(given.hidden).tolist() == [0, 1, 1]
    assert (device.download(projected.unseen) != 0).tolist() == [False, True, True]
    (nearest,) = given.nearest_boxes(device)
    there = np.isfinite(nearest).reshape(5, 7)
    assert there[2, 3] and not there[0].any()
    assert np.all((nearest[there.ravel()] > 2.099) & (nearest[there.ravel()] <= np.float32(2.1)))


def test_widest_is_the_largest_of_nine():
    from scipy.ndimage import maximum_filter

    rng = np.random.default_rng(0)
    for shape in ((1, 1), (1, 5), (4, 1), (6, 7)):
        depths = rng.normal(size=shape)
        want = maximum_filter(depths, 3, mode="constant", cval=-np.inf)
        np.testing.assert_array_equal(widest(depths), want)


def test_depths_move_with_a_view():
    """A wall two metres before the eye: from half a metre nearer it is one and a half away; turned
    round nothing is known.
    """
    before = view_at((0, 0, 2), (0, 0, 0))
    depths = np.full((5, 7), 2.0)
    np.testing.assert_allclose(moved(depths, before, before), depths)
    nearer = moved(depths, before, view_at((0, 0, 1.5), (0, 0, 0)))
    np.testing.assert_allclose(nearer, 1.5)
    assert np.isinf(moved(depths, before, view_at((0, 0, 2), (0, 0, 4)))).all()
    aside = moved(depths, before, view_at((0.6, 0, 2), (0.6, 0, 0)))  # of 2.4 m that are seen
    np.testing.assert_allclose(aside[:, :5], 2)
    assert np.isinf(aside[:, 6]).all()
    open_ = np.where(np.arange(7) == 3, np.inf, depths)
    assert np.isinf(moved(open_, before, before)).sum() == 5


@pytest.mark.parametrize(
    "changes",
    [
        {"order": "distance"}, {"key_bits": 16}, {"resort_frames": 4}, {"depth_scale": 0.5},
        {"foveation": "medium"}, {"debug": "overdraw"},
    ],
    ids=lambda changes: next(iter(changes)),
)  # fmt: skip
def test_what_needs_all_that_is_in_view_has_it(renderer, at_once, changes):
    scene = Scene((SceneObject("walls", walls()),))
    made = Film(renderer)
    made.check([(scene, [view], RenderSettings(**changes)) for view in steps(5)])
    assert made.hidden == [0] * 5


def test_views_in_the_order_of_a_frame_that_left_out_something(at_once):
    """`draw_beside` shows parts of the eyes; they lack nothing, and later frames leave out none."""
    scene = Scene((SceneObject("walls", walls()),))
    eyes = [steps(1)[0], beside(steps(1)[0])]
    parts = [eye.part(10, 8, (64, 48)) for eye in eyes]
    pictures = []
    for allowed in (False, True):
        with Renderer(None) as renderer:
            renderer.drawing.occlusion.allowed = allowed
            for _ in range(2):
                renderer.update(scene)
                stats = renderer.draw(eyes)
            assert (stats.hidden > 0) == allowed
            renderer.draw_beside(parts, scene, 2)
            pictures.append([renderer.image(i).copy() for i in range(4)])
            assert renderer.draw(eyes).hidden == 0
    np.testing.assert_array_equal(pictures[0][:2], pictures[1][:2])
    np.testing.assert_array_equal(pictures[0][2:], pictures[1][2:])


def test_rows_in_pages(at_once, tmp_path):
    """Splats in levels of detail: rows that are drawn lie in pages of the arena, two objects share
    them.
    """
    model = open_levels(write_levels(walls(4), tmp_path / "walls", 512), 10**6)
    behind = Pose(np.array([0, 0, -3.0]), np.array([1.0, 0, 0, 0]))
    scene = Scene((SceneObject("near", model), SceneObject("far", model, behind)))
    hidden = []
    with Renderer(None, "tiles") as renderer:
        renderer.update(scene)
        hiding = renderer.drawing.occlusion
        for view in steps(6):
            rest(renderer, view)
            pictures = []
            for hiding.allowed in (False, True, True):
                stats = renderer.draw([view])
                pictures.append(renderer.image(0).copy())
            hidden.append(stats.hidden)
            for picture in pictures[1:]:
                np.testing.assert_array_equal(picture, pictures[0])
        assert renderer.drawing.paged is not None
    assert min(hidden) > 1000


def test_where_nothing_hides_it_is_seldom_asked(renderer, at_once, monkeypatch):
    """One wall: depths are noted in one frame, asked for in the next, then there is a pause."""
    monkeypatch.setattr(occlusion, "LEAST_SPLATS", 1)
    scene = Scene((SceneObject("wall", walls(1)),))
    hiding = renderer.drawing.occlusion = occlusion.Occlusion()
    renderer.settings = RenderSettings()
    renderer.update(scene)
    watched = []
    for _ in range(2 * occlusion.PAUSE + 4):
        renderer.draw([steps(1)[0]])
        watched.append(hiding.watching)
    pause = [False] * (occlusion.PAUSE - 1)
    assert watched[: occlusion.PAUSE + 3] == [True, True, *pause, True, True]
