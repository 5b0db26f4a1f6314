"""The panel's section "Play": how the control value moves by itself."""

from imgui_bundle import imgui

from app.panels.panel_rows import choice, slider, tip
from app.viewer.stage import Stage
from scene.control import EASES, MODES, Sweep

LONGEST_LEG_S = 20.0
SHORTEST_LEG_S = 0.2
LONGEST_REST_S = 10.0
MODE_NAMES = {"ping-pong": "there and back", "loop": "round and round", "once": "once"}


def draw_play(stage: Stage, ui_scale: float) -> None:
    """Play and pause, the course of time, and the stops to visit; of every object that has some."""
    for index in stage.sliders:
        imgui.push_id(index)
        if len(stage.sliders) > 1:
            imgui.text_disabled(stage.scene.objects[index].name)
        _play(stage, index, ui_scale)
        draw_sweep(stage, index, ui_scale)
        imgui.pop_id()
    if not stage.sliders:
        imgui.text_disabled("There is one stop: nothing to play.")


def _play(stage: Stage, index: int, ui_scale: float) -> None:
    if imgui.button("Pause" if stage.sweeps[index].playing else "Play", imgui.ImVec2(-1, 0)):
        stage.toggle_play(index)
    tip("Key Space plays and pauses all objects.", ui_scale)


def draw_sweep(stage: Stage, index: int, ui_scale: float) -> None:
    """How fast and which way one object's x plays, and through which stops."""
    sweep = stage.sweeps[index]
    imgui.push_item_width(-1)
    sweep.mode = choice("mode", sweep.mode, MODES, [MODE_NAMES[mode] for mode in MODES])
    tip("What happens after the last stop.", ui_scale)
    sweep.ease = choice("ease", sweep.ease, EASES, [f"pace: {name}" for name in EASES])
    tip("How speed changes on the way from one stop to the next.", ui_scale)
    sweep.leg_s = slider(
        "leg", sweep.leg_s, SHORTEST_LEG_S, LONGEST_LEG_S, "%.1f s from stop to stop"
    )
    sweep.rest_s = slider(
        "rest", sweep.rest_s, 0.0, LONGEST_REST_S, "%.1f s of rest at stops", "no rest at stops"
    )
    imgui.pop_item_width()
    _stops(stage, index, sweep, ui_scale)


def _stops(stage: Stage, index: int, sweep: Sweep, ui_scale: float) -> None:
    """A box for each stop; two at least are visited."""
    for stop in stage.stops(index):
        changed, on = imgui.checkbox(f"{stop.name}##{stop.x}", stop.x in sweep.xs)
        tip("Visited while playing; two stops at least are.", ui_scale)
        if changed:
            stage.visit(index, stop.x, on)
