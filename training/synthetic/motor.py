"""The workshop's electric motor, its axis along x: closed with cooling fins, or cut open."""

from typing import Any

import numpy as np

from shapeshift.training.synthetic.placing import bar, box, disc, mix, noise, ring
from shapeshift.training.synthetic.solids import Cuboid
from shapeshift.training.synthetic.tracer import Material, Solid

SHELL = 0.088  # metres, radius of the housing
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
        out.append(sector_plate(degrees, SHELL - 0.004, SHELL + 0.019, HALF - 0.008, surface))
        out[-1] = Solid(
            Cuboid((HALF - 0.008, 0.0115, 0.0032), 0.0015), surface, out[-1].world_from_local
        )
    return out


def housing(opened: bool) -> list[Solid]:
    surface = painted(body_heat)
    if not opened:
        return [bar((-HALF, 0, 0), (HALF, 0, 0), SHELL, surface)]
    inner = Material((0.30, 0.33, 0.35), lambda p: 66 + 0 * p[:, 0])
    edge = Material((0.62, 0.64, 0.66), 64.0, 0.3, 30.0, 0.3)
    keep = outside(CUT, HALF - 0.012)
    out = [
        bar((-HALF, 0, 0), (HALF, 0, 0), SHELL, surface, capped=False, keep=keep),
        bar((-HALF, 0, 0), (HALF, 0, 0), SHELL - 0.005, inner, capped=False, keep=keep),
    ]
    out += [sector_plate(a, SHELL - 0.005, SHELL, HALF - 0.012, edge) for a in CUT]
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
        bar((-HALF - 0.06, 0, 0), (-HALF, 0, 0), SHELL + 0.006, cowl, bevel=0.006),
        bar((HALF, 0, 0), (HALF + 0.03, 0, 0), SHELL, bell, top_radius=0.055),
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
