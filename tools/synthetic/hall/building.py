"""The plant hall itself: floor, brick walls with windows, roof, columns, crane, and the outside.

The world is in metres, y up: x along the hall, z across it; the floor is y = 0.
"""

import numpy as np

from shapeshift.training.synthetic.placing import ball, bar, box, mix, noise, ring
from shapeshift.training.synthetic.solids import Disc
from shapeshift.training.synthetic.tracer import Material, Solid

HALF_X, HALF_Z, HEIGHT = 17.0, 11.0, 9.0  # metres, inside
WALL = 0.15  # metres, half a wall's thickness
BAYS = 8  # between columns along x
BAY = 2 * HALF_X / BAYS  # metres
GATE = (-1.5, 2.5, 4.2)  # metres: z from, z to, height of the opening in the wall at -x
WINDOW = (1.5, 2.6, 6.4)  # metres: half width, sill, lintel; one a bay in the wall at +z
SKYLIGHT = 0.55  # metres, half the width of the glass strip over each bay
INDOORS, OUTDOORS = 21.0, 9.0  # °C

STEEL = Material((0.36, 0.40, 0.45), INDOORS + 1, 0.15, 20.0)
YELLOW = Material((0.90, 0.70, 0.10), INDOORS + 1, 0.2, 20.0)


def bay_of(x: np.ndarray) -> np.ndarray:
    """Metres from the middle of the bay that x lies in."""
    return (x + HALF_X) % BAY - BAY / 2


def concrete(p: np.ndarray) -> np.ndarray:
    """Slabs with joints, stains, and yellow lines beside the walkways at z = -3.5 and 3.5."""
    x, z = p[:, 0], p[:, 2]
    flat = p * (1.0, 0.0, 1.0)
    tone = 0.5 * noise(flat, 0.7) + 0.3 * noise(flat, 4.0) + 0.2 * noise(flat, 17.0)
    out = mix((0.44, 0.45, 0.45), (0.66, 0.65, 0.62), tone)
    slab = np.minimum(np.abs(bay_of(x + BAY / 2)), np.abs(z - BAY * np.round(z / BAY)))
    out[slab < 0.03] *= 0.6
    stain = np.clip(4 * noise(flat + 31.0, 0.45) - 2.9, 0, 1)
    out *= 1 - 0.45 * stain[:, None]
    walkway = np.abs(np.abs(z) - 3.5)
    line = (np.abs(walkway - 1.0) < 0.06) & (np.abs(x) < HALF_X - 1)
    out[line & (noise(flat, 9.0) > 0.12)] = (0.88, 0.74, 0.16)
    return out


def floor_heat(p: np.ndarray) -> np.ndarray:
    """A warm duct runs under the floor along z = -9."""
    duct = np.exp(-(((p[:, 2] + 9.0) / 0.5) ** 2))
    return INDOORS - 1 + 5 * duct + 1.0 * noise(p * (1.0, 0.0, 1.0), 0.5)


def brick(along: int):
    """Bricks on walls whose length runs along an axis: painted below two metres."""

    def color(p: np.ndarray) -> np.ndarray:
        across, y = p[:, along], p[:, 1] + HEIGHT / 2
        row = np.floor(y / 0.16)
        place = across / 0.5 + 0.5 * (row % 2)
        cell = np.stack([np.floor(place), row, np.zeros_like(row)], axis=1)
        tone = noise(cell * 0.37 + 0.19, 3.0)
        out = mix((0.55, 0.29, 0.21), (0.78, 0.50, 0.38), tone)
        joint = (np.abs(place - np.round(place)) < 0.035) | (np.abs(y / 0.16 - row) < 0.1)
        out[joint] = (0.66, 0.63, 0.58)
        paint = y < 2.0
        worn = noise(p, 1.3)
        out[paint] = mix((0.30, 0.45, 0.42), (0.42, 0.57, 0.53), worn)[paint]
        out[np.abs(y - 2.0) < 0.05] = (0.85, 0.84, 0.78)
        return out

    return color


def wall_heat(p: np.ndarray) -> np.ndarray:
    """Colder towards the floor and where the wall is wet."""
    wet = np.clip(3 * noise(p, 0.35) - 2.0, 0, 1)
    return INDOORS - 3 + 0.35 * (p[:, 1] + HEIGHT / 2) - 4 * wet


def beside_windows(p: np.ndarray) -> np.ndarray:
    half, sill, lintel = WINDOW
    y = p[:, 1] + HEIGHT / 2
    return ~((np.abs(bay_of(p[:, 0])) < half) & (y > sill) & (y < lintel))


def beside_gate(p: np.ndarray) -> np.ndarray:
    first, last, top = GATE
    return ~((p[:, 2] > first) & (p[:, 2] < last) & (p[:, 1] + HEIGHT / 2 < top))


def between_skylights(p: np.ndarray) -> np.ndarray:
    return ~((np.abs(bay_of(p[:, 0])) < SKYLIGHT) & (np.abs(p[:, 2]) < HALF_Z - 1.5))


def corrugated(p: np.ndarray) -> np.ndarray:
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * p[:, 2] / 0.4)
    return mix((0.47, 0.50, 0.52), (0.66, 0.69, 0.71), 0.7 * wave + 0.3 * noise(p, 1.0))


def shell() -> list[Solid]:
    """Floor, four walls and the roof."""
    y, w = HEIGHT / 2, WALL
    long, cross = Material(brick(0), wall_heat), Material(brick(2), wall_heat)
    half_x, half_z = HALF_X + 2 * w, HALF_Z + 2 * w
    return [
        box((0, -0.1, 0), (half_x, 0.1, half_z), Material(concrete, floor_heat, 0.12, 30.0, 0.1)),
        box((0, y, -HALF_Z - w), (half_x, y, w), long),
        box((0, y, HALF_Z + w), (half_x, y, w), long, keep=beside_windows),
        box((HALF_X + w, y, 0), (w, y, half_z), cross),
        box((-HALF_X - w, y, 0), (w, y, half_z), cross, keep=beside_gate),
        box((0, HEIGHT + w, 0), (half_x, w, half_z), Material(corrugated, INDOORS + 4),
            keep=between_skylights),
    ]  # fmt: skip


def frames() -> list[Solid]:
    """Columns and beams a bay, the bars of the windows, the frame of the gate."""
    half, sill, lintel = WINDOW
    out = []
    for i in range(BAYS + 1):
        x = -HALF_X + i * BAY
        x = float(np.clip(x, -HALF_X + 0.2, HALF_X - 0.2))
        for z in (-HALF_Z + 0.2, HALF_Z - 0.2):
            out.append(box((x, HEIGHT / 2, z), (0.18, HEIGHT / 2, 0.2), STEEL))
            out.append(box((x, 0.12, z), (0.3, 0.12, 0.3), YELLOW))
        out.append(box((x, HEIGHT - 0.35, 0), (0.12, 0.3, HALF_Z), STEEL))
    white = Material((0.86, 0.86, 0.84), INDOORS - 5)
    for i in range(BAYS):
        x = -HALF_X + (i + 0.5) * BAY
        z = HALF_Z + WALL
        out += [box((x + s, (sill + lintel) / 2, z), (0.04, (lintel - sill) / 2, 0.05), white)
                for s in (-half / 3, half / 3)]  # fmt: skip
        out += [box((x, sill + (lintel - sill) * s, z), (half, 0.04, 0.05), white)
                for s in (1 / 3, 2 / 3)]  # fmt: skip
        out.append(box((x, sill - 0.04, HALF_Z - 0.06), (half + 0.1, 0.04, 0.1), white))
    first, last, top = GATE
    out += [
        box((-HALF_X + 0.05, top / 2, first - 0.1), (0.12, top / 2, 0.1), YELLOW),
        box((-HALF_X + 0.05, top / 2, last + 0.1), (0.12, top / 2, 0.1), YELLOW),
        box((-HALF_X + 0.05, top + 0.3, (first + last) / 2), (0.15, 0.3, 2.3), STEEL),
    ]
    return out


def crane() -> list[Solid]:
    """A bridge on two rails with its trolley, rope and hook, and lamps under the beams."""
    x, y = 2.2, 7.6
    out = [
        box((0, y - 0.25, z), (HALF_X - 0.4, 0.15, 0.12), STEEL)
        for z in (-HALF_Z + 0.6, HALF_Z - 0.6)
    ]
    out += [box((x + dx, y, 0), (0.18, 0.35, HALF_Z - 0.5), YELLOW) for dx in (-0.7, 0.7)]
    dark = Material((0.16, 0.17, 0.19), INDOORS + 2)
    drive = Material((0.20, 0.30, 0.55), INDOORS + 14, 0.2, 20.0)
    out += [
        box((x, y + 0.45, -2.0), (0.9, 0.12, 0.7), dark),
        bar((x - 0.5, y + 0.75, -2.0), (x + 0.5, y + 0.75, -2.0), 0.25, drive),
        bar((x, y + 0.4, -2.0), (x, 4.6, -2.0), 0.025, dark),
        box((x, 4.5, -2.0), (0.16, 0.2, 0.1), YELLOW),
        ring((x, 4.18, -2.0), "z", 0.12, 0.035, dark),
    ]  # fmt: skip
    lamp = Material((0.97, 0.96, 0.90), INDOORS + 9)
    for i in range(1, BAYS, 2):
        for z in (-5.5, 0.0, 5.5):
            out.append(box((-HALF_X + i * BAY + 0.3, HEIGHT - 0.75, z), (0.12, 0.06, 0.7), lamp))
    return out


def meadow(p: np.ndarray) -> np.ndarray:
    """Asphalt in a yard round the hall, grass beyond."""
    flat = p * (1.0, 0.0, 1.0)
    grass = mix((0.27, 0.38, 0.16), (0.48, 0.56, 0.27), noise(flat, 0.4))
    yard = mix((0.33, 0.33, 0.34), (0.45, 0.45, 0.45), noise(flat, 0.8))
    near = (np.abs(p[:, 0]) < HALF_X + 14) & (np.abs(p[:, 2]) < HALF_Z + 12)
    return np.where(near[:, None], yard, grass)


def facade(p: np.ndarray) -> np.ndarray:
    """The neighbour's wall: rows of dark windows."""
    along = p[:, 0] + p[:, 2]
    window = (np.abs(along / 3 - np.round(along / 3)) < 0.28) & (
        np.abs(p[:, 1] / 3.2 - np.round(p[:, 1] / 3.2)) < 0.25
    )
    out = np.tile([0.76, 0.70, 0.60], (len(p), 1))
    out[window] = (0.20, 0.26, 0.33)
    return out


def outside() -> list[Solid]:
    """What the windows and the gate show, up to hills at 400 metres; behind it is the sky."""
    ground = Solid(Disc(900.0), Material(meadow, OUTDOORS))
    ground.world_from_local[1, 3] = -0.22
    out = [ground]
    wall, chimney = Material(facade, OUTDOORS + 3), Material((0.62, 0.36, 0.28), OUTDOORS + 8)
    out += [
        box((-8, 6.5, 48), (16, 6.7, 7), wall),
        box((30, 4.5, 62), (10, 4.7, 8), wall),
        box((-62, 5, -6), (9, 5.2, 14), wall),
        bar((14, 0, 55), (14, 30, 55), 1.6, chimney, top_radius=1.1),
    ]  # fmt: skip
    leaves = Material(
        lambda p: mix((0.14, 0.27, 0.10), (0.36, 0.50, 0.20), noise(p, 1.1)), OUTDOORS + 1
    )
    trunk = Material((0.30, 0.23, 0.17), OUTDOORS + 1)
    trees = [
        (-18, 26),
        (-9, 29),
        (1, 25),
        (8, 31),
        (17, 27),
        (25, 24),
        (-30, 6),
        (-33, -3),
        (-28, -9),
    ]
    for i, (x, z) in enumerate(trees):
        tall = 2.2 + 0.5 * (i % 3)
        out.append(bar((x, -0.2, z), (x, tall + 1, z), 0.25, trunk))
        out.append(ball((x, tall + 2.2, z), 2.0 + 0.25 * (i % 4), leaves))
    hill = Material(
        lambda p: mix((0.33, 0.42, 0.28), (0.45, 0.53, 0.40), noise(p, 0.02)), OUTDOORS - 2
    )
    for x, z, radius in ((-150, 420, 190), (120, 460, 220), (-480, 60, 200), (-430, -180, 160)):
        out.append(ball((x, -0.75 * radius, z), float(radius), hill))
    return out


def building() -> list[Solid]:
    return shell() + frames() + crane() + outside()
