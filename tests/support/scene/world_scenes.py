"""Worlds of a few bodies for the tests of steps, hands, reactions and following."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Finding, SplatLayers, Stop
from shapeshift.scene.colliders.collider import Collider, box_around
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.pose import Pose
from shapeshift.scene.world.reactions import Reaction, State
from shapeshift.scene.world.world import World
from tests.support.scene.physics_things import box

UP = np.array([1.0, 0, 0, 0])
STATES = (State("normal", 0.0), State("ice", 0.5), State("fire", 1.0))


@dataclass
class Touch:
    a: int
    b: int
    impulse_n_s: float
    point: np.ndarray


class Points:
    """Bodies are points that fall onto y = 0, and follow hands exactly."""

    def __init__(self, hz: int = 90) -> None:
        self.hz, self.place, self.speed, self.hold, self.still = hz, {}, {}, {}, set()
        self.told: list[tuple] = []
        self.findings: list[Finding] = []

    def add_static(self, shape, pose, friction, restitution) -> int:
        self.told.append((shape, friction, restitution))
        self.still.add(len(self.place) + 1)
        return self.add_body((), pose, 0, friction, restitution)

    def add_body(self, hulls, pose, mass_kg, friction, restitution) -> int:
        if mass_kg > 100:
            raise ValueError("hull 0 is flat.")
        if mass_kg > 5:
            self.findings.append(Finding(f"the mass {mass_kg:g} kg", 1, "taken as 5 kg"))
        number = len(self.place) + 1
        self.place[number], self.speed[number] = pose.position.copy(), 0.0
        return number

    def step(self) -> list[Touch]:
        contacts = []
        for number, place in self.place.items():
            if number in self.still or number in [h[0] for h in self.hold.values()]:
                continue
            self.speed[number] += 9.81 / self.hz
            place[1] -= self.speed[number] / self.hz
            if place[1] <= 0:
                contacts.append(Touch(0, number, self.speed[number], place.copy()))
                place[1], self.speed[number] = 0.0, 0.0
        return contacts[::-1]

    def pose(self, number: int) -> Pose:
        return Pose(self.place[number].copy(), UP)

    def nearest(self, point, within):
        near = [
            (np.linalg.norm(p - point), n) for n, p in self.place.items() if n not in self.still
        ]
        distance, number = min(near, default=(np.inf, 0))
        return (number, distance) if distance <= within else None

    def grab(self, number: int, pose, point) -> int:
        self.hold[len(self.hold) + 1] = (number, pose)
        return len(self.hold)

    def held(self, grab: int) -> int:
        return self.hold[grab][0]

    def move_hand(self, grab: int, pose) -> None:
        if pose is None:
            self.release(grab)
        else:
            self.place[self.hold[grab][0]] = pose.position.copy()

    def release(self, grab: int) -> None:
        del self.hold[grab]

    def cast_ray(self, origin, direction):
        self.told.append(("ray", tuple(direction)))
        near = [(float(np.linalg.norm(p - origin)), n) for n, p in self.place.items()]
        return min(near)[::-1] if near else None


def model() -> SplatLayers:
    ones = np.ones((2, 3), np.float32)
    wxyz = np.tile(np.array([1, 0, 0, 0], np.float32), (2, 1))
    arrays = (ones * 0, ones, wxyz, np.ones(2, np.float32), ones[:, None])
    return SplatLayers(*arrays, np.zeros(2, np.int32), (Stop("only", 0.0),))


def item(name: str = "a", **changes) -> SceneItem:
    plain = {"states": STATES, "position": (0.0, 1.0, 0.0)}
    return SceneItem(name=name, model="m", **(plain | changes))


def reaction(on: str, to, **changes) -> Reaction:
    return Reaction(on=on, to=to, **({"seconds": 0.0} | changes))


HALF = 0.05
BOX = Collider((box(HALF, HALF, HALF),), box_around(box(HALF, HALF, HALF)))


def at(*place: float, wxyz=UP) -> Pose:
    return Pose(np.array(place, float), np.array(wxyz, float))


def real(*items, floor_y: float | None = 0.0, **file) -> World:
    """A world of boxes 10 cm wide with the engine in it."""
    scene = SceneFile(folder=Path(), items=items, floor_y=floor_y, **file)
    names = [obj.name for obj in scene.all_items]
    return World(scene, dict.fromkeys(names, model()), dict.fromkeys(names, BOX))


def place(world: World, name: str = "a") -> np.ndarray:
    return world.objects[name].pose.position
