"""All with one controller: the other hand is not asked for, and its stick's work is shared out.

The panel hangs beside the head, opened by the menu button, by a press on the stick or by the palm
turned up; the same hand points at it.  The stick walks ahead and back, and turns sideways.
"""

from dataclasses import replace

from shapeshift.vr.frame import LOST, SIDES, Frame, Hand
from shapeshift.vr.panel import Palm, turned


def other_side(side: str) -> str:
    return SIDES[1 - SIDES.index(side)]


def alone(frame: Frame, side: str, palm: Palm, seconds: float) -> tuple[Frame, Palm]:
    """The frame with the hand of one side alone, which has a menu button in any case."""
    hand = frame.hands[side]
    palm = turned(palm, side, hand, seconds)
    hand = replace(hand, menu=hand.menu or hand.stick_click or palm.up)
    return replace(frame, hands={side: hand, other_side(side): LOST}), palm


def shared_stick(frame: Frame, side: str) -> Frame:
    """The stick of one side as both: ahead and back it walks, sideways it is the one that turns.

    Whichever way it is pushed farther counts; one flies by drawing the world along.
    """
    hand = frame.hands[side]
    x, y = hand.stick
    turns = abs(x) > abs(y)
    walking = replace(hand, stick=(0.0, 0.0 if turns else y))
    turning = Hand(active=hand.active, stick=(x if turns else 0.0, 0.0))
    return replace(frame, hands={side: walking, other_side(side): turning})
