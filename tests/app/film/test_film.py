"""film: the same frames always, files that other programs read, refusals in one sentence."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.document import Document
from shapeshift.app.drawing import open_renderer
from shapeshift.app.film.draw_film import averaged
from shapeshift.app.film.film_plan import circle_around
from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.files import whole_file
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import random_package
from tests.support.three_stops import three_stop_package

ROOT = Path(__file__).resolve().parents[3]
SIZE = (40, 30)
TINY = ("--size", "40x30", "--context", "none", "--fps", "6", "--seconds", "1")
STYLE = ("--style-path", "RGB@0 Opened@1s")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return three_stop_package(tmp_path_factory.mktemp("scene") / "three.shift")


@pytest.fixture(scope="module")
def cameras(tmp_path_factory):
    views = orbit_path(12, np.zeros(3), 1.0, SIZE)[:8]
    path = tmp_path_factory.mktemp("cameras") / "cameras.json"
    write_cameras(CameraList(tuple(views), ("",) * 8, "test"), path, "ours")
    return path


def film(*arguments) -> int:
    return cli.main(["film", *map(str, arguments)])


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.png"))}


def refused(capsys, *arguments) -> str:
    """The sentence with which the command refuses, before anything is written."""
    assert film(*arguments) == 2
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1, said
    return said


@pytest.fixture(scope="module")
def drawn(scene, cameras, tmp_path_factory):
    """The film that the tests compare with: 6 frames past 8 cameras from RGB to Opened."""
    out = tmp_path_factory.mktemp("film") / "frames"
    assert film(scene, "--cameras", cameras, *TINY, *STYLE, "--out", out) == 0
    return out


def test_a_film_is_its_frames(drawn):
    frames = bytes_of(drawn)
    assert list(frames) == [f"{k:05d}.png" for k in range(6)]
    assert len(set(frames.values())) == 6
    for path in drawn.glob("*.png"):
        assert Image.open(path).size == SIZE and np.asarray(Image.open(path)).std() > 5


def test_a_circle_has_the_side_and_the_height_of_the_first_look():
    document = Document.of(read_model(DEMO))
    centre, _ = document.bounds()
    way = document.view(SIZE).world_from_eye.position - centre
    seen = [circle_around(document, SIZE).view(part, SIZE).world_from_eye for part in (0.0, 0.4)]
    first, later = (pose.position - centre for pose in seen)
    assert way[1] > 0.1 * np.linalg.norm(way)  # from above
    np.testing.assert_allclose(first / np.linalg.norm(first), way / np.linalg.norm(way), atol=1e-6)
    assert later[1] == pytest.approx(first[1]) and np.linalg.norm(later - first) > first[1]


def test_the_same_film_has_the_same_bytes(scene, cameras, drawn, tmp_path):
    assert film(scene, "--cameras", cameras, *TINY, *STYLE, "--out", tmp_path / "again") == 0
    assert bytes_of(tmp_path / "again") == bytes_of(drawn)


@pytest.mark.parametrize("frame", [0, 3, 5])
def test_a_frame_drawn_alone_is_that_of_the_film(scene, cameras, drawn, tmp_path, frame):
    options = ("--cameras", cameras, *TINY, *STYLE, "--only", frame)
    assert film(scene, *options, "--out", tmp_path / "one") == 0
    alone = bytes_of(tmp_path / "one")
    assert alone == {f"{frame:05d}.png": bytes_of(drawn)[f"{frame:05d}.png"]}


def test_parts_drawn_apart_are_one_film(scene, cameras, drawn, tmp_path):
    options = (scene, "--cameras", cameras, *TINY, *STYLE, "--out", tmp_path / "parts")
    for part in ("0:2", "4:6", "2:4"):
        assert film(*options, "--only", part) == 0
    assert bytes_of(tmp_path / "parts") == bytes_of(drawn)


def test_a_frame_is_what_its_place_and_its_blend_draw(scene, drawn):
    """From outside of the command: the legend's numbers through a renderer of its own."""
    rows = json.loads((drawn / "frames.json").read_text())["rows"]
    assert [row["x"][0] for row in rows[:: len(rows) - 1]] == [0.0, 1.0]
    blend = rows[2]["x"][0]
    beta = 0.4**2 * (3 - 0.8)  # smoothstep at 0.4 of the way; the random model has no pace
    assert blend == pytest.approx({"RGB": 1 - beta, "Opened": beta})
    from shapeshift.scene.pose import Pose, View

    pose = Pose(np.array(rows[2]["eye"]), np.array(rows[2]["wxyz"]))
    view = View(pose, tuple(rows[2]["tangents"]), 0.01, 1000.0, SIZE)
    control = StopWeights(tuple(blend.items()))
    with open_renderer("none", "tiles") as (renderer, _):
        renderer.update(Scene((SceneObject("a", read_model(scene), x=control),)))
        renderer.draw([view])
        wanted = renderer.resolved()
    got = np.asarray(Image.open(drawn / "00002.png")) / 255
    assert np.abs(got - wanted).max() <= 1.5 / 255


def test_what_was_killed_goes_on_with_the_same_frames(scene, cameras, drawn, tmp_path):
    """Killed as soon as two frames are there: those stay untouched, the rest is drawn."""
    out = tmp_path / "killed"
    words = ["film", scene, "--cameras", cameras, *TINY, *STYLE, "--out", out]
    child = subprocess.Popen(
        [sys.executable, "-m", "shapeshift", *map(str, words)], cwd=ROOT, stderr=subprocess.DEVNULL
    )
    until = time.monotonic() + 60
    while len(list(out.glob("0*.png"))) < 2 and child.poll() is None and time.monotonic() < until:
        time.sleep(0.002)
    child.send_signal(signal.SIGKILL)
    child.wait()
    kept = {path.name: path.stat().st_mtime_ns for path in out.glob("0*.png")}
    assert len(kept) >= 2
    assert film(*words[1:]) == 0
    assert bytes_of(out) == bytes_of(drawn)
    assert all((out / name).stat().st_mtime_ns == at for name, at in kept.items())


def test_frames_that_a_disk_has_spoiled_are_drawn_again(scene, cameras, drawn, tmp_path):
    """Cut off, empty, of another size, no picture; and a part that a kill has left."""
    out = tmp_path / "spoiled"
    shutil.copytree(drawn, out)
    whole = bytes_of(drawn)
    bad = {0: whole["00000.png"][:-1], 1: b"", 2: b"x" * 100, 3: whole["00003.png"][:-12]}
    for number, data in bad.items():
        (out / f"{number:05d}.png").write_bytes(data)
    Image.new("RGB", (SIZE[0] + 1, SIZE[1])).save(out / "00004.png")
    options = (scene, "--cameras", cameras, *TINY, *STYLE, "--out", out)
    assert film(*options) == 0
    assert bytes_of(out) == whole
    (out / ".shapeshift-0123456789abcdef.part").touch()
    whole_file._swept.clear()  # as another start
    assert film(*options, "--background", 1, 1, 1, "--overwrite") == 0
    assert len(bytes_of(out)) == 6 and not list(out.glob(".*"))


def test_frames_of_another_film_are_not_mixed_in(scene, cameras, tmp_path, capsys):
    out = tmp_path / "frames"
    assert film(scene, *TINY, "--out", out) == 0
    before = bytes_of(out)
    capsys.readouterr()
    said = refused(capsys, scene, *TINY, "--background", 1, 1, 1, "--out", out)
    assert "another film" in said and "--overwrite" in said
    assert bytes_of(out) == before
    assert film(scene, *TINY, "--background", 1, 1, 1, "--out", out, "--overwrite") == 0
    after = bytes_of(out)
    assert len(after) == 6 and not set(after.values()) & set(before.values())


def test_a_folder_of_somebody_else_stays_as_it_is(scene, tmp_path, capsys):
    Image.new("RGB", (3, 3)).save(tmp_path / "mine.png")
    before = bytes_of(tmp_path)
    capsys.readouterr()
    assert "no frame of a film" in refused(capsys, scene, *TINY, "--out", tmp_path, "--overwrite")
    assert bytes_of(tmp_path) == before


def test_streams_lie_beside_the_film(scene, tmp_path):
    """Depth, normals and coverage of a frame are those of `render --output` at the same place."""
    out = tmp_path / "a.webp"
    assert film(scene, *TINY, "--streams", "depth,normal", "coverage", "--out", out) == 0
    folder = tmp_path / "a.frames"
    for name in ("depth", "normal", "coverage"):
        assert len(list((folder / name).glob("0*.png"))) == 6
    cover = np.asarray(Image.open(folder / "coverage" / "00000.png")) / 65535
    depth = np.asarray(Image.open(folder / "depth" / "00000.png"))
    assert 0.1 < cover.mean() < 0.9
    np.testing.assert_array_equal(depth > 0, cover >= 0.5)
    assert not list(folder.glob("0*.png"))  # the frames are in the film


def test_two_eyes_stand_side_by_side(scene, tmp_path):
    assert film(scene, *TINY, "--stereo", "0.1", "--out", tmp_path / "eyes") == 0
    image = np.asarray(Image.open(tmp_path / "eyes" / "00000.png"), float)
    assert image.shape == (30, 80, 3)
    assert np.abs(image[:, :40] - image[:, 40:]).mean() > 1


def test_supersampling_is_the_mean_of_finer_pixels(scene, tmp_path):
    assert film(scene, *TINY, "--only", 2, "--supersample", 2, "--out", tmp_path / "s") == 0
    fine = ("--size", "80x60")
    assert film(scene, *TINY, *fine, "--only", 2, "--out", tmp_path / "f") == 0
    got = np.asarray(Image.open(tmp_path / "s" / "00002.png"), float)
    wide = np.asarray(Image.open(tmp_path / "f" / "00002.png"), np.float32)
    assert np.abs(got - averaged(wide, 2)).max() <= 1.0  # both were rounded to bytes


def test_every_third_frame_is_a_look_at_the_same_film(scene, drawn, cameras, tmp_path):
    options = ("--cameras", cameras, *TINY, *STYLE, "--every", 3)
    assert film(scene, *options, "--out", tmp_path / "look") == 0
    whole = bytes_of(drawn)
    assert bytes_of(tmp_path / "look") == {n: whole[n] for n in ("00000.png", "00003.png")}


def test_a_poster_is_a_frame_of_the_film(scene, drawn, cameras, tmp_path):
    options = ("--cameras", cameras, *TINY, *STYLE, "--poster", tmp_path / "poster.png")
    assert film(scene, *options, "--out", tmp_path / "frames") == 0
    poster = np.asarray(Image.open(tmp_path / "poster.png"))
    np.testing.assert_array_equal(poster, np.asarray(Image.open(drawn / "00003.png")))


def test_a_saved_path_is_the_same_flight(scene, drawn, cameras, tmp_path):
    """Its twelve cameras lead past where the film was, and its clock and style are the film's."""
    saved = tmp_path / "way.film.json"
    options = ("--cameras", cameras, *TINY, *STYLE, "--save-path", saved)
    assert film(scene, *options, "--out", tmp_path / "one") == 0
    again = ("--context", "none", "--cameras", saved, "--out", tmp_path / "two")
    assert film(scene, *again) == 0
    one, two = (json.loads((tmp_path / n / "frames.json").read_text()) for n in ("one", "two"))
    assert two["size"] == [40, 30] and two["fps"] == 6
    for a, b in zip(one["rows"], two["rows"], strict=True):
        np.testing.assert_allclose(a["eye"], b["eye"], atol=0.02)
        assert a["x"] == b["x"]


def test_a_path_of_nerfstudio_is_played_as_it_is(scene, tmp_path):
    views = tuple(orbit_path(9, np.zeros(3), 1.0, SIZE)[:7])
    path = tmp_path / "camera_path.json"
    write_cameras(CameraList(views, ("",) * 7, "test", fps=7.0), path, "nerfstudio")
    out = tmp_path / "frames"
    assert film(scene, "--context", "none", "--size", "40x30", "--cameras", path, "--out", out) == 0
    rows = json.loads((out / "frames.json").read_text())["rows"]
    eyes = np.array([row["eye"] for row in rows])
    wanted = [view.world_from_eye.position for view in views]
    np.testing.assert_allclose(eyes, wanted, atol=0.02)


def test_plain_splats_have_a_film(tmp_path):
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.splat_scenes import random_layers

    s = random_layers(40, seed=4)
    write_ply(PlainSplats(s.means, s.scales, s.wxyz, s.opacity, s.sh), tmp_path / "a.ply")
    assert film(tmp_path / "a.ply", *TINY, "--out", tmp_path / "f") == 0
    assert len(bytes_of(tmp_path / "f")) == 6


def test_objects_of_a_scene_file_go_each_its_own_way(scene, cameras, tmp_path):
    """Both have RGB, one has Opened: the other stays where the key before has it.  A change of a
    model that the file names makes another film of it.
    """
    model = tmp_path / "three.shift"
    model.write_bytes(scene.read_bytes())
    other = random_package(tmp_path, 30, k=2)
    items = [{"name": "a", "model": model.name}, {"name": "b", "model": other.name, "x": 0.25,
             "pose": {"position": [2, 0, 0]}}]  # fmt: skip
    file = tmp_path / "two.scene.json"
    file.write_text(json.dumps({"format": "shapeshift-scene 1", "objects": items}))
    options = (file, "--cameras", cameras, *TINY, *STYLE, "--out", tmp_path / "f")
    assert film(*options) == 0
    rows = json.loads((tmp_path / "f" / "frames.json").read_text())["rows"]
    assert [row["x"] for row in (rows[0], rows[-1])] == [[0.0, 0.0], [1.0, 0.0]]
    random_package(tmp_path, 30, k=2, seed=9)
    assert film(*options) == 2


BAD = [
    (("--style-path", "RGB@0 Open@1s"), ("Open", "did you mean Opened")),
    (("--style-path", "RGB@0 Opened@2s"), ("the film ends at 1 s",)),
    (("--style-path", "RGB"), ("no key",)),
    (("--seconds", "0"), ("--seconds is 0",)),
    (("--seconds", "nan"), ("--seconds is nan",)),
    (("--fps", "500"), ("--fps is 500",)),
    (("--seconds", "9000", "--fps", "240"), ("2,160,000 frames",)),
    (("--ease", "0.6"), ("--ease is 0.6",)),
    (("--hold", "0.5"), ("--hold is 0.5",)),
    (("--smooth", "-1"), ("--smooth is -1",)),
    (("--supersample", "0"), ("--supersample is 0",)),
    (("--supersample", "8", "--size", "4000x3000"), ("32000x24000",)),
    (("--every", "0"), ("--every is 0",)),
    (("--stereo", "1"), ("--stereo is 1.0",)),
    (("--streams", "heat"), ("'heat'", "depth, normal, coverage")),
    (("--only", "6"), ("frames 0 to 5",)),
    (("--only", "a:b"), ("a:b",)),
    (("--poster", "p.jpg"), (".png",)),
    (("--cameras", "nowhere.json"), ("does not exist",)),
    (("--codec", "av1"), ("--codec",)),
    (("--out", "film.avi"), (".avi", ".mp4")),
    (("--out", "film.gif", "--fps", "60"), ("at most 50",)),
    (("--out", "film.webm", "--codec", "h264"), ("does not go into .webm",)),
    (("--out", "film.webm", "--only", "3"), ("--only",)),
    (("--out", "film.mp4", "--size", "9000x30"), ("8192",)),
]


@pytest.mark.parametrize(("options", "words"), BAD, ids=lambda v: " ".join(v))
def test_what_cannot_be_is_one_sentence(scene, tmp_path, capsys, options, words):
    out = () if "--out" in options else ("--out", tmp_path / "out")
    options = [tmp_path / o if o.startswith("film.") else o for o in options]
    said = refused(capsys, scene, *TINY, *out, *options)
    for word in words:
        assert word in said
    assert not list(tmp_path.iterdir())


def test_a_film_that_is_there_is_not_replaced(scene, tmp_path, capsys):
    (tmp_path / "a.gif").write_bytes(b"mine")
    assert "exists" in refused(capsys, scene, *TINY, "--out", tmp_path / "a.gif")
    assert (tmp_path / "a.gif").read_bytes() == b"mine"
    assert film(scene, *TINY, "--out", tmp_path / "a.gif", "--overwrite") == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"shapeshift_film": 2, "cameras": []}', "shapeshift_film"),
        ('{"shapeshift_film": 1, "cameras": []}', "no camera"),
        ('{"shapeshift_film": 1, "cameras": [{"fov_y": 1}]}', "matrix"),
        ('{"shapeshift_film": 1, "fps": 0, "cameras": []}', "fps"),
        ('{"shapeshift_film": 1, "second": 3, "cameras": [{"fov_y": 1, "matrix": EYE}]}', "second"),
        ('{"shapeshift_film": 1, "style": "a", "cameras": [{"fov_y": 1, "matrix": EYE}]}', "key"),
        ('{"shapeshift_film": 1, "cameras": [{"fov_y": 1, "matrix": EYE, "time": 11}]}', "10 s"),
        ('{"shapeshift_film": 1, "size": [0, 9], "cameras": [{"fov_y": 1, "matrix": EYE}]}', "siz"),
    ],
)  # fmt: skip
def test_a_wrong_file_of_a_path_is_one_sentence(scene, tmp_path, capsys, text, said):
    path = tmp_path / "way.film.json"
    path.write_text(text.replace("EYE", json.dumps(np.eye(4).tolist())))
    out = tmp_path / "out"
    assert said in refused(capsys, scene, *TINY, "--cameras", path, "--out", out)
    assert not out.exists()
