"""What is in the workshop besides pipes: bench, cabinet with its conduit, mug, tools, motor."""

from typing import Any

import numpy as np

from shapeshift.training.synthetic.pipework import AMBIENT, drip_stain
from shapeshift.training.synthetic.placing import (
    bar,
    box,
    bump,
    disc,
    frame,
    inside,
    mix,
    noise,
    ring,
    run_of_pipe,
    turned,
)
from shapeshift.training.synthetic.solids import Cuboid
from shapeshift.training.synthetic.tracer import Material, Solid

BENCH = (0.64, 0.03, 0.38)  # metres, half sizes of the top
CABINET = (-0.40, 0.165, 0.04)  # metres, its centre
SHELL = (0.11, 0.155, 0.07)  # metres, its half sizes
MOTOR = (0.27, 0.123, 0.11)  # metres, the middle of its axis
MUG = (-0.13, 0.0, 0.22)


def plank_color(p: np.ndarray) -> np.ndarray:
    plank = np.floor(p[:, 2] / 0.095)
    tone = 0.5 + 0.5 * np.sin(plank * 12.9)
    grain = noise(p * (3.0, 1.0, 30.0) + plank[:, None] * 7.7, 4.0)
    fine = noise(p * (4.0, 1.0, 60.0) + plank[:, None] * 3.1, 4.0)
    out = mix((0.58, 0.39, 0.23), (0.82, 0.61, 0.40), 0.35 * tone + 0.45 * grain + 0.2 * fine)
    gap = np.abs(p[:, 2] / 0.095 - np.round(p[:, 2] / 0.095)) < 0.018
    out[gap] *= 0.55
    return out * (1 - 0.45 * drip_stain(p)[:, None])


def plank_heat(p: np.ndarray) -> np.ndarray:
    level = p * (1, 0, 1)
    heat = AMBIENT + 4 + 1.5 * noise(p * (1.0, 1.0, 8.0), 6.0)
    heat += 9 * bump(level, (MOTOR[0], 0, MOTOR[2]), 0.11)
    heat += 14 * bump(level, (MUG[0], 0, MUG[2]), 0.04) + 12 * drip_stain(p)
    return heat + 12 * bump(level, (-0.54, 0, -0.2), 0.05)


def bench() -> list[Solid]:
    iron = Material((0.42, 0.44, 0.47), AMBIENT + 2, 0.15, 20.0)
    w, h, d = BENCH
    out = [
        box((0, -h, 0), BENCH, Material(plank_color, plank_heat, 0.08, 20.0), 0.006),
        box((0, -0.085, 0), (w - 0.05, 0.025, d - 0.05), iron, 0.006),
    ]
    for x in (-1, 1):
        for z in (-1, 1):
            foot = (x * (w - 0.09), -0.135, z * (d - 0.09))
            out.append(box(foot, (0.035, 0.03, 0.035), iron))
    return out


def front(p: np.ndarray) -> np.ndarray:
    """The door: a yellow warning triangle on grey paint."""
    out = np.tile([0.83, 0.83, 0.79], (len(p), 1))
    x, y = p[:, 0] + 0.0, p[:, 1] + 0.065
    forward = p[:, 2] > 0.004
    triangle = (y > -0.03) & (np.abs(x) < 0.036 * (1 - (y + 0.03) / 0.066))
    inner = (y > -0.024) & (np.abs(x) < 0.027 * (1 - (y + 0.024) / 0.052))
    bolt = inner & (np.abs(x + 0.25 * y) < 0.0045) & (y < 0.014)
    out[forward & triangle] = (0.10, 0.10, 0.10)
    out[forward & inner] = (0.97, 0.78, 0.10)
    out[forward & bolt] = (0.10, 0.10, 0.10)
    return out


def cabinet_heat(p: np.ndarray) -> np.ndarray:
    """Cool, a little warmer towards the top."""
    return 29 + 14 * np.clip(p[:, 1], -0.15, 0.15)


def door() -> list[Solid]:
    """In its own frame: the middle of its back face is the origin, it faces +z."""
    w, h, _ = SHELL
    black = Material((0.12, 0.12, 0.13), 33.0, 0.3, 30.0)
    out = [
        box(
            (0, 0, 0.007),
            (w - 0.006, h - 0.006, 0.007),
            Material(front, cabinet_heat, 0.15, 20.0),
            0.004,
        ),
        box((0, 0.075, 0.016), (0.062, 0.036, 0.004), black),
        box((0, 0.075, 0.0205), (0.052, 0.026, 0.001), Material(screen, 41.0, 0.2, 60.0)),
        box((w - 0.022, -0.03, 0.019), (0.006, 0.03, 0.008), black),
    ]
    for k, color in enumerate(((0.15, 0.75, 0.30), (0.98, 0.70, 0.10), (0.88, 0.15, 0.12))):
        at = (-0.045 + 0.045 * k, 0.018, 0.006)
        lamp = Material(color, 44.0, 0.5, 30.0, 0.2)
        out.append(bar(at, (at[0], at[1], 0.02), 0.0155, black))
        out.append(bar(at, (at[0], at[1], 0.026), 0.0115, lamp, bevel=0.005))
    return out


def screen(p: np.ndarray) -> np.ndarray:
    """A curve on a blue display."""
    curve = 0.008 * np.sin(p[:, 0] * 130) + 0.004 * np.sin(p[:, 0] * 47)
    out = mix((0.05, 0.16, 0.28), (0.10, 0.30, 0.44), (p[:, 1] + 0.026) / 0.052)
    out[np.abs(p[:, 1] - curve) < 0.003] = (0.55, 0.95, 0.75)
    return out


def cabinet() -> list[Solid]:
    """A control cabinet on feet."""
    paint = Material((0.77, 0.78, 0.75), cabinet_heat, 0.15, 20.0)
    w, h, d = SHELL
    feet = [
        box((x, -h - 0.005, 0), (0.02, 0.005, d - 0.01), Material((0.15, 0.15, 0.16), 22.0))
        for x in (-0.07, 0.07)
    ]
    closed = [box((0, 0, 0), (w, h, d), paint, 0.004), *inside(frame((0, 0, d)), door())]
    return inside(frame(CABINET), closed + feet)


def conduit() -> list[Solid]:
    """From the cabinet along the bench, up to the motor's terminal box."""
    rubber = Material((0.14, 0.14, 0.16), lambda p: 27 + 3 * noise(p, 12), 0.25, 20.0, 0.05)
    x, y, z = MOTOR
    corners = [
        (CABINET[0] + 0.1, 0.035, z - 0.09),
        (x - 0.245, 0.035, z - 0.09),
        (x - 0.245, 0.035, z - 0.02),
        (x - 0.245, y + 0.108, z - 0.02),
        (x - 0.04, y + 0.108, z - 0.02),
    ]
    gland = Material((0.66, 0.66, 0.68), 34.0, 0.4, 30.0, 0.3)
    return [
        *run_of_pipe(corners, 0.03, 0.011, rubber),
        bar((x - 0.064, y + 0.108, z - 0.02), (x - 0.04, y + 0.108, z - 0.02), 0.017, gland),
        bar(
            (CABINET[0] + 0.1, 0.035, z - 0.09), (CABINET[0] + 0.128, 0.035, z - 0.09), 0.017, gland
        ),
    ]


def mug() -> list[Solid]:
    """Coffee, still hot: the one hot thing that everybody knows."""
    glaze = Material((0.93, 0.90, 0.82), lambda p: 52 + 60 * p[:, 1], 0.35, 40.0, 0.12)
    stripe = Material((0.85, 0.35, 0.18), 56.0, 0.35, 40.0, 0.12)
    return inside(
        frame(MUG, turned("y", 35)),
        [
            bar((0, 0, 0), (0, 0.082, 0), 0.037, glaze, bevel=0.004),
            bar((0, 0.03, 0), (0, 0.052, 0), 0.0375, stripe),
            disc((0, 0.0826, 0), "y", 0.034, Material((0.20, 0.11, 0.06), 71.0, 0.3, 60.0, 0.15)),
            ring((0, 0.083, 0), "y", 0.0355, 0.0035, glaze),
            ring((0.04, 0.042, 0), "z", 0.023, 0.0055, glaze),
        ],
    )


CHROME = Material((0.68, 0.69, 0.72), 20.0, 0.5, 40.0, 0.45)


def screwdriver() -> list[Solid]:
    """On the front of the bench, as are the ring spanner and the oil can."""
    orange = Material((0.93, 0.45, 0.08), 31.0, 0.4, 30.0, 0.1)
    driver = [
        bar((0, 0.017, 0), (0.095, 0.017, 0), 0.0165, orange, top_radius=0.013, bevel=0.004),
        bar((0.095, 0.017, 0), (0.215, 0.015, 0), 0.0048, CHROME),
    ]
    return inside(frame((-0.02, 0, 0.305), turned("y", 12)), driver)


def spanner() -> list[Solid]:
    flat = [
        box((0, 0.007, 0), (0.085, 0.006, 0.011), CHROME),
        ring((0.1, 0.009, 0), "y", 0.018, 0.009, CHROME),
        ring((-0.1, 0.009, 0), "y", 0.021, 0.009, CHROME),
    ]
    return inside(frame((0.40, 0, 0.31), turned("y", -8)), flat)


def oil_can() -> list[Solid]:
    red = Material((0.76, 0.13, 0.10), 23.0, 0.35, 30.0, 0.15)
    can = [
        bar((0, 0, 0), (0, 0.065, 0), 0.037, red, bevel=0.004),
        bar((0, 0.065, 0), (0, 0.098, 0), 0.035, red, top_radius=0.01),
        bar((0, 0.09, 0), (0.075, 0.165, 0), 0.007, CHROME, top_radius=0.003),
        bar((0, 0.02, 0), (0, 0.045, 0), 0.0375, Material((0.95, 0.82, 0.30), 23.0)),
    ]
    return inside(frame((0.56, 0, -0.04), turned("y", 120)), can)


def base_plate() -> list[Solid]:
    """The steel plate that the motor is bolted to."""
    x, _, z = MOTOR
    plate = Material(
        (0.42, 0.43, 0.46), lambda p: 28 + 6 * bump(p, (0, 0, 0), 0.1), 0.3, 30.0, 0.25
    )
    return [box((x, 0.008, z), (0.15, 0.008, 0.115), plate)]


# The workshop's electric motor, its axis along x: closed with cooling fins, or cut open.

HOUSING = 0.088  # metres, its radius
STATOR = (0.050, 0.079)  # metres, inner and outer radius of the iron
HALF = 0.105  # metres, half the housing
FINS = 30
CUT = (-28.0, 78.0)  # degrees of the opened sector: 0 = forward (+z), 90 = up
STATOR_CUT = (-12.0, 62.0)
PAINT = (0.07, 0.36, 0.44)


def angle_of(p: np.ndarray) -> np.ndarray:
    """Degrees round the axis for points local to a bar along x: 0 forward, 90 up."""
    return np.degrees(np.arctan2(-p[:, 0], p[:, 2]))


def outside(sector: tuple[float, float], half: float = np.inf):
    """What a cut leaves: points out of the sector, or further than `half` from the middle."""

    def keep(p: np.ndarray) -> np.ndarray:
        angle = angle_of(p)
        return ~((angle > sector[0]) & (angle < sector[1]) & (np.abs(p[:, 1]) < half))

    return keep


def body_heat(p: np.ndarray) -> np.ndarray:
    """The core warms the housing, most towards the drive end (local +Y), whose bearing is dry."""
    return 60 + 90 * p[:, 1] + 5 * noise(p, 30)


def painted(celsius: Any, color: Any = PAINT) -> Material:
    return Material(color, celsius, 0.25, 25.0, 0.12)


def sector_plate(degrees: float, low: float, high: float, half: float, surface: Material) -> Solid:
    """The flat face of a cut: a thin plate from radius low to high at that angle."""
    a = np.deg2rad(degrees)
    spoke = np.array([0.0, np.sin(a), np.cos(a)])
    rotation = np.stack([(1.0, 0, 0), spoke, np.cross((1.0, 0, 0), spoke)], axis=1)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, spoke * (low + high) / 2
    return Solid(Cuboid((half, (high - low) / 2, 0.001)), surface, frame)


def fins(opened: bool) -> list[Solid]:
    out = []
    for k in range(FINS):
        degrees = 360 * (k + 0.5) / FINS - 180
        if 236 < degrees % 360 < 304:
            continue  # the feet are there
        if 62 < degrees % 360 < 118:
            continue  # and the terminal box
        if opened and CUT[0] - 4 < degrees < CUT[1] + 4:
            continue
        surface = painted(lambda p: 55 + 80 * p[:, 0] - 350 * p[:, 1])
        out.append(sector_plate(degrees, HOUSING - 0.004, HOUSING + 0.019, HALF - 0.008, surface))
        out[-1] = Solid(
            Cuboid((HALF - 0.008, 0.0115, 0.0032), 0.0015), surface, out[-1].world_from_local
        )
    return out


def housing(opened: bool) -> list[Solid]:
    surface = painted(body_heat)
    if not opened:
        return [bar((-HALF, 0, 0), (HALF, 0, 0), HOUSING, surface)]
    inner = Material((0.30, 0.33, 0.35), lambda p: 66 + 0 * p[:, 0])
    edge = Material((0.62, 0.64, 0.66), 64.0, 0.3, 30.0, 0.3)
    keep = outside(CUT, HALF - 0.012)
    out = [
        bar((-HALF, 0, 0), (HALF, 0, 0), HOUSING, surface, capped=False, keep=keep),
        bar((-HALF, 0, 0), (HALF, 0, 0), HOUSING - 0.005, inner, capped=False, keep=keep),
    ]
    out += [sector_plate(a, HOUSING - 0.005, HOUSING, HALF - 0.012, edge) for a in CUT]
    return out


def stator() -> list[Solid]:
    """Laminated iron round copper end windings."""

    def sheets(p: np.ndarray) -> np.ndarray:
        return mix((0.34, 0.34, 0.36), (0.52, 0.52, 0.54), 0.5 + 0.5 * np.sin(p[:, 1] * 700))

    def copper(p: np.ndarray) -> np.ndarray:
        turn = np.arctan2(p[:, 2], p[:, 0])
        return mix((0.55, 0.24, 0.10), (0.93, 0.55, 0.28), 0.5 + 0.5 * np.sin(36 * turn))

    iron = Material(sheets, 72.0, 0.2, 30.0, 0.2)
    cut_iron = Material((0.55, 0.55, 0.57), 74.0, 0.3, 30.0, 0.25)
    low, high, half = *STATOR, 0.062
    keep = outside(STATOR_CUT)
    out = [
        bar((-half, 0, 0), (half, 0, 0), high, iron, capped=False, keep=keep),
        bar((-half, 0, 0), (half, 0, 0), low, iron, capped=False, keep=keep),
    ]

    def face(p: np.ndarray) -> np.ndarray:
        angle = np.degrees(np.arctan2(-p[:, 0], p[:, 2]))
        inside = (angle > STATOR_CUT[0]) & (angle < STATOR_CUT[1])
        return (np.hypot(p[:, 0], p[:, 2]) > low) & ~inside

    out += [disc((x, 0, 0), "x", high, iron, keep=face) for x in (-half, half)]
    out += [sector_plate(a, low, high, half, cut_iron) for a in STATOR_CUT]
    wire = Material(copper, 84.0, 0.4, 25.0, 0.2)
    out += [ring((x, 0, 0), "x", 0.063, 0.0155, wire) for x in (-0.079, 0.079)]
    # Coils seen in the slots of the cut faces.
    for a in STATOR_CUT:
        for r in (0.056, 0.066):
            spoke = (r * np.sin(np.deg2rad(a)), r * np.cos(np.deg2rad(a)))
            out.append(bar((-half, *spoke), (half, *spoke), 0.0042, wire))
    return out


def rotor() -> list[Solid]:
    def skewed_bars(p: np.ndarray) -> np.ndarray:
        turn = np.arctan2(p[:, 2], p[:, 0])
        wave = np.sin(18 * turn + 16 * p[:, 1])
        return mix((0.36, 0.37, 0.40), (0.80, 0.81, 0.83), (wave - 0.3) * 3)

    core = Material(skewed_bars, 80.0, 0.4, 40.0, 0.3)
    aluminium = Material((0.80, 0.81, 0.83), 82.0, 0.4, 40.0, 0.35)
    return [
        bar((-0.07, 0, 0), (0.07, 0, 0), 0.046, core),
        bar((-0.082, 0, 0), (-0.07, 0, 0), 0.042, aluminium),
        bar((0.07, 0, 0), (0.082, 0, 0), 0.042, aluminium),
        bar((-HALF, 0, 0), (HALF, 0, 0), 0.014, Material((0.7, 0.7, 0.73), 74.0, 0.5, 40.0, 0.4)),
    ]


def ends() -> list[Solid]:
    """The cowl of the fan at -x, the drive end with a dry, hot bearing at +x, a flywheel."""

    def grille(p: np.ndarray) -> np.ndarray:
        radius = np.hypot(p[:, 0], p[:, 2])
        slots = (p[:, 1] < -0.027) & (np.sin(radius * 480) > 0.1) & (radius > 0.012)
        return np.where((slots & (radius < 0.075))[:, None], (0.05, 0.06, 0.07), PAINT)

    cowl = painted(lambda p: 36 + 120 * (p[:, 1] + 0.03), grille)
    bell = painted(lambda p: 66 + 300 * p[:, 1])
    bearing = Material((0.55, 0.55, 0.57), 93.0, 0.4, 40.0, 0.3)
    shaft = Material((0.74, 0.74, 0.77), lambda p: 74 - 320 * (p[:, 1] + 0.03), 0.5, 40.0, 0.4)

    def wheel(p: np.ndarray) -> np.ndarray:
        radius = np.hypot(p[:, 0], p[:, 2])
        return mix((0.30, 0.31, 0.34), (0.58, 0.58, 0.60), (radius - 0.04) * 90)

    flywheel = Material(wheel, lambda p: 46 - 250 * np.hypot(p[:, 0], p[:, 2]), 0.35, 40.0, 0.3)
    return [
        bar((-HALF - 0.06, 0, 0), (-HALF, 0, 0), HOUSING + 0.006, cowl, bevel=0.006),
        bar((HALF, 0, 0), (HALF + 0.03, 0, 0), HOUSING, bell, top_radius=0.055),
        bar((HALF + 0.03, 0, 0), (HALF + 0.038, 0, 0), 0.03, bearing),
        bar((HALF + 0.03, 0, 0), (HALF + 0.1, 0, 0), 0.012, shaft),
        bar((HALF + 0.06, 0, 0), (HALF + 0.085, 0, 0), 0.062, flywheel, bevel=0.004),
        ring((HALF + 0.0725, 0, 0), "x", 0.061, 0.007, flywheel),
    ]


def feet_and_terminals() -> list[Solid]:
    paint = painted(40.0)
    out = []
    for x in (-0.07, 0.07):
        out.append(box((x, -0.095, 0), (0.022, 0.012, 0.085), paint))
        out.append(box((x, -0.08, 0), (0.018, 0.02, 0.05), paint))
        for z in (-0.07, 0.07):
            bolt = Material((0.7, 0.7, 0.72), 34.0, 0.4, 30.0)
            out.append(bar((x, -0.085, z), (x, -0.075, z), 0.009, bolt))
    lid = painted(42.0, (0.09, 0.42, 0.50))
    out += [
        box((0, 0.108, -0.02), (0.05, 0.026, 0.042), painted(46.0)),
        box((0, 0.137, -0.02), (0.053, 0.005, 0.045), lid),
        box((0.0, 0.112, 0.0232), (0.032, 0.012, 0.001), Material((0.80, 0.79, 0.72), 42.0)),
    ]
    return out


def motor(opened: bool) -> list[Solid]:
    """In its own frame: the axis is x, the feet stand 0.107 m below it."""
    inner = stator() + rotor() if opened else []
    return housing(opened) + fins(opened) + ends() + feet_and_terminals() + inner
