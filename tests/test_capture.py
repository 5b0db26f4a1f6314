"""Captures of every kind that we read, what they are turned into, and what is refused, and how."""

import json
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from PIL import Image

from runtime_models.model import BadFile, Stop
from scene.capture import Capture, Photo
from scene.capture_rules import spread_stops, turn_upright
from scene.photo import area_weights, load_photo
from scene.pose import OPENCV_FROM_EYE, Pose, View, look_at
from scene.read_capture import read_capture
from scene.read_points import read_points
from scene.write_capture import write_capture

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
RANDOM = np.random.default_rng(7)
CLOUD = RANDOM.normal(0, 0.3, (20, 3))


def save_image(path: Path, size=(16, 12), seed=0, mode="RGB") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    channels = {"RGB": 3, "RGBA": 4}.get(mode)
    shape = (size[1], size[0]) if channels is None else (size[1], size[0], channels)
    pixels = np.random.default_rng(seed).integers(0, 256, shape, np.uint8)
    Image.fromarray(pixels, mode).save(path)
    return path


def opencv_pose(i: int, up=(0.0, -1.0, 0.0)) -> np.ndarray:
    """(4, 4) world_from_camera of a camera on a circle round the origin in a world with that up."""
    side = np.array([np.cos(i), 0.4, np.sin(i)]) * 3
    eye = turn_upright(up, "test")[:3, :3].T @ side
    return look_at(eye, np.zeros(3), up).matrix() @ OPENCV_FROM_EYE


def projected(view: View, points: np.ndarray) -> np.ndarray:
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    p = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    return np.stack([fx * p[:, 0] / p[:, 2] + cx, fy * p[:, 1] / p[:, 2] + cy], axis=1)


def write_transforms(folder: Path, frames: list[dict], **more) -> Path:
    path = folder / "transforms.json"
    path.write_text(json.dumps({"frames": frames} | more))
    return path


def simple(folder: Path, count: int = 4, **more) -> tuple[list[dict], dict]:
    """Frames of a nerfstudio file with its images, and what it says for all of them."""
    frames = []
    for i in range(count):
        save_image(folder / f"images/{i:03}.png", seed=i)
        pose = opencv_pose(i, (0.0, 0.0, 1.0)) @ OPENCV_FROM_EYE
        frames.append({"file_path": f"images/{i:03}.png", "transform_matrix": pose.tolist()})
    return frames, {"fl_x": 20.0, "w": 16, "h": 12} | more


# ---------------------------------------------------------------- COLMAP


def colmap_model(folder: Path, text: bool, model="SIMPLE_PINHOLE", params=(20.0, 8.0, 6.0)):
    """Four colour photos and three thermal ones of another size, posed apart from each other."""
    model_folder = folder / "sparse" / "0"
    model_folder.mkdir(parents=True)
    out = pycolmap.Reconstruction()
    sizes = {1: (16, 12), 2: (10, 8)}
    kinds = {1: (model, params), 2: ("PINHOLE", (15.0, 14.0, 5.5, 4.0))}
    for number, (kind, values) in kinds.items():
        width, height = sizes[number]
        camera = pycolmap.Camera(
            model=kind, width=width, height=height, params=values, camera_id=number
        )
        out.add_camera_with_trivial_rig(camera)
    names = [f"rgb/{i}.png" for i in range(4)] + [f"thermal/{i}.png" for i in range(3)]
    for i, name in enumerate(names):
        number = 1 if name.startswith("rgb") else 2
        grey = number == 2
        save_image(folder / "images" / name, sizes[number], i, "L" if grey else "RGB")
        camera_from_world = pycolmap.Rigid3d(np.linalg.inv(opencv_pose(i))[:3])
        image = pycolmap.Image(name=name, camera_id=number, image_id=i + 1)
        out.add_image_with_trivial_frame(image, camera_from_world)
    for xyz in CLOUD:
        out.add_point3D(xyz, pycolmap.Track(), np.array([255, 128, 0], np.uint8))
    (out.write_text if text else out.write_binary)(model_folder)
    return out


@pytest.mark.parametrize("text", [True, False])
def test_colmap_projects_as_colmap_itself(tmp_path, text):
    model = colmap_model(tmp_path, text)
    capture = read_capture(tmp_path)
    assert [(s.name, s.x, s.kind, s.palette) for s in capture.stops] == [
        ("rgb", 0.0, "rgb", ""),
        ("thermal", 1.0, "thermal", "ironbow"),
    ]
    assert [p.view.size for p in capture.photos] == [(16, 12)] * 4 + [(10, 8)] * 3
    assert capture.points.dtype == np.float32
    # Half a turn about x, as for splats of COLMAP-style worlds.
    points = CLOUD * (1, -1, -1)
    np.testing.assert_allclose(np.sort(capture.points, 0), np.sort(points, 0), atol=1e-6)
    np.testing.assert_allclose(capture.point_colors, [[1, 128 / 255, 0]] * 20, atol=1e-6)
    images = {i.name: i for i in model.images.values()}
    for photo in capture.photos:
        image = images[photo.path.relative_to(tmp_path / "images").as_posix()]
        theirs = np.array([image.project_point(p) for p in CLOUD])
        np.testing.assert_allclose(projected(photo.view, points), theirs, atol=1e-9)
        assert photo.view.world_from_eye.matrix()[1, 1] > 0.5  # upright


def test_colmap_text_and_binary_are_one(tmp_path):
    captures = []
    for text in (True, False):
        colmap_model(tmp_path / str(text), text)
        captures.append(read_capture(tmp_path / str(text)))
    for a, b in zip(captures[0].photos, captures[1].photos, strict=True):
        assert a.view.tangents == b.view.tangents
        np.testing.assert_allclose(
            a.view.world_from_eye.matrix(), b.view.world_from_eye.matrix(), atol=1e-12
        )


def test_capture_json_names_the_modalities_of_a_colmap_folder(tmp_path):
    colmap_model(tmp_path, False)
    stops = [
        {"name": "Heat", "x": 0.5, "kind": "thermal", "folder": "thermal", "unit": "°C",
         "value_range": [10, 60], "palette": "turbo"},
        {"name": "Colour", "x": 0.0, "folder": "rgb"},
    ]  # fmt: skip
    (tmp_path / "capture.json").write_text(
        json.dumps({"modalities": stops, "background": [1, 1, 1], "up": [0, 0, 1]})
    )
    capture = read_capture(tmp_path)
    assert capture.stops == (
        Stop("Colour", 0.0, "rgb"),
        Stop("Heat", 0.5, "thermal", "turbo", (10.0, 60.0), "°C"),
    )
    assert capture.background == (1.0, 1.0, 1.0)
    up_z = CLOUD[:, [0, 2, 1]] * (1, 1, -1)
    np.testing.assert_allclose(np.sort(capture.points, 0), np.sort(up_z, 0), atol=1e-6)
    stops[0]["folder"] = "lidar"
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": stops}))
    with pytest.raises(BadFile, match="'Heat' has no images"):
        read_capture(tmp_path)


def test_colmap_masks_are_found(tmp_path):
    colmap_model(tmp_path, False)
    first = save_image(tmp_path / "masks/rgb/0.png.png", mode="L")
    second = save_image(tmp_path / "masks/rgb/1.png", mode="L")
    masks = {p.path.name: p.mask for p in read_capture(tmp_path).of("rgb", "train")}
    assert (masks["1.png"], masks["2.png"]) == (second, None)
    assert read_capture(tmp_path).of("rgb", "test")[0].mask == first


def test_a_nearly_straight_lens_is_taken_and_a_bent_one_refused(tmp_path):
    colmap_model(tmp_path / "ok", False, "SIMPLE_RADIAL", (20.0, 8.0, 6.0, 0.01))
    assert len(read_capture(tmp_path / "ok").photos) == 7
    colmap_model(tmp_path / "bent", False, "SIMPLE_RADIAL", (20.0, 8.0, 6.0, 0.3))
    with pytest.raises(BadFile, match=r"SIMPLE_RADIAL.*undistort"):
        read_capture(tmp_path / "bent")


@pytest.mark.parametrize("keep", [0, 7, 60, 300])
def test_a_cut_off_colmap_model_is_refused(tmp_path, keep):
    colmap_model(tmp_path, False)
    file = tmp_path / "sparse/0/images.bin"
    file.write_bytes(file.read_bytes()[:keep])
    with pytest.raises(BadFile):
        read_capture(tmp_path)


def test_colmap_lacks_a_table_or_an_image(tmp_path):
    colmap_model(tmp_path, False)
    (tmp_path / "images/rgb/2.png").unlink()
    with pytest.raises(BadFile, match=r"rgb/2.png: the image file is missing"):
        read_capture(tmp_path)
    (tmp_path / "sparse/0/cameras.bin").unlink()
    with pytest.raises(BadFile, match=r"cameras.bin missing"):
        read_capture(tmp_path)


# ---------------------------------------------------------------- transforms.json


def test_nerfstudio_axes_and_angles(tmp_path):
    frames, _ = simple(tmp_path, 9)
    for f in frames:
        f["file_path"] = f["file_path"].removesuffix(".png")
    write_transforms(tmp_path, frames, camera_angle_x=0.8)
    capture = read_capture(tmp_path)
    assert [p.split for p in capture.photos] == ["test"] + ["train"] * 7 + ["test"]
    left, right, down, up = capture.photos[0].view.tangents
    assert (right, up) == (pytest.approx(np.tan(0.4)), pytest.approx(np.tan(0.4) * 12 / 16))
    assert (left, down) == (-right, -up)
    for f, photo in zip(frames, capture.photos, strict=True):
        # z up becomes y up: (x, y, z) -> (x, z, -y)
        x, y, z = np.array(f["transform_matrix"])[:3, 3]
        np.testing.assert_allclose(photo.view.world_from_eye.position, (x, z, -y), atol=1e-9)
        middle = projected(photo.view, np.zeros((1, 3)))
        np.testing.assert_allclose(middle, [[8, 6]], atol=1e-6)


def test_blender_split_files(tmp_path):
    frames, more = simple(tmp_path, 5)
    for name, part in (("train", frames[:3]), ("test", frames[3:])):
        (tmp_path / f"transforms_{name}.json").write_text(json.dumps({"frames": part} | more))
    capture = read_capture(tmp_path)
    assert [p.split for p in capture.photos] == ["train"] * 3 + ["test"] * 2


def test_several_modalities_and_their_masks(tmp_path):
    frames, more = simple(tmp_path, 6)
    for f in frames[3:]:
        f["modality"] = "LWIR"
    frames[0]["modality"] = frames[1]["modality"] = frames[2]["modality"] = "RGB"
    save_image(tmp_path / "m.png", mode="L")
    frames[4]["mask_path"] = "m.png"
    write_transforms(tmp_path, frames, **more)
    capture = read_capture(tmp_path)
    assert [(s.name, s.kind, s.palette) for s in capture.stops] == [
        ("RGB", "rgb", ""), ("LWIR", "thermal", ""),  # coloured photos: no palette on top
    ]  # fmt: skip
    assert [p.mask for p in capture.photos[3:]] == [None, tmp_path / "m.png", None]


def test_our_own_form_round_trip(tmp_path):
    stops = (Stop("A", 0.0), Stop("B", 0.5, "thermal", "ironbow", (15.0, 95.0), "°C"))
    photos = []
    for i in range(6):
        path = save_image(tmp_path / f"{i}.png", (16, 12))
        view = View(
            look_at(RANDOM.normal(size=3) * 3, np.zeros(3)), (-0.4, 0.3, -0.2, 0.25),
            0.05, 1000.0, (16, 12),
        )  # fmt: skip
        mask = save_image(tmp_path / f"m{i}.png", mode="L") if i % 2 else None
        photos.append(Photo(view, path, "AB"[i % 2], mask, "test" if i > 3 else "train"))
    given = Capture(
        tmp_path, stops, tuple(photos), CLOUD.astype(np.float32),
        np.full((20, 3), 0.2, np.float32), (0.1, 0.2, 0.3), {"source": "here"},
    )  # fmt: skip
    write_capture(given)
    got = read_capture(tmp_path)
    assert (got.stops, got.background) == (given.stops, given.background)
    assert got.notes["source"] == "here"
    np.testing.assert_array_equal(got.points, given.points)
    np.testing.assert_array_equal(got.point_colors, given.point_colors)
    for a, b in zip(given.photos, got.photos, strict=True):
        assert (a.path, a.mask, a.split, a.modality) == (b.path, b.mask, b.split, b.modality)
        np.testing.assert_allclose(a.view.tangents, b.view.tangents, atol=1e-12)
        poses = a.view.world_from_eye.matrix(), b.view.world_from_eye.matrix()
        np.testing.assert_allclose(*poses, atol=1e-12)


def test_a_plain_border_is_the_background_and_a_real_one_is_not(tmp_path):
    frames, more = simple(tmp_path, 8)
    write_transforms(tmp_path, frames, **more)
    assert read_capture(tmp_path).background is None
    for f in frames:
        image = np.full((12, 16, 3), 255, np.uint8)
        image[3:9, 3:16] = 40
        Image.fromarray(image).save(tmp_path / f["file_path"])
    assert read_capture(tmp_path).background == (1.0, 1.0, 1.0)
    write_transforms(tmp_path, frames, background=[0, 0, 0], **more)
    assert read_capture(tmp_path).background == (0.0, 0.0, 0.0)


def test_ply_points_both_ways_of_writing(tmp_path):
    xyz = CLOUD.astype(np.float32)
    head = (
        f"ply\nformat {{}} 1.0\nelement vertex {len(xyz)}\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "end_header\n"
    )
    rows = np.zeros(len(xyz), [("p", "<f4", 3), ("c", "u1", 3)])
    rows["p"], rows["c"] = xyz, (255, 0, 51)
    binary, text = tmp_path / "b.ply", tmp_path / "t.ply"
    binary.write_bytes(head.format("binary_little_endian").encode() + rows.tobytes())
    lines = "".join(f"{x!r} {y!r} {z!r} 255 0 51\n" for x, y, z in xyz.tolist())
    text.write_text(head.format("ascii") + lines)
    for path in (binary, text):
        points, colors = read_points(path)
        np.testing.assert_array_equal(points.astype(np.float32), xyz)
        np.testing.assert_allclose(colors, [[1, 0, 0.2]] * len(xyz), atol=1e-7)
    binary.write_bytes(binary.read_bytes()[:-1])
    with pytest.raises(BadFile, match="cut off"):
        read_points(binary)


# ---------------------------------------------------------------- refusals


def spoil(change):
    """A table entry: frames and settings in, what is broken in them changed in place."""
    return pytest.param(change, id=change.__name__)


def no_poses(frames, more):
    for f in frames:
        del f["transform_matrix"]
    return "has no pose"


def nan_pose(frames, more):
    frames[1]["transform_matrix"][0][3] = float("nan")
    return r"frame 1 .*NaN"


def singular_pose(frames, more):
    frames[2]["transform_matrix"][0][:3] = [0, 0, 0]
    return "no rotation"


def scaled_pose(frames, more):
    frames[0]["transform_matrix"] = (np.array(frames[0]["transform_matrix"]) * 1.1).tolist()
    return "no rotation"


def mirrored_pose(frames, more):
    for row in frames[0]["transform_matrix"]:
        row[0] = -row[0]
    return "mirrors"


def ragged_pose(frames, more):
    frames[0]["transform_matrix"] = [[1, 2], [3]]
    return "no matrix"


def small_pose(frames, more):
    frames[0]["transform_matrix"] = [[1, 0], [0, 1]]
    return r"shape \(2, 2\)"


def wrong_size(frames, more):
    more["w"] = 32
    return "16x12 pixels, the capture says 32x12"


def missing_image(frames, more):
    frames[3]["file_path"] = "images/gone.png"
    return r"gone.png is missing"


def nameless_frame(frames, more):
    del frames[1]["file_path"]
    return "names no image"


def empty(frames, more):
    frames.clear()
    return "'frames' is empty"


def no_focal(frames, more):
    del more["fl_x"]
    return "no focal length"


def negative_focal(frames, more):
    more["fl_x"] = -3
    return "above 0"


def nan_focal(frames, more):
    more["fl_x"] = float("nan")
    return "above 0"


def bent_lens(frames, more):
    more["k1"] = 0.4
    return "undistort"


def empty_modality(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}, {"name": "IR", "x": 1}]
    for f in frames:
        f["modality"] = "RGB"
    return "'IR' has no images"


def unknown_modality(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}]
    frames[0]["modality"] = "UV"
    return "of modality 'UV'"


def only_tests(frames, more):
    for f in frames:
        f["split"] = "test"
    return "no photos to train on"


def odd_split(frames, more):
    frames[0]["split"] = "holdout"
    return "use train or test"


def stop_outside(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 1.5}]
    return "x = 1.5"


def twin_stops(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0}, {"name": "RGB", "x": 1}]
    return "same name"


def odd_kind(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0, "kind": "sonar"}]
    return "kind 'sonar'"


def upside_range(frames, more):
    more["modalities"] = [{"name": "RGB", "x": 0, "value_range": [9, 1]}]
    return "value_range"


def newer_version(frames, more):
    more["version"] = 7
    return "version 7"


def no_up(frames, more):
    more["up"] = [0, 0, 0]
    return "'up' must be"


def odd_background(frames, more):
    more["background"] = [0, 0]
    return "'background'"


def missing_points(frames, more):
    more["points"] = "gone.npz"
    return "file of points is missing"


@pytest.mark.parametrize("change", [spoil(c) for c in (
    no_poses, nan_pose, singular_pose, scaled_pose, mirrored_pose, ragged_pose, small_pose,
    wrong_size, missing_image, nameless_frame, empty, no_focal, negative_focal, nan_focal,
    bent_lens, empty_modality, unknown_modality, only_tests, odd_split, stop_outside, twin_stops,
    odd_kind, upside_range, newer_version, no_up, odd_background, missing_points,
)])  # fmt: skip
def test_refused_in_one_sentence(tmp_path, change):
    frames, more = simple(tmp_path)
    sentence = change(frames, more)
    write_transforms(tmp_path, frames, **more)
    with pytest.raises(BadFile, match=sentence) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)


def test_refused_folders_and_files(tmp_path):
    with pytest.raises(BadFile, match="does not exist"):
        read_capture(tmp_path / "nowhere")
    with pytest.raises(BadFile, match="neither photos nor poses"):
        read_capture(tmp_path)
    save_image(tmp_path / "images/a.png")
    with pytest.raises(BadFile, match=r"without poses.*structure from motion"):
        read_capture(tmp_path)
    with pytest.raises(BadFile, match="is no capture"):
        read_capture(tmp_path / "images/a.png")
    (tmp_path / "transforms.json").write_text('{"frames": [')
    with pytest.raises(BadFile, match="not JSON"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text("[1]")
    with pytest.raises(BadFile, match="holds a list"):
        read_capture(tmp_path)
    (tmp_path / "transforms.json").write_text('{"poses": []}')
    with pytest.raises(BadFile, match="no list 'frames'"):
        read_capture(tmp_path)


def test_refused_points(tmp_path):
    path = tmp_path / "points.npz"
    for arrays, sentence in (
        ({"abc": CLOUD}, "'xyz'"),
        ({"xyz": CLOUD[:, :2]}, r"\(20, 2\)"),
        ({"xyz": CLOUD * np.nan}, "NaN"),
        ({"xyz": CLOUD, "rgb": CLOUD[:3]}, "do not fit"),
    ):
        np.savez(path, **arrays)
        with pytest.raises(BadFile, match=sentence):
            read_points(path)
    path.write_bytes(path.read_bytes()[:50])
    with pytest.raises(BadFile, match="cannot be read"):
        read_points(path)


# ---------------------------------------------------------------- photos


def photo_at(path: Path, mask: Path | None = None) -> Photo:
    view = View(Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-1, 1, -1, 1), 0.1, 9.0, (4, 4))
    return Photo(view, path, "RGB", mask)


def test_grey_photos_get_three_equal_channels(tmp_path):
    eight = np.array([[0, 255], [51, 102]], np.uint8)
    Image.fromarray(eight).save(tmp_path / "8.png")
    Image.fromarray(eight.astype(np.uint16) * 257).save(tmp_path / "16.png")
    for name in ("8.png", "16.png"):
        rgb, mask = load_photo(photo_at(tmp_path / name))
        assert (rgb.dtype, rgb.shape, mask) == (np.float32, (2, 2, 3), None)
        np.testing.assert_allclose(rgb, np.repeat(eight[..., None] / 255, 3, 2), atol=1e-7)


def test_alpha_is_the_mask_and_black_lies_behind(tmp_path):
    path = save_image(tmp_path / "a.png", mode="RGBA")
    rgba = np.asarray(Image.open(path)) / np.float32(255)
    rgb, mask = load_photo(photo_at(path))
    np.testing.assert_allclose(mask, rgba[..., 3], atol=1e-6)
    np.testing.assert_allclose(rgb, rgba[..., :3] * rgba[..., 3:], atol=1e-6)
    file = save_image(tmp_path / "m.png", seed=3, mode="L")
    _, mask = load_photo(photo_at(path, file))
    np.testing.assert_allclose(mask, np.asarray(Image.open(file)) / 255, atol=1e-6)
    with pytest.raises(BadFile, match="mask has 5x5"):
        load_photo(photo_at(path, save_image(tmp_path / "s.png", (5, 5), mode="L")))


@pytest.mark.parametrize("old, new", [(8, 4), (7, 3), (5, 5), (4, 7), (1, 3), (3, 1)])
def test_shrinking_is_the_mean_over_the_area(old, new):
    """The twin: every old pixel as many equal cells, the new ones their plain means."""
    row = np.random.default_rng(old).random(old)
    cells = np.repeat(row, new)  # old * new cells, so both grids fall on them
    np.testing.assert_allclose(area_weights(old, new) @ row, cells.reshape(new, old).mean(1), 1e-6)
    np.testing.assert_allclose(area_weights(old, new).sum(1), 1, 1e-6)


def test_load_photo_shrinks_photo_and_mask(tmp_path):
    path, mask = save_image(tmp_path / "a.png"), save_image(tmp_path / "m.png", mode="L")
    rgb, small = load_photo(photo_at(path, mask), (8, 4))
    full, full_mask = load_photo(photo_at(path, mask))
    assert (rgb.shape, rgb.dtype, small.dtype) == ((4, 8, 3), np.float32, np.float32)
    np.testing.assert_allclose(rgb, full.reshape(4, 3, 8, 2, 3).mean((1, 3)), atol=1e-6)
    np.testing.assert_allclose(small, full_mask.reshape(4, 3, 8, 2).mean((1, 3)), atol=1e-6)


def test_broken_photos_are_refused(tmp_path):
    with pytest.raises(BadFile, match="missing"):
        load_photo(photo_at(tmp_path / "no.png"))
    path = save_image(tmp_path / "cut.png", (64, 64))
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(BadFile, match="cut off"):
        load_photo(photo_at(path))
    path.write_text("hello")
    with pytest.raises(BadFile, match="not a readable image"):
        load_photo(photo_at(path))


# ---------------------------------------------------------------- rules


@pytest.mark.parametrize(
    "up", [(0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -2), (1, 0, 0), (1, -5, 2)]
)
def test_turning_upright_is_a_rotation_to_plus_y(up):
    turn = turn_upright(up, "test")[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(turn @ up / np.linalg.norm(up), (0, 1, 0), atol=1e-12)
    if up == (0, -1, 0):
        np.testing.assert_array_equal(turn, np.diag([1, -1, -1]))


def test_stops_spread_over_the_slider():
    assert [(s.x, s.kind) for s in spread_stops(["bone"])] == [(0.0, "rgb")]
    three = spread_stops(["RGB", "thermal_left", "inside"])
    assert [(s.x, s.kind) for s in three] == [(0, "rgb"), (0.5, "thermal"), (1, "layer")]


# ---------------------------------------------------------------- real captures


def real(name: str) -> Path:
    if not (DATA / name).is_dir():
        pytest.skip(f"{name} is not on this machine")
    return DATA / name


def test_leg_with_its_own_split_and_white_background():
    capture = read_capture(real("anatomy_leg_3modal_views"))
    assert [(s.name, s.x, s.kind) for s in capture.stops] == [
        ("bone", 0, "layer"), ("muscle", 0.5, "layer"), ("full", 1, "layer"),
    ]  # fmt: skip
    for stop in capture.stops:
        assert len(capture.of(stop.name, "train")) == 84
        assert len(capture.of(stop.name, "test")) == 12
    assert (capture.background, capture.points) == ((1.0, 1.0, 1.0), None)
    ups = [p.view.world_from_eye.matrix()[1, 1] for p in capture.photos]
    assert max(ups) < 0  # turned as its PLY files are, although its cameras hung upside down


def test_plush_points_fall_on_pixels_of_their_own_colour():
    """Poses, axes, intrinsics and points all at once: four pixels aside the colours fit worse."""
    capture = read_capture(real("plush_snowmiku"))
    assert (len(capture.photos), len(capture.of("RGB", "test"))) == (97, 13)
    well_seen = np.load(DATA / "plush_snowmiku" / "points3d.npz")["track"] >= 8
    points, colors = capture.points[well_seen].astype(float), capture.point_colors[well_seen]
    for photo in (capture.photos[0], capture.photos[72], capture.photos[96]):
        rgb, _ = load_photo(photo)
        to_eye = photo.view.eye_from_world()
        ahead = points @ to_eye[2, :3] + to_eye[2, 3] < 0
        at = projected(photo.view, points)
        seen = ahead & ((at >= 8) & (at < np.array(photo.view.size) - 8)).all(1)

        def misfit(dx: int, dy: int, rgb=rgb, at=at[seen], seen=seen) -> float:
            x, y = np.add(at, (dx, dy)).astype(int).T
            return float(np.abs(rgb[y, x] - colors[seen]).mean())

        aside = [misfit(*d) for d in ((4, 0), (-4, 0), (0, 4), (0, -4))]
        assert misfit(0, 0) < 0.92 * min(aside)


def test_tankard_has_masks_and_fern_has_points():
    tankard = read_capture(real("maryrose_tankard"))
    assert len(tankard.photos) == 69
    assert all(p.mask is not None for p in tankard.photos)
    rgb, mask = load_photo(tankard.photos[0], (100, 100))
    assert (rgb.shape, mask.shape) == ((100, 100, 3), (100, 100))
    assert 0.05 < mask.mean() < 0.9
    fern = read_capture(real("fern_llff"))
    assert (len(fern.photos), len(fern.points)) == (20, 10091)


def test_unposed_bananas_are_told_what_to_do():
    with pytest.raises(BadFile, match="photos without poses; run structure from motion first"):
        read_capture(real("banana16_unposed"))
