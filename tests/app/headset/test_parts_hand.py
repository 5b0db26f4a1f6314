"""A hand in a headset takes a thing out of a captured scene: its ray, its trigger, its buttons."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.headset.in_hand.finger_brush import PartsHand
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import Frame
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace
from tests.support.splat_scenes import random_layers
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import PANEL, a_state, an_editor, item

COUNT = 300


def two_balls() -> SplatLayers:
    """One at x -0.5 and one at x 0.5, two metres ahead; each of a colour of its own."""
    layers, rng = random_layers(2 * COUNT, layers=1), np.random.default_rng(2)
    side = np.repeat([-0.5, 0.5], COUNT)
    away = rng.normal(size=(2 * COUNT, 3))
    away *= 0.2 / np.linalg.norm(away, axis=1, keepdims=True)
    means = away + np.stack([side, np.full(2 * COUNT, 1.2), np.full(2 * COUNT, -2.0)], axis=1)
    sh = np.zeros((2 * COUNT, 1, 3), np.float32)
    sh[:COUNT, 0, 0] = sh[COUNT:, 0, 2] = 1.5
    return replace(
        layers, means=means.astype(np.float32), scales=np.full((2 * COUNT, 3), 0.03, np.float32),
        opacity=np.full(2 * COUNT, 0.95, np.float32), sh=sh,
    )  # fmt: skip


@pytest.fixture
def hand() -> PartsHand:
    editor = an_editor(item("room"))
    model = two_balls()
    editor.edited.sources = {
        key: replace(source, model=model, path=Path("room.ply"))
        for key, source in editor.edited.sources.items()
    }
    (obj,) = editor.scene.objects
    editor.reorder_rows(
        [(replace(obj, model=model), model, editor.sweeps[0], editor.sources[0])], {}
    )
    state = a_state(editor)
    editor.bodies.follow = lambda edited: None
    state.parts.toggle()
    yield PartsHand(state.parts)
    state.parts.finder.close()


def pointing_at(x: float, **buttons) -> Frame:
    """The right hand at head height, its ray to the ball at x."""
    frame = a_frame()
    there = np.array([x, 1.2, -2.0])
    here = np.array([0.0, 1.2, 0.0])
    turn = np.arctan2(here[0] - there[0], here[2] - there[2])  # about +Y; the ray is -Z
    aim = Pose(here, np.array([np.cos(turn / 2), 0.0, np.sin(turn / 2), 0.0]))
    mine = replace(hand_at((0.0, 1.2, 0.0)), aim=aim, **buttons)
    return replace(frame, hands={**frame.hands, "right": mine})


def once(hand: PartsHand, frame: Frame) -> Frame:
    return hand.act(frame, PlaySpace(), Carried(PANEL, home="left"))


def look(hand: PartsHand, frame: Frame) -> None:
    """Frames until what the ray meets has been found."""
    wanted, end = frame.hands["right"].aim.matrix(), time.monotonic() + 30
    while time.monotonic() < end:
        once(hand, frame)
        found = hand.tool.found
        if found is not None and np.allclose(found.query.view.world_from_eye.matrix(), wanted):
            return
        time.sleep(0.002)
    raise AssertionError("nothing was found")


def test_a_ray_lights_a_trigger_chooses_buttons_add_and_remove(hand):
    tool = hand.tool
    look(hand, pointing_at(-0.5))
    lit = np.asarray(tool.state.shown_scene.lit[1].strength) > 0
    assert lit[:COUNT].mean() > 0.95 and not lit[COUNT:].any() and tool.count == 0
    left = once(hand, pointing_at(-0.5, trigger=1.0))
    assert tool.count == lit.sum() and left.hands["right"].trigger == 0.0
    look(hand, pointing_at(0.5))
    once(hand, pointing_at(0.5, trigger=1.0, primary=True))
    assert tool.count > 1.9 * COUNT
    look(hand, pointing_at(-0.5, secondary=True))
    once(hand, pointing_at(-0.5, trigger=1.0, secondary=True))
    assert tool.chosen[COUNT:].mean() > 0.95 and tool.chosen[:COUNT].mean() < 0.05
    tool.make()
    assert [obj.name for obj in tool.state.scene.objects] == ["background", "object"]
    tool.state.shown_scene.show = "isolated"
    shown = tool.state.shown(pointing_at(0.5).views[0])
    assert [obj.visible for obj in shown.objects] == [False, True]


def test_a_held_trigger_chooses_once_and_a_lost_hand_nothing(hand):
    tool = hand.tool
    look(hand, pointing_at(-0.5))
    once(hand, pointing_at(-0.5, trigger=1.0))
    assert tool.count
    tool.clear()
    look(hand, pointing_at(-0.5, trigger=0.5))  # not let go yet
    once(hand, pointing_at(-0.5, trigger=1.0))
    assert tool.count == 0
    frame = pointing_at(-0.5, trigger=1.0)
    lost = replace(frame, hands={**frame.hands, "right": replace(frame.hands["right"], aim=None)})
    assert once(hand, lost) is lost and tool.found is None
    tool.toggle()
    assert once(hand, frame) is frame  # the tool is off: all is for the world
