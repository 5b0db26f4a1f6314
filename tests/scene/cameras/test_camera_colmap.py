"""COLMAP models: against pycolmap both ways, cut and lying tables, broken lines of text."""

import struct
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraList, data_from_ours
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.cameras.write_cameras import COLMAP_FORMS, write_cameras
from shapeshift.scene.captures.colmap.colmap_files import read_colmap_points
from tests.support.scene.camera_files import HALF, NAMES, cameras, views


@pytest.mark.parametrize("form", COLMAP_FORMS)
def test_pycolmap_reads_what_we_write(tmp_path, form):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    wanted = CameraList(views(5), (*NAMES[::2], "d", "e", "f"), "test")
    write_cameras(wanted, tmp_path, form)
    model = pycolmap.Reconstruction(tmp_path / "sparse/0")
    assert len(model.images) == 5 and len(model.points3D) == 0
    for number, (view, name) in enumerate(zip(wanted.views, wanted.names, strict=True), 1):
        image = model.images[number]
        camera = model.cameras[image.camera_id]
        camera_from_ours, *lens = view.pinhole()
        camera_from_data = camera_from_ours @ np.linalg.inv(data_from_ours())
        np.testing.assert_allclose(image.cam_from_world().matrix(), camera_from_data[:3], atol=1e-9)
        np.testing.assert_allclose(camera.params, lens, rtol=1e-12)
        assert (image.name, camera.width, camera.height) == (name, *view.size)


@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
def test_we_read_what_pycolmap_writes(tmp_path, text):
    """Every model of lens; points, a second sensor size and distortion among it."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_frames_per_rig, options.num_points3D = 2, 4, 30
    made = pycolmap.synthesize_dataset(options)
    (made.write_text if text else made.write_binary)(tmp_path)
    got = read_camera_list(tmp_path)
    assert len(got.views) == len(made.images)
    for view, number in zip(got.views, sorted(made.images), strict=True):
        image = made.images[number]
        camera = made.cameras[image.camera_id]
        camera_from_ours, fx, fy, cx, cy = view.pinhole()
        np.testing.assert_allclose(
            (camera_from_ours @ HALF)[:3], image.cam_from_world().matrix(), atol=1e-9
        )
        assert (fx, fy) == pytest.approx((camera.focal_length_x, camera.focal_length_y))
        assert (cx, cy) == pytest.approx((camera.principal_point_x, camera.principal_point_y))
    assert any("distortion" in note for note in got.notes) == any(
        any(camera.params[3:]) for camera in made.cameras.values()
    )


def test_every_lens_of_colmap_has_its_numbers():
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    from shapeshift.scene.captures.colmap_tables import LENSES

    for number, (name, focals, count) in LENSES.items():
        kind = getattr(pycolmap.CameraModelId, name)
        info = pycolmap.Camera.create_from_model_id(1, kind, 1.0, 10, 10).params_info.split(", ")
        assert int(kind) == number and len(info) == count
        assert info[:focals] == (["fx", "fy"] if focals == 2 else ["f"])
        assert info[focals : focals + 2] == ["cx", "cy"]


def colmap(folder: Path) -> Path:
    write_cameras(cameras(), folder, "colmap-bin")
    return folder / "sparse/0"


@pytest.mark.parametrize("table", ["cameras", "images"])
def test_a_table_cut_anywhere_is_one_sentence(tmp_path, table):
    folder = colmap(tmp_path)
    path = folder / f"{table}.bin"
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(BadFile) as refused:
            read_camera_list(folder)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("count", [1 << 20, 1 << 40, (1 << 64) - 1])
@pytest.mark.parametrize("table", ["cameras", "images"])
def test_a_lying_count_takes_no_memory(tmp_path, table, count):
    folder = colmap(tmp_path)
    path = folder / f"{table}.bin"
    path.write_bytes(count.to_bytes(8, "little") + path.read_bytes()[8:])
    with pytest.raises(BadFile, match="claims"):
        read_camera_list(folder)


def test_points_that_lie_or_are_cut(tmp_path):
    path = tmp_path / "points3D.bin"
    point = struct.pack("<Q3d3BdQ", 7, 1.0, 2.0, 3.0, 10, 20, 30, 0.5, 2) + bytes(16)
    earlier = struct.pack("<Q3d3BdQ", 3, 4.0, 5.0, 6.0, 40, 50, 60, 0.5, 0)
    whole = struct.pack("<Q", 2) + point + earlier
    path.write_bytes(whole)
    xyz, rgb = read_colmap_points(path)  # in the order of their numbers
    np.testing.assert_array_equal(xyz, [[4, 5, 6], [1, 2, 3]])
    np.testing.assert_array_equal(rgb, [[40, 50, 60], [10, 20, 30]])
    lies = [whole[:length] for length in range(len(whole))]
    lies += [struct.pack("<Q", 1 << 40) + whole[8:]]
    lies += [
        whole.replace(struct.pack("<Q", 2) + bytes(16), struct.pack("<Q", 1 << 50) + bytes(16))
    ]
    for data in lies:
        path.write_bytes(data)
        with pytest.raises(BadFile):
            read_colmap_points(path)
    path.write_bytes(struct.pack("<Q", 0))
    assert [len(a) for a in read_colmap_points(path)] == [0, 0]
    text = tmp_path / "points3D.txt"
    text.write_text("# a\n7 1 2 3 10 20 30 0.5 1 2 3 4\n\n3 4 5 6 40 50 60 0.5\n")
    for got, wanted in zip(read_colmap_points(text), (xyz, rgb), strict=True):
        np.testing.assert_array_equal(got, wanted)
    for line in ("7 1 2 3 10 20 30", "7 1 x 3 10 20 30 0.5", "7 1 nan 3 10 20 30 0.5"):
        text.write_text(line)
        with pytest.raises(BadFile, match="line 1"):
            read_colmap_points(text)


TEXTS = {
    "cameras": {
        "1 PINHOLE 10 10 1 1 5": "has 4 numbers",
        "1 NEWER 10 10 1 1 5": "no camera model",
        "1 PINHOLE 10 10 1 one 5 5": "not",
        "1 PINHOLE 10 10 0 1 5 5": "focal lengths",
        "1 PINHOLE 0 10 1 1 5 5": "size",
        "1 PINHOLE 99999 10 1 1 5 5": "65536",
        "2 PINHOLE 10 10 1 1 5 5": "absent",
        "1": "no camera model",
    },
    "images": {
        "1 1 0 0 0 0 0 0 1": "9 numbers and a name",
        "1 0 0 0 0 0 0 0 1 a.png": "no rotation",
        "1 1 0 0 0 0 0 nan 1 a.png": "should be numbers",
        "1 1 0 0 0 0 0 1e999 1 a.png": "should be numbers",
        "# nothing": "no posed image",
    },
}
GOOD = {"cameras": "1 PINHOLE 10 10 1 1 5 5", "images": "1 1 0 0 0 0 0 0 1 a b.png\n"}


@pytest.mark.parametrize(
    ("table", "line"), [(t, line) for t, rows in TEXTS.items() for line in rows]
)
def test_broken_lines_of_text_are_one_sentence(tmp_path, table, line):
    for name, text in (GOOD | {table: line}).items():
        (tmp_path / f"{name}.txt").write_text(text)
    with pytest.raises(BadFile, match=TEXTS[table][line]) as refused:
        read_camera_list(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_model_is_named_by_folder_or_by_any_of_its_files(tmp_path):
    for name, text in GOOD.items():
        (tmp_path / f"{name}.txt").write_text(text)
    (tmp_path / "points3D.txt").write_text("")
    for path in (tmp_path, *tmp_path.glob("*.txt")):
        assert read_camera_list(path).names == ("a b.png",)
    (tmp_path / "cameras.txt").unlink()
    with pytest.raises(BadFile, match=r"cameras\.txt is missing"):
        read_camera_list(tmp_path / "images.txt")
    (tmp_path / "cameras.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadFile, match="not text"):
        read_camera_list(tmp_path / "images.txt")
