"""The workshop's hot line: pipe, insulation over a leaking flange, valve with handwheel, gauge."""

import numpy as np

from shapeshift.training.synthetic.placing import (
    ALONG,
    ball,
    bar,
    bolt_circle,
    box,
    bump,
    disc,
    mix,
    noise,
    ring,
    run_of_pipe,
)
from shapeshift.training.synthetic.tracer import Material, Solid

LINE_Y, LINE_Z = 0.19, -0.2  # metres; the axis of the line
PIPE = 0.024  # metres, radius
LAGGING = 0.05  # metres, radius of the insulation
LAGGED = (-0.43, -0.05)  # metres along x
LEAK = -0.24  # metres along x: the flange whose joint leaks, hidden inside the insulation
VALVE = 0.11
GAUGE = 0.31
AMBIENT = 22.0  # °C
MEDIUM = 92.0  # °C, what flows in the pipe


def steel(celsius, tone: float = 0.5) -> Material:
    return Material((tone, tone * 1.01, tone * 1.04), celsius, 0.35, 40.0, 0.45)


def line() -> list[Solid]:
    """The pipe from the bench up, along, and down again; it cools behind the valve."""
    left = [(-0.54, 0, LINE_Z), (-0.54, LINE_Y, LINE_Z), (VALVE, LINE_Y, LINE_Z)]
    right = [(VALVE, LINE_Y, LINE_Z), (0.48, LINE_Y, LINE_Z), (0.48, 0, LINE_Z)]
    out = run_of_pipe(left, 0.06, PIPE, steel(MEDIUM - 4))
    out += run_of_pipe(right, 0.06, PIPE, steel(62.0))
    feet = []
    for x, heat in ((-0.54, 70.0), (0.48, 50.0)):
        feet += [bar((x, 0, LINE_Z), (x, 0.016, LINE_Z), 0.052, steel(heat, 0.36))]
        feet += bolt_circle((x, 0.014, LINE_Z), "y", 0.04, 6, steel(heat - 8, 0.62))
    posts = []
    for x, heat in ((-0.46, 48.0), (0.24, 38.0)):
        posts += [
            box((x, 0.08, LINE_Z), (0.009, 0.08, 0.02), Material((0.22, 0.24, 0.27), 30.0)),
            box((x, 0.006, LINE_Z), (0.024, 0.006, 0.045), Material((0.22, 0.24, 0.27), 26.0)),
            bar(
                (x - 0.011, LINE_Y, LINE_Z),
                (x + 0.011, LINE_Y, LINE_Z),
                0.031,
                Material((0.22, 0.24, 0.27), heat),
            ),
        ]
    return out + feet + posts


def flange_pair(x: float, heat: float, gasket: tuple, tone: float = 0.42) -> list[Solid]:
    def plate(a: float, b: float, radius: float, surface: Material) -> Solid:
        return bar((x + a, LINE_Y, LINE_Z), (x + b, LINE_Y, LINE_Z), radius, surface)

    return [
        plate(-0.016, -0.003, 0.045, steel(heat, tone)),
        plate(0.003, 0.016, 0.045, steel(heat, tone)),
        plate(-0.003, 0.003, 0.042, Material(gasket, heat + 3)),
        *bolt_circle((x, LINE_Y, LINE_Z), "x", 0.036, 6, steel(heat - 5, 0.66)),
        bar((x - 0.026, LINE_Y, LINE_Z), (x + 0.026, LINE_Y, LINE_Z), 0.029, steel(heat, tone)),
    ]


def insulation() -> list[Solid]:
    """Cladding sheets with bands; warm everywhere, hot where the joint inside leaks."""
    middle = (LAGGED[0] + LAGGED[1]) / 2

    def heat(p: np.ndarray) -> np.ndarray:
        # Local +Y is world x; local x is minus world y: steam rises, the top is warmer.
        along, down = p[:, 1] + middle - LEAK, p[:, 0]
        leak = np.exp(-((along / 0.035) ** 2)) * (0.75 - 5 * down)
        return 31 + 3 * noise(p, 40) + 46 * leak

    def cladding(p: np.ndarray) -> np.ndarray:
        dents = noise(p, 60)
        seam = np.abs(p[:, 2]) < 0.004
        out = mix((0.72, 0.71, 0.68), (0.86, 0.85, 0.81), dents)
        # A red arrow band says that the medium is hot.
        out[np.abs(p[:, 1] - 0.105) < 0.018] = (0.75, 0.16, 0.10)
        out[seam & (p[:, 0] < 0)] *= 0.6
        return out

    jacket = Material(cladding, heat, 0.25, 25.0, 0.3)
    a, b = LAGGED
    out = [bar((a, LINE_Y, LINE_Z), (b, LINE_Y, LINE_Z), LAGGING, jacket, bevel=0.006)]
    band = Material((0.50, 0.51, 0.53), heat_of_band, 0.4, 40.0, 0.4)
    for x in (a + 0.02, -0.335, -0.145, b - 0.02):
        out.append(
            bar((x - 0.007, LINE_Y, LINE_Z), (x + 0.007, LINE_Y, LINE_Z), LAGGING + 0.003, band)
        )
    for x in (a, b):
        out.append(
            disc((x, LINE_Y, LINE_Z), "x", LAGGING - 0.004, Material((0.85, 0.72, 0.35), 44.0))
        )
    return out


def heat_of_band(p: np.ndarray) -> np.ndarray:
    return 30 + 2 * noise(p, 30)


def valve() -> list[Solid]:
    """A globe valve of brass; its red handwheel stays cool, the stem is warm at its foot."""
    brass = Material((0.78, 0.60, 0.24), lambda p: 76 - 60 * p[:, 1], 0.45, 35.0, 0.35)
    red = Material((0.78, 0.12, 0.10), 34.0, 0.35, 30.0, 0.1)

    def stem_heat(p: np.ndarray) -> np.ndarray:
        return 52 - 130 * (p[:, 1] + 0.02)

    middle = (VALVE, LINE_Y, LINE_Z)
    top = LINE_Y + 0.17
    out = [ball(middle, 0.047, brass)]
    for side in (-1, 1):
        x = VALVE + side * 0.06
        out.append(bar((x - 0.008, LINE_Y, LINE_Z), (x + 0.008, LINE_Y, LINE_Z), 0.045, brass))
        out += bolt_circle((x, LINE_Y, LINE_Z), "x", 0.036, 6, steel(66.0, 0.62))
        hub = bar((VALVE, LINE_Y, LINE_Z), (x, LINE_Y, LINE_Z), 0.034, brass)
        out.append(hub)
    x, z = VALVE, LINE_Z
    out += [
        bar((x, LINE_Y + 0.03, z), (x, LINE_Y + 0.075, z), 0.03, brass, top_radius=0.022),
        bar((x, LINE_Y + 0.072, z), (x, LINE_Y + 0.086, z), 0.03, brass),
        bar((x, LINE_Y + 0.086, z), (x, LINE_Y + 0.11, z), 0.017, brass),
        bar(
            (x, LINE_Y + 0.1, z), (x, top + 0.018, z), 0.008, Material((0.6, 0.6, 0.62), stem_heat)
        ),
        ring((x, top, z), "y", 0.076, 0.009, red),
        bar((x, top - 0.009, z), (x, top + 0.01, z), 0.019, red),
    ]
    for k in range(5):
        way = ALONG["y"] @ np.array(
            [np.cos(2 * np.pi * k / 5 + 0.3), 0, np.sin(2 * np.pi * k / 5 + 0.3)]
        )
        wheel = np.array((x, top, z))
        out.append(bar(wheel + 0.012 * way, wheel + 0.072 * way, 0.006, red))
    return out


def dial(p: np.ndarray) -> np.ndarray:
    """The face of the gauge; local x, z in its plane, the needle at two thirds."""
    right, up = p[:, 0], -p[:, 2]
    radius, angle = np.hypot(right, up), np.degrees(np.arctan2(right, up))
    out = np.tile([0.93, 0.92, 0.87], (len(p), 1))
    scale = (radius > 0.029) & (radius < 0.038) & (np.abs(angle) < 130)
    out[scale & (np.abs((angle + 130) % 26 - 13) > 9)] = (0.12, 0.12, 0.12)
    out[scale & (angle > 78)] = (0.82, 0.15, 0.10)
    turned = np.deg2rad(55)
    along = right * np.sin(turned) + up * np.cos(turned)
    across = right * np.cos(turned) - up * np.sin(turned)
    out[(along > -0.008) & (along < 0.031) & (np.abs(across) < 0.003)] = (0.10, 0.10, 0.12)
    return out


def gauge() -> list[Solid]:
    """A dial on a short branch, looking forward."""
    black = Material((0.13, 0.13, 0.15), 33.0, 0.3, 30.0, 0.1)
    y = LINE_Y + 0.13
    front = LINE_Z + 0.022
    return [
        bar((GAUGE, LINE_Y, LINE_Z), (GAUGE, y - 0.03, LINE_Z), 0.012, steel(50.0)),
        bar((GAUGE, LINE_Y + 0.02, LINE_Z), (GAUGE, LINE_Y + 0.038, LINE_Z), 0.019, steel(56.0)),
        bar((GAUGE, y, LINE_Z - 0.02), (GAUGE, y, front), 0.05, black),
        disc((GAUGE, y, front + 0.001), "z", 0.044, Material(dial, 31.0, 0.15, 60.0)),
        ring(
            (GAUGE, y, front), "z", 0.047, 0.005, Material((0.72, 0.6, 0.3), 31.0, 0.5, 40.0, 0.3)
        ),
    ]


def return_line() -> list[Solid]:
    """A thin copper pipe low behind everything, lukewarm."""
    copper = Material((0.76, 0.42, 0.27), lambda p: 40 + 4 * noise(p, 8), 0.4, 35.0, 0.3)
    corners = [
        (-0.42, 0.0, -0.31),
        (-0.42, 0.07, -0.31),
        (0.36, 0.07, -0.31),
        (0.36, 0.0, -0.31),
    ]
    out = run_of_pipe(corners, 0.035, 0.012, copper)
    for x in (-0.2, 0.12):
        clip = Material((0.22, 0.24, 0.27), 28.0)
        out.append(box((x, 0.035, -0.31), (0.006, 0.035, 0.008), clip))
        out.append(bar((x - 0.008, 0.07, -0.31), (x + 0.008, 0.07, -0.31), 0.017, clip))
    return out


def drip_stain(p: np.ndarray) -> np.ndarray:
    """(n,) 0..1 on the bench under the leak, in bench coordinates."""
    return bump(p * (1, 0, 1), (LEAK, 0, LINE_Z + 0.01), 0.045)


def joint(opened: bool) -> list[Solid]:
    """Where the pipe leaks: bare flanges, or the insulation round them."""
    return flange_pair(LEAK, MEDIUM, (0.86, 0.42, 0.10)) if opened else insulation()
