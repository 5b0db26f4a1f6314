"""Photos of bent lenses: against pycolmap's own undistortion, and against points in the world."""

import json
import re
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.capture_photos import of_size, posed_photo
from shapeshift.scene.captures.colmap_tables import LENSES, ColmapCamera
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.undistort import (
    fold,
    is_straight,
    lost,
    pinhole_of,
    pixels_of,
    straight_pixels,
)
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.photos import load_photos
from tests.support.scene.captures import simple, write_transforms
from tests.support.scene.lenses import FISH, KEYS, brown, eighth_power, fisheye

SIZE = (200, 150)
F, CENTRE = 160.0, (103.0, 72.0)
# As phones, wide lenses, action cameras and fisheyes have them.
BENT = {
    "phone": ColmapCamera("SIMPLE_RADIAL", SIZE, (F, *CENTRE, 0.05)),
    "barrel": ColmapCamera("OPENCV", SIZE, (F, F * 1.01, *CENTRE, -0.25, 0.06, 0.002, -0.003)),
    "pincushion": ColmapCamera("RADIAL", SIZE, (F, *CENTRE, 0.2, 0.05)),
    "brown": ColmapCamera("FULL_OPENCV", SIZE, (F, F, *CENTRE, -0.2, 0.05, 0, 0, -0.01, 0, 0, 0)),
    "fisheye": ColmapCamera("OPENCV_FISHEYE", SIZE, (110.0, 110.0, *CENTRE, 0.03, -0.004, 0, 0)),
    "field of view": ColmapCamera("FOV", SIZE, (F, F, *CENTRE, 0.8)),
}
every_bend = pytest.mark.parametrize("bend", BENT)


def photo_of(folder, lens: ColmapCamera, pixels: np.ndarray):
    Image.fromarray(pixels).save(folder / "photo.png")
    return posed_photo(folder / "photo.png", "RGB", np.eye(4), lens, "here")


def smooth_picture(size: tuple[int, int]) -> np.ndarray:
    x, y = np.meshgrid(*(np.arange(side) for side in size))
    waves = [np.sin(x / 9 + 0.3), np.cos(y / 7), np.sin((x + y) / 11)]
    return np.rint(127 + 100 * np.stack(waves, axis=-1)).astype(np.uint8)


def bilinear(image: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(N, 3) of pixels whose centres lie at +0.5; NaN beyond the outermost centres."""
    x, y = (at - 0.5).T
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    good = (i >= 0) & (j >= 0) & (i < image.shape[1] - 1) & (j < image.shape[0] - 1)
    i, j = np.where(good, i, 0), np.where(good, j, 0)
    u, v = (x - i)[:, None], (y - j)[:, None]
    top = image[j, i] * (1 - u) + image[j, i + 1] * u
    below = image[j + 1, i] * (1 - u) + image[j + 1, i + 1] * u
    return np.where(good[:, None], top * (1 - v) + below * v, np.nan)


@every_bend
def test_as_pycolmap_undistorts_it(tmp_path, bend):
    """Its straight camera has another field of view, so its picture is read where ours has pixels.

    Both interpolate: two bytes in the mean are the waves' curvature within a pixel.
    """
    lens, picture = BENT[bend], smooth_picture(SIZE)
    photo = photo_of(tmp_path, lens, picture)
    ours, _, gone = load_photo(photo)
    camera = pycolmap.Camera(model=lens.model, width=SIZE[0], height=SIZE[1], params=lens.params)
    bitmap = pycolmap.Bitmap.from_array(picture)
    theirs, straight = pycolmap.undistort_image(pycolmap.UndistortCameraOptions(), bitmap, camera)
    _, fx, fy, cx, cy = photo.view.pinhole()
    width, height = photo.view.size
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    tangents = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], -1).reshape(-1, 3)
    want = bilinear(theirs.to_array().astype(float), straight.img_from_cam(tangents))
    known = np.isfinite(want).all(axis=1) & ~gone.ravel()
    assert known.mean() > 0.25
    away = np.abs(ours.reshape(-1, 3)[known] - want[known])
    assert away.mean() < 2 and np.percentile(away, 99) < 8


FORMULAS = [
    (brown, KEYS, (620, 615, 410, 290, -0.28, 0.09, 0.002, -0.001, -0.01), {}),
    (brown, KEYS, (620, 615, 410, 290, 0.12, 0.03, 0, 0, 0), {"camera_model": "OPENCV"}),
    (fisheye, FISH, (330, 330, 395, 305, 0.04, -0.01, 0.002, 0),
     {"camera_model": "OPENCV_FISHEYE"}),
    (fisheye, FISH, (330, 330, 395, 305, 0.04, -0.01, 0.002, 0), {"is_fisheye": True}),
    (eighth_power, (*KEYS, "k4"), (620, 615, 410, 290, -0.28, 0.09, 0.002, -0.001, -0.01, 0.03),
     {"camera_model": "opencv"}),
]  # fmt: skip


SIZES = [(1, 16), (2, 16), (2, 1), (3, 16), (3, 1), (7, 16)]  # factor, least


@pytest.mark.parametrize(
    "formula, keys, numbers, more, factor, least",
    [(*f, *size) for i, f in enumerate(FORMULAS) for size in SIZES[i % 2 :: 2]],  # each with half
)
def test_points_in_the_world_fall_where_the_view_says(
    tmp_path, monkeypatch, formula, keys, numbers, more, factor, least
):
    """White discs are drawn where the lens formula shows points; after reading they lie where the
    pinhole of the photo's view shows them, by the mesh of one photo and by the matrix of many."""
    monkeypatch.setattr("shapeshift.training.photos.LEAST_PHOTOS", least)
    size, rng = (800, 600), np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1.5, 1.5, (400, 2)), np.ones(400)])
    points *= rng.uniform(1, 5, (400, 1))
    at, apart, chosen = formula(points, numbers), 26 * factor, []
    for i in np.flatnonzero(((at > 40) & (at < np.array(size) - 40)).all(axis=1)):
        if not chosen or np.linalg.norm(at[chosen] - at[i], axis=1).min() > apart:
            chosen.append(i)
    points, at = points[chosen], at[chosen]
    sigma = 3.0 * factor
    image = discs(size, at, sigma)
    (tmp_path / "images").mkdir()
    pixels = np.rint(255 * np.minimum(image, 1)).astype(np.uint8)
    for name in ("0.png", "1.png"):
        Image.fromarray(pixels).save(tmp_path / "images" / name)
    lens = dict(zip(keys, numbers, strict=True)) | {"w": size[0], "h": size[1]} | more
    pose = np.diag([1.0, -1, -1, 1]).tolist()
    frames = [{"file_path": f"images/{i}.png", "transform_matrix": pose} for i in range(2)]
    write_transforms(tmp_path, frames, **lens, up=[0, 1, 0])
    photo = load_photos(read_capture(tmp_path), "train", factor, "object")[0]
    camera_from_world, fx, fy, cx, cy = photo.view.pinhole()
    eye = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    want = eye[:, :2] / eye[:, 2:] * (fx, fy) + (cx, cy)
    width, height = photo.view.size
    away, grey = [], photo.rgba[..., 0].astype(float)
    for u, v in want:
        if not (12 < u < width - 12 and 12 < v < height - 12):
            continue
        if not np.hypot((u - cx) / fx, (v - cy) / fy) < 0.9:  # there discs are as wide as windows
            continue
        here, x, y = around((width, height), (u, v), 10)
        window = np.hypot(x - u, y - v) < 10
        if photo.weight is not None and not photo.weight[here][window].all():
            continue
        weight = grey[here] * window
        centroid = np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()
        slope = bend_of_disc(formula, numbers, (u, v), (fx, fy, cx, cy), sigma)
        away.append(np.abs(centroid - (u, v) - slope).max())
    # Pixels of the photo read: a mesh of quads and bytes, at its own size; less where it is shrunk.
    assert len(away) >= 3 and max(away) < 0.06


def around(size: tuple[int, int], at: tuple[float, float], reach: float) -> tuple:
    """Rows and columns of a picture that lie within `reach` of a place, and their x and y."""
    first = np.maximum(np.floor(np.subtract(at, reach)), 0).astype(int)
    after = np.minimum(np.ceil(np.add(at, reach)), size).astype(int)
    x, y = np.meshgrid(*(np.arange(a, b) + 0.5 for a, b in zip(first, after, strict=True)))
    return (slice(first[1], after[1]), slice(first[0], after[0])), x, y


def discs(size: tuple[int, int], at: np.ndarray, sigma: float) -> np.ndarray:
    """(H, W) sum of Gaussians around (N, 2); six sigma away one is 4 millionths of a byte."""
    image = np.zeros(size[::-1])
    for place in at:
        here, x, y = around(size, place, 6 * sigma)
        image[here] += np.exp(-((x - place[0]) ** 2 + (y - place[1]) ** 2) / (2 * sigma**2))
    return image


def bend_of_disc(formula, numbers, at, pinhole, sigma) -> np.ndarray:
    """(2,) by how much the centroid of a round disc on the bent photo moves when it is straight.

    A disc is not small beside the bend: the same sum is taken over its own pixels.
    """
    fx, fy, cx, cy = pinhole
    steps = np.linspace(-10, 10, 81)
    x, y = (g.ravel() for g in np.meshgrid(at[0] + steps, at[1] + steps))
    inside = np.hypot(x - at[0], y - at[1]) < 10
    rays = np.stack([(x - cx) / fx, (y - cy) / fy, np.ones_like(x)], 1)[inside]
    middle = np.array([[(at[0] - cx) / fx, (at[1] - cy) / fy, 1.0]])
    away = formula(rays, numbers) - formula(middle, numbers)
    weight = np.exp(-(away**2).sum(axis=1) / (2 * sigma**2))
    offset = np.stack([x, y], 1)[inside] - at
    return (weight[:, None] * offset).sum(axis=0) / weight.sum()


@every_bend
@pytest.mark.parametrize("factor", [2, 3, 5])
@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L"])
def test_the_matrix_of_many_photos_is_the_mean_of_four_samples(tmp_path, bend, factor, mode):
    """By the lens's own formula to half a byte; the mesh of one photo, whose samples Pillow cuts
    to bytes and places to 0.05 of its pixels, to a few."""
    lens, picture = BENT[bend], smooth_picture(SIZE)
    photo = photo_of(tmp_path, lens, picture)
    picture = Image.open(photo.path).convert(mode)
    picture.save(photo.path)
    one, many = (load_photo(photo, factor, among) for among in (False, True))
    known = ~one.lost
    assert np.abs(one.rgb.astype(int) - many.rgb)[known].max() <= factor
    np.testing.assert_array_equal(one.lost, many.lost)
    if mode == "RGBA":
        assert (many.mask[known] == 255).all()
    more, straight = factor // 2, pinhole_of(lens)
    read = np.asarray(picture.convert("RGB").reduce(more), float)
    height, width = known.shape
    x, y = np.meshgrid(*((np.arange(2 * side) + 0.5) * factor / 2 for side in (width, height)))
    at = (np.stack([x.ravel(), y.ravel()], 1) - straight.centre) / straight.focal
    want = bilinear(read, pixels_of(lens, at) / more)
    want = want.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    compared = np.isfinite(want).all(axis=2) & known
    assert compared.mean() > 0.25
    assert np.abs(many.rgb - want)[compared].max() <= 0.501


def test_photos_of_several_lenses_keep_their_order(tmp_path, monkeypatch):
    monkeypatch.setattr("shapeshift.training.photos.LEAST_PHOTOS", 2)
    lenses = [BENT["phone"], BENT["barrel"], BENT["phone"], BENT["pincushion"], BENT["barrel"]]
    photos = []
    for i, lens in enumerate(lenses):
        (tmp_path / str(i)).mkdir()
        pixels = np.full((SIZE[1], SIZE[0], 3), 40 * i, np.uint8)
        photos.append(replace(photo_of(tmp_path / str(i), lens, pixels), split="train"))
    capture = replace(read_capture_of(tmp_path), photos=tuple(photos))
    read = load_photos(capture, "train", 2, "object")
    assert [photo.name for photo in read] == [str(photo.path) for photo in photos]
    assert [int(np.median(photo.rgba[..., 0])) for photo in read] == [0, 40, 80, 120, 160]


@every_bend
@pytest.mark.parametrize("factor", [1, 2, 3])
def test_what_is_not_lost_is_whole_and_what_is_lost_does_not_count(tmp_path, bend, factor):
    """Of a white photo every pixel that counts is white: nothing from beyond its edges is in it."""
    lens = BENT[bend]
    photo = photo_of(tmp_path, lens, np.full((SIZE[1], SIZE[0], 3), 255, np.uint8))
    rgb, _, gone = load_photo(photo, factor, factor > 1)
    assert rgb.shape[:2] == gone.shape == photo.view.divided(factor).size[::-1]
    assert (rgb[~gone] == 255).all()
    barrel = bend in ("barrel", "brown", "field of view", "fisheye")
    assert gone.mean() < (0.04 if barrel else 0.2) * factor
    assert gone[0, 0] or barrel
    capture = replace(
        read_capture_of(tmp_path), photos=(replace(photo, mask=None, split="train"),)
    )  # fmt: skip
    (read,) = load_photos(capture, "train", factor, "object")
    np.testing.assert_array_equal(read.weight == 0, gone)
    assert (read.rgba[..., 3] == 255).all()  # unknown is no background: nothing is carved there


def read_capture_of(folder):
    frames, rest = simple(folder, 2)
    write_transforms(folder, frames, **rest)
    return read_capture(folder)


@every_bend
def test_the_straight_camera_is_as_wide_and_high_as_the_photo(bend):
    """Along the axes through the principal point its edges are the photo's, to half a pixel."""
    lens = BENT[bend]
    straight = pinhole_of(lens)
    (cx, cy), (width, height) = straight.centre, straight.size
    across = straight_pixels(lens, np.array([0.0, width]), np.array([cy]))[0, :, 0]
    down = straight_pixels(lens, np.array([cx]), np.array([0.0, height]))[:, 0, 1]
    np.testing.assert_allclose(across, (0, SIZE[0]), atol=0.6)
    np.testing.assert_allclose(down, (0, SIZE[1]), atol=0.6)
    assert straight.focal == lens.focal


def test_masks_and_depth_bend_with_their_photo(tmp_path):
    """Mask and depth are drawn from the photo's own pixels; after reading they still agree."""
    lens, (width, height) = BENT["barrel"], SIZE
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    disc = np.hypot(x - 40, y - 40) < 25
    pixels = np.where(disc[..., None], 255, 0).astype(np.uint8).repeat(3, axis=2)
    photo = photo_of(tmp_path, lens, pixels)
    Image.fromarray(pixels[..., 0]).save(tmp_path / "mask.png")
    np.save(tmp_path / "depth.npy", np.where(disc, 2.0, 5.0).astype(np.float32)[::2, ::2])
    photo = replace(photo, mask=tmp_path / "mask.png", depth=tmp_path / "depth.npy")
    capture = replace(read_capture_of(tmp_path), photos=(photo,))
    (read,) = load_photos(capture, "train", 1, "object")
    inside, outside = read.rgba[..., 0] > 250, read.rgba[..., 0] < 5
    assert (read.rgba[..., 3] > 250)[inside].all() and inside.sum() > 1500
    assert np.isin(read.depth[inside], (2.0,)).mean() > 0.97
    assert (read.depth[outside] == 0).all()  # outside of the mask nothing is known
    assert np.mean(read.depth[inside & (read.weight > 0)]) < 2.1 if read.weight is not None else 1


@pytest.mark.parametrize("model", [row for row in LENSES.values() if row[0] != "SIMPLE_PINHOLE"])
def test_every_model_of_colmap_is_read_or_refused(model):
    """Random numbers, mild and wild: a straight camera that shows something, or one sentence."""
    name, focals, count = model
    rng = np.random.default_rng(count)
    for spread in (0.0, 0.01, 0.1, 1.0, 30.0, np.inf):
        more = rng.normal(size=count - focals - 2) * (1 if spread == np.inf else spread)
        more = np.where(more > 0, np.inf, more) if spread == np.inf else more
        lens = ColmapCamera(name, SIZE, (*(F,) * focals, *CENTRE, *more.tolist()))
        try:
            straight = pinhole_of(lens)
        except BadFile as error:
            assert re.search("folds the photo|would make", str(error)) and "\n" not in str(error)
            continue
        assert 0.25 * 150 * 200 <= np.prod(straight.size) <= 8 * 150 * 200
        assert lost(lens, straight.size, 1).shape == straight.size[::-1]
        assert is_straight(lens, "here") in (True, False)


def test_numbers_that_blow_a_photo_up_are_refused():
    """A rational lens that squeezes nearly all of its field into the photo's edge: 140 times."""
    pinhole, radial = (20263.6, 20263.6, 500, 500), (1442012.6, 0.175, 0, 0)
    squeezed = (*pinhole, *radial, 91437023.5, 24491569.6, 6667826.6, 804.2)
    with pytest.raises(BadFile, match=r"would make 11\d+x11\d+ pixels of the photo's 1000x1000"):
        pinhole_of(ColmapCamera("FULL_OPENCV", (1000, 1000), squeezed))
    focal = 500 / np.radians(60)  # a field of 120 degrees
    whole = ColmapCamera("OPENCV_FISHEYE", (1000, 1000), (focal, focal, 500, 500, 0, 0, 0, 0))
    assert 2.7 < np.prod(pinhole_of(whole).size) / 1e6 < 2.8


def test_what_is_lost_does_not_depend_on_the_rows_at_a_time(monkeypatch):
    lens = ColmapCamera("OPENCV", (400, 300), (320.0, 325.0, 200.0, 150.0, 0.3, 0.1, 0.001, 0))
    at_once = lost(lens, pinhole_of(lens).size, 1)
    assert at_once.any() and not at_once.all()
    lost.cache_clear()
    monkeypatch.setattr("shapeshift.scene.captures.undistort.ROWS", 7)
    np.testing.assert_array_equal(lost(lens, pinhole_of(lens).size, 1), at_once)


@pytest.mark.parametrize("bend", np.linspace(-0.16, -0.1, 61).tolist())
def test_a_long_lens_that_folds_far_outside_the_photo_is_read(bend):
    """Its polynomial turns at tangents of 1.4 to 1.8, the photo ends at 0.16: the straight photo
    is 1.000 to 1.004 times as wide, r k r^2, wherever between two samples the turn lies."""
    lens = ColmapCamera("SIMPLE_RADIAL", (1000, 1000), (3084.0, 500.0, 500.0, bend))
    straight = pinhole_of(lens)
    edge = 500 / 3084
    for side in straight.size:
        assert 1000 <= side <= 1000 * (1 - 1.1 * bend * edge**2) + 1


def test_a_lens_folds_back_where_its_polynomial_turns():
    """r (1 + k r^2) grows until r = 1 / sqrt(-3 k)."""
    lens = ColmapCamera("SIMPLE_RADIAL", SIZE, (F, *CENTRE, -0.3))
    assert fold(lens) == pytest.approx(1 / np.sqrt(0.9), abs=2e-3)
    assert fold(replace(lens, params=(F, *CENTRE, 0.3))) > 2


def test_smaller_photos_keep_their_lens(tmp_path):
    """The pixels of a photo of half the size lie at half the pixels of the whole one."""
    whole = ColmapCamera("OPENCV", (801, 600), (640.0, 650.0, 400.0, 300.0, -0.2, 0.03, 0, 0))
    half = of_size(whole, (400, 300), tmp_path / "a.png")
    np.testing.assert_allclose(half.params[:4], (640 * 400 / 801, 325, 400 * 400 / 801, 150))
    assert half.params[4:] == whole.params[4:]
    one = ColmapCamera("SIMPLE_RADIAL", (801, 600), (640.0, 400.0, 300.0, 0.1))
    assert of_size(one, (400, 300), tmp_path).params[0] == pytest.approx(320, abs=0.3)
    Image.new("RGB", (400, 400)).save(tmp_path / "a.png")
    with pytest.raises(BadFile, match="400x400 pixels, the capture says 801x600"):
        of_size(whole, (400, 400), tmp_path / "a.png")


def test_a_phone_capture_as_nerfstudio_leaves_it(tmp_path):
    """Missing files, photos of half the size, a bent lens, a cloud that is gone, and its splits."""
    frames, _ = simple(tmp_path, 8)
    frames += [{**frames[0], "file_path": f"images/gone_{i}.png"} for i in range(3)]
    lens = {"fl_x": 40.0, "fl_y": 40.0, "cx": 16.0, "cy": 12.0, "k1": 0.3, "k2": 0.1}
    lens |= {"w": 32, "h": 24, "camera_model": "OPENCV", "p1": 0.001, "p2": 0.0}
    names = [frame["file_path"] for frame in frames]
    splits = {"train_filenames": names[:5] + names[8:], "val_filenames": names[5:7]}
    write_transforms(tmp_path, frames, **lens, **splits, ply_file_path="sparse_pc.ply")
    capture = read_capture(tmp_path)
    assert (len(capture.of("RGB", "train")), len(capture.of("RGB", "test"))) == (5, 2)
    said = "\n".join(capture.doubts)
    assert "3 of 10 photos that the capture names are not there" in said
    assert "7 photos have another size than the capture says" in said
    assert "sparse_pc.ply are not there" in said and "undistorted as they are read" in said
    assert len(json.loads((tmp_path / "transforms.json").read_text())["frames"]) == 11
    assert all(photo.lens.size == (16, 12) for photo in capture.photos)


@every_bend
def test_our_own_form_keeps_a_lens_or_says_that_it_cannot(tmp_path, bend):
    capture = read_capture_of(tmp_path)
    lens = of_size(BENT[bend], (16, 12), tmp_path)
    photos = tuple(replace(photo, lens=lens) for photo in capture.photos)
    if bend in ("phone", "pincushion", "field of view"):
        with pytest.raises(ValueError, match="cannot be written"):
            write_capture(replace(capture, photos=photos))
        return
    write_capture(replace(capture, photos=photos))
    for photo in read_capture(tmp_path).photos:
        tangents = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 2))
        np.testing.assert_allclose(pixels_of(photo.lens, tangents), pixels_of(lens, tangents))
