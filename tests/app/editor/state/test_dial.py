"""The dial's pixels while something moves, without a window."""

import pytest

from shapeshift.app.editor.state.quality_controller import LEAST_SCALE, QualityController
from shapeshift.renderer.settings import RenderSettings


def slow_dial() -> QualityController:
    """A dial whose frames have been far too slow for long."""
    dial = QualityController(target_ms=10.0, dynamic=True)
    dial.while_moving(RenderSettings())
    for _ in range(400):
        dial.seen(200.0, moving=True)
    return dial


@pytest.mark.parametrize("chosen", [1.0, 0.75, LEAST_SCALE, 0.3])
def test_fewer_pixels_stop_at_the_floor_whatever_was_chosen(chosen):
    drawn = slow_dial().while_moving(RenderSettings(render_scale=chosen)).render_scale
    assert drawn == min(chosen, LEAST_SCALE)


def test_at_rest_all_pixels_that_were_chosen_are_drawn():
    dial, settings = slow_dial(), RenderSettings(render_scale=0.75)
    dial.dynamic = False
    assert dial.while_moving(settings) is settings


def test_a_dial_that_has_measured_nothing_changes_nothing():
    dial, settings = QualityController(), RenderSettings(max_pixels=3)
    assert not dial.step() and dial.rows == ()
    assert dial.applied(settings) is settings
