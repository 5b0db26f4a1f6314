"""What the headset's panel says of its frames, and notes over it that come and go."""

import numpy as np
import pytest

from shapeshift.app.editor.state.touch_state import HOW
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.sections.performance_section import Figures
from shapeshift.app.headset.wrist_menu import SETTLE_FRAMES
from shapeshift.renderer.settings import FrameStats
from shapeshift.vr.pace import FramePace
from tests.support.vr.vr_panel import SETTLED, Wearer

FIGURES = Figures(9.5, 6.25, 11.1, 12345, 3, 100_000, 400_000)


@pytest.fixture
def picture(ctx):
    made = PanelPicture(ctx)
    yield made
    made.release()


@pytest.fixture
def wearer(picture):
    return Wearer(picture)


def pixels(wearer: Wearer) -> np.ndarray:
    return np.frombuffer(wearer.menu.picture.texture.read(), np.uint8).copy()


def test_figures_are_medians_of_the_last_frames_and_sums_of_all():
    pace = FramePace(display_s=1 / 90, frames=1000, dropped=7)
    pace.own_ms, pace.drawing_ms = [99.0] * 40 + [8.0] * 59 + [10.0], [5.04] * 3
    figures = Figures.of(pace, FrameStats(drawn=5, splats=12))
    assert figures == Figures(8.0, 5.0, 11.1, 1000, 7, 5, 12)
    assert figures.rows()[0] == ("Frame", "8.0 of 11.1 ms")
    assert dict(figures.rows())["Late"].startswith("7 of 1")


def test_before_the_first_frame_nothing_is_claimed():
    nothing = Figures.of(FramePace(), FrameStats())
    assert nothing == Figures(0.0, 0.0, 0.0, 0, 0, 0, 0)
    assert nothing.rows()[0] == ("Frame", "0.0 ms"), "no period is known"


def test_the_panel_is_drawn_for_figures_only_while_they_are_in_sight(wearer, monkeypatch):
    drawn, draw = [], wearer.menu.picture.draw
    monkeypatch.setattr(wearer.menu.picture, "draw", lambda *given: drawn.append(1) or draw(*given))
    wearer.state.figures = FIGURES
    wearer.wait(SETTLED)
    assert not drawn, "the section is folded at first"
    wearer.unfold()
    wearer.scroll()
    wearer.press("Performance")
    wearer.scroll()
    wearer.wait(2 * SETTLED)
    drawn.clear()
    before = pixels(wearer)
    wearer.state.figures = Figures(19.5, 6.25, 11.1, 22345, 3, 100_000, 400_000)
    wearer.wait(2 * SETTLED)
    assert len(drawn) == SETTLE_FRAMES and not np.array_equal(pixels(wearer), before)


def test_a_note_lies_over_the_sections_and_moves_nothing(wearer):
    plain, places = pixels(wearer), dict(wearer.menu.picture.boxes)
    wearer.editor.messages.say("Undone: move cube", now=0.0)
    wearer.wait()
    assert not np.array_equal(pixels(wearer), plain)
    assert wearer.menu.picture.boxes == places
    assert wearer.editor.messages.ended(now=100.0)
    wearer.wait()
    np.testing.assert_array_equal(pixels(wearer), plain)


def test_no_note_names_a_key_that_is_not_there(wearer):
    """At a desk the same change says which keys go on."""
    wearer.state.touch.toggle()
    assert wearer.state.world.paused and wearer.editor.messages.note == ""
    assert "T stops" in HOW
