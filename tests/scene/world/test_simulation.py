"""The order of a step, with a physics of a few lines in place of the engine."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.pose import Pose
from shapeshift.scene.selectors.selector import Sphere
from shapeshift.scene.world.reactions import TwoAxes
from shapeshift.scene.world.read_script import Act
from shapeshift.scene.world.simulation import Simulation
from shapeshift.scene.world.world import World
from tests.support.scene.world_scenes import UP, Points, item, model, reaction

SOLID = SimpleNamespace(parts=(), mesh="mesh")


def simulation(*items: SceneItem, acts: tuple = (), solid: bool = True, **file) -> Simulation:
    scene = SceneFile(folder=Path(), items=items, **file)
    names = [item.name for item in scene.all_items]
    colliders = dict.fromkeys(names, SOLID) if solid else {}
    return Simulation(World(scene, dict.fromkeys(names, model()), colliders, Points()), acts)


def act(t: float, do: str, **values) -> Act:
    return Act(line=1, t=t, do=do, **values)


def hand(t: float, *place: float, hand: str = "right") -> Act:
    return act(t, "hand", hand=hand, pose=Pose(np.array(place), UP))


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
