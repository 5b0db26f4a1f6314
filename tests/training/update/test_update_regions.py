"""Regions: who stands in them, which pixels see them, and captures moved into a scene's world."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.change.similarity import Similarity, read_change
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.sections.section import BoxShape
from shapeshift.scene.sections.section_texts import read_box
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.update.regions import STEP, UpdateRegion, cut_photo, moved_capture
from shapeshift.training.update.update_trainer import capture_for, counts_of

TURNED = (0.9238795325112867, 0.0, 0.3826834323650898, 0.0)  # 45 degrees about the vertical
BOXES = (BoxShape((0.2, 0.1, 0.0), (0.3, 0.2, 0.1), TURNED), BoxShape((-0.6, 0, 0), (0.1,) * 3))
REGION = UpdateRegion(BOXES)


def view_of(eye, size=(48, 40)) -> View:
    return View(look_at(np.array(eye), np.zeros(3)), perspective(0.9, size), 0.05, 100.0, size)


def test_faces_belong_to_a_box_and_what_lies_out_moves_onto_it():
    region = UpdateRegion((BoxShape((0, 0, 0), (1, 2, 3)),))
    ulp = np.nextafter(1.0, 2.0)
    places = np.array([[1.0, 2, 3], [ulp, 0, 0], [0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
    with np.errstate(invalid="ignore"):
        assert region.holds(places).tolist() == [True, False, True, False, False]
    moved = region.nearest(np.array([[5.0, 0.5, 0.5], [0.25, 0.5, 0.125]]))
    assert np.allclose(moved[0], [1, 0.5, 0.5], atol=3e-6) and region.holds(moved).all()
    assert moved[1].tolist() == [0.25, 0.5, 0.125]  # inside: as it was


@pytest.mark.parametrize("eye", [(0.3, 0.8, 2.0), (2.0, 0.05, -0.3), (0.2, 0.1, 0.02)])
def test_a_shadow_is_where_points_along_the_ray_lie_inside(eye):
    """The oracle walks along each ray in steps of 4 mm; the last eye stands in a box."""
    view = view_of(eye)
    shadow = REGION.shadow(view)
    left, right, down, up = view.tangents
    width, height = view.size
    x = left + (right - left) * (np.arange(width) + 0.5) / width
    y = up - (up - down) * (np.arange(height) + 0.5) / height
    ways = np.stack(np.broadcast_arrays(x, y[:, None], -1.0), axis=-1).reshape(-1, 3)
    matrix = view.world_from_eye.matrix()
    far = np.arange(0.002, 4, 0.004)
    seen = np.zeros(len(ways), bool)
    for t in far:
        seen |= REGION.holds(matrix[:3, 3] + t * ways @ matrix[:3, :3].T)
    differ = seen.reshape(height, width) != shadow
    assert shadow.any() and differ.mean() < 0.01  # rays that cut a corner by less than a step
    assert not (seen.reshape(height, width) & ~shadow).any()


def test_a_box_behind_the_eye_throws_no_shadow_and_rays_along_a_face_are_no_nan():
    behind = UpdateRegion((BoxShape((0, 0, 5), (0.5, 0.5, 0.5)),))
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    view = View(pose, (-1.0, 1.0, -1.0, 1.0), 0.1, 10.0, (3, 3))  # the middle ray: 0, 0, -1
    assert not behind.shadow(view).any()
    before = UpdateRegion((BoxShape((0, 0, -5), (0.5, 0.5, 0.5)),))
    assert before.shadow(view).astype(int).tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]


def photo_of(view: View, weight=None) -> LoadedPhoto:
    width, height = view.size
    rgba = np.random.default_rng(0).integers(0, 255, (height, width, 4)).astype(np.uint8)
    return LoadedPhoto(view, "RGB", rgba, weight, "a.png", np.ones((height, width), np.float32))


def test_a_cut_photo_holds_the_shadow_and_its_view_is_that_part():
    view = view_of((0.3, 0.8, 2.0), (200, 120))
    photo = photo_of(view)
    cut = cut_photo(photo, REGION)
    assert cut is not None
    width, height = cut.view.size
    assert width % STEP == 0 and cut.rgba.shape == (height, width, 4)
    assert int((cut.weight > 0).sum()) == int(REGION.shadow(view).sum())
    assert np.array_equal(cut.weight > 0, REGION.shadow(cut.view))
    assert cut.view.widest_tangents() == view.widest_tangents()
    assert cut_photo(photo_of(view_of((0, 0.5, -90.0))), REGION) is None  # a few pixels of it
    assert cut_photo(photo_of(view, np.zeros((120, 200), np.float32)), REGION) is None


def test_a_moved_capture_sees_the_same_in_its_pixels():
    a_from_b = Similarity(Pose(np.zeros(3), np.array(TURNED)).matrix()[:3, :3], np.ones(3), 1.7)
    view, point = view_of((0.3, 0.8, 2.0)), np.array([0.2, 0.1, -0.3])
    given = Capture(Path("c"), (Stop("RGB", 0.0),), (Photo(view, Path("p"), "RGB"),), point[None])
    moved = moved_capture(given, a_from_b)

    def pixel(view: View, place: np.ndarray) -> np.ndarray:
        camera, fx, fy, cx, cy = view.pinhole()
        x, y, z = (camera @ [*place, 1])[:3]
        return np.array([fx * x / z + cx, fy * y / z + cy, z])

    was = pixel(view, point)
    now = pixel(moved.photos[0].view, moved.points[0].astype(np.float64))
    assert np.allclose(now, was * [1, 1, 1.7], rtol=1e-6)
    assert moved.photos[0].depth_unit == pytest.approx(0.001 * 1.7)


def test_values_of_another_range_are_read_over_the_scenes():
    was = Stop("T", 1.0, "thermal", "ironbow", (0.0, 100.0), "C")
    now = replace(was, value_range=(20.0, 70.0))
    capture = Capture(Path("c"), (was,), ())
    assert counts_of((1000.0, 3000.0), was, now, capture) == (1400.0, 2400.0)
    assert counts_of((0.0, 1.0), was, was, capture) == (0.0, 1.0)
    with pytest.raises(BadFile, match="stand for 0 and 100, in the scene for 20 and 70"):
        counts_of(None, was, now, capture)
    with pytest.raises(BadFile, match="one unit"):
        counts_of((0.0, 1.0), replace(was, unit="K"), now, capture)


def test_names_of_stops_are_found_whatever_their_case():
    view = view_of((0.3, 0.8, 2.0))
    photos = tuple(Photo(view, Path("p"), name) for name in ("rgb", "X"))
    capture = Capture(Path("c"), (Stop("rgb", 0.0), Stop("X", 1.0)), photos)

    class Model:
        stops = (Stop("RGB", 0.0),)

    fitting, said = capture_for(Model(), capture)
    assert [p.modality for p in fitting.photos] == ["RGB"] and fitting.stops == Model.stops
    assert said == ("photos of 'X' are left out: the scene has no such stop.",)


GOOD = {
    "settings": {"cell_m": 0.01},
    "registration": {"a_from_b": np.eye(4).tolist()},
    "places": [
        {"x": 1, "y": 2, "z": 3, "size_x": 0.2, "size_y": 0, "size_z": 0.1, "from_x": None},
        {"x": 0, "y": 0, "z": 0, "size_x": 0.2, "size_y": 0.2, "size_z": 0.2,
         "from_x": 1.0, "from_y": 0.0, "from_z": 0.0},
    ],
}  # fmt: skip


def written(folder: Path, **more: object) -> Path:
    (folder / "places.json").write_text(json.dumps(GOOD | more))
    return folder


def test_what_change_wrote_is_read_as_boxes_with_room(tmp_path):
    known = read_change(written(tmp_path))
    assert [box.centre for box in known.boxes] == [(1, 2, 3), (0, 0, 0), (1, 0, 0)]
    assert np.allclose(known.boxes[0].half, (0.14, 0.04, 0.09))  # 4 cells of room
    assert known.a_from_b.scale == 1 and np.array_equal(known.a_from_b.rotation, np.eye(3))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"registration": {"a_from_b": [[1, 2], [3, 4]]}}, "no matrix of 4 x 4"),
        ({"registration": {"a_from_b": (np.eye(4) * [1, 2, 3, 1]).tolist()}}, "no turn, shift"),
        ({"registration": {"a_from_b": np.zeros((4, 4)).tolist()}}, "no turn, shift"),
        ({"registration": {"a_from_b": "x"}}, "no matrix of 4 x 4"),
        ({"settings": {"cell_m": 0}}, "cell_m"),
        ({"places": [{"x": 1e99}]}, "size_x"),
        ({"places": 3}, "places"),
    ],
)
def test_other_places_are_refused(tmp_path, more, said):
    with pytest.raises(BadFile, match=said):
        read_change(written(tmp_path, **more))
    with pytest.raises(BadFile, match=r"no places\.json"):
        read_change(tmp_path / "nothing")


@pytest.mark.parametrize("text", ["plane:0,1,0,0", "box:0,0,0:1,1,1:soft:0.1", "box:0,0:1,1,1",
                                  "box:0,0,0:1,nan,1", "box:0,0,0:0,1,1", "", "box"])  # fmt: skip
def test_a_box_is_all_that_where_takes(text):
    assert read_box("box:0,1,2:3,4,5") == BoxShape((0, 1, 2), (3, 4, 5))
    with pytest.raises(ValueError):
        read_box(text)
