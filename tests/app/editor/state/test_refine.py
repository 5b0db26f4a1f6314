"""Levels of detail in the viewer: coarse at once, finer ones meanwhile, nothing else moves."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest

import shapeshift.app.streaming.refine as refine
from shapeshift.app.editor.desktop import attach_refiner
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.quality_controller import QualityController
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.opening import ReadingOptions
from shapeshift.app.streaming.refine import Refiner
from shapeshift.runtime_models.model import BadFile
from tests.support.splat_scenes import one_splat
from tests.support.splats.sog_scenes import COUNTS, write_streamed

LONGEST_S = 30.0


class FakeRenderer:
    """Notes what it is given; more splats than it holds are refused."""

    def __init__(self, most: int = 10**9) -> None:
        self.most, self.drawn = most, []

    def update(self, scene) -> None:
        count = sum(obj.model.splat_count for obj in scene.objects)
        if count > self.most:
            raise BadFile(f"{count} splats are more than {self.most}.")
        self.drawn.append(count)


class FakeViewer:
    """The part of the viewer that levels of detail touch."""

    def __init__(self, refiner: Refiner, paths: list[Path], most: int = 10**9) -> None:
        self.state, self.hooks = EditorState(refiner.open), Hooks()
        self.renderer, self.changes = FakeRenderer(most), 0
        self.dial = QualityController()
        self.state.open(paths)
        self.renderer.update(self.state.scene)
        attach_refiner(refiner, self.state, self.hooks, self.renderer.update, self._changed)

    def _changed(self) -> None:
        self.changes += 1
        self.dial.scene_changed()

    def counts(self) -> list[int]:
        return [obj.model.splat_count for obj in self.state.scene.objects]

    def open(self, *paths: Path) -> None:
        """As dropping files on the window does."""
        self.state.open(paths)
        for changed in self.hooks.opened:
            changed()

    def frame(self) -> bool:
        return any([work() for work in self.hooks.each_frame])

    def run(self) -> list[list[int]]:
        """Frames until nothing is under way; what was shown, each once."""
        seen, until = [self.counts()], time.monotonic() + LONGEST_S
        while self.frame():
            assert time.monotonic() < until
            if self.counts() != seen[-1]:
                seen.append(self.counts())
            time.sleep(0.002)
        if self.counts() != seen[-1]:
            seen.append(self.counts())
        return seen

    @property
    def status(self) -> list[str]:
        return [word for word in (said() for said in self.hooks.status) if word]


@pytest.fixture
def scene(tmp_path) -> Path:
    return write_streamed(tmp_path / "scene")


def test_the_coarsest_level_is_there_at_once_and_finer_ones_follow(scene):
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        assert viewer.counts() == [20] and viewer.status[0].startswith("detail 1 of 4")
        state = viewer.state
        state.set_x(0, 0.25)
        before = (state.centre.copy(), state.radius, state.settings, state.sweeps, state.palette)
        assert viewer.run() == [[20], [150], [400]]
        assert viewer.status == ["detail 4 of 4"] and not refiner.running
        assert state.scene.objects[0].x == 0.25 and state.scene.objects[0].name == "scene"
        after = (state.centre, state.radius, state.settings, state.sweeps, state.palette)
        assert np.array_equal(before[0], after[0]) and before[1:] == after[1:]
        [source] = state.sources
        assert source.path == scene and source.facts["splats"] == 400
        assert source.model is state.scene.objects[0].model and state.findings == []
        assert viewer.renderer.drawn == [20, 150, 400] and viewer.changes == 2


def test_the_budget_bounds_it(scene):
    for budget, wanted in ((160, [[20], [150]]), (20, [[20]]), (7, [[7]])):
        with Refiner(ReadingOptions(max_splats=budget)) as refiner:
            viewer = FakeViewer(refiner, [scene])
            assert viewer.run() == wanted


def test_files_without_levels_are_left_alone(tmp_path, scene):
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    one, path = one_splat(), tmp_path / "one.ply"
    write_ply(PlainSplats(one.means, one.scales, one.wxyz, one.opacity, one.sh), path)
    with Refiner(ReadingOptions()) as refiner:
        for name in (path, scene / "0_0"):
            viewer = FakeViewer(refiner, [name])
            assert not refiner.running and viewer.status == [] and len(viewer.run()) == 1
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [path, scene])
        assert viewer.run() == [[1, 20], [1, 150], [1, 400]]


def reading_thread() -> threading.Thread:
    """The newest: one that has been sent away may still read its last level."""
    return [thread for thread in threading.enumerate() if thread.name == refine.THREAD][-1]


def test_another_scene_ends_the_reading_of_the_one_before(tmp_path, scene):
    other = write_streamed(tmp_path / "other", (90, 9))
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        first = reading_thread()
        viewer.open(other, other)
        first.join(LONGEST_S)
        assert not first.is_alive()
        seen = viewer.run()
        assert seen[0] == [9, 9] and seen[-1] == [90, 90]
        assert all(count in (9, 90) for counts in seen for count in counts)


def test_a_level_for_a_scene_that_is_not_shown_any_more_is_dropped(scene):
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        viewer.state.open([scene / "1_0"])  # the reader was not told yet
        assert viewer.run() == [[COUNTS[1]]]


def test_a_level_that_the_driver_does_not_hold_leaves_the_one_before(scene):
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene], most=200)
        assert viewer.run() == [[20], [150]]
        assert "no finer level can be shown: 400 splats" in viewer.state.problem
        assert not refiner.running and viewer.status == ["detail 3 of 4"]


def test_a_broken_finer_level_is_said_and_the_coarse_one_stays(scene):
    (scene / "0_0" / "sh0.webp").write_bytes(b"no picture")
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        assert viewer.run() == [[20], [150]]
        assert "no finer level can be shown: 0_0/meta.json" in viewer.state.problem
        viewer.state.problem = ""
        viewer.frame()
        assert viewer.state.problem == ""  # said once


def test_a_budget_that_was_chosen_is_chosen_again(scene):
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        viewer.dial.choice = object()
        viewer.run()
        assert viewer.dial.wanted


def test_the_window_never_waits_for_a_level(scene, monkeypatch):
    gate, real = threading.Event(), refine.levels

    def slow(path, reading):
        for number, level in enumerate(real(path, reading)):
            if number:
                assert gate.wait(LONGEST_S)
            yield level

    monkeypatch.setattr(refine, "levels", slow)
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        for _ in range(50):
            assert viewer.frame()  # something is under way
        assert reading_thread().is_alive() and viewer.counts() == [20]  # no frame waited for it
        gate.set()
        assert viewer.run()[-1] == [400]


def test_another_scene_does_not_wait_for_the_level_that_is_being_read(scene, monkeypatch):
    gate, real = threading.Event(), refine.levels

    def stuck(path, reading):
        yield from [next(real(path, reading))]
        assert gate.wait(LONGEST_S)
        raise BadFile("read too late.")

    monkeypatch.setattr(refine, "levels", stuck)
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        first = reading_thread()
        viewer.open(scene / "1_0")
        assert first.is_alive(), "it was waited for"
        assert not refiner.running and viewer.status == []
        gate.set()
        first.join(LONGEST_S)
        assert refiner.problem == "" and viewer.counts() == [COUNTS[1]]


def test_closing_ends_the_thread(scene):
    with Refiner(ReadingOptions()) as refiner:
        viewer = FakeViewer(refiner, [scene])
        thread = reading_thread()
    assert not thread.is_alive() and not refiner.running and refiner.next_level() is None
    assert viewer.counts() == [20]


def test_what_does_not_exist_is_one_sentence(tmp_path):
    with Refiner(ReadingOptions()) as refiner, pytest.raises(BadFile, match="does not exist"):
        refiner.open(tmp_path / "nothing")
