"""What rays carve out of a place: a floor and a box whose depth is known by formula, and fog that
only single cameras see.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.colliders import carve
from shapeshift.scene.colliders.carve import SeenDepth, Votes, carved_mesh, is_free, votes
from shapeshift.scene.colliders.collider_wrap import is_watertight
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.world.physics import Physics

LOW, HIGH = np.array([-0.4, 0.0, -0.3]), np.array([0.4, 0.3, 0.3])  # a box on a floor at y = 0
WIDE = 2.0  # metres, half of the floor
SIZE = (64, 48)
EYES = [np.array([2.2 * np.sin(a), 0.9 + 0.5 * (i % 3), 2.2 * np.cos(a)])
        for i, a in enumerate(np.linspace(0, 2 * np.pi, 14, endpoint=False))]  # fmt: skip


def depth_of(view: View) -> np.ndarray:
    """(H, W) metres along the view to the box or the floor; Inf beside both."""
    width, height = view.size
    one = SeenDepth(view, np.ones((height, width), np.float32))
    eye = view.world_from_eye.position
    way = one.points - eye  # to where it is one metre deep
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(way[..., 1] < 0, -eye[1] / way[..., 1], np.inf)
        at = eye + floor[..., None] * way
        floor = np.where(np.abs(at[..., [0, 2]]).max(-1) < WIDE, floor, np.inf)
        near, far = np.sort(np.stack([(LOW - eye) / way, (HIGH - eye) / way]), axis=0)
    enters, leaves = near.max(-1), far.min(-1)
    return np.where(leaves > np.maximum(enters, 0), enters, floor).astype(np.float32)


@pytest.fixture(autouse=True)
def fewer_cells(monkeypatch):
    """Of 53 mm: a tenth of the time."""
    monkeypatch.setattr(carve, "CELLS", 64)


@pytest.fixture(scope="module")
def seen() -> list[SeenDepth]:
    views = [View(look_at(eye, np.array([0, 0.1, 0])), perspective(1.0, SIZE), 0.05, 100.0, SIZE)
             for eye in EYES]  # fmt: skip
    return [SeenDepth(view, depth_of(view)) for view in views]


def met(mesh, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) where on the way from an eye to points (n, 3) the mesh is met, 1: there; Inf."""
    physics = Physics()
    physics.add_static(mesh, Pose(np.zeros(3), np.array([1.0, 0, 0, 0])))
    found = []
    for way in points - eye:
        hit = physics.cast_ray(eye, way)
        found.append(hit[1] / np.linalg.norm(way) if hit else np.inf)
    return np.array(found)


def around(mesh, point: np.ndarray) -> float:
    """How often a closed mesh goes around a point: the sum of solid angles over 4 pi."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(np.arctan2(np.einsum("ij,ij->i", a, np.cross(b, c)), below).sum() / 2 / np.pi)


def test_planes_are_found_finer_than_a_cell_and_nothing_stands_in_the_way(seen):
    mesh = carved_mesh(seen, 4000)
    assert is_watertight(mesh.faces) and len(mesh.faces) <= 4400
    down = np.array([[x, -1.0, z] for x in np.linspace(-1.5, 1.5, 9) for z in (-0.9, 0.8, 1.4)])
    eye = np.array([0.0, 3.0, 0.0])
    heights = eye[1] + met(mesh, eye, down) * (down[:, 1] - eye[1])
    np.testing.assert_allclose(heights, 0, atol=0.006)  # a tenth of a cell
    top = np.array([[x, 0.3, z] for x in (-0.3, 0.0, 0.3) for z in (-0.2, 0.0, 0.2)])
    np.testing.assert_allclose(met(mesh, eye, top), 1, atol=0.002)
    for one in seen:
        assert around(mesh, one.view.world_from_eye.position) == pytest.approx(0, abs=0.01)
        rays = one.points[4::9, 4::9][~one.edges[4::9, 4::9]]
        assert (met(mesh, one.view.world_from_eye.position, rays) > 0.99).all()


def test_fog_that_few_cameras_see_is_free(seen):
    """A patch in front of each of four cameras, as training leaves it; others look through it."""
    foggy = []
    for number, one in enumerate(seen):
        depth_m = one.depth_m.copy()
        if number % 4 == 0:
            depth_m[10:38, 15:50] = 0.8
        foggy.append(SeenDepth(one.view, depth_m))
    mesh = carved_mesh(foggy, 4000)
    for one in seen:
        eye = one.view.world_from_eye.position
        assert around(mesh, eye) == pytest.approx(0, abs=0.01)
        rays = one.points[4::9, 4::9][~one.edges[4::9, 4::9]]
        assert (met(mesh, eye, rays) > 0.99).all()


def test_what_is_not_looked_for_carves_and_is_not_solid(seen):
    """The box as an object: the floor around it stays, its place holds nothing."""
    places = np.array([[0.0, 0.3, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    things = []
    for one in seen:
        floor = one.points[..., 1] < 1e-3
        things.append(SeenDepth(one.view, one.depth_m, floor))
    mesh = carved_mesh(things, 4000)
    assert mesh.vertices[:, 1].max() < 0.06
    found = votes(things, places, 0.05)
    assert found.ends[0] == 0 and found.ends[2] > 0 and is_free(found).tolist() == [
        False, True, False,
    ]  # fmt: skip


def test_within_a_thing_nothing_is_solid(seen):
    """The box as a thing that stands on no plane: a hull around it, and a cell off, is free."""
    corners = np.stack(np.meshgrid(*np.stack([LOW, HIGH], 1)), -1).reshape(-1, 3)
    mesh = carved_mesh(seen, 4000, [corners.astype(np.float32)])
    assert is_watertight(mesh.faces)
    away = np.maximum(np.maximum(LOW - mesh.vertices, mesh.vertices - HIGH), 0)
    assert np.linalg.norm(away, axis=1).min() > 0.02  # metres; a cell has 53 mm
    assert (np.abs(mesh.vertices[:, 0]) > 1.5).any()  # the floor stays


@pytest.mark.parametrize("ends", [1, 2, 10])
def test_more_than_so_many_rays_through_a_place_make_it_free(ends, monkeypatch):
    monkeypatch.setattr(carve, "LEAST_FREE", 0.5)  # a number that is exact
    through = np.array([0, ends - 1, ends, ends + 1])
    found = Votes(through, np.full(4, ends), np.zeros(4))
    assert is_free(found).tolist() == [False, False, False, True]
    nothing = Votes(np.array([0, 1]), np.array([0, 0]), np.full(2, np.nan))
    assert is_free(nothing).tolist() == [False, True]


@pytest.mark.parametrize("depth", [np.inf, np.nan, 0.0, 1e30])
def test_where_nothing_is_seen_nothing_is_solid(seen, depth):
    blind = [SeenDepth(o.view, np.full(SIZE[::-1], depth, np.float32)) for o in seen[:3]]
    assert carved_mesh([], 1000) is None
    found = carved_mesh(blind, 1000)
    assert found is None or np.isfinite(found.vertices).all()
    inside = votes(blind, np.array([[0, 0.1, 0]]), 0.05)
    assert inside.through[0] == (3 if depth > 1 else 0) and inside.ends[0] == 0
    # Their pixels in good pictures change little.
    mixed = []
    for one in seen:
        depth_m = one.depth_m.copy()
        depth_m[::7, ::7] = np.nan if depth == 0 else depth
        mixed.append(SeenDepth(one.view, depth_m))
    mesh = carved_mesh(mixed, 2000)
    top = np.array([[0.1, 0.3, 0.1]])
    assert met(mesh, np.array([0.0, 3.0, 0.0]), top)[0] == pytest.approx(1, abs=0.005)


@pytest.mark.parametrize("count", [1, 6, 7])
def test_of_few_pictures_one_ray_is_enough(seen, count):
    """Of 7 two must agree: what one alone shows is not surely there."""
    lonely = [seen[0]] + [
        SeenDepth(o.view, np.full(SIZE[::-1], np.nan, np.float32)) for o in seen[1:count]
    ]
    mesh = carved_mesh(lonely, 2000)
    assert (mesh is None) == (count > carve.FEW)


def test_a_camera_stands_in_free_space(seen):
    """One lies on the floor, where the others see it: none of it is left around the eye."""
    eye = np.array([1.2, 0.004, 0.0])
    low = View(look_at(eye, np.array([0, 0.1, 0])), perspective(1.0, SIZE), 0.05, 100.0, SIZE)
    mesh = carved_mesh([*seen, SeenDepth(low, depth_of(low))], 6000)
    assert around(mesh, eye) == pytest.approx(0, abs=0.01)


def test_the_grid_has_a_budget(seen, monkeypatch):
    """With single pixels that see for kilometres, too; dense grids are of 64 cells a side."""
    far = [replace(one, depth_m=np.where(np.indices(SIZE[::-1]).sum(0) % 9, one.depth_m, 5e3)
                   .astype(np.float32)) for one in seen]  # fmt: skip
    monkeypatch.setattr(carve, "MOST_PLACES", 20_000)
    grid = carve.grid_of(far)
    assert grid is not None
    _low, cell, where, shape = grid
    assert len(where) <= 24_000 and max(shape) <= carve.CELLS + 14
    assert cell < 0.2  # of a place of 4 m, whatever lies behind it
    tracemalloc.start()
    carved_mesh(far, 2000)
    assert tracemalloc.get_traced_memory()[1] < 32e6
    tracemalloc.stop()
