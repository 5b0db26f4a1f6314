"""Depth photos of captures: both ways of writing them, their sizes, and what is refused."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.depth_photo import load_depth, refuse_other_units
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.synthetic.balls import DEPTH_UNIT, make_balls
from tests.support.scene.captures import simple, write_transforms
from tests.support.scene.gaps import write_tiff

STEPS = np.array([[0, 1, 2, 1000], [65534, 65535, 7, 30000], [5, 5, 5, 5]], np.uint16)


def save(path, values):
    path.parent.mkdir(exist_ok=True)
    if path.suffix == ".npy":
        np.save(path, values)
    else:
        Image.fromarray(values).save(path)


def capture_of(folder, name: str, values, **more):
    """Photos of 16x12 pixels, the first with a depth photo."""
    frames, rest = simple(folder, 4)
    save(folder / name, values)
    frames[0] |= {"depth_path": name} | more
    write_transforms(folder, frames, **rest)
    return read_capture(folder)


def test_a_png_of_sixteen_bits(tmp_path):
    first, *others = capture_of(tmp_path, "depth/000.png", STEPS).photos
    want = STEPS * np.float32(0.001)
    want[1, 1] = 0  # too far is not known
    np.testing.assert_array_equal(load_depth(first), want)
    assert all(photo.depth is None for photo in others)


@pytest.mark.parametrize("key", ["depth_unit", "integer_depth_scale"])
def test_its_unit_can_stand_at_the_top(tmp_path, key):
    frames, rest = simple(tmp_path, 2)
    save(tmp_path / "d.png", STEPS)
    frames[1] |= {"depth_file_path": "d.png"}
    write_transforms(tmp_path, frames, **rest | {key: 0.25})
    photo = read_capture(tmp_path).photos[1]
    assert load_depth(photo)[2, 0] == 1.25


@pytest.mark.parametrize("kind", ["f2", "f4", "f8", "u2", "i4", ">f4"])
def test_a_npy_of_any_kind(tmp_path, kind):
    values = np.array([[1, 2, 3, 4], [5, 0, 7, 8], [9, 10, 11, 12]], kind)
    photo = capture_of(tmp_path, "d.npy", values).photos[0]
    got = load_depth(photo)
    want = values.astype(np.float32) * (1 if "f" in kind else np.float32(0.001))
    np.testing.assert_allclose(got, want, rtol=1e-6)
    assert got.dtype == np.float32


def test_what_is_no_depth_is_not_known(tmp_path):
    values = np.array([[np.nan, np.inf, -1, 1e9], [1, 2, 3, 4], [0, -0.0, -np.inf, 5]], np.float32)
    got = load_depth(capture_of(tmp_path, "d.npy", values).photos[0])
    np.testing.assert_array_equal(got, [[0, 0, 0, 0], [1, 2, 3, 4], [0, 0, 0, 5]])


@pytest.mark.parametrize("factor", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("rows", [3, 6, 12, 24])
def test_each_pixel_takes_the_depth_at_its_centre(tmp_path, rows, factor):
    """The photo has 16x12 pixels, its depth photo fewer, as many, or more."""
    values = np.arange(1, rows * rows * 4 // 3 + 1, dtype=np.float32).reshape(rows, -1)
    photo = capture_of(tmp_path, "d.npy", values).photos[0]
    got = load_depth(photo, factor)
    assert got.shape == photo.view.divided(factor).size[::-1]
    for y, x in np.ndindex(got.shape):
        row, column = int((y + 0.5) * factor * rows / 12), int((x + 0.5) * factor * rows / 12)
        assert got[y, x] == values[row, column]


def test_depth_photos_that_are_not_there_are_counted(tmp_path):
    frames, rest = simple(tmp_path, 3)
    save(tmp_path / "d.png", STEPS)
    for frame, name in zip(frames, ("gone.png", "d.png", "lost.png"), strict=True):
        frame["depth_file_path"] = name
    write_transforms(tmp_path, frames, **rest)
    capture = read_capture(tmp_path)
    assert [photo.depth is None for photo in capture.photos] == [True, False, True]
    (said,) = capture.doubts
    assert said.startswith("2 depth photos are not there, for example of ")


def test_our_own_form_keeps_it(tmp_path):
    first = capture_of(tmp_path, "depth/000.png", STEPS, depth_unit=0.01)
    write_capture(replace(first, points=None))
    again = read_capture(tmp_path)
    assert again.photos[0].depth == tmp_path / "depth/000.png"
    assert again.photos[0].depth_unit == 0.01
    assert again.photos[1].depth is None


def test_a_frame_of_several_modalities_has_a_depth_photo_in_each_folder(tmp_path):
    frames, rest = simple(tmp_path, 3)
    for name in ("a", "b"):
        shutil.copytree(tmp_path / "images", tmp_path / name / "images")
        save(tmp_path / name / "d.png", STEPS)
    frames = [frame | {"depth_path": "d.png"} for frame in frames]
    write_transforms(tmp_path, frames, **rest, modalities=["a", "b"])
    for photo in read_capture(tmp_path).photos:
        assert photo.depth == tmp_path / photo.modality / "d.png"


@pytest.mark.parametrize(
    "name, values, more, told",
    [
        ("d.png", STEPS.astype(np.uint8), {}, "16 bits"),
        ("d.png", STEPS[:2], {}, "same field of view"),
        ("d.npy", STEPS[:, :2], {}, "same field of view"),
        ("d.npy", np.zeros(3), {}, "(H, W)"),
        ("d.npy", np.zeros((3, 4), complex), {}, "(H, W)"),
        ("d.npy", np.array([{}]), {}, "plain numbers"),
        ("d.png", STEPS, {"depth_unit": 0}, "depth_unit"),
        ("d.png", STEPS, {"depth_unit": "mm"}, "depth_unit"),
        ("d.png", STEPS, {"depth_path": 7}, "depth_path"),
        ("d.png", STEPS, {"depth_path": "images/000.png"}, "16 bits"),
    ],
)
def test_refused_in_one_sentence(tmp_path, name, values, more, told):
    with pytest.raises(BadFile, match=told.replace("(", r"\(").replace(")", r"\)")) as refused:
        capture_of(tmp_path, name, values, **more)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("ending", ["png", "npy"])
def test_cut_off_anywhere_is_one_sentence(tmp_path, ending):
    path = tmp_path / f"d.{ending}"
    good = capture_of(tmp_path, path.name, STEPS)
    whole, values = path.read_bytes(), load_depth(good.photos[0])
    refused = 0
    for length in range(0, len(whole), 3):
        path.write_bytes(whole[:length])
        try:
            read_capture(tmp_path)
            np.testing.assert_array_equal(load_depth(good.photos[0]), values)  # lacks its end mark
        except BadFile:
            refused += 1
    assert refused > length / 3 - 8


def test_a_header_that_promises_more_takes_no_memory(tmp_path):
    good = capture_of(tmp_path, "d.npy", STEPS)
    path = tmp_path / "d.npy"
    header = np.lib.format.magic(1, 0) + b"\x76\x00"
    told = b"{'descr': '<f4', 'fortran_order': False, 'shape': (90000000, 120000000), }"
    path.write_bytes(header + told.ljust(117) + b"\n")
    with pytest.raises(BadFile):
        load_depth(good.photos[0])


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return make_balls(tmp_path_factory.mktemp("balls"), 48, 4, 1, depth=True)


@pytest.mark.parametrize("times", [0.001, 0.1, 10, 1000])
def test_depth_of_another_unit_than_the_points_is_refused(balls, times):
    told = balls.folder / "transforms.json"
    data = json.loads(told.read_text())
    assert read_capture(balls.folder).photos[0].depth_unit == DEPTH_UNIT
    other = told.with_name("other.json")
    for frame in data["frames"]:
        frame["depth_unit"] = DEPTH_UNIT * times
    other.write_text(json.dumps(data))
    with pytest.raises(BadFile, match=rf"by about {1 / times:g}\.$"):
        read_capture(other)
    other.write_text(json.dumps(data | {"points": ""}))  # nothing to compare with
    (balls.folder / "points3d.npz").unlink(missing_ok=True)
    assert read_capture(other).points is None


def test_points_that_are_hidden_do_not_matter(balls):
    hidden = np.concatenate([balls.points, balls.points - [0, 9, 0]])  # under the floor
    refuse_other_units(replace(balls, points=hidden), "here")


@pytest.mark.parametrize("dtype,unit", [(np.float32, 1.0), (np.uint16, 0.001)])
def test_the_no_data_number_of_a_tiff_is_not_known(tmp_path, dtype, unit):
    values = np.array([[7, 2], [3, 7]], dtype)
    frames, rest = simple(tmp_path, 2)
    write_tiff(tmp_path / "d.tif", np.kron(values, np.ones((6, 8), dtype)), "7")
    frames[0] |= {"depth_path": "d.tif"}
    write_transforms(tmp_path, frames, **rest)
    got = load_depth(read_capture(tmp_path).photos[0])[::6, ::8]
    np.testing.assert_array_equal(got, np.array([[0, 2], [3, 0]], np.float32) * np.float32(unit))
