"""The figures of the physics, measured: what a step costs, how deep things go, how hands hold.

    python tools/scene/physics.py --out docs/bench/physics.csv

Costs are CPU ms of this process a step of 1/90 s, while objects fall in layers onto a table,
collide, roll and settle for 4 s: other load does not count in full.  Everything else is the worst
of all trials: tables are a slab of 20 mm and an open sheet of triangles; cups are 8 hulls, concave
as a whole, plates 2 mm thick.  Limits are those of
tests/scene/world/test_physics_figures.py.
"""

import argparse
import csv
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.scene.world.physics import Physics  # noqa: E402
from tests.support.scene.physics_things import PLATE, at, box, cup, lowest, run, table  # noqa: E402

FIELDS = ("figure", "case", "value", "unit", "limit", "holds")
COSTS = {5: 0.5, 20: 1.0, 100: 8.0}  # objects: ms, mean
KINDS = ("slab", "sheet")
MASSES = (0.05, 0.3, 5.0)  # kg
STEPS = 10_000  # of the run that two processes repeat
Row = tuple[str, str, float, str, float | None]  # without "holds"


def fill(physics: Physics, count: int, hulls: list[np.ndarray], mass: float = 0.3) -> list[int]:
    """Objects in layers of at most 25 above the table, a little off their places."""
    rng, side = np.random.default_rng(0), int(np.ceil(np.sqrt(min(count, 25))))
    bodies = []
    for i in range(count):
        layer, cell = divmod(i, side * side)
        x, z = ((cell % side, cell // side) - np.array([1, 1]) * (side - 1) / 2) * 0.16
        place = x + rng.normal() * 0.01, 0.1 + 0.17 * layer, z + rng.normal() * 0.01
        bodies.append(physics.add_body(hulls, at(*place), mass))
    return bodies


def steps_ms(physics: Physics, count: int, hulls: list[np.ndarray], seconds: int = 4) -> np.ndarray:
    """CPU ms of every step (n,) while they fall and settle."""
    fill(physics, count, hulls)
    spent = []
    for _ in range(seconds * 90):
        start = time.process_time()
        physics.step()
        spent.append((time.process_time() - start) * 1e3)
    return np.array(spent)


def costs() -> Iterator[Row]:
    for count, limit in COSTS.items():
        for kind in KINDS:
            physics, one = Physics(), Physics()
            table(physics, kind)
            table(one, kind)
            spent = steps_ms(physics, count, cup(8))
            case = f"{count} objects of 8 hulls, {kind}"
            yield "cost of a step, mean", case, spent.mean(), "ms CPU", limit
            yield "cost of a step, 95 of 100", case, np.percentile(spent, 95), "ms CPU", None
            ratio = spent.mean() / steps_ms(one, count, [box(0.06, 0.06, 0.06)]).mean()
            yield "cost over that of single boxes", case, ratio, "times", None


def held_costs() -> Iterator[Row]:
    for kind in KINDS:
        physics, spent = Physics(), []
        table(physics, kind)
        held = fill(physics, 20, cup(8))[0]
        start = physics.pose(held).position
        grab = physics.grab(held, at(*start), start)
        for i in range(270):
            way = 0.3 * np.sin(i / 14), 0.05 * np.cos(i / 9), 0.3 * np.sin(i / 20)
            physics.move_hand(grab, at(*(start + way)))
            begun = time.process_time()
            physics.step()
            spent.append((time.process_time() - begun) * 1e3)
        case = f"20 objects, a hand ploughs one through them, {kind}"
        yield "cost of a step, mean", case, float(np.mean(spent)), "ms CPU", None


def rest() -> Iterator[Row]:
    for kind in (*KINDS, "floor"):
        physics = Physics(floor_y=0 if kind == "floor" else None)
        if kind != "floor":
            table(physics, kind)
        bodies = fill(physics, 20, cup())
        run(physics, 6)
        deepest = max(-lowest(physics, body, cup()) for body in bodies)
        yield "resting penetration", f"20 cups, {kind}", deepest * 1e3, "mm", 1.0


def pushed_depth(kind: str, speed: float, mass: float, shape: str) -> float:
    """Metres that a hand gets a thing into a table."""
    physics, deepest, height = Physics(), 0.0, 0.3
    table(physics, kind)
    hulls = {"box": [box(0.06, 0.06, 0.06)], "plate": [box(*PLATE)], "cup": cup()}[shape]
    body = physics.add_body(hulls, at(0.013, height, 0.017), mass)
    grab = physics.grab(body, at(0.013, height, 0.017), (0.013, height, 0.017))
    for _ in range(90):
        height = max(-0.3, height - speed / 90)
        physics.move_hand(grab, at(0.013, height, 0.017))
        physics.step()
        deepest = max(deepest, -lowest(physics, body, hulls))
    return deepest


def turned_depth(kind: str, speed: float, trial: int) -> float:
    """The same while the hand turns about any axis, from any rotation."""
    rng = np.random.default_rng((int(speed), trial))
    physics, deepest, height = Physics(), 0.0, 0.3
    table(physics, kind)
    hulls = [box(*PLATE)] if trial % 3 == 0 else cup()
    turn, axis = rng.standard_normal(4), rng.standard_normal(3)
    pose = at(0.01, height, 0.02, turn / np.linalg.norm(turn))
    body = physics.add_body(hulls, pose, MASSES[trial // 3 % 3])
    grab = physics.grab(body, at(0, height, 0), (0, height, 0))
    for i in range(90):
        height, half = max(-0.3, height - speed / 90), i / 90
        wxyz = np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis))
        physics.move_hand(grab, at(0, height, 0, wxyz))
        physics.step()
        deepest = max(deepest, -lowest(physics, body, hulls))
    return deepest


def pushes() -> Iterator[Row]:
    shapes = ("box", "plate", "cup")
    for kind in KINDS:
        for speed, limit in ((1, 2.0), (5, 5.0)):
            deepest = max(pushed_depth(kind, speed, m, s) for m in MASSES for s in shapes)
            case = f"{speed} m/s into a {kind}, 0.05 to 5 kg, box, plate and cup"
            yield "pushed by a hand", case, deepest * 1e3, "mm", limit
            deepest = max(turned_depth(kind, speed, trial) for trial in range(27))
            case = f"{speed} m/s into a {kind} while it turns, 27 rotations"
            yield "pushed by a hand", case, deepest * 1e3, "mm", limit


def stacks() -> Iterator[Row]:
    for ratio in (10, 50, 100):
        physics, deepest = Physics(), 0.0
        table(physics, "slab")
        light = physics.add_body([box(0.05, 0.05, 0.05)], at(0, 0.051, 0), 0.05)
        heavy = physics.add_body([box(0.05, 0.05, 0.05)], at(0, 0.153, 0), 0.05 * ratio)
        for step in range(6 * 90):
            physics.step()
            low, high = (physics.pose(number).position[1] for number in (light, heavy))
            if step > 20:
                deepest = max(deepest, 0.05 - low, 0.1 - (high - low))
        yield "a heavy box on a light one", f"1 : {ratio}", deepest * 1e3, "mm", 2.0
    physics = Physics()
    for kg in (0.001, 0.05, 5.0, 500.0):
        physics.add_body(cup(), at(kg, 0, 0), kg)
    masses = [physics.mass(body) for body in physics.bodies()]
    yield "largest ratio of masses", "0.001 to 500 kg", max(masses) / min(masses), "times", 100.0
    yield "masses without a note", "0.001 and 500 kg", 2.0 - len(physics.findings), "of 2", 0.0


def plates() -> Iterator[Row]:
    for kind in KINDS:
        for speed in (3, 6, 10, 20, 40):
            rng, through = np.random.default_rng(speed), 0
            for trial in range(24):
                physics = Physics()
                table(physics, kind)
                turn = rng.standard_normal(4) if trial else np.array([1.0, 0, 0, 0])
                place = rng.uniform(-0.3, 0.3), 0.4, rng.uniform(-0.3, 0.3)
                pose = at(*place, turn / np.linalg.norm(turn))
                plate = physics.add_body([box(*PLATE)], pose, 0.2)
                physics.set_velocity(plate, (0, -speed, 0))
                for _ in range(45):
                    physics.step()
                    x, y, z = physics.pose(plate).position
                    if max(abs(x), abs(z)) > 0.9:  # it slid to the rim
                        break
                    if not y > -0.01:
                        through += 1
                        break
            yield "a 2 mm plate went through", f"{speed} m/s at a {kind}", through, "of 24", 0.0


def throws() -> Iterator[Row]:
    along = np.array([np.cos(0.5), np.sin(0.5), 0])
    for speed in (1.0, 4.0, 8.0):
        worst = 0.0
        for mass in MASSES:
            for seed in range(5):
                physics, noise = Physics(), np.random.default_rng(seed)
                body = physics.add_body(cup(), at(0, 1, 0), mass)
                grab, hand = physics.grab(body, at(0, 1, 0), (0, 1, 0)), np.array([0.0, 1, 0])
                for i in range(27):  # speeds up evenly over 0.3 s
                    hand = hand + along * speed * (i + 0.5) / 27 / 90
                    physics.move_hand(grab, at(*(hand + noise.normal(0, 0.0002, 3))))
                    physics.step()
                physics.release(grab)
                wrong = physics.velocity(body)[0] - along * speed
                worst = max(worst, float(np.linalg.norm(wrong)) / speed)
        case = f"a hand of {speed:g} m/s, tracked to 0.2 mm, 0.05 to 5 kg"
        yield "thrown velocity off the hand's", case, worst * 100, "%", 5.0


def lags() -> Iterator[Row]:
    for hands in (1, 2):
        worst = 0.0
        for mass in MASSES:
            physics = Physics()
            body = physics.add_body(cup(), at(0, 1, 0), mass)
            sides = [np.array([s, 1.0, 0]) for s in ((0.0,) if hands == 1 else (-0.06, 0.06))]
            grabs = [physics.grab(body, at(*side), side) for side in sides]
            for i in range(180):  # 0.3 m to and fro once a second
                moved = np.array([0.3 * np.sin(2 * np.pi * i / 90) * min(1, i / 45), 0, 0])
                for grab, side in zip(grabs, sides, strict=True):
                    physics.move_hand(grab, at(*(side + moved)))
                physics.step()
                away = physics.pose(body).position - moved - (0, 1, 0)
                worst = max(worst, float(np.linalg.norm(away)))
        case = f"0.3 m to and fro once a second, {hands} hand{'s' * (hands - 1)}, 0.05 to 5 kg"
        yield "held thing behind its hand", case, worst * 1e3, "mm", 5.0
    physics = Physics()
    body = physics.add_body(cup(), at(0, 1, 0), 0.3)
    physics.move_hand(physics.grab(body, at(0, 1, 0), (0, 1, 0)), None)
    run(physics, 0.3)
    stayed = physics.pose(body).position[1] - (1 - 9.81 * 0.3**2 / 2)
    yield "a lost hand lets go: off free fall", "0.3 s", abs(stayed) * 1e3, "mm", 20.0


def shown() -> Iterator[Row]:
    """How far a corner of what the engine holds is from where its pose shows it."""
    physics, farthest, seen = Physics(floor_y=0), 0.0, 0
    half = np.array([0.06, 0.05, 0.04])
    bodies = [
        physics.add_body([box(*half)], at(0.02 * i, 0.1 + 0.13 * i, 0), 0.3) for i in range(6)
    ]
    run(physics, 10)
    for body in bodies:
        shown = physics.pose(body).matrix()
        for corner in box(*half) * 1.5:  # from outside, the engine's nearest point is the corner
            outside = shown[:3, :3] @ corner + shown[:3, 3]
            found = physics.nearest(outside, 1.0)
            wanted = float(np.linalg.norm(corner / 3))
            if found and found[0] == body:  # not a neighbour that is nearer
                farthest, seen = max(farthest, abs(found[1] - wanted)), seen + 1
    yield (
        "shown pose off the body's after 10 s",
        f"{seen} corners of 6 boxes",
        farthest * 1e3,
        "mm",
        0.1,
    )


def busy(steps: int) -> str:
    """The hash after so many steps of a world that never rests: hands take, shake and throw."""
    physics = Physics(floor_y=-0.5)
    table(physics, "sheet")
    bodies = fill(physics, 12, cup())
    rng, grab = np.random.default_rng(7), None
    for step in range(steps):
        if step % 100 == 0:
            body = bodies[int(rng.integers(len(bodies)))]
            start = physics.pose(body).position
            physics.set_pose(body, at(*np.clip(start, -0.4, 0.4)))
            start = physics.pose(body).position
            grab = physics.grab(body, at(*start), start)
        assert grab is not None
        if step % 100 < 60:
            physics.move_hand(
                grab, at(*(start + 0.2 * np.sin(step * np.array([0.11, 0.07, 0.05]))))
            )
        if step % 100 == 60:
            physics.release(grab)
        physics.step()
    return physics.hash()


def repeats() -> Iterator[Row]:
    command = [sys.executable, str(Path(__file__)), "--hash", str(STEPS)]
    runs = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    hashes = {each.communicate()[0].strip() for each in runs}
    case = f"{STEPS} steps with hands, 2 processes"
    yield "different hashes of the same calls", case, len(hashes) - 1, "", 0.0
    one, two = Physics(), Physics()
    table(one, "sheet")
    held = fill(one, 20, cup())[0]
    grab = one.grab(held, at(0, 0.3, 0), one.pose(held).position)
    run(one, 0.5)
    start = time.process_time()
    kept = one.snapshot()
    taken = (time.process_time() - start) * 1e3
    start = time.process_time()
    two.restore(kept)
    back = (time.process_time() - start) * 1e3
    different = 0
    for step in range(600):
        for physics in (one, two):
            if step == 300:
                physics.release(grab)
            physics.step()
        different += one.hash() != two.hash()
    case = "20 cups, one of them held"
    yield "steps that differ after a restored snapshot", f"{case}, 600 steps", different, "", 0.0
    yield "taking a snapshot", case, taken, "ms CPU", None
    yield "restoring it", case, back, "ms CPU", None


FIGURES: tuple[Callable[[], Iterator[Row]], ...] = (
    costs, held_costs, rest, pushes, stacks, plates, throws, lags, shown, repeats,
)  # fmt: skip


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options.add_argument("--only", help="one of: " + ", ".join(part.__name__ for part in FIGURES))
    options.add_argument("--hash", type=int, metavar="STEPS", help="print the hash of a long run")
    chosen = options.parse_args()
    if chosen.hash:
        sys.stdout.write(busy(chosen.hash) + "\n")
        return 0
    rows = []
    for part in FIGURES:
        for figure, case, value, unit, limit in (
            part() if chosen.only in (None, part.__name__) else ()
        ):
            holds = "" if limit is None else "yes" if value <= limit else "NO"
            wanted = "" if limit is None else f"{limit:g}"
            rows.append((figure, case, f"{value:.3g}", unit, wanted, holds))
            sys.stdout.write("  ".join(rows[-1]) + "\n")
            sys.stdout.flush()
    if chosen.out:
        with chosen.out.open("w", newline="") as file:
            file.write(
                "# python tools/scene/physics.py --out docs/bench/physics.csv\n"
                f"# Rapier {version('rapier3d')}, 90 Hz, 4 substeps, one thread; "
                f"Python {platform.python_version()}, {platform.machine()}\n"
            )
            csv.writer(file, lineterminator="\n").writerows([FIELDS, *rows])
    return 0 if all(row[-1] != "NO" for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
