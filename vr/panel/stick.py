"""What thumbsticks do to the panel: the carrying hand's slides x, the pointing hand's scrolls.

What a stick is for is decided when it leaves its middle, and stays so until it is let go: a hand
that walks does not begin to slide.
"""

from collections.abc import Sequence

from shapeshift.runtime_models.model import Stop

# What a stick does since it left its middle; rests: came to a stop and has to be let go.
MIDDLE, SLIDES, RESTS, SCROLLS, MOVES = "", "slides", "rests", "scrolls", "moves"
OURS = (SLIDES, RESTS, SCROLLS)  # of them, those that walk and turn nobody
DEAD = 0.2  # of its way
SLIDE_SPEED = 0.6  # of the slider's range a second, stick at its end
SCROLL_SPEED = 3.0  # notches of a wheel a second, stick at its end
ON_STOP = 1e-3  # of the slider's range

Stick = tuple[float, float]  # -1..1, right and ahead


def slide(
    does: str, stick: Stick, x: float, stops: Sequence[Stop], seconds: float
) -> tuple[str, float]:
    """What the stick does now, and the new x: pushed sideways first it moves x, and rests at every
    stop.
    """
    if at_rest(stick):
        return MIDDLE, x
    does = does or (SLIDES if abs(stick[0]) > abs(stick[1]) else MOVES)
    if does != SLIDES:
        return does, x
    moved = min(max(x + _speed(stick[0]) * SLIDE_SPEED * seconds, 0.0), 1.0)
    low, high = sorted((x, moved))
    passed = [s.x for s in stops if low <= s.x <= high and abs(s.x - x) > ON_STOP]
    if not passed:
        return does, moved
    return RESTS, min(passed, key=lambda stop_x: abs(stop_x - x))


def scroll(does: str, stick: Stick, on_panel: bool, seconds: float) -> tuple[str, float]:
    """What the stick does now, and by how many notches it scrolls, up positive: pushed ahead or
    back first, while its hand points at the panel.
    """
    if at_rest(stick):
        return MIDDLE, 0.0
    does = does or (SCROLLS if on_panel and abs(stick[1]) > abs(stick[0]) else MOVES)
    if does != SCROLLS:
        return does, 0.0
    return does, _speed(stick[1]) * SCROLL_SPEED * seconds


def at_rest(stick: Stick) -> bool:
    """Also where a stick tells no number."""
    return not max(abs(stick[0]), abs(stick[1])) > DEAD


def _speed(pushed: float) -> float:
    """-1..1, 0 within the dead zone."""
    if not abs(pushed) > DEAD:
        return 0.0
    speed = (min(abs(pushed), 1.0) - DEAD) / (1 - DEAD)
    return speed if pushed > 0 else -speed
