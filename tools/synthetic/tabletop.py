"""The example of docs/scene.md: three things on a table that answer to touch, as plain splats.

    python3 -m tools.synthetic.tabletop examples

writes touch.scene.json, touch.jsonl and the folder touch/ anew, the same each time.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from shapeshift.scene.colliders.collider import Making, collider_of_model
from shapeshift.scene.colliders.collider_pieces import write_collider
from shapeshift.scene.document.scene_file import FirstView, SceneFile, SceneItem
from shapeshift.scene.document.write_scene_file import write_scene_file
from shapeshift.scene.selectors.selector import Box
from shapeshift.scene.world.reactions import Reaction, State, TwoAxes

Paint = Callable[[np.ndarray, np.ndarray], np.ndarray]  # places (N, 3), noise (N,) -> sRGB (N, 3)
SH0 = 0.28209479177387814  # colour = 0.5 + SH0 * coefficient
CUBE, BALL, RING = 0.1, 0.06, (0.06, 0.022)  # metres: side; radius; radii of a torus
TABLE = (0.9, 0.04, 0.6)  # metres; its top is at y = 0
PEDESTAL = (0.16, 0.01, 0.16)  # metres


def wall(half: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places on a box with half sides (3,) and the outward normals, (N, 3) each."""
    area = np.array([half[1] * half[2], half[0] * half[2], half[0] * half[1]])
    axis = rng.choice(3, count, p=area / area.sum())
    side = rng.choice([-1.0, 1.0], count)
    places = rng.uniform(-1, 1, (count, 3)) * half
    normals = np.zeros((count, 3))
    rows = np.arange(count)
    places[rows, axis], normals[rows, axis] = side * half[axis], side
    return places, normals


def ball(radius: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The same of a ball, evenly on a spiral."""
    i = np.arange(count) + 0.5
    turn, y = i * math.pi * (3 - 5**0.5), 1 - 2 * i / count
    level = np.sqrt(1 - y * y)
    normals = np.stack([np.cos(turn) * level, y, np.sin(turn) * level], axis=1)
    return normals * radius, normals


def torus(
    radius: float, thick: float, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The same of a torus about +Y."""
    around, across = rng.uniform(0, 2 * math.pi, (2, 2 * count))
    outer = rng.uniform(0, radius + thick, 2 * count) < radius + thick * np.cos(across)
    around, across = around[outer][:count], across[outer][:count]
    level = np.stack([np.cos(around), 0 * around, np.sin(around)], axis=1)
    up = np.array([0.0, 1.0, 0.0])
    normals = level * np.cos(across)[:, None] + up * np.sin(across)[:, None]
    return level * radius + normals * thick, normals


def flat_on(normals: np.ndarray) -> np.ndarray:
    """(N, 4) wxyz that turn +Z onto each normal."""
    turn = np.stack(
        [1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=1
    )
    turn[normals[:, 2] < -1 + 1e-9] = (0.0, 1.0, 0.0, 0.0)
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)


def splats(
    surface: tuple[np.ndarray, np.ndarray], area: float, paint: Paint, seed: int,
    puff: float = 0.0, opacity: float = 0.95,
) -> PlainSplats:  # fmt: skip
    """Flat splats that close a surface of `area` m2; `puff` metres throws them out of it."""
    places, normals = surface
    rng = np.random.default_rng(seed)
    noise = rng.uniform(size=len(places))
    size = 0.75 * math.sqrt(area / len(places))
    scales = np.tile([size, size, 0.15 * size], (len(places), 1))
    out = puff * rng.uniform(size=(len(places), 1)) ** 2
    lit = 0.75 + 0.25 * np.clip(normals @ (0.35, 0.85, 0.4), 0, 1)  # painted, not shone on
    color = np.clip(paint(places, noise) * lit[:, None], 0, 1)
    arrays = (places + normals * out, scales, flat_on(normals), np.full(len(places), opacity))
    sh = ((color - 0.5) / SH0)[:, None]
    means, sizes, wxyz, alphas, harmonics = (a.astype(np.float32) for a in (*arrays, sh))
    return PlainSplats(means, sizes, wxyz, alphas, harmonics)


def mix(a: tuple, b: tuple, part: np.ndarray) -> np.ndarray:
    return np.array(a) + (np.array(b) - np.array(a)) * part[:, None]


def wood(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    grain = 0.5 + 0.5 * np.sin(90 * p[:, 2] + 6 * np.sin(7 * p[:, 0]))
    return mix((0.42, 0.27, 0.15), (0.6, 0.42, 0.25), 0.7 * grain + 0.3 * noise)


def crate(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    rim = (np.sort(np.abs(p), axis=1)[:, 1] > 0.4 * CUBE).astype(float)
    return mix((0.8, 0.6, 0.35), (0.55, 0.35, 0.18), np.clip(rim + 0.3 * noise, 0, 1))


def ice(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.55, 0.8, 0.95), (0.95, 0.99, 1.0), noise**2)


def fire(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((1.0, 0.25, 0.02), (1.0, 0.9, 0.2), np.clip(0.5 + 5 * p[:, 1] + 0.5 * noise, 0, 1))


def charcoal(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.05, 0.05, 0.06), (0.2, 0.18, 0.17), noise**3)


def striped(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.9, 0.9, 0.88), (0.15, 0.35, 0.8), (np.sin(60 * p[:, 1]) > 0).astype(float))


def confetti(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    palette = np.array([(1, 0.2, 0.3), (1, 0.85, 0.1), (0.2, 0.8, 0.4), (0.3, 0.5, 1)])
    return palette[(noise * 4).astype(int) % 4]


def cold(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.15, 0.25, 0.75), (0.3, 0.6, 1.0), noise)


def brass(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.7, 0.55, 0.2), (0.9, 0.78, 0.4), noise)


def stone(p: np.ndarray, noise: np.ndarray) -> np.ndarray:
    return mix((0.45, 0.45, 0.48), (0.6, 0.6, 0.63), noise)


def write_models(folder: Path) -> None:
    """Layers a stop, all as spz."""
    rng = np.random.default_rng(5)
    side = np.full(3, CUBE / 2)
    cube, cube_area = wall(side, 1800, rng), 6 * CUBE**2
    looks = {"normal": crate, "ice": ice, "fire": fire, "charcoal": charcoal, "again": crate}
    for i, (name, paint) in enumerate(looks.items()):
        puff = 0.02 if name == "fire" else 0.0
        save(splats(cube, cube_area, paint, 1, puff), folder / "cube" / f"{i}_{name}.spz")
    globe, globe_area = ball(BALL, 1500), 4 * math.pi * BALL**2
    save(splats(globe, globe_area, striped, 2), folder / "ball" / "0_ball.spz")
    save(splats(globe, globe_area, confetti, 2, 0.12), folder / "ball" / "1_confetti.spz")
    hoop, hoop_area = torus(*RING, 1500, rng), 4 * math.pi**2 * RING[0] * RING[1]
    for i, (name, paint) in enumerate({"cold": cold, "brass": brass, "hot": fire}.items()):
        save(splats(hoop, hoop_area, paint, 3), folder / "ring" / f"{i}_{name}.spz")
    half = np.array(TABLE) / 2
    top = wall(half, 14000, rng)
    table = splats(top, 2 * (TABLE[0] * TABLE[2]), wood, 4)
    save(moved(table, -half[1]), folder / "table.spz")
    plate = np.array(PEDESTAL) / 2
    save(splats(wall(plate, 1500, rng), 2 * PEDESTAL[0] * PEDESTAL[2], stone, 6),
         folder / "plate.spz")  # fmt: skip
    write_box(half, -half[1], folder / "table.obj")
    write_box(side, 0.0, folder / "cube.obj")
    write_box(plate, 0.0, folder / "plate.obj")


def moved(part: PlainSplats, y: float) -> PlainSplats:
    part.means[:, 1] += np.float32(y)
    return part


def save(part: PlainSplats, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_spz(part, path, axes="rub")  # whose up is +Y, as the scene file says


def write_box(half: np.ndarray, y: float, path: Path) -> None:
    """A closed box of 12 faces about (0, y, 0) as .obj, anticlockwise seen from outside."""
    corners = [(x, h, z) for x in (-1, 1) for h in (-1, 1) for z in (-1, 1)]
    quads = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    lines = ["v {:.6g} {:.6g} {:.6g}".format(*(np.array(c) * half + (0, y, 0))) for c in corners]
    for a, b, c, d in quads:
        lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    write_whole(path, ("\n".join(lines) + "\n").encode())


def scene(folder: Path) -> SceneFile:
    """The three objects, what they answer to, and where they stand."""
    states = tuple(
        State(name, i / 4) for i, name in enumerate(("normal", "ice", "fire", "charcoal"))
    )
    above_plate = Box(centre=(0.28, 0.1, 0.1), half=(0.09, 0.12, 0.09), x=0, space="world")
    cube = SceneItem(
        name="cube", model="touch/cube", mode="exclusive", up="+Y", collider="touch/cube.obj",
        position=(-0.22, CUBE / 2 + 0.001, 0.05), mass_kg=0.4, restitution=0.1, states=states,
        ring=True, reactions=(
            Reaction(on="collision", to="next", least_impulse_n_s=0.25, seconds=0.4,
                     cooldown_s=0.4),
        ),
    )  # fmt: skip
    globe = SceneItem(
        name="ball", model="touch/ball", mode="exclusive", up="+Y",
        collider="touch/ball.glb", position=(0.0, BALL + 0.001, -0.12), mass_kg=0.2,
        restitution=0.4, reactions=(
            Reaction(on="ray", to="confetti", after=("ball",), seconds=0.3, ease="slow end"),
            Reaction(on="ray", to="ball", after=("confetti",), seconds=1.0),
        ),
    )  # fmt: skip
    hoop = SceneItem(
        name="ring", model="touch/ring", mode="exclusive", up="+Y", x=0.5,
        collider="touch/ring.glb", position=(0.05, RING[1] + 0.001, 0.14), mass_kg=0.3,
        states=(State("cold", 0.0), State("brass", 0.5), State("hot", 1.0)), reactions=(
            Reaction(on="grab", to="hot", seconds=0.8),
            Reaction(on="enter", to="cold", region=above_plate, seconds=0.8),
        ),
        two_axes=TwoAxes(below=0.0, rest=0.5, above=1.0),
    )  # fmt: skip
    plate = SceneItem(
        name="plate", model="touch/plate.spz", up="+Y", collider="touch/plate.obj", static=True,
        position=(0.28, PEDESTAL[1] / 2, 0.1),
    )  # fmt: skip
    table = SceneItem(name="background", model="touch/table.spz", up="+Y", static=True,
                      collider="touch/table.obj")  # fmt: skip
    return SceneFile(
        folder=folder, items=(cube, globe, hoop, plate), background=table, floor_y=-0.7,
        view=FirstView((0.05, 0.5, 0.95), (0.02, 0.04, 0.0), 0.75),
    )  # fmt: skip


SCRIPT = """\
# Takes the ring to the plate, shoots the ball twice, throws the cube at it: ice, then fire.
{"t": 0.0, "do": "hand", "position": [0.11, 0.12, 0.14]}
{"t": 0.5, "do": "hand", "position": [0.11, 0.03, 0.14]}
{"t": 0.6, "do": "grab"}
{"t": 0.7, "do": "hand", "position": [0.11, 0.03, 0.14]}
{"t": 1.1, "do": "hand", "position": [0.15, 0.18, 0.14]}
{"t": 1.7, "do": "hand", "position": [0.34, 0.16, 0.10]}
{"t": 2.0, "do": "hand", "position": [0.34, 0.07, 0.10]}
{"t": 2.2, "do": "release"}
{"t": 2.3, "do": "hand", "position": [0.34, 0.30, 0.10]}
{"t": 2.4, "do": "ray", "origin": [0.0, 0.4, 0.9], "direction": [0.0, -0.34, -1.0]}
{"t": 2.6, "do": "hand", "hand": "left", "position": [-0.22, 0.09, 0.05]}
{"t": 2.7, "do": "grab", "hand": "left"}
{"t": 2.8, "do": "hand", "hand": "left", "position": [-0.22, 0.09, 0.05]}
{"t": 3.2, "do": "hand", "hand": "left", "position": [-0.26, 0.30, -0.02]}
{"t": 3.3, "do": "ray", "origin": [0.0, 0.4, 0.9], "direction": [0.0, -0.34, -1.0]}
{"t": 3.4, "do": "hand", "hand": "left", "position": [-0.26, 0.30, -0.02]}
{"t": 3.75, "do": "hand", "hand": "left", "position": [-0.05, 0.30, -0.09]}
{"t": 3.75, "do": "release", "hand": "left"}
{"t": 5.0, "do": "control", "object": "ring", "balance": 0.6, "power": 1.0}
"""


def write_colliders(folder: Path) -> None:
    """The two that are no boxes, which take most of a minute, as `launch.py colliders` makes them.

    What they are made of is looked at as it is in the scene at first.
    """
    for item in scene(folder).items:
        path = folder / str(item.collider)
        if path.suffix == ".glb":
            model = read_model(folder / item.model, Reading(mode=item.mode, up=item.up))
            x = item.x if isinstance(item.x, float | int) else 0.0
            made = collider_of_model(model, x, Making(kept=False))
            write_collider(made.parts, made.mesh, path)


def write_example(folder: Path) -> None:
    """All of it but the colliders into a folder."""
    write_models(folder / "touch")
    write_scene_file(scene(folder), folder / "touch.scene.json")
    write_whole(folder / "touch.jsonl", SCRIPT.encode())


if __name__ == "__main__":
    here = Path(sys.argv[1] if len(sys.argv) > 1 else "assets")
    write_example(here)
    write_colliders(here)
