"""How a world begins: pushed apart, put down, floating, and whether it rests; of shapes by rule."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.world.follow import follow, reset_objects
from shapeshift.scene.world.physics import Physics
from shapeshift.scene.world.settle import (
    AFTER_S,
    MOST_INSIDE,
    TOUCHING_M,
    begin,
    let_fall,
    push_apart,
    settle,
)
from tests.support.scene.physics_things import at, box, cup, run, table
from tests.support.scene.world_scenes import BOX, HALF, item, model, place, real

pytest.importorskip("rapier3d", reason="the physics engine is not installed")

SIDE = 2 * HALF  # metres, of the boxes of world_scenes


def ball(radius: float, count: int = 200) -> np.ndarray:
    """(count, 3) float32 points spread over a sphere."""
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    y = 1 - 2 * (np.arange(count) + 0.5) / count
    r = np.sqrt(1 - y**2)
    return (radius * np.stack([r * np.cos(turn), y, r * np.sin(turn)], 1)).astype(np.float32)


def beside(share: float, **heavy):
    """Two boxes on the floor, the second so much of its side within the first."""
    away = item("b", position=(SIDE * (1 - share), HALF, 0))
    return real(item("a", position=(0, HALF, 0), **heavy), away)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2, MOST_INSIDE - 0.01])
def test_two_boxes_that_overlap_are_pushed_apart_and_stand(share):
    world = beside(share)
    begin(world)
    a, b = place(world, "a"), place(world, "b")
    assert np.abs(b - a).max() >= SIDE - 2 * TOUCHING_M  # a gap along one axis at least
    moved = np.linalg.norm(a - [0, HALF, 0]) + np.linalg.norm(b - [SIDE * (1 - share), HALF, 0])
    assert moved == pytest.approx(share * SIDE, abs=3 * TOUCHING_M)  # no farther than it has to be
    found = world.findings[0]
    assert found.what.startswith("'a' and 'b' begin ") and found.done == "pushed apart"
    assert all(rest.is_good for rest in settle(world))
    before = place(world, "a"), place(world, "b")
    for _ in range(3 * world.hz):
        world.step()
    for was, now in zip(before, (place(world, "a"), place(world, "b")), strict=True):
        assert np.linalg.norm(now - was) < 0.02 * SIDE


@pytest.mark.parametrize("share", [MOST_INSIDE + 0.01, 0.6])
def test_what_begins_deep_inside_another_is_refused_by_both_names(share):
    world = beside(share)
    poses = place(world, "a").copy(), place(world, "b").copy()
    with pytest.raises(BadFile, match=f"'a' and 'b' begin inside each other.* {100 * share:.0f} %"):
        begin(world)
    assert (place(world, "a") == poses[0]).all() and (place(world, "b") == poses[1]).all()


def test_what_touches_and_no_more_is_left_to_the_bit():
    world = beside(0.0)
    hashed = world.physics.hash()
    begin(world)
    assert world.physics.hash() == hashed and not world.findings


@pytest.mark.parametrize("share", [0.05, 0.2, 0.6])
def test_the_depth_of_two_balls_is_the_spheres_own(share):
    physics = Physics(floor_y=0)
    for x in (0.0, 0.1 * (1 - share)):
        physics.add_body([ball(0.05)], at(x, 0.05, 0), 0.5)
    poses, (found,) = push_apart(physics)
    # 200 corners lie on the sphere, faces up to 2 % of its radius within.
    assert found.share == pytest.approx(share, abs=0.02)
    apart = np.linalg.norm(poses[found.a].position - poses[found.b].position)
    assert apart == pytest.approx(0.1, abs=0.002)


def test_the_heavier_of_two_moves_less():
    world = beside(0.2, mass_kg=4.0)
    begin(world)
    moved = np.linalg.norm(place(world, "a") - [0, HALF, 0])
    assert 0 < moved < 0.3 * 0.2 * SIDE


@pytest.mark.parametrize("kind", ["slab", "sheet"])
@pytest.mark.parametrize("height", [0.002, -0.005, -0.02])
def test_a_thing_a_little_off_the_table_is_put_on_it(kind, height):
    physics = Physics()
    table(physics, kind)
    number = physics.add_body([box(HALF, HALF, HALF)], at(0, HALF + height, 0), 0.5)
    for body, pose in push_apart(physics)[0].items():
        physics.set_pose(body, pose)
    run(physics, 3)
    assert physics.pose(number).position == pytest.approx([0, HALF, 0], abs=0.02 * SIDE)


def test_what_nothing_carries_floats_until_it_is_touched():
    world = real(item("a", position=(0, 0.5, 0)), item("b", position=(0.5, HALF + 0.002, 0)))
    begin(world)
    rests = {rest.name: rest for rest in settle(world)}
    assert rests["a"].floats and "nothing that is in the scene carries a" in rests["a"].sentence()
    assert rests["b"].is_good and not rests["b"].sentence()
    assert place(world, "b")[1] == pytest.approx(HALF, abs=1e-3)  # put down
    for _ in range(world.hz):
        world.step()
    assert place(world, "a") == pytest.approx([0, 0.5, 0], abs=1e-6)
    world.move_object("b", at(0.5, HALF, 0.1))  # what is edited elsewhere wakes nothing here
    for _ in range(world.hz):
        world.step()
    assert place(world, "a")[1] == pytest.approx(0.5, abs=1e-6)
    world.physics.set_velocity(world.objects["b"].body_id, (0, 0, 0))
    world.move_object("b", at(0.02, 0.7, 0))  # falls on it
    for _ in range(2 * world.hz):
        world.step()
    assert place(world, "a")[1] < 0.2


def test_of_what_moves_the_test_ends_when_it_is_known_how():
    """A box whose middle is beside the edge of the one that carries it tips; how fast does not
    change with the time that the test would have gone on."""
    world = real(
        item("a", position=(0, HALF, 0), static=True),
        item("b", position=(1.3 * HALF, 3 * HALF, 0)),
    )
    (rest,) = settle(world)
    assert rest.kept and not rest.motion.rests
    assert rest.motion.after_s == pytest.approx(rest.motion.left_s + AFTER_S, abs=2 / world.hz)
    assert f"in {rest.motion.after_s:.1f} s" in rest.sentence()
    whole = let_fall(world.physics, 3.0, after_s=9.0)
    assert all(motion.after_s == 3.0 for motion in whole.values())


def floating(**changes):
    return real(item("a", position=(0, 0.5, 0), floats=True, **changes))


def test_a_file_says_what_floats_and_one_that_does_not_falls(tmp_path):
    world = floating()
    path = tmp_path / "float.scene.json"
    write_scene_file(SceneFile(folder=tmp_path, items=(world.objects["a"].item,)), path)
    assert read_scene_file(path).items[0].floats
    saved = world.snapshot()
    for _ in range(45):
        world.step()
    assert place(world)[1] == pytest.approx(0.5, abs=1e-6)
    world.move_hand("right", at(0, 0.5, 0))
    assert world.grab("right") == "a"
    world.step()
    world.release("right")
    for _ in range(90):
        world.step()
    assert place(world)[1] < 0.06  # it was taken, and falls when let go
    reset_objects(world)
    world.step()
    assert place(world)[1] == pytest.approx(0.5, abs=1e-6)
    world.restore(saved)
    for _ in range(45):
        world.step()
    assert place(world)[1] == pytest.approx(0.5, abs=1e-6)
    falls = replace(world.objects["a"].item, floats=False)
    scene = SceneFile(folder=tmp_path, items=(falls,), floor_y=0.0)
    follow(world, scene, {"a": model()}, {"a": BOX})
    for _ in range(90):
        world.step()
    assert place(world)[1] < 0.06


def tilted(degrees: float) -> Physics:
    """A box on a table that is tilted about z."""
    physics, turn = Physics(), np.deg2rad(degrees)
    wxyz = (np.cos(turn / 2), 0, 0, np.sin(turn / 2))
    up = np.array([-np.sin(turn), np.cos(turn), 0])
    physics.add_static([box(1, 0.01, 1)], at(*(-0.01 * up), wxyz=wxyz))
    physics.add_body([box(HALF, HALF, HALF)], at(*(HALF * up), wxyz=wxyz), 0.5)
    return physics


def leaning() -> Physics:
    """A plank at 60 degrees that leans on the edge of a heavy box."""
    physics, turn, half, thick = Physics(floor_y=0), np.deg2rad(60), 0.1, 0.004
    physics.add_body([box(HALF, HALF, HALF)], at(0, HALF, 0), 4.0)
    along, below = np.array([-np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), -np.cos(turn)])
    foot = np.array([HALF + SIDE / np.tan(turn), 0.0])
    middle = foot + half * along - thick * below
    wxyz = (np.cos(turn), 0, 0, np.sin(turn))
    physics.add_body([box(half, thick, 0.03)], at(middle[0], middle[1], 0, wxyz), 0.2)
    return physics


def in_a_bowl() -> Physics:
    physics = Physics(floor_y=0)
    physics.add_body(cup(size=0.08), at(0, 0.08, 0), 0.5)
    physics.add_body([box(0.02, 0.02, 0.02)], at(0, 0.04, 0), 0.2)  # on its bottom, 0.02 thick
    return physics


def still(physics: Physics) -> tuple[float, float]:
    """Metres and degrees that the body which stirs most makes in 3 s."""
    before = {n: physics.pose(n) for n in physics.bodies()}
    run(physics, 3)
    after = {n: physics.pose(n) for n in before}
    moved = max(float(np.linalg.norm(after[n].position - p.position)) for n, p in before.items())
    cosine = min(abs(float(after[n].wxyz @ p.wxyz)) for n, p in before.items())
    return moved, float(np.degrees(2 * np.arccos(min(cosine, 1.0))))


@pytest.mark.parametrize("make", [lambda: tilted(3), leaning, in_a_bowl])
def test_friction_an_edge_and_a_bowl_hold(make):
    physics = make()
    assert not push_apart(physics)[1]
    moved, turned = still(physics)
    assert moved < 0.02 * 0.04 and turned < 2


def test_a_table_too_steep_for_friction_does_not_hold_and_a_push_moves_what_sleeps():
    assert still(tilted(40))[0] > 0.1  # friction 0.6 holds up to 31 degrees
    physics = tilted(3)
    run(physics, 2)
    (number,) = physics.bodies()
    assert physics.sleeps(number)
    pusher = physics.add_body([box(0.02, 0.02, 0.02)], at(0, 0.05, 0.3), 1.0)
    physics.set_velocity(pusher, (0, 0, -2.0))
    assert still(physics)[0] > 0.02 and abs(physics.pose(number).position[2]) > 0.01
