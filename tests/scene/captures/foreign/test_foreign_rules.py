"""Which file of another program is used, what is left out and said, and what is refused."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.camera_list import CameraReading
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene import foreign_files as write
from tests.support.scene.foreign_files import SIZE, make_shots, save_photos

SHOTS = make_shots()
PLAIN = {"f": 38.0}
CAMERA = {"projection_type": "perspective", "focal": 0.9, "k1": 0.0, "k2": 0.0}


@pytest.fixture
def photos(tmp_path) -> Path:
    save_photos(tmp_path / "photos", SHOTS)
    return tmp_path / "photos"


def names(capture) -> set[str]:
    return {photo.path.name for photo in capture.photos}


def said(capture) -> str:
    return " ".join(capture.doubts)


ALL = {shot.name for shot in SHOTS}


@pytest.mark.parametrize("place", [".", "metashape", ".."])
def test_a_file_beside_below_and_above_the_photos_is_used_and_named(photos, place):
    write.metashape(photos / place, SHOTS, PLAIN)
    capture = read_capture(photos)
    assert names(capture) == ALL
    assert "The poses are those of Metashape" in said(capture) and "cameras.xml" in said(capture)


@pytest.mark.parametrize("place", [".", "metashape", ".."])
def test_the_file_itself_can_be_named(photos, place):
    file = write.metashape(photos / place, SHOTS, PLAIN)
    assert names(read_capture(file)) == ALL


def test_a_file_above_of_other_photos_is_not_taken(photos):
    write.metashape(photos.parent, make_shots(3), PLAIN, label=lambda name: f"other_{name}")
    with pytest.raises(BadFile, match="photos without poses"):
        read_capture(photos)


def test_our_own_table_comes_before(photos):
    write.metashape(photos, SHOTS, PLAIN)
    frames = [
        {"file_path": s.name, "transform_matrix": s.pose.tolist(), "fl_x": 38.0} for s in SHOTS
    ]
    (photos / "transforms.json").write_text(json.dumps({"frames": frames}))
    assert "Metashape" not in said(read_capture(photos))


def test_the_newest_of_two_is_used_and_the_other_named(photos):
    old = write.metashape(photos, SHOTS, PLAIN)
    new = write.bundler(photos, SHOTS, (38.0, 0.0, 0.0))
    for first, last, program in ((old, new, "Bundler"), (new, old, "Metashape")):
        os.utime(first, (1_000_000, 1_000_000))
        os.utime(last, (2_000_000, 2_000_000))
        capture = read_capture(photos)
        assert f"The poses are those of {program}" in said(capture)
        assert f"Beside it lie {first.name} (" in said(capture)


def test_photos_without_pose_and_missing_photos_are_counted(photos):
    write.metashape(photos, SHOTS, PLAIN, lost={SHOTS[0].name})
    (photos / SHOTS[1].name).unlink()
    capture = read_capture(photos)
    assert names(capture) == ALL - {SHOTS[0].name, SHOTS[1].name}
    assert "1 of 5 photos" in said(capture) and "are not aligned" in said(capture)
    assert "1 of 4 photos that the capture names are not there" in said(capture)


def test_photos_in_folders_are_found_by_their_names_alone(photos):
    for i, shot in enumerate(SHOTS):
        place = photos / f"card {i % 2}"
        place.mkdir(exist_ok=True)
        shutil.move(photos / shot.name, place / shot.name)
        (photos / "masks").mkdir(exist_ok=True)
        shutil.copy(place / shot.name, photos / "masks" / shot.name)
    for make in (
        lambda: write.metashape(photos, SHOTS, PLAIN, label=lambda n: Path(n).stem),
        lambda: write.blocks(photos, SHOTS, {k: 20.0 for k in "fxy"} | dict.fromkeys(
            ("K1", "K2", "K3", "P1", "P2"), 0.0)),
    ):  # fmt: skip
        file = make()
        assert names(read_capture(photos)) == ALL
        file.unlink()


def test_two_photos_of_one_name_are_told_by_the_group_or_by_their_size(photos):
    """Metashape's labels have no folders."""
    heat = photos / "thermal"
    save_photos(heat, SHOTS, (20, 15))
    write.metashape(photos, SHOTS, PLAIN, label=lambda n: Path(n).stem)
    capture = read_capture(photos)
    assert {p.path.parent for p in capture.photos} == {photos}  # of 40x30, as its sensor
    shutil.rmtree(heat)
    save_photos(heat, SHOTS)
    with pytest.raises(BadFile, match=r"5 of 5 photos.* have names that several"):
        read_capture(photos)
    file = photos / "cameras.xml"
    text = file.read_text().replace("<cameras>", '<cameras><group id="0" label="thermal">')
    file.write_text(text.replace("</cameras>", "</group></cameras>"))
    assert {p.path.parent for p in read_capture(photos).photos} == {heat}


def test_copies_that_opensfm_makes_are_not_taken_for_photos(photos):
    save_photos(photos / "undistorted/images", SHOTS)
    write.opensfm(photos, SHOTS, CAMERA)
    assert {p.path.parent for p in read_capture(photos).photos} == {photos}
    write.opensfm(photos / "undistorted", SHOTS, CAMERA)
    found = read_capture(photos / "undistorted").photos
    assert {p.path.parent for p in found} == {photos / "undistorted/images"}


@pytest.mark.parametrize("name", [".", "..", "/", "a\\u0000b.png", "../" * 40 + "etc/x.png", "C:"])
def test_names_that_are_none_are_photos_that_are_not_there(photos, name):
    file = write.openmvg(photos, SHOTS, (38.0, 20.0, 15.0), "pinhole", {})
    file.write_text(file.read_text().replace(SHOTS[0].name, name))
    capture = read_capture(photos)
    assert names(capture) == ALL - {SHOTS[0].name}
    assert "1 of 5 photos that the capture names are not there" in said(capture)


def test_degrees_are_refused(photos):
    """11.6 E, 48.1 N: 100 m are 0.001 degrees."""
    lens = dict.fromkeys(("px", "py", "k1", "k2", "k3", "k4", "t1", "t2"), 0.0) | {"f": 36.0}
    flown = [replace(s, centre=s.centre * (1e-4, 1e-4, 20) + (11.6, 48.1, 500)) for s in SHOTS]
    write.realityscan(photos, flown, lens)
    with pytest.raises(BadFile, match="look like degrees"):
        read_capture(photos)


def test_a_lens_that_no_used_camera_has_may_be_broken(photos):
    file = write.metashape(photos, SHOTS, PLAIN)
    text = file.read_text()
    start, end = text.index('<sensor id="0"'), text.index("</sensors>")
    other = text[start:end].replace('id="0"', 'id="5"').replace("<f>38.0</f>", "<f>0</f>")
    file.write_text(text[:end] + other + text[end:])
    assert names(read_capture(photos)) == ALL


def test_the_largest_of_several_reconstructions_is_used(photos):
    small = {"cameras": {"v2 c": CAMERA | {"width": 40, "height": 30}},
             "shots": write.shots_json(SHOTS[:1])}  # fmt: skip
    write.opensfm(photos, SHOTS, CAMERA, [small])
    capture = read_capture(photos)
    assert names(capture) == ALL and "the largest is used, 5 of 6 photos" in said(capture)


def test_points_lie_where_their_cameras_do(photos):
    """One point of the file, by the turn from z up to y up: (x, y, z) becomes (x, z, -y)."""
    write.opensfm(photos, SHOTS, CAMERA)
    capture = read_capture(photos)
    assert np.allclose(capture.points, [[0.5, 0.125, -0.25]], atol=1e-6)
    assert np.allclose(capture.point_colors, [[1, 0, 0.2]])


def test_survey_coordinates_keep_their_places(photos):
    far = make_shots(middle=(512345.5, 5412345.25, 431.0))
    write.realityscan(photos, far, dict.fromkeys(("px", "py", "k1", "k2", "k3", "k4", "t1", "t2"),
                                                 0.0) | {"f": 36.0})  # fmt: skip
    capture = read_capture(photos)
    x, y, z = np.array(capture.origin) + capture.photos[0].view.world_from_eye.position
    assert np.abs(np.array([x, -z, y]) - far[0].centre).max() < 1e-6
    assert max(map(abs, capture.photos[0].view.world_from_eye.position)) < 1000


def test_photos_that_a_file_names_by_whole_paths_are_used_where_they_are(tmp_path):
    """Meshroom's cache lies elsewhere."""
    save_photos(tmp_path / "photos", SHOTS)
    file = write.alicevision(
        tmp_path / "MeshroomCache/StructureFromMotion/a1", SHOTS, (1, 0, 0),
        {"type": "radial1", "pxFocalLength": "37", "principalPoint": ["20", "15"],
         "distortionParams": ["0"]},
    )  # fmt: skip
    file.write_text(file.read_text().replace("/home/them/photos", str(tmp_path / "photos")))
    assert {p.path for p in read_capture(file).photos} == {tmp_path / "photos" / n for n in ALL}


BOMB = """<?xml version="1.0"?><!DOCTYPE document [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>"""


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (lambda t: t.replace('<?xml version="1.0" encoding="UTF-8"?>', BOMB), "DOCTYPE"),
        (lambda t: t[: len(t) // 2], "is no XML"),
        (lambda t: t.replace("</f>", "x</f>"), "f is '38.0x'; a number is wanted"),
        (lambda t: t.replace("38.0", "nan"), "f is 'nan'; a number is wanted"),
        (lambda t: t.replace("38.0", "0"), "both must be above 0"),
        (lambda t: t.replace("<transform>", "<transform>1 "), "16 numbers are wanted"),
        (lambda t: t.replace('width="40"', 'width="-4"'), "-4x30 pixels"),
        (lambda t: t.replace("<cameras>", "<cameras>" + "<a>" * 200 + "</a>" * 200), "100 deep"),
    ],
)
def test_broken_xml_is_one_sentence(photos, change, wanted):
    file = write.metashape(photos, SHOTS, PLAIN)
    file.write_text(change(file.read_text()))
    with pytest.raises(BadFile, match=wanted) as caught:
        read_capture(photos)
    assert "\n" not in str(caught.value)


def test_xml_of_a_gigabyte_is_refused_before_it_is_read(photos, monkeypatch):
    """A sparse file: charged by its size."""
    file = write.metashape(photos, SHOTS, PLAIN)
    with file.open("r+b") as open_file:
        open_file.truncate(900 << 20)
    monkeypatch.setenv("SHAPESHIFT_MEMORY", "2")
    with pytest.raises(BadFile, match="of memory"):
        read_capture(photos)


@pytest.mark.parametrize(
    ("make", "change", "wanted"),
    [
        (lambda d: write.bundler(d, SHOTS, (38.0, 0.0, 0.0)), ("\n5 1\n", "\n9999999 1\n"),
         "claims"),
        (lambda d: write.bundler(d, SHOTS, (38.0, 0.0, 0.0)), ("38.0", "inf"), "'inf' stands"),
        (lambda d: write.bundler(d, SHOTS, (38.0, 0.0, 0.0)), ("\n2 0 1 1", "\n900 0 1 1"), "ends"),
        (lambda d: write.openmvg(d, SHOTS, (38.0, 20.0, 15.0), "pinhole", {}),
         ('"key": 0', '"key": [0]'), "lens|pose"),
        (lambda d: write.nvm(d, SHOTS, 38.0, 0.0), ("38.0", "x"), "'x' stands"),
        (lambda d: write.nvm(d, SHOTS, 38.0, 0.0), ("\n5\n", "\n6\n"), "no name with ten numbers"),
        (lambda d: write.opensfm(d, SHOTS, CAMERA),
         ('"rotation": [', '"rotation": [NaN, '), "rotation"),
        (lambda d: write.openmvg(d, SHOTS, (38.0, 20.0, 15.0), "pinhole", {}),
         ('"center": [', '"center": [Infinity, '), "center"),
        (lambda d: write.alicevision(d, SHOTS, (1, 0, 0), {
            "type": "radial1", "pxFocalLength": "37", "principalPoint": ["20", "15"],
            "distortionParams": ["0"]}), ('"37"', '"1e999"'), "pxFocalLength"),
    ],
)  # fmt: skip
def test_broken_numbers_are_one_sentence(photos, make, change, wanted):
    file = make(photos)
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(BadFile, match=wanted):
        read_capture(photos)


@pytest.mark.parametrize(
    ("name", "content", "program"),
    [
        ("site.psx", b"<document/>", "Metashape"), ("a.rcproj", b"x", "RealityScan"),
        ("flight.p4d", b"<pix4d/>", "Pix4D"), ("x.zep", b"x", "3DF Zephyr"),
        ("database.db", b"SQLite format 3\0", "COLMAP's data base"), ("a.mg", b"{}", "Meshroom"),
        ("cameras.abc", b"Ogawa", "Alembic"), ("predictions.npz", b"PK", "VGGT"),
        ("sfm_data.bin", b"x", "OpenMVG"), ("frames.pb", b"x", "Scaniverse"),
        ("opk.txt", b"PhotoID, X, Y, Z, Omega, Phi, Kappa", "omega, phi and kappa"),
        ("odometry.csv", b"timestamp, frame", "Stray Scanner"),
        ("site_pmatrix.txt", b"a.jpg 1 2 3", "Pix4D"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named_with_the_way_there(photos, name, content, program):
    (photos / name).write_bytes(content)
    for path in (photos, photos / name):
        with pytest.raises(BadFile, match=program):
            read_capture(path)
    with pytest.raises(BadFile, match=program):
        read_camera_list(photos / name)


def test_cameras_are_read_from_the_same_files_without_photos(tmp_path):
    file = write.metashape(tmp_path, SHOTS, PLAIN)
    for path in (file, tmp_path):
        found = read_camera_list(path)
        assert found.format == "Metashape" and len(found.views) == len(SHOTS)
        assert found.names[0] == SHOTS[0].name and found.views[0].size == SIZE
    turned = read_camera_list(file, CameraReading(up="+Z"))
    assert np.allclose(
        turned.views[0].world_from_eye.position, SHOTS[0].centre[[0, 2, 1]] * (1, 1, -1)
    )
    with pytest.raises(BadFile, match="does not say how many pixels"):
        read_camera_list(write.bundler(tmp_path / "b", SHOTS, (38.0, 0, 0)))


def test_a_wide_photo_of_another_size_has_its_lens_scaled(photos):
    """Half the pixels a side, as exports for training have."""
    write.metashape(photos, SHOTS, PLAIN)
    for shot in SHOTS:
        with Image.open(photos / shot.name) as image:
            image.resize((20, 15)).save(photos / shot.name)
    capture = read_capture(photos)
    assert capture.photos[0].view.size == (20, 15)
    assert np.isclose(capture.photos[0].view.pinhole()[1], 19)


TABLES = {
    "realityscan": lambda d, s: write.realityscan(
        d, s, dict.fromkeys(("px", "py", "k1", "k2", "k3", "k4", "t1", "t2"), 0.0) | {"f": 34.0}
    ),
    "bundler": lambda d, s: write.bundler(d, s, (38.0, 0.0, 0.0)),
    "nvm": lambda d, s: write.nvm(d, s, 37.0, 0.0),
    "pix4d": lambda d, s: write.pix4d(
        d, s, (37, 20, 15, (0, 0, 0), (0, 0)), s[0].centre
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", TABLES)
@pytest.mark.parametrize("encoding,letter", [
    ("utf-16", "ä"), ("cp1252", "ä"), ("cp1251", "я"), ("cp932", "橋"), ("utf-8-sig", "橋"),
])  # fmt: skip
def test_tables_of_text_in_any_encoding_and_with_any_line_ends(tmp_path, form, encoding, letter):
    shots = [replace(shot, name=f"{letter}_{shot.name}") for shot in SHOTS]
    save_photos(tmp_path, shots)
    before = set(tmp_path.iterdir())
    TABLES[form](tmp_path, shots)
    for path in set(tmp_path.iterdir()) - before:
        text = path.read_text("utf-8-sig").replace("\n", "\r")
        path.write_bytes(text.encode(encoding))
    assert names(read_capture(tmp_path)) == {shot.name for shot in shots}


def test_a_table_with_decimal_commas_is_refused_as_such(photos):
    path = TABLES["realityscan"](photos, SHOTS)
    head, *rows = path.read_text().splitlines()
    name = SHOTS[0].name
    row = f"{name}{rows[0].removeprefix(name).replace('.', ',')}"
    path.write_text(f"{head}\n{row}\n")
    with pytest.raises(BadFile, match=r"line 2: 31 columns, the first line names 16; .*points"):
        read_capture(photos)
