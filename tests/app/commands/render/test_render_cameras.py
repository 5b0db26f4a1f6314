"""render --camera: files that lie with a scene, scenes far from zero, scenes turned by --up."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.scene.cameras.camera_list import CameraList
from shapeshift.scene.cameras.write_cameras import write_cameras
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.splat_scenes import random_layers

SIZE = (48, 36)
TINY = ("--context", "none", "--drawing", "tiles")
FAR = (5e5, 0.0, -3e6)  # metres: a survey's coordinates


def splats(path: Path, origin=(0.0, 0.0, 0.0)) -> Path:
    s = random_layers(60, seed=4)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_ply(PlainSplats(s.means, s.scales, s.wxyz, s.opacity, s.sh, origin), path)
    return path


def around(origin=(0.0, 0.0, 0.0), count: int = 3) -> CameraList:
    eyes = [np.array([3 * np.sin(a), 1.0, 3 * np.cos(a)]) for a in range(count)]
    poses = [look_at(eye + origin, np.array(origin)) for eye in eyes]
    views = [View(pose, perspective(0.8, SIZE), 0.05, 1000.0, SIZE) for pose in poses]
    return CameraList(tuple(views), ("",) * count, "test")


def drawn(scene: Path, out: Path, *options) -> list[np.ndarray]:
    given = ["render", scene, "--out", out, *TINY, *options]
    assert cli.main(list(map(str, given))) == 0
    return [np.asarray(Image.open(path)) / 255 for path in sorted(out.glob("*.png"))]


def assert_alike(some, others, db: float = 50) -> None:
    assert len(some) == len(others) == 3
    for one, other in zip(some, others, strict=True):
        assert one.max() > 0.2 and psnr(one, other) > db


@pytest.mark.parametrize("form", ["inria", "colmap-txt", "nerfstudio", "transforms"])
def test_cameras_that_lie_with_a_run_are_followed(tmp_path, capsys, form):
    scene = splats(tmp_path / "run/point_cloud/iteration_7/point_cloud.ply")
    assert cli.main(["render", str(scene), "--camera", "auto", "--out", str(tmp_path / "no")]) == 2
    assert "no cameras lie with" in capsys.readouterr().err
    named = tmp_path / "cameras"
    write_cameras(around(), named, form)
    wanted = drawn(scene, tmp_path / "named", "--camera", named)
    write_cameras(around(), tmp_path / "run/cameras.json", "inria")
    for number, given in enumerate((scene, tmp_path / "run")):
        assert_alike(drawn(given, tmp_path / f"auto{number}", "--camera", "auto"), wanted, 90)


def test_a_scene_far_from_zero_is_seen_by_its_cameras_as_one_at_zero(tmp_path):
    near, far = splats(tmp_path / "near/a.ply"), splats(tmp_path / "far/a.ply", FAR)
    write_cameras(around(), near.with_name("cameras.json"), "inria")
    write_cameras(around(np.array(FAR)), far.with_name("cameras.json"), "inria")
    pictures = [drawn(s, s.parent / "out", "--camera", "auto") for s in (near, far)]
    assert_alike(pictures[1], pictures[0])  # places are doubles in the file, and stay exact
    rows = json.loads(far.with_name("cameras.json").read_text())
    assert abs(rows[0]["position"][2]) > 2.9e6


@pytest.mark.parametrize("options", [("--up=+Z",), ("--up=-X", "--flip"), ("--flip",)])
def test_a_turned_scene_is_seen_the_same_by_cameras_turned_with_it(tmp_path, options):
    scene = splats(tmp_path / "a.ply")
    write_cameras(around(), tmp_path / "cameras.json", "inria")
    usual = drawn(scene, tmp_path / "usual", "--camera", "auto")
    assert_alike(drawn(scene, tmp_path / "turned", "--camera", "auto", *options), usual)
