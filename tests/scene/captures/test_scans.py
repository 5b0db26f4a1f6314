"""Scans and data sets in forms of their own, each written here as its makers document it.

The truth is the tracer's: a photo read back must have the view that it was drawn from, up to one
turn of the whole world, and its depth must be what the tracer measured.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View
from shapeshift.training.synthetic.balls import dome_views, place, radiance
from shapeshift.training.synthetic.tracer import depth_under, photograph

SIDE, COUNT = 24, 5
VIEWS = dome_views(COUNT, 3, SIDE)
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
FLIP = np.diag([1.0, -1, -1, 1])  # between cameras of OpenGL and of OpenCV


@pytest.fixture(scope="module")
def drawn() -> list[tuple[np.ndarray, np.ndarray]]:
    """(H, W, 3) uint8 and (H, W) metres of each view."""
    here = place()
    photos = [photograph(view, radiance(here, "RGB"))[0] for view in VIEWS]
    return [
        (np.rint(255 * photo).astype(np.uint8), depth_under(here, view))
        for photo, view in zip(photos, VIEWS, strict=True)
    ]


def lens(view: View) -> tuple[float, float, float, float]:
    return view.pinhole()[1:]


def k_matrix(view: View, rows: int = 4) -> np.ndarray:
    fx, fy, cx, cy = lens(view)
    out = np.eye(rows)
    out[:2, :3] = [[fx, 0, cx], [0, fy, cy]]
    return out


def save(path: Path, pixels: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)


def save_text(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def save_depth(path: Path, metres: np.ndarray) -> None:
    save(path, np.rint(1000 * metres).astype(np.uint16))


def polycam(folder, drawn):
    for i, (view, (photo, depth)) in enumerate(zip(VIEWS, drawn, strict=True)):
        name, matrix = f"{7000 + i}", view.world_from_eye.matrix()  # ARKit: +Y up, OpenGL
        said = {f"t_{r}{c}": matrix[r, c] for r in range(3) for c in range(4)}
        said |= dict(zip(("fx", "fy", "cx", "cy"), lens(view), strict=True))
        save(folder / f"keyframes/corrected_images/{name}.jpg", photo)
        save_depth(folder / f"keyframes/depth/{name}.png", depth)
        said |= {"width": SIDE, "height": SIDE, "blur_score": 91.0}
        save_text(folder / f"keyframes/corrected_cameras/{name}.json", json.dumps(said))


def record3d(folder, drawn):
    poses = []
    for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
        matrix = view.world_from_eye.matrix()
        xyzw = Rotation.from_matrix(matrix[:3, :3]).as_quat()
        poses.append([*xyzw.tolist(), *matrix[:3, 3].tolist()])
        save(folder / f"rgb/{i}.png", photo)
    k = k_matrix(VIEWS[0], 3).T.ravel().tolist()  # column by column
    save_text(folder / "metadata.json", json.dumps({"w": SIDE, "h": SIDE, "K": k, "poses": poses}))


def scannet(folder, drawn):
    for i, (view, (photo, depth)) in enumerate(zip(VIEWS, drawn, strict=True)):
        save(folder / f"color/{i}.png", photo)
        save_depth(folder / f"depth/{i}.png", depth)
        matrix = Z_UP @ view.world_from_eye.matrix() @ FLIP
        save_text(
            folder / f"pose/{i}.txt", "\n".join(" ".join(map(repr, r)) for r in matrix.tolist())
        )
    save(folder / f"color/{COUNT}.png", drawn[0][0])
    save_text(folder / f"pose/{COUNT}.txt", "-inf " * 16)  # ScanNet's word for: lost
    np.savetxt((folder / "pose").parent / "k.txt", k_matrix(VIEWS[0]))
    save_text(folder / "intrinsic/intrinsic_color.txt", (folder / "k.txt").read_text())


def arkitscenes(folder, drawn):
    lines, place_ = [], folder / f"{folder.name}_frames"
    for i, (view, (photo, depth)) in enumerate(zip(VIEWS, drawn, strict=True)):
        seconds = 6790.123 + 0.1 * i
        name = f"{folder.name}_{seconds:.3f}"
        save(place_ / f"lowres_wide/{name}.png", photo)
        save_depth(place_ / f"lowres_depth/{name}.png", depth)
        fx, fy, cx, cy = lens(view)
        aside = f"{folder.name}_{seconds + 0.001:.3f}"  # as it is in the wild
        save_text(place_ / f"lowres_wide_intrinsics/{aside}.pincam",
                  f"{SIDE} {SIDE} {fx!r} {fy!r} {cx!r} {cy!r}")  # fmt: skip
        matrix = np.linalg.inv(Z_UP @ view.world_from_eye.matrix() @ FLIP)
        about = Rotation.from_matrix(matrix[:3, :3]).as_rotvec()
        lines.append(
            " ".join(map(repr, [seconds + 0.002, *about.tolist(), *matrix[:3, 3].tolist()]))
        )
    save_text(place_ / "lowres_wide.traj", "\n".join(lines))


def scannetpp(folder, drawn):
    frames = []
    for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
        save(folder / f"dslr/resized_images/DSC{i:05}.png", photo)
        matrix = (Z_UP @ view.world_from_eye.matrix()).tolist()
        frames.append({"file_path": f"DSC{i:05}.png", "mask_path": f"DSC{i:05}.png",
                       "transform_matrix": matrix})  # fmt: skip
    names = ("fl_x", "fl_y", "cx", "cy")
    said = dict(zip(names, lens(VIEWS[0]), strict=True)) | {"w": SIDE, "h": SIDE}
    said |= {"camera_model": "OPENCV", "frames": frames[1:], "test_frames": frames[:1]}
    save_text(folder / "dslr/nerfstudio/transforms.json", json.dumps(said))


def sdfstudio(folder, drawn):
    frames = []
    for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
        save(folder / f"{i:06}_rgb.png", photo)
        matrix = Z_UP @ view.world_from_eye.matrix() @ FLIP
        frames.append({"rgb_path": f"{i:06}_rgb.png", "camtoworld": matrix.tolist(),
                       "intrinsics": k_matrix(view).tolist()})  # fmt: skip
    said = {"camera_model": "OPENCV", "height": SIDE, "width": SIDE, "frames": frames}
    save_text(folder / "meta_data.json", json.dumps(said))


def nerfies(folder, drawn):
    ids = [f"{i:06}" for i in range(COUNT)]
    for name, view, (photo, _) in zip(ids, VIEWS, drawn, strict=True):
        save(folder / f"rgb/1x/{name}.png", photo)
        fx, fy, cx, cy = lens(view)
        matrix = Z_UP @ view.world_from_eye.matrix() @ FLIP
        camera = {
            "orientation": matrix[:3, :3].T.tolist(), "position": matrix[:3, 3].tolist(),
            "focal_length": fx, "principal_point": [cx, cy], "skew": 0.0,
            "pixel_aspect_ratio": fy / fx, "radial_distortion": [0.0, 0.0, 0.0],
            "tangential_distortion": [0.0, 0.0], "image_size": [SIDE, SIDE],
        }  # fmt: skip
        save_text(folder / f"camera/{name}.json", json.dumps(camera))
    said = {"count": COUNT, "ids": ids, "train_ids": ids[1:], "val_ids": ids[:1]}
    save_text(folder / "dataset.json", json.dumps(said))
    times = {name: {"warp_id": i, "appearance_id": i, "camera_id": 0} for i, name in enumerate(ids)}
    save_text(folder / "metadata.json", json.dumps(times))


def posed_splits(folder, drawn):
    for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
        split = folder / ("test" if i == 0 else "train")
        save(split / f"rgb/{i:04}.png", photo)
        matrix = Z_UP @ view.world_from_eye.matrix() @ FLIP
        for name, values in (("pose", matrix), ("intrinsics", k_matrix(view))):
            save_text(split / name / f"{i:04}.txt", " ".join(map(repr, values.ravel().tolist())))


def wxyz_of(matrix: np.ndarray) -> list[float]:
    return np.roll(Rotation.from_matrix(matrix[:3, :3]).as_quat(), 1).tolist()


def nuscenes(folder, drawn, scenes=("scene-0061",)):
    """Of each scene the same photos; a lidar and a sweep between key frames are there, too."""
    rig = np.eye(4)
    rig[:3, :3] = Rotation.from_rotvec([0.2, -1.4, 0.6]).as_matrix()
    rig[:3, 3] = 1.7, 0.1, 1.5
    k = k_matrix(VIEWS[0], 3).tolist()
    rigs = [{"token": "r0", "sensor_token": "s0", "translation": rig[:3, 3].tolist(),
             "rotation": wxyz_of(rig), "camera_intrinsic": k},
            {"token": "r1", "sensor_token": "s1", "translation": [0, 0, 2],
             "rotation": [1, 0, 0, 0], "camera_intrinsic": []}]  # fmt: skip
    sensors = [{"token": "s0", "channel": "CAM_FRONT", "modality": "camera"},
               {"token": "s1", "channel": "LIDAR_TOP", "modality": "lidar"}]  # fmt: skip
    samples, data, poses = [], [], []
    for name in scenes:
        for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
            file = f"samples/CAM_FRONT/{name}__CAM_FRONT__{i}.png"
            save(folder / file, photo)
            vehicle = Z_UP @ view.world_from_eye.matrix() @ FLIP @ np.linalg.inv(rig)
            token = f"{name} {i}"
            samples.append({"token": token, "timestamp": i, "scene_token": f"of {name}"})
            poses.append({"token": token, "translation": vehicle[:3, 3].tolist(),
                          "rotation": wxyz_of(vehicle), "timestamp": i})  # fmt: skip
            row = {"token": token, "sample_token": token, "ego_pose_token": token,
                   "calibrated_sensor_token": "r0", "filename": file, "fileformat": "png",
                   "width": SIDE, "height": SIDE, "timestamp": i, "is_key_frame": True}  # fmt: skip
            data += [row, row | {"filename": f"sweeps/{i}.png", "is_key_frame": False},
                     row | {"calibrated_sensor_token": "r1", "filename": f"{i}.bin"}]  # fmt: skip
    named = [{"token": f"of {name}", "name": name} for name in scenes]
    tables = {"scene": named, "sample": samples, "sample_data": data, "sensor": sensors,
              "calibrated_sensor": rigs, "ego_pose": poses}  # fmt: skip
    for name, rows in tables.items():
        save_text(folder / f"v1.0-mini/{name}.json", json.dumps(rows))


def sitcoms3d(folder, drawn):
    frames = []
    for i, (view, (photo, _)) in enumerate(zip(VIEWS, drawn, strict=True)):
        save(folder / f"images_4/TBBT_{i}.png", photo)
        k = k_matrix(view, 3) * 4
        k[2, 2] = 1
        frames.append({"image_name": f"TBBT_{i}.png", "intrinsics": k.tolist(),
                       "camtoworld": view.world_from_eye.matrix().tolist()})  # fmt: skip
    said = {"frames": frames, "bbox": [[-1, -1, -1], [1, 1, 1]]}
    save_text(folder / "cameras.json", json.dumps(said))


def scanner_app(folder, drawn):
    """3D Scanner App: a table each frame, a photo every few."""
    for i, (view, (photo, depth)) in enumerate(zip(VIEWS, drawn, strict=True)):
        said = {
            "cameraPoseARFrame": view.world_from_eye.matrix().ravel().tolist(),
            "intrinsics": k_matrix(view, 3).ravel().tolist(), "frame_index": 3 * i,
        }  # fmt: skip
        for number in (3 * i, 3 * i + 1):
            save_text(folder / f"frame_{number:05d}.json", json.dumps(said))
        save(folder / f"frame_{3 * i:05d}.jpg", photo)
        save_depth(folder / f"depth_{3 * i:05d}.png", depth)
    save_text(folder / "info.json", json.dumps({"device": "x"}))


WITH_DEPTH = (polycam, scannet, arkitscenes, scanner_app)
WRITERS = (polycam, record3d, scannet, arkitscenes, scannetpp, sdfstudio, nerfies, posed_splits,
           nuscenes, sitcoms3d, scanner_app)  # fmt: skip


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_views_and_depth_are_those_that_were_photographed(tmp_path, drawn, write):
    folder = tmp_path / "41069021"
    folder.mkdir()
    write(folder, drawn)
    capture = read_capture(folder)
    photos = sorted(capture.photos, key=lambda photo: photo.path.name)
    assert len(photos) == COUNT
    # One turn of the world between the form's and ours, which here all keep +Y up.
    turn = photos[0].view.world_from_eye.matrix() @ VIEWS[0].eye_from_world()
    assert np.allclose(turn[:3, 1], (0, 1, 0), atol=1e-6), "up is up"
    assert np.allclose(turn[:3, 3], 0, atol=1e-5)
    for photo, view, (pixels, depth) in zip(photos, VIEWS, drawn, strict=True):
        assert np.allclose(
            photo.view.world_from_eye.matrix(), turn @ view.world_from_eye.matrix(), atol=1e-5
        )
        assert np.allclose(photo.view.pinhole()[1:], view.pinhole()[1:], atol=1e-9)
        if photo.path.suffix == ".png":  # JPEG is not exact
            assert np.array_equal(load_photo(photo).rgb, pixels)
        if write in WITH_DEPTH:
            assert np.allclose(load_depth(photo), depth, atol=0.0006), "millimetres, rounded"
        assert (photo.depth is not None) == (write in WITH_DEPTH)
    assert {p.path.stem for p in photos if p.split == "test"} == {photos[0].path.stem}


def test_what_is_left_out_is_said(tmp_path, drawn):
    folder = tmp_path / "scene"
    folder.mkdir()
    scannet(folder, drawn)
    capture = read_capture(folder)
    (row,) = [row for row in capture.files if row.left_out]
    assert (row.kind, row.found, row.left_out, row.why) == ("photos", 1, 1, "they have no pose")
    assert any("they have no pose" in d and "5.png" in d for d in capture.doubts)
    other = tmp_path / "other"
    other.mkdir()
    scannetpp(other, drawn)
    assert any("masks" in said for said in read_capture(other).doubts)
    third = tmp_path / "third"
    third.mkdir()
    nerfies(third, drawn)
    assert any("one still scene" in said for said in read_capture(third).doubts)


def test_a_scene_of_nuscenes_is_named(tmp_path, drawn):
    nuscenes(tmp_path, drawn, ("scene-0061", "scene-0103"))
    with pytest.raises(BadFile, match=r"2 scenes .*scene-0061.*scene-0103.*name one"):
        read_capture(tmp_path)
    with pytest.raises(BadFile, match=r"no scene .scene-7. among its 2"):
        read_capture(tmp_path / "scene-7")
    capture = read_capture(tmp_path / "scene-0103")
    assert len(capture.photos) == COUNT
    assert all(photo.path.name.startswith("scene-0103") for photo in capture.photos)
    assert any("will be smears" in said for said in capture.doubts)
    for photo in capture.photos:
        save(tmp_path / f"masks/CAM_FRONT/{photo.path.stem}.png", np.eye(SIDE, dtype=np.uint8))
    capture = read_capture(tmp_path / "scene-0103")
    assert {photo.mask_means for photo in capture.photos} == {"valid"} and not capture.doubts


@pytest.mark.parametrize("key, value, said", [
    ("rotation", [1, 1, 0, 0], "no quaternion"), ("rotation", [1, 0], "list of 4"),
    ("translation", ["x", 0, 0], "translation"), ("token", "gone", "in no row of that table"),
])  # fmt: skip
def test_broken_tables_of_nuscenes(tmp_path, drawn, key, value, said):
    nuscenes(tmp_path, drawn)
    path = tmp_path / "v1.0-mini/ego_pose.json"
    rows = json.loads(path.read_text())
    rows[2][key] = value
    path.write_text(json.dumps(rows))
    with pytest.raises(BadFile, match=said) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)


def test_nerfstudios_minimal_form_is_refused_unopened(tmp_path):
    np.savez(tmp_path / "train.npz", cameras=np.array({"fx": 1}, dtype=object))
    for path in (tmp_path, tmp_path / "train.npz"):
        with pytest.raises(BadFile, match=r"pickled Python objects.*write transforms.json"):
            read_capture(path)


def cut_pose(folder):
    (folder / "pose/2.txt").write_text("1 0 0 0")
    return "holds 4 numbers; 16 are wanted"


def no_intrinsics(folder):
    (folder / "intrinsic/intrinsic_color.txt").unlink()
    return "intrinsic_color.txt is missing"


def words_for_numbers(folder):
    (folder / "pose/2.txt").write_text("north " * 16)
    return "what should be numbers is not"


def all_lost(folder):
    for path in (folder / "pose").iterdir():
        path.write_text("-inf " * 16)
    return "no photo has a pose"


def endless_pose(folder):
    (folder / "pose/2.txt").write_text("1 " * (1 << 20))
    return "too many for one camera"


@pytest.mark.parametrize(
    "spoil", [cut_pose, no_intrinsics, words_for_numbers, all_lost, endless_pose]
)
def test_broken_scans_are_refused_in_one_sentence(tmp_path, drawn, spoil):
    scannet(tmp_path, drawn)
    sentence = spoil(tmp_path)
    with pytest.raises(BadFile, match=sentence) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", ["Infinity", "NaN", '"x"', "[]", "null", "1e999"])
@pytest.mark.parametrize("write", [polycam, record3d, sdfstudio, nerfies], ids=lambda w: w.__name__)
def test_numbers_that_are_none_are_refused(tmp_path, drawn, write, value):
    write(tmp_path, drawn)
    of = {
        polycam: ("keyframes/corrected_cameras/7002.json", '"t_12"'),
        record3d: ("metadata.json", '"w"'),
        sdfstudio: ("meta_data.json", '"width"'),
        nerfies: ("camera/000002.json", '"focal_length"'),
    }
    name, key = of[write]
    text = (tmp_path / name).read_text()
    at = text.index(key) + len(key) + 2
    end = min(i for i in (text.find(",", at), text.find("}", at)) if i > 0)
    (tmp_path / name).write_text(text[:at] + value + text[end:])
    with pytest.raises(BadFile) as caught:
        read_capture(tmp_path)
    assert "\n" not in str(caught.value)
