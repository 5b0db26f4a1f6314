"""Styles from the gallery: the command that is started, what is shown of it, and its end."""

import time
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest

from shapeshift.app.editor.state.arrange import undo
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.film.window import style_work
from shapeshift.app.film.window.style_work import SHAPES, StyleWork
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.stop_weights import StopWeights
from tests.support.three_stops import four_stop_package, three_stop_package


class StandIn:
    """A child that ends as it is told to."""

    started: ClassVar[list] = []

    def __init__(self, words) -> None:
        self.words = list(words)
        self.started.append(self)
        self.progress, self.said, self.code = ("shape: fur, 40%", 0.4), "", None
        self.cancelled = False

    def cancel(self) -> None:
        self.cancelled, self.code = True, -15

    def problem(self) -> str:
        return "" if self.code == 0 else self.said


@pytest.fixture
def child(monkeypatch):
    monkeypatch.setattr(style_work, "ProgramChild", StandIn)
    monkeypatch.setattr(StandIn, "started", [])
    return StandIn.started


@pytest.fixture
def work(tmp_path):
    """The gallery's work on a package that lies on the disk, and what was shown of it."""
    state = EditorState(read_model)
    state.open([three_stop_package(tmp_path / "three.shift")])
    shown: list[Path] = []
    work = StyleWork(state, tmp_path / "scenes", shown.append)
    return state, work, shown


def test_the_command_is_the_program_s_own(work, child, tmp_path):
    state, styles, shown = work
    styles.shape, styles.strength = "melt", 0.5
    styles.add("Opened")
    out = tmp_path / "scenes" / "three-melt-001.shift"
    assert child[0].words == [
        "style", str(tmp_path / "three.shift"), "--out", str(out), "--shape", "melt",
        "--name", "Melt", "--from", "Opened", "--strength", "0.5",
    ]  # fmt: skip
    assert styles.running and styles.poll() and styles.status() == "style 40%"
    styles.cancel()
    assert styles.poll() and not styles.running and not shown
    assert "nothing was written" in state.messages.note and not state.problem


def test_a_refusal_is_said_and_a_success_shown(work, child):
    state, styles, shown = work
    styles.remove("Thermal")
    assert child[0].words[-2:] == ["--remove", "Thermal"]
    assert styles.progress == ("shape: fur, 40%", 0.4)
    child[0].said, child[0].code = "the stop stays.", 2
    styles.poll()
    assert not styles.running and "the stop stays" in state.problem and not shown
    styles.remove("Thermal")
    child[1].code = 0
    styles.poll()
    assert [path.name for path in shown] == ["three-without-001.shift"]


def test_a_name_that_is_taken_gets_a_number(work):
    _, styles, _ = work
    styles.shape = "fur"
    assert styles.name() == "Fur"
    state = work[0]
    model = state.scene.objects[0].model
    state.replace_model(0, replace(model, stops=(Stop("FUR", 0.0), *model.stops[1:])))
    assert styles.name() == "Fur 2"


def test_beside_unsaved_edits_the_object_gets_the_new_package(work, child, tmp_path):
    """In place, as one edit that can be undone; in the headset it is always so."""
    state, styles, shown = work
    state.add_region("sphere")
    state.record_regions()
    styles.shape = "melt"
    styles.add("RGB")
    made = four_stop_package(tmp_path / "scenes" / "three-melt-001.shift")
    child[0].code = 0
    styles.poll()
    assert not state.problem and not shown and str(made) in state.messages.note
    obj = state.scene.objects[0]
    assert [stop.name for stop in obj.model.stops] == ["RGB", "Melt", "Thermal", "Opened"]
    assert obj.x == 0.3 and state.edited.unsaved
    state.set_x(0, StopWeights((("Melt", 0.5), ("Opened", 0.5))))  # its own stops are known
    assert undo(state) == "style of three"
    assert [s.name for s in state.scene.objects[0].model.stops] == ["RGB", "Thermal", "Opened"]
    assert len(state.regions.items) == 1


def test_what_was_made_and_cannot_be_shown_is_said(work, child):
    state, styles, _ = work
    state.add_region("sphere")
    state.record_regions()
    styles.add("RGB")
    child[0].code = 0
    styles.poll()
    assert "cannot be shown" in state.problem


def test_shapes_are_the_command_s():
    assert "fur" in SHAPES and "" not in SHAPES and len(SHAPES) >= 7


@pytest.mark.slow
def test_a_stop_comes_and_goes(work):
    """The real command: the new stop is the last of four, then there are three again."""
    state, styles, shown = work
    styles.shape = "points"
    styles.add("RGB")
    wait_for(styles)
    assert not state.problem
    assert [s.name for s in read_package(shown[0]).stops] == ["RGB", "Thermal", "Opened", "Points"]
    state.open([shown[0]])
    styles.remove("Points")
    wait_for(styles)
    assert [s.name for s in read_package(shown[1]).stops] == ["RGB", "Thermal", "Opened"]


def wait_for(styles: StyleWork) -> None:
    end = time.monotonic() + 300
    while styles.poll() and styles.running:
        assert time.monotonic() < end
        time.sleep(0.05)


def test_the_new_stop_is_gone_to_as_soon_as_it_is_open(work, child, tmp_path):
    """It is the last one: from RGB on the ways are those that were there."""
    state, styles, shown = work
    styles.shape = "melt"
    styles.add("RGB")
    four_stop_package(styles.path)
    child[-1].code = 0
    styles.stop = read_package(styles.path).stops[-1].name  # as the command would have called it
    assert styles.poll() and shown == [styles.path]
    styles.poll()
    assert state.scene.objects[0].x == 0.0  # it is not open yet
    state.open(shown)
    styles.poll()
    state.finish_shifts()
    assert state.scene.objects[0].slider_x == 1.0 and "last stop" in state.messages.note
    state.set_x(0, 0.0)
    styles.poll()
    assert not state.shifts  # once
