"""COLMAP's text tables in every shape in which they arrive; pycolmap reads the well-formed ones."""

import shutil

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.colmap_cameras import camera_pose
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.captures.capture_rules import rigid
from shapeshift.scene.captures.colmap.colmap_files import read_colmap_points
from shapeshift.scene.captures.colmap_tables import read_tables
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.captures import colmap_model
from tests.support.scene.colmap_texts import EVERY, IMAGES, NAMES, PAGES, named, well_formed


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """The folder of well-formed tables, and what pycolmap reads of them."""
    import pycolmap

    folder = tmp_path_factory.mktemp("good")
    well_formed(folder)
    return folder, pycolmap.Reconstruction(folder)


def copied(source, folder):
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        shutil.copy(source / name, folder)
    return folder


def assert_as_colmap(folder, model) -> None:
    lenses, posed = read_tables(folder, ".txt")
    assert [image.number for image in posed] == sorted(model.images)
    for image in posed:
        theirs = model.images[image.number]
        assert (image.name, image.lens) == (theirs.name, theirs.camera_id)
        world_from_camera = rigid(camera_pose(image, image.name), image.name)
        np.testing.assert_allclose(
            np.linalg.inv(world_from_camera)[:3], theirs.cam_from_world().matrix(), atol=1e-9
        )
    for number, lens in lenses.items():
        theirs = model.cameras[number]
        assert (lens.model, lens.size) == (theirs.model_name, (theirs.width, theirs.height))
        assert lens.params == pytest.approx(tuple(theirs.params), rel=1e-15)
    xyz, _ = read_colmap_points(folder / "points3D.txt")
    np.testing.assert_allclose(xyz, [model.points3D[n].xyz for n in sorted(model.points3D)])


@pytest.mark.parametrize("how", EVERY)
def test_tables_are_read_however_their_lines_end(tmp_path, good, how):
    folder = copied(good[0], tmp_path)
    for path in folder.glob("*.txt"):
        path.write_bytes(EVERY[how](path.read_bytes()))
    assert_as_colmap(folder, good[1])


@pytest.mark.parametrize("how", IMAGES)
@pytest.mark.parametrize("ends", ["LF", "CR LF", "CR CR LF"])
def test_lines_of_images_are_told_from_those_of_points(tmp_path, good, how, ends):
    path = copied(good[0], tmp_path) / "images.txt"
    data = IMAGES[how](path.read_bytes())
    ends = ends.replace("CR", "\r").replace("LF", "\n").replace(" ", "").encode()
    path.write_bytes(data.replace(b"\r\n", b"\n").replace(b"\n", ends))
    assert_as_colmap(tmp_path, good[1])


@pytest.mark.parametrize("points", [b"", b"\n", b"12 13 -1 14 15 7\n"], ids=["none", "", "two"])
def test_names_may_be_anything_but_empty(tmp_path, points):
    """Names of numbers, too: 10 and 11 words are no points, and pose-like numbers are a pose."""
    folder = tmp_path
    (folder / "cameras.txt").write_text("1 PINHOLE 10 10 1 1 5 5")
    names = (*NAMES, "1 2 3")  # with nine numbers before it: twelve, as of four points
    rows = b"".join(f"{i} 0.6 0 0.8 0 1 2 3 1 {n}\n".encode() + points for i, n in enumerate(names))
    (folder / "images.txt").write_bytes(rows)
    assert [image.name for image in read_tables(folder, ".txt")[1]] == list(names)


@pytest.mark.parametrize("zero", ["0 0 0 0", "-0 0 0 0", "1e-400 0 0 0"])
def test_a_quaternion_without_direction_is_refused(tmp_path, zero):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 10 10 1 1 5 5")
    (tmp_path / "images.txt").write_text(f"1 {zero} 0 0 0 1 a.png\n\n")
    with pytest.raises(BadFile, match=r"a\.png: its pose is no rotation"):
        read_camera_list(tmp_path)


@pytest.mark.parametrize("length", [1.02, 5e-324, 1e-310, 1e300])
def test_other_lengths_than_1_are_said(tmp_path, length):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 10 10 1 1 5 5")
    (tmp_path / "images.txt").write_text(f"1 0 {length} 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 0 1 b\n")
    cameras = read_camera_list(tmp_path)
    (said,) = cameras.notes
    assert said.startswith("1 of 2 quaternions have another length than 1")
    assert np.isfinite(cameras.views[0].world_from_eye.matrix()).all()


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ("1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 0 1\n\n", 3),  # a name is missing
        ("1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1\n", 2),
        ("1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 1 b.png\n", 2),  # a number is missing
        ("1 1 0 0 0 0 0 0 1 a.png\n\n1 1 0 0 0 0 0 x 1 b.png\n", 3),
        ("1 2 3\n1 1 0 0 0 0 0 0 1 a.png\n", 1),  # points of no image
        ("1 1 0 0 0 0 0 0 1 a.png\n1 2 3\n1 2 3\n", 3),  # of one image twice
        ("1 1 0 0 0 0 0 0 1 a.png\n1 2\n", 2),
    ],
)
def test_what_is_neither_image_nor_points_is_refused(tmp_path, rows, line):
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 10 10 1 1 5 5")
    (tmp_path / "images.txt").write_text(rows)
    with pytest.raises(BadFile, match=rf"images\.txt, line {line}: ") as refused:
        read_tables(tmp_path, ".txt")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.parametrize("text", [True, False], ids=["txt", "bin"])
def test_names_in_a_code_page_find_their_photos(tmp_path, page, text):
    """Text and binary tables hold the bytes of the machine that wrote them; files have Unicode."""
    colmap_model(tmp_path, text)
    (tmp_path / "images/rgb/1.png").rename(tmp_path / "images/rgb" / PAGES[page])
    other = b"rgb/" + PAGES[page].encode(page)
    path = tmp_path / "sparse/0" / ("images.txt" if text else "images.bin")
    if text:
        named(path.parent, {"rgb/1.png": other})
    else:
        path.write_bytes(path.read_bytes().replace(b"rgb/1.png\0", other + b"\0"))
    capture = read_capture(tmp_path)
    assert PAGES[page] in {photo.path.name for photo in capture.photos}
    assert len(capture.photos) == 7 and not any("not there" in d for d in capture.doubts)


def test_names_of_no_code_page_are_said_to_be_missing(tmp_path):
    colmap_model(tmp_path, True)
    named(tmp_path / "sparse/0", {"rgb/1.png": b"rgb/\x81\xff\xfe.png"})
    capture = read_capture(tmp_path)
    assert any("1 of 7 photos" in said for said in capture.doubts)


def test_a_line_that_is_no_name_is_refused(tmp_path):
    """Points but for their last word, a million letters: longer than a name can be."""
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 10 10 1 1 5 5")
    rows = "1 1 0 0 0 0 0 0 1 a.png\n" + "1 2 3 " * 200_000 + "x\n"
    (tmp_path / "images.txt").write_text(rows)
    with pytest.raises(BadFile, match="line 2"):
        read_tables(tmp_path, ".txt")
