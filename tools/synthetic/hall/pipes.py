"""Pipes, duct and cable trays that tie the hall's machine groups together, in the hall's frame."""

import numpy as np

from shapeshift.training.synthetic.placing import ball, bar, box, mix, noise, ring, run_of_pipe
from shapeshift.training.synthetic.tracer import Material, Solid
from tools.synthetic.hall.building import HALF_X, HALF_Z, INDOORS
from tools.synthetic.hall.machines import DARK, metal

TRAP, TRAP_C = (8.4, 1.0, -8.9), 94.0  # a steam trap that no longer closes
LEAK, LEAK_C = (-8.2, 4.7, -8.9), 80.0  # a flange under the steam line's lagging


def lagging(p: np.ndarray) -> np.ndarray:
    out = mix((0.68, 0.69, 0.70), (0.86, 0.87, 0.88), noise(p, 6.0))
    out[np.abs(p[:, 1] - np.round(p[:, 1])) < 0.02] *= 0.6
    return out


def steam_heat(p: np.ndarray) -> np.ndarray:
    """Of a bar along x about 0: the lagging is warm, and hot over the leak."""
    leak = np.exp(-(((p[:, 1] - LEAK[0]) / 0.35) ** 2))
    return 36 + 2 * noise(p, 1.5) + (LEAK_C - 37) * leak


def long_pipes() -> list[Solid]:
    """Steam, water there and back on brackets along the wall at -z."""
    first, last = -HALF_X + 2, HALF_X - 2
    out = [
        bar(
            (first, 4.7, -8.9),
            (last, 4.7, -8.9),
            0.2,
            Material(lagging, steam_heat, 0.2, 25.0, 0.2),
        ),
        bar((first, 4.2, -9.2), (last, 4.2, -9.2), 0.11, Material((0.14, 0.42, 0.25), 46.0, 0.2)),
        bar((first, 4.2, -9.6), (last, 4.2, -9.6), 0.11, Material((0.16, 0.32, 0.58), 17.0, 0.2)),
    ]
    for x in np.linspace(first + 1.5, last - 1.5, 8):
        out.append(box((float(x), 4.0, -9.8), (0.05, 0.06, 1.1), DARK))
        out.append(box((float(x), 4.25, -8.9), (0.04, 0.25, 0.04), DARK))
    return out


def drops() -> list[Solid]:
    """From the rack down to the groups of the back row, the trap, and over to the other rows."""
    steam = metal(88.0, 0.5)
    green = Material((0.14, 0.42, 0.25), 45.0, 0.2)
    out = run_of_pipe([(3.2, 3.0, -7.2), (3.2, 4.7, -7.2), (3.2, 4.7, -8.7)], 0.3, 0.1, steam)
    out += run_of_pipe(
        [(-5.4, 2.6, -7.2), (-5.4, 4.7, -7.2), (-5.4, 4.7, -8.7)], 0.3, 0.1, metal(74.0, 0.5)
    )
    out += run_of_pipe([(13.8, 0.82, -8.2), (13.8, 4.2, -8.2), (13.8, 4.2, -9.1)], 0.3, 0.1, green)
    out += run_of_pipe(
        [(8.4, 4.6, -8.9), (8.4, 0.4, -8.9), (6.6, 0.4, -8.9)], 0.25, 0.06, metal(62.0)
    )
    out += [
        box(TRAP, (0.1, 0.14, 0.1), metal(TRAP_C, 0.42)),
        bar((8.4, 1.14, -8.9), (8.4, 1.24, -8.9), 0.11, metal(TRAP_C - 8, 0.5)),
        ball((8.4, 2.1, -8.9), 0.13, metal(70.0, 0.45)),
        ring((8.4, 2.1, -8.55), "z", 0.15, 0.02, Material((0.78, 0.10, 0.08), 32.0, 0.3)),
        bar((8.4, 2.1, -8.9), (8.4, 2.1, -8.55), 0.025, metal(52.0)),
    ]
    # Compressed air and cooling water cross the hall under the crane.
    air = Material((0.35, 0.55, 0.75), 31.0, 0.2)
    up, over = (-10.9, 5.6, 0.0), (-10.9, 5.6, 9.8)
    corners = [(-10.9, 3.0, 0.0), up, over, (12.0, 5.6, 9.8), (12.0, 3.0, 9.8)]
    out += run_of_pipe(corners, 0.3, 0.06, air)
    out += run_of_pipe(
        [(4.2, 0.6, 9.3), (0.9, 0.6, 9.3), (0.9, 6.2, 9.3), (0.9, 6.2, -9.3), (0.9, 4.4, -9.3)],
        0.3, 0.08, metal(11.0, 0.6),
    )  # fmt: skip
    return out


def duct_and_trays() -> list[Solid]:
    """The ventilation duct with its outlets along +z, trays for cables along the middle."""

    def sheet(p: np.ndarray) -> np.ndarray:
        out = mix((0.70, 0.72, 0.73), (0.84, 0.85, 0.86), noise(p, 1.5))
        out[np.abs(p[:, 0] / 1.5 - np.round(p[:, 0] / 1.5)) < 0.02] *= 0.6
        return out

    duct = Material(sheet, lambda p: 27 - 0.2 * p[:, 0], 0.2, 25.0, 0.2)
    out = [box((0, 7.0, 8.8), (HALF_X - 1.5, 0.4, 0.5), duct, 0.02)]
    for x in np.linspace(-13, 13, 7):
        out.append(box((float(x), 6.55, 8.8), (0.4, 0.1, 0.3), Material((0.30, 0.31, 0.32), 28.0)))
    tray = Material((0.56, 0.57, 0.57), INDOORS + 2)
    cable = Material((0.10, 0.10, 0.11), INDOORS + 5)
    out.append(box((0, 5.1, 5.4), (HALF_X - 1.5, 0.03, 0.25), tray))
    for z in (5.25, 5.35, 5.5):
        out.append(bar((-HALF_X + 1.5, 5.16, z), (HALF_X - 1.5, 5.16, z), 0.035, cable))
    for x in np.linspace(-12.5, 12.5, 4):
        out.append(bar((float(x), 5.1, 5.4), (float(x), 9.0, 5.4), 0.02, tray))
        out.append(box((float(x), 3.6, 5.4), (0.12, 1.5, 0.03), tray))
    return out


def signs() -> list[Solid]:
    """Fire extinguishers, notice boards and doors along the walls at both ends."""
    red = Material((0.80, 0.10, 0.08), INDOORS, 0.3, 30.0)
    out = []
    for x in (-12.75, -4.25, 4.25, 12.75):
        out.append(bar((x, 0.9, -HALF_Z + 0.15), (x, 1.4, -HALF_Z + 0.15), 0.09, red))
        board = Material(notices, INDOORS - 1)
        out.append(box((x + 0.9, 1.7, -HALF_Z + 0.03), (0.5, 0.35, 0.03), board))
    door = Material((0.30, 0.36, 0.44), INDOORS - 2)
    for z in (-6.5, 6.5):
        out.append(box((HALF_X - 0.04, 1.1, z), (0.05, 1.1, 0.5), door))
        out.append(
            box((HALF_X - 0.04, 2.45, z), (0.04, 0.12, 0.3), Material((0.1, 0.6, 0.3), 24.0))
        )
    return out


def notices(p: np.ndarray) -> np.ndarray:
    out = np.tile([0.55, 0.42, 0.26], (len(p), 1))
    sheet = (np.abs(p[:, 0] % 0.25 - 0.125) < 0.1) & (np.abs(p[:, 1] % 0.33 - 0.165) < 0.14)
    out[sheet] = (0.95, 0.95, 0.92)
    out[sheet & (np.sin(p[:, 1] * 180) > 0.5)] = (0.35, 0.36, 0.4)
    return out


def pipes() -> list[Solid]:
    return long_pipes() + drops() + duct_and_trays() + signs()
