"""The viewer as a person starts it, under Xvfb or without a display: pictures and sentences."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from Xlib import Xatom
from Xlib.display import Display

from shapeshift.app.editor.window.window import Window
from shapeshift.renderer.gl.context import NoContext
from shapeshift.scene.pose import look_at
from tests.support.desktop.desktop_stand import ROOT, ball, start
from tests.support.program import launch

EXAMPLE = ROOT / "examples" / "touch.scene.json"
ACCENT = np.array([242, 161, 69])  # app/editor/panels/widgets/theme.py


def assert_one_sentence(done, code: int, *words: str) -> None:
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr and len(done.stderr.strip().splitlines()) == 1
    for word in words:
        assert word in done.stderr


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory) -> Path:
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    path = tmp_path_factory.mktemp("scene") / "ball.ply"
    b = ball()
    write_ply(PlainSplats(b.means, b.scales, b.wxyz, b.opacity, b.sh), path)
    return path


def test_screenshot_of_the_whole_window(display, scene_file, tmp_path):
    out = tmp_path / "sub" / "window.png"
    done = start(display, "view", scene_file, "--screenshot", out, "--frames", 2)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    picture = np.asarray(Image.open(out)).astype(int)
    assert picture.shape == (720, 1280, 3)
    green = (picture[..., 1] > 120) & (picture[..., 0] < 90) & (picture[..., 2] < 90)
    _, columns = np.nonzero(green)
    assert 0.1 < green.mean() < 0.6
    assert abs(columns.mean() - (332 + 1280) / 2) < 12  # in the middle of what the panel leaves
    panel = np.abs(picture[:500, :290] - ACCENT).max(axis=2) < 12
    assert panel.sum() > 40  # the title and the bars of the passes
    assert out.parent.exists() and [p.name for p in out.parent.iterdir()] == ["window.png"]


def test_a_section_cuts_from_the_start(display, scene_file, tmp_path):
    """The ball's half with x above 0 is gone, and nothing waits to be saved or undone."""
    pictures = []
    for more in ((), ("--section", "plane:1,0,0,0")):
        out = tmp_path / "window.png"
        done = start(display, "view", scene_file, "--screenshot", out, "--size", "640x400", *more)
        assert done.returncode == 0, done.stderr
        pictures.append(np.asarray(Image.open(out)).astype(int)[:280])
    green = [(p[..., 1] > 120) & (p[..., 0] < 90) & (p[..., 2] < 90) for p in pictures]
    whole, half = green[0].sum(), green[1].sum()
    assert 0.4 < half / whole < 0.6 and not (green[1] & ~green[0]).sum() > 0.02 * whole
    wrong = launch("view", scene_file, "--section", "plane:1,0,0")
    assert_one_sentence(wrong, 2, "has not the numbers of plane")


@pytest.mark.parametrize("percent", [100, 150, pytest.param(200, marks=pytest.mark.slow)])
def test_a_desktop_that_is_scaled_has_the_same_window_in_more_pixels(
    display, scene_file, tmp_path, percent
):
    """By Xft.dpi, as desktops on X11 say it: the ball is in the middle of what is free."""
    out = tmp_path / "window.png"
    screen = Display(display)
    text = f"Xft.dpi:\t{96 * percent / 100:.0f}\n".encode()
    root = screen.screen().root
    try:
        root.change_property(Xatom.RESOURCE_MANAGER, Xatom.STRING, 8, text)
        screen.sync()
        done = start(display, "view", scene_file, "--screenshot", out, "--size", "800x600")
    finally:
        root.delete_property(Xatom.RESOURCE_MANAGER)
        screen.close()
    assert done.returncode == 0, done.stderr
    picture = np.asarray(Image.open(out)).astype(int)
    assert picture.shape[:2] == (600 * percent // 100, 800 * percent // 100)
    green = (picture[..., 1] > 120) & (picture[..., 0] < 90) & (picture[..., 2] < 90)
    rows, columns = np.nonzero(green)
    scale = percent / 100
    assert columns.mean() / scale == pytest.approx((332 + 800) / 2, abs=8)
    assert rows.mean() / scale == pytest.approx((600 - 24) / 2, abs=8)


def test_any_name_and_a_file_of_cameras(display, scene_file, tmp_path):
    """Opened by its address, as desktops hand it over; the camera looks past the ball."""
    path = tmp_path / "Möbel 3 ツ" / "stuhl äöü.ply"
    path.parent.mkdir()
    path.write_bytes(scene_file.read_bytes())
    row = {"matrix": look_at((0.0, 0.0, 6.0), (0.0, 3.0, 0.0)).matrix().tolist(), "fov_y": 0.9}
    (path.parent / "blick ß.json").write_text(json.dumps([row]))
    out = path.parent / "bild ä.png"
    done = start(
        display, "view", path.as_uri(), "--camera", path.parent / "blick ß.json",
        "--screenshot", out, "--size", "900x600",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    picture = np.asarray(Image.open(out)).astype(int)
    green = (picture[..., 1] > 120) & (picture[..., 0] < 90) & (picture[..., 2] < 90)
    rows, _ = np.nonzero(green)
    assert green.any() and rows.mean() > 330  # below the middle: the eye looks up past it


def test_no_display_is_one_sentence(scene_file):
    assert_one_sentence(start(None, "view", scene_file), 2, "no window with OpenGL 4.3", "headless")
    assert_one_sentence(start(":9999", "view", scene_file), 2, "no window with OpenGL 4.3")


def test_bad_input_is_one_sentence_before_any_window_opens(scene_file, tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    broken = tmp_path / "broken.ply"
    broken.write_bytes(b"ply\nnothing")
    assert_one_sentence(launch("view", broken), 2, "broken.ply")
    assert_one_sentence(launch("view", scene_file, "--size", "12"), 2, "--size")
    assert_one_sentence(launch("view", scene_file, "--x", "nan"), 2, "--x")
    assert_one_sentence(launch("view", scene_file, "--frames", "0"), 2, "--frames")
    assert_one_sentence(launch("view", scene_file, "--target-ms", "-1"), 2, "--target-ms")
    assert_one_sentence(launch("view", scene_file, "--floor-db", "nan"), 2, "--floor-db")
    assert_one_sentence(launch("view", scene_file, "--select", "cube:1"), 2, "cube", "sphere")


def test_a_region_a_debug_view_and_a_budget_from_the_command_line(display, scene_file, tmp_path):
    out = tmp_path / "window.png"
    done = start(
        display, "view", scene_file, "--screenshot", out, "--size", "800x600",
        "--select", "sphere:0,0,0:0.5:0", "--debug", "culls", "--target-ms", "1000",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    picture = np.asarray(Image.open(out)).astype(int)
    legend = picture[16:160, 300:460]
    assert (np.abs(legend - np.array([77, 217, 102])).max(axis=2) < 40).sum() > 20  # "drawn"


def test_a_crash_in_a_callback_is_one_sentence_and_not_success(display, scene_file, tmp_path):
    code = (
        "import sys\nfrom shapeshift.app import cli\n"
        "from shapeshift.app.editor.window import window\n"
        "def crash(self, event=None):\n    raise ZeroDivisionError('the callback broke')\n"
        "window.Window.expose = crash\n"
        "old = window.Window.begin_frame\n"
        "def begin(self):\n    self._window.size = (700, 500)\n    return old(self)\n"
        "window.Window.begin_frame = begin\n"
        "sys.exit(cli.main(sys.argv[1:]))"
    )
    out = tmp_path / "never.png"
    done = start(display, "view", scene_file, "--screenshot", out, "--frames", 200, code=code)
    assert_one_sentence(done, 3, "the callback broke")
    assert not out.exists()
    Path(done.stderr.rsplit(" in ", 1)[1].strip().rstrip(".")).unlink()  # the log


def test_no_context_is_the_error_of_the_window(monkeypatch):
    monkeypatch.setattr(
        "shapeshift.app.editor.window.monitor.GlfwWindow",
        lambda **_: (_ for _ in ()).throw(ValueError("no")),
    )
    with pytest.raises(NoContext, match=r"no window with OpenGL 4.3 could be opened \(no\)"):
        Window("a", (10, 10))


def test_a_scene_file_opens_with_one_object_more(display, scene_file, tmp_path):
    out = tmp_path / "window.png"
    done = start(display, "view", EXAMPLE, scene_file, "--screenshot", out, "--frames", 2)
    assert done.returncode == 0 and done.stdout == "", done.stderr
    assert np.asarray(Image.open(out)).std() > 10


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([EXAMPLE, "--x", "Termal"], ["--x", "'Termal' is no x"]),
        ([EXAMPLE, "--up=-Z"], ["touch.scene.json", "which way is up"]),
        (["--touch"], ["--touch is no longer an option"]),
        (["broken.scene.json"], ["object 'a'", "nothing.ply"]),
        (["broken.scene.json", "other.scene.json"], ["two scene files"]),
    ],
)
def test_what_a_scene_file_cannot_is_one_sentence(display, tmp_path, arguments, words):
    text = '{"objects": [{"name": "a", "model": "nothing.ply"}]}'
    for name in ("broken", "other"):
        (tmp_path / f"{name}.scene.json").write_text(text)
    arguments = [tmp_path / a if str(a).endswith(".json") else a for a in arguments]
    assert_one_sentence(start(display, "view", *arguments), 2, *words)


def test_a_window_opens_without_heavy_libraries():
    """scipy alone was a third of the processor time of a start, for tools that few frames want."""
    code = (
        "import sys; import shapeshift.app.editor.desktop;"
        "print([name for name in ('scipy', 'trimesh', 'onnxruntime', 'pycolmap', 'pyopencl')"
        " if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
