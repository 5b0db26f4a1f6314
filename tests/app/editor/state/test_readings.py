"""What the viewer tells about speed and likeness: the last second, exact or not, the budget."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.charts.comparison import (
    MOST_DB,
    REST_S,
    Comparison,
    exact,
    is_exact,
    measure_error,
    shortcuts,
)
from shapeshift.app.charts.quick_chart import QUICK, QuickChart, turned
from shapeshift.app.editor.state.frame_stats import FEWEST, Meter
from shapeshift.app.editor.state.quality_controller import QualityController
from shapeshift.app.editor.window.shown import FrameRequest, Shown, rested
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import View, look_at
from shapeshift.scene.scene import Scene

VIEW = View(look_at(np.array([0.0, 0, 4]), np.zeros(3)), (-0.4, 0.4, -0.3, 0.3), 0.1, 50.0, (8, 6))
NOISE = np.random.default_rng(0).normal(size=(6, 8, 3))


class KnownRenderer:
    """Draws gray; each shortcut adds noise of a known size.  Counts what it is asked for."""

    def __init__(self, drawing: str = "tiles (test)") -> None:
        self.settings, self.backends = RenderSettings(), {"drawing": drawing}
        self.drawn, self.presents, self.updates = [], 0, 0
        self.streaming = SimpleNamespace(due=False)  # nothing comes by and by
        self._image = np.zeros((6, 8, 3))

    def update(self, scene) -> None:
        self.updates += 1

    def draw(self, views, target=None) -> FrameStats:
        self.drawn.append((self.settings, views[0]))
        error = 0.01 * len(shortcuts(self.settings))
        self._image = 0.5 + error * NOISE
        return FrameStats(order_age=int(self.settings.resort_frames != 1))

    def present(self, framebuffer) -> None:
        self.presents += 1

    def resolved(self, i: int) -> np.ndarray:
        return self._image

    def stale_order_db(self, views) -> float:
        return 51.0


EMPTY, EXACT = Scene(()), RenderSettings()


def request(settings=EXACT, moving=False, scene=EMPTY) -> FrameRequest:
    return FrameRequest(scene, VIEW, settings, moving)


# The last second


def test_the_meter_is_the_median_of_the_last_second():
    meter = Meter()
    for i in range(100):
        meter.note(i * 0.1, 500.0 if i < 90 else 10.0, FrameStats(sorts=1, color_runs=2))
    assert meter.ms == 10.0 and meter.slowest_ms == 500.0  # the frame at exactly one second ago
    assert meter.per_second("sorts", 9.9) == 10 and meter.color_runs == 200
    assert meter.per_second("sorts", 100.0) == 0
    assert meter.ms == 10.0  # still told at rest


def test_a_few_frames_are_kept_however_slow_they_are():
    meter = Meter()
    assert meter.ms == 0.0
    for i in range(20):
        meter.note(i * 3.0, float(i), FrameStats())
    assert meter.ms == np.median(np.arange(20)[-FEWEST:])


# Exact


def test_exact_leaves_nothing_out_and_keeps_the_background():
    rough = RenderSettings(background=(1, 0, 0), max_pixels=3, order="distance", debug="depth")
    assert exact(rough, "tiles") == RenderSettings(background=(1, 0, 0))
    assert exact(rough, "quads (rgba16)").target == "rgba32f"
    assert is_exact(RenderSettings(debug="culls", background=(0, 1, 0)), "tiles (PoCL)")
    assert not is_exact(RenderSettings(), "quads (rgba16)")  # 16 bits round
    assert is_exact(RenderSettings(target="rgba32f"), "quads (rgba32f)")
    assert shortcuts(rough) == ["max_pixels", "order"]


def test_the_error_is_that_of_the_two_pictures_and_the_setting_stays():
    renderer = KnownRenderer()
    settings = RenderSettings(min_pixels=1.0, debug="culls")
    want = -10 * np.log10(np.mean((0.01 * NOISE) ** 2))
    assert measure_error(renderer, VIEW, settings) == pytest.approx(want)
    assert [s for s, _ in renderer.drawn] == [RenderSettings(), replace(settings, debug="")]
    assert measure_error(renderer, VIEW, RenderSettings()) == MOST_DB


def test_a_picture_is_compared_once_after_it_has_rested():
    comparison, one, two = Comparison(), (Scene(()), 1), (Scene(()), 1)
    assert not comparison.due(one, 0.0, moving=True)
    assert not comparison.due(one, 5.0, moving=True)
    assert not comparison.due(one, 5.0 + 0.9 * REST_S, moving=False)
    assert comparison.due(one, 5.0 + 2 * REST_S, moving=False)
    comparison.measured(one, 40.0)
    assert not comparison.due(one, 9.0, moving=False) and not comparison.is_old(one)
    assert not comparison.due(two, 9.0, moving=False) and comparison.is_old(two)
    assert comparison.due(two, 9.0 + 2 * REST_S, moving=False)


# What is on the screen


def make_shown(drawing: str = "tiles (test)"):
    from shapeshift.app.editor.state.frame_stats import FrameStatsView

    renderer, readings = KnownRenderer(drawing), FrameStatsView(drawing=drawing)
    return renderer, readings, Shown(renderer, readings)


def test_the_same_picture_is_drawn_once_and_a_kept_order_made_anew_at_rest():
    renderer, readings, shown = make_shown()
    kept = RenderSettings(resort_frames=4, recolor_degrees=5.0)
    assert shown.draw(request(kept, moving=True), None, force=False)
    shown.read(request(kept, moving=True), 10.0)
    assert renderer.drawn[-1][0] == kept and readings.stale_db == 51.0
    assert shown.draw(request(kept), None, force=False)
    assert renderer.drawn[-1][0] == RenderSettings()
    assert not shown.draw(request(kept), None, force=False)
    assert not shown.draw(request(replace(kept, background=(1, 0, 0))), None, force=False)
    assert renderer.settings.background == (1, 0, 0) and renderer.presents == 2
    shown.read(request(), 20.0)
    assert readings.stale_db is None  # every frame is sorted


def test_a_replaced_scene_is_drawn_even_when_it_is_equal():
    renderer, _, shown = make_shown()
    shown.draw(request(), None, force=False)
    assert shown.draw(request(scene=Scene(())), None, force=False)
    assert len(renderer.drawn) == 2


def test_comparing_draws_two_frames_and_then_the_picture_again():
    renderer, readings, shown = make_shown()
    rough = request(RenderSettings(min_pixels=1.0, debug="depth"))
    shown.draw(rough, None, force=False)
    assert not shown.due(request(), 50.0)  # exact: there is nothing to compare
    assert not shown.due(rough, 50.0) and shown.due(rough, 50.0 + 2 * REST_S)
    shown.measure(rough)
    assert len(renderer.drawn) == 3
    assert shown.draw(rough, None, force=False) and renderer.drawn[-1][0] == rough.settings
    shown.read(rough, 60.0)
    assert readings.error_db == pytest.approx(-10 * np.log10(np.mean((0.01 * NOISE) ** 2)))
    assert not readings.error_is_old and not shown.due(rough, 99.0)
    shown.read(request(RenderSettings(min_pixels=2.0)), 61.0)
    assert readings.error_is_old


def test_a_kept_order_is_judged_once_a_second_at_most():
    renderer, _, shown = make_shown()
    asked = []
    renderer.stale_order_db = lambda views: asked.append(views) or 40.0
    kept = request(RenderSettings(resort_frames=0, resort_degrees=5.0), moving=True)
    for i in range(30):
        shown.draw(kept, None, force=True)
        shown.read(kept, 10 + i * 0.1)
    assert len(asked) == 3


def test_at_rest_no_shortcut_of_time_is_left():
    kept = RenderSettings(resort_frames=0, resort_degrees=9.0, recolor_degrees=5.0, max_pixels=9)
    assert rested(kept) == RenderSettings(max_pixels=9)


# The budget


def test_turning_keeps_the_distance_to_the_centre_and_what_is_in_the_middle():
    centre = np.array([0.5, -0.2, 0.1])
    view = View(look_at(np.array([0.0, 1, 4]), centre), VIEW.tangents, 0.1, 50.0, (8, 6))
    for angle in (0.0, 0.3, -2.0):
        other = turned(view, centre, angle)
        for v in (view, other):
            in_eye = v.eye_from_world() @ np.append(centre, 1)
            np.testing.assert_allclose(in_eye[:2], 0, atol=1e-9)
        before, after = (v.world_from_eye.position - centre for v in (view, other))
        assert np.linalg.norm(before) == pytest.approx(np.linalg.norm(after))
        assert before[1] == pytest.approx(after[1])


def test_the_quick_chart_prices_every_setting_against_exact():
    renderer = KnownRenderer()
    chart = QuickChart(renderer, Scene(()), VIEW, np.zeros(3), lambda: None)
    while not chart.done:
        chart.step()
    assert [row.name for row in chart.rows] == ["exact", *QUICK]
    assert len(renderer.drawn) == chart.frames  # progress ends at 1
    for row in chart.rows[1:]:
        error = 0.01 * len(QUICK[row.name])
        assert row.db == pytest.approx(-10 * np.log10(np.mean((error * NOISE) ** 2)))
        assert row.ms > 0
        used = [view for settings, view in renderer.drawn if settings == row.settings]
        turns = [tuple(view.world_from_eye.position) for view in used]
        assert len(set(turns)) == len(turns)  # every frame of a setting moves, as a hand does


def test_the_dial_measures_in_steps_and_chooses_again_without_measuring():
    renderer, dial = KnownRenderer(), QualityController(floor_db=20.0)
    dial.start(renderer, Scene(()), VIEW, np.zeros(3), lambda: None)
    before = dial.progress
    while dial.measuring:
        assert before <= dial.progress <= 1
        before = dial.progress
        complete = dial.step()
    assert complete and dial.choice.settings in [row.settings for row in dial.rows]
    drawn = len(renderer.drawn)
    dial.floor_db = 150.0
    dial.choose()
    assert dial.choice.name == "exact" and len(renderer.drawn) == drawn
    mine = RenderSettings(background=(1, 0, 0), debug="depth", max_pixels=3)
    assert dial.applied(mine) == replace(dial.choice.settings, background=(1, 0, 0), debug="depth")
    dial.forget()
    assert not dial.rows and dial.choice is None


def test_measuring_can_be_stopped_and_keeps_what_was_known():
    dial = QualityController(wanted=True)
    dial.start(KnownRenderer(), Scene(()), VIEW, np.zeros(3), lambda: None)
    assert dial.measuring and not dial.wanted
    dial.cancel()
    assert not dial.measuring and dial.progress == 0 and dial.choice is None
