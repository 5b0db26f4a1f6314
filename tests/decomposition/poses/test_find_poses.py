"""Poses from photos: against the camera path of a traced room, and against captures of others."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pycolmap", reason="pycolmap is not installed")

import shapeshift as ss
from shapeshift.decomposition.poses.find_poses import (
    Length,
    PoseSettings,
    count_pairs,
    find_poses,
    model_length,
)
from shapeshift.decomposition.poses.photo_list import list_photos
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.read_capture import read_capture
from tests.support.scene.textured_room import FOCAL, SIZE, camera, fitted, hits, write_photos

COUNT = 8
DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
ENDS = ((100.0, 60.0), (220.0, 70.0))  # pixels, one on each wall


def quiet(*_: object) -> None:
    pass


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> tuple[Path, list[np.ndarray]]:
    folder = tmp_path_factory.mktemp("room") / "photos"
    return folder, write_photos(folder, COUNT)


@pytest.fixture(scope="module")
def capture(room, tmp_path_factory):
    """The folder written with a known length, and the report."""
    folder, poses = room
    places, _ = hits(poses[3], np.array(ENDS))
    metres = float(np.linalg.norm(places[0] - places[1]))
    out = tmp_path_factory.mktemp("found") / "capture"
    settings = PoseSettings(length=Length(metres, "03.png", ENDS), threads=2)
    return out, find_poses(list_photos(folder), out, settings, quiet)


def poses_of(folder: Path) -> tuple[list[str], np.ndarray]:
    """Names, and (N, 4, 4) world from camera in OpenCV axes, the world +Y up."""
    photos = sorted(read_capture(folder).photos, key=lambda photo: photo.path.name)
    flip = np.diag([1.0, -1, -1, 1])
    return [p.path.stem for p in photos], np.array(
        [p.view.world_from_eye.matrix() @ flip for p in photos]
    )


def compare(
    found: np.ndarray, true: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Scale, turn of the world, degrees of each photo, and places as shares of their spread."""
    scale, turn, _, left = fitted(found[:, :3, 3], true[:, :3, 3])
    cosine = (np.einsum("nij,nij->n", turn @ found[:, :3, :3], true[:, :3, :3]) - 1) / 2
    spread = np.linalg.norm(true[:, :3, 3] - true[:, :3, 3].mean(axis=0), axis=1).mean()
    return scale, turn, np.degrees(np.arccos(np.clip(cosine, -1, 1))), left / spread


def test_a_room_is_found_upright_and_in_metres(room, capture):
    """Photos of 320x240: a feature is placed to about 0.2 px of 300, 0.04 degrees."""
    out, report = capture
    assert report.placed == report.photos == COUNT
    assert not report.left_out and not report.few_points and report.error_px < 0.5
    names, found = poses_of(out)
    assert names == [f"{i:02d}" for i in range(COUNT)]
    scale, turn, degrees, places = compare(found, np.array(room[1]))
    assert np.median(degrees) < 0.2 and degrees.max() < 0.5
    assert np.median(places) < 0.005 and places.max() < 0.02
    assert scale == pytest.approx(1, abs=0.02)  # metres, by one length of 120 px between points
    tilt = np.degrees(np.arccos(turn[1, 1]))
    assert tilt < 1, "the cameras are level, so what they call level is"
    assert "03.png" in report.scale
    view = read_capture(out).photos[0].view
    assert view.pinhole()[1] == pytest.approx(FOCAL, rel=0.02)


def test_what_is_written_is_whole_and_nothing_else(capture):
    out, report = capture
    assert {p.name for p in out.iterdir()} == {"images", "sparse", "poses.json"}
    assert {p.name for p in (out / "sparse/0").iterdir()} == {
        "cameras.bin", "images.bin", "points3D.bin"}  # fmt: skip
    assert json.loads((out / "poses.json").read_text())["placed"] == report.placed
    assert len(read_capture(out).points) == report.points > 200


def test_points_lie_on_the_walls_of_the_room(room, capture):
    """An oracle beside the cameras: the traced walls are three planes, to a centimetre."""
    out, _ = capture
    _, found = poses_of(out)
    scale, turn, shift, _ = fitted(found[:, :3, 3], np.array(room[1])[:, :3, 3])
    points = scale * read_capture(out).points @ turn.T + shift
    beside = np.abs(points).min(axis=1)
    assert np.median(beside) < 0.01 and np.percentile(beside, 90) < 0.04


def test_the_library_finds_the_same(room, capture, tmp_path):
    """Bit for bit by the same seed, whatever the threads: eight have two cores to end in turn."""
    report = capture[1]
    found = ss.poses(room[0], tmp_path / "out", threads=2)
    for threads in (1, 8):
        ss.poses(room[0], tmp_path / f"{threads}", threads=threads)
        for name in ("cameras.bin", "images.bin", "points3D.bin"):
            first, other = ((tmp_path / of / "sparse/0" / name) for of in ("out", f"{threads}"))
            assert first.read_bytes() == other.read_bytes(), (threads, name)
    assert (found.placed, found.points) == (report.placed, report.points)
    assert found.error_px == report.error_px and "arbitrary" in found.scale
    with pytest.raises(ss.UsageError, match="is not empty"):
        ss.poses(room[0], tmp_path / "out")
    with pytest.raises(ss.UsageError, match="lens_model"):
        ss.poses(room[0], tmp_path / "new", lens_model="OPENCV")


def test_pycolmap_reads_the_model(capture):
    import pycolmap

    model = pycolmap.Reconstruction(str(capture[0] / "sparse/0"))
    assert model.num_reg_images() == COUNT and model.compute_mean_reprojection_error() < 0.5


def test_a_thermal_camera_gets_the_poses_of_its_pairs(room, tmp_path):
    """A drone's pairs in one folder below another: heat is not searched, and the capture says in
    its capture.json which photos are of which stop, so that a reader has to guess nothing."""
    root, taken = tmp_path / "flight", (0, 2, 4, 6, 7)
    for i in taken:
        for letter, size in (("V", SIZE), ("T", (80, 60))):
            (root / "hall").mkdir(parents=True, exist_ok=True)
            picture = Image.open(room[0] / f"{i:02d}.png").resize(size)
            picture.save(root / f"hall/DJI_000{i}_{letter}.png")
    Image.new("RGB", (8, 8)).save(root / "note.png")
    photos = list_photos(root)
    assert (len(photos.photos), len(photos.paired)) == (6, 5)
    out = tmp_path / "capture"
    report = find_poses(photos, out, PoseSettings(threads=2), quiet)
    assert report.paired == report.placed == 5 and report.left_out == ["note.png"]
    said = json.loads((out / "capture.json").read_text())["modalities"]
    assert [(row["name"], row["photos"]) for row in said] == [
        ("RGB", "DJI_*_V.*"), ("Thermal", "DJI_*_T.*")]  # fmt: skip
    read = read_capture(out)
    assert [(stop.name, stop.kind) for stop in read.stops] == [
        ("RGB", "rgb"),
        ("Thermal", "thermal"),
    ]
    by_name = {(p.modality, p.path.name): p.view for p in read.photos}
    for i in taken:
        one = by_name["RGB", f"DJI_000{i}_V.png"]
        other = by_name["Thermal", f"DJI_000{i}_T.png"]
        np.testing.assert_allclose(one.world_from_eye.matrix(), other.world_from_eye.matrix())
        assert other.pinhole()[1] * 4 == pytest.approx(one.pinhole()[1], rel=1e-6)


def test_a_photo_of_something_else_is_named(room, tmp_path):
    root = tmp_path / "photos"
    root.mkdir()
    for i in range(COUNT):
        os.link(room[0] / f"{i:02d}.png", root / f"{i:02d}.png")
    noise = np.random.default_rng(9).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
    Image.fromarray(noise).save(root / "other.png")
    report = find_poses(list_photos(root), tmp_path / "out", PoseSettings(threads=2), quiet)
    assert report.left_out == ["other.png"] and report.placed == COUNT
    assert not (tmp_path / "out/images/other.png").exists()


def test_a_mask_hides_what_moves_and_comes_along(room, tmp_path):
    masks = tmp_path / "masks"
    masks.mkdir()
    half = np.full((SIZE[1], SIZE[0]), 255, np.uint8)
    half[:, :60] = 0
    for i in range(COUNT):
        Image.fromarray(half).save(masks / f"{i:02d}.png")
    settings = PoseSettings(masks=masks, threads=2)
    report = find_poses(list_photos(room[0]), tmp_path / "out", settings, quiet)
    assert report.placed == COUNT
    assert all(photo.mask is not None for photo in read_capture(tmp_path / "out").photos)
    import pycolmap

    model = pycolmap.Reconstruction(str(tmp_path / "out/sparse/0"))
    seen = np.array([p.xy for image in model.images.values() for p in image.points2D])
    assert len(seen) > 500 and seen[:, 0].min() >= 59


def test_straight_photos_are_of_pinhole_cameras(room, tmp_path):
    settings = PoseSettings(straight=True, threads=2)
    find_poses(list_photos(room[0]), tmp_path / "out", settings, quiet)
    import pycolmap

    model = pycolmap.Reconstruction(str(tmp_path / "out/sparse/0"))
    assert {c.model.name for c in model.cameras.values()} == {"PINHOLE"}
    assert not any(photo.lens for photo in read_capture(tmp_path / "out").photos)


def test_photos_that_share_nothing_are_refused_and_the_search_is_kept(tmp_path):
    root, rng = tmp_path / "photos", np.random.default_rng(3)
    root.mkdir()
    for i in range(4):
        noise = Image.fromarray(rng.integers(0, 255, (30, 40, 3), np.uint8)).resize(SIZE)
        noise.save(root / f"{i}.png")
    with pytest.raises(BadFile, match="no two of its 4 photos could be placed"):
        find_poses(list_photos(root), tmp_path / "out", PoseSettings(threads=2), quiet)
    assert not (tmp_path / "out/sparse").exists() and not (tmp_path / "out/images").exists()


def test_an_unfinished_search_goes_on_and_no_other_takes_its_place(room, tmp_path):
    """Interrupted when all features are there, the second run computes none anew."""
    out = tmp_path / "out"

    def interrupt(what: str, done: int, of: int) -> None:
        if what.startswith("poses"):
            raise KeyboardInterrupt

    photos = list_photos(room[0])
    with pytest.raises(KeyboardInterrupt):
        find_poses(photos, out, PoseSettings(threads=2), interrupt)
    database = out / "poses.work/database.db"
    before = database.read_bytes()
    with pytest.raises(BadFile, match="unfinished search with other photos"):
        find_poses(photos, out, PoseSettings(threads=2, side=800), quiet)
    assert database.read_bytes() == before
    stages = []
    report = find_poses(photos, out, PoseSettings(threads=2), lambda *say: stages.append(say))
    assert report.placed == COUNT and not (out / "poses.work").exists()
    import pycolmap

    model = pycolmap.Reconstruction(str(out / "sparse/0"))
    assert len(model.cameras) == 1, "photos done before the kill share the camera of the others"


@pytest.mark.parametrize("name", ["log.txt", "database.db", "best/images.bin"])
def test_nothing_is_written_through_a_link_in_an_unfinished_search(room, tmp_path, name):
    """A folder from elsewhere may hold one that leads to a file of the user's."""
    mine, link = tmp_path / "mine", tmp_path / "out/poses.work" / name
    mine.write_bytes(b"mine")
    link.parent.mkdir(parents=True)
    link.symlink_to(mine)
    with pytest.raises(BadFile, match="is a link"):
        find_poses(list_photos(room[0]), tmp_path / "out", PoseSettings(threads=2), quiet)
    assert mine.read_bytes() == b"mine"


BAD_LISTS = {
    "no folder": (lambda root: None, "does not exist"),
    "empty": (lambda root: root.mkdir(), "holds 0 photos"),
    "two": (lambda root: plain_photos(root, (10, 20)), "holds 2 photos"),
    "alike": (lambda root: plain_photos(root, (10, 10, 10)), "are all alike"),
    "broken": (lambda root: plain_photos(root, (1, 2)) or (root / "x.jpg").write_bytes(b"no"),
               "x.jpg: not a readable image"),
    "thermal alone": (lambda root: plain_photos(root / "RGB", (1, 2, 3))
                      or plain_photos(root / "Thermal", (1, 2, 3, 4)), "1 thermal photos"),
    "posed": (lambda root: plain_photos(root, (1, 2, 3))
              or (root / "transforms.json").write_text("{}"), "has poses already"),
}  # fmt: skip


def plain_photos(folder: Path, greys: tuple[int, ...]) -> None:
    folder.mkdir(parents=True)
    for i, grey in enumerate(greys):
        Image.new("RGB", (64, 48), (grey, grey, grey)).save(folder / f"{i}.png")


@pytest.mark.parametrize("how", BAD_LISTS)
def test_photos_that_cannot_work_are_refused_in_a_sentence(tmp_path, how):
    make, words = BAD_LISTS[how]
    make(tmp_path / "photos")
    with pytest.raises(BadFile) as refused:
        list_photos(tmp_path / "photos")
    said = str(refused.value)
    assert words in said and said.endswith((".", "wanted")) and "\n" not in said


BAD_MASKS = {
    "no folder": (None, "no folder of masks"),
    "none": ((), "no mask has a photo's name"),
    "another size": ((Image.new("L", (10, 10), 255),), "has 10x10 pixels, its photo 320x240"),
    "black": ((Image.new("L", SIZE, 0),), "is all black"),
}


@pytest.mark.parametrize("how", BAD_MASKS)
def test_masks_that_cannot_work_are_refused_before_the_work(room, tmp_path, how):
    pictures, words = BAD_MASKS[how]
    masks = tmp_path / "m"
    for picture in pictures or ():
        masks.mkdir(exist_ok=True)
        picture.save(masks / "00.png")
    if pictures == ():
        masks.mkdir()
    with pytest.raises(BadFile, match=words):
        find_poses(list_photos(room[0]), tmp_path / "out", PoseSettings(masks=masks), quiet)


BAD_LENGTHS = {
    "no photo": (Length(1, "99.png", ENDS), "none of those given"),
    "outside": (Length(1, "03.png", ((5, 5), (400, 5))), "has 320x240 pixels"),
    "one place": (Length(1, "03.png", ((100, 60), (100, 60))), "they are one"),
}


@pytest.mark.parametrize("how", BAD_LENGTHS)
def test_lengths_that_cannot_be_measured_are_refused(room, how):
    """On the arrays of a search that ended well: a search costs seconds, the length nothing."""
    length, words = BAD_LENGTHS[how]
    flat = np.array([[(x - 160) / FOCAL, (y - 120) / FOCAL, 1] for x, y in length.ends])
    best = {"names": np.array(["03.png"]), "at": np.array([[100.0, 60]] * 9),
            "away": np.full(9, 2.0), "rays": flat}  # fmt: skip
    with pytest.raises(BadFile, match=words):
        model_length(best, list_photos(room[0]), length)


@pytest.mark.parametrize("change,words", [
    ({"side": 99}, "at least 100"), ({"features": float("nan")}, "at least 100"),
    ({"threads": -1}, "threads"), ({"neighbours": -1}, "neighbours"),
    ({"length": Length(float("nan"), "a", ENDS)}, "above 0"),
    ({"length": Length(0.0, "a", ENDS)}, "above 0"),
    ({"straight": True, "masks": Path("m")}, "undistort without masks"),
])  # fmt: skip
def test_settings_refuse_what_cannot_work(change, words):
    with pytest.raises(ValueError, match=words):
        replace(PoseSettings(), **change)


@pytest.mark.parametrize("photos,near,pairs", [(2, 0, 1), (33, 0, 528), (3, 10, 3), (16, 1, 15)])
def test_pairs_are_counted_as_they_are_matched(photos, near, pairs):
    """3 photos have 3 pairs at most; one neighbour each makes a chain of 15."""
    assert count_pairs(photos, near) == pairs


def real(folder: Path, name: str, every: int = 1, first: int | None = None) -> Path:
    source = DATA / name / "images"
    if not source.is_dir():
        pytest.skip(f"{name} is not on this machine")
    folder.mkdir()
    for path in sorted(source.iterdir())[::every][:first]:
        (folder / path.name).symlink_to(path)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    "name,every,first,near,turn,place",
    [
        # degrees in the median and shares of the cameras' spread; measured 0.30 and 0.0042
        ("plush_snowmiku", 3, None, None, 0.5, 0.01),
        ("maryrose_tankard", 1, 16, 10, 0.3, 0.005),  # measured 0.12 and 0.0017
    ],
)
def test_real_photos_come_out_as_their_known_poses(tmp_path, name, every, first, near, turn, place):
    photos = list_photos(real(tmp_path / "photos", name, every, first))
    masks = DATA / name / "masks"
    settings = PoseSettings(neighbours=near, masks=masks if masks.is_dir() else None, threads=2)
    before = os.times()
    report = find_poses(photos, tmp_path / "out", settings, quiet)
    after = os.times()
    assert report.placed == report.photos
    spent = after.children_user + after.children_system
    spent -= before.children_user + before.children_system
    assert spent / report.photos < 4, "s of processor time a photo; 1.9 and 2.1 measured"
    known = {p.path.name: p.view.world_from_eye.matrix() for p in read_capture(DATA / name).photos}
    pairs = [
        (p.view.world_from_eye.matrix(), known[p.path.name])
        for p in read_capture(tmp_path / "out").photos
    ]
    _, _, degrees, places = compare(*(np.array(side) for side in zip(*pairs, strict=True)))
    assert np.median(degrees) < turn and np.median(places) < place


@pytest.mark.slow
def test_real_photos_without_known_poses(tmp_path):
    """One of the 16 shows the other side of the table and shares nothing with the others."""
    photos = list_photos(real(tmp_path / "photos", "banana16_unposed"))
    report = find_poses(photos, tmp_path / "out", PoseSettings(threads=2), quiet)
    assert report.placed >= 15 and set(report.left_out) <= {"DSC_0434.JPG"}
    assert report.error_px < 0.5


def test_the_camera_path_is_level():
    """What the room's tests stand on."""
    assert all(abs(camera(i, COUNT)[1, 0]) < 1e-12 for i in range(COUNT))
