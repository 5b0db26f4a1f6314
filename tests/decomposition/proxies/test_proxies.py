"""Proxies: cut at the plane, chosen by silhouettes, scored by distances; primitives and ground."""

from typing import cast

import numpy as np
import pytest

from shapeshift.decomposition.assemble import PIECES, Proxy, choose_proxy, proxies_apart
from shapeshift.decomposition.completion.plane import Plane
from shapeshift.decomposition.partition import LabelledView
from shapeshift.decomposition.proxies.ground import (
    distinct,
    is_within,
    seen_planes,
    slab,
    without_diagonals,
    without_pinches,
)
from shapeshift.decomposition.proxies.silhouettes import (
    SilhouetteScore,
    score_silhouettes,
    silhouette,
)
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.scene.colliders.carve import SeenDepth
from shapeshift.scene.colliders.collider import Collider, box_around
from shapeshift.scene.colliders.collider_wrap import is_watertight, join_meshes, volume
from shapeshift.scene.colliders.primitives import SHAPES, collider_of_shape
from shapeshift.scene.colliders.standing import (
    LEANS,
    MOST_PRESSED,
    SNAP,
    middle_of,
    pressed,
    stands,
)
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.scene.world.physics_shapes import mesh_shape
from tests.support.scene.physics_things import BOX_FACES, box
from tools.decomposition.surface_scores import score_surfaces, surface_of

FLOOR = Plane(np.array([0.0, 1.0, 0.0]), 0.0)
SIZE = (160, 120)


def cube(half: float = 0.1) -> Collider:
    mesh = box_around(np.array([[-half] * 3, [half] * 3]))
    return Collider((mesh.vertices,), mesh)


def view_from(eye: tuple) -> View:
    return View(look_at(eye, (0, 0, 0)), perspective(0.8, SIZE), 0.05, 10.0, SIZE)


def test_what_lies_below_the_plane_or_on_the_lowest_is_moved_onto_it():
    longest = 2.0  # along z
    points = np.array([[-1, -0.02, -1], [1, 0, -1], [0, SNAP * longest * 0.99, 1],
                       [0, SNAP * longest, 0.5], [0, 0.1, 0]], np.float32)  # fmt: skip
    (out,) = pressed([points], FLOOR)
    assert out[:3, 1].tolist() == [0, 0, 0]
    assert np.array_equal(out[3:], points[3:])  # at the threshold itself it stays


def test_pieces_of_a_thing_above_the_plane_are_drawn_down_to_it():
    pieces = [np.array([[0, 0.004, 0], [0, 0.1, 0]], np.float32),
              np.array([[0, 0.0045, 0], [0, 0.05, 0]], np.float32)]  # fmt: skip
    first, second = pressed(pieces, FLOOR)
    assert first[:, 1].tolist() == pytest.approx([0, 0.1])
    assert second[:, 1].tolist() == pytest.approx([0, 0.05])


def leaning(low: float) -> np.ndarray:
    """(8, 3): a unit cube on one edge, the other edge of its base so high above the floor."""
    points = box(0.5, 0.5, 0.5).astype(np.float64) + 0.5
    points[(points[:, 1] == 0) & (points[:, 0] == 1), 1] = low
    return points


@pytest.mark.parametrize(("low", "lies"), [
    (0.0, True), (0.02, True), (MOST_PRESSED - 0.01, True), (MOST_PRESSED + 0.01, False),
])  # fmt: skip
def test_what_stood_in_photos_has_a_base_that_carries_it(low, lies):
    """One edge alone carries nothing; above MOST_PRESSED of its height it is its own shape."""
    (out,) = pressed([leaning(low)], FLOOR)
    assert ((out[:, 1] == 0).sum() == 4) == lies
    assert stands([out], FLOOR) == lies


def test_a_thing_stands_as_far_as_it_may_lean():
    """A unit cube's middle is .5 high: moved towards an edge it stands while it is more than
    .5 tan LEANS from it."""
    top = box(0.5, 0.5, 0.5).astype(np.float64) + 0.5
    for short, good in ((1e-3, True), (-1e-3, False)):
        edge = 0.5 - 0.5 * np.tan(np.radians(LEANS)) - short
        points = top.copy()
        foot = np.array([[x, -1e-9, z] for x in (edge, 1) for z in (0, 1)])
        above = points[points[:, 1] > 0]
        body = np.concatenate([above, above - [0, 1 - 2e-4, 0]])  # just off the floor
        assert stands([body, foot], FLOOR) == good
    assert not stands([np.zeros((3, 3))], FLOOR)  # nothing solid


def test_the_middle_is_that_of_the_mass():
    from trimesh import Trimesh
    from trimesh.creation import icosphere

    ball = np.asarray(icosphere(1).vertices) * (1, 2, 3) + 4.0
    cut = ball[ball[:, 1] < 4.5]
    hull = Trimesh(cut).convex_hull
    assert middle_of([cut]) == pytest.approx(hull.center_mass, abs=1e-9)
    assert middle_of([cut, cut + 1]) == pytest.approx(hull.center_mass + 0.5, abs=1e-9)


def test_a_hull_that_swallows_a_neighbour_is_made_of_pieces(monkeypatch):
    """An L whose one hull holds the ball in its corner: its two pieces leave it alone."""
    x, z = np.eye(3)[[0, 2]]
    legs = [box(0.5, 0.1, 0.1) + 0.4 * x, box(0.1, 0.1, 0.5) + 0.4 * z]
    ball = box(0.1, 0.1, 0.1) + 0.25 * (x + z)
    monkeypatch.setattr("shapeshift.decomposition.assemble.part_of", lambda *_: (None, np.zeros(3)))
    model = cast(AnchorModel, None)  # part_of, which is another one here, would look into it
    asked = []

    def proxy(name: str, parts: list) -> Proxy:
        return Proxy(name, Collider(tuple(parts), box_around(legs[0])), SilhouetteScore(0, 0, 0))

    def make(label: int, only: str) -> Proxy:
        asked.append((label, only))
        return proxy(only, legs if label == 1 else [ball])

    proxies = {1: proxy("hull", [np.concatenate(legs)]), 2: proxy("given.glb", [ball])}
    made = proxies_apart(proxies, model, make)
    assert asked == [(1, PIECES)]  # the user's own mesh is not made anew
    assert all(map(np.array_equal, made[1].collider.parts, legs))
    assert np.array_equal(made[2].collider.parts[0], ball)
    asked.clear()
    assert proxies_apart({1: proxies[1]}, model, make) == {1: proxies[1]} and not asked


def test_a_silhouette_is_what_the_cube_covers():
    view = view_from((0, 0, 1.0))
    covered = silhouette(view, cube().parts)
    # The near face is .2 m wide, .9 m away; the far one lies within it.
    wide = 0.2 * view.pinhole()[1] / 0.9
    assert np.sqrt(covered.sum()) == pytest.approx(wide, abs=1.0)  # half a pixel on either side
    assert silhouette(view_from((0, 0, 0.12)), cube().parts) is None


def test_the_true_cube_is_chosen_and_a_smaller_one_covers_too_little():
    views = [view_from(eye) for eye in ((0, 0.5, 1), (1, 0.5, 0), (0.3, 0.9, -0.8))]
    maps = [LabelledView(v, 0.0, silhouette(v, cube().parts).astype(np.uint8)) for v in views]
    candidates = {"large": cube(0.2), "true": cube(), "small": cube(0.05)}
    best, scored = choose_proxy(candidates, np.eye(4), 1, maps)
    assert best.name == "true"
    assert best.score.iou == 1
    assert [proxy.name for proxy in scored] == ["true", "small", "large"] or scored[0] is best
    small = score_silhouettes(candidates["small"], np.eye(4), 1, maps)
    assert small.recall == pytest.approx(0.25, abs=0.06)  # half as wide, a little farther away


def test_a_mesh_is_scored_by_its_faces():
    """Two cubes that touch at an edge: their hull covers what lies between, the mesh does not."""
    low, high = (box_around(np.array([[s * 0.1, s * 0.1, -0.1], [0, 0, 0.1]])) for s in (-1, 1))
    view = view_from((0, 0, 1.0))
    labels = silhouette(view, (low.vertices, high.vertices)).astype(np.uint8)
    both = Collider((np.concatenate([low.vertices, high.vertices]),), join_meshes([low, high]))
    maps = [LabelledView(view, 0.0, labels)]
    assert score_silhouettes(both, np.eye(4), 1, maps, as_mesh=True).iou == 1
    assert score_silhouettes(both, np.eye(4), 1, maps).iou < 0.8


def test_photos_raise_a_plane_to_what_they_see_of_it():
    """Not by less than FEWEST_PIXELS, nor to what lies farther off than what counts as it."""
    eye = (0.0, 1.0, 0.001)
    view = View(look_at(eye, (0, 0, 0)), perspective(0.8, (12, 9)), 0.05, 10.0, (12, 9))
    below = Plane(FLOOR.normal, -0.02)
    ends = np.ones((9, 12), bool)

    def seen(ends: np.ndarray) -> list[SeenDepth]:
        return [SeenDepth(view, np.full((9, 12), 1.0, np.float32), ends)]

    def found(spacing_m: float, *pictures: SeenDepth) -> Plane:
        planes = {1: below, 2: Plane(FLOOR.normal, 5.0)}
        out = seen_planes(planes, pictures, spacing_m)
        assert out[2] is planes[2]
        return out[1]

    assert found(0.015, *seen(ends)).offset == pytest.approx(0, abs=1e-6)
    assert found(0.0075, *seen(ends)) is below
    assert found(0.015, *seen(ends & (np.arange(12) != 0))) is below  # 99
    assert found(0.015) is below


def test_a_silhouette_at_or_beyond_the_pictures_border_is_cut_there():
    """As the whole of a larger picture shows it, whose middle the view is."""
    wide, narrow = (
        ((2 * SIZE[0], 2 * SIZE[1]), (-0.4, 0.4, -0.3, 0.3)),
        (SIZE, (-0.2, 0.2, -0.15, 0.15)),
    )
    pose = look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    for x in (0.0, 0.15, 0.2, 0.35, 2.0):
        parts = [cube().parts[0] + np.array([x, x / 2, 0.0], np.float32)]
        large, small = (silhouette(View(pose, tangents, 0.05, 10.0, size), parts)
                        for size, tangents in (wide, narrow))  # fmt: skip
        assert large is not None and small is not None
        inner = large[SIZE[1] // 2 : -SIZE[1] // 2, SIZE[0] // 2 : -SIZE[0] // 2]
        assert (inner != small).mean() < 1e-3  # of pixels: an outline through a pixel's middle
    assert not silhouette(View(pose, narrow[1], 0.05, 10.0, SIZE), []).any()


def test_other_objects_say_nothing():
    view = view_from((0, 0, 1))
    labels = silhouette(view, cube().parts).astype(np.uint8)
    labels[:, SIZE[0] // 2 :] *= 2  # another object hides half of it
    score = score_silhouettes(cube(), np.eye(4), 1, [LabelledView(view, 0.0, labels)])
    assert (score.recall, score.iou) == (1, 1)


def test_without_a_view_the_first_candidate_is_taken():
    best, _ = choose_proxy({"first": cube(), "second": cube(0.2)}, np.eye(4), 1, [])
    assert best.name == "first"


def test_distances_of_cubes_of_two_sizes():
    same = score_surfaces(surface_of(cube()), surface_of(cube()))
    assert (same.chamfer_m, same.f1, same.hausdorff_m) == (0, 1, 0)
    apart = score_surfaces(surface_of(cube(0.11)), surface_of(cube(0.1)))
    # 10 mm from face to face, sqrt(3) of it from corner to corner; samples lie 4 mm apart.
    assert 0.0095 < apart.chamfer_m < 0.0135
    assert apart.f1 == 0
    assert 0.015 < apart.hausdorff_m < 0.0215


def test_faces_between_pieces_are_no_surface():
    left, right = (box_around(np.array([[x, -1, -1], [x + 1, 1, 1.0]])) for x in (-1, 0))
    halves = Collider((left.vertices - [1e-3, 0, 0], right.vertices), left)
    overlapping = Collider(
        (left.vertices + np.array([0.1, 0, 0], np.float32), right.vertices), left
    )
    inner = np.abs(surface_of(overlapping)[:, 0]) < 0.05
    inner &= np.abs(surface_of(overlapping)[:, 1:]).max(1) < 0.99
    assert not inner.any()
    assert len(surface_of(halves)) > len(surface_of(overlapping))


@pytest.mark.parametrize("shape", SHAPES)
def test_primitives_hold_nearly_all_of_a_tilted_brick(shape):
    random = np.random.default_rng(0)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    points = (random.uniform(-1, 1, (800, 3)) * [0.05, 0.02, 0.1]) @ turn.T + 0.3
    mesh = collider_of_shape(box_around(points), "hull").mesh
    made = collider_of_shape(mesh, shape)
    assert len(made.parts) == 1
    assert is_watertight(made.mesh.faces)
    low, high = made.parts[0].min(0), made.parts[0].max(0)
    assert (low < 0.3).all() and (high > 0.3).all()
    size = volume(made.mesh.vertices, made.mesh.faces)
    assert size >= 0.9 * volume(mesh.vertices, mesh.faces)


def test_a_box_is_the_smallest_upright_one():
    turn = np.deg2rad(30)
    flat = np.array([[-2, -1], [2, -1], [2, 1], [-2, 1.0]]) @ np.array(
        [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    )
    corners = np.concatenate([np.insert(flat, 1, y, axis=1) for y in (0.0, 3.0)])
    mesh = collider_of_shape(box_around(corners), "hull").mesh
    found = collider_of_shape(type(mesh)(corners.astype(np.float32), mesh.faces), "box")
    assert volume(found.mesh.vertices, found.mesh.faces) == pytest.approx(4 * 2 * 3, rel=1e-5)


def test_a_slab_is_closed_and_as_large_as_its_cells():
    cells = without_diagonals(np.random.default_rng(0).random((20, 30)) > 0.4)
    plane = Plane(np.array([0.0, 1.0, 0.0]), 0.5)
    made = slab(plane, np.array([0.1, 0.2]), cells, 0.02)
    assert is_watertight(made.faces)
    size = cells.sum() * 0.02**2 * 0.08  # cells of .02 m, 4 sides of a cell thick
    assert volume(made.vertices, made.faces) == pytest.approx(size, rel=1e-4)
    assert made.vertices[:, 1].max() == np.float32(0.5)


def test_planes_that_are_one_give_one_slab():
    other = Plane(np.array([0.0, 1.0, 0.0]), 0.3)
    assert distinct([FLOOR, Plane(FLOOR.normal, 0.001), other], 0.01) == [FLOOR, other]


def test_places_within_a_hull_and_around_it_are_found():
    """Against the distance to a box, which has a formula."""
    box = np.array([[x, y, z] for x in (0, 2) for y in (0, 1) for z in (0, 1)], float)
    places = np.random.default_rng(0).uniform(-1, 3, (4000, 3))
    outside = np.maximum(np.maximum(-places, places - [2, 1, 1]).max(1), -1)  # beyond its faces
    for margin in (0.0, 0.25):
        found = is_within(places, box, margin)
        np.testing.assert_array_equal(found, outside < margin)
        assert 0 < found.sum() < len(found)
    assert not is_within(np.zeros((0, 3)), box, 0.1).any()
    assert not is_within(np.full((1, 3), np.nan), box, 0.1).any()


def test_corners_that_sheets_share_go_apart():
    """Two boxes along one edge, a third alone: whoever joins equal corners finds two solids."""
    one, alone = box(1, 1, 1), box(1, 1, 1) + np.array([9, 0, 0], np.float32)
    vertices = np.concatenate([one, one + np.array([2, 2, 0], np.float32), alone])
    faces = np.concatenate([BOX_FACES + 8 * i for i in range(3)])
    made = without_pinches(vertices, faces)
    assert len(np.unique(vertices, axis=0)) == 22 and len(np.unique(made.vertices, axis=0)) == 24
    moved = np.linalg.norm(made.vertices - vertices, axis=1)
    assert (moved > 0).sum() == 4 and moved.max() < 0.05 and not moved[16:].any()
    assert mesh_shape(made)[1] == []
