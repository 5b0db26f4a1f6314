"""Moving in VR: sticks, turns, jumps and the world in one's hands, with plain structs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.locomotion import (
    HOME_S,
    LONGEST_S,
    RISES_S,
    RULES,
    Arc,
    Comfort,
    Rules,
    Travel,
    level_ground,
    move,
    throw_arc,
)
from shapeshift.vr.play_space import PlaySpace, underfoot
from tests.support.vr.vr_frames import LOST, at, frame, hand, tilted, yawed

HZ = 90
START = PlaySpace(Pose(np.array([1.0, 0.5, -2]), yawed(0.3)), 1.0)


def run(frames, play_space=START, travel=None, rules=RULES, ground=None, seconds=1 / HZ):
    """Play space, travel and all that was shown after these frames."""
    travel, shown = travel or Travel(), []
    for one in frames:
        play_space, travel, comfort = move(play_space, travel, one, seconds, rules, ground)
        shown.append(comfort)
    return play_space, travel, shown


def feet(play_space: PlaySpace, one) -> np.ndarray:
    return play_space.point(underfoot(one.head))


def test_at_rest_nothing_changes_at_all():
    play_space, travel, shown = run([frame()] * 10)
    assert play_space is START and travel == Travel()
    assert shown == [Comfort()] * 10


def test_a_full_stick_walks_along_the_head():
    for look, scale in ((0.0, 1.0), (1.1, 1.0), (1.1, 0.2)):
        start = replace(START, scale=scale)
        head = Pose(np.array([0.1, 1.7, 0.2]), yawed(look))
        one = frame(left=hand("left", stick=(0, 1)), head=head)
        play_space, _, _ = run([one] * HZ, start)
        way = play_space.world_from_play.position - start.world_from_play.position
        angle = look + 0.3
        ahead = np.array([-math.sin(angle), 0, -math.cos(angle)])
        assert np.allclose(way, ahead * RULES.walk_m_s * scale, atol=1e-9)


def test_sideways_backwards_and_slantwise():
    for stick in ((1, 0), (0, -1), (-0.6, 0.8)):
        one = frame(left=hand("left", stick=stick))
        play_space, _, _ = run([one] * HZ, PlaySpace())
        wanted = np.array([stick[0], 0, -stick[1]]) * RULES.walk_m_s
        assert np.allclose(play_space.world_from_play.position, wanted, atol=1e-9)


def test_looking_down_still_walks_ahead():
    for tilt in (-math.pi / 2, -1.4, 1.4):
        head = Pose(np.array([0.1, 1.7, 0.2]), tilted(tilt))
        one = frame(left=hand("left", stick=(0, 1)), head=head)
        play_space, _, _ = run([one] * HZ, PlaySpace())
        assert np.allclose(play_space.world_from_play.position, [0, 0, -RULES.walk_m_s], atol=1e-9)


@pytest.mark.parametrize("stick", [(0.1, 0.1), (0.0, 0.149), (math.nan, 0.5), (0.5, math.nan)])
def test_a_stick_that_drifts_or_is_no_number_rests(stick):
    both = frame(left=hand("left", stick=stick), right=hand("right", stick=stick))
    for turning in ("snap", "smooth"):
        play_space, _, _ = run([both] * 50, rules=Rules(turning=turning))
        assert play_space is START


def test_the_other_stick_flies_and_does_not_turn_meanwhile():
    one = frame(right=hand(stick=(0.5, 0.9)))
    play_space, _, _ = run([one] * HZ, replace(START, scale=0.5))
    way = play_space.world_from_play.position - START.world_from_play.position
    assert way[0] == way[2] == 0 and 0.3 < way[1] <= RULES.fly_m_s * 0.5
    assert np.array_equal(play_space.world_from_play.wxyz, START.world_from_play.wxyz)


def angle_between(a: PlaySpace, b: PlaySpace) -> float:
    turns = a.world_from_play.matrix()[:3, :3].T @ b.world_from_play.matrix()[:3, :3]
    return math.degrees(math.atan2(turns[0, 2], turns[0, 0]))


def test_a_snap_is_thirty_degrees_about_the_head_once_until_the_stick_is_back():
    for push, turn in ((0.9, -30), (-0.9, 30)):
        one = frame(right=hand(stick=(push, 0.2)))
        play_space, travel, shown = run([one] * 40)
        assert angle_between(START, play_space) == pytest.approx(turn)
        head = one.head.position
        assert np.allclose(play_space.point(head), START.point(head), atol=1e-12)
        assert [s.jumps for s in shown] == [True] + [False] * 39
        # half back is not back
        half = frame(right=hand(stick=(math.copysign(0.4, push), 0)))
        again, travel, _ = run([half, one], play_space, travel)
        assert again is play_space
        rest = frame(right=hand(stick=(0.1, 0)))
        again, _, _ = run([rest, one], play_space, travel)
        assert angle_between(START, again) == pytest.approx(2 * turn)


def test_a_hand_unseen_for_a_moment_does_not_snap_again():
    one = frame(right=hand(stick=(1, 0)))
    play_space, _, _ = run([one, frame(right=LOST), one])
    assert angle_between(START, play_space) == pytest.approx(-30)


def test_smooth_turning_is_ninety_degrees_a_second_and_none_is_none():
    one = frame(right=hand(stick=(1, 0)))
    play_space, _, shown = run([one] * HZ, rules=Rules(turning="smooth"))
    assert angle_between(START, play_space) == pytest.approx(-90)
    assert not any(s.jumps for s in shown) and shown[-1].vignette > 0.5
    play_space, _, _ = run([one] * HZ, rules=Rules(turning="none"))
    assert play_space is START


def test_hands_can_be_swapped():
    one = frame(right=hand(stick=(0, 1)), left=hand("left", stick=(1, 0)))
    play_space, _, _ = run([one] * HZ, PlaySpace(), rules=Rules(walks="right"))
    assert angle_between(PlaySpace(), play_space) == pytest.approx(-30)
    there = play_space.point(one.head.position) - PlaySpace().point(one.head.position)
    assert np.linalg.norm(there) == pytest.approx(RULES.walk_m_s, rel=0.01)  # less one frame


def test_rules_are_checked():
    with pytest.raises(ValueError, match="'both'; left or right"):
        Rules(walks="both")
    with pytest.raises(ValueError, match="snap, smooth, none"):
        Rules(turning="slow")


def test_after_a_hitch_nobody_is_thrown_far():
    one = frame(left=hand("left", stick=(0, 1)))
    for seconds, way in ((5.0, LONGEST_S), (-1.0, 0.0), (math.nan, 0.0)):
        play_space, _, _ = run([one], PlaySpace(), seconds=seconds)
        assert play_space.world_from_play.position[2] == pytest.approx(-way * RULES.walk_m_s)


def test_the_vignette_comes_with_what_only_the_eye_moves_by_and_goes():
    walks = frame(left=hand("left", stick=(0, 1)))
    _, travel, shown = run([walks] * 60)
    dark = [s.vignette for s in shown]
    assert dark == sorted(dark) and dark[0] > 0
    assert dark[-1] == pytest.approx(RULES.vignette, abs=0.01)
    assert dark[round(RISES_S * HZ) - 1] == pytest.approx(RULES.vignette * (1 - 1 / math.e), 0.02)
    _, travel, shown = run([frame()] * 180, travel=travel)
    assert shown[-1].vignette == 0 and travel == Travel()
    _, _, shown = run([walks] * 60, rules=Rules(vignette=0))
    assert not any(s.vignette for s in shown)


# ---- jumps


def aiming(**named):
    """A hand at 1.2 m that points a little upwards."""
    return hand("right", wxyz=tilted(0.3), **named)


def test_a_jump_lands_where_the_arc_came_down():
    start = replace(START, scale=0.5)
    held = frame(right=aiming(primary=True))
    play_space, travel, shown = run([held] * 20, start)
    assert play_space is start and travel.aims == "right"
    arc = shown[-1].arc
    assert arc.fine and abs(arc.landing[1]) < 1e-9 and arc.points[-1] is not None
    landing = start.point(arc.landing)
    let_go = frame(right=aiming())
    play_space, travel, shown = run([let_go], start, travel)
    assert np.allclose(feet(play_space, let_go), landing, atol=1e-12)
    assert shown[0].blink == 1 and shown[0].arc is None
    assert shown[0].jumps and not shown[0].home
    _, travel, shown = run([frame()] * 20, play_space, travel)
    dark = [s.blink for s in shown]
    assert dark == sorted(dark, reverse=True) and dark[-1] == 0 and travel == Travel()


def test_a_jump_is_thought_better_of():
    held = frame(right=aiming(primary=True))
    for instead in (
        frame(right=LOST),
        frame(right=aiming(primary=True, squeeze=1.0)),
        frame(right=aiming(primary=True), recentred=True),
    ):
        _, travel, _ = run([held, instead])
        assert travel.aims is None
        play_space, _, shown = run([frame(right=aiming())], START, replace(travel, grips=()))
        assert play_space is START and not shown[0].jumps


def test_a_button_that_is_down_already_does_not_aim():
    held = frame(right=aiming(primary=True))
    _, travel, _ = run([held, frame(right=LOST)])
    _, travel, shown = run([frame(right=LOST), frame()], START, travel)
    assert travel.aims is None
    _, travel, shown = run([held], START, replace(travel, pressed=frozenset({"right"})))
    assert travel.aims is None and shown[0].arc is None


def test_where_one_cannot_stand_one_does_not_jump():
    up = frame(right=hand("right", wxyz=tilted(1.5), primary=True))
    wall = lambda start, end: (end, False)  # noqa: E731
    for ground in (lambda start, end: None, wall):
        _, travel, shown = run([up], ground=ground)
        assert not shown[0].arc.fine
        play_space, travel, _ = run([frame()], START, travel, ground=ground)
        assert play_space is START and travel.aims is None


def test_the_arc_is_the_parabola_and_meets_the_floor_exactly():
    room = PlaySpace(Pose(np.array([0, 2.0, 0]), yawed(1.0)), 3.0)
    arc = throw_arc(at(0, 1.2, 0, tilted(0.4)), room, level_ground(2.0))
    speed, angle, height = 6.0, 0.4, 1.2
    rise = speed * math.sin(angle)
    falls = (rise + math.sqrt(rise**2 + 2 * 9.81 * height)) / 9.81
    assert arc.landing[2] == pytest.approx(-speed * math.cos(angle) * falls, abs=0.02)
    assert arc.landing[1] == pytest.approx(0, abs=1e-9) and arc.landing[0] == pytest.approx(0)
    steps = np.diff(arc.points[:-1], n=2, axis=0)  # the same fall in each step
    assert np.allclose(steps, [0, -9.81 * 0.05**2, 0], atol=1e-12)


def test_an_aim_that_is_no_number_has_no_arc():
    arc = throw_arc(at(0, 1, 0, [math.nan, 0, 0, 1]), START, level_ground(0))
    assert isinstance(arc, Arc) and len(arc.points) == 1 and not arc.fine


# ---- the world in one's hands


def test_one_hand_draws_the_world_along():
    start = replace(START, scale=0.25)
    places = [(0.2, 1.2, -0.4), (0.2, 1.2, -0.4), (0.5, 1.0, 0.1), (-0.3, 1.6, 0.4)]
    held = start.point(np.array(places[0]))
    play_space, travel = start, Travel()
    for place in places:
        one = frame(right=hand("right", place, squeeze=1.0))
        play_space, travel, comfort = move(play_space, travel, one, 1 / HZ)
        assert np.allclose(play_space.point(np.array(place)), held, atol=1e-12)
        assert comfort.vignette == 0 and not comfort.jumps
    assert np.array_equal(play_space.world_from_play.wxyz, start.world_from_play.wxyz)
    still, travel, _ = move(play_space, travel, frame(right=hand("right", (1, 1, 1))), 1 / HZ)
    assert still is play_space and travel.grips == ()


def both(left, right, squeeze=(1.0, 1.0), **named):
    return frame(
        hand("left", left, squeeze=squeeze[0]), hand("right", right, squeeze=squeeze[1]), **named
    )


def test_two_hands_stretch_and_turn_and_both_hold():
    a, b = (-0.2, 1.2, -0.4), (0.2, 1.2, -0.4)
    held = [START.point(np.array(p)) for p in (a, b)]
    play_space, travel, _ = run([both(a, b)])
    assert np.allclose(play_space.world_from_play.position, START.world_from_play.position)
    # Twice as far apart, a quarter turned, elsewhere: level, so both points can be kept.
    c, d = (0.1, 1.5, -0.9), (0.1, 1.5, -0.1)
    play_space, travel, _ = run([both(c, d)], play_space, travel)
    assert play_space.scale == pytest.approx(0.5)
    for place, world in zip((c, d), held, strict=True):
        assert np.allclose(play_space.point(np.array(place)), world, atol=1e-9)
    # One lets go: the other draws on, and nothing leaps.
    after, travel, _ = run([both(c, d, (0.0, 1.0))], play_space, travel)
    assert np.allclose(after.world_from_play.position, play_space.world_from_play.position)
    assert after.scale == play_space.scale


def test_hands_one_above_the_other_do_not_spin_the_world():
    play_space, travel, _ = run([both((0, 1.2, -0.4), (0.01, 1.5, -0.4))])
    play_space, travel, _ = run([both((0.01, 1.2, -0.4), (0, 1.5, -0.4))], play_space, travel)
    assert angle_between(START, play_space) == pytest.approx(0)
    near, _, _ = run([both((0, 1.3, -0.4), (0.001, 1.3, -0.4))], play_space, travel)
    assert near.scale == play_space.scale


def test_the_stretch_is_bounded():
    play_space, travel, _ = run([both((-0.5, 1, 0), (0.5, 1, 0))], replace(START, scale=0.02))
    for _ in range(4):
        play_space, travel, _ = run([both((-0.03, 1, 0), (0.03, 1, 0))], play_space, travel)
        play_space, travel, _ = run(
            [frame(), both((-0.03, 1, 0), (0.03, 1, 0)), both((-1, 1, 0), (1, 1, 0))],
            play_space,
            travel,
        )
    assert play_space.scale == 0.01


def test_a_light_squeeze_trembles_no_grip():
    for squeeze, grips in ((0.5, 0), (0.61, 1), (0.5, 1), (0.45, 1), (0.39, 0), (0.5, 0)):
        if squeeze == 0.5 and grips == 0:
            travel = Travel()
        one = frame(right=hand("right", squeeze=squeeze))
        _, travel, _ = move(START, travel, one, 1 / HZ)
        assert len(travel.grips) == grips


def test_a_squeeze_that_had_something_else_takes_no_world():
    """A hand whose squeeze a caller hid begins anew only after it let go in the open."""
    _, travel, _ = run([frame(right=hand(squeeze=1.0))])
    assert travel.grips
    _, travel, _ = run([frame(right=LOST)], START, travel)
    assert not travel.grips


def test_sticks_wait_while_the_world_is_held():
    one = both((-0.2, 1.2, -0.4), (0.2, 1.2, -0.4))
    one.hands["left"] = replace(one.hands["left"], stick=(0, 1))
    play_space, _, _ = run([one] * 10)
    assert np.allclose(play_space.world_from_play.position, START.world_from_play.position)


def test_a_new_origin_moves_nobody():
    here = frame(right=hand(squeeze=1.0))
    play_space, travel, _ = run([here])
    there = frame(right=hand("right", (2, 1, 3), squeeze=1.0), recentred=True)
    after, travel, _ = run([there], play_space, travel)
    assert np.allclose(after.world_from_play.position, START.world_from_play.position, atol=1e-12)
    on = frame(right=hand("right", (2, 1.5, 3), squeeze=1.0))
    after, _, _ = run([on], after, travel)
    way = after.world_from_play.position - START.world_from_play.position
    assert np.allclose(way, [0, -0.5, 0])


# ---- true size, and all anew


def test_a_button_brings_the_true_size_back_with_the_feet_on_the_spot():
    for scale, changes in ((0.25, True), (1.0, False)):
        start = replace(START, scale=scale)
        down = frame(right=hand(secondary=True))
        play_space, travel, shown = run([down] * 20 + [frame()], start)
        assert play_space.scale == 1.0 and travel.resets is None
        assert np.allclose(feet(play_space, down), feet(start, down), atol=1e-12)
        assert [s.jumps for s in shown] == [False] * 20 + [changes]
        assert shown[-1].blink == float(changes) and not any(s.home for s in shown)


def test_held_for_a_second_all_begins_anew_once():
    small = replace(START, scale=0.25)
    down = frame(left=hand("left", secondary=True))
    play_space, _, shown = run([down] * 200 + [frame()] * 2, small)
    [at_frame] = [i for i, s in enumerate(shown) if s.home]
    assert at_frame == pytest.approx(HOME_S * HZ, abs=1)
    assert play_space.scale == 0.25  # it is the caller's now
    assert [i for i, s in enumerate(shown) if s.jumps] == [at_frame]


def test_a_lost_hand_did_not_let_go_of_its_button():
    small = replace(START, scale=0.25)
    play_space, travel, _ = run([frame(right=hand(secondary=True)), frame(right=LOST)], small)
    assert play_space is small and travel.resets is None
