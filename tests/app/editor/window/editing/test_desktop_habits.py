"""What people expect of a window: another language, settings that stay, New, recent pictures."""

import json

import numpy as np
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import opened_scene
from shapeshift.app.editor.state.files.opened import OpenedFiles, Source
from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.state.user.recent_pictures import RecentPictures, read_picture, shrunk
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.fonts import is_offered
from shapeshift.app.editor.texts.table import use_language
from shapeshift.app.editor.window.monitor import place_of, put_window
from tests.support.desktop.desktop_stand import PlainRenderer, ball, read_stub, run_frames
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets, every_section


@pytest.fixture
def viewer(window, tmp_path):
    state = EditorState(read_stub)
    found = OpenedFiles((Source(tmp_path / "ball.ply", ball(50)),))
    scene, edited = opened_scene(found)
    state.open_sources(found.sources, scene, None, edited)
    state.bodies.follow = lambda edited: None
    settings = ProgramSettings.read(tmp_path / "config")
    options = Options(pictures=tmp_path / "pictures")
    viewer = Viewer(window, PlainRenderer(window.ctx), state, options, settings)
    run_frames(viewer, 4)
    yield viewer
    viewer.films.gallery.thumbnails.close()
    use_language("en")
    window.restyle()


@pytest.fixture
def hands(viewer, display):
    with RealHands(viewer, display) as hands:
        yield hands
        hands.button(False)
        hands.move(600, 200)


@pytest.mark.parametrize("code", ["de", "ja"])
def test_no_label_is_wider_than_its_button(viewer, code, monkeypatch):
    """Every section open, in the real window: what stands on a button ends within it."""
    if not is_offered(code):
        pytest.skip("no font of this machine has its letters")
    widgets, wide, real = Widgets(monkeypatch), [], imgui.button

    def button(label: str, *size) -> bool:
        done = real(label, *size)
        text = imgui.calc_text_size(label.split("##")[0]).x
        box = imgui.get_item_rect_max().x - imgui.get_item_rect_min().x
        if text > box:
            wide.append((label, round(text), round(box)))
        return done

    monkeypatch.setattr(imgui, "button", button)
    monkeypatch.setattr(panel, "section", lambda *_, **__: True)
    every_section(monkeypatch)
    viewer.parts.toggle()
    viewer.shell.speak(code)
    run_frames(viewer, 4)
    assert not wide
    assert "Delete" not in widgets.boxes or code == "en"
    assert any(label in widgets.boxes for label in ("L\u00f6schen", "\u524a\u9664"))
    assert viewer.parts.on


def test_settings_stay(viewer, hands, window, tmp_path, monkeypatch):
    widgets, file = Widgets(monkeypatch), tmp_path / "config" / "settings.json"
    run_frames(viewer, 2)
    left, *_ = viewer.window.covered[0]
    high = widgets.boxes["Front"][1]
    before = dict(viewer.settings.sections)
    hands.click(left + 100, high - 14)  # the heading of the camera's buttons
    toggled = {k for k in viewer.settings.sections if k not in before}
    assert toggled and json.loads(file.read_text())["sections"] == viewer.settings.sections
    viewer.state.choose_palette("turbo")
    run_frames(viewer, 1)
    assert json.loads(file.read_text())["palette"] == "turbo"
    size, place = window.logical_size, place_of(window.handle)
    put_window(window.handle, (30, 20, 700, 500))
    run_frames(viewer, 3)
    viewer.shell.keep_place()
    again = ProgramSettings.read(tmp_path / "config")
    assert again.place == (30, 20, 700, 500) and again.palette == "turbo"
    assert again.sections == viewer.settings.sections
    put_window(window.handle, (0, 0, *size) if place is None else place)
    run_frames(viewer, 3)


def test_new_is_empty_and_asks_first(viewer, hands, monkeypatch):
    widgets = Widgets(monkeypatch)
    viewer.state.add_region("box")
    viewer.state.regions.placing = False
    run_frames(viewer, 2)
    hands.key("n", "Control_L")
    assert viewer.objects.saving.then is not None  # changes are not saved: it asks
    hands.click(*widgets.middle("Cancel"))
    assert viewer.state.scene.objects
    hands.key("n", "Control_L")
    hands.click(*widgets.middle("Do not save"))
    run_frames(viewer, 3)
    assert not viewer.state.scene.objects and not viewer.objects.unsaved
    assert "The demo" in widgets.boxes  # what can be opened instead


def test_recent_files_have_pictures(viewer, tmp_path):
    files, config = viewer.files, tmp_path / "config"
    files.recent, files.pictures = RecentFiles.read(config), RecentPictures(config)
    files.remember(tmp_path / "ball.ply")
    assert files.picture_due is not None
    for _ in range(10):
        run_frames(viewer, 1)
    assert files.picture_due is None
    (file,) = (config / "recent").iterdir()
    picture = RecentPictures(config).of(tmp_path / "ball.ply")
    assert picture.shape == (54, 96, 3) and abs(int(picture.mean()) - 128) < 6  # the stub's gray
    assert RecentPictures(config).of(tmp_path / "other.ply") is None
    for broken in (
        b"",
        b"no picture",
        file.read_bytes()[:60],
        b"\x89PNG\r\n\x1a\n" + bytes(200_000),
    ):
        file.write_bytes(broken)
        assert read_picture(file) is None


def test_a_small_picture_is_the_middle_of_a_large_one():
    wide = np.zeros((54, 192, 3), np.float32)
    wide[:, 48:144] = 1.0
    assert (shrunk(wide) == 255).all()
    assert shrunk(np.full((3, 2, 3), np.nan)).max() == 0
