"""A world follows the edits of its file; what was not edited goes on."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.selectors.selector import Sphere
from shapeshift.scene.world.follow import changed, follow, reset_objects
from shapeshift.scene.world.world import World
from tests.support.scene.world_scenes import BOX, STATES, at, item, model, place, reaction, real

pytest.importorskip("rapier3d")


def edited(world: World, *items, background=None) -> World:
    """The world after its file has these items."""
    file = SceneFile(folder=None, items=items, background=background, floor_y=0.0)
    names = [obj.name for obj in file.all_items]
    follow(world, file, dict.fromkeys(names, model()), dict.fromkeys(names, BOX))
    return world


def fallen(*items) -> World:
    world = real(*items)
    for _ in range(60):
        world.step()
    return world


def test_what_was_not_edited_stays_where_it_fell():
    a, b = item("a"), item("b", position=(1, 1, 0))
    world = fallen(a, b)
    lies, body = place(world, "b").copy(), world.objects["b"].body
    assert lies[1] < 0.1
    edited(world, replace(a, position=(0, 2, 0)), b)
    assert list(place(world, "a")) == [0, 2, 0] and list(place(world, "b")) == list(lies)
    edited(world, replace(a, position=(0, 2, 0)), replace(b, x=0.5, visible=False))
    drawn = world.drawn().objects[1]
    assert (drawn.x, drawn.visible, world.objects["b"].body) == (0.5, False, body)
    assert list(place(world, "b")) == list(lies)
    before = world.snapshot()
    edited(world, *(obj.item for obj in world.objects.values()))
    assert world.snapshot().objects == before.objects


def test_objects_come_go_and_change_their_order():
    a, b, c = item("a"), item("b", position=(1, 1, 0)), item("c", position=(2, 1, 0))
    world = real(a, b)
    world.move_hand("right", at(0, 1, 0))
    world.grab("right")
    edited(world, c, b)
    assert list(world.objects) == ["c", "b"] and world.held("right") is None
    assert [obj.label for obj in world.drawn().objects] == [1, 2]
    table = item("background", static=True, position=(0, -1, 0))
    edited(world, a, b, c, background=table)  # an undo
    assert [(obj.name, obj.label) for obj in world.drawn().objects] == [
        ("background", 0), ("a", 1), ("b", 2), ("c", 3)
    ]  # fmt: skip
    world.step()


def test_a_new_name_keeps_body_pose_and_hand():
    a = item("a")
    world = fallen(a, item("b", position=(1, 1, 0)))
    lies = place(world, "a").copy()
    world.move_hand("right", at(*lies))
    world.grab("right")
    body = world.objects["a"].body
    edited(world, replace(a, name="cup"), world.objects["b"].item)
    assert list(world.objects) == ["cup", "b"] and world.held("right") == "cup"
    assert world.objects["cup"].body == body and list(place(world, "cup")) == list(lies)
    assert [obj.name for obj in world.drawn().objects] == ["cup", "b"]
    assert world.aim(lies + np.array([0, 1, 0]), (0, -1, 0)).object == "cup"


def test_another_body_stands_where_the_old_one_stood():
    a = item("a")
    world = fallen(a)
    lies = place(world).copy()
    world.control("a", 0.3)
    edited(world, replace(a, static=True))
    assert list(place(world)) == list(lies) and not world.objects["a"].moves
    assert world.objects["a"].reaction_state.x == 0.3
    world.move_hand("right", at(*lies))
    assert world.grab("right") is None
    edited(world, replace(a, mass_kg=4.0))
    assert world.physics.mass(world.objects["a"].body) == 4.0 and list(place(world)) == list(lies)


def test_reactions_and_selectors_are_taken_over():
    a = item("a", position=(0, 0.05, 0))
    world = real(a)
    body = world.objects["a"].body
    part = Sphere(centre=(0, 0, 0), radius=0.1, x=1.0)
    edited(world, replace(a, reactions=(reaction("ray", "ice"),), selectors=(part,)))
    assert world.objects["a"].body == body and world.drawn().objects[0].selectors == (part,)
    world.ray((0, 1, 0), (0, -1, 0))
    assert world.step().events[0]["to"] == "ice" and world.drawn().objects[0].selectors == (part,)


def test_put_back_is_the_file_again():
    a = item("a", states=STATES, x=0.5, reactions=(reaction("collision", "fire"),))
    world = fallen(a, item("b", position=(1, 1, 0)))
    assert world.objects["a"].reaction_state.x == 1.0
    world.move_hand("right", at(*place(world, "b")))
    world.grab("right")
    reset_objects(world)
    assert world.held("right") is None and world.objects["a"].reaction_state.x == 0.5
    for name, x in (("a", 0.0), ("b", 1.0)):
        assert list(place(world, name)) == [x, 1, 0]
        assert not np.any(world.physics.velocity(world.objects[name].body))
    again = [world.step() for _ in range(60)]
    assert [row["to"] for record in again for row in record.events] == ["fire"]


def test_only_what_differs_has_changed():
    a = item("a", reactions=(reaction("grab", 0.5),))
    assert changed(a, a) == changed(a, replace(a)) == set()
    assert changed(item("a"), item("a")) == set()
    assert changed(a, replace(a, name="b", wxyz=(0.0, 1.0, 0.0, 0.0))) == {"name", "wxyz"}
