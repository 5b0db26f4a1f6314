"""A place that is visited twice: the demo's workshop ray-traced as it is, and after six changes.

Imported by tools/inspection/change.py.  Three changes of geometry (the mug is moved, a tool box
appeared, the oil can vanished) and three of heat (the gauge, a corner of the cabinet's door and the
fan's cowl are hotter).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import make_folders
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import Pose
from shapeshift.training.synthetic.balls import save_png
from shapeshift.training.synthetic.placing import box, bump
from shapeshift.training.synthetic.things import MOTOR, MUG
from shapeshift.training.synthetic.tracer import (
    Material,
    Solid,
    color_of,
    photograph,
    surface_points,
)
from shapeshift.training.synthetic.workshop import (
    GREY,
    STOPS,
    dome,
    placed,
    radiance_of,
    things,
)

VIEWS, TEST_VIEWS = 40, 4  # photos of each stop
SIZE = (160, 120)
MUG_MOVED = np.array([-0.23, 0.0, 0.05])  # metres
TOOL_BOX = (-0.12, 0.036, -0.085)  # metres, its centre
TOOL_BOX_HALF = (0.05, 0.035, 0.03)
OIL_CAN = (0.56, 0.07, -0.04)
GAUGE = (0.31, 0.32, -0.18)
DOOR = (-0.34, 0.09, 0.12)  # metres: the warm corner
COWL = (MOTOR[0] - 0.135, MOTOR[1], MOTOR[2])
STOPS_OF_A_VISIT = tuple(replace(stop, x=float(i)) for i, stop in enumerate(STOPS[:2]))


@dataclass(frozen=True)
class Planted:
    """What was changed, and about where: the centre of what is seen of it, metres."""

    kind: str
    place: tuple[float, float, float]
    reach_m: float  # what is found lies so near to it


PLANTED = (
    Planted("moved", tuple(np.add(MUG, MUG_MOVED) + np.array([0, 0.04, 0])), 0.06),
    Planted("appeared", TOOL_BOX, 0.06),
    Planted("vanished", OIL_CAN, 0.08),
    Planted("hotter", GAUGE, 0.06),
    Planted("hotter", DOOR, 0.08),
    Planted("hotter", COWL, 0.11),
)


def warmer(solid: Solid, heat: Callable[[np.ndarray], np.ndarray]) -> Solid:
    """A solid with degrees added, heat: world points (n, 3) -> (n,) °C."""
    before, world_from_local = solid.surface.celsius, solid.world_from_local

    def celsius(p: np.ndarray) -> np.ndarray:
        base = before(p) if callable(before) else np.full(len(p), before)
        return base + heat(p @ world_from_local[:3, :3].T + world_from_local[:3, 3])

    return replace(solid, surface=replace(solid.surface, celsius=celsius))


WARMED: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "gauge": lambda p: np.full(len(p), 22.0),
    "cabinet": lambda p: 30 * bump(p, DOOR, 0.035),
    "motor": lambda p: 20.0 * (p[:, 0] < MOTOR[0] - 0.105),
}


def solids_of(changed: bool) -> list[Solid]:
    out = []
    for name, solids in things(opened=False):
        if changed and name == "can":
            continue
        if changed and name == "mug":
            move = np.eye(4)
            move[:3, 3] = MUG_MOVED
            solids = [replace(s, world_from_local=move @ s.world_from_local) for s in solids]
        if changed and name in WARMED:
            solids = [warmer(s, WARMED[name]) for s in solids]
        out += solids
    if changed:
        blue = Material((0.16, 0.30, 0.70), 22.0, 0.2, 25.0)
        out.append(box(TOOL_BOX, TOOL_BOX_HALF, blue, 0.004))
    return out


def true_warming(points: np.ndarray) -> np.ndarray:
    """(n,) °C by which the surface next to world points (n, 3) got hotter, before its slant."""
    solids = [(s, name) for name, of_it in things(opened=False) for s in of_it]
    away = np.stack([np.abs(solid.distance(points)) for solid, _ in solids])  # (solids, n)
    nearest = np.argmin(away, axis=0)
    out = np.zeros(len(points))
    for i in np.unique(nearest):
        if (heat := WARMED.get(solids[i][1])) is not None:
            out[nearest == i] = heat(points[nearest == i])
    return out


def make_visit(
    folder: Path, changed: bool, turn: float, size=SIZE, views: int = VIEWS,
    world_from_workshop: Pose | None = None,
) -> Capture:  # fmt: skip
    """Writes the capture of one visit.

    turn: of the golden angle's sequence: other photos.  world_from_workshop: what the capture calls
    its world; None: the workshop's own.
    """
    here, clearance = placed(solids_of(changed))
    moved = np.eye(4) if world_from_workshop is None else world_from_workshop.matrix()
    photos = []
    for number, stop in enumerate(STOPS_OF_A_VISIT):
        name = stop.name.lower()
        make_folders(folder, name)
        shots = [("train", v) for v in dome(views, turn + number / 3, size)]
        shots += [("test", v) for v in dome(TEST_VIEWS, turn + number / 3 + 0.17, size)]
        for i, (split, view) in enumerate(shots):
            image, _ = photograph(view, radiance_of(here, clearance, stop.kind == "thermal"))
            path = folder / name / f"{split}_{i:03}.png"
            save_png(path, image)
            pose = Pose.from_matrix(moved @ view.world_from_eye.matrix())
            photos.append(Photo(replace(view, world_from_eye=pose), path, stop.name, None, split))
    points, solids = surface_points(here, dome(24, turn + 0.4, size), 20000, 0.0015)
    colors = color_of(here, points, solids)
    points = points @ moved[:3, :3].T + moved[:3, 3]
    capture = Capture(
        folder, STOPS_OF_A_VISIT, tuple(photos), points.astype(np.float32),
        colors.astype(np.float32), (GREY, GREY, GREY), {"source": "ray-traced: a visit"},
    )  # fmt: skip
    write_capture(capture)
    return capture
