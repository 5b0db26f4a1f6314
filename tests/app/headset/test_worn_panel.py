"""What the panel tells of a world, and what its wishes do to it: no runtime, no drawing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.headset.notices import BEGINS_S, BELOW, QUIET_S, SHOWN_S, Late, late_card
from shapeshift.app.headset.pacing import Pacing
from shapeshift.app.headset.wrist_menu import (
    HINT,
    MenuActions,
    WristMenu,
    facts_of,
    grant,
    sliders_of,
)
from shapeshift.app.headset.xr_user import XrState, XrUser
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, named_stops
from shapeshift.scene.world.reactions import State
from shapeshift.scene.world.world import World
from shapeshift.vr.panel.carried import panel_row
from shapeshift.vr.panel.panel_state import (
    Exit,
    Pulse,
    PutBack,
    Recentre,
    SetFloor,
    SetQuality,
    SetScale,
    SetX,
)
from shapeshift.vr.touching import Touched
from tests.support.splat_scenes import random_layers
from tests.support.vr.vr_hands import HEAD, OPEN, a_frame, hand_at

LEFT = hand_at((-0.15, 1.15, -0.45))
HEAT = (Stop("seen", 0.0), Stop("half", 0.5), Stop("heat", 1.0, "thermal", "ironbow", (0, 9), "K"))


def item(name: str, **fields) -> SceneItem:
    return SceneItem(name=name, model=name, static=True, **fields)


def a_world() -> World:
    items = (
        item("table"),
        item("lamp"),
        item("leg", states=(State("cold", 0.0), State("warm", 0.25))),
        item("gone", visible=False),
    )
    layers = random_layers(20, layers=1)
    models = {name: replace(layers, stops=HEAT) for name in ("leg", "gone")}
    models["lamp"] = random_layers(20, layers=3)
    models["table"] = layers
    return World(SceneFile(folder=None, items=items, gravity_m_s2=0.0), models, {})


def a_state() -> XrState:
    world = a_world()
    return XrState(world, Pacing((0, 0, 0)), XrUser(world, SimpleNamespace(), None))


def noting(done: list) -> MenuActions:
    """What the menu asks of its session goes into the list."""
    return MenuActions(
        lambda frame: done.append("recentre"), done.append, lambda *felt: done.append(felt)
    )


def test_sliders_are_of_what_is_seen_and_goes_somewhere():
    sliders = sliders_of(a_world())
    assert [slider.name for slider in sliders] == ["lamp", "leg"]
    assert [stop.name for stop in sliders[0].stops] == ["layer 0", "layer 1", "layer 2"]
    assert [(stop.name, stop.x, stop.palette) for stop in sliders[1].stops] == [
        ("cold", 0.0, ""), ("warm", 0.25, ""), ("half", 0.5, ""), ("heat", 1.0, "ironbow")
    ]  # fmt: skip


def test_a_ring_ends_where_it_begins():
    states = (State("normal", 0.0), State("fire", 0.5))
    ring = replace(a_world().objects["leg"], item=item("leg", states=states, ring=True))
    assert [(stop.name, stop.x) for stop in named_stops(ring.item, ring.drawn.model)] == [
        ("normal", 0.0), ("fire", 0.5), ("normal", 1.0)
    ]  # fmt: skip


def test_wishes_are_granted():
    state, frame, done = a_state(), a_frame(LEFT), []
    actions = noting(done)
    grant(SetX("leg", 0.7), state, actions, frame)
    assert {s.name: s.x for s in sliders_of(state.world)} == {"lamp": 0.0, "leg": 0.7}
    grant(PutBack(), state, actions, frame)
    assert {s.name: s.x for s in sliders_of(state.world)} == {"lamp": 0.0, "leg": 0.0}
    grant(SetQuality("fast"), state, actions, frame)
    assert state.pacing.quality == "fast" and state.pacing.settings().render_scale == 0.5
    under = state.standing.point(frame.head.position * (1, 0, 1))
    grant(SetScale(4.0), state, actions, frame)
    assert state.standing.scale == 4.0
    np.testing.assert_allclose(state.standing.point(frame.head.position * (1, 0, 1)), under)
    grant(SetFloor(False), state, actions, frame)
    assert not state.floor_shown and not facts_of(state).floor
    for wish in (Recentre(), Pulse("left", 0.5, 0.1), Exit()):
        grant(wish, state, actions, frame)
    assert done == ["recentre", ("left", 0.5, 0.1), "from the panel"]


def an_open_panel(state: XrState) -> WristMenu:
    panel = WristMenu(state, noting([]))
    panel.carried = OPEN
    return panel


def test_it_is_closed_at_first_and_tells_how_to_open_it():
    panel = WristMenu(a_state(), noting([]), "right")
    panel.act(a_frame(LEFT), 0.0)
    assert not panel.carried.panel.open and panel.carried.home == "right"
    assert panel.carried.panel.facts.note == HINT and "palm up" in HINT


def test_a_frame_shows_the_world_and_moves_it():
    state = a_state()
    panel = an_open_panel(state)
    panel.act(a_frame(LEFT), 0.0)
    row = panel_row(panel.carried)
    assert (row["object"], row["shown"], row["hand"]) == ("lamp", "layer 0", "left")
    ends = np.array(row["slider"])
    target = ends[0] + 0.3 * (ends[1] - ends[0])
    for trigger in (0.0, 1.0):
        right = hand_at((0.25, 1.1, -0.2), target, trigger=trigger)
        frame = panel.act(a_frame(LEFT, right), 1 / 72)
    assert frame.hands["right"].trigger == 0 and frame.hands["left"] == LEFT
    assert state.world.objects["lamp"].reaction_state.x == pytest.approx(0.3, abs=0.01)
    panel.act(a_frame(LEFT), 1 / 72)
    assert panel_row(panel.carried)["shown"] == "layer 0 \u2192 layer 1  60 %"


def test_what_is_taken_in_a_hand_is_what_the_slider_is_of():
    state = a_state()
    panel = an_open_panel(state)
    state.user.touched = Touched(held={"left": None, "right": "leg"})
    panel.act(a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "leg"
    panel.carried = replace(panel.carried, panel=replace(panel.carried.panel, chosen="lamp"))
    panel.act(a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "lamp"  # chosen since, while it is still held
    state.user.touched = Touched(held={"left": "table", "right": None})
    panel.act(a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "lamp"  # a table has none


def test_late_frames_are_told_for_a_moment_and_not_again_at_once():
    late = Late()
    assert not any(late.watch(0.1 * i, 100 * i) for i in range(50)), "all begins slowly"
    rows = ((5.0, 0), (5.5, 1), (6.0, 7), (6.5, 7), (9.9, 7), (10.1, 7), (11.0, 20), (35.0, 20))
    said = [late.watch(second, dropped) for second, dropped in rows]
    assert said == [False, False, True, True, True, False, False, False]
    assert (BEGINS_S, SHOWN_S) == (5.0, 4.0)
    assert not late.watch(6.0 + QUIET_S, 40) and late.watch(6.1 + QUIET_S, 60)


@pytest.mark.parametrize(
    ("quality", "line"),
    [("auto", "Frames are late"), ("best", "Frames are late: try Auto")],
)
def test_the_word_on_late_frames_is_below_what_one_looks_at(quality, line):
    card = late_card(HEAD, quality)
    assert card.lines == (line,)
    np.testing.assert_allclose(card.play_from_card.position, HEAD.position + BELOW)
    ahead = -card.play_from_card.matrix()[:3, 2]
    assert ahead @ BELOW / np.linalg.norm(BELOW) > 0.999, "it faces the head"
