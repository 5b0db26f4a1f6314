"""Photos as masks are made on them: places and masks of large and of bent ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.decomposition.find_objects import in_file
from shapeshift.decomposition.label_folder import read_map
from shapeshift.decomposition.masks.label_maps import SILENT, write_label_map
from shapeshift.decomposition.masks.specs import ObjectSpec, PhotoPrompt
from shapeshift.decomposition.masks.work_photos import (
    MOST_SIDE,
    WorkPhoto,
    prompt_of,
    straight_points,
    work_photos,
)
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.undistort import pinhole_of, straight_pixels
from shapeshift.scene.pose import View, look_at, perspective

RGB = Stop("RGB", 0.0)


def photo_of(path: Path, size: tuple[int, int], k1: float = 0.0, factor: int = 1) -> WorkPhoto:
    """A grey photo, bent where k1 is not 0."""
    Image.new("RGB", size, (90, 90, 90)).save(path)
    view = View(look_at((0, 0, 3), (0, 0, 0)), perspective(0.8, size), 0.05, 100.0, size)
    photo = Photo(view, path, "RGB")
    if k1:
        lens = ColmapCamera("SIMPLE_RADIAL", size, (0.8 * size[0], size[0] / 2, size[1] / 2, k1))
        photo = replace(photo, lens=lens, view=view.resized(pinhole_of(lens).size))
    return WorkPhoto(path.name, photo, factor, photo.view.divided(factor), RGB)


@pytest.mark.parametrize(("size", "factor"), [
    ((MOST_SIDE, 10), 1), ((MOST_SIDE + 1, 10), 2), ((10, 3 * MOST_SIDE), 3), ((1, 1), 1),
])  # fmt: skip
def test_large_photos_are_divided(tmp_path, size, factor):
    here = photo_of(tmp_path / "a.png", size)
    (work,) = work_photos(Capture(tmp_path, (RGB,), (here.photo,)), (RGB,))
    assert work.factor == factor and max(work.view.size) <= MOST_SIDE
    assert work.pixels().shape == (*work.view.size[::-1], 3)
    np.testing.assert_allclose(work.places([(size[0], 0)]), [[size[0] / factor, 0]])


@pytest.mark.parametrize("k1", [0.2, -0.2])
def test_places_in_a_bent_photo_become_places_in_the_straight_one(tmp_path, k1):
    """There and back, by COLMAP's own functions: what the straight camera sees at a place."""
    photo = photo_of(tmp_path / "a.png", (64, 48), k1)
    x, y = np.array([20.0, 30.5]), np.array([15.0, 33.0])
    bent = straight_pixels(photo.photo.lens, x, y).reshape(-1, 2)
    straight = straight_points(photo.photo.lens, bent)
    np.testing.assert_allclose(straight, [[a, b] for b in y for a in x], atol=1e-6)
    assert np.abs(bent - straight).max() > 0.01


def test_what_a_fisheye_sees_past_90_degrees_is_outside(tmp_path):
    """An equidistant lens by hand: a pixel lies at the angle times the focal length."""
    photo, focal = photo_of(tmp_path / "a.png", (64, 64)), 16.0
    lens = ColmapCamera("OPENCV_FISHEYE", (64, 64), (focal, focal, 32, 32, 0, 0, 0, 0))
    photo = replace(photo, photo=replace(photo.photo, lens=lens))
    angles = np.array([0.0, 0.5, 1.5, 1.6, 1.9])  # radians
    straight = straight_points(lens, np.stack([32 + focal * angles, np.full(5, 32.0)], axis=1))
    wanted = focal * np.tan(angles[:3]) + pinhole_of(lens).centre[0]
    np.testing.assert_allclose(straight[:3, 0], wanted, rtol=1e-6)
    assert np.isnan(straight[3:]).all()
    prompt_of(ObjectSpec(1, "thing"), PhotoPrompt("a.png", inside=((40, 32),)), photo)
    with pytest.raises(BadFile, match=r"thing': 62, 32 of a.png lies outside of what"):
        prompt_of(ObjectSpec(1, "thing"), PhotoPrompt("a.png", inside=((62, 32),)), photo)
    with pytest.raises(BadFile, match="lies outside of what"):
        prompt_of(ObjectSpec(1, "thing"), PhotoPrompt("a.png", (2, 30, 40, 34)), photo)


@pytest.mark.parametrize("k1", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("factor", [1, 2])
def test_a_mask_and_a_box_of_a_photo_lie_in_one_place(tmp_path, k1, factor):
    photo = photo_of(tmp_path / "a.png", (128, 96), k1, factor)
    mask = np.zeros((96, 128), np.uint8)
    mask[20:60, 30:90] = 255
    write_label_map(mask, tmp_path / "m.png")
    found = photo.mask(tmp_path / "m.png", None)
    assert found.shape == photo.view.size[::-1]
    said = PhotoPrompt("a.png", (30, 20, 90, 60), ((60, 40),))
    prompt = prompt_of(ObjectSpec(1, "thing"), said, photo)
    rows, columns = np.nonzero(found)
    around = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    np.testing.assert_allclose(prompt.box, around, atol=1.5 + 3 * bool(k1))  # sides are curves
    x, y = prompt.inside[0].astype(int)
    assert found[y, x]


@pytest.mark.parametrize("k1", [0.0, 0.2, -0.2])
@pytest.mark.parametrize("factor", [1, 2])
def test_label_maps_written_as_the_file_lies_are_read_again(tmp_path, k1, factor):
    """But for a pixel where labels meet: two roundings to the nearest."""
    photo = photo_of(tmp_path / "a.png", (128, 96), k1, factor)
    width, height = photo.view.size
    y, x = np.mgrid[:height, :width] // 12
    labels = (1 + (x + 2 * y) % 5).astype(np.uint8)
    write_label_map(in_file(labels, photo), tmp_path / "m.png")
    _, again = read_map(tmp_path / "m.png", photo.photo, factor)
    told = again != SILENT
    assert told.mean() > (0.85 if k1 else 0.999)
    inner = told & (np.mgrid[:height, :width] % 12 % 11 > 0).all(0)  # not at a patch's edge
    assert inner.sum() > 500 and (again == labels)[inner].mean() > 0.99


def test_a_place_outside_of_the_photo_is_refused(tmp_path):
    photo = photo_of(tmp_path / "a.png", (64, 48), 0.2)
    spec = ObjectSpec(1, "thing")
    prompt_of(spec, PhotoPrompt("a.png", (0, 0, 64, 48)), photo)
    for said in (
        PhotoPrompt("a.png", (0, 0, 64.1, 48)), PhotoPrompt("a.png", inside=((3, 48.1),)),
        PhotoPrompt("a.png", inside=((3, 4),), outside=((70, 4),)),
    ):  # fmt: skip
        with pytest.raises(BadFile, match=r"object 'thing': .* lies outside of a[.]png, which has"):
            prompt_of(spec, said, photo)
