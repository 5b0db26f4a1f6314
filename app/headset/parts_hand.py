"""A hand that takes things out of a captured scene: its ray lights them up, its trigger chooses."""

from dataclasses import dataclass, replace

from shapeshift.app.editor.state.parts.parts_tool import ADD, REMOVE, REPLACE, PartsTool
from shapeshift.scene.pose import View
from shapeshift.vr.frame import Frame, Hand
from shapeshift.vr.locomotion.play_space import PlaySpace
from shapeshift.vr.panel.carried import Carried

PRESSED, LET_GO = 0.6, 0.4  # of a trigger
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
