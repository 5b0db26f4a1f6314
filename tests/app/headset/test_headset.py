"""`launch.py vr` where there is no headset, wrong options, and what a scene is to be worn as."""

import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.cli import main
from shapeshift.app.document import DARK
from shapeshift.app.headset import headset
from shapeshift.app.headset.headset import NO_HEADSET, Options, interrupting
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.paths import TOUCH as DEMO_SCENE
from shapeshift.vr.openxr.instance import Lost, NoHeadset
from tests.support.touch_scene import TOUCH

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def viewer(monkeypatch) -> list:
    """What the viewer would be opened with; there is a display."""
    from shapeshift.app.editor import desktop

    opened = []
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setattr(desktop, "run", lambda options: opened.append(options) or 0)
    return opened


def worn(monkeypatch, reason: Exception) -> None:
    def wear(options):
        raise reason

    monkeypatch.setattr(headset, "wear", wear)


@pytest.mark.parametrize("reason", [NoHeadset("no hat."), Lost("the hat went away.")])
def test_without_a_headset_the_viewer_opens_the_same_scene(monkeypatch, viewer, capsys, reason):
    worn(monkeypatch, reason)
    scene = ROOT / "assets" / "workshop.shift"
    assert main(["vr", str(scene), "--max-splats", "500"]) == 0
    assert main(["vr"]) == 0
    assert [each.scenes for each in viewer] == [(scene,), (DEMO_SCENE,)]
    assert [each.max_splats for each in viewer] == [500, 0]
    said = capsys.readouterr()
    assert said.out == "" and said.err.splitlines()[:1] == [f"shapeshift vr: {reason}"]


@pytest.mark.parametrize("measured", [["--frames", "3"], ["--report", "r.json"]])
def test_a_measured_run_opens_nothing(monkeypatch, viewer, capsys, measured):
    worn(monkeypatch, NoHeadset("no hat."))
    assert main(["vr", *measured]) == NO_HEADSET
    assert viewer == [] and capsys.readouterr().err == "shapeshift vr: no hat.\n"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has no display")
def test_without_a_display_nothing_is_opened(monkeypatch, viewer, capsys):
    worn(monkeypatch, NoHeadset("no hat."))
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["vr"]) == NO_HEADSET
    assert viewer == []


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (["--eye-part", "0"], "--eye-part is 0, expected 0.1 to 2."),
        (["--eye-part", "nan"], "--eye-part is nan"),
        (["--frames", "-1"], "--frames is -1, expected 0"),
        (["--every", "0"], "--every is 0, expected 1 or more."),
        (["--target-ms", "nan"], "--target-ms is nan, expected a number above 0."),
        (["--floor-db", "0"], "--floor-db is 0.0, expected a number above 0."),
        (["--quality", "best", "--target-ms", "5"], "--target-ms is for --quality auto"),
        (["--text-size", "0.7"], "--text-size is 0.7, expected 0.75 to 2."),
        (["--text-size", "nan"], "--text-size is nan"),
        (["--vignette", "1.01"], "--vignette is 1.01, expected 0 to 1."),
        (["nothing.ply"], "there is no nothing.ply."),
        (["--report", "no/where/r.json"], "there is no folder"),
        (["--lines", str(DEMO_SCENE)], "demo.scene.json is the scene; choose another file."),
    ],
)
def test_wrong_options_are_one_sentence(capsys, wrong, sentence):
    assert main(["vr", *wrong]) == 2
    said = capsys.readouterr().err
    assert sentence in said and said.count("\n") == 1


def test_ctrl_c_ends_the_session_first_and_only_then_the_program():
    wearing, before = SimpleNamespace(interrupted=False), signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interrupting(wearing):
        signal.raise_signal(signal.SIGINT)
        assert wearing.interrupted  # and the session goes on to its end
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_ends_at_once_and_none_changes_nothing():
    wearing, before = SimpleNamespace(interrupted=False), signal.getsignal(signal.SIGINT)
    with interrupting(wearing):
        pass
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), interrupting(wearing):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("the second one waits")


def test_a_scene_file_is_a_world_with_a_floor():
    document, editor = open_xr(TOUCH, Options())
    world = editor.world
    assert document.floor_y == -0.7 and document.background_or(DARK) == DARK
    named = {obj.name for obj in document.scene.objects}
    assert named == set(world.objects) >= {"cube", "ball", "ring", "plate"}
    eye = document.view((640, 360)).world_from_eye
    np.testing.assert_allclose(eye.position, (0.05, 0.5, 0.95))
    assert world.aim((-0.22, 1.0, 0.05), (0.0, -1.0, 0.0)).object == "cube"
    assert np.abs(document.bounds()[0]).max() < 0.5


def test_a_package_alone_is_seen_and_not_touched():
    document, editor = open_xr(ROOT / "assets" / "workshop.shift", Options())
    world = editor.world
    (obj,) = world.drawn().objects
    assert (obj.name, document.floor_y) == ("workshop", None)
    world.advance(0.05)
    assert world.drawn().objects[0].world_from_object == obj.world_from_object
    assert world.nearest(np.zeros(3), 10.0) is None
