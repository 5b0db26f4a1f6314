"""The order of a step, with a physics of a few lines in place of the engine."""

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers, Stop
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.pose import Pose
from shapeshift.scene.selectors.selector import Sphere
from shapeshift.scene.world.reactions import Reaction, State, TwoAxes
from shapeshift.scene.world.read_script import Act
from shapeshift.scene.world.simulation import Simulation
from shapeshift.scene.world.world import World

UP = np.array([1.0, 0, 0, 0])
SOLID = SimpleNamespace(hulls=(), mesh="mesh")
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
    wxyz = np.tile(np.float32([1, 0, 0, 0]), (2, 1))
    arrays = (ones * 0, ones, wxyz, np.ones(2, np.float32), ones[:, None])
    return SplatLayers(*arrays, np.zeros(2, np.int32), (Stop("only", 0.0),))


def simulation(*items: SceneItem, acts: tuple = (), solid: bool = True, **file) -> Simulation:
    scene = SceneFile(folder=Path(), items=items, **file)
    names = [item.name for item in scene.all_items]
    colliders = dict.fromkeys(names, SOLID) if solid else {}
    return Simulation(World(scene, dict.fromkeys(names, model()), colliders, Points()), acts)


def item(name: str = "a", **changes) -> SceneItem:
    plain = {"states": STATES, "position": (0.0, 1.0, 0.0)}
    return SceneItem(name=name, model="m", **(plain | changes))


def act(t: float, do: str, **values) -> Act:
    return Act(line=1, t=t, do=do, **values)


def hand(t: float, *place: float, hand: str = "right") -> Act:
    return act(t, "hand", hand=hand, pose=Pose(np.array(place), UP))


def reaction(on: str, to, **changes) -> Reaction:
    return Reaction(on=on, to=to, **({"seconds": 0.0} | changes))


def play(run: Simulation, steps: int) -> list[dict]:
    return [record.row() for _ in range(steps) if (record := run.step()).is_news]


def test_what_falls_collides_once_and_changes_x():
    run = simulation(item(reactions=(reaction("collision", "ice", least_impulse_n_s=1.0),)))
    rows = play(run, 90)
    hit = [row for row in rows if "events" in row]
    assert len(hit) == 1 and abs(hit[0]["t"] - np.sqrt(2 / 9.81)) < 2 / 90
    assert hit[0]["events"] == [
        {"object": "a", "on": "collision", "reaction": 1, "from": "normal", "to": "ice", "x": 0.5}
    ]
    assert hit[0]["contacts"][0]["between"] == ["floor", "a"]
    assert hit[0]["x"] == {"a": 0.5} and hit[0]["poses"] == {"a": [0, 0, 0, 1, 0, 0, 0]}
    assert [row for row in rows if row["t"] > hit[0]["t"]] == []  # it lies: nothing is new
    assert run.world.drawn().objects[0].x == 0.5


def test_both_sides_of_a_contact_answer_in_the_order_of_ids():
    answer = (reaction("collision", "ice"),)
    run = simulation(item("a", reactions=answer), item("b", reactions=answer))
    row = next(row for row in play(run, 90) if "events" in row)
    assert [event["object"] for event in row["events"]] == ["a", "b"]
    assert [contact["between"] for contact in row["contacts"]] == [["floor", "a"], ["floor", "b"]]


def test_a_hand_grabs_carries_and_releases():
    acts = (
        hand(0.0, 0, 1, 0), act(0.0, "grab"), hand(0.5, 2, 1, 0), act(0.5, "release"),
        act(0.6, "release"),
    )  # fmt: skip
    run = simulation(item(reactions=(reaction("grab", "fire"),)), acts=acts)
    rows = play(run, 60)
    assert rows[0]["hands"] == [{"hand": "right", "did": "grab", "object": "a"}]
    assert rows[0]["x"] == {"a": 1.0}
    carried = {row["step"]: row["poses"]["a"][0] for row in rows if "poses" in row}
    for step in range(1, 46):  # at the end of a step it is where the hand is then
        assert carried[step] == pytest.approx(4 * step / 90, abs=1e-6)
    let_go = [row for row in rows if row.get("hands") and row["step"] > 1]
    assert [(row["step"], row["hands"]) for row in let_go] == [
        (46, [{"hand": "right", "did": "release", "object": "a"}])
    ]


def test_a_hand_that_is_far_or_lost_holds_nothing():
    acts = (
        hand(0.0, 0, 1.2, 0), act(0.0, "grab", reach_m=0.1), act(0.1, "grab", reach_m=0.5),
        act(0.2, "lose"),
    )  # fmt: skip
    run = simulation(item(), acts=acts)
    deeds = [deed for row in play(run, 30) for deed in row.get("hands", [])]
    assert deeds == [
        {"hand": "right", "did": "miss"}, {"hand": "right", "did": "grab", "object": "a"},
        {"hand": "right", "did": "lose", "object": "a"},
    ]  # fmt: skip
    assert not run.world.holds and not run.world.physics.hold


def test_a_second_grab_lets_go_of_the_first():
    acts = (hand(0.0, 0, 1, 0), act(0.0, "grab"), act(0.1, "grab"))
    run = simulation(item(), acts=acts)
    deeds = [deed["did"] for row in play(run, 20) for deed in row.get("hands", [])]
    assert deeds == ["grab", "release", "grab"]


def test_a_ray_hits_and_misses():
    shot = act(0.1, "ray", origin=(0, 1, 3), direction=(0, 0, -2))
    run = simulation(item(reactions=(reaction("ray", "fire"),)), acts=(shot,))
    row = next(row for row in play(run, 20) if "rays" in row)
    assert row["rays"][0]["object"] == "a" and row["rays"][0]["distance_m"] > 2.9
    assert run.world.physics.told == [("ray", (0, 0, -1))]
    assert row["step"] == 10 and row["x"] == {"a": 1.0}  # 0.1 s is the begin of step 10
    run = simulation(item(reactions=(reaction("ray", "fire"),), collider=None), acts=(shot,),
                       solid=False)  # fmt: skip
    row = next(row for row in play(run, 20) if "rays" in row)
    assert row["rays"] == [{"origin": [0, 1, 3], "object": None}]


def test_a_region_that_is_fallen_into():
    region = Sphere(centre=(0, 0, 0), radius=0.5, x=0, space="world")
    run = simulation(item(reactions=(reaction("enter", "ice", region=region),)))
    event = next(row for row in play(run, 60) if "events" in row)
    assert event["poses"]["a"][1] == pytest.approx(0.5, abs=0.05)


def test_controls_by_x_and_by_two_axes():
    acts = (
        act(0.0, "control", item="a", x=0.3),
        act(0.1, "control", item="a", balance=-0.5, power=1.0),
    )
    run = simulation(item(two_axes=TwoAxes()), acts=acts)
    xs = [row["x"]["a"] for row in play(run, 20) if "x" in row]
    assert xs == [0.3, 0.25]


def test_what_has_no_collider_stays_and_what_is_static_stays():
    table = SceneItem(name="background", model="m", static=True, friction=0.3)
    run = simulation(item("b", static=True), background=table)
    rows = play(run, 30)
    assert len(rows) == 1 and set(rows[0]["poses"]) == {"background", "b"}
    assert [shape for shape, *_ in run.world.physics.told] == ["mesh", ()]
    assert len(play(simulation(item(), solid=False), 30)) == 1


def test_the_same_script_gives_the_same_rows():
    acts = (hand(0.0, 0, 1, 0), act(0.1, "grab"), hand(0.5, 1, 2, 3), act(0.5, "release"))
    runs = [
        json.dumps(
            play(simulation(item(reactions=(reaction("collision", "next"),)), acts=acts), 99)
        )
        for _ in range(2)
    ]
    assert runs[0] == runs[1]


def test_what_the_physics_says_names_its_object():
    run = simulation(item(), item("b", mass_kg=9.0), item("c"))
    assert [(f.file, f.what) for f in run.world.findings] == [("object 'b'", "the mass 9 kg")]
    with pytest.raises(BadFile, match="object 'b': hull 0 is flat"):
        simulation(item(), item("b", mass_kg=900.0))
