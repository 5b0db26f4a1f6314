"""A person in a world of bodies, from frame to frame, without a runtime."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.headset.xr_user import XrUser
from shapeshift.vr.play_space import PlaySpace, resized, underfoot
from tests.support.scene.world_scenes import item, reaction, real
from tests.support.vr.vr_frames import at, frame, hand, tilted

pytest.importorskip("rapier3d", reason="the physics engine is not installed")
HZ = 90
HERE = (0.2, 1.2, -0.4)  # of the right hand
EYE = at(0, 1.5, 2, tilted(-0.3))


def person_with(*items, floor_y=0.0, **file) -> XrUser:
    return XrUser(real(*items, floor_y=floor_y, **file), EYE, floor_y)


def run(person: XrUser, frames, play_space=None):
    """The standing after these frames, and the buzzes of each."""
    if not person.touching.seen:
        person.act(frame(), play_space or PlaySpace(), 1 / HZ)  # with open hands first
    play_space, felt = play_space or PlaySpace(), []
    for one in frames:
        play_space = person.act(one, play_space, 1 / HZ)
        felt.append(person.felt(person.world.advance(1 / HZ)))
    return play_space, felt


def test_one_begins_on_the_floor_before_the_scene():
    person = person_with()
    for scale in (1.0, 0.5):
        play_space = person.before_scene(frame(), scale)
        head = play_space.point(frame().head.position)
        assert np.allclose(head, [0, 1.7 * scale, 2]) and play_space.scale == scale


def test_grab_carry_and_drop_onto_the_floor_changes_x():
    hit = reaction("collision", "fire", least_impulse_n_s=0.1)
    person = person_with(item(position=HERE, reactions=(hit,)), gravity_m_s2=9.81)
    squeeze = frame(right=hand(squeeze=1.0))
    play_space, felt = run(person, [squeeze] * 30)
    assert person.touched.held["right"] == "a"
    assert [len(pulses) for pulses in felt] == [1] + [0] * 29
    assert np.allclose(person.world.objects["a"].pose.position, HERE, atol=5e-3)
    run(person, [frame()] * 90, play_space)
    assert person.touched.held["right"] is None
    assert person.world.objects["a"].reaction_state.state == "fire"
    assert person.world.objects["a"].pose.position[1] < 0.06


def held_after(person: XrUser, play_space: PlaySpace) -> float:
    """Metres from the hand to what it holds."""
    return float(
        np.linalg.norm(person.world.objects["a"].pose.position - play_space.point(np.array(HERE)))
    )


def test_a_menu_that_moves_or_scales_the_room_takes_along_what_is_held():
    person = person_with(item(position=HERE), gravity_m_s2=0.0)
    squeeze = frame(right=hand(squeeze=1.0))
    play_space, _ = run(person, [squeeze] * 10)
    for wished in (
        person.before_scene(squeeze, play_space.scale),
        resized(play_space, squeeze.head, 3.0),
    ):
        person.jumped()
        play_space, _ = run(person, [squeeze], wished)
        assert held_after(person, play_space) < 2e-3
        speed = person.world.physics.velocity(person.world.objects["a"].body)[0]
        assert np.linalg.norm(speed) < 0.05


def test_held_a_second_the_button_begins_anew_with_what_is_held():
    person = person_with(item(position=HERE), gravity_m_s2=0.0)
    down = frame(right=hand(squeeze=1.0, secondary=True))
    play_space, _ = run(person, [down] * 80, resized(PlaySpace(), down.head, 1.0))
    assert np.allclose(play_space.world_from_play.position, 0)
    play_space, _ = run(person, [down] * 20, play_space)
    assert np.allclose(play_space.point(down.head.position), [0, 1.7, 2], atol=1e-9)
    assert person.touched.held["right"] == "a" and held_after(person, play_space) < 2e-3


def test_one_jumps_onto_the_floor_of_the_scene_or_along_one_s_own_level():
    aims = frame(right=hand(wxyz=tilted(-0.3), primary=True))
    lets_go = replace(aims, hands={**aims.hands, "right": hand(wxyz=tilted(-0.3))})
    high = PlaySpace(at(0, 0.5, 0))
    for floor_y, level in ((0.0, 0.0), (None, 0.5)):
        person = person_with(floor_y=floor_y)
        play_space, _ = run(person, [aims, aims, lets_go], high)
        feet = play_space.point(underfoot(aims.head))
        assert feet[1] == pytest.approx(level, abs=1e-5) and feet[2] < -1
        assert person.comfort.jumps and person.comfort.blink == 1
