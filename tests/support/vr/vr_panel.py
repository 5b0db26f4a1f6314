"""Somebody with the headset's panel open: points at its items with a ray, and pulls the trigger."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import edited_from_file
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.headset.pacing import Pacing
from shapeshift.app.headset.panel_picture import PANEL, PanelPicture
from shapeshift.app.headset.scene_shelf import editor_of
from shapeshift.app.headset.wrist_menu import MenuActions, WristMenu
from shapeshift.app.headset.xr_user import XrState, XrUser
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.world.reactions import State
from shapeshift.scene.world.world import World
from shapeshift.vr.frame import LOST, Frame, Hand
from tests.support.splat_scenes import random_layers
from tests.support.vr.vr_hands import a_frame, hand_at

LEFT = hand_at((-0.15, 1.15, -0.45))
FROM = (0.25, 1.1, -0.2)  # metres of the room: the hand that points
SETTLED = 8  # frames after which a panel that nobody touches is drawn no more
HEAT = (Stop("seen", 0.0), Stop("half", 0.5), Stop("heat", 1.0, "thermal", "ironbow", (0, 9), "K"))


def item(name: str, **fields) -> SceneItem:
    return SceneItem(name=name, model=name, static=True, **fields)


def an_editor(*items: SceneItem, **stops: tuple[Stop, ...]) -> EditorState:
    """Objects of three stops each, or of those that are named after them; nothing falls."""
    layers = random_layers(20, layers=3)
    models = {each.name: layers for each in items}
    models |= {name: replace(layers, stops=mine) for name, mine in stops.items()}
    file = SceneFile(folder=Path(), items=items, gravity_m_s2=0.0)
    world = World(file, models, {})
    sources = [Source(Path(name), models[name]) for name in models]
    return editor_of(world, replace(edited_from_file(Path("none"), file, sources), path=None))


def some_things() -> EditorState:
    """A table that is one thing for ever, a lamp, a leg with states and a thermal stop, and one
    that is hidden.
    """
    items = (
        item("table"),
        item("lamp"),
        item("leg", states=(State("cold", 0.0), State("warm", 0.25))),
        item("gone", visible=False),
    )
    return an_editor(*items, table=HEAT[:1], leg=HEAT, gone=HEAT)


def a_state(editor: EditorState | None = None) -> XrState:
    editor = editor or some_things()
    user = XrUser(editor.world, SimpleNamespace(), None)
    touch, tool = TouchState(editor, True, keys=False), PartsTool(editor, lambda: None)
    return XrState(editor, touch, Pacing((0, 0, 0)), user, tool)


class Wearer:
    """The menu of a session with its panel open, and what it has asked of the session."""

    def __init__(self, picture: PanelPicture, state: XrState | None = None) -> None:
        self.state, self.done, self.pulses = state or a_state(), [], []
        self.editor = self.state.editor
        actions = MenuActions(
            lambda frame: self.done.append("recentre"),
            self.done.append,
            lambda *felt: self.pulses.append(felt),
        )
        self.menu = WristMenu(self.state, actions, picture)
        self.menu.carried = replace(self.menu.carried, open=True, pinned=True)
        self.wait()

    def act(self, right: Hand = LOST, left: Hand = LEFT, seconds: float = 1 / 72) -> Frame:
        """One frame of the session, as xr_app has it."""
        frame = self.menu.act(a_frame(left, right), seconds)
        self.editor.advance(seconds)
        self.state.touch.advance(seconds)
        return frame

    def wait(self, frames: int = SETTLED, seconds: float = 1 / 72) -> None:
        for _ in range(frames):
            self.act(seconds=seconds)

    def labels(self) -> list[str]:
        return list(self.menu.picture.boxes)

    def middle(self, label: str) -> tuple[float, float]:
        """Of an item that is in sight."""
        boxes = self.menu.picture.boxes
        assert label in boxes, f"there is no {label!r} among {sorted(boxes)}"
        left, top, right, low = boxes[label]
        return (left + right) / 2, (top + low) / 2

    def room(self, at: tuple[float, float]) -> np.ndarray:
        """(3,) metres of the room of a place on the panel."""
        return PANEL.play_point(self.menu.carried.play_from_panel, at)

    def point(self, at: tuple[float, float], trigger: float = 0.0, **state) -> Frame:
        """The right hand's ray meets a place on the panel's plane."""
        return self.act(hand_at(FROM, self.room(at), trigger=trigger, **state))

    def press(self, label: str) -> None:
        """Points at an item, pulls the trigger, lets it go."""
        for trigger in (0.0, 1.0, 1.0, 0.0):
            self.point(self.middle(label), trigger)
        self.wait(3)

    def unfold(self, *sections: str) -> None:
        """Folds what is open above them, and unfolds each."""
        for name, part in (("Room", "+"), ("Touch", "Put back")):
            if part in self.labels():
                self.press(name)
        for name in sections:
            self.scroll_to(name)
            self.press(name)

    def scroll(self, push: float = -1.0) -> list[Frame]:
        """Holds the pointing hand's stick back (1: forth) until the sections' end is in sight."""
        middle = (PANEL.size[0] / 2, PANEL.size[1] * 0.7)
        frames = [self.point(middle, stick=(0.0, push)) for _ in range(144)]
        self.wait()
        return frames

    def scroll_to(self, label: str) -> None:
        """Holds the pointing hand's stick back until an item is in sight."""
        middle = (PANEL.size[0] / 2, PANEL.size[1] * 0.7)
        for _ in range(300):
            if label in self.labels():
                break
            self.point(middle, stick=(0.0, -1.0))
        self.wait()

    def x(self, name: str) -> float:
        return next(t.slider_x for t in self.editor.scene.objects if t.name == name)

    @property
    def shown(self) -> str:
        """The object whose slider is there."""
        return self.editor.scene.objects[self.editor.sliders[0]].name

    def along(self, x: float) -> tuple[float, float]:
        """Where x lies on the slider."""
        row, pose = self.menu.row(), self.menu.carried.play_from_panel
        first, last = map(np.array, row["slider"])
        local = np.linalg.inv(pose.matrix()) @ np.append(first + x * (last - first), 1.0)
        return PANEL.place(local[:3])
