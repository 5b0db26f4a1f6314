"""What a run's seconds are, how they are told, and that no clock is in what it leaves."""

import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from shapeshift.app import cli, progress
from shapeshift.app.training.fit import without_times
from shapeshift.app.training.train import train
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training import run
from shapeshift.training.photo_store.open_photos import TrainingPhotos
from shapeshift.training.run import LENGTH_STEPS, Progress, Run
from shapeshift.training.schedule import Budget
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.program import HeardLines


class Steps(Run):
    """A run whose steps do what they are told."""

    primitive = param_group = "anchors"
    settled = True

    def __init__(self, kind: str, step, seconds: float | None = None) -> None:
        self.device, self.step = SimpleNamespace(kind=kind), step
        self.settings = SimpleNamespace(seconds=seconds, rates=lambda length: length)
        self.budget = Budget(None if seconds else 5, seconds)
        self.adam, self.schedule = {"anchors": [0]}, SimpleNamespace(photo=None)
        self.photos = TrainingPhotos([], [])
        self.iteration, self.elapsed, self.run_length = 0, 0.0, None

    splat_count = 1

    def compile_kernels(self) -> None:
        burn(0.05)

    def one_step(self):
        self.step()
        self.iteration += 1
        return None, False

    def all_rates(self) -> dict:
        return {}

    def held_out_psnr(self) -> dict:
        return {"RGB": 20.0}


def burn(seconds: float) -> None:
    start = time.process_time()
    while time.process_time() - start < seconds:
        pass


class Clock:
    """The module `time` of a run: its clocks go on by what work says that it took, exactly."""

    def __init__(self) -> None:
        self.processor, self.wall = 1000.0, 5.0

    def process_time(self) -> float:
        return self.processor

    def perf_counter(self) -> float:
        return self.wall

    def burn(self, seconds: float) -> None:
        self.processor, self.wall = self.processor + seconds, self.wall + seconds

    def idle(self, seconds: float) -> None:
        self.wall += seconds


@pytest.fixture
def clock(monkeypatch) -> Clock:
    """No sleep is as long as it was meant to be where others have the cores."""
    clock = Clock()
    monkeypatch.setattr(run, "time", clock)
    return clock


def test_a_processor_s_seconds_are_those_that_it_computed(clock):
    """Waiting costs none; neither do compiling and what is done between the steps."""
    waited = Steps("cpu", lambda: clock.idle(0.5))
    for _ in waited.steps():
        clock.burn(0.25)
    assert waited.elapsed == 0
    worked = Steps("cpu", lambda: clock.burn(0.5))
    assert [now.elapsed for now in worked.steps()] == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert worked.elapsed == 2.5


def test_a_processor_s_seconds_are_those_of_the_system():
    """Without a clock of ours: none for a nap, and all of what is computed."""
    assert run.clock_of(SimpleNamespace(kind="cpu")) is time.process_time
    assert run.clock_of(SimpleNamespace(kind="gpu")) is time.perf_counter
    worked = Steps("cpu", lambda: burn(0.02))
    assert all(now.elapsed >= 0.02 * now.iteration for now in worked.steps())


def test_reading_photos_costs_none_of_the_budget(clock):
    """Be it a step that reads or a thread beside it, which processor time counts with the step."""
    store = SimpleNamespace(read_s=0.0, waited_s=0.0, ahead=0, trouble="")
    steps = Steps("cpu", lambda: read(store, clock.burn))
    steps.photos = TrainingPhotos([], [], store)
    for _ in steps.steps():
        pass
    assert steps.elapsed == pytest.approx(0.05, abs=1e-9)


def read(store, burn) -> None:
    """A step of 10 ms in which a photo is read in 20."""
    burn(0.02)
    store.read_s += 0.02
    burn(0.01)


def test_other_devices_are_timed_by_the_clock(clock):
    waited = Steps("gpu", lambda: clock.idle(0.5))
    for _ in waited.steps():
        clock.idle(0.25)
    assert waited.elapsed == 2.5  # five naps in the steps, not those between them


def test_a_budget_of_seconds_ends_a_run(clock):
    worked = Steps("cpu", lambda: clock.burn(0.125), seconds=1.0)
    assert sum(1 for _ in worked.steps()) == 8 and worked.elapsed == 1


@pytest.mark.parametrize(
    ("seconds", "start", "training"),
    [(None, 5.0, None), (10.0, 0.0, 10.0), (10.0, 4.0, 6.0), (10.0, 5.0, 5.0), (10.0, 9.0, 5.0)],
)
def test_the_start_comes_out_of_the_seconds(seconds, start, training):
    """Up to half of them: without steps there is no scene.  Rates and growing follow the steps."""
    budget = Budget(None if seconds else 100, seconds, start)
    assert budget.training == training
    if training:
        assert budget.fraction(7, 0.0) == 0 and budget.fraction(7, training / 4) == 0.25


def test_what_other_processes_took_is_in_the_start():
    """The photos are matched in one; what comes after it is not, nor is reading.

    Their times come in ticks of 10 ms."""
    steps = Steps("cpu", lambda: burn(0.01), seconds=1.2)
    store = SimpleNamespace(read_s=0.0, waited_s=0.0, ahead=0, trouble="")
    steps.photos = TrainingPhotos([], [], store)
    code = "import time\nwhile time.process_time() < 0.3: pass"
    with steps.counted_start():
        burn(0.1)
        subprocess.run([sys.executable, "-S", "-c", code], check=True)
        read(store, burn)  # 20 ms that do not count, 10 that do
    burn(0.1)
    assert 0.38 <= steps.start_s < 0.5 and steps.budget.start == steps.start_s
    for _ in steps.steps():
        pass
    assert 1.2 <= steps.seconds < 1.25 and steps.seconds == steps.start_s + steps.elapsed


def test_a_run_that_goes_on_has_the_start_it_had(device, tmp_path):
    """Opening the capture again costs nothing of its budget."""
    make_balls(tmp_path / "balls", 32, 8, 2)
    capture, settings = (
        read_capture(tmp_path / "balls"),
        TrainSettings(iterations=3, max_anchors=50),
    )
    first = Trainer(device, capture, settings)
    assert 0 < first.start_s == first.seconds == first.budget.start
    state, notes = first.checkpoint()
    again = Trainer(device, capture, settings, (state, notes | {"start_s": 7.5}))
    assert again.start_s == again.seconds == again.budget.start == 7.5
    del notes["start_s"]  # of a checkpoint that was written before there was such a thing
    assert Trainer(device, capture, settings, (state, notes)).seconds == 0


def test_the_pace_is_that_of_the_steps_before(monkeypatch):
    timed = Steps("cpu", lambda: None, seconds=60.0)
    timed.iteration, timed.elapsed = LENGTH_STEPS, 0.1 * (LENGTH_STEPS - 1)
    timed.adam = SimpleNamespace(set_rates=lambda rates: None)
    timed.fix_run_length()
    assert timed.run_length == pytest.approx(600, abs=1)


def test_without_a_terminal_lines_say_steps_seconds_and_decibels(monkeypatch):
    """The line a minute of every command, here one every 10 ms; the last step waits for it."""
    said = HeardLines(monkeypatch)
    line = "train: 4 steps, 0 core s, 1 anchors, 80 %, RGB 20.00 dB (0 min)"
    steps = Steps("cpu", lambda: steps.iteration == 4 and said.wait(line))
    with progress.lines("train"):
        assert not train(steps, None)
    assert Progress(1, 0.5, None, 3, 1.0).rolled_back is False


def test_the_same_seed_gives_the_same_file_to_the_byte(tmp_path):
    """Whatever the clock says: the second run comes later, and its checkpoint knows it."""
    make_balls(tmp_path / "balls", 48, 8, 2)
    files = []
    for name in ("a", "b"):
        out = tmp_path / name / "scene.shift"
        words = ["train", tmp_path / "balls", "--out", out, "--iterations", 30, "--max-anchors",
                 200]  # fmt: skip
        assert cli.main(list(map(str, words))) == 0
        files.append(out.read_bytes())
    assert files[0] == files[1]


def test_a_need_report_in_a_package_has_no_times():
    report = {"full": {"decode_ms": 1.0, "bytes": 3}, "rows": [{"saves_train_s": 2, "part": "x"}]}
    assert without_times(report) == {"full": {"bytes": 3}, "rows": [{"part": "x"}]}
