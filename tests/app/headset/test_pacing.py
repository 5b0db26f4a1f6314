"""What a headset's frames are drawn with: exact where time allows, the floor never left."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import ClassVar, get_args, get_type_hints

import numpy as np
import pytest

from shapeshift.app.charts.quick_chart import QUICK, QuickRow
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.pacing import (
    AUTO,
    FIXED,
    LATE,
    PART,
    PRICED,
    QUALITIES,
    Pacing,
    StereoChart,
)
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene

BACKGROUND = (0.1, 0.2, 0.3)
PERIOD = 0.010  # seconds
TARGET = PART * PERIOD * 1e3  # ms


@dataclass
class FakeChart:
    """Times that are known: name -> (ms, dB)."""

    exact: float
    priced: dict = field(default_factory=dict)
    measured: int = 0

    def exact_ms(self) -> float:
        return self.exact

    def rows(self) -> tuple[QuickRow, ...]:
        self.measured += 1
        settings = {"exact": RenderSettings()}
        settings |= {name: RenderSettings(**changes) for name, changes in QUICK.items()}
        priced = {"exact": (self.exact, 99.0), **self.priced}
        return tuple(QuickRow(name, settings[name], *row) for name, row in priced.items())


def test_what_is_far_from_the_period_is_exact_and_not_measured(capsys):
    pacing, chart = Pacing(BACKGROUND), FakeChart(0.5 * TARGET)
    assert pacing.wants_measure(PERIOD) and not pacing.wants_measure(0.0)
    pacing.measure(chart, PERIOD)
    assert pacing.settings() == RenderSettings(background=BACKGROUND)
    assert chart.measured == 0 and capsys.readouterr().err == ""
    assert not pacing.wants_measure(PERIOD) and not pacing.wants_measure(1.05 * PERIOD)
    assert pacing.wants_measure(2 * PERIOD)


def test_what_is_too_slow_is_the_best_that_is_fast_enough(capsys):
    pacing = Pacing(BACKGROUND)
    rows = {
        "1 px footprint": (0.9 * TARGET, 41.0), "2 px footprint": (0.5 * TARGET, 36.0),
        "16-bit keys": (1.9 * TARGET, 70.0), "50 % scale": (0.4 * TARGET, 30.0),
    }  # fmt: skip
    pacing.measure(FakeChart(2 * TARGET, rows), PERIOD)
    assert pacing.chosen == "1 px footprint" and "41.0 dB" in capsys.readouterr().err
    assert pacing.settings() == RenderSettings(background=BACKGROUND, min_pixels=1.0)
    for _ in range(200):  # late however often: on top of it nothing is priced
        pacing.seen(3 * TARGET, 3 * TARGET)
    assert pacing.settings().render_scale == 1.0


def test_late_frames_have_fewer_pixels_but_never_below_what_the_floor_was_priced_at():
    pacing = Pacing(BACKGROUND)
    rows = {"75 % scale": (0.8 * TARGET, 38.0), "50 % scale": (0.5 * TARGET, 33.0)}
    pacing.measure(FakeChart(0.95 * TARGET, rows), PERIOD)
    assert pacing.chosen == "exact" and pacing.settings().render_scale == 1.0
    for _ in range(200):
        pacing.seen(2 * TARGET, 2 * TARGET)
    assert pacing.settings().render_scale == 0.75
    for _ in range(2000):
        pacing.seen(0.3 * TARGET, 0.3 * TARGET)
    assert pacing.settings().render_scale == 1.0


def test_frames_that_stay_late_are_drawn_with_a_quicker_row_at_the_floor_or_better(capsys):
    """Exact was priced as quick enough where one began; here all takes half as long again."""
    pacing = Pacing(BACKGROUND)
    rows = {
        "75 % scale": (0.9 * TARGET, 40.0), "1 px footprint": (0.65 * TARGET, 45.0),
        "2 px footprint": (0.5 * TARGET, 37.0), "50 % scale": (0.2 * TARGET, 33.0),
    }  # fmt: skip
    pacing.measure(FakeChart(0.95 * TARGET, rows), PERIOD)
    assert pacing.chosen == "exact"
    for _ in range(LATE - 1):
        pacing.seen(1.42 * TARGET, 1.42 * TARGET)
    assert pacing.chosen == "exact", "a few late ones are no reason"
    pacing.seen(1.42 * TARGET, 1.42 * TARGET)
    assert pacing.chosen == "1 px footprint" and pacing.settings().render_scale == 1.0
    assert "45.0 dB" in capsys.readouterr().err and pacing.report()["chosen_db"] == 45.0
    for _ in range(10 * LATE):
        pacing.seen(0.97 * TARGET, 0.97 * TARGET)
    assert pacing.chosen == "1 px footprint"
    for _ in range(20 * LATE):
        pacing.seen(3 * TARGET, 3 * TARGET)
    assert pacing.chosen == "2 px footprint", "what is below the floor is never taken"


def test_a_chosen_scale_is_where_fewer_pixels_begin():
    pacing = Pacing(BACKGROUND)
    rows = {"75 % scale": (1.2 * TARGET, 40.0), "50 % scale": (0.8 * TARGET, 36.0)}
    pacing.measure(FakeChart(2 * TARGET, rows), PERIOD)
    assert pacing.settings().render_scale == 0.5
    for _ in range(200):
        pacing.seen(2 * TARGET, 2 * TARGET)
    assert pacing.settings().render_scale == 0.5


def test_what_proves_slow_later_is_measured_once_then():
    pacing, chart = Pacing(BACKGROUND), FakeChart(0.5 * TARGET, {"75 % scale": (TARGET, 38.0)})
    pacing.measure(chart, PERIOD)
    for _ in range(LATE):
        assert not pacing.wants_measure(PERIOD)
        pacing.seen(2 * TARGET, 2 * TARGET)
    assert pacing.wants_measure(PERIOD)
    pacing.measure(chart, PERIOD)
    assert chart.measured == 1
    for _ in range(2 * LATE):
        pacing.seen(2 * TARGET, 2 * TARGET)
    assert not pacing.wants_measure(PERIOD)


def test_another_period_chooses_again_from_what_was_measured():
    pacing = Pacing(BACKGROUND)
    chart = FakeChart(2 * TARGET, {"1 px footprint": (0.9 * TARGET, 41.0)})
    pacing.measure(chart, PERIOD)
    assert pacing.chosen == "1 px footprint" and pacing.wants_measure(3 * PERIOD)
    pacing.measure(chart, 3 * PERIOD)
    assert pacing.chosen == "exact" and chart.measured == 1


def test_splats_have_what_all_else_leaves_and_are_not_blamed_for_it():
    pacing = Pacing(BACKGROUND)
    for _ in range(LATE):
        pacing.seen(1.0, 1.0 + TARGET / 2)
    pacing.measure(FakeChart(0.7 * TARGET, {"75 % scale": (0.4 * TARGET, 38.0)}), PERIOD)
    assert pacing.chosen == "75 % scale"  # alone the exact picture would have been in time
    pacing = Pacing(BACKGROUND)
    rows = {"75 % scale": (0.8 * TARGET, 38.0), "50 % scale": (0.5 * TARGET, 36.0)}
    pacing.measure(FakeChart(0.9 * TARGET, rows), PERIOD)
    for _ in range(200):
        pacing.seen(0.2 * TARGET, 5 * TARGET)
    assert pacing.target_ms == pytest.approx(0.25 * TARGET)
    assert pacing.settings().render_scale == 1.0


def test_times_that_do_not_count_change_nothing():
    pacing = Pacing(BACKGROUND)
    pacing.measure(FakeChart(2 * TARGET, {"75 % scale": (TARGET, 38.0)}), PERIOD)
    before = pacing.settings()
    for ms in (0.0, -1.0, float("nan")):
        for _ in range(100):
            pacing.seen(ms, 1.0)
            pacing.seen(ms, ms)
    assert pacing.settings() == before


@pytest.mark.parametrize("quality", FIXED)
def test_a_fixed_quality_stays_as_it_is(quality):
    pacing = Pacing(BACKGROUND, quality)
    assert not pacing.wants_measure(PERIOD)
    before = pacing.settings()
    for _ in range(100):
        pacing.seen(1000.0, 1000.0)
    assert pacing.settings() == before and before.background == BACKGROUND
    assert (before.render_scale < 1) == (quality == "fast")


def test_what_is_priced_and_what_is_fixed_are_rows_of_the_quick_chart():
    assert set(PRICED) <= set(QUICK)
    assert {name for name in FIXED.values() if name} <= set(QUICK)


class SlowRenderer:
    """Draws nothing, `seconds` a frame, and keeps what it was asked for."""

    backends: ClassVar = {"drawing": "tiles"}

    def __init__(self, clock) -> None:
        self.clock, self.settings, self.eyes = clock, RenderSettings(background=BACKGROUND), []

    def update(self, scene) -> None:
        self.clock.now += self.clock.each

    def draw(self, views) -> None:
        self.eyes.append([view.world_from_eye.position for view in views])

    def resolved(self, i):
        return np.zeros((4, 4, 3), np.float32)


@pytest.mark.parametrize(("each", "most"), [(0.01, len(PRICED)), (0.2, 2), (10.0, 0)])
def test_a_chart_ends_with_its_patience_and_draws_both_eyes(monkeypatch, each, most):
    clock = SimpleNamespace(now=0.0, each=each)
    monkeypatch.setattr("time.perf_counter", lambda: clock.now)
    renderer = SlowRenderer(clock)
    eye = look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    other = Pose(eye.position + np.array([0.06, 0, 0]), eye.wxyz)
    views = [View(at, (-1, 1, -1, 1), 0.1, 10.0, (8, 8)) for at in (eye, other)]
    chart = StereoChart(renderer, Scene(()), views, np.zeros(3), lambda: None)
    rows = chart.rows()
    names = [row.name for row in rows]
    assert names == ["exact", *PRICED[: len(rows) - 1]] and len(rows) - 1 <= most
    assert len(rows) - 1 == most or each == 0.2
    assert renderer.settings == RenderSettings(background=BACKGROUND)
    for left, right in renderer.eyes:  # turned about the middle, as far apart as ever
        assert np.linalg.norm(left - right) == pytest.approx(0.06)
        assert np.linalg.norm(left) == pytest.approx(2.0)


def test_the_panel_offers_what_there_is():
    """As many as the command line knows."""
    assert set(get_args(get_type_hints(Options)["quality"])) == set(QUALITIES)
    assert QUALITIES[0] == AUTO


def test_a_chart_prices_all_four_views_by_the_worse_of_the_left_eye_s(monkeypatch):
    """The inset differs by more than the wide view: its dB is the row's; right eyes have none."""
    clock = SimpleNamespace(now=0.0, each=0.001)
    monkeypatch.setattr("time.perf_counter", lambda: clock.now)
    renderer, off = SlowRenderer(clock), {0: 0.01, 1: 0.9, 2: 0.05, 3: 0.8}

    def resolved(i):
        exact = renderer.settings.render_scale == 1 and not renderer.settings.min_pixels
        exact &= renderer.settings.resort_frames == 1
        return np.full((4, 4, 3), 0.0 if exact else off[i], np.float32)

    renderer.resolved = resolved
    eye = look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    poses = [Pose(eye.position + np.array([x, 0, 0]), eye.wxyz) for x in (0.0, 0.06) * 2]
    views = [
        View(pose, (-w, w, -w, w), 0.1, 10.0, (8, 8))
        for pose, w in zip(poses, (1, 1, 0.2, 0.2), strict=True)
    ]
    rows = StereoChart(renderer, Scene(()), views, np.zeros(3), lambda: None).rows()
    assert [row.name for row in rows] == ["exact", *PRICED]
    for row in rows[1:]:
        assert row.db == pytest.approx(-20 * np.log10(0.05), abs=1e-4)
    for places in renderer.eyes:
        left, right, left_inset, right_inset = places
        assert np.linalg.norm(left - right) == pytest.approx(0.06)
        np.testing.assert_allclose(left, left_inset, atol=1e-12)
        np.testing.assert_allclose(right, right_inset, atol=1e-12)
