"""info, render, bench and headless as a person runs them, and what they refuse."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.commands.bench import command_line
from shapeshift.scene.pose import look_at
from tests.support.models import random_package
from tests.support.program import assert_refused, launch

ROOT = Path(__file__).resolve().parents[3]
BENCH_KEYS = {
    "gl_renderer", "frame_ms", "passes", "stereo_over_mono", "psnr_db", "sweep_worst_ms",
    "splats", "drawn",
}  # fmt: skip


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 60)


def test_info_json_is_alone_on_standard_output(scene):
    done = launch("info", scene, "--json")
    facts = json.loads(done.stdout)
    assert done.returncode == 0 and done.stderr == ""
    assert {"format", "anchors", "splats", "sh_degree", "stops", "bytes"} <= facts.keys()
    assert (facts["anchors"], facts["splats"]) == (60, 300)
    assert facts["stops"][1] == {"name": "Thermal", "x": 1.0, "kind": "thermal"}
    assert facts["bytes"] == scene.stat().st_size


def test_info_table_names_the_stops(scene):
    assert "Thermal (thermal)" in launch("info", scene).stdout


def test_info_table_is_readable_where_letters_are_few(scene):
    """As where Windows sends output into a file, in cp1252: an arrow was written as a code."""
    few = os.environ | {"PYTHONIOENCODING": "cp1252"}
    done = launch("info", scene, env=few)
    assert done.returncode == 0 and "\\u" not in done.stdout
    assert re.search(r"color: \d+ to \d+ to \d+", done.stdout)


def test_render_draws_every_view_at_every_x(scene, tmp_path):
    done = launch("render", scene, "--x", "0", "1", "--frames", 2, "--size", "40x30",
                  "--out", tmp_path, "--context", "none")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["0000_x0.000.png", "0001_x0.000.png", "0002_x1.000.png", "0003_x1.000.png"]
    pictures = [np.asarray(Image.open(tmp_path / n), int) for n in names]
    assert {p.shape for p in pictures} == {(30, 40, 3)}
    for i in range(4):
        for j in range(i):
            assert np.abs(pictures[i] - pictures[j]).mean() > 1  # each is another picture
    second = launch("render", scene, "--size", "40x30", "--out", tmp_path, "--context", "none")
    assert_refused(second, "0000_x0.000.png exists", "--overwrite")


def test_render_stereo_is_two_eyes_side_by_side(scene, tmp_path):
    done = launch("render", scene, "--stereo", 0.1, "--size", "40x30", "--out", tmp_path,
                  "--context", "none")  # fmt: skip
    assert done.returncode == 0, done.stderr
    both = np.asarray(Image.open(tmp_path / "0000_x0.000.png"), int)
    assert both.shape == (30, 80, 3)
    assert 0 < np.abs(both[:, :40] - both[:, 40:]).mean() < 30


def test_render_follows_a_camera_file(scene, tmp_path):
    matrix = look_at((0.0, 0.5, 3.0), (0.0, 0.0, 0.0)).matrix().tolist()
    rows = [
        {"matrix": matrix, "fov_y": 0.8},
        {"matrix": matrix, "tangents": [-0.5, 0.2, -0.3, 0.3]},
    ]
    (tmp_path / "cameras.json").write_text(json.dumps(rows))
    done = launch("render", scene, "--camera", tmp_path / "cameras.json", "--size", "40x30",
                  "--out", tmp_path / "out", "--context", "none")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "out").iterdir())) == 2


def test_bench_json_has_the_promised_keys(scene, tmp_path):
    done = launch("bench", scene, "--frames", 3, "--sweep", 3, "--size", "64x48", "--json",
                  "--quality-size", "32x24", "--context", "none")  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert BENCH_KEYS <= result.keys()
    assert result["splats"] == 300 and 0 < result["drawn"] <= 300
    for row in [result["frame_ms"], *result["passes"].values()]:
        assert 0 <= row["p50"] <= row["p95"] <= row["p99"]
    assert result["psnr_db"] > 50
    assert result["stereo_over_mono"] > 0  # test_bench.py has a clock of its own for it
    assert "PSNR" in done.stderr and "p95" in done.stderr


def test_headless_writes_pictures_and_says_where(scene, tmp_path):
    done = launch("headless", "--scene", scene, "--out", tmp_path / "out", "--size", "48x32",
                  "--frames", 2)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "out") in done.stderr
    sheet = Image.open(tmp_path / "out/sheet.png")
    assert sheet.size == (48 * 3, 32 * 3)  # two stops and the middle, from three sides
    assert BENCH_KEYS <= json.loads((tmp_path / "out/bench.json").read_text()).keys()


REFUSED = {
    ("--x", "1.5"): "--x: '1.5' is no x of this scene; expected a number from 0 to 1, a stop",
    ("--x", "nan"): "--x: 'nan' is no x",
    ("--x", "left"): "a stop (RGB, Thermal) or a way such as RGB..Thermal:0.5.",
    ("--x", "thrmal"): "did you mean Thermal?",
    ("--x", "sweep:1"): "sweep:N has 2 to 100000 values",
    ("--size", "0x10"): "each side must be 1 to 16384",
    ("--size", "99999x10"): "each side must be 1 to 16384",
    ("--size", "big"): "expected WIDTHxHEIGHT",
    ("--camera", "nowhere.json"): "nowhere.json does not exist",
    ("--frames", "0"): "--frames is 0",
    ("--context", "none", "--drawing", "quads"): "quads needs GL",
    ("--background", "2", "0", "0"): "--background",
}


@pytest.mark.parametrize("extra", REFUSED, ids=" ".join)
def test_bad_options_are_one_sentence_and_write_nothing(scene, tmp_path, extra):
    assert_refused(launch("render", scene, "--out", tmp_path / "out", *extra), REFUSED[extra])
    assert not (tmp_path / "out").exists()


CAMERAS = {
    "[]": "holds no camera",
    "[3]": "camera 0 is 3; one object",
    "{": "is not JSON",
    '[{"matrix": [[1]]}]': "not 4 x 4",
    '[{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,NaN, 0,0,0,1], "fov_y": 1}]': "holds NaN or Inf",
    '[{"matrix": [2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], "fov_y": 1}]': "is no rotation",
    '[{"matrix": [-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], "fov_y": 1}]': "mirrors",
    '[{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}]': "'fov_y' is missing",
    '[{"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], "tangents": [1,0,0,1]}]': "left < right",
}


@pytest.mark.parametrize("text", CAMERAS)
def test_broken_camera_files_are_one_sentence(tmp_path, text):
    from shapeshift.runtime_models.model import BadFile
    from shapeshift.scene.cameras.read_cameras import read_cameras

    (tmp_path / "c.json").write_text(text)
    with pytest.raises(BadFile, match=CAMERAS[text].replace("[", r"\[")):
        read_cameras(tmp_path / "c.json", (8, 8))


def test_no_opencl_is_one_sentence(scene, tmp_path):
    """An empty folder of drivers: what a machine without any looks like."""
    import os

    (tmp_path / "none").mkdir()
    environment = os.environ | {
        "OCL_ICD_VENDORS": str(tmp_path / "none"),
        "OPENCL_VENDOR_PATH": str(tmp_path / "none"),
    }
    done = launch("render", scene, "--out", tmp_path / "out", "--context", "none", env=environment)
    assert_refused(done, "OpenCL", "pocl")


def test_old_gl_is_one_sentence(scene, tmp_path):
    import os

    environment = os.environ | {"MESA_GL_VERSION_OVERRIDE": "4.1"}
    done = launch("render", scene, "--out", tmp_path / "out", "--drawing", "quads",
                  "--context", "egl", env=environment)  # fmt: skip
    assert_refused(done, "4.3", "4.1")


def test_rows_name_no_folders(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["x", "bench", "/some/where/leg.shift", "--size", "8x8"])
    assert command_line() == "python3 launch.py bench leg.shift --size 8x8"


def test_interrupt_leaves_whole_pictures_only(scene, tmp_path):
    import signal
    import time

    child = subprocess.Popen(
        [sys.executable, "-m", "shapeshift", "render", str(scene), "--x", "sweep:5000", "--size",
         "64x48", "--out", str(tmp_path / "out"), "--context", "none"],
        cwd=ROOT, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    for _ in range(600):
        if len(list((tmp_path / "out").glob("*.png"))) > 3:
            break
        time.sleep(0.05)
    child.send_signal(signal.SIGINT)
    _, text = child.communicate(timeout=30)
    assert child.returncode == 130
    assert "Traceback" not in text and "Interrupted." in text
    for path in (tmp_path / "out").glob("*.png"):
        Image.open(path).load()
