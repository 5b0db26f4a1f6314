"""Scenes, starts and pictures without taking the headset off: the parts, without a runtime."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.headset import scene_shelf
from shapeshift.app.headset.save_start import save_start
from shapeshift.app.headset.scene_shelf import PICTURE_AFTER, SceneShelf, open_xr
from shapeshift.app.headset.session.recorder import Shutter
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.paths import TOUCH
from shapeshift.scene.pose import look_at
from tests.support.three_stops import three_stop_package
from tests.support.vr.vr_panel import an_editor, item


@pytest.fixture
def package(tmp_path) -> Path:
    return three_stop_package(tmp_path / "three.shift")


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    return tmp_path


def polled(shelf: SceneShelf, fail) -> object:
    """What the thread has read; it always comes to an end."""
    while shelf.opening is not None:
        if (opened := shelf.poll(fail)) is not None:
            return opened
        time.sleep(0.001)
    return None


def test_a_scene_is_read_in_a_thread_and_comes_first_in_the_list(tmp_path, package):
    said: list[str] = []
    shelf = SceneShelf(tmp_path / "config", keeps=True)
    assert shelf.rows == [("The demo", TOUCH)]
    shelf.open(tmp_path / "gone.shift")
    shelf.open(package)  # not while another one is read
    assert polled(shelf, said.append) is None
    assert len(said) == 1 and "gone.shift" in said[0] and shelf.shown == TOUCH
    shelf.open(package)
    document, editor = polled(shelf, said.append)
    assert [obj.name for obj in document.scene.objects] == ["three"] and editor.bodies.world
    assert shelf.rows[0] == ("three.shift", package) and shelf.shown == package
    read: list[int] = []
    for _ in range(PICTURE_AFTER + 5):
        shelf.saw(lambda: read.append(1) or np.full((30, 40, 3), 0.5))
    assert read == [1] and shelf.pictures.of(package).shape == (54, 96, 3)
    quiet = SceneShelf(tmp_path / "config", shown=package)
    assert quiet.rows[0] == ("three.shift", package)
    again = SceneShelf(tmp_path / "other", shown=package)
    assert again.rows == [("The demo", TOUCH)]
    assert RecentFiles.read(tmp_path / "other").paths == (), "it keeps nothing unasked"


def test_a_scene_that_memory_is_too_small_for_is_told(tmp_path, package, monkeypatch):
    def read(path, options):
        raise MemoryError

    monkeypatch.setattr(scene_shelf, "open_xr", read)
    said: list[str] = []
    shelf = SceneShelf()
    shelf.open(package)
    assert polled(shelf, said.append) is None
    assert said == ["three.shift needs more memory than there is."]


def test_a_start_makes_a_scene_file_once_and_is_written_over_then(home, package):
    before = package.read_bytes()
    _, editor = open_xr(package, ReadingOptions())
    for eye in ((1.0, 1.5, 2.0), (-1.0, 1.5, 2.0)):
        assert save_start(editor, look_at(np.array(eye), np.array([0.0, 1.0, 0.0])))
        (path,) = (home / "documents" / "Shapeshift" / "scenes").iterdir()
        view = json.loads(path.read_text())["view"]
        assert view["eye"] == list(eye) and editor.edited.path == path
    assert package.read_bytes() == before
    document, _ = open_xr(path, ReadingOptions())
    pose = document.view((64, 36)).world_from_eye
    np.testing.assert_allclose(pose.position, (-1.0, 1.5, 2.0), atol=1e-6)
    # Straight down nobody knows which way is up: said, and nothing is written.
    down = look_at(np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.0, 0.0]), (0.0, 0.0, -1.0))
    stamp = path.read_bytes()
    assert not save_start(editor, down) and path.read_bytes() == stamp
    assert "straight up or down" in editor.messages.problems[-1]


def test_a_picture_is_a_png_and_a_folder_that_is_none_is_said(tmp_path):
    said: list = []
    shutter = Shutter(tmp_path / "pictures")
    picture = np.zeros((4, 6, 3), np.float32)
    picture[0, 0], picture[1] = (1.0, np.float32(0.5), 2.0), -1.0
    shutter.press()
    assert shutter.due
    shutter.expose(picture)
    shutter.press()
    assert not shutter.due, "one after the other"
    shutter.close()
    shutter.poll(said.append, said.append)
    (path,) = said
    shown = np.asarray(Image.open(path))
    assert shown.shape == (4, 6, 3) and list(shown[0, 0]) == [255, 128, 255] and not shown[1:].any()
    (tmp_path / "file").write_text("")
    broken = Shutter(tmp_path / "file")
    broken.press()
    broken.expose(picture)
    broken.close()
    broken.poll(said.append, said.append)
    assert "file is a file; name a folder" in said[1]


def test_work_is_not_lost_by_one_press(ctx):
    from shapeshift.app.editor.state.object_edits import ObjectEdits
    from shapeshift.app.headset.panel_picture import PanelPicture
    from tests.support.vr.vr_panel import Wearer, a_state

    picture = PanelPicture(ctx)
    wearer = Wearer(picture, a_state(an_editor(item("cube"))))
    shelf = wearer.menu.shelf
    opened: list[Path] = []
    shelf.open = opened.append
    wearer.unfold("Scenes")
    wearer.scroll_to("The demo")
    wearer.press("The demo")
    assert opened == [TOUCH]
    objects = ObjectEdits(wearer.editor, None, lambda: None)
    objects.change(wearer.editor.edited.file.items[0], "mass", mass_kg=2.0)
    wearer.press("The demo")
    assert opened == [TOUCH] and "not saved" in wearer.editor.messages.note
    wearer.press("The demo")
    assert opened == [TOUCH, TOUCH]
    picture.release()
