"""Clusters that no view sees are left out: their boxes, and pictures the same to the bit."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.clusters import CLUSTER, bound_clusters
from shapeshift.rasterizer.project_arena import Limits, clusters_unseen, project_arena
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.tiles import arena as arena_module
from shapeshift.renderer.tiles.inputs import camera_of
from shapeshift.scene.pose import HiddenMesh, Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer import poison
from tests.support.renderer.reference_reasons import reference_counts
from tests.support.splat_scenes import only, random_layers, two_objects

LEAST = 1 / 255
COUNT = 12 * CLUSTER + 17


def in_order(count: int, seed: int = 0, **kind):
    """A long cloud whose neighbours in the file are neighbours along x."""
    layers = random_layers(count, seed, **kind)
    means = layers.means * np.array([4, 1, 1], np.float32)
    layers = replace(layers, means=means, scales=layers.scales * np.float32(0.3))
    return only(layers, np.argsort(means[:, 0]))


def looking(rng: np.random.Generator, size=(96, 72)) -> View:
    """From near or far, inside or beside, wide or narrow, off the axis or not."""
    eye = rng.normal(size=3) * rng.choice([0.2, 1.0, 3.0])
    pose = look_at(eye, rng.normal(size=3) * (2, 0.7, 0.7))
    wide, aside = rng.choice([0.1, 0.4, 1.5]), rng.choice([0.0, 0.6])
    tangents = (aside - wide, aside + wide, -0.75 * wide, 0.75 * wide)
    return View(pose, tangents, float(rng.choice([0.01, 0.5])), 50, size)


def pose_of(rng: np.random.Generator) -> Pose:
    wxyz = rng.normal(size=4)
    return Pose(rng.normal(size=3) * 0.2, wxyz / np.linalg.norm(wxyz))


def upload(device, mean_opacity, covariance, index=None):
    count = len(mean_opacity)
    index = np.zeros(count, np.int32) if index is None else index
    arrays = (mean_opacity.astype(np.float32), covariance.astype(np.float32), index)
    return tuple(device.upload(a) for a in arrays)


def splats(count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(count, 3, 3)) * 0.05
    matrix = factor @ factor.transpose(0, 2, 1)
    covariance = np.zeros((count, 8))
    covariance[:, :6] = matrix[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    mean_opacity = np.column_stack([rng.normal(size=(count, 3)), rng.uniform(-0.1, 1, count)])
    return mean_opacity, covariance, np.linalg.eigvalsh(matrix)[:, -1]


@pytest.mark.parametrize("count", [1, CLUSTER - 1, CLUSTER, CLUSTER + 1, 5 * CLUSTER + 3])
def test_boxes_hold_their_splats(device, count):
    mean_opacity, covariance, widest = splats(count)
    made = bound_clusters(device, *upload(device, mean_opacity, covariance), LEAST)
    bounds = device.download(made.bounds)
    assert len(bounds) == -(-count // CLUSTER)
    for c, row in enumerate(bounds):
        rows = slice(c * CLUSTER, (c + 1) * CLUSTER)
        bright = mean_opacity[rows, 3].astype(np.float32) >= np.float32(LEAST)
        held = mean_opacity[rows].astype(np.float32)[bright]
        np.testing.assert_array_equal(row[:3], held[:, :3].min(axis=0))
        np.testing.assert_array_equal(row[3:6], held[:, :3].max(axis=0))
        most = widest[rows][bright].max()
        assert most * (1 - 1e-5) <= row[6] <= 2 * most  # a sum of a row is at most sqrt(3) times it
        assert row[7] == held[:, 3].max() and row[8] == bright.sum() and row[9] == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e20])
@pytest.mark.parametrize("column", range(9))
def test_a_box_of_what_is_no_number_says_nothing(device, value, column):
    """One splat of 300; columns: three of its mean, six of its covariance."""
    mean_opacity, covariance, _ = splats(CLUSTER + 44)
    mean_opacity[:, 3] = 0.5
    into = mean_opacity if column < 3 else covariance
    into[CLUSTER + 7, column if column < 3 else column - 3] = value
    made = bound_clusters(device, *upload(device, mean_opacity, covariance), LEAST)
    assert device.download(made.bounds)[:, 9].tolist() == [0, -1]
    mean_opacity[CLUSTER + 7, 3] = 0  # it is absent: what else it says does not matter
    made = bound_clusters(device, *upload(device, mean_opacity, covariance), LEAST)
    assert device.download(made.bounds)[:, 9].tolist() == [0, 0]


def test_a_box_of_two_objects_says_nothing(device):
    mean_opacity, covariance, _ = splats(3 * CLUSTER)
    index = np.repeat(np.arange(2, dtype=np.int32), [CLUSTER + 1, 2 * CLUSTER - 1])
    mean_opacity[:, 3] = 1
    made = bound_clusters(device, *upload(device, mean_opacity, covariance, index), LEAST)
    assert device.download(made.bounds)[:, 9].tolist() == [0, -1, 1]


def same_projection(device, arena, color, poses, cameras, limits, clusters, before):
    """Asserts that leaving out changes nothing that a picture or a count is made of."""
    mean_opacity, covariance, index = arena
    given = (device, mean_opacity, covariance, color, index, poses, cameras, limits)
    whole = project_arena(*given, into=before[0])
    part = project_arena(*given, into=before[1], clusters=clusters)
    for a, b in zip(whole, part, strict=True):
        assert a.culled(device) == b.culled(device)
        records, others = device.download(a.record), device.download(b.record)
        live = records[:, 9] > 0
        np.testing.assert_array_equal(live, others[:, 9] > 0)
        np.testing.assert_array_equal(records[live], others[live])
        np.testing.assert_array_equal(device.download(a.depth), device.download(b.depth))
        for name in ("tile_bounds", "status"):
            mine, its = (getattr(p.in_tiles, name) for p in (a, b))
            np.testing.assert_array_equal(device.download(mine), device.download(its))
    return whole, part


@pytest.mark.parametrize("views", [1, 2])
@pytest.mark.parametrize("limits", [Limits(), Limits(max_distance=9.0), Limits(low_pass=0.0)])
def test_gates_count_what_was_left_out(device, views, limits):
    """Random views one after the other, in arrays that are kept: every record, bound and count."""
    rng = np.random.default_rng(views)
    layers = in_order(COUNT)
    mean_opacity, covariance, _ = splats(COUNT)
    mean_opacity[:, :3], covariance = layers.means, covariance * 0.01
    arena = upload(device, mean_opacity, covariance)
    color = device.upload(rng.uniform(size=(COUNT, 4)).astype(np.float32))
    clusters = bound_clusters(device, *arena, limits.min_alpha)
    before, left_out = (None, None), 0
    for _ in range(25):
        seen = looking(rng)
        beside = Pose(seen.world_from_eye.position + 0.03, seen.world_from_eye.wxyz)
        cameras = [camera_of(v) for v in (seen, replace(seen, world_from_eye=beside))[:views]]
        poses = pose_of(rng).matrix()[None]
        before = same_projection(device, arena, color, poses, cameras, limits, clusters, before)
        flags = device.download(before[1][0].unseen)
        asked = clusters_unseen(device, clusters, cameras, limits, poses)
        np.testing.assert_array_equal(flags != 0, asked)
        left_out += np.count_nonzero(flags)
    assert left_out > 10


def test_the_edge_of_a_picture_in_steps_of_floats(device):
    """Points, a cluster of them each, move across an edge by steps of 1e-7 to 1 pixel."""
    view = View(
        Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-0.5, 0.5, -0.4, 0.4), 0.1, 50, (64, 48)
    )
    steps = np.concatenate([[0], np.geomspace(1e-7, 1, 60)])
    for limits in (Limits(), Limits(low_pass=2.0)):
        reach = np.sqrt(2 * np.log(0.5 / LEAST) * limits.low_pass) / 64  # of a width of 1 at z = -1
        x = np.concatenate([s * (0.5 + reach + t * steps / 64) for s in (-1, 1) for t in (-1, 1)])
        count = len(x) * CLUSTER
        mean_opacity = np.zeros((count, 4))
        mean_opacity[:, 0], mean_opacity[:, 2], mean_opacity[:, 3] = np.repeat(x, CLUSTER), -1, 0.5
        arena = upload(device, mean_opacity, np.full((count, 8), 1e-16))
        clusters = bound_clusters(device, *arena, LEAST)
        color = device.zeros((count, 4))
        given = (arena, color, np.eye(4)[None], [camera_of(view)], limits, clusters)
        _, (part,) = same_projection(device, *given, (None, None))
        flags = device.download(part.unseen) != 0
        seen = device.download(part.depth)[::CLUSTER] < 1e29
        assert not (flags & seen).any() and flags.any() and seen.any()


def test_behind_the_near_plane(device):
    depths = np.concatenate([[-1.0, 0.0, 0.1], 0.1 + np.geomspace(1e-8, 1e-2, 20)])
    count = len(depths) * CLUSTER
    mean_opacity = np.zeros((count, 4))
    mean_opacity[:, 2], mean_opacity[:, 3] = -np.repeat(depths, CLUSTER), 0.5
    arena = upload(device, mean_opacity, np.full((count, 8), 1e-6))
    view = View(
        Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-0.5, 0.5, -0.4, 0.4), 0.1, 50, (64, 48)
    )
    clusters = bound_clusters(device, *arena, LEAST)
    given = (arena, device.zeros((count, 4)), np.eye(4)[None], [camera_of(view)], Limits())
    _, (part,) = same_projection(device, *given, clusters, (None, None))
    assert (device.download(part.unseen) != 0)[:2].all()


@pytest.fixture
def at_once(monkeypatch):
    """Boxes from the first frame on, of any scene, and asked for in each."""
    for name, value in (("RESTS", 0), ("LEAST_SPLATS", 0)):
        monkeypatch.setattr(arena_module, name, value)


class Film:
    """Frames of a scene with and without leaving out, in the same renderer's two lives."""

    def __init__(self, renderer) -> None:
        self.renderer, self.left_out = renderer, 0

    def frames(self, allowed: bool, film: list) -> list:
        renderer, told = self.renderer, []
        renderer.drawing.allocate([])
        renderer.update(Scene(()))
        renderer.drawing.culling.allowed = allowed
        for scene, views, settings in film:
            renderer.settings = settings
            renderer.update(scene)
            stats = renderer.draw(views)
            images = [renderer.image(i).copy() for i in range(len(views))]
            self.left_out += renderer.drawing.culling.left_out or 0
            told.append((stats.drawn, stats.culled, stats.sorts, images))
        renderer.drawing.culling.allowed = True
        return told

    def check(self, film: list, least: int = 1) -> None:
        off, on = self.frames(False, film), self.frames(True, film)
        for number, (want, got) in enumerate(zip(off, on, strict=True)):
            assert want[:3] == got[:3], number
            for a, b in zip(want[3], got[3], strict=True):
                np.testing.assert_array_equal(a, b, err_msg=f"frame {number}")
        assert self.left_out >= least


SETTINGS = {
    "plain": {},
    "kept order": {"order": "distance", "resort_frames": 4},
    "one sort": {"stereo_sort": "shared"},
    "16 bits": {"key_bits": 16},
    "limits": {"max_distance": 9.0, "min_pixels": 1.5, "max_pixels": 20.0, "fade": 0.3},
    "half": {"render_scale": 0.5},
    "fovea": {"foveation": "medium"},
    "depth": {"depth_scale": 0.5},
}


@pytest.mark.parametrize("views", [1, 2, 4])
@pytest.mark.parametrize("name", SETTINGS)
def test_jumps(renderer, at_once, name, views):
    """A view anywhere after a view anywhere, of other sizes: eyes, and four parts of two eyes."""
    rng = np.random.default_rng(len(name) + views)
    scene = Scene((SceneObject("cloud", in_order(COUNT, coefficients=16)),))
    film = []
    for number in range(8):
        size = (96, 72) if number < 4 else (65, 33)
        eye = looking(rng, size)
        group = [eye]
        for k in range(1, views):
            place = eye.world_from_eye.position + np.array([0.03 * k, 0, 0])
            group.append(replace(eye, world_from_eye=Pose(place, eye.world_from_eye.wxyz)))
        film.append((scene, group, RenderSettings(**SETTINGS[name])))
    kept = views > 2 or name == "kept order"  # an order of all leaves out nobody
    Film(renderer).check(film, 0 if kept else 1)


def test_what_moves_between_frames(renderer, at_once):
    """x of layers, poses, objects that come, go and hide, a mesh of hidden pixels."""
    rng = np.random.default_rng(3)
    first, second = in_order(COUNT, layers=3, coefficients=9), in_order(COUNT // 2, 4)
    mesh = HiddenMesh(np.array([[[-2, -2], [0, -2], [-2, 0]]]))
    film = []
    for number in range(12):
        turned = pose_of(rng)
        objects = [SceneObject("a", first, turned, x=number / 11)]
        if number % 4 != 3:
            objects.append(SceneObject("b", second, visible=number % 3 != 1))
        view = looking(rng)
        view = replace(view, hidden=mesh if number % 2 else None)
        for _ in range(2):  # the second of them rests
            film.append((Scene(tuple(objects)), [view], RenderSettings()))
    Film(renderer).check(film)


def test_counts_are_the_oracle_s(renderer, at_once):
    rng = np.random.default_rng(8)
    layers = in_order(COUNT)
    scene = Scene((SceneObject("cloud", layers),))
    renderer.update(scene)
    for _ in range(6):
        view = looking(rng)
        stats = renderer.draw([view])
        told = {"drawn": stats.drawn, **stats.culled}
        assert told == reference_counts(scene, view, renderer.settings)


@pytest.mark.parametrize("seed", range(60))
def test_what_is_no_number_anywhere(renderer, at_once, seed):
    """The scenes of the poison tests, x and settings among them: leaving out changes no picture."""
    try:
        made = poison.make(seed)
    except ValueError:
        pytest.skip("refused at the door")
    settings = replace(made.settings, debug="")
    film = [(made.scene, views, settings) for views in poison.walk(made)]
    Film(renderer).check(film, 0)


def test_boxes_wait_until_a_scene_rests(renderer, monkeypatch):
    """Frames with the same splats before boxes are made, and none while x moves or for so few."""
    monkeypatch.setattr(arena_module, "LEAST_SPLATS", 2 * CLUSTER)
    layers = in_order(COUNT, layers=2)
    view = View(look_at((0, 0, 1), (1, 0, 0)), (-0.1, 0.1, -0.1, 0.1), 0.05, 50, (64, 64))
    drawing = renderer.drawing
    renderer.settings = RenderSettings()
    for number in range(arena_module.RESTS + 4):
        renderer.update(Scene((SceneObject("cloud", layers, x=0.05 * number),)))
        renderer.draw([view])
        assert drawing.culling.left_out is None
    for number in range(arena_module.RESTS + 1):
        assert (drawing.culling.in_use(LEAST) is None) == (number < arena_module.RESTS)
        renderer.draw([view])
    assert drawing.culling.in_use(2 * LEAST) is None
    for count in (2 * CLUSTER - 1, 2 * CLUSTER):
        renderer.update(Scene((SceneObject("cloud", only(layers, np.arange(count))),)))
        for _ in range(arena_module.RESTS + 1):
            renderer.draw([view])
        assert (drawing.culling.left_out is None) == (count < 2 * CLUSTER)


def test_where_too_little_is_out_of_view_nobody_is_asked(renderer, monkeypatch):
    monkeypatch.setattr(arena_module, "LEAST_SPLATS", CLUSTER)
    monkeypatch.setattr(renderer.drawing.occlusion, "allowed", False)  # it asks by itself
    layers = in_order(COUNT)
    far = View(look_at((0, 0, 90), (0, 0, 0)), (-0.4, 0.4, -0.4, 0.4), 0.05, 100, (64, 64))
    renderer.settings = RenderSettings()
    renderer.update(Scene((SceneObject("cloud", layers),)))
    asked = []
    for _ in range(arena_module.RESTS + 1 + 2 * arena_module.PAUSE):
        renderer.draw([far])
        asked.append(renderer.drawing.culling.left_out is not None)
    first = arena_module.RESTS
    assert asked.index(True) == first and sum(asked[first : first + arena_module.PAUSE]) == 1
    assert asked[first + arena_module.PAUSE]


def test_two_objects_share_an_arena(renderer, at_once):
    rng = np.random.default_rng(5)
    scene = two_objects(COUNT)
    film = [(scene, [looking(rng), looking(rng)], RenderSettings()) for _ in range(6)]
    Film(renderer).check(film, 0)


def test_an_order_of_all_leaves_out_nobody(device):
    from shapeshift.rasterizer.project_arena import SortFrames

    mean_opacity, covariance, _ = splats(CLUSTER)
    arena = upload(device, mean_opacity, covariance)
    clusters = bound_clusters(device, *arena, LEAST)
    camera = camera_of(looking(np.random.default_rng(0)))
    with pytest.raises(ValueError, match="cannot leave out"):
        project_arena(
            device, arena[0], arena[1], device.zeros((CLUSTER, 4)), arena[2], np.eye(4)[None],
            [camera], sort=SortFrames((np.eye(4),), keep_outside=True), clusters=clusters,
        )  # fmt: skip
