"""Six more groups of the plant hall that hold, heat, switch and store: see machines.py."""

import numpy as np

from shapeshift.training.synthetic.placing import ball, bar, box, bump, disc, mix, noise, ring
from shapeshift.training.synthetic.tracer import Material, Solid
from tools.synthetic.hall.building import INDOORS
from tools.synthetic.hall.machines import CONCRETE, DARK, carton, metal, paint

FUSE, FUSE_C = (0.42, 1.32, 0.42), 79.0  # behind the third door of the switchgear
BUSHING, BUSHING_C = (-0.5, 2.75, 0.0), 92.0  # the transformer's first
DOOR, DOOR_C = (-0.55, 0.66, 0.96), 98.0  # the lower edge of the fire door of the boiler
LEVEL = 1.9  # metres: what stands in the tanks


def tanks() -> list[Solid]:
    """Three upright tanks of warm liquid, filled to a level that only heat shows."""
    out = []
    for i, x in enumerate((-1.65, 0.0, 1.65)):
        level = LEVEL + 0.5 * (i - 1)
        warm = 58.0 - 9 * i

        def heat(p: np.ndarray, level=level, warm=warm) -> np.ndarray:
            below = 1 / (1 + np.exp((p[:, 1] + 1.95 - level) / 0.05))
            return INDOORS + 4 + (warm - INDOORS - 4) * below

        steel = Material(
            lambda p: mix((0.62, 0.64, 0.66), (0.82, 0.83, 0.85), noise(p * (1, 0.15, 1), 5.0)),
            heat, 0.35, 40.0, 0.35,
        )  # fmt: skip
        out += [
            bar((x, 0.45, 0), (x, 3.45, 0), 0.68, steel, bevel=0.02),
            bar((x, 3.45, 0), (x, 3.75, 0), 0.68, steel, top_radius=0.2),
            *[
                bar((x + dx, 0, dz), (x + dx, 0.5, dz), 0.06, DARK)
                for dx, dz in ((0.45, 0.45), (-0.45, 0.45), (0.45, -0.45), (-0.45, -0.45))
            ],
            ring((x, 1.0, 0.0), "y", 0.69, 0.025, DARK),
            ring((x, 2.9, 0.0), "y", 0.69, 0.025, DARK),
            bar((x, 1.35, 0.6), (x, 1.35, 0.8), 0.2, metal(warm - 12, 0.5)),
            bar((x, 3.7, 0), (x, 4.4, 0), 0.07, metal(40.0)),
            box((x, 2.2, 0.69), (0.22, 0.14, 0.02), Material(sign(i), INDOORS + 6)),
        ]
    rail = Material((0.90, 0.70, 0.10), INDOORS + 1)
    for x in (2.42, 2.58):
        out.append(bar((x, 0, 0.5), (x, 4.2, 0.5), 0.02, rail))
    out += [bar((2.42, 0.35 * k, 0.5), (2.58, 0.35 * k, 0.5), 0.014, rail) for k in range(1, 12)]
    return out


def sign(number: int):
    """A plate with a number of strokes."""

    def color(p: np.ndarray) -> np.ndarray:
        out = np.tile([0.95, 0.93, 0.85], (len(p), 1))
        stroke = np.abs(p[:, 0] / 0.08 - np.round(p[:, 0] / 0.08)) < 0.2
        out[stroke & (np.abs(p[:, 0]) < 0.05 + 0.06 * number) & (np.abs(p[:, 1]) < 0.09)] = (
            0.10, 0.18, 0.45,
        )  # fmt: skip
        return out

    return color


def exchanger() -> list[Solid]:
    """A shell-and-tube heat exchanger on two saddles: hot on the left, cooled to the right."""
    shell = Material(
        lambda p: mix((0.66, 0.66, 0.63), (0.84, 0.84, 0.81), noise(p, 3.0)),
        lambda p: 72 - 17 * (p[:, 1] + 1.5), 0.25, 25.0, 0.2,
    )  # fmt: skip
    head = paint((0.55, 0.16, 0.12), 74.0)
    out = [
        bar((-1.6, 1.3, 0), (1.6, 1.3, 0), 0.5, shell, bevel=0.02),
        ball((-1.7, 1.3, 0), 0.5, head),
        ball((1.7, 1.3, 0), 0.5, paint((0.16, 0.30, 0.55), 26.0)),
    ]
    for x, celsius in ((-1.6, 71.0), (1.6, 27.0)):
        out.append(bar((x - 0.07, 1.3, 0), (x + 0.07, 1.3, 0), 0.62, metal(celsius, 0.45)))
    for x in (-1.0, 1.0):
        out.append(box((x, 0.4, 0), (0.12, 0.4, 0.45), CONCRETE))
        out.append(box((x, 0.86, 0), (0.16, 0.08, 0.4), DARK))
    for x, celsius in ((-1.2, 70.0), (1.2, 33.0)):
        out.append(bar((x, 1.7, 0), (x, 2.6, 0), 0.13, metal(celsius, 0.5)))
        out.append(bar((x, 2.2, 0), (x, 2.3, 0), 0.22, metal(celsius - 4, 0.45)))
        out.append(disc((x, 1.3, 0.505), "z", 0.12, Material((0.92, 0.91, 0.86), celsius - 20)))
    return out


def boiler() -> list[Solid]:
    """A steam boiler with its burner, fire door and flue through the roof."""

    def front(p: np.ndarray) -> np.ndarray:
        out = mix((0.50, 0.53, 0.55), (0.66, 0.68, 0.70), noise(p, 2.0))
        door = np.hypot(p[:, 0] + 0.55, p[:, 1] + 0.27)
        out[(door < 0.36) & (p[:, 2] > 0.9)] = (0.17, 0.17, 0.18)
        out[(door < 0.30) & (p[:, 2] > 0.9)] = (0.30, 0.29, 0.28)
        band = np.abs(p[:, 1] - 0.8) < 0.07
        out[band] = (0.78, 0.18, 0.12)
        return out

    def heat(p: np.ndarray) -> np.ndarray:
        ring_of_door = np.hypot(p[:, 0] + 0.55, p[:, 1] + 0.27)
        seal = np.exp(-(((ring_of_door - 0.33) / 0.05) ** 2)) * (p[:, 2] > 0.9)
        weak = 0.35 + 0.65 * np.exp(-(((p[:, 0] + 0.55) / 0.2) ** 2)) * (p[:, 1] < -0.27)
        return 41 + 4 * noise(p, 1.5) + 57 * seal * weak

    flue = metal(lambda p: 86 - 4 * (p[:, 1] + 3), 0.5)
    return [
        box((0, 0.1, 0), (2.0, 0.1, 1.1), CONCRETE),
        box((0, 1.25, 0), (1.7, 1.05, 0.95), Material(front, heat, 0.2, 25.0, 0.05), 0.03),
        bar((0.8, 2.3, 0), (0.8, 9.0, 0), 0.28, flue),
        bar((0.8, 2.3, 0), (0.8, 2.45, 0), 0.42, metal(70.0, 0.4)),
        bar((0.7, 0.95, 0.95), (0.7, 0.95, 1.5), 0.2, paint((0.78, 0.16, 0.10), 36.0)),
        box((0.7, 0.95, 1.55), (0.24, 0.26, 0.16), paint((0.78, 0.16, 0.10), 34.0)),
        bar((-1.0, 2.3, 0), (-1.0, 3.2, 0), 0.12, metal(84.0)),
        box((1.35, 1.5, 0.98), (0.2, 0.3, 0.04), Material((0.14, 0.26, 0.38), 33.0, 0.2)),
        disc((-1.2, 2.0, 0.965), "z", 0.13, Material((0.93, 0.92, 0.88), 45.0)),
    ]


def switchgear() -> list[Solid]:
    """Six cabinets in a row; behind one door a fuse is loose."""
    out = [box((0, 0.05, 0), (2.45, 0.05, 0.45), DARK)]
    for i in range(6):
        x = -2.0 + 0.8 * i
        loose = i == 3

        def color(p: np.ndarray, i=i) -> np.ndarray:
            out = mix((0.76, 0.77, 0.74), (0.85, 0.86, 0.83), noise(p, 2.0))
            out[(np.abs(p[:, 0]) > 0.36)] *= 0.55
            window = (np.abs(p[:, 0]) < 0.2) & (np.abs(p[:, 1] - 0.55) < 0.16) & (p[:, 2] > 0.3)
            out[window] = (0.16, 0.20, 0.24)
            for k in range(3):
                lamp = np.hypot(p[:, 0] + 0.15 - 0.15 * k, p[:, 1] - 0.22) < 0.035
                out[lamp & (p[:, 2] > 0.3)] = (
                    (0.82, 0.12, 0.1),
                    (0.15, 0.65, 0.2),
                    (0.9, 0.7, 0.1),
                )[(i + k) % 3]
            vents = (np.abs(p[:, 0]) < 0.25) & (np.abs(p[:, 1] + 0.8) < 0.12) & (p[:, 2] > 0.3)
            out[vents & (np.sin(p[:, 1] * 120) > 0)] = (0.2, 0.2, 0.21)
            return out

        def heat(p: np.ndarray, loose=loose) -> np.ndarray:
            at = bump(p * (1, 1, 0), (0.02, 0.22, 0), 0.13)
            return 27 + 2 * noise(p, 2.0) + (FUSE_C - 28) * loose * at

        out.append(box((x, 1.1, 0), (0.39, 1.0, 0.42), Material(color, heat, 0.2, 25.0), 0.01))
        out.append(bar((x + 0.3, 1.0, 0.42), (x + 0.3, 1.25, 0.42), 0.02, DARK))
    return out


def transformer() -> list[Solid]:
    """A tank with radiators to both sides and three bushings; the first has a bad contact."""
    grey = paint((0.48, 0.54, 0.52), lambda p: 44 + 9 * (p[:, 1] + 0.7))
    out = [
        box((0, 0.12, 0), (2.0, 0.12, 1.2), CONCRETE),
        box((0, 1.1, 0), (1.1, 0.85, 0.6), grey, 0.02),
        bar((-0.9, 2.35, -0.35), (0.9, 2.35, -0.35), 0.2, grey),
    ]
    for side in (-1, 1):
        for k in range(7):
            fin = paint((0.48, 0.54, 0.52), lambda p: 41 + 10 * (p[:, 1] + 0.6))
            out.append(box((side * (1.2 + 0.09 * k), 1.05, 0), (0.02, 0.65, 0.5), fin))
    for i, x in enumerate((-0.5, 0.0, 0.5)):
        hot = BUSHING_C if i == 0 else 50.0
        brown = Material((0.38, 0.20, 0.14), hot - 26, 0.45, 50.0, 0.1)
        out.append(bar((x, 1.95, 0), (x, 2.65, 0), 0.07, brown))
        out += [bar((x, y, 0), (x, y + 0.04, 0), 0.13, brown) for y in (2.05, 2.2, 2.35, 2.5)]
        out.append(bar((x, 2.65, 0), (x, 2.85, 0), 0.06, metal(hot, 0.6)))
        out.append(box((x, 2.75, 0), (0.09, 0.07, 0.09), metal(hot, 0.55)))
    fence = Material((0.90, 0.70, 0.10), INDOORS + 1)
    for y in (0.5, 1.0):
        out.append(bar((-2.4, y, 1.45), (2.4, y, 1.45), 0.025, fence))
    return out + [bar((x, 0, 1.45), (x, 1.05, 1.45), 0.03, fence) for x in (-2.4, -0.8, 0.8, 2.4)]


def store() -> list[Solid]:
    """A rack with cartons, drums before it, a pallet of sacks: what is as warm as the hall."""
    blue = Material((0.16, 0.28, 0.58), INDOORS)
    out = [box((x, 1.6, z), (0.05, 1.6, 0.05), blue) for x in (-2.3, 0, 2.3) for z in (-1.2, -0.3)]
    for y in (0.25, 1.35, 2.5):
        beam = Material((0.88, 0.42, 0.10), INDOORS)
        out += [box((0, y, z), (2.3, 0.06, 0.03), beam) for z in (-1.2, -0.3)]
        out.append(
            box((0, y + 0.07, -0.75), (2.3, 0.015, 0.5), Material((0.62, 0.5, 0.34), INDOORS))
        )
    sizes = ((0.3, 0.28), (0.36, 0.2), (0.26, 0.36), (0.34, 0.3), (0.24, 0.24))
    for level, y in enumerate((0.335, 1.435, 2.585)):
        x = -2.1
        for k in range(5):
            half, tall = sizes[(k + 2 * level) % 5]
            surface = Material(carton(5 * level + k), INDOORS + (k % 3))
            out.append(box((x + half, y + tall, -0.75), (half, tall, 0.4), surface))
            x += 2 * half + 0.12
    for i, (x, z) in enumerate(((-1.9, 0.5), (-1.2, 0.75), (-1.55, 1.2))):
        color = ((0.10, 0.30, 0.55), (0.62, 0.14, 0.10), (0.15, 0.42, 0.25))[i]
        drum = paint(color, INDOORS + 1, 0.3)
        out.append(bar((x, 0, z), (x, 0.88, z), 0.29, drum, bevel=0.02))
        out += [ring((x, y, z), "y", 0.29, 0.015, drum) for y in (0.3, 0.58)]
    sack = Material(lambda p: mix((0.70, 0.66, 0.55), (0.86, 0.83, 0.74), noise(p, 7.0)), INDOORS)
    out.append(box((1.3, 0.07, 0.7), (0.6, 0.07, 0.45), Material((0.62, 0.48, 0.30), INDOORS)))
    for k in range(6):
        at = (1.0 + 0.6 * (k % 2), 0.24 + 0.2 * (k // 2), 0.7)
        out.append(box(at, (0.28, 0.1, 0.42), sack, 0.06))
    return out
