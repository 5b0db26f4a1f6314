"""The ray tracer against walking along distance fields, and the captures that it makes."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import STOP_KINDS
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View, look_at
from shapeshift.training.synthetic import balls, workshop
from shapeshift.training.synthetic.placing import (
    FAR,
    Clearance,
    elbow,
    frame,
    inside,
    noise,
    run_of_pipe,
    turned,
)
from shapeshift.training.synthetic.solids import Ball, Cuboid, Cylinder, Disc, Ring, unit
from shapeshift.training.synthetic.tracer import (
    Light,
    Material,
    Place,
    Solid,
    blocked,
    lit_share,
    look,
    photograph,
    pixel_rays,
    surface_points,
    trace,
)
from tools.synthetic import one_shape

PLAIN = Material()
SHAPES = {
    "ball": Ball(0.7),
    "box": Cuboid((0.5, 0.3, 0.8)),
    "cylinder": Cylinder(0.4, 0.6),
    "cone": Cylinder(0.6, 0.5, 0.0),
    "frustum": Cylinder(0.3, 0.5, 0.5),
    "ring": Ring(0.6, 0.2),
    "bend": Ring(0.6, 0.15, np.pi / 4),
}


def rays(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """From a ball of 3 m towards points of a ball of 1 m."""
    random = np.random.default_rng(seed)
    o = 3 * unit(random.normal(size=(count, 3)))
    return o, unit(random.uniform(-1, 1, (count, 3)) - o)


@pytest.mark.parametrize("name", SHAPES)
def test_first_root_is_where_the_distance_field_gets_to_zero(name):
    shape = SHAPES[name]
    o, d = rays(400)
    t = Solid(shape, PLAIN).nearest(o, d)
    hit = np.isfinite(t)
    assert 0.05 < hit.mean() < 0.99
    assert np.abs(shape.distance(o[hit] + t[hit, None] * d[hit])).max() < 2e-4
    # The slow twin: small steps along the ray; nothing is met before the root, or at all.
    steps = np.linspace(0, 6, 1500)
    for i in range(len(o)):
        along = shape.distance(o[i] + steps[:, None] * d[i])
        before = along[steps < t[i] - 1e-3]
        assert (before > -1e-4).all()


@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_the_slope_of_the_distance(name):
    shape = SHAPES[name]
    o, d = rays(300, 1)
    t = Solid(shape, PLAIN).nearest(o, d)
    p = (o + np.where(np.isfinite(t), t, 0)[:, None] * d)[np.isfinite(t)]
    step = 1e-6
    slope = np.stack(
        [(shape.distance(p + e) - shape.distance(p - e)) / (2 * step) for e in step * np.eye(3)], 1
    )
    straight = (unit(slope) * shape.normal(p)).sum(1)
    # Edges have no slope of their own.
    assert np.quantile(straight, 0.03) > 0.999
    assert np.abs(np.linalg.norm(shape.normal(p), axis=1) - 1).max() < 1e-9


def test_a_disc_is_met_from_both_sides_and_not_beside():
    o = np.array([[0.2, 1, 0], [0.2, -1, 0], [0.9, 1, 0], [0.0, 0, 0.1]])
    d = np.array([[0.0, -1, 0], [0, 1, 0], [0, -1, 0], [1, 0, 0]])
    t = Solid(Disc(0.5), PLAIN).nearest(o, d)
    np.testing.assert_array_equal(t, [1, 1, np.inf, np.inf])


def test_what_is_cut_away_shows_the_inside():
    half_gone = Solid(Ball(1.0), PLAIN, keep=lambda p: p[:, 2] < 0)
    o, d = np.array([[0.0, 0, 3], [0.0, 0, -3]]), np.array([[0.0, 0, -1], [0.0, 0, 1]])
    np.testing.assert_allclose(half_gone.nearest(o, d), [4, 2])
    hits = look(Place.of([half_gone]), o, d)
    np.testing.assert_allclose(hits.normals, [[0, 0, 1], [0, 0, -1]], atol=1e-12)


def many_solids() -> list[Solid]:
    random = np.random.default_rng(5)
    shapes = list(SHAPES.values())
    out = []
    for i in range(40):
        rotation = turned("xyz"[i % 3], 360 * random.random())
        shape = shapes[i % len(shapes)]
        out.append(Solid(shape, PLAIN, frame(random.uniform(-2, 2, 3), rotation)))
    return out


def test_the_tree_finds_what_a_plain_loop_finds():
    solids = many_solids()
    place = Place.of(solids)
    o, d = rays(2000, 3)
    o = o * 2
    t, index = trace(place, o, d)
    each = np.array([s.nearest(o, d) for s in solids])
    np.testing.assert_array_equal(t, each.min(0))
    np.testing.assert_array_equal(index, np.where(np.isfinite(t), each.argmin(0), -1))
    np.testing.assert_array_equal(blocked(place, o, d), np.isfinite(t))
    assert 0.2 < np.isfinite(t).mean() < 1
    empty = trace(place, o[:0], d[:0])
    assert [len(e) for e in empty] == [0, 0]


def test_pixel_rays_are_those_of_the_pinhole():
    view = View(look_at((1.0, 2, 3), (0, 0, 0)), (-0.5, 0.3, -0.2, 0.4), 0.1, 10.0, (8, 6))
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:6, :8])
    d = pixel_rays(view, columns, rows)
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    p = d @ camera_from_world[:3, :3].T
    np.testing.assert_allclose(fx * p[:, 0] / p[:, 2] + cx, columns, atol=1e-9)
    np.testing.assert_allclose(fy * p[:, 1] / p[:, 2] + cy, rows, atol=1e-9)


def test_shadows():
    place = Place.of([Solid(Disc(5.0), PLAIN), Solid(Ball(0.5), PLAIN, frame((0.0, 2, 0)))])
    o = np.array([[0.0, 1, 0], [3.0, 1, 0], [0.0, 9, 9]])
    hits = look(place, o, np.array([[0.0, -1, 0], [0.0, -1, 0], [0.0, 1, 0]]))
    for spread in (0.0, 0.05):
        share = lit_share(place, hits, Light(towards=(0, 1, 0), spread=spread))
        np.testing.assert_allclose(share, [0, 1, 0])
    edge = look(place, np.array([[0.5, 1, 0]]), np.array([[0.0, -1, 0]]))
    assert 0 < lit_share(place, edge, Light(towards=(0, 1, 0), spread=0.1))[0] < 1


def test_photos_of_a_ball_cover_what_a_ball_covers():
    """The mask adds up to the projected area; edges are between object and background."""
    place = Place.of([Solid(Ball(0.5), Material((1.0, 1.0, 1.0)))])
    view = View(look_at((0, 0, 5.0), (0, 0, 0)), (-0.2, 0.2, -0.2, 0.2), 0.1, 10.0, (60, 60))

    def white(o, d):
        hits = look(place, o, d)
        return np.where(hits.index[:, None] >= 0, 1.0, 0.0) * np.ones(3), hits.index

    image, mask = photograph(view, white, samples=3)
    assert (image.shape, image.dtype, mask.dtype) == ((60, 60, 3), np.float32, np.float32)
    np.testing.assert_array_equal(image, np.repeat(mask[..., None], 3, 2))
    radius = np.tan(np.arcsin(0.1)) / 0.4 * 60
    assert mask.sum() == pytest.approx(np.pi * radius**2, rel=0.003)
    assert ((mask > 0) & (mask < 1)).any()


def test_openness_of_a_free_plane_and_of_a_corner():
    floor = Solid(Cuboid((1.0, 0.1, 1.0)), PLAIN, frame((0, -0.1, 0)))
    wall = Solid(Cuboid((0.1, 1.0, 1.0)), PLAIN, frame((-0.6, 0, 0)))
    o, d = (
        np.array([[0.4, 1.0, 0], [-0.49, 1, 0], [0, 1, 0]]),
        np.array([[0.0, -1, 0]] * 2 + [[0, 1.0, 0]]),
    )
    place = Place.of([floor, wall])
    clearance = Clearance.of(place, (-1, -0.2, -0.5), (1, 1, 0.5), 0.02)
    every = np.random.default_rng(0).integers(0, clearance.grid.shape, (200, 3))
    at = clearance.low + clearance.cell * every
    plain = np.minimum(np.min([s.distance(at) for s in place.solids], axis=0), FAR)
    np.testing.assert_allclose(clearance.grid[tuple(every.T)], plain, atol=1e-12)
    free, corner, sky = clearance.openness(look(place, o, d))
    assert free == pytest.approx(1, abs=0.02)
    assert corner < 0.5
    assert sky == 0


def test_pipes_join():
    """A bend's ends meet the straight parts; no gap in the distance along the whole run."""
    pipe = run_of_pipe([(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 1, -1)], 0.2, 0.05, PLAIN)
    assert len(pipe) == 5
    path = [(0, t, 0) for t in np.linspace(0, 0.8, 9)] + [
        (t, 1, 0) for t in np.linspace(0.2, 0.8, 7)
    ]
    path += [(1, 1, -t) for t in np.linspace(0.2, 1, 9)]
    bent = 0.2 * (1 - np.cos(np.pi / 4))
    path += [(bent, 1 - bent, 0), (1 - bent, 1, -bent)]
    nearest = np.min([s.distance(np.array(path, float)) for s in pipe], axis=0)
    assert (nearest < 1e-9).all()
    corner = elbow((0, 0, 0), (0, -1, 0), (1, 0, 0), 0.2, 0.05, PLAIN)
    assert corner.distance(np.zeros((1, 3)))[0] == pytest.approx(0.2 * (2**0.5 - 1) - 0.05)
    moved = inside(frame((1.0, 2, 3)), [corner])[0]
    np.testing.assert_allclose(moved.centre, np.add(corner.centre, (1, 2, 3)))


def test_noise_is_smooth_and_bounded():
    p = np.random.default_rng(0).uniform(-3, 3, (5000, 3))
    a = noise(p, 4)
    assert 0 <= a.min() < 0.2 and 0.8 < a.max() <= 1
    assert np.abs(noise(p + 1e-5, 4) - a).max() < 1e-3


# ---------------------------------------------------------------- the captures


@pytest.fixture(scope="module")
def small_balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls")
    return balls.make_balls(folder, size=48, views=12, test_views=3)


def test_balls_as_written_are_as_made(small_balls):
    got = read_capture(small_balls.folder)
    assert got.stops == small_balls.stops
    assert [s.x for s in got.stops] == [0.0, 1.0]
    for stop in got.stops:
        assert (len(got.of(stop.name, "train")), len(got.of(stop.name, "test"))) == (12, 3)
    np.testing.assert_array_equal(got.points, small_balls.points)
    assert got.background == (0.0, 0.0, 0.0)
    for a, b in zip(small_balls.photos, got.photos, strict=True):
        poses = a.view.world_from_eye.matrix(), b.view.world_from_eye.matrix()
        np.testing.assert_allclose(*poses, atol=1e-12)


def test_balls_are_unaligned_upright_and_lit(small_balls):
    eyes = {
        stop.name: np.array(
            [p.view.world_from_eye.position for p in small_balls.of(stop.name, "train")]
        )
        for stop in small_balls.stops
    }
    apart = np.linalg.norm(eyes["RGB"][:, None] - eyes["Thermal"], axis=2)
    assert apart.min() > 1e-3
    for photo in small_balls.photos:
        rgb = load_photo(photo).rgb
        assert photo.view.world_from_eye.matrix()[1, 1] > 0.3
        assert 0.02 < rgb.mean() / 255 < 0.5
        if photo.modality == "Thermal":
            assert (np.ptp(rgb, axis=2) == 0).all()


def test_balls_points_lie_on_the_balls(small_balls):
    place = balls.place()
    nearest = np.min([s.distance(small_balls.points) for s in place.solids], axis=0)
    assert np.abs(nearest).mean() < 0.004
    assert np.abs(nearest).max() < 0.03
    assert len(small_balls.points) == 20000


def test_the_same_balls_twice(small_balls, tmp_path):
    balls.make_balls(tmp_path, size=48, views=12, test_views=3)
    for photo in small_balls.photos[::7]:
        other = tmp_path / photo.path.relative_to(small_balls.folder)
        assert other.read_bytes() == photo.path.read_bytes()


def test_workshop_opens_what_it_says():
    closed, opened = workshop.place(False)[0], workshop.place(True)[0]
    assert len(closed.solids) != len(opened.solids)
    view = workshop.dome(6, 0.1, (64, 48))[5]  # close to the motor
    pictures = {}
    for stop in workshop.STOPS:
        image, mask = photograph(view, workshop.radiance(stop.name), samples=1)
        assert np.isfinite(image).all()
        assert 0 <= image.min() and image.max() <= 1
        assert 0.1 < mask.mean() < 0.95
        np.testing.assert_allclose(image[mask == 0], workshop.GREY, atol=1e-6)
        pictures[stop.name] = image
    assert np.abs(pictures["RGB"] - pictures["Opened"]).mean() > 0.005
    assert (np.ptp(pictures["Thermal"], axis=2) == 0).all()
    assert 0.6 < pictures["Thermal"].max()
    assert {s.kind for s in workshop.STOPS} <= set(STOP_KINDS)


def test_depth_and_normals_are_those_of_one_shape():
    """Against each other: normals are those of the surface that neighbouring depths span."""
    view = workshop.dome(4, 0.1, (96, 72))[1]
    depth, mask = photograph(view, one_shape.radiance("Depth"), samples=1)
    normals, _ = photograph(view, one_shape.radiance("Normals"), samples=1)
    rgb, _ = photograph(view, one_shape.radiance("RGB"), samples=1)
    assert np.ptp(depth, axis=2).max() == 0
    for picture in (depth, normals, rgb):
        np.testing.assert_allclose(picture[mask == 0], workshop.GREY, atol=1e-6)
    metres = one_shape.FAR_M - depth[..., 0] * (one_shape.FAR_M - one_shape.NEAR_M)
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:72, :96])
    rays = pixel_rays(view, columns, rows).reshape(72, 96, 3)
    points = view.world_from_eye.position + metres[..., None] * rays
    right, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
    spanned = unit(np.cross(down, right))  # towards the eye
    there = (mask[1:-1, 1:-1] == 1) & (np.linalg.norm(right, axis=2) < 0.1)
    there &= np.linalg.norm(down, axis=2) < 0.1
    told = 2 * normals[1:-1, 1:-1] - 1
    alike = (spanned * told).sum(axis=2)[there]
    assert there.sum() > 500 and np.median(alike) > 0.999  # the rest lies at edges
    assert np.abs(np.linalg.norm(told[there], axis=1) - 1).max() < 1e-5


def test_workshop_points_and_views():
    points, colors = workshop.colored_points((64, 48), 2000)
    assert points.shape == colors.shape and len(points) > 1900
    surfaces = workshop.place(False)[0].solids + workshop.place(True)[0].solids
    nearest = np.min([np.abs(s.distance(points.astype(float))) for s in surfaces], axis=0)
    assert nearest.max() < 0.01
    eyes = np.array([v.world_from_eye.position for v in workshop.dome(64, 0.0, (64, 48))])
    from_target = eyes[np.arange(64) % 6 != 5] - workshop.TARGET
    away = np.linalg.norm(from_target, axis=1)
    elevation = np.degrees(np.arcsin(from_target[:, 1] / away))
    assert 8 <= elevation.min() < 14 and 55 < elevation.max() <= 66
    assert set(away.round(6)) == set(workshop.DISTANCES)
    assert (eyes[5::6, 2] > 0.1).all()  # the close ones stand in front


def test_make_workshop_small(tmp_path):
    made = workshop.make_workshop(tmp_path, (32, 24), views=2, test_views=1, processes=1)
    got = read_capture(tmp_path)
    assert got.stops == made.stops == workshop.STOPS
    assert len(got.photos) == 9
    assert got.background == pytest.approx((workshop.GREY,) * 3)
    for photo in got.photos:
        mask = np.asarray(Image.open(tmp_path / "masks" / photo.path.relative_to(tmp_path)))
        assert mask.shape == (24, 32) and mask.max() == 255


def test_surface_points_are_seen_from_the_views():
    place = Place.of([Solid(Ball(0.5), PLAIN)])
    view = View(look_at((0, 0, 3.0), (0, 0, 0)), (-0.3, 0.3, -0.3, 0.3), 0.1, 10.0, (60, 60))
    points, solids = surface_points(place, [view], 200, 0.0)
    assert points.shape == (200, 3) and (solids == 0).all()
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.5, atol=1e-9)
    assert (points[:, 2] > 0).all()
