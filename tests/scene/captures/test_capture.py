"""Captures of JSON kinds, what they are turned into; and the real ones."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.runtime_models.splats.layers.read_layers import layer_files, read_layers
from shapeshift.scene.cameras.upright import upright_rotation
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.capture_rules import spread_stops
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.point_clouds import read_points
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View, look_at
from tests.support.scene.captures import (
    CLOUD,
    RANDOM,
    projected,
    save_image,
    simple,
    write_transforms,
)

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


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


@pytest.mark.parametrize(
    "up", [(0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -2), (1, 0, 0), (1, -5, 2)]
)
def test_turning_upright_is_a_rotation_to_plus_y(up):
    turn = upright_rotation(up, "test")[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    np.testing.assert_allclose(turn @ up / np.linalg.norm(up), (0, 1, 0), atol=1e-12)
    if up == (0, -1, 0):
        np.testing.assert_array_equal(turn, np.diag([1, -1, -1]))


def test_stops_spread_over_the_slider():
    assert [(s.x, s.kind) for s in spread_stops(["bone"])] == [(0.0, "rgb")]
    three = spread_stops(["RGB", "thermal_left", "inside"])
    assert [(s.x, s.kind) for s in three] == [(0, "rgb"), (0.5, "thermal"), (1, "layer")]


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


def test_leg_layers_and_leg_photos_are_in_one_world():
    """The photos were rendered from these splats: their centres lie on what is not white."""
    layers = read_layers(layer_files(real("anatomy_leg_ml3dgs")))
    centres = layers.means[layers.opacity > 0.8].astype(float)
    capture = read_capture(real("anatomy_leg_3modal_views"))
    for photo in capture.of("full", "test")[:3]:
        rgb = load_photo(photo).rgb / 255
        at = projected(photo.view, centres)
        inside = ((at >= 0) & (at < photo.view.size)).all(1)
        x, y = at[inside].astype(int).T
        assert (rgb[y, x] < 1).any(axis=1).mean() > 0.995
        assert (rgb < 1).any(axis=2).mean() < 0.2  # which is not most of the photo


def test_plush_points_fall_on_pixels_of_their_own_colour():
    """Poses, axes, intrinsics and points all at once: four pixels aside the colours fit worse."""
    capture = read_capture(real("plush_snowmiku"))
    assert (len(capture.photos), len(capture.of("RGB", "test"))) == (97, 13)
    well_seen = np.load(DATA / "plush_snowmiku" / "points3d.npz")["track"] >= 8
    points, colors = capture.points[well_seen].astype(float), capture.point_colors[well_seen]
    for photo in (capture.photos[0], capture.photos[72], capture.photos[96]):
        rgb = load_photo(photo).rgb / 255
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
    rgb, mask, _ = load_photo(tankard.photos[0], 10)
    assert (rgb.shape, mask.shape) == ((100, 100, 3), (100, 100))
    assert 0.05 < mask.mean() / 255 < 0.9
    fern = read_capture(real("fern_llff"))
    assert (len(fern.photos), len(fern.points)) == (20, 10091)


def test_unposed_bananas_are_told_what_to_do():
    with pytest.raises(
        BadFile, match=r"photos without poses; find them first, `python3 launch\.py poses"
    ):
        read_capture(real("banana16_unposed"))


def photo_folder(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    return folder


@pytest.mark.parametrize("files", [("images/a.jpg",), ("a.jpg",), ("heat/a.jpg", "photo/b.jpg")])
def test_the_advice_for_photos_without_poses_is_a_command(tmp_path, files):
    """What it names is there; `poses` is tried in tests/app/commands/test_poses.py."""
    root = photo_folder(tmp_path / "my capture", *files)
    with pytest.raises(BadFile) as refusal:
        read_capture(root)
    words = shlex.split(re.search("`(.*)`", str(refusal.value))[1])
    assert words[:3] == ["python3", "launch.py", "poses"] and words[4:] == ["--out", "CAPTURE"]
    assert Path(words[3]).samefile(root)


def test_photos_beside_their_poses_are_told_where_these_are(tmp_path):
    root = photo_folder(tmp_path / "capture", "images/a.jpg", "cameras.json")
    with pytest.raises(BadFile, match=r"poses lie in the folder above, name that: .*capture\.$"):
        read_capture(root / "images")
