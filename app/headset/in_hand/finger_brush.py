"""A finger that paints, what lies in a ball about its tip goes into the painted region; and a hand
that takes things out.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import ADD, REMOVE, REPLACE, PartsTool
from shapeshift.app.editor.state.regions import within_balls
from shapeshift.scene.pose import View
from shapeshift.vr.frame import Frame, Hand
from shapeshift.vr.glove import fingertip
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace

PRESSED, LET_GO = 0.6, 0.4  # of a trigger, or a pinch
LEAST_M, FIRST_M, MOST_M = 0.005, 0.03, 0.3  # radius of the ball, metres of the room
GROWTH = 1.6  # a second with the stick pushed all the way: e to this power
DEAD = 0.15  # of a stick: it rests
STEP = 0.5  # of the radius: so far apart are the balls along a stroke
MOST_BALLS = 64  # of one frame


@dataclass
class FingerBrush:
    """Keeps the stroke that is under way.  `on`: the pointing hand paints."""

    editor: EditorState
    on: bool = False
    erases: bool = False  # as the panel has it; B or Y held erases, too
    radius_m: float = FIRST_M  # of the room
    tip: np.ndarray | None = None  # (3,) metres of the room; None: there is no such finger now
    wipes: bool = False  # it erases in this frame
    _down: bool = False
    _last: np.ndarray | None = None  # (3,) world: where the stroke was in the frame before
    _index: int | None = None  # of the object that the stroke began on, and stays on

    def act(self, frame: Frame, play_space: PlaySpace, carried: Carried, seconds: float) -> Frame:
        """While it is on: what the pointing hand paints; the frame with what it leaves of it."""
        side = carried.pointer
        hand, self.tip = frame.hands[side], None
        if not self.on or hand.grip is None or carried.on_panel or not self.editor.scene.objects:
            self._rest()
            return frame
        self.tip = fingertip(side, hand)
        stick = self._resize(hand, seconds)
        self.wipes = self.erases or hand.secondary
        down = hand.trigger > (LET_GO if self._down else PRESSED)
        if down:
            self._stroke(play_space.point(self.tip), self.radius_m * play_space.scale)
        elif self._down:
            self._rest()
        self._down = down
        # A bare hand that pinches squeezes by it, too.
        squeeze = hand.squeeze if hand.joints is None else 0.0
        left = replace(hand, trigger=0.0, squeeze=squeeze, stick=stick, secondary=False)
        return replace(frame, hands={**frame.hands, side: left})

    def _rest(self) -> None:
        """The stroke is at its end: one step to be taken back."""
        if self._last is not None:
            self.editor.record_regions()
            self.editor.rest()
        self._down, self._last, self._index = False, None, None

    def _resize(self, hand: Hand, seconds: float) -> tuple[float, float]:
        """By the stick pushed ahead or back; returns what is left of it."""
        aside, ahead = hand.stick
        if not (abs(ahead) > DEAD and abs(ahead) >= abs(aside)):
            return hand.stick
        radius = self.radius_m * math.exp(GROWTH * ahead * seconds)
        self.radius_m = min(max(radius, LEAST_M), MOST_M)
        return (0.0, 0.0)

    def _stroke(self, to: np.ndarray, radius: float) -> None:
        """Balls from where it was to a place (3,) of the world, metres."""
        start = to if self._last is None else self._last
        count = math.ceil(float(np.linalg.norm(to - start)) / (STEP * radius))
        count = min(max(count, 1), MOST_BALLS)
        parts = np.arange(1, count + 1)[:, None] / count
        centres = start + parts * (to - start)
        self._last = to
        if self._index is None:
            self._index = self._meets(centres, radius)
        if self._index is not None and self._choose(self._index):
            obj = self.editor.scene.objects[self._index]
            self.editor.regions.paint_balls(centres, radius, obj, self.wipes)

    def _meets(self, centres: np.ndarray, radius: float) -> int | None:
        """The seen object with most anchors in the balls; None: there are none."""
        best, most = None, 0
        for index, obj in enumerate(self.editor.scene.objects):
            count = int(within_balls(obj, centres, radius).sum()) if obj.visible else 0
            if count > most:
                best, most = index, count
        return best

    def _choose(self, index: int) -> bool:
        """The painted region of that object is the chosen one, a new one where it has none; False:
        there is nothing to be erased.
        """
        regions = self.editor.regions
        current = regions.current
        if current is not None and current.kind == "painted" and current.index == index:
            return True
        mine = [n for n, r in enumerate(regions.items) if r.kind == "painted" and r.index == index]
        if mine:
            regions.choose(mine[-1])
        elif self.wipes:
            return False
        else:
            regions.add("painted", index, self.editor.scene.objects[index], np.zeros(3))
        return True


# A hand that takes things out of a captured scene: its ray lights them up, its trigger chooses.

NEAR, FAR = 0.01, 1000.0  # metres of the room, of a view along a ray
NARROW = 0.01  # tangent of that view's half
SIZE = (10, 10)  # its pixels: a hand means one or two of them
CENTRE = (SIZE[0] / 2, SIZE[1] / 2)


@dataclass
class PartsHand:
    """Keeps whether the trigger is down."""

    tool: PartsTool
    down: bool = False

    def act(self, frame: Frame, play_space: PlaySpace, carried: Carried) -> Frame:
        """While the tool is on: what the pointing hand means; the frame with what it leaves.

        A or X held adds, B or Y removes.
        """
        tool, side = self.tool, carried.pointer
        if not tool.on:
            self.down = False
            return frame
        hand = frame.hands[side]
        tool.poll()
        if hand.aim is None or carried.on_panel:
            self.down = False
            tool.look_away()
            return frame
        how = how_of(hand)
        self._point(hand, play_space, how)
        pressed = hand.trigger > (LET_GO if self.down else PRESSED)
        if pressed and not self.down:
            tool.click_lit(how)
        self.down = pressed
        taken = replace(hand, trigger=0.0, primary=False, secondary=False)
        return replace(frame, hands={**frame.hands, side: taken})

    def _point(self, hand: Hand, play_space: PlaySpace, how: str) -> None:
        """Asks what the ray meets, as soon as the question before is answered."""
        if self.tool.finder.busy or hand.aim is None:
            self.tool.how = how
            return
        tangents = (-NARROW, NARROW, -NARROW, NARROW)
        self.tool.point(play_space.view(View(hand.aim, tangents, NEAR, FAR, SIZE)), CENTRE, how)


def how_of(hand: Hand) -> str:
    """What a trigger does with the buttons that are held."""
    return ADD if hand.primary else REMOVE if hand.secondary else REPLACE
