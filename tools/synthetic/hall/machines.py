"""Six machine groups of the plant hall that turn, pump and press, each in a frame of its own.

In that frame the floor is y = 0, the middle of the group x = z = 0, and z leads to the aisle; a
group stays within 2.6 metres to each side and 1.7 to the front and the back.
"""

import numpy as np

from shapeshift.training.synthetic.placing import ball, bar, box, bump, disc, mix, noise, ring
from shapeshift.training.synthetic.tracer import Material, Solid
from tools.synthetic.hall.building import INDOORS

DARK = Material((0.15, 0.16, 0.18), INDOORS + 2, 0.15, 20.0)
CONCRETE = Material(
    lambda p: mix((0.50, 0.50, 0.48), (0.68, 0.67, 0.64), noise(p, 6.0)), INDOORS, 0.0
)
BEARING, BEARING_C = (-0.52, 0.82, 0.55), 96.0  # the first pump's dry bearing, its own frame
ROLLER, ROLLER_C = (0.75, 0.62, 0.45), 84.0  # the conveyor's seized roller
SPINDLE, SPINDLE_C = (0.35, 1.28, 0.62), 66.0  # the lathe's spindle, without oil
DUCT, DUCT_C = (1.25, 1.42, 0.0), 88.0  # the compressor's pipe of hot air


def paint(color: tuple, celsius, gloss: float = 0.2) -> Material:
    """Machine paint, a little worn."""
    low = tuple(0.82 * c for c in color)
    return Material(lambda p: mix(low, color, noise(p, 3.0)), celsius, gloss, 25.0, 0.05)


def metal(celsius, tone: float = 0.55) -> Material:
    return Material((tone, 1.01 * tone, 1.04 * tone), celsius, 0.35, 40.0, 0.35)


def electric_motor(middle: tuple, length: float, radius: float, color: tuple, celsius: float):
    """A motor along x with cooling ribs, fan cowl to -x, terminal box and feet."""
    x, y, z = middle
    half = length / 2
    body = paint(color, lambda p: celsius - 8 + 16 * (p[:, 1] / length + 0.5))
    out = [bar((x - half, y, z), (x + half, y, z), radius, body, bevel=0.02)]
    for i in range(7):
        at = x - 0.75 * half + i * half / 4
        out.append(bar((at - 0.012, y, z), (at + 0.012, y, z), 1.12 * radius, body))
    out += [
        bar((x - half - 0.14, y, z), (x - half, y, z), 1.08 * radius, paint(color, celsius - 14)),
        box(
            (x, y + 1.15 * radius, z),
            (0.13, 0.3 * radius, 0.6 * radius),
            paint(color, celsius - 12),
        ),
        box((x, y - radius - 0.02, z), (0.7 * half, 0.12, radius), paint(color, celsius - 12)),
    ]
    return out


def one_pump(z: float, bearing: float, motor: float) -> list[Solid]:
    """A motor, its coupling, the bearing's housing and the pump's volute with two flanges."""
    blue, y = (0.12, 0.34, 0.62), 0.82
    water = lambda p: 48 + 5 * noise(p, 5.0)  # noqa: E731 - a pattern among patterns
    guard = Material((0.93, 0.55, 0.08), INDOORS + 4, 0.2, 20.0)
    volute = paint((0.20, 0.45, 0.40), water)
    return [
        box((0, 0.16, z), (1.55, 0.16, 0.5), CONCRETE, 0.01),
        box((0, 0.36, z), (1.45, 0.05, 0.4), DARK),
        *electric_motor((-1.0, y - 0.04, z), 0.75, 0.24, blue, motor),
        box((-0.4, 0.55, z), (0.16, 0.2, 0.16), DARK),
        bar((-0.68, y, z), (-0.4, y, z), 0.15, guard),
        bar((-0.62, y, z), (-0.42, y, z), 0.17, metal(bearing, 0.5), bevel=0.01),
        bar((-0.45, y, z), (0.3, y, z), 0.06, metal(34.0, 0.7)),
        bar((0.05, y, z), (0.42, y, z), 0.38, volute, bevel=0.03),
        ring((0.24, y, z), "x", 0.34, 0.13, volute),
        box((0.24, 0.48, z), (0.16, 0.12, 0.3), volute),
        bar((0.42, y, z), (1.1, y, z), 0.12, volute),
        bar((1.0, y, z), (1.1, y, z), 0.2, metal(47.0)),
        bar((0.24, y + 0.3, z), (0.24, y + 1.6, z), 0.1, volute),
        bar((0.24, y + 0.7, z), (0.24, y + 0.78, z), 0.17, metal(47.0)),
        ball((0.24, y + 1.1, z), 0.16, metal(47.0, 0.45)),
        bar((0.24, y + 1.1, z), (0.24, y + 1.1, z + 0.3), 0.03, metal(40.0)),
        ring((0.24, y + 1.1, z + 0.32), "z", 0.16, 0.02, Material((0.78, 0.10, 0.08), 30.0, 0.3)),
    ]


def pumps() -> list[Solid]:
    """Two feed pumps side by side; the bearing of the first runs dry."""
    header = paint((0.20, 0.45, 0.40), 48.0)
    pipe = bar((1.3, 0.82, -1.1), (1.3, 0.82, 1.1), 0.14, header)
    return one_pump(0.55, BEARING_C, 52.0) + one_pump(-0.55, 41.0, 47.0) + [pipe]


def compressor() -> list[Solid]:
    """A cabinet with louvres, a receiver standing beside it, the hot duct between them."""

    def louvres(p: np.ndarray) -> np.ndarray:
        out = mix((0.78, 0.80, 0.82), (0.88, 0.89, 0.90), noise(p, 2.0))
        grille = (np.abs(p[:, 0] + 0.45) < 0.5) & (np.abs(p[:, 1]) < 0.6) & (p[:, 2] > 0.7)
        out[grille & (np.sin(p[:, 1] * 60) > 0)] = (0.12, 0.13, 0.15)
        panel = (np.abs(p[:, 0] - 0.62) < 0.2) & (np.abs(p[:, 1] - 0.35) < 0.16) & (p[:, 2] > 0.7)
        out[panel] = (0.10, 0.18, 0.35)
        return out

    cabinet = Material(louvres, lambda p: 33 + 12 * bump(p, (-0.45, 0.2, 0.8), 0.5), 0.2, 25.0)
    tank = paint((0.22, 0.38, 0.66), lambda p: 38 + 6 * (p[:, 1] + 0.7), 0.3)
    hot = metal(lambda p: DUCT_C - 8 * np.abs(p[:, 1]), 0.5)
    return [
        box((-0.9, 0.06, 0), (1.3, 0.06, 0.9), CONCRETE),
        box((-0.9, 1.0, 0), (1.2, 0.88, 0.8), cabinet, 0.02),
        bar((1.6, 0.5, 0), (1.6, 2.3, 0), 0.5, tank, bevel=0.03),
        ball((1.6, 2.3, 0), 0.5, tank),
        *[bar((1.6 + dx, 0, dz), (1.6 + dx, 0.5, dz), 0.05, DARK)
          for dx, dz in ((0.3, 0.3), (-0.3, 0.3), (0, -0.4))],
        bar((0.3, 1.42, 0), (1.3, 1.42, 0), 0.11, hot),
        bar((0.42, 1.42, 0), (0.5, 1.42, 0), 0.17, metal(80.0)),
        disc((1.6, 1.6, 0.505), "z", 0.1, Material((0.93, 0.92, 0.88), 36.0)),
        bar((1.6, 2.75, 0), (1.6, 3.05, 0), 0.05, metal(44.0)),
    ]  # fmt: skip


def lathe() -> list[Solid]:
    """A machine tool: bed, headstock with its chuck, tailstock, splash guard, control panel."""
    green, cream = (0.35, 0.52, 0.38), (0.84, 0.80, 0.68)
    head = paint(cream, lambda p: 34 + (SPINDLE_C - 34) * bump(p, (0.35, 0.1, 0.3), 0.28))
    screen = Material((0.08, 0.22, 0.30), 31.0, 0.3, 60.0, 0.1)
    out = [
        box((0, 0.35, 0), (2.2, 0.35, 0.5), paint(green, 24.0), 0.02),
        box((0.2, 0.86, 0), (1.9, 0.14, 0.35), metal(26.0, 0.5)),
        box((-0.0, 1.18, 0.0), (0.62, 0.42, 0.45), head, 0.02),
        bar((0.62, 1.22, 0), (0.84, 1.22, 0), 0.26, metal(42.0, 0.6)),
        bar((0.84, 1.22, 0), (1.5, 1.22, 0), 0.06, metal(38.0, 0.75)),
        box((1.7, 1.14, 0), (0.22, 0.24, 0.26), paint(cream, 25.0), 0.02),
        box((1.1, 1.06, 0.24), (0.18, 0.12, 0.18), metal(29.0, 0.45)),
        box((-1.4, 1.1, 0.1), (0.5, 0.7, 0.45), paint(green, 29.0), 0.02),
        box((-1.4, 1.35, 0.56), (0.34, 0.26, 0.02), screen),
        box((0.6, 1.75, -0.5), (1.6, 0.5, 0.03), paint(cream, 23.0)),
        bar((-1.4, 1.8, 0.1), (-1.4, 2.4, 0.1), 0.03, DARK),
    ]
    lights = ((0.80, 0.12, 0.10), (0.92, 0.65, 0.10), (0.15, 0.62, 0.25))
    return out + [
        bar((-1.4, 2.4 - 0.12 * i, 0.1), (-1.4, 2.5 - 0.12 * i, 0.1), 0.07, Material(c, 30.0))
        for i, c in enumerate(lights)
    ]


def conveyor() -> list[Solid]:
    """A belt with boxes on it; one of its rollers is seized."""
    belt = Material(
        lambda p: mix((0.13, 0.13, 0.14), (0.22, 0.22, 0.23), noise(p, 8.0)),
        lambda p: 26 + 10 * bump(p, (ROLLER[0], 0.06, 0.3), 0.35),
    )
    rail = paint((0.25, 0.42, 0.62), 23.0)
    out = [box((0, 0.8, 0), (2.4, 0.06, 0.42), belt, 0.02)]
    for z in (-0.48, 0.48):
        out.append(box((0, 0.78, z), (2.45, 0.1, 0.03), rail))
    for i in range(7):
        x = -2.25 + 0.75 * i
        hot = abs(x - ROLLER[0]) < 0.1
        surface = metal(ROLLER_C if hot else 28.0, 0.6)
        out.append(bar((x, 0.62, -0.5), (x, 0.62, 0.5), 0.08, surface))
        if i % 2 == 0:
            for z in (-0.45, 0.45):
                out.append(box((x + 0.12, 0.34, z), (0.04, 0.34, 0.04), rail))
    out += electric_motor((-1.8, 0.28, 0.75), 0.5, 0.15, (0.55, 0.56, 0.58), 44.0)
    boxes = ((-1.7, 0.24, 30), (-0.7, 0.30, 24), (0.3, 0.2, 27), (1.7, 0.28, 33))
    for i, (x, half, celsius) in enumerate(boxes):
        card = Material(carton(i), float(celsius))
        out.append(box((x, 0.86 + half, 0.04 * i - 0.05), (half + 0.05, half, 0.27), card))
    return out


def carton(seed: int):
    def color(p: np.ndarray) -> np.ndarray:
        out = mix((0.60, 0.45, 0.28), (0.76, 0.60, 0.41), noise(p + seed, 5.0))
        out[np.abs(p[:, 2]) < 0.035] = (0.86, 0.80, 0.62)
        label = (np.abs(p[:, 0] - 0.05) < 0.1) & (np.abs(p[:, 1]) < 0.07)
        out[label] = (0.93, 0.93, 0.91)
        out[label & (np.sin(p[:, 0] * 260 + seed) > 0.2)] = (0.12, 0.12, 0.12)
        return out

    return color


def kiln() -> list[Solid]:
    """A turning drum on four rollers, heated from the left; a patch of its lining is gone."""

    def heat(p: np.ndarray) -> np.ndarray:
        return 68 - 11 * (p[:, 1] + 1.6) + 34 * bump(p, KILN_PATCH_LOCAL, 0.22)

    def rust(p: np.ndarray) -> np.ndarray:
        out = mix((0.42, 0.27, 0.20), (0.66, 0.50, 0.42), 0.6 * noise(p, 2.2) + 0.4 * noise(p, 9.0))
        out[np.abs((p[:, 1] + 1.6) % 0.8 - 0.4) < 0.025] *= 0.6
        return out

    drum = Material(rust, heat, 0.1, 20.0)
    rim = metal(46.0, 0.5)
    out = [
        bar((-1.9, 1.35, 0), (1.9, 1.35, 0), 0.72, drum, bevel=0.02),
        box((-2.25, 1.3, 0), (0.35, 1.3, 0.95), paint((0.62, 0.30, 0.20), 52.0), 0.03),
        box((2.25, 1.0, 0), (0.3, 1.0, 0.8), paint((0.60, 0.60, 0.58), 33.0), 0.03),
        bar((-2.25, 2.6, 0), (-2.25, 3.4, 0), 0.22, metal(64.0, 0.45)),
    ]
    for x in (-1.2, 1.2):
        out.append(bar((x - 0.09, 1.35, 0), (x + 0.09, 1.35, 0), 0.84, rim))
        out.append(box((x, 0.15, 0), (0.35, 0.15, 0.9), CONCRETE))
        for z in (-0.5, 0.5):
            out.append(bar((x - 0.12, 0.48, z), (x + 0.12, 0.48, z), 0.2, metal(32.0, 0.4)))
    return out


KILN_PATCH = (0.3, 1.6, 0.68)  # metres, the group's frame
KILN_PATCH_LOCAL = (-0.25, 0.3, 0.68)  # the drum's own: +Y lies along x, +X is down
KILN_PATCH_C = 82.0


def cooler() -> list[Solid]:
    """A dry cooler: three fans over a block of fins, cold pipes below."""

    def fins(p: np.ndarray) -> np.ndarray:
        return mix((0.55, 0.57, 0.58), (0.76, 0.78, 0.79), 0.5 + 0.5 * np.sin(p[:, 0] * 110))

    def fan(p: np.ndarray) -> np.ndarray:
        turn = np.arctan2(p[:, 2], p[:, 0])
        radius = np.hypot(p[:, 0], p[:, 2])
        out = mix((0.10, 0.11, 0.12), (0.30, 0.32, 0.34), 2 * np.sin(5 * turn + 7 * radius))
        out[radius < 0.09] = (0.85, 0.75, 0.15)
        return out

    block = Material(fins, lambda p: 12 + 6 * (p[:, 1] + 0.6), 0.15, 20.0, 0.1)
    cold = metal(8.0, 0.7)
    frost = Material(
        lambda p: mix((0.75, 0.80, 0.84), (0.96, 0.97, 0.98), noise(p, 14.0)), 7.0, 0.1
    )
    out = [box((0, 1.15, 0), (2.1, 0.6, 0.7), block)]
    for x in (-1.9, 1.9):
        for z in (-0.6, 0.6):
            out.append(box((x, 0.28, z), (0.06, 0.28, 0.06), DARK))
    for x in (-1.4, 0.0, 1.4):
        surface = Material(fan, 17.0, 0.1)
        out.append(disc((x, 1.15, 0.71), "z", 0.5, surface))
        out.append(ring((x, 1.15, 0.72), "z", 0.53, 0.05, DARK))
        out.append(ring((x, 1.15, 0.75), "z", 0.27, 0.012, metal(18.0)))
    for y in (0.35, 0.5):
        out.append(bar((-2.4, y, 0.85), (2.4, y, 0.85), 0.05, cold if y > 0.4 else frost))
    return out
