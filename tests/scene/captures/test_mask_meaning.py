"""What masks mean, where a capture does not say: by their shapes, on the tracer's captures too."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.photos import load_photos, validate_views
from tests.support.scene.captures import colmap_model, simple, write_transforms
from tools.synthetic.strangers import make_stranger

SIZE = (80, 60)
X, Y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)


def disc(x: float, y: float, radius: float) -> np.ndarray:
    return np.hypot(X - x, Y - y) < radius


def object_seen(i: int) -> np.ndarray:
    return disc(35 + 2 * i, 30, 18)


def close_up(i: int) -> np.ndarray:
    """Of a thing that reaches beyond half of the photo's edges."""
    return disc(5 * i, 55, 45)


def people(i: int) -> np.ndarray:
    return ~disc(10 + 12 * i, 35, 12)


def inverted(i: int) -> np.ndarray:
    return ~object_seen(i)


def fisheye_rim(i: int) -> np.ndarray:
    return disc(40, 30, 34)


def bonnet(i: int) -> np.ndarray:
    """Of the car that carries the camera, along the lower edge."""
    return Y < 45


def a_ball(i: int) -> np.ndarray:
    """The same from all sides, and still an object."""
    return disc(40, 30, 20)


def nothing(i: int) -> np.ndarray:
    return np.ones_like(X, bool)


def everything(i: int) -> np.ndarray:
    return np.zeros_like(X, bool)


SHAPES = [
    (object_seen, "object", ""), (close_up, "object", "train with --masks valid"),
    (people, "valid", "white along most of the photos' edges"), (inverted, "valid", "invert them"),
    (fisheye_rim, "valid", "the same pixels in all photos"),
    (bonnet, "valid", "the same pixels in all photos"), (a_ball, "object", ""),
    (nothing, "valid", "white along"), (everything, "object", ""),
]  # fmt: skip


def with_masks(folder, shape, one_file: bool = False, values: int = 255, **more) -> None:
    frames, _ = simple(folder, 5)
    (folder / "masks").mkdir()
    for i, frame in enumerate(frames):
        Image.new("RGB", SIZE, (90, 120, 30)).save(folder / frame["file_path"])
        name = "masks/all.png" if one_file else f"masks/{i}.png"
        Image.fromarray(shape(i).astype(np.uint8) * np.uint8(values)).save(folder / name)
        frame["mask_path"] = name
    write_transforms(folder, frames, w=SIZE[0], h=SIZE[1], fl_x=90.0, **more)


@pytest.mark.parametrize("shape, means, said", SHAPES, ids=lambda v: getattr(v, "__name__", ""))
@pytest.mark.parametrize("values", [255, 1])
def test_shapes_tell(tmp_path, shape, means, said, values):
    """Also of masks of 0 and 1, which are white where they are 1, as nerfstudio has them."""
    with_masks(tmp_path, shape, values=values)
    capture = read_capture(tmp_path)
    assert {photo.mask_means for photo in capture.photos} == {means}
    assert [said in doubt for doubt in capture.doubts] == [True] * bool(said)
    if shape is everything:
        return
    whole = load_photos(capture, "train", 1, "auto")
    stated = load_photos(capture, "train", 1, means)
    for one, other, number in zip(whole, stated, (1, 2, 3, 4), strict=True):
        np.testing.assert_array_equal(one.rgba, other.rgba)
        white = one.rgba[..., 3] == 255 if means == "object" else one.weight == 1
        np.testing.assert_array_equal(white, shape(number))
    assert not [w for w in validate_views(whole, "auto")[1] if "without a mask" in w]


def test_one_file_for_all_photos_hides_something(tmp_path):
    """However much of them."""
    with_masks(tmp_path, a_ball, one_file=True)
    assert {photo.mask_means for photo in read_capture(tmp_path).photos} == {"valid"}


@pytest.mark.parametrize("said", ["object", "valid"])
def test_what_the_file_says_counts_first(tmp_path, said):
    with_masks(tmp_path, people, mask_means=said)
    capture = read_capture(tmp_path)
    assert {photo.mask_means for photo in capture.photos} == {said} and not capture.doubts
    write_capture(capture)
    assert {photo.mask_means for photo in read_capture(tmp_path).photos} == {said}


def test_another_word_is_refused(tmp_path):
    with_masks(tmp_path, people, mask_means="hidden")
    with pytest.raises(BadFile, match=r"'mask_means' is \"hidden\"; 'object' or 'valid'"):
        read_capture(tmp_path)


@pytest.mark.parametrize("masks", ["object", "valid", "ignore"])
def test_what_is_asked_for_is_done(tmp_path, masks):
    with_masks(tmp_path, people)
    (photo, *_) = load_photos(read_capture(tmp_path), "train", 1, masks)
    assert (photo.weight is not None) == (masks == "valid")
    assert (photo.rgba[..., 3] < 255).any() == (masks == "object")


def test_frames_without_a_mask_beside_those_that_hide_something(tmp_path):
    with_masks(tmp_path, people)
    path = tmp_path / "masks/3.png"
    text = (tmp_path / "transforms.json").read_text()
    (tmp_path / "transforms.json").write_text(text.replace(f'"masks/{path.name}"', '""'))
    photos = load_photos(read_capture(tmp_path), "train", 1, "auto")
    kept, doubts = validate_views(photos, "auto")
    assert len(kept) == len(photos) and not any("without a mask" in doubt for doubt in doubts)


def test_masks_of_a_colmap_model(tmp_path):
    colmap_model(tmp_path, text=True)
    (tmp_path / "masks/rgb").mkdir(parents=True)
    for i in range(4):
        white = np.full((12, 16), 255, np.uint8)
        white[5:9, 3 * i : 3 * i + 4] = 0
        Image.fromarray(white).save(tmp_path / f"masks/rgb/{i}.png.png")
    capture = read_capture(tmp_path)
    assert {p.mask_means for p in capture.photos if p.mask is not None} == {"valid"}
    assert any("'valid'" in d or "taken as unknown" in d for d in capture.doubts)
    (tmp_path / "capture.json").write_text('{"mask_means": "object"}')
    capture = read_capture(tmp_path)
    assert {p.mask_means for p in capture.photos} == {"object"}
    assert not any("unknown" in doubt for doubt in capture.doubts)


@pytest.mark.parametrize("kind, means", [("cut_out", "object"), ("passers", "valid")])
def test_captures_of_the_tracer(tmp_path, kind, means):
    """Black is where the wall is, or somebody: what is white is the place without them."""
    make_stranger(tmp_path, kind, 3, (64, 48), 6)
    capture = read_capture(tmp_path)
    assert {photo.mask_means for photo in capture.photos} == {means}


def test_masks_of_another_size_than_their_photo(tmp_path):
    """Photos were made smaller, masks were not: they are of one shape, and read."""
    with_masks(tmp_path, people)
    for i in range(5):
        image = Image.open(tmp_path / f"masks/{i}.png")
        image.resize((4 * SIZE[0], 4 * SIZE[1]), Image.Resampling.NEAREST).save(
            tmp_path / f"masks/{i}.png"
        )
    for factor in (1, 2):
        (photo, *_) = load_photos(read_capture(tmp_path), "train", factor, "auto")
        want = people(1).reshape(60 // factor, factor, 80 // factor, factor).mean(axis=(1, 3))
        np.testing.assert_allclose(photo.weight, want, atol=0.003)
    Image.new("L", (60, 60)).save(tmp_path / "masks/2.png")
    with pytest.raises(BadFile, match="the mask has 60x60 pixels, the photo 80x60"):
        read_capture(tmp_path)
