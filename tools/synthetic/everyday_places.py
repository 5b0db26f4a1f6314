"""The four places of everyday.py: things on a table, what is around them, and who walks by."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.training.synthetic.placing import (
    ALONG,
    ball,
    bar,
    box,
    disc,
    frame,
    inside,
    mix,
    noise,
    ring,
    turned,
)
from shapeshift.training.synthetic.solids import Ring, unit
from shapeshift.training.synthetic.tracer import Light, Material, Pattern, Solid
from tools.synthetic.strangers import GOLDEN, paint, view_at, walls

Things = dict[str, list[Solid]]  # in the order of their labels, from 1
LIGHT = Light(key=(0.5, 0.5, 0.48), sky=(0.5, 0.5, 0.52), ground=(0.3, 0.3, 0.3),
              in_shadow=0.4)  # fmt: skip
WOOD = (0.55, 0.38, 0.24), (0.68, 0.5, 0.33)


@dataclass(frozen=True)
class Kind:
    """What is photographed, from where, and in which words the poses are written."""

    things: Callable[[], Things]
    around: Callable[[np.random.Generator], list[Solid]]
    views: Callable[[int, tuple[int, int]], list[View]]
    count: int
    unit_m: float  # metres a unit of the file's world
    world: (
        str  # "colmap": its text tables, in the first camera's frame; "+Z", "+Y": transforms.json
    )
    tilt_degrees: float = 0.0  # of that axis from what is up
    sky: tuple[float, float, float] | None = None  # where nothing is; else a wall that stands still


def grain(low: tuple, high: tuple, cells_per_m: float, along: float = 1.0) -> Pattern:
    """Two colours in streaks, `along` times as long in x: wood, skin, stone."""

    def pattern(p: np.ndarray) -> np.ndarray:
        q = p * (1 / along, 1, 1) + 7.3
        return mix(low, high, noise(q, cells_per_m) + 0.5 * (noise(q, 6 * cells_per_m) - 0.5))

    return pattern


def band(outer: tuple, stripe: tuple, low: float, high: float) -> Pattern:
    """A colour, another between two local heights."""

    def pattern(p: np.ndarray) -> np.ndarray:
        within = (p[:, 1] > low) & (p[:, 1] < high)
        return mix(outer, stripe, within + 0.15 * noise(p, 60))

    return pattern


def plain(rng: np.random.Generator, cells_per_m: float) -> Material:
    """A surface of the quiet colours that rooms have."""
    color = rng.uniform(0.3, 0.75) + 0.07 * rng.uniform(-1, 1, 3)
    return Material(grain(tuple(0.85 * color), tuple(1.15 * color), cells_per_m))


def wood() -> Material:
    return Material(grain(*WOOD, 30, 6))


def put(x: float, y: float, z: float, degrees: float, solids: list[Solid]) -> list[Solid]:
    """Solids made around the origin, standing on y = 0, put at a place and turned about +Y."""
    return inside(frame((x, y, z), turned("y", degrees)), solids)


def apple() -> list[Solid]:
    """0.074 m wide; its lowest 4 mm are below the table: it stands on a flat foot as apples do."""
    skin = Material(grain((0.75, 0.1, 0.08), (0.75, 0.6, 0.2), 25), gloss=0.15)
    stalk = bar((0, 0.066, 0), (0.004, 0.082, 0), 0.0022, Material((0.3, 0.2, 0.1)))
    return [ball((0, 0.033, 0), 0.037, skin), stalk]


def banana() -> list[Solid]:
    """An arc of 85 mm about the origin on its side: an apple at (0.0335, 0, 0) touches it."""
    skin = Material(grain((0.9, 0.74, 0.16), (0.72, 0.55, 0.12), 40))
    tip = Material((0.28, 0.2, 0.08))
    out = [Solid(Ring(0.085, 0.017, np.deg2rad(55)), skin, frame((0, 0.017, 0)))]
    for side in (-1, 1):
        turn = side * np.deg2rad(66)
        out.append(ball((0.085 * np.cos(turn), 0.017, 0.085 * np.sin(turn)), 0.007, tip))
    return out


def mug(outer: tuple = (0.85, 0.86, 0.84), stripe: tuple = (0.1, 0.3, 0.6)) -> list[Solid]:
    """95 mm high, open, with a handle at +x that encloses what lies behind it."""
    glaze = Material(band(outer, stripe, -0.02, 0.015), gloss=0.2)
    plain = Material(outer)
    handle = Solid(Ring(0.026, 0.006, np.deg2rad(92)), glaze, frame((0.041, 0.048, 0), ALONG["z"]))
    return [
        bar((0, 0, 0), (0, 0.093, 0), 0.041, glaze, capped=False),
        bar((0, 0.004, 0), (0, 0.093, 0), 0.036, plain, capped=False),
        disc((0, 0.006, 0), "y", 0.037, plain),
        ring((0, 0.093, 0), "y", 0.0385, 0.0028, plain),
        handle,
    ]


def block(half: tuple, color: Pattern | tuple) -> list[Solid]:
    """A box with half sides in metres, standing on y = 0."""
    return [box((0, half[1], 0), half, Material(color))]


def book() -> list[Solid]:
    cover = Material(grain((0.12, 0.35, 0.3), (0.2, 0.5, 0.42), 20))
    return [
        box((0, 0.014, 0), (0.095, 0.011, 0.066), Material((0.88, 0.86, 0.78))),
        box((0, 0.0015, 0), (0.1, 0.0015, 0.07), cover),
        box((0, 0.0265, 0), (0.1, 0.0015, 0.07), cover),
    ]


def bottle() -> list[Solid]:
    glass = Material(grain((0.1, 0.3, 0.12), (0.15, 0.42, 0.18), 15), gloss=0.4)
    label = Material(band((0.9, 0.86, 0.7), (0.6, 0.1, 0.1), -0.01, 0.012))
    return [
        bar((0, 0, 0), (0, 0.16, 0), 0.036, glass),
        bar((0, 0.05, 0), (0, 0.12, 0), 0.0365, label, capped=False),
        bar((0, 0.16, 0), (0, 0.2, 0), 0.036, glass, top_radius=0.014),
        bar((0, 0.2, 0), (0, 0.25, 0), 0.014, glass),
    ]


def pencil() -> list[Solid]:
    return [bar((-0.085, 0.0045, 0), (0.085, 0.0045, 0), 0.0045, Material((0.85, 0.5, 0.1)))]


BRICK = grain((0.62, 0.24, 0.16), (0.75, 0.36, 0.25), 50)
ORANGE = grain((0.9, 0.5, 0.1), (0.95, 0.62, 0.25), 50)


def on_a_turntable() -> Things:
    return {
        "banana": put(-0.05, 0, 0.02, 20, banana()),
        "apple": put(-0.05 + 0.0335 * np.cos(0.349), 0, 0.02 - 0.0335 * np.sin(0.349), 20, apple()),
        "mug": put(0.1, 0, -0.06, 35, mug()),
        "crate": put(-0.02, 0, -0.13, -15, block((0.045, 0.03, 0.035), grain(*WOOD, 30, 6))),
    }


def a_turntable(rng: np.random.Generator) -> list[Solid]:
    return [bar((0, -0.02, 0), (0, 0, 0), 0.24, wood())]


TABLE_M = 0.75  # height of the tables' tops


def in_a_room() -> Things:
    y = TABLE_M
    return {
        "mug": put(0.22, y, 0.06, -60, mug((0.8, 0.75, 0.65), (0.6, 0.15, 0.1))),
        "apple": put(-0.1665, y, 0.1, 0, apple()),
        "banana": put(-0.2, y, 0.1, 0, banana()),
        "crate": put(-0.02, y, -0.16, 25, block((0.09, 0.05, 0.06), grain(*WOOD, 30, 6))),
        "book": put(0.36, y, -0.12, 70, book()),
    }


def a_table(width: float, deep: float) -> list[Solid]:
    """Its top at TABLE_M; half sides in metres."""
    y = TABLE_M
    legs = [(sx * (width - 0.05), sz * (deep - 0.05)) for sx in (-1, 1) for sz in (-1, 1)]
    return [
        box((0, y - 0.015, 0), (width, 0.015, deep), wood()),
        *(box((x, (y - 0.03) / 2, z), (0.025, (y - 0.03) / 2, 0.025), wood()) for x, z in legs),
    ]


def a_room(rng: np.random.Generator) -> list[Solid]:
    """4.4 x 2.5 x 3.8 m with a table, shelves and a chair: what a kitchen has."""
    here = quiet_walls(rng, (2.2, 1.25, 1.9)) + a_table(0.6, 0.4)
    dark = plain(rng, 6)
    here += [box((0, h, -1.75), (0.9, 0.02, 0.13), dark) for h in (1.3, 1.65)]
    for i in range(7):
        tall = rng.uniform(0.05, 0.13)
        half = (rng.uniform(0.03, 0.07), tall, 0.08)
        here.append(box((-0.75 + 0.24 * i, 1.32 + tall, -1.75), half, plain(rng, 30)))
    here += put(-1.5, 0, -1.2, 20, [box((0, 0.5, 0), (0.35, 0.5, 0.3), plain(rng, 10))])
    return here + put(1.45, 0, -1.0, -30, [box((0, 0.23, 0), (0.22, 0.23, 0.22), plain(rng, 12))])


def quiet_walls(rng: np.random.Generator, half: tuple[float, float, float]) -> list[Solid]:
    """Floor, ceiling and four walls around (+-x, 0 to 2y, +-z)."""
    return [replace(wall, surface=plain(rng, 4)) for wall in walls(rng, half)]


def walked(count: int, size: tuple[int, int]) -> list[View]:
    """By hand around three sides of the table, a few looks into the room, none level, none still.

    The first looks 27 degrees down: COLMAP's world has the tilt of one of its cameras.
    """
    rng, out = np.random.default_rng(5), []
    for i in range(count):
        s = i / (count - 1)
        turn = np.deg2rad(-110 + 220 * (0.5 - 0.5 * np.cos(3 * np.pi * s)))
        away = 0.72 + 0.2 * np.sin(11 * s)
        eye = np.array([away * np.sin(turn), 1.22 + 0.18 * np.sin(17 * s), away * np.cos(turn)])
        eye += 0.02 * rng.normal(size=3)
        target = np.array([0.05, TABLE_M, 0]) + 0.06 * rng.normal(size=3)
        if i % 8 == 7:  # a look up: the table at the lower rim, the room behind it
            target[1] += 0.45
        if i == 0:
            level = np.hypot(*(eye - target)[[0, 2]])
            eye[1] = target[1] + level * np.tan(np.deg2rad(27))
        lean = np.tan(np.deg2rad(3 * rng.normal()))  # of a hand
        side = unit(np.cross(target - eye, (0, 1, 0)))
        up = tuple(np.array([0, 1.0, 0]) + (lean * side if i else 0))
        out.append(lens(look_at(eye, target, up), size, 55))
    return out


def before_a_shelf() -> Things:
    y = TABLE_M
    return {
        "bottle": put(-0.22, y, -0.05, 0, bottle()),
        "mug": put(0.02, y, 0.06, 200, mug()),
        "apple": put(0.1235, y, 0.16, 180, apple()),
        "banana": put(0.157, y, 0.16, 180, banana()),
        "book": put(0.28, y, -0.1, 15, book()),
        "pencil": put(-0.12, y, 0.2, 25, pencil()),
    }


def a_shelf(rng: np.random.Generator) -> list[Solid]:
    here = a_table(0.75, 0.38) + quiet_walls(rng, (2.5, 1.25, 1.9))
    here += [box((0, 1.25, -1.7), (1.4, 0.03, 0.2), plain(rng, 8))]
    for i in range(9):
        half = (rng.uniform(0.04, 0.1), rng.uniform(0.1, 0.25), 0.1)
        here.append(box((-1.2 + 0.3 * i, 1.28 + half[1], -1.68), half, plain(rng, 30)))
    return here


def forwards(count: int, size: tuple[int, int]) -> list[View]:
    """A hand's grid 0.7 m wide and 0.45 m high, all looking the same way, 22 degrees down."""
    rng, out = np.random.default_rng(6), []
    for i in range(count):
        x = -0.35 + 0.7 * (i % 6) / 5 + 0.02 * rng.normal()
        y = -0.22 + 0.45 * (i // 6) / max((count - 1) // 6, 1) + 0.02 * rng.normal()
        eye = np.array([x, 1.16 + y, 1.0 + 0.03 * rng.normal()])
        ahead = np.array([-0.25 * x, -np.tan(np.deg2rad(22)) - 0.3 * y, -1.0])
        out.append(lens(look_at(eye, eye + ahead), size, 50))
    return out


def under_a_dome() -> Things:
    return {
        "brick": put(-0.0851, 0, 0.03, 0, block((0.055, 0.03, 0.03), BRICK)),
        "orange brick": put(0.0251, 0, 0.03, 0, block((0.055, 0.03, 0.03), ORANGE)),
        "book": put(0.02, 0, -0.15, 10, book()),
        "ball": [ball((0.02, 0.028 + 0.04, -0.15), 0.0405, Material(paint(np.random.default_rng(3),
                                                                         30)))],
        "mug": put(0.19, 0, 0.0, 100, mug((0.25, 0.45, 0.35), (0.9, 0.9, 0.8))),
        "apple": put(-0.22, 0, -0.09, 0, apple()),
    }  # fmt: skip


def a_yard(rng: np.random.Generator) -> list[Solid]:
    """Paving without end, a low wall behind."""
    stone = plain(rng, 25)
    return [
        box((0, -1, 0), (60, 1, 60), stone),
        box((0, 0.2, -2.2), (3.5, 0.2, 0.12), plain(rng, 8)),
    ]


def from_a_dome(count: int, size: tuple[int, int]) -> list[View]:
    """From 20 to 70 degrees above, all round; the first from 68 degrees above."""
    low, high = np.sin(np.deg2rad((20, 70)))
    out = []
    for i in range(count):
        turn, height = 2 * np.pi * GOLDEN * i, low + (high - low) * ((i + 0.5) * 2**0.5 % 1)
        height = np.sin(np.deg2rad(68)) if i == 0 else height
        level = np.sqrt(1 - height**2)
        spoke = np.array([level * np.sin(turn), height, level * np.cos(turn)])
        out.append(lens(look_at((0, 0.03, 0) + 0.7 * spoke, (0, 0.03, -0.03)), size, 45))
    return out


def in_three_rings(count: int, size: tuple[int, int]) -> list[View]:
    """A ring of cameras at 12, 30 and 50 degrees above, as a turning table sees one camera."""
    out = []
    for i in range(count):
        turn, up = (
            2 * np.pi * (i * 3 / count + (i % 3) / 9),
            np.deg2rad((12, 30, 50)[i * 3 // count]),
        )
        spoke = np.array([np.cos(up) * np.sin(turn), np.sin(up), np.cos(up) * np.cos(turn)])
        out.append(lens(look_at((0, 0.03, 0) + 0.6 * spoke, (0, 0.03, 0)), size, 42))
    return out


def lens(pose: Pose, size: tuple[int, int], degrees: float) -> View:
    """The view of a pose; `degrees` high."""
    from_there = view_at(np.array([0.0, 0, 1]), np.zeros(3), size, degrees)
    return View(pose, from_there.tangents, 0.02, 1000.0, size)


KINDS = {
    "turntable": Kind(on_a_turntable, a_turntable, in_three_rings, 60, 0.07, "+Z", 3),
    "room": Kind(in_a_room, a_room, walked, 80, 0.9, "colmap", sky=(0, 0, 0)),
    "forward": Kind(before_a_shelf, a_shelf, forwards, 24, 0.4, "+Y", 22, sky=(0, 0, 0)),
    "dome": Kind(under_a_dome, a_yard, from_a_dome, 49, 0.25, "colmap", sky=(0.66, 0.77, 0.9)),
}
