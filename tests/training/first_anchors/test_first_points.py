"""train --points: where the first anchors stand, by what was asked for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.las_run import las_points
from shapeshift.scene.captures.point_clouds import read_las
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.first_anchors import hull, initial
from shapeshift.training.first_anchors.first_anchors import first_anchors
from shapeshift.training.first_anchors.hull import carve, choose_voxel, visual_hulls, voxel_centres
from shapeshift.training.first_anchors.initial import initial_points
from shapeshift.training.first_anchors.views import pixel_size
from shapeshift.training.photos import LoadedPhoto, load_photos
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.synthetic.tracer import pixel_rays
from tests.support.training.point_files import write_las

RNG = np.random.default_rng
HEADER = "ply\nformat ascii 1.0\nelement vertex {}\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    folder = tmp_path_factory.mktemp("balls")
    make_balls(folder, size=48, views=8, test_views=1, depth=True)
    return read_capture(folder)


@pytest.fixture(scope="module")
def photos(balls) -> list[LoadedPhoto]:
    return load_photos(balls, "train", 1, "object")


@pytest.fixture
def coarse(monkeypatch) -> None:
    """Hulls of an eighth of the cells: enough where it does not matter how fine they are; as many
    of them as of large photos.
    """
    monkeypatch.setattr(hull, "FINE_SIDE", hull.FINE_SIDE // 2)
    monkeypatch.setattr(hull, "FINEST", 0.1)


def rod_photos(half: np.ndarray) -> list[LoadedPhoto]:
    """Sixteen pictures of a box of half sides `half` metres, by rays that meet it."""
    size, out = (80, 80), []
    for turn in np.linspace(0, 2 * np.pi, 16, endpoint=False):
        eye = 3 * np.array([np.cos(turn), 0.4 * np.sin(3 * turn), np.sin(turn)])
        view = View(look_at(eye, np.zeros(3)), perspective(0.8, size), 0.05, 100.0, size)
        camera_from_world, fx, fy, cx, cy = view.pinhole()
        column, row = np.meshgrid(np.arange(80) + 0.5, np.arange(80) + 0.5)
        ray = np.stack([(column - cx) / fx, (row - cy) / fy, np.ones((80, 80))], -1)
        ray = ray @ camera_from_world[:3, :3]
        with np.errstate(divide="ignore"):
            ends = np.sort([(-half - eye) / ray, (half - eye) / ray], axis=0)
        inside = ends[0].max(axis=-1) < ends[1].min(axis=-1)
        rgba = np.full((80, 80, 4), 200, np.uint8)
        rgba[..., 3] = 255 * inside
        out.append(LoadedPhoto(view, "RGB", rgba, None, f"{turn:.2f}"))
    return out


def test_shapes_of_their_own_get_as_many_anchors_as_alone(coarse):
    thick = rod_photos(np.array([0.3, 0.5, 0.3]))
    thin = [replace(p, modality="bone") for p in rod_photos(np.array([0.07, 0.4, 0.06]))]
    capture = Capture(Path("rods"), (), ())
    one, both = (initial_points(capture, p, RNG(0)) for p in (thick, thick + thin))
    assert (one.origin, len(one.shapes), len(both.shapes)) == ("hull", 1, 2)
    start = first_anchors(both, 1000, thick + thin, None)
    assert len(start.anchors) == 1000
    # the thick hull is empty there
    inside = (np.abs(start.anchors) < (0.1, 0.45, 0.09)).all(axis=1)
    assert 0.4 < inside.mean() < 0.6


def test_cells_of_a_long_thin_hull_are_cubes():
    half = np.array([0.07, 0.8, 0.06])
    (points,), doubts = visual_hulls(rod_photos(half), None)
    assert doubts == ()
    gaps = [np.diff(np.unique(points[:, axis].round(9))) for axis in range(3)]
    np.testing.assert_allclose(np.concatenate(gaps), gaps[0][0], rtol=1e-6)
    voxel = choose_voxel(points, 10**6, RNG(0))
    assert voxel == pytest.approx(gaps[0][0], rel=1e-5)
    # the grid of anchors leaves no gap: as many as there are points
    assert len(voxel_centres(points, voxel)) == pytest.approx(len(points), rel=0.02)
    assert (np.abs(points).max(axis=0) < 1.15 * half + 0.02).all()


def test_a_cube_is_carved_into_as_many_cells_as_before():
    view = View(look_at((0, 0, 9), (0, 0, 0)), perspective(0.5, (9, 9)), 0.05, 100.0, (9, 9))
    everything = [(view, np.ones((9, 9), bool))] * 2
    cells = carve(everything, np.full(3, -1.0), np.full(3, 1.0), 8)
    axis = (np.arange(8) + 0.5) / 4 - 1
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    surface = (np.abs(grid) > 0.8).any(axis=1)
    np.testing.assert_allclose(cells, grid[surface], atol=1e-12)


def off_surface(p: np.ndarray) -> np.ndarray:
    """(P,) metres from points to the nearest of the disc, the three balls and the box."""
    balls = [((-0.45, 0.35, 0.25), 0.35), ((0.5, 0.25, -0.35), 0.25), ((0.15, 0.18, 0.55), 0.18)]
    away = [np.linalg.norm(p - np.array(centre), axis=1) - radius for centre, radius in balls]
    box = (np.abs(p - (0, 0.3, -0.45)) - (0.3, 0.3, 0.2)).max(axis=1)
    return np.abs([p[:, 1], *away, box]).min(axis=0)


def test_depth_photos_give_points_on_the_surfaces(balls, photos):
    points, origin, *_ = initial_points(balls, photos, RNG(0), "depth")
    assert origin == "depth photos"  # the background is known: no guesses
    assert off_surface(points).max() < 2e-4  # metres: two steps of the depth photos
    # Every pixel that saw something has a point within the diagonal of its cube, of two pixels of
    # the view that is nearest rounded by sqrt(2) at most; an eighth of a pixel for rounding.
    seen = np.concatenate([measured(photo) for photo in photos])
    assert 0.05 * len(seen) < len(points) < 0.3 * len(seen)  # eight photos show most places
    away = np.array([np.linalg.norm(points - p, axis=1).min() for p in seen])
    pixel = pixel_size(seen, [photo.view for photo in photos])
    assert (away / pixel).max() < 2 * 2**0.5 * 3**0.5 + 0.125
    assert np.array([np.linalg.norm(seen - p, axis=1).min() for p in points]).max() < 1e-9


def measured(photo: LoadedPhoto) -> np.ndarray:
    """(P, 3) metres that a depth photo saw, pixel by pixel along its rays."""
    row, column = np.nonzero(photo.depth > 0)
    rays = pixel_rays(photo.view, column + 0.5, row + 0.5)
    eye, turn = photo.view.world_from_eye.position, photo.view.world_from_eye.matrix()
    along = photo.depth[row, column] / (rays @ -turn[:3, 2])
    return np.asarray(eye) + along[:, None] * rays


@pytest.mark.parametrize("seed", range(3))
def test_one_of_the_points_in_a_cube_is_left_the_first(seed):
    """Beside a loop over points."""
    rng = RNG(seed)
    points = rng.normal(size=(700, 3)) * rng.choice([0.01, 1.0, 100.0], (700, 1))
    points[:8] = [[0, 0, 0], [-0.0, 0, 0], [1, 1, 1], [1, 1, 1], [0.999, 1, 1], *-np.eye(3)]
    edge = np.exp(rng.uniform(-6, 3, 700))
    edge[rng.choice(700, 20, replace=False)] = np.inf
    kept, taken = [], set()
    for point, side in zip(points, edge, strict=True):
        key = None
        if np.isfinite(side):
            cube = 2.0 ** round(float(np.log2(side)))
            key = (cube, *(float(np.floor(x / cube)) for x in point))
        if key is None or key not in taken:
            kept.append(point)
            taken.add(key)
    found = initial.one_a_cell(points, edge)
    assert 100 < len(kept) < 700
    assert np.array_equal(found, np.array(kept))


def test_no_point_is_left_of_none_and_all_of_those_that_nobody_sees():
    assert initial.one_a_cell(np.zeros((0, 3)), np.zeros(0)).shape == (0, 3)
    points = np.zeros((5, 3))
    assert len(initial.one_a_cell(points, np.full(5, np.inf))) == 5
    assert len(initial.one_a_cell(points, np.full(5, 1e-30))) == 1


def test_without_points_depth_comes_before_the_hull(balls, photos, monkeypatch):
    monkeypatch.setattr(initial, "visual_hulls", lambda *_: ([np.ones((9, 3))], ()))
    bare = replace(balls, points=None)
    assert initial_points(bare, photos, RNG(0))[1] == "depth photos"
    flat = [replace(p, depth=None) for p in photos]
    assert initial_points(bare, flat, RNG(0))[1] == "hull"
    assert initial_points(balls, photos, RNG(0))[1] == "points"
    assert initial_points(balls, photos, RNG(0), "hull")[1] == "hull"
    assert initial_points(balls, photos, RNG(0), "random")[1] == "random"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("capture", "has no points of its own"),
        ("depth", "has no depth photos"),
        ("hull", "has neither masks nor a known background"),
        (
            "lidar.xyz",
            "give auto, capture, depth, hull, triangulated, random, or a file that ends in",
        ),
        ("lidar.ply", "is missing"),
        ("lidar.las", "is missing"),
    ],
)
def test_what_is_not_there_is_said(balls, photos, source, found):
    bare = replace(balls, points=None, background=None)
    with pytest.raises(BadFile, match=found):
        initial_points(bare, [replace(p, depth=None) for p in photos], RNG(0), source)


def test_many_depths_are_thinned(balls, photos, monkeypatch):
    monkeypatch.setattr(initial, "MOST_POINTS", 500)
    points = initial_points(balls, photos, RNG(0), "depth")[0]
    assert 400 < len(points) < 600


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_laser_clouds_are_read_and_thinned(tmp_path, ending):
    path, points = tmp_path / f"a.{ending}", RNG(0).uniform(-2, 2, (1001, 3))
    write_las(path, points)
    found, count = read_las(path, 10**6)
    assert count == 1001
    np.testing.assert_allclose(found, points, atol=6e-5)
    np.testing.assert_allclose(read_las(path, 300)[0], points[::4], atol=6e-5)
    for chunk in (64, 100, 1000, 1001, 1002):  # whatever the pieces, every 4th
        np.testing.assert_allclose(
            las_points(str(path), 300, chunk)["points"], points[::4], atol=6e-5
        )


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_cut_and_mangled_laser_clouds_are_one_sentence(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    write_las(path, RNG(0).uniform(-2, 2, (300, 3)))
    whole, random = path.read_bytes(), RNG(1)
    for number in range(40):
        data = bytearray(whole)
        if number % 2:
            data = data[: int(random.integers(len(whole)))]
        else:
            for at in random.integers(0, 400, 3):
                data[at] = random.integers(256)
        path.write_bytes(data)
        try:
            found, _ = read_las(path, 1000)
            assert found.ndim == 2
        except BadFile as error:
            assert "\n" not in str(error)


def test_a_chunk_table_of_nonsense_is_one_sentence(tmp_path):
    """Of a million chunks, of 2^24 bytes: laszip's decoder takes all memory or panics."""
    path = tmp_path / "a.laz"
    write_las(path, RNG(0).uniform(-2, 2, (300, 3)))
    whole = path.read_bytes()
    at = int.from_bytes(whole[int.from_bytes(whole[96:100], "little") :][:8], "little")
    for number in (1 << 20, 0xFFFFFFFF):
        path.write_bytes(whole[: at + 4] + number.to_bytes(4, "little") + whole[at + 8 :])
        with pytest.raises(BadFile, match="copy it again"):
            read_las(path, 1000)


def test_a_cloud_keeps_what_photos_see_in_the_capture_s_axes(tmp_path, balls, photos):
    far = np.array([[500.0, 0, 0], [0, 500, 0]])
    write_las(tmp_path / "scan.las", np.concatenate([balls.points[::10], far]))
    points, origin, *_ = initial_points(balls, photos, RNG(0), str(tmp_path / "scan.las"))
    count = len(balls.points[::10])
    assert origin == f"scan.las ({count:,} of {count + 2:,} points)"
    np.testing.assert_allclose(points, balls.points[::10], atol=1e-3)
    # a capture whose files have -Y up: its clouds are turned as its poses were
    rows = "\n".join("{} {} {}".format(*(p * (1, -1, -1))) for p in balls.points[::10])
    (tmp_path / "scan.ply").write_text(f"{HEADER.format(count)}end_header\n{rows}\n")
    turned = replace(balls, notes={"up_in_file": (0.0, -1.0, 0.0)})
    points = initial_points(turned, photos, RNG(0), str(tmp_path / "scan.ply"))[0]
    np.testing.assert_allclose(points, balls.points[::10], atol=1e-5)


def test_a_cloud_of_another_place_is_refused(tmp_path, balls, photos):
    write_las(tmp_path / "scan.las", balls.points[::10] + 3000)
    with pytest.raises(BadFile, match="no photo sees any of its"):
        initial_points(balls, photos, RNG(0), str(tmp_path / "scan.las"))


def test_the_same_seed_gives_the_same_points(balls, photos, coarse):
    for source in ("depth", "random", "hull"):
        first, second = (initial_points(balls, photos, RNG(7), source)[0] for _ in range(2))
        np.testing.assert_array_equal(first, second)
