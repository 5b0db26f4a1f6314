"""Reactions: every transition, the edges of time and impulse, and what is refused."""

import itertools
import math
from dataclasses import replace
from fractions import Fraction

import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopBlend, StopWeights
from shapeshift.scene.control import EASES
from shapeshift.scene.selectors.selector import Box, Sphere
from shapeshift.scene.world.reactions import (
    KINDS,
    Event,
    Machine,
    Motion,
    Reaction,
    ReactionState,
    State,
    TwoAxes,
    advance,
    start,
    steer,
)

NAMES = ("normal", "ice", "fire", "charcoal")
STATES = tuple(State(name, i / 4) for i, name in enumerate(NAMES))
NAN, INF = math.nan, math.inf
BALL = Sphere(centre=(0, 0, 0), radius=1.0, x=0, space="world")


def reaction(on: str = "grab", to: str | float = "next", **changes) -> Reaction:
    plain = {"seconds": 0.0, "cooldown_s": 0.0}
    return Reaction(on=on, to=to, **(plain | changes))


def machine(*reactions: Reaction, **changes) -> Machine:
    return Machine(STATES, reactions, **changes)


def hit(impulse: float, before: float = 0.0) -> Event:
    return Event("collision", impulse, before)


GRAB, RAY = Event("grab"), Event("ray")


def test_next_goes_round_all_states():
    ring, standing, seen = machine(reaction()), start(machine(), 0.0), []
    for step in range(9):
        standing, fired = advance(ring, standing, float(step), [GRAB])
        assert [(f.before, f.after) for f in fired] == [(NAMES[step % 4], NAMES[(step + 1) % 4])]
        seen.append((standing.state, standing.x))
    assert seen == [(NAMES[(i + 1) % 4], (i + 1) % 4 / 4) for i in range(9)]


@pytest.mark.parametrize(
    "here,after,goal",
    [*itertools.product(NAMES, ((), ("ice",), ("ice", "fire")), (*NAMES, "next"))],
)
def test_table_of_transitions(here, after, goal):
    """Every state, every condition, every goal: against the rule written out."""
    table = machine(reaction(to=goal, after=after))
    standing, fired = advance(table, start(table, NAMES.index(here) / 4), 0.0, [GRAB])
    wanted = NAMES[(NAMES.index(here) + 1) % 4] if goal == "next" else goal
    allowed = (not after or here in after) and wanted != here
    assert standing.state == (wanted if allowed else here)
    assert standing.x == NAMES.index(standing.state) / 4
    assert len(fired) == allowed


@pytest.mark.parametrize("on,kind", [*itertools.product(("collision", "grab", "ray"), repeat=2)])
def test_only_its_own_kind_fires_it(on, kind):
    table = machine(reaction(on, "fire"))
    event = hit(1.0) if kind == "collision" else Event(kind)
    standing, fired = advance(table, start(table, 0.0), 0.0, [event])
    assert (standing.state, len(fired)) == (("fire", 1) if on == kind else ("normal", 0))


def test_the_first_that_may_be_taken_and_leads_elsewhere_wins():
    table = machine(
        reaction(to="ice", after=("fire",)), reaction(to="normal"), reaction(to="charcoal"),
        reaction(to="ice"),
    )  # fmt: skip
    standing, fired = advance(table, start(table, 0.0), 0.0, [GRAB])
    assert (fired[0].reaction, standing.state) == (2, "charcoal")  # 1 leads where it is
    standing, fired = advance(table, standing, 1.0, [GRAB])
    assert (fired[0].reaction, standing.state) == (1, "normal")


def test_several_events_in_one_step_are_taken_in_order():
    table = machine(
        reaction("grab", "ice"), reaction("ray", "fire", after=("ice",)), reaction("collision", 0.9)
    )
    standing, fired = advance(table, start(table, 0.0), 0.0, [RAY, GRAB, RAY, hit(1)])
    assert [(f.kind, f.before, f.after, f.to_x) for f in fired] == [
        ("grab", "normal", "ice", 0.25), ("ray", "ice", "fire", 0.5), ("collision", "fire", "", 0.9)
    ]  # fmt: skip
    assert (standing.x, standing.state) == (0.9, "")
    standing, fired = advance(table, standing, 0.0, [hit(1)])
    assert not fired  # it is at 0.9 already


def test_next_from_an_x_without_a_name_is_the_first_state():
    table = machine(reaction("grab"), reaction("ray", 0.6))
    standing, _ = advance(table, start(table, 0.0), 0.0, [RAY])
    assert standing.state == ""
    assert advance(table, standing, 0.0, [GRAB])[0].state == "normal"


@pytest.mark.parametrize(
    "least,impulse", [*itertools.product((0.0, 1e-9, 0.5, 5.0), (0, 0.5, 5, 6))]
)
def test_impulse_at_least_exactly(least, impulse):
    table = machine(reaction("collision", "ice", least_impulse_n_s=least))
    for value in (impulse, math.nextafter(impulse, INF), math.nextafter(impulse, -INF)):
        if value >= 0:
            _, fired = advance(table, start(table, 0.0), 0.0, [hit(value)])
            assert len(fired) == (value >= least and value > 0)


def test_what_lies_does_not_collide_again():
    table = machine(reaction("collision", "next", least_impulse_n_s=0.5))
    standing, before, states = start(table, 0.0), 0.0, []
    for step, impulse in enumerate((0.4, 0.5, 0.6, 0.5, 0.4, 0.5, 0.0, 9.0, 9.0)):
        standing, _ = advance(table, standing, float(step), [hit(impulse, before)])
        before = impulse
        states.append(standing.state)
    assert states == ["normal", *["ice"] * 4, "fire", "fire", "charcoal", "charcoal"]


@pytest.mark.parametrize(
    "steps,first", [*itertools.product((1, 9, 22, 27, 90), (0, 7, 10, 89, 90000))]
)
def test_cooldown_ends_exactly_on_its_step(steps, first):
    """At 90 Hz, whatever rounding says: not one step early, not one late."""
    table = machine(reaction(cooldown_s=float(Fraction(steps, 90))))
    standing, _ = advance(table, start(table, 0.0), first / 90, [GRAB])
    for step in range(first + 1, first + steps):
        standing, fired = advance(table, standing, step / 90, [GRAB])
        assert not fired
    standing, fired = advance(table, standing, (first + steps) / 90, [GRAB])
    assert len(fired) == 1


def test_cooldown_holds_for_its_own_kind_and_within_a_step():
    table = machine(reaction("grab", cooldown_s=1.0), reaction("ray", "charcoal"))
    standing, fired = advance(table, start(table, 0.0), 0.0, [GRAB, GRAB, RAY])
    assert [f.kind for f in fired] == ["grab", "ray"]
    standing, fired = advance(table, standing, 0.999, [GRAB])
    assert not fired and standing.state == "charcoal"
    standing, fired = advance(table, standing, 1.0, [GRAB])
    assert standing.state == "normal"


@pytest.mark.parametrize("ease", EASES)
def test_x_eases_to_its_goal_and_arrives_exactly(ease):
    table = machine(reaction(to="charcoal", seconds=0.3, ease=ease))
    standing, _ = advance(table, start(table, 0.1), 10 / 90, [GRAB])
    assert standing.x == 0.1
    xs = []
    for step in range(11, 38):
        standing, _ = advance(table, standing, step / 90)
        part = EASES[ease][0]((step - 10) / 27)
        xs.append(standing.x)
        assert standing.x == pytest.approx(0.1 + 0.65 * part, abs=1e-9)
    assert xs == sorted(xs)
    assert standing.x == 0.75 and standing.motion is None  # at step 37 = 10 + 27, not one later


def test_large_and_small_steps_reach_the_same_x():
    table = machine(reaction(to="charcoal", seconds=2.0))
    begun, _ = advance(table, start(table, 0.0), 0.0, [GRAB])
    slow = begun
    for step in range(1, 151):
        slow, _ = advance(table, slow, step / 100)
    fast, _ = advance(table, begun, 1.5)
    assert slow == fast


def test_a_reaction_on_the_way_goes_on_from_where_x_is():
    table = machine(reaction("grab", 1.0, seconds=1.0, ease="even"), reaction("ray", "normal"))
    standing, _ = advance(table, start(table, 0.0), 0.0, [GRAB])
    standing, fired = advance(table, standing, 0.5, [GRAB])
    assert not fired and standing.x == 0.5  # it is on its way there: nothing begins anew
    turned = replace(table, reactions=(table.reactions[0], reaction("ray", 0.0, seconds=1.0)))
    standing, _ = advance(turned, standing, 0.5, [RAY])
    assert standing.x == 0.5 and standing.state == "normal"
    assert advance(turned, standing, 1.0)[0].x == 0.25  # smooth: half of the way at half the time


def test_a_ring_goes_on_past_one():
    table = machine(reaction(seconds=1.0, ease="even"), ring=True)
    standing, _ = advance(table, start(table, 0.75), 0.0, [GRAB])
    xs = [advance(table, standing, t)[0].x for t in (0.25, 0.5, 0.99, 1.0)]
    assert standing.state == "normal"
    assert xs == pytest.approx([0.8125, 0.875, 0.9975, 0.0])
    assert xs[-1] == 0.0
    past = replace(table, reactions=(reaction(to="ice", seconds=1.0, ease="even"),))
    standing, _ = advance(past, start(past, 0.75), 0.0, [GRAB])
    assert [advance(past, standing, t)[0].x for t in (0.5, 0.75, 1.0)] == pytest.approx(
        [1.0, 0.125, 0.25]
    )


STOPS = StopBlend(tuple(Stop(state.name, state.x) for state in (*STATES, State("again", 1.0))))


@pytest.mark.parametrize("ring", (False, True))
def test_a_state_that_is_no_neighbour_is_reached_without_the_ones_between(ring):
    table = machine(reaction(to="charcoal", seconds=1.0), ring=ring, blend=STOPS)
    standing, _ = advance(table, start(table, 0.0), 0.0, [GRAB])
    for time in (0.1, 0.5, 0.9):
        row = STOPS.weights(advance(table, standing, time)[0].x)
        assert row[0] > 0 and row[3] > 0 and not row[[1, 2, 4]].any()
    half = advance(table, standing, 0.5)[0]
    assert half.x == StopWeights((("normal", 0.5), ("charcoal", 0.5)))
    assert advance(table, standing, 1.0)[0].x == 0.75
    turned = replace(table, reactions=(reaction(to="ice", seconds=1.0),))  # from half way there
    on = advance(turned, replace(half, state="normal"), 0.5, [GRAB])[0]
    rows = [STOPS.weights(advance(turned, on, time)[0].x) for time in (0.5, 0.9, 1.2)]
    assert rows[0].tolist() == [0.5, 0, 0, 0.5, 0]
    assert not any(row[[2, 4]].any() for row in rows)
    assert advance(turned, on, 1.5)[0].x == 0.25


def test_the_end_of_a_ring_is_its_beginning():
    table = machine(reaction(to="normal", seconds=1.0, ease="even"), ring=True, blend=STOPS)
    standing, _ = advance(table, start(table, 0.75), 0.0, [GRAB])
    assert [advance(table, standing, t)[0].x for t in (0.25, 0.5, 1.0)] == [0.8125, 0.875, 0.0]
    standing, _ = advance(table, start(table, 0.25), 0.0, [GRAB])  # up, past fire and charcoal
    row = STOPS.weights(advance(table, standing, 0.5)[0].x)
    assert row.tolist() == [0, 0.5, 0, 0, 0.5]


def test_states_may_be_blends():
    blend = StopWeights((("ice", 0.5), ("charcoal", 0.5)))
    states = (*STATES, State("ash", blend))
    table = Machine(states, (reaction(to="ash", seconds=1.0),), blend=STOPS)
    assert start(table, blend).state == "ash" and start(table, 0.7).state == "charcoal"
    standing, _ = advance(table, start(table, 0.0), 0.0, [GRAB])
    assert STOPS.weights(advance(table, standing, 0.5)[0].x).tolist() == [0.5, 0.25, 0, 0.25, 0]
    assert advance(table, standing, 1.0)[0].x == blend
    with pytest.raises(ValueError, match="no stop 'bone'"):
        start(table, StopWeights((("bone", 1.0),)))
    with pytest.raises(ValueError, match="no stop 'ice'"):
        Machine((State("ash", blend),))


def test_two_axes_lean_straight_to_their_sides():
    axes = TwoAxes(0.0, 0.5, 1.0)
    assert axes.x(-1, 0.5, STOPS) == StopWeights((("normal", 0.5), ("fire", 0.5)))
    assert axes.x(-1, 1, STOPS) == 0.0 and axes.x(0, 1, STOPS) == 0.5


def test_a_region_is_entered_from_outside_only():
    table = machine(reaction("enter", region=BALL), reaction("grab", "charcoal"))
    standing, states = start(table, 0.0), []
    for step, x in enumerate((0.0, 0.5, 2.0, 1.0, 0.0, math.nextafter(1, 2), 1.0)):
        standing, fired = advance(table, standing, float(step), place=(x, 0, 0))
        assert all(f.kind == "enter" for f in fired)
        states.append(standing.state)
    assert states == [*["normal"] * 3, "ice", "ice", "ice", "fire"]  # the surface is inside


def test_regions_are_told_apart_and_come_after_the_events():
    box = Box(centre=(5, 0, 0), half=(1, 1, 1), x=0, space="world")
    table = machine(
        reaction("enter", "ice", region=BALL), reaction("enter", "fire", region=box),
        reaction("ray", "charcoal"),
    )  # fmt: skip
    standing, _ = advance(table, start(table, 0.0), 0.0, place=(3, 0, 0))
    standing, fired = advance(table, standing, 1.0, [RAY], place=(5, 0, 0))
    assert [(f.reaction, f.after) for f in fired] == [(2, "charcoal"), (1, "fire")]
    standing, fired = advance(table, standing, 2.0)  # no place: as before
    assert not fired and standing.inside == (False, True, False)


def test_a_hand_on_the_slider_ends_a_motion():
    table = machine(reaction(to="charcoal", seconds=1.0, cooldown_s=1.0))
    standing, _ = advance(table, start(table, 0.0), 0.0, [GRAB])
    standing = steer(table, standing, 0.3)
    standing, _ = advance(table, standing, 0.5, [GRAB])
    assert (standing.x, standing.state, standing.motion) == (0.3, "ice", None)
    assert advance(table, standing, 1.0, [GRAB])[0].state == "charcoal"


def test_the_same_events_give_the_same_standings():
    def run() -> list[ReactionState]:
        table = machine(reaction(seconds=0.2), reaction("ray", "ice", seconds=0.5))
        standing, out = start(table, 0.0), []
        for step in range(200):
            events = [GRAB] * (step % 17 == 0) + [RAY] * (step % 23 == 0)
            standing, _ = advance(table, standing, step / 90, events, (step, 0, 0))
            out.append(standing)
        return out

    assert run() == run()


@pytest.mark.parametrize("time", (NAN, INF, -1.0, math.nextafter(0.0, -1)))
def test_time_never_goes_back_and_is_a_number(time):
    standing, _ = advance(machine(), start(machine(), 0.0), 0.0)
    with pytest.raises(ValueError, match="must not go back"):
        advance(machine(), standing, time)


@pytest.mark.parametrize("bad", (NAN, INF, -INF))
def test_what_is_no_number_is_refused(bad):
    table = machine(reaction("enter", region=BALL))
    with pytest.raises(ValueError, match="finite"):
        advance(table, start(table, 0), 0.0, place=(0, bad, 0))
    for values in ((bad, 0.0), (0.0, bad)):
        with pytest.raises(ValueError, match="N s"):
            Event("collision", *values)
    with pytest.raises(ValueError, match="from 0 to 1"):
        start(table, bad)
    with pytest.raises(ValueError, match="from 0 to 1"):
        steer(table, start(table, 0), bad)
    for name in ("seconds", "cooldown_s"):
        with pytest.raises(ValueError, match=f"'{name}'"):
            reaction(**{name: bad})
    with pytest.raises(ValueError, match="'least_impulse_n_s'"):
        reaction("collision", least_impulse_n_s=bad)
    with pytest.raises(ValueError, match="'to'"):
        reaction(to=bad)
    with pytest.raises(ValueError, match="balance"):
        TwoAxes().x(bad, 0.5)
    with pytest.raises(ValueError, match="balance"):
        TwoAxes().x(0.5, bad)


@pytest.mark.parametrize(
    "make,said",
    [
        (lambda: Event("enter"), "collision, grab or ray"),
        (lambda: Event("touch"), "'touch'"),
        (lambda: Event("collision", -1.0), "N s"),
        (lambda: State("", 0.0), "is called ''"),
        (lambda: State("next", 0.0), "'next'"),
        (lambda: State("a", 1.5), "1.5"),
        (lambda: reaction("touch"), "'on' is 'touch'"),
        (lambda: reaction(to=""), "'to' is ''"),
        (lambda: reaction(to=2), "'to' is 2"),
        (lambda: reaction(ease="bouncy"), "'ease' is 'bouncy'"),
        (lambda: reaction(least_impulse_n_s=1), "a collision"),
        (lambda: reaction("enter"), "'region' is None"),
        (lambda: reaction("grab", region=BALL), "for nothing else"),
        (lambda: Machine((STATES[0], STATES[0])), "two states are called 'normal'"),
        (lambda: Machine(STATES[:1], (reaction(),)), "two are needed"),
        (lambda: machine(reaction(to="hot")), "'hot' is no state; there are normal, ice"),
        (lambda: machine(reaction(after=("hot",))), "'hot' is no state"),
        (lambda: TwoAxes(below=-1), "'below'"),
        (lambda: TwoAxes().x(1.5, 0), "-1 to 1"),
        (lambda: TwoAxes().x(0, -0.1), "0 to 1"),
    ],
)
def test_impossible_declarations_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()


@pytest.mark.parametrize("kind", KINDS)
def test_without_reactions_nothing_happens(kind):
    events = [] if kind == "enter" else [Event(kind)]
    standing, fired = advance(Machine(), start(Machine(), 0.4), 0.0, events, (0, 0, 0))
    assert (standing.x, standing.state, fired) == (0.4, "", ())


def test_two_axes_lean_to_a_side_as_far_as_the_power_goes():
    axes = TwoAxes(0.1, 0.5, 0.8)
    assert [axes.x(b, 1.0) for b in (-1, -0.5, 0, 0.5, 1)] == pytest.approx(
        [0.1, 0.3, 0.5, 0.65, 0.8]
    )
    assert [axes.x(b, 0.0) for b in (-1, 0, 1)] == [0.5] * 3
    assert axes.x(1, 0.5) == pytest.approx(0.65)
    assert all(0 <= TwoAxes(0, 0.3, 1).x(b / 7, p / 7) <= 1 for b in range(-7, 8) for p in range(8))


def test_a_motion_before_it_began_is_at_its_start():
    motion = Motion(0.2, 0.8, 1.0, 1.0, "smooth")
    assert (motion.x(0.0), motion.x(1.0), motion.x(2.0)) == (0.2, 0.2, 0.8)
