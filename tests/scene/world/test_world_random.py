"""A world in any order of calls: nothing raises, names and bodies belong together, numbers stay."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.scene.document.scene_file import SceneFile
from shapeshift.scene.world.follow import follow, reset_objects
from shapeshift.scene.world.world import World
from tests.support.scene.world_scenes import BOX, STATES, at, item, model, reaction, real

pytest.importorskip("rapier3d")
HANDS = ("left", "right", "mouse")


class Random:
    """Does something to a world, again and again."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        answers = (reaction("collision", "next", seconds=0.3), reaction("ray", 0.7))
        self.items = {
            name: item(name, position=(0.3 * n, 0.5, 0.0), states=STATES, reactions=answers)
            for n, name in enumerate("abc")
        } | {"post": item("post", static=True, position=(0.0, 0.0, 1.0))}
        self.world = real(*self.items.values())
        self.saved = [(self.world.snapshot(), dict(self.items))]
        self.deeds = [getattr(self, name) for name in dir(self) if name.startswith("do_")]

    def go(self) -> None:
        self.rng.choice(self.deeds)()

    def pick(self, names) -> str:
        return str(self.rng.choice(list(names)))

    def somewhere(self) -> np.ndarray:
        return self.rng.uniform((-0.5, 0, -0.5), (1, 1, 1))

    def do_move(self) -> None:
        self.world.move_hand(self.pick(HANDS), at(*self.somewhere()))

    def do_lose(self) -> None:
        self.world.move_hand(self.pick(HANDS), None)

    def do_grab(self) -> None:
        self.world.grab(self.pick(HANDS), 1.0)

    def do_take(self) -> None:
        self.world.grab_body(self.pick(HANDS), self.pick([*self.items, "nobody"]), np.zeros(3))

    def do_release(self) -> None:
        self.world.release(self.pick(HANDS))

    def do_carry(self) -> None:
        turn = self.rng.normal(size=4)
        self.world.carry(self.pick(HANDS), at(0.1, 0, 0, wxyz=turn / np.linalg.norm(turn)).matrix())

    def do_ray(self) -> None:
        self.world.ray(self.somewhere(), self.rng.normal(size=3))

    def do_time(self) -> None:
        self.world.paused = bool(self.rng.random() < 0.2)
        for _ in range(4):
            self.world.advance(float(self.rng.choice([0.0, 0.003, 0.02, 0.3])))
            self.world.drawn()

    do_more_time = do_time

    def do_step(self) -> None:
        self.world.step()

    def do_place(self) -> None:
        self.world.move_object(self.pick(self.items), at(*self.somewhere()))

    def do_control(self) -> None:
        self.world.control(self.pick(self.items), self.rng.random())

    def do_back(self) -> None:
        reset_objects(self.world)

    def do_edit(self) -> None:
        name, items = self.pick(self.items), dict(self.items)
        changed = [
            {"position": tuple(self.somewhere())}, {"x": 0.5}, {"visible": False}, {"static": True},
            {"mass_kg": 2.0}, {"name": f"{name}'"}, {"reactions": ()},
        ]  # fmt: skip
        new = replace(items.pop(name), **changed[self.rng.integers(len(changed))])
        items[new.name] = new
        if self.rng.random() < 0.3 and len(items) > 2:
            items.pop(self.pick(items))
        if self.rng.random() < 0.3:
            fresh = f"n{self.rng.integers(100)}"
            items[fresh] = item(fresh, position=tuple(self.somewhere()))
        self.follow(items)

    def follow(self, items: dict) -> None:
        self.items = items
        file = SceneFile(folder=Path(), items=tuple(items.values()), floor_y=0.0)
        follow(self.world, file, dict.fromkeys(items, model()), dict.fromkeys(items, BOX))

    def do_save(self) -> None:
        self.saved.append((self.world.snapshot(), dict(self.items)))

    def do_restore(self) -> None:
        saved, items = self.saved[self.rng.integers(len(self.saved))]
        self.world.restore(saved)
        self.items = dict(items)


def check(world: World, items: dict) -> None:
    assert list(world.objects) == list(items)
    assert world.names == {t.body: name for name, t in world.objects.items()}
    assert set(world.physics.ids()) - {0} == set(world.names)
    for hand in HANDS:
        held = world.held(hand)
        assert (held is None) == (hand not in world.holds)
        assert held is None or (world.objects[held].moves and hand in world.hands)
    for obj in world.objects.values():
        assert np.isfinite(obj.pose.position).all() and 0 <= obj.reaction_state.x <= 1
    drawn = world.drawn()
    assert [obj.name for obj in drawn.objects] == list(items)
    assert world.drawn() is drawn


@pytest.mark.parametrize("seed", range(8))
def test_any_order_of_calls_leaves_a_world_whole(seed):
    somebody = Random(seed)
    for _ in range(150):
        somebody.go()
        check(somebody.world, somebody.items)
