"""The panel's section "Export" under Xvfb: what is written, in the background, and what is said."""

import time
import webbrowser
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.editor.state.files.exporting import EVERYTHING, REGIONS, Exporting
from shapeshift.runtime_models.splats.formats import read_plain
from tests.support.desktop.desktop_stand import ball, run_frames
from tests.support.desktop.widgets import Widgets
from tests.support.splats.writers import EACH_WRITER


@pytest.fixture
def panel(viewer):
    exporting = Exporting(
        viewer.state, viewer.viewpoint, viewer.options.pictures.parent / "exports"
    )
    viewer.hooks.each_frame.append(exporting.poll)
    viewer.hooks.opened.append(exporting.forget)
    return exporting


def finish(viewer, panel, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while panel.running:
        assert time.monotonic() < end
        run_frames(viewer, 1)


def exported(viewer) -> list[Path]:
    folder = viewer.options.pictures.parent / "exports"
    return sorted(folder.iterdir()) if folder.exists() else []


@EACH_WRITER
def test_every_format_is_written_and_said(viewer, panel, writer):
    panel.ending = writer.ending
    panel.start()
    finish(viewer, panel)
    (path,) = exported(viewer)
    assert path.name == f"ball-x0.00{writer.ending}"
    assert path.name in viewer.state.messages.note and "splats" in viewer.state.messages.note
    assert len(read_plain(path).means) == len(ball().means)


def test_no_file_is_written_over(viewer, panel):
    for _ in range(3):
        panel.start()
        finish(viewer, panel)
    names = [path.name for path in exported(viewer)]
    assert names == ["ball-x0.00-2.ply", "ball-x0.00-3.ply", "ball-x0.00.ply"]


def test_it_is_as_shown(viewer, panel):
    """x and palette of now: the ball of the stub is green, at the thermal stop it is not."""
    viewer.state.set_x(0, 1.0)
    panel.start()
    viewer.state.set_x(0, 0.0)  # moved meanwhile: not in the file
    finish(viewer, panel)
    panel.palette = False
    viewer.state.set_x(0, 1.0)
    panel.start()
    finish(viewer, panel)
    tinted, plain = (read_plain(path) for path in reversed(exported(viewer)))
    green = plain.sh[0, 0]
    assert green[1] > green[0] and not tinted.sh[0, 0, 1] > tinted.sh[0, 0, 0]
    assert exported(viewer)[-1].name == "ball-x1.00.ply"


def test_inside_the_regions_and_one_object(viewer, panel):
    state = viewer.state
    one = state.scene.objects[0]
    state.show(replace(state.scene, objects=(one, replace(one, name="other"))))
    panel.forget()
    assert panel.choices()[0] == [EVERYTHING, 0, 1]
    state.add_region("half-space")
    state.regions.edit(0, centre=np.zeros(3), normal=np.array([0.0, 1, 0]), border=0.0)
    assert panel.choices()[0][-1] == REGIONS
    panel.what = REGIONS
    panel.start()
    finish(viewer, panel)
    panel.what = 1
    panel.start()
    finish(viewer, panel)
    panel.what = EVERYTHING
    panel.start()
    finish(viewer, panel)
    upper = read_plain(viewer.options.pictures.parent / "exports" / "ball-x0.00.ply")
    assert upper.means[:, 1].min() >= -1e-6 and 800 < len(upper.means) < 1200
    folder = viewer.options.pictures.parent / "exports"
    assert len(read_plain(folder / "other-x0.00.ply").means) == 2000
    assert len(read_plain(folder / "ball and 1 more-x0.00.ply").means) == 4000


def test_what_goes_wrong_is_in_the_box_and_leaves_nothing(viewer, panel, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shapeshift.app.editor.state.files.exporting.export", full)
    panel.start()
    finish(viewer, panel)
    assert "No space left" in viewer.state.problem and not exported(viewer)
    viewer.state.problem = ""
    (viewer.options.pictures.parent / "exports").rmdir()
    (viewer.options.pictures.parent / "exports").write_text("a file")
    panel.start()
    assert viewer.state.problem and not panel.running


def test_the_window_goes_on_while_it_is_written(viewer, panel, monkeypatch):
    from threading import Event

    go = Event()
    monkeypatch.setattr(
        "shapeshift.app.editor.state.files.exporting.export",
        lambda *_: go.wait(20) and ball(),
    )
    panel.start()
    run_frames(viewer, 3)
    assert panel.running and panel.poll()
    go.set()
    finish(viewer, panel)
    assert not viewer.state.problem


@pytest.mark.parametrize("browser", [True, False, None])
def test_share_makes_the_page_and_opens_it(viewer, hands, browser, monkeypatch):
    """By the command; where no browser is there or starts (None, False) it says where it lies."""
    began, opened = [], []
    child = SimpleNamespace(progress=("writing", 0.4), code=None, cancelled=False, problem=str)
    module = "shapeshift.app.film.window.rendering"
    monkeypatch.setattr(f"{module}.ProgramChild", lambda words: began.append(words) or child)

    def get() -> SimpleNamespace:
        if browser is None:
            raise webbrowser.Error
        return SimpleNamespace(open=lambda url: opened.append(url) or browser)

    monkeypatch.setattr(webbrowser, "get", get)
    widgets = Widgets(monkeypatch)
    viewer.shell.choose_tool("Share")
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Make the page and open it"))
    (words,) = began
    assert words[:3] == ["export", "ball.shift", "--out"] and viewer.films.page.running
    path = Path(words[3])
    assert path.parent.name == "exports" and path.suffix == ".html"
    assert "page 40%" in [words() for words in viewer.hooks.status]
    child.code = 0
    end = time.monotonic() + 20
    while viewer.films.page.poll() and time.monotonic() < end:
        run_frames(viewer, 1)
    note = viewer.state.messages.note
    assert str(path) in note and ("No browser" in note) == (not browser)
    assert opened == [path.as_uri()] * (browser is not None)


def test_a_page_of_a_scene_that_is_not_saved_says_so(viewer):
    viewer.state.add_region("box")
    viewer.films.page.start()
    assert "save it first" in viewer.state.problem and not viewer.films.page.running
