"""Captures as strangers bring them: what is written of a phone is what the tracer sees."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import Pose
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.photo_store.open_photos import open_photos
from shapeshift.training.synthetic.tracer import Place, photograph, pixel_rays, trace
from tools.synthetic.strangers import (
    EXIF_ORIENTATION,
    KINDS,
    ON_ITS_SIDE,
    make_stranger,
    paint,
    radiance,
    straightened,
)

SIZE, COUNT = (96, 72), 16


@pytest.fixture(scope="module")
def phone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("strangers") / "phone"
    folder.mkdir()
    place, views = make_stranger(folder, "phone", 3, SIZE, COUNT)
    return folder, place, views


def test_a_phone_names_photos_that_are_not_there_and_lays_them_on_their_side(phone):
    folder, _, views = phone
    data = json.loads((folder / "transforms.json").read_text())
    there = sorted(path.name for path in (folder / "images").iterdir())
    missing = round(KINDS["phone"].missing * COUNT)
    assert len(data["frames"]) == len(views) == COUNT and len(there) == COUNT - missing < COUNT
    assert (data["k1"], data["k2"]) == KINDS["phone"].lens
    for name in there:
        with Image.open(folder / "images" / name) as photo:
            assert photo.getexif()[EXIF_ORIENTATION] == ON_ITS_SIDE
            assert photo.size == SIZE, "pixels lie as the poses say, whatever EXIF says"
    assert f"{missing} of {COUNT} photos" in " ".join(read_capture(folder).doubts)


@pytest.mark.parametrize("lens", [(0.0, 0.0), (-0.11, 0.02), (0.2, -0.03), (-0.2, 0.0)])
def test_straightened_is_the_inverse_of_opencvs_lens(lens):
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 13), np.linspace(-0.5, 0.5, 11))
    square = x**2 + y**2
    factor = 1 + lens[0] * square + lens[1] * square**2  # OpenCV's formula
    again = straightened(x * factor, y * factor, lens)
    assert np.abs(np.array(again) - (x, y)).max() < 1e-9


def test_a_phones_photos_read_straight_are_what_the_tracer_sees_without_a_lens(phone):
    """The reader's undistortion beside rays that never met a lens."""
    folder, place, views = phone
    capture = read_capture(folder)
    seen = radiance(KINDS["phone"], place, paint(np.random.default_rng(0), 8))
    found = []
    photos = open_photos(capture, 1, "object", None)
    for photo in [*photos.train, *photos.test][::3]:
        pose = photo.view.world_from_eye.matrix()
        pose[:3, 3] += capture.origin
        straight, _ = photograph(replace(photo.view, world_from_eye=Pose.from_matrix(pose)), seen)
        found.append(likeness(photo.over((0.0, 0.0, 0.0)), straight, photo.weight))
    # A JPEG resampled once, full of edges: 31.1 to 35.1 dB.
    assert min(found) > 30
    bent = []
    for name in sorted(path.name for path in (folder / "images").iterdir())[::3]:
        straight, _ = photograph(views[int(name[6:11])], seen)
        with Image.open(folder / "images" / name) as picture:
            bent.append(likeness(np.asarray(picture, np.float32) / 255, straight, None))
    # As they were taken lines bow, by up to 8 pixels in the corners: 27.6 dB in the mean, not 33.1.
    assert np.mean(found) > np.mean(bent) + 4


def likeness(shown: np.ndarray, straight: np.ndarray, weight: np.ndarray | None) -> float:
    """dB of a photo (H, W, 3) against what is traced, but for its exposure."""
    weight = np.ones(shown.shape[:2], np.float32) if weight is None else weight
    known = weight > 0
    gain = (shown * straight)[known].sum() / (straight**2)[known].sum()
    return psnr(gain * straight, shown, weight)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [24, 48])
def test_a_turn_on_the_spot_looks_away_from_the_middle_at_every_wall(seed, count):
    kind = KINDS["outward"]
    views = kind.views(count, SIZE)
    eyes = np.array([view.world_from_eye.position for view in views])
    ahead = -np.array([view.world_from_eye.matrix()[:3, 2] for view in views])
    level = ahead[:, [0, 2]] / np.linalg.norm(ahead[:, [0, 2]], axis=1, keepdims=True)
    assert np.abs(eyes[:, [0, 2]] - 0.35 * level).max() < 1e-6  # no two cameras face each other
    turns = np.sort(np.arctan2(*level.T))
    gaps = np.diff(np.append(turns, turns[0] + 2 * np.pi))
    assert gaps.max() < np.deg2rad(65) / 3, "photos do not overlap by two thirds"
    place = Place.of(kind.place(np.random.default_rng(seed)))
    column, row = (g.ravel() + 0.5 for g in np.meshgrid(np.arange(0, 96, 5), np.arange(0, 72, 5)))
    met = set()
    for view, eye in zip(views, eyes, strict=True):
        d = pixel_rays(view, column, row)
        distance, index = trace(place, np.broadcast_to(eye, d.shape), d)
        assert (index >= 0).all(), "a room has no gaps"
        assert distance.min() > 0.3, "a camera stands in a thing, or right before one"
        met |= set(index.tolist())
    assert {2, 3, 4, 5} <= met, "all four walls are photographed"
