"""Normal maps of captures: both ways of writing them, their axes and sizes, what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.commands.outputs import as_steps, write_png16
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.normal_photo import load_normals, refuse_other_axes
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from tests.support.scene.captures import simple, write_transforms

AHEAD = np.broadcast_to([0.0, 0.0, 1.0], (12, 16, 3))  # a wall that faces the camera


def capture_of(folder, name: str, values, **more):
    """Photos of 16x12 pixels, the first with a normal map."""
    frames, rest = simple(folder, 4)
    path = folder / name
    if path.suffix == ".npy":
        np.save(path, values)
    else:
        Image.fromarray(values).save(path)
    frames[0] |= {"normal_path": name} | more
    write_transforms(folder, frames, **rest)
    return read_capture(folder)


def some_normals(seed: int = 1) -> np.ndarray:
    """(12, 16, 3) float32 of length 1 that face the camera."""
    normals = np.random.default_rng(seed).normal((0, 0, 1), 0.3, (12, 16, 3))
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True)).astype(np.float32)


def test_directions_of_a_npy_and_of_a_picture(tmp_path):
    normals = some_normals()
    photo, *others = capture_of(tmp_path, "n.npy", normals).photos
    got = load_normals(photo)
    assert got.dtype == np.int8 and (got[..., 3] == 1).all()
    assert np.abs(got[..., :3] / 127 - normals).max() <= 0.5 / 127 + 1e-6
    assert all(other.normals is None for other in others)
    shades = np.rint((normals + 1) / 2 * 255).astype(np.uint8)
    again = load_normals(capture_of(tmp_path, "n.png", shades).photos[0])
    # A shade is half a step of 2 / 255 wide either way, and lengths are made 1 again.
    assert np.abs(again.astype(int) - got).max() <= 2


def test_what_render_writes_is_a_normal_map(tmp_path):
    """render --output normal: 16 bits, black where less than half of a pixel is covered."""
    normals = some_normals(2)
    normals[3, 4:9] = np.nan
    write_png16(as_steps(normals, "normal", 1.0), tmp_path / "r.png", {})
    np.save(tmp_path / "r.npy", normals)
    frames, rest = simple(tmp_path, 2)
    for frame, name in zip(frames, ("r.png", "r.npy"), strict=True):
        frame["normal_file_path"] = name
    write_transforms(tmp_path, frames, **rest)
    seen, exact = (load_normals(photo) for photo in read_capture(tmp_path).photos)
    np.testing.assert_array_equal(seen[..., 3], exact[..., 3])
    assert not seen[3, 4:9].any() and seen[..., 3].sum() == 12 * 16 - 5
    assert np.abs(seen.astype(int) - exact).max() <= 2


@pytest.mark.parametrize("at_top", [False, True])
def test_axes_of_opencv(tmp_path, at_top):
    normals = some_normals()
    frames, rest = simple(tmp_path, 2)
    np.save(tmp_path / "n.npy", normals * np.array([1, -1, -1], np.float32))
    frames[0]["normal_path"] = "n.npy"
    said = {"normal_convention": "opencv"}
    frames[0] |= {} if at_top else said
    write_transforms(tmp_path, frames, **rest | (said if at_top else {}))
    capture = read_capture(tmp_path)
    np.save(tmp_path / "n.npy", normals)
    usual = replace(capture.photos[0], normal_axes="opengl")
    got = load_normals(usual)
    np.save(tmp_path / "n.npy", normals * np.array([1, -1, -1], np.float32))
    np.testing.assert_array_equal(load_normals(capture.photos[0]), got)


def test_what_is_no_direction_is_not_known(tmp_path):
    values = np.array(AHEAD, np.float32)
    wrong = [np.nan, np.inf, -np.inf, 0, 0.49, 1.51, 1e38]
    values[0, :7, 2] = wrong
    values[1, :2, 2] = 0.51, 1.49  # near enough to 1
    got = load_normals(capture_of(tmp_path, "n.npy", values).photos[0])
    assert not got[0, :7].any() and (got[0, 7:] == (0, 0, 127, 1)).all()
    assert (got[1:] == (0, 0, 127, 1)).all()
    shades = np.full((12, 16, 3), (128, 128, 255), np.uint8)
    shades[0, 0], shades[0, 1] = 0, 128  # black; grey
    again = load_normals(capture_of(tmp_path, "n.png", shades).photos[0])
    assert not again[0, :2].any() and again[..., 3].sum() == 12 * 16 - 2
    clear = np.dstack([shades, np.full((12, 16), 255, np.uint8)])
    clear[1, 1, 3] = 0
    assert load_normals(capture_of(tmp_path, "c.png", clear).photos[0])[..., 3].sum() == 189


@pytest.mark.parametrize("factor", [1, 2, 3, 7])
def test_each_pixel_takes_the_direction_at_its_centre(tmp_path, factor):
    """The map has half the photo's pixels a side."""
    normals = some_normals()[:6, :8]
    photo = capture_of(tmp_path, "n.npy", normals).photos[0]
    got, whole = load_normals(photo, factor), load_normals(photo)
    assert got.shape[:2] == photo.view.divided(factor).size[::-1]
    for y, x in np.ndindex(got.shape[:2]):
        row, column = int((y + 0.5) * factor / 2), int((x + 0.5) * factor / 2)
        np.testing.assert_array_equal(got[y, x], whole[row, column])


REFUSED = [
    ("n.png", np.zeros((12, 16), np.uint8), {}, "in colours"),
    ("n.npy", np.zeros((12, 16), np.float32), {}, "(H, W, 3) floats"),
    ("n.npy", np.zeros((12, 16, 3), np.uint8), {}, "(H, W, 3) floats"),
    ("n.npy", np.zeros((0, 16, 3), np.float32), {}, "(H, W, 3) floats"),
    ("n.npy", np.zeros((12, 12, 3), np.float32), {}, "same field of view"),
    ("n.npy", -AHEAD, {}, "100 % of the directions"),
    ("n.npy", AHEAD, {"normal_convention": "opencv"}, "100 % of the directions"),
    ("n.npy", AHEAD, {"normal_convention": "world"}, "opengl or opencv"),
    ("n.npy", AHEAD, {"normal_convention": 3}, "normal_convention"),
]


@pytest.mark.parametrize(("name", "values", "more", "said"), REFUSED)
def test_what_is_refused_in_a_sentence(tmp_path, name, values, more, said):
    with pytest.raises(BadFile) as found:
        capture_of(tmp_path, name, np.asarray(values), **more)
    assert said in str(found.value) and "\n" not in str(found.value)


@pytest.mark.parametrize(("wrong", "refused"), [(19, False), (20, True)])
def test_a_tenth_may_look_away(tmp_path, wrong, refused):
    """Edges of what a network guesses; 19 and 20 of 192 directions are 9.9 and 10.4 %."""
    values = np.array(AHEAD, np.float32)
    values.reshape(-1, 3)[:wrong, 2] = -1
    frames, rest = simple(tmp_path, 2)
    np.save(tmp_path / "n.npy", AHEAD)
    frames[0]["normal_path"] = "n.npy"
    write_transforms(tmp_path, frames, **rest)
    capture = read_capture(tmp_path)
    np.save(tmp_path / "n.npy", values)
    if not refused:
        return refuse_other_axes(capture, "here")
    with pytest.raises(BadFile, match="here: 10 % of the directions"):
        refuse_other_axes(capture, "here")


def test_broken_files_and_files_that_are_not_there(tmp_path):
    capture = capture_of(tmp_path, "n.png", np.full((12, 16, 3), (128, 128, 255), np.uint8))
    whole = (tmp_path / "n.png").read_bytes()
    (tmp_path / "n.png").write_bytes(whole[:-30])
    with pytest.raises(BadFile, match="cut off"):
        load_normals(capture.photos[0])
    (tmp_path / "n.png").unlink()
    again = read_capture(tmp_path)
    assert again.photos[0].normals is None
    assert [line for line in again.doubts if line.startswith("1 normal maps are not there")]
    frames, rest = simple(tmp_path, 2)
    frames[0]["normal_path"] = "n.npy"
    (tmp_path / "n.npy").write_bytes(b"\x93NUMPY no")
    write_transforms(tmp_path, frames, **rest)
    with pytest.raises(BadFile, match=r"no \.npy of plain numbers"):
        read_capture(tmp_path)


def test_a_capture_that_was_written_names_them(tmp_path):
    capture = capture_of(
        tmp_path,
        "n.npy",
        some_normals() * np.array([1, -1, -1], np.float32),
        normal_convention="opencv",
    )
    (tmp_path / "transforms.json").unlink()
    write_capture(capture)
    again = read_capture(tmp_path)
    assert again.photos[0].normals == capture.photos[0].normals
    assert again.photos[0].normal_axes == "opencv" and again.photos[1].normals is None
