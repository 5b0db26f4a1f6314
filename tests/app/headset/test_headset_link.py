"""A session that is lost and opened again: how often it is tried, and where the person then is."""

from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.headset.session import headset_link
from shapeshift.app.headset.session.headset_link import PATIENCE_S, Comeback, HeadsetLink
from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST, Frame
from shapeshift.vr.openxr.instance import Lost, NoHeadset
from shapeshift.vr.play_space import PlaySpace

HEAD = Pose(np.array([0.3, 1.6, -0.2]), np.array([np.cos(0.4), 0.0, np.sin(0.4), 0.0]))
MOVED = Pose(np.array([-1.0, 1.5, 2.0]), np.array([np.cos(0.1), 0.0, -np.sin(0.1), 0.0]))
ROOM = PlaySpace(Pose(np.array([2.0, -0.7, 1.0]), np.array([np.cos(1), 0.0, np.sin(1), 0.0])), 3.0)


class Door:
    """Instances and sessions: each try answers with the next of `answers`."""

    def __init__(self, *answers: Exception | None) -> None:
        self.answers, self.open, self.tries = [None, *answers], 0, 0

    def instance(self, insets: bool = False) -> "Part":
        self.tries += 1
        if (answer := self.answers.pop(0)) is not None:
            raise answer
        return Part(self)

    def session(self, *given) -> "Part":
        return Part(self)


class Part:
    runtime = "Testing"

    def __init__(self, door: Door) -> None:
        self.door, self.followed = door, None
        door.open += 1

    def follow(self, lost) -> None:
        self.followed = lost

    def __enter__(self) -> "Part":
        return self

    def __exit__(self, *failure) -> None:
        self.door.open -= 1


class Wearer:
    """Loses its first `losses` sessions."""

    def __init__(self, losses: int, ends_after: int = 10**9) -> None:
        self.leaving, self.losses, self.rested, self.ends_after = False, losses, 0, ends_after
        self.sessions: list[Part] = []

    @property
    def ends(self) -> str:
        return "closed at the desk" if self.rested > self.ends_after else ""

    def loop(self, frames: int) -> None:
        self.losses -= 1
        if self.losses >= 0:
            raise Lost("Testing went away.")

    def rest_at_desk(self) -> None:
        self.rested += 1

    def go_on(self, session) -> None:
        self.sessions.append(session)


@pytest.fixture
def link(monkeypatch):
    """The clock is turned by who sleeps: a test waits for nothing."""
    clock = [100.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    monkeypatch.setattr(
        headset_link, "time", SimpleNamespace(monotonic=lambda: clock[0], sleep=sleep)
    )

    def made(door: Door, reopen: float = 10.0) -> HeadsetLink:
        monkeypatch.setattr(headset_link, "Instance", door.instance)
        return HeadsetLink(door.session, reopen)

    return made


def test_it_is_tried_once_a_second_until_it_is_back(link, capsys):
    door, wearer = Door(NoHeadset("none"), Lost("failed"), None), Wearer(losses=1)
    with link(door) as opened, opened.opened_on(None) as first:
        assert opened.stay(wearer, 0) == ""
        assert (door.tries, door.open, opened.reopened) == (4, 2, 1)
        assert wearer.sessions == [opened.session] and opened.session.followed is first
    assert door.open == 0
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "Testing went away. Trying for 10 seconds to go on.",
        "Testing is back; the session goes on.",
    ]


@pytest.mark.parametrize(("reopen", "tries"), [(0.0, 0), (0.5, 1), (1.0, 1), (2.5, 3), (10.0, 10)])
def test_one_that_stays_away_is_lost(link, reopen, tries):
    door = Door(*[NoHeadset("none")] * 20)
    with link(door, reopen) as opened, opened.opened_on(None):
        with pytest.raises(Lost, match="went away"):
            opened.stay(Wearer(losses=1), 0)
        assert door.tries == 1 + tries
    assert door.open == 0


def test_the_desk_ends_the_waiting(link):
    door, wearer = Door(*[NoHeadset("none")] * 20), Wearer(losses=1, ends_after=30)
    with link(door) as opened, opened.opened_on(None):
        assert opened.stay(wearer, 0) == "closed at the desk"
    assert wearer.rested == 31 and wearer.sessions == [] and door.open == 0


def test_one_that_is_lost_while_it_ends_is_not_opened_again(link):
    door, wearer = Door(None), Wearer(losses=1)
    wearer.leaving = True
    with link(door) as opened, opened.opened_on(None), pytest.raises(Lost):
        opened.stay(wearer, 0)
    assert door.tries == 1


def test_it_can_be_lost_again_and_again(link):
    door, wearer = Door(None, NoHeadset("none"), None), Wearer(losses=2)
    with link(door) as opened, opened.opened_on(None):
        opened.stay(wearer, 0)
        assert opened.reopened == 2 and len(wearer.sessions) == 2
        assert wearer.sessions[1].followed is wearer.sessions[0]


def state(**held: str | None) -> SimpleNamespace:
    touched = SimpleNamespace(held={"left": None, "right": None} | held)
    return SimpleNamespace(play_space=ROOM, user=SimpleNamespace(touched=touched))


def frame(head: Pose, drawn: bool = True, focused: bool = True, **hands) -> Frame:
    both = {"left": LOST, "right": LOST} | hands
    return Frame((), head, both, 0.0, 0.01, drawn, focused)


def test_the_head_is_where_it_was_in_the_world_whatever_the_origin_is_now():
    comeback = Comeback(state(), HEAD, same_room=False)
    assert comeback.place(frame(MOVED, drawn=False)) is None
    assert comeback.rests(frame(MOVED, drawn=False), 0.1)
    now = comeback.place(frame(MOVED))
    before, after = ROOM.pose(HEAD), now.pose(MOVED)
    np.testing.assert_allclose(after.position[[0, 2]], before.position[[0, 2]], atol=1e-9)
    np.testing.assert_allclose(
        after.matrix()[:3, 2], before.matrix()[:3, 2], atol=1e-9
    )  # both look level
    assert now.scale == ROOM.scale
    # The floor stays where it was: the head is 10 cm lower, three times as much in the world.
    assert after.position[1] == pytest.approx(before.position[1] - 0.3)
    assert comeback.place(frame(HEAD)) is None, "once"


def test_a_room_that_has_its_own_origin_stays_as_it_is():
    assert Comeback(state(), HEAD, same_room=True).place(frame(MOVED)) is ROOM


def test_the_world_waits_for_the_hand_that_held_and_for_no_other():
    there = SimpleNamespace(active=True)
    comeback = Comeback(state(right="cube"), HEAD, same_room=True)
    comeback.place(frame(HEAD))
    assert comeback.rests(frame(HEAD, focused=False, right=there), 0.5)
    assert comeback.rests(frame(HEAD, left=there), 0.5) and not comeback.over
    assert not comeback.rests(frame(HEAD, right=there), 0.5) and comeback.over
    empty = Comeback(state(), HEAD, same_room=True)
    empty.place(frame(HEAD, focused=False))
    assert not empty.rests(frame(HEAD, focused=False), 0.0), "nothing was held"


def test_a_hand_that_stays_away_is_waited_for_only_so_long():
    comeback = Comeback(state(left="ring"), HEAD, same_room=True)
    comeback.place(frame(HEAD))
    for _ in range(100):  # a menu of the runtime's has the hands: that does not count
        assert comeback.rests(frame(HEAD, focused=False), 1.0)
    waited = 0
    while comeback.rests(frame(HEAD), 0.5):
        waited += 1
    assert waited == PATIENCE_S / 0.5
