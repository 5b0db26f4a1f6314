"""What the panel tells of a world, and what its wishes do to it: no runtime, no drawing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from splat_scenes import random_layers
from vr_hands import a_frame, hand_at

from app.headset.pacing import Pacing
from app.headset.person import Person
from app.headset.worn_panel import HINT, WornPanel, grant, sliders_of
from runtime_models.model import Stop
from scene.reactions import State
from scene.scene_file import SceneFile, SceneItem, named_stops
from scene.world import World
from vr.carried import panel_row
from vr.panel_state import (
    Exit,
    Pulse,
    PutBack,
    Recentre,
    SetQuality,
    SetScale,
    SetX,
)
from vr.standing import Standing
from vr.touching import Touched

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


class Wearing(SimpleNamespace):
    """What of app.headset.wearing.Wearing the panel meets."""

    def __init__(self) -> None:
        world, pace = a_world(), SimpleNamespace(dropped=0)
        super().__init__(
            world=world, pacing=Pacing((0, 0, 0)), standing=Standing(), done=[],
            person=Person(world, SimpleNamespace(), None), session=SimpleNamespace(pace=pace),
        )  # fmt: skip

    def recentre(self, frame) -> None:
        self.done.append("recentre")

    def leave(self, why: str) -> None:
        self.done.append(why)

    def pulse(self, *felt) -> None:
        self.done.append(felt)


def test_sliders_are_of_what_is_seen_and_goes_somewhere():
    sliders = sliders_of(a_world())
    assert [slider.name for slider in sliders] == ["lamp", "leg"]
    assert [stop.name for stop in sliders[0].stops] == ["layer 0", "layer 1", "layer 2"]
    assert [(stop.name, stop.x, stop.palette) for stop in sliders[1].stops] == [
        ("cold", 0.0, ""), ("warm", 0.25, ""), ("half", 0.5, ""), ("heat", 1.0, "ironbow")
    ]  # fmt: skip


def test_a_ring_ends_where_it_begins():
    states = (State("normal", 0.0), State("fire", 0.5))
    ring = item("leg", states=states, ring=True)
    leg = a_world().things["leg"].drawn.model
    assert [(stop.name, stop.x) for stop in named_stops(ring, leg)] == [
        ("normal", 0.0), ("fire", 0.5), ("normal", 1.0)
    ]  # fmt: skip


def test_wishes_are_granted():
    wearing, frame = Wearing(), a_frame(LEFT)
    grant(SetX("leg", 0.7), wearing, frame)
    assert {s.name: s.x for s in sliders_of(wearing.world)} == {"lamp": 0.0, "leg": 0.7}
    grant(PutBack(), wearing, frame)
    assert {s.name: s.x for s in sliders_of(wearing.world)} == {"lamp": 0.0, "leg": 0.0}
    grant(SetQuality("fast"), wearing, frame)
    assert wearing.pacing.quality == "fast" and wearing.pacing.settings().render_scale == 0.5
    under = wearing.standing.point(frame.head.position * (1, 0, 1))
    grant(SetScale(4.0), wearing, frame)
    assert wearing.standing.scale == 4.0
    np.testing.assert_allclose(wearing.standing.point(frame.head.position * (1, 0, 1)), under)
    for wish in (Recentre(), Pulse("left", 0.5, 0.1), Exit()):
        grant(wish, wearing, frame)
    assert wearing.done == ["recentre", ("left", 0.5, 0.1), "from the panel"]


def test_a_frame_shows_the_world_and_moves_it():
    wearing, panel = Wearing(), WornPanel()
    panel.act(wearing, a_frame(LEFT), 0.0)
    row = panel_row(panel.carried)
    assert (row["object"], row["shown"], row["hand"]) == ("lamp", "layer 0", "left")
    ends = np.array(row["slider"])
    target = ends[0] + 0.3 * (ends[1] - ends[0])
    for trigger in (0.0, 1.0):
        right = hand_at((0.25, 1.1, -0.2), target, trigger=trigger)
        frame = panel.act(wearing, a_frame(LEFT, right), 1 / 72)
    assert frame.hands["right"].trigger == 0 and frame.hands["left"] == LEFT
    assert wearing.world.things["lamp"].standing.x == pytest.approx(0.3, abs=0.01)
    panel.act(wearing, a_frame(LEFT), 1 / 72)
    assert panel_row(panel.carried)["shown"] == "layer 0 \u2192 layer 1  60 %"


def test_what_is_taken_in_a_hand_is_what_the_slider_is_of():
    wearing, panel = Wearing(), WornPanel()
    wearing.person.touched = Touched(held={"left": None, "right": "leg"})
    panel.act(wearing, a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "leg"
    panel.carried = replace(panel.carried, panel=replace(panel.carried.panel, chosen="lamp"))
    panel.act(wearing, a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "lamp"  # chosen since, while it is still held
    wearing.person.touched = Touched(held={"left": "table", "right": None})
    panel.act(wearing, a_frame(LEFT), 0.0)
    assert panel.carried.panel.slider.name == "lamp"  # a table has none


@pytest.mark.parametrize(
    ("quality", "told"),
    [("auto", "frames are late"), ("best", "frames are late: try Auto")],
)
def test_late_frames_are_told_and_forgotten(quality, told):
    wearing, panel = Wearing(), WornPanel()
    wearing.pacing.quality = quality
    notes = []
    for second, dropped in ((0.0, 0), (0.5, 1), (1.0, 7), (1.5, 7), (3.1, 7), (4.0, 8)):
        wearing.session.pace.dropped = dropped
        panel.act(wearing, a_frame(LEFT, seen_s=second), 0.0)
        notes.append(panel.carried.panel.facts.note)
    assert notes == [HINT, HINT, told, told, HINT, HINT]
