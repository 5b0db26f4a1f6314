"""The four captures with a truth: what lies in the files is what was photographed."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.decomposition.masks.specs import read_specs
from shapeshift.scene.cameras.upright import PHOTOS, angle, turn_of_world
from shapeshift.scene.captures.read_capture import read_capture
from tools.synthetic.everyday import make_everyday
from tools.synthetic.everyday_places import KINDS

SIZE, COUNT = (48, 36), 7


@pytest.fixture(scope="module", params=list(KINDS))
def made(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    truth = make_everyday(folder, request.param, size=SIZE, count=COUNT)
    return folder, truth, read_capture(folder)


def test_it_is_read_as_the_file_says(made):
    folder, truth, capture = made
    assert len(capture.photos) == COUNT and json.loads(
        (folder / "truth/truth.json").read_text()
    ) == truth  # fmt: skip
    names = [spec.name for spec in read_specs(folder / "objects.json").objects]
    assert names == [name for name in truth["labels"] if name in names] and len(names) >= 3


def test_depth_lies_on_the_plane_that_things_stand_on(made):
    """A third way to the same plane: depth along the view, the file's poses, and its unit."""
    folder, truth, capture = made
    up, point = np.array(truth["up"]), np.array(truth["plane_point"])
    turn = np.array(truth["world_from_ours"])
    assert angle(up, turn[:, 1]) < 1e-6
    heights, unit = [], truth["metres_a_unit"]
    file_from_read = read_turn(capture)
    for photo in capture.photos:
        steps = np.asarray(Image.open(folder / f"truth/depth/{photo.path.stem}.png"))
        labels = np.asarray(Image.open(folder / f"truth/labels/{photo.path.stem}.png"))
        assert steps.shape == labels.shape == SIZE[::-1] and labels.max() <= len(truth["labels"])
        places = seen_places(photo.view, steps * truth["depth_m_a_step"] / unit)
        known = (steps > 0) & (labels == 0)
        heights.append((places @ file_from_read.T - point)[known] @ up * unit)
    near = np.abs(np.concatenate(heights)) < 1e-3  # metres: on the table, within two steps
    assert near.mean() > 0.1  # of what is no thing: a table's top fills so much of the pictures


def read_turn(capture) -> np.ndarray:
    """(3, 3) the file's axes from the program's."""
    return turn_of_world(capture.notes["up_in_file"], False, "")[:3, :3].T


def seen_places(view, depth: np.ndarray) -> np.ndarray:
    """(H, W, 3) in the program's axes, of depth along the view."""
    left, right, down, up = view.tangents
    rows, columns = np.mgrid[: depth.shape[0], : depth.shape[1]] + 0.5
    x = left + (right - left) * columns / depth.shape[1]
    y = up - (up - down) * rows / depth.shape[0]
    matrix = view.world_from_eye.matrix()
    in_eye = np.stack([x * depth, y * depth, -depth], axis=-1)
    return in_eye @ matrix[:3, :3].T + matrix[:3, 3]


def test_the_photos_say_its_up_where_they_look_in_different_directions(made):
    _, truth, capture = made
    photos = next(way for way in capture.ups if way.source == PHOTOS)
    off = angle(photos.direction, read_turn(capture).T @ truth["up"])
    # hands lean by 3 degrees in the room; on a shelf all photos look one way, 22 degrees down
    assert off < {"turntable": 0.01, "dome": 0.01, "room": 4.0, "forward": 25.0}[truth["kind"]]
    assert photos.sure is (truth["kind"] != "forward")
    tilt = {"turntable": 3, "room": 27, "forward": 22, "dome": 65.8}[truth["kind"]]
    assert angle(read_turn(capture).T @ truth["up"], (0, 1, 0)) == pytest.approx(tilt, abs=0.5)
    said = any("degrees from up by" in doubt for doubt in capture.doubts)
    assert said is (truth["kind"] in ("room", "dome"))


def test_without_a_thing_its_label_is_nowhere(tmp_path):
    make_everyday(tmp_path, "turntable", ("mug",), SIZE, 3)
    seen = [np.asarray(Image.open(path)) for path in sorted((tmp_path / "truth/labels").iterdir())]
    assert not np.isin(3, seen) and np.isin(2, seen)
    names = [spec.name for spec in read_specs(tmp_path / "objects.json").objects]
    assert "mug" not in names and "apple" in names
