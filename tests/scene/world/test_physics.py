"""The physics as a class: the same bits again, snapshots, contacts, queries, what it refuses."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.colliders.triangle_mesh import TriangleMesh
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.grab import hand_velocity, turn_between
from shapeshift.scene.world.physics import FLOOR, Physics
from shapeshift.scene.world.physics_shapes import THICKNESS
from tests.support.scene.physics_things import at, box, cup, run, sheet, table

pytest.importorskip("rapier3d", reason="the physics engine is not installed")

CUBE = [box(0.05, 0.05, 0.05)]


def busy_world() -> Physics:
    """Twelve cups and boxes in a heap on a floor, one of them in a hand, after a second."""
    physics = Physics(floor_y=0)
    for i in range(12):
        hulls = cup() if i % 2 else CUBE
        physics.add_body(hulls, at(0.03 * (i % 3), 0.1 + 0.12 * i, 0.02 * (i % 5)), 0.1 + 0.3 * i)
    run(physics, 0.5)
    first = physics.bodies()[0]
    hand = physics.pose(first)
    grab = physics.grab(first, hand, hand.position)
    for i in range(45):
        physics.move_hand(grab, Pose(hand.position + np.array([0.004, 0.006, 0]) * i, hand.wxyz))
        physics.step()
    return physics


def carry_on(physics: Physics) -> list:
    """Another second with the hand on the move and let go in the middle; all contacts."""
    grab = 1
    hand = physics.pose(physics.held(grab))
    told = []
    for i in range(90):
        if i < 45:
            x, y, z = hand.position
            physics.move_hand(grab, at(x, y - 0.005 * i, z + 0.003 * i, hand.wxyz))
        elif i == 45:
            physics.release(grab)
        told += [(c.a, c.b, c.impulse_n_s, *c.point) for c in physics.step()]
    return told


def test_the_same_calls_give_the_same_hash_here_and_in_another_process():
    physics = busy_world()
    carry_on(physics)
    here = physics.hash()
    again = busy_world()
    carry_on(again)
    assert again.hash() == here
    folder = Path(__file__).resolve().parents[2]
    code = (
        "from tests.scene.world import test_physics as t\n"
        "p = t.busy_world(); t.carry_on(p); print(p.hash())"
    )
    paths = os.pathsep.join([str(folder), str(folder.parent)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": paths, "PYTHONHASHSEED": "17"},
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == here


def test_a_snapshot_comes_back_to_the_bit_with_what_is_held():
    physics = busy_world()
    taken, before = physics.snapshot(), physics.hash()
    first, after = carry_on(physics), physics.hash()
    assert after != before
    physics.restore(taken)
    assert physics.hash() == before
    assert carry_on(physics) == first and physics.hash() == after
    other = Physics(gravity_m_s2=1, hz=45)  # another one takes on the snapshot's gravity and step
    other.restore(taken)
    assert other.hash() == before and other.hz == 90
    other.restore(other.snapshot())  # of a restored one, too
    assert carry_on(other) == first and other.hash() == after


def test_looking_and_asking_change_nothing():
    plain, asked = busy_world(), busy_world()
    for _ in range(30):
        plain.step()
        asked.step()
        asked.cast_ray((0, 2, 0), (0.01, -1, 0))
        asked.nearest((0, 0.2, 0), 0.5)
        asked.snapshot()
    assert asked.hash() == plain.hash() and carry_on(asked) == carry_on(plain)
    assert asked.hash() == plain.hash()


@pytest.mark.parametrize("cut", [0, 10, 40, 70, -1, "flip", "other"])
def test_a_broken_snapshot_is_refused_and_nothing_changes(cut):
    physics = busy_world()
    good, before = physics.snapshot(), physics.hash()
    bad = b"PNG" * 100 if cut == "other" else good[:cut] if cut != "flip" else bytearray(good)
    if cut == "flip":
        bad[len(bad) // 2] ^= 1
    with pytest.raises(ValueError, match="no whole snapshot of this program's physics"):
        physics.restore(bytes(bad))
    assert physics.hash() == before


def test_a_contact_is_told_once_a_step_with_its_impulse_and_place():
    physics = Physics(floor_y=0)
    body = physics.add_body(cup(), at(1, 0.56, -2), 0.5)  # 0.5 m above the floor
    steps = [physics.step() for _ in range(90)]
    hits = [contact for contacts in steps for contact in contacts]
    assert all(len({(c.a, c.b) for c in contacts}) == len(contacts) for contacts in steps)
    first = hits[0]
    assert (first.a, first.b) == (FLOOR, body)
    landing = 0.5 * np.sqrt(2 * 9.81 * 0.5)  # N s: mass times the speed after half a metre
    assert landing * 0.97 < first.impulse_n_s < landing * 1.1
    assert abs(first.point[1]) < 0.002 and np.hypot(first.point[0] - 1, first.point[2] + 2) < 0.065
    resting = [c.impulse_n_s for contacts in steps[60:] for c in contacts]
    assert np.allclose(np.mean(resting), 0.5 * 9.81 / 90, rtol=0.05)  # its weight, a step long


def test_two_bodies_that_meet_exchange_the_impulse_that_is_told():
    physics = Physics(gravity_m_s2=0)
    a = physics.add_body(CUBE, at(-0.3, 0, 0), 0.5, restitution=0)
    b = physics.add_body(CUBE, at(0.3, 0, 0), 0.5, restitution=0)
    physics.set_velocity(a, (2, 0, 0))
    told = [contact for _ in range(60) for contact in physics.step()]
    assert {(c.a, c.b) for c in told} == {(a, b)}
    gained = physics.velocity(b)[0][0] * 0.5
    assert sum(c.impulse_n_s for c in told) == pytest.approx(gained, rel=1e-4)
    assert gained == pytest.approx(0.5, rel=0.06)  # N s: half of the momentum


def test_restitution_bounces():
    physics = Physics()
    physics.add_static([box(1, 0.1, 1)], at(0, -0.1, 0), restitution=0.8)
    body = physics.add_body(CUBE, at(0, 0.55, 0), 0.3, restitution=0.8)
    highest, fell = 0.0, False
    for _ in range(90):
        physics.step()
        fell = fell or physics.velocity(body)[0][1] > 0.1
        highest = max(highest, physics.pose(body).position[1] - 0.05) if fell else 0.0
    assert highest == pytest.approx(0.5 * 0.8**2, rel=0.08)


# The slow twins: closed forms in float64.


@pytest.mark.parametrize("gravity", [0.0, 1.62, 9.81])
@pytest.mark.parametrize("velocity", [(0, 0, 0), (3, 4, -1), (0, 12, 0)])
def test_flight_is_the_parabola(gravity, velocity):
    physics = Physics(gravity_m_s2=gravity)
    body = physics.add_body([box(0.06, 0.02, 0.04)], at(1, 2, 3), 0.3)
    physics.set_velocity(body, velocity, (0, 0, 5))
    for step in range(1, 91):
        physics.step()
        t = step / 90
        want = np.array([1, 2, 3]) + np.array(velocity) * t - np.array([0, gravity * t * t / 2, 0])
        # Substeps of 1/360 s are late by half of one at most.
        assert np.linalg.norm(physics.pose(body).position - want) <= gravity * t / 720 + 0.003
    assert np.allclose(physics.velocity(body)[0], np.array(velocity) - (0, gravity, 0), atol=1e-3)


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("kind", ["floor", "slab"])
def test_sliding_stops_where_friction_says(friction, kind):
    physics = Physics(floor_y=None)
    if kind == "floor":
        physics = Physics(floor_y=0)
        friction_there = 0.6
    else:
        physics.add_static([box(5, 0.1, 5)], at(0, -0.1, 0), friction=friction)
        friction_there = friction
    body = physics.add_body([box(0.1, 0.02, 0.1)], at(0, 0.0201, 0), 0.3, friction=friction)
    run(physics, 0.2)
    physics.set_velocity(body, (2, 0, 0))
    run(physics, 2 / (0.1 * 9.81) + 0.5)
    slowing = 9.81 * (friction + friction_there) / 2  # the two sides' mean counts
    assert physics.pose(body).position[0] == pytest.approx(2**2 / (2 * slowing), rel=0.03)


@pytest.mark.parametrize(("slope", "slides"), [(0.5, False), (0.7, True)])
def test_on_a_slope_friction_decides(slope, slides):
    physics = Physics()
    angle = np.arctan(slope)  # friction 0.6 holds up to 0.6
    turn = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
    physics.add_static([box(3, 0.1, 3)], at(0.1 * np.sin(angle), -0.1 * np.cos(angle), 0, turn))
    start = np.array([-np.sin(angle), np.cos(angle)]) * 0.0501
    body = physics.add_body(CUBE, at(*start, 0, turn), 0.3)
    run(physics, 1)
    moved = np.linalg.norm(physics.pose(body).position[:2] - start)
    want = 9.81 * (np.sin(angle) - 0.6 * np.cos(angle)) / 2 if slides else 0.0
    assert moved == pytest.approx(want, abs=0.03 if slides else 0.002)


def test_the_turn_between_two_rotations_is_the_axis_times_the_angle():
    rng = np.random.default_rng(5)
    for _ in range(200):
        a = rng.standard_normal(4)
        a /= np.linalg.norm(a)
        axis = rng.standard_normal(3)
        want = axis / np.linalg.norm(axis) * rng.uniform(0, 3.1)
        angle = np.linalg.norm(want)
        turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * want / angle)])
        b = Pose.from_matrix(at(0, 0, 0, turn).matrix() @ at(0, 0, 0, a).matrix()).wxyz
        assert np.allclose(turn_between(a, b), want, atol=1e-6)
        assert np.allclose(turn_between(a, -b), want, atol=1e-6)
    assert np.array_equal(turn_between(a, a), np.zeros(3))


def test_the_hands_velocity_is_exact_for_even_speeding_up_and_steady_in_noise():
    t = np.arange(6) / 90
    trail = [at(3 * s + 20 * s * s, -s, 7) for s in t]
    assert np.allclose(hand_velocity(trail, 90)[0], (3 + 40 * t[-1], -1, 0), atol=1e-6)
    assert np.array_equal(hand_velocity(trail[:1], 90)[0], np.zeros(3))
    assert np.allclose(hand_velocity(trail[:2], 90)[0][1], -1)
    rng = np.random.default_rng(1)
    still = [at(*rng.normal(0, 3e-4, 3)) for _ in range(6)]  # 0.3 mm of tracking noise
    assert np.linalg.norm(hand_velocity(still, 90)[0]) < 0.1


def test_rays_and_hands_find_the_nearest():
    physics = Physics(floor_y=0)
    near = physics.add_body(CUBE, at(0, 1, -1), 0.3)
    far = physics.add_body(CUBE, at(0, 1, -2), 0.3)
    upright, faces = sheet().vertices[:, [0, 2, 1]], sheet().faces[:, ::-1]  # it looks to +Z
    wall = physics.add_static(TriangleMesh(upright, np.ascontiguousarray(faces)), at(0, 1, -3))
    assert physics.cast_ray((0, 1, 0), (0, 0, -7)) == (near, pytest.approx(0.95, abs=1e-5))
    assert physics.cast_ray((0, 1, -1.5), (0, 0, -1)) == (far, pytest.approx(0.45, abs=1e-5))
    assert physics.cast_ray((0.5, 1, 0), (0, 0, -1)) == (wall, pytest.approx(3, abs=1e-5))
    behind = physics.cast_ray((0.5, 1, -5), (0, 0, 1))  # the back that an open mesh is given
    assert behind == (wall, pytest.approx(2 - THICKNESS, abs=1e-5))
    assert physics.cast_ray((0.5, 1, 0), (0, -1, 0)) == (FLOOR, pytest.approx(1, abs=1e-5))
    assert physics.cast_ray((0.5, 1, 0), (0, 1, 0)) is None
    assert physics.cast_ray((0, 1, -1), (0, 1, 0)) == (near, 0)  # from inside
    assert physics.nearest((0, 1.15, -1), 0.2) == (near, pytest.approx(0.1, abs=1e-5))
    assert physics.nearest((0, 1.15, -1), 0.05) is None
    physics.set_pose(near, at(0, 1, -2.5))
    assert physics.cast_ray((0, 1, 0), (0, 0, -1))[0] == far
    physics.remove(far)
    assert physics.cast_ray((0, 1, 0), (0, 0, -1))[0] == near


def test_what_lay_on_a_removed_thing_falls():
    physics = Physics()
    shelf = table(physics, "slab")
    body = physics.add_body([box(0.1, 0.02, 0.1)], at(0, 0.0201, 0), 0.3)
    run(physics, 5)
    assert physics.sleeps(body)
    physics.remove(shelf)
    run(physics, 0.5)
    assert physics.pose(body).position[1] < -0.5
    with pytest.raises(ValueError, match="no object 1"):
        physics.pose(shelf)


def test_a_removed_body_leaves_its_hand_empty_and_ids_are_never_given_again():
    physics = Physics()
    body = physics.add_body(CUBE, at(0, 1, 0), 0.3)
    grab = physics.grab(body, at(0, 1, 0), (0, 1, 0))
    physics.remove(body)
    assert physics.held(grab) is None
    assert physics.add_body(CUBE, at(0, 1, 0), 0.3) == body + 1
    physics.step()
    with pytest.raises(ValueError, match=f"no grab {grab}"):
        physics.move_hand(grab, at(0, 1, 0))


@pytest.mark.parametrize(("mass", "held"), [(0.001, 0.05), (0.05, 0.05), (5, 5), (80, 5)])
def test_a_mass_out_of_range_is_clamped_with_a_note(mass, held):
    physics = Physics()
    body = physics.add_body(CUBE, at(0, 0, 0), mass)
    assert physics.mass(body) == held
    told = [f"{finding.what}, {finding.done}" for finding in physics.findings]
    want = [f"the mass {mass:g} kg is outside 0.05 to 5 kg, taken as {held:g} kg"]
    assert told == ([] if mass == held else want)


def test_triangles_without_area_are_dropped_with_a_note():
    vertices = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 1, 2]], np.int32)
    physics = Physics()
    physics.add_static(TriangleMesh(vertices, faces), at(0, 0, 0))
    assert physics.findings[0].count == 1 and physics.findings[0].done == "dropped"
    body = physics.add_body(CUBE, at(0, 0.2, 0), 0.3)
    run(physics, 1)
    assert physics.pose(body).position[1] == pytest.approx(0.05, abs=0.001)


NAN, INF = float("nan"), float("inf")
FLAT = [box(1, 0, 1)]
BAD_CALLS = {
    "gravity NaN": lambda p, b: Physics(gravity_m_s2=NAN),
    "hz 0": lambda p, b: Physics(hz=0),
    "no substeps": lambda p, b: Physics(substeps=0),
    "floor NaN": lambda p, b: Physics(floor_y=NAN),
    "position NaN": lambda p, b: p.add_body(CUBE, at(NAN, 0, 0), 1),
    "position far": lambda p, b: p.add_body(CUBE, at(1e9, 0, 0), 1),
    "position of two": lambda p, b: p.add_body(CUBE, Pose(np.zeros(2), np.eye(4)[0]), 1),
    "rotation 0": lambda p, b: p.add_body(CUBE, at(0, 0, 0, (0, 0, 0, 0)), 1),
    "rotation NaN": lambda p, b: p.add_body(CUBE, at(0, 0, 0, (NAN, 0, 0, 0)), 1),
    "mass 0": lambda p, b: p.add_body(CUBE, at(0, 0, 0), 0),
    "mass NaN": lambda p, b: p.add_body(CUBE, at(0, 0, 0), NAN),
    "mass Inf": lambda p, b: p.add_body(CUBE, at(0, 0, 0), INF),
    "friction below 0": lambda p, b: p.add_body(CUBE, at(0, 0, 0), 1, friction=-0.1),
    "friction NaN": lambda p, b: p.add_static(CUBE, at(0, 0, 0), friction=NAN),
    "restitution over 1": lambda p, b: p.add_body(CUBE, at(0, 0, 0), 1, restitution=1.1),
    "no hulls": lambda p, b: p.add_body([], at(0, 0, 0), 1),
    "flat hull": lambda p, b: p.add_body(FLAT, at(0, 0, 0), 1),
    "three points": lambda p, b: p.add_body([CUBE[0][:3]], at(0, 0, 0), 1),
    "hull of pairs": lambda p, b: p.add_body([CUBE[0][:, :2]], at(0, 0, 0), 1),
    "hull NaN": lambda p, b: p.add_body([CUBE[0] * np.float32(NAN)], at(0, 0, 0), 1),
    "hull far": lambda p, b: p.add_body([CUBE[0] * np.float32(1e9)], at(0, 0, 0), 1),
    "no triangles": lambda p, b: p.add_static(
        TriangleMesh(sheet().vertices, np.zeros((0, 3), np.int32)), at(0, 0, 0)
    ),
    "mesh far": lambda p, b: p.add_static(
        TriangleMesh(sheet().vertices * np.float32(1e9), sheet().faces), at(0, 0, 0)
    ),
    "velocity NaN": lambda p, b: p.set_velocity(b, (NAN, 0, 0)),
    "turning Inf": lambda p, b: p.set_velocity(b, (0, 0, 0), (0, INF, 0)),
    "velocity of the floor": lambda p, b: p.set_velocity(FLOOR, (1, 0, 0)),
    "place NaN": lambda p, b: p.set_pose(b, at(0, NAN, 0)),
    "hand NaN": lambda p, b: p.grab(b, at(NAN, 0, 0), (0, 0, 0)),
    "grab at NaN": lambda p, b: p.grab(b, at(0, 0, 0), (0, NAN, 0)),
    "grab of the floor": lambda p, b: p.grab(FLOOR, at(0, 0, 0), (0, 0, 0)),
    "grab of nothing": lambda p, b: p.grab(77, at(0, 0, 0), (0, 0, 0)),
    "move to NaN": lambda p, b: p.move_hand(p.grab(b, at(0, 0, 0), (0, 1, 0)), at(0, NAN, 0)),
    "release of nothing": lambda p, b: p.release(5),
    "ray without direction": lambda p, b: p.cast_ray((0, 0, 0), (0, 0, 0)),
    "ray NaN": lambda p, b: p.cast_ray((0, 0, 0), (NAN, 0, 0)),
    "ray from NaN": lambda p, b: p.cast_ray((NAN, 0, 0), (1, 0, 0)),
    "reach NaN": lambda p, b: p.nearest((0, 0, 0), NAN),
    "remove twice": lambda p, b: (p.remove(b), p.remove(b)),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_bad_input_is_refused_in_a_sentence(case):
    physics = Physics(floor_y=0)
    body = physics.add_body(CUBE, at(0, 1, 0), 0.3)
    ids = physics.ids()
    with pytest.raises(ValueError) as refused:
        BAD_CALLS[case](physics, body)
    text = str(refused.value)
    assert text.endswith(".") and "\n" not in text and len(text) > 25, text
    if case != "remove twice":
        assert physics.ids() == ids
        run(physics, 0.2)
        assert np.isfinite(physics.pose(body).position).all()


def test_no_number_is_ever_lost_whatever_hands_do():
    rng = np.random.default_rng(9)
    physics = Physics(floor_y=0)
    table_top = physics.add_static(sheet(), at(0, 0.7, 0))
    bodies = [physics.add_body(cup(), at(0.1 * i, 0.8, 0), 0.05 * 3**i) for i in range(5)]
    bodies += [physics.add_body(CUBE, at(0.1, 0.8, 0), 5) for _ in range(3)]  # in one place
    grabs: list[int] = []
    for step in range(720):
        deed = rng.integers(12)
        body = bodies[rng.integers(len(bodies))]
        if deed == 0 and len(grabs) < 4:
            grabs.append(physics.grab(body, at(*rng.normal(0, 1, 3)), rng.normal(0, 1, 3)))
        elif deed == 1 and grabs:
            physics.release(grabs.pop())
        elif deed == 2 and step % 5 == 0:  # tracking jumps across the street
            for grab in grabs:
                physics.move_hand(grab, at(*rng.normal(0, 300, 3)))
        elif deed == 3:
            physics.set_velocity(body, rng.normal(0, 1000, 3), rng.normal(0, 1000, 3))
        elif deed == 4:
            physics.set_pose(body, at(*rng.normal(0, 0.2, 3)))  # into the floor and each other
        else:
            for grab in grabs:
                turn = rng.standard_normal(4)
                physics.move_hand(grab, at(*rng.normal(0, 0.3, 3), turn / np.linalg.norm(turn)))
        for contact in physics.step():
            assert 0 <= contact.impulse_n_s < 1e6 and np.isfinite(contact.point).all()
        for body in bodies:
            pose, velocities = physics.pose(body), physics.velocity(body)
            assert np.isfinite([*pose.position, *pose.wxyz, *np.concatenate(velocities)]).all()
            assert abs(np.linalg.norm(pose.wxyz) - 1) < 1e-4
    assert not physics.findings and table_top in physics.ids()
