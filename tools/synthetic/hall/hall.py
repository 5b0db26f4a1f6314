"""A plant hall of 34 x 22 metres, ray-traced: RGB and thermal photos along a walk, with hot faults.

Twelve machine groups in three rows, pipes between them, and windows, skylights and a gate to an
outside without an end.  No masks: everything that a photo shows is the scene.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import make_folders
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.training.synthetic.placing import Clearance, frame, inside, turned
from shapeshift.training.synthetic.tracer import (
    Light,
    Place,
    Solid,
    color_of,
    look,
    pattern_at,
    shade,
    surface_points,
)
from shapeshift.training.synthetic.workshop import Radiance, write_photos
from tools.synthetic.hall import machines, pipes, vessels
from tools.synthetic.hall.building import HALF_X, HALF_Z, HEIGHT, building

COLD, HOT = 5.0, 105.0  # °C that thermal intensity 0 and 1 stand for
STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 1.0, "thermal", "ironbow", (COLD, HOT), "°C"),
)
LIGHT = Light(
    towards=(0.35, 0.75, 0.56),  # in by the windows at +z and the skylights
    key=(0.62, 0.58, 0.50),
    sky=(0.58, 0.60, 0.64),
    ground=(0.40, 0.39, 0.37),
    in_shadow=0.35,
    spread=0.0,
)
HORIZON, ZENITH = (0.86, 0.90, 0.94), (0.42, 0.60, 0.86)  # of the sky, display sRGB
FOV_X = np.deg2rad(72)
RIG = 0.06  # metres from the RGB camera to the thermal one
SIDE_STEP = 3.5  # metres: |z| of the two walkways
WALK_X = 15.0  # metres: where the walk turns
ROWS = (-7.2, 0.0, 7.2)  # metres, z
COLUMNS = (-12.5, -4.2, 4.2, 12.5)  # metres, x
LARGE = 6  # solids of the building that come first: floor, walls, roof
GROUPS = (
    (vessels.tanks, vessels.exchanger, vessels.boiler, machines.pumps),
    (machines.compressor, machines.kiln, machines.conveyor, machines.lathe),
    (vessels.switchgear, vessels.transformer, machines.cooler, vessels.store),
)


@dataclass(frozen=True)
class Fault:
    """Something hot that should not be: its place in the world, and how hot it gets."""

    name: str
    place: tuple[float, float, float]  # metres
    celsius: float


def world_from_group(name: str) -> np.ndarray:
    """(4, 4) of a group by its function's name; the row at +z is turned to face the walkway."""
    for row, groups in enumerate(GROUPS):
        for column, group in enumerate(groups):
            if group.__name__ == name:
                turn = turned("y", 180.0) if row == 2 else None
                return frame((COLUMNS[column], 0.0, ROWS[row]), turn)
    raise KeyError(name)


def faults() -> tuple[Fault, ...]:
    of_groups = (
        ("dry bearing", "pumps", machines.BEARING, machines.BEARING_C),
        ("seized roller", "conveyor", machines.ROLLER, machines.ROLLER_C),
        ("spindle", "lathe", machines.SPINDLE, machines.SPINDLE_C),
        ("duct of hot air", "compressor", machines.DUCT, machines.DUCT_C),
        ("lining gone", "kiln", machines.KILN_PATCH, machines.KILN_PATCH_C),
        ("loose fuse", "switchgear", vessels.FUSE, vessels.FUSE_C),
        ("bad contact", "transformer", vessels.BUSHING, vessels.BUSHING_C),
        ("door seal", "boiler", vessels.DOOR, vessels.DOOR_C),
    )
    out = []
    for name, group, local, celsius in of_groups:
        place = world_from_group(group) @ np.append(local, 1.0)
        out.append(Fault(name, tuple(place[:3].tolist()), celsius))
    out.append(Fault("steam trap", pipes.TRAP, pipes.TRAP_C))
    out.append(Fault("leak under lagging", pipes.LEAK, pipes.LEAK_C))
    return tuple(out)


def solids() -> list[Solid]:
    out = building() + pipes.pipes()
    for groups in GROUPS:
        for group in groups:
            out += inside(world_from_group(group.__name__), group())
    return out


@lru_cache(maxsize=1)
def place() -> tuple[Place, Clearance]:
    here = Place.of(solids(), LARGE)
    low, high = (-HALF_X, -0.3, -HALF_Z), (HALF_X, HEIGHT + 0.3, HALF_Z)
    return here, Clearance.of(here, low, high, 0.15, 8.0)


def sky(d: np.ndarray) -> np.ndarray:
    """(n, 3) display sRGB of directions (n, 3): paler towards the horizon."""
    up = np.clip(d[:, 1:2], 0, 1) ** 0.6
    return np.asarray(HORIZON) * (1 - up) + np.asarray(ZENITH) * up


def radiance(stop: str) -> Radiance:
    """What a ray of that stop's camera brings home: colour (n, 3) and solid (n,)."""
    here, clearance = place()

    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        outside = (np.abs(hits.points[:, 0]) > HALF_X + 1) | (
            np.abs(hits.points[:, 2]) > HALF_Z + 1
        )
        openness = np.where(outside, 1.0, clearance.openness(hits))
        color = shade(here, hits, d, LIGHT, openness)
        away = hits.index < 0
        color[away] = sky(d[away])
        return color, hits.index

    def thermal(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        celsius, index = degrees(o, d)
        share = np.clip((celsius - COLD) / (HOT - COLD), 0, 1)
        return np.repeat(share[:, None], 3, axis=1), index

    return thermal if stop == "Thermal" else rgb


def degrees(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) °C that the thermal camera shows along rays, and what they meet (n,)."""
    here, _ = place()
    hits = look(here, o, d)
    celsius = pattern_at(here, hits, "celsius", 1)[:, 0]
    # Emission falls off at grazing angles, where the cooler hall is mirrored instead.
    facing = np.abs((hits.normals * d).sum(1))
    celsius = 20 + (celsius - 20) * (0.85 + 0.15 * facing)
    return np.where(hits.index >= 0, celsius, -30.0), hits.index


def walk(count: int) -> list[Pose]:
    """`count` poses of the camera in two laps along both walkways, at eye height.

    The first lap looks to the left, ahead and to the right in turn; the second goes the other way
    round, a little higher and off the middle.  Sizes and tangents are `photo_views`' business.
    """
    corners = np.array([(-WALK_X, -SIDE_STEP), (WALK_X, -SIDE_STEP), (WALK_X, SIDE_STEP),
                        (-WALK_X, SIDE_STEP), (-WALK_X, -SIDE_STEP)])  # fmt: skip
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    out = []
    for i in range(count):
        lap, share = divmod(2 * (i + 0.5) / count, 1.0)
        along = share * ends[-1] if lap < 1 else (1 - share) * ends[-1]
        leg = min(int(np.searchsorted(ends, along, "right")) - 1, 3)
        ahead = (corners[leg + 1] - corners[leg]) / lengths[leg]
        at = corners[leg] + (along - ends[leg]) * ahead
        ahead = ahead if lap < 1 else -ahead
        right = np.array([-ahead[1], ahead[0]])
        # Swaying as somebody who walks, and further off the middle in the second lap.
        at = at + right * (0.35 * np.sin(2.4 * i) + (0.5 if lap >= 1 else -0.2))
        yaw = np.deg2rad((-78.0, 8.0, 78.0)[i % 3] + 14 * np.sin(1.7 * i))
        pitch = np.deg2rad((-10.0, 2.0, 9.0, -4.0)[i % 4] + (4.0 if lap >= 1 else 0.0))
        level = np.cos(yaw) * ahead + np.sin(yaw) * right
        eye = np.array([at[0], 1.55 + 0.25 * np.sin(0.9 * i) + (0.3 if lap >= 1 else 0), at[1]])
        towards = np.array([level[0], np.tan(pitch), level[1]])
        out.append(look_at(eye, eye + towards))
    return out


def photo_views(count: int, size: tuple[int, int]) -> tuple[list[View], list[View]]:
    """The rig's views: visible light, and heat RIG metres to its right."""
    right = np.tan(FOV_X / 2)
    up = right * size[1] / size[0]
    both: tuple[list[View], list[View]] = ([], [])
    for pose in walk(count):
        matrix = pose.matrix()
        eye, side, ahead = matrix[:3, 3], matrix[:3, 0], -matrix[:3, 2]
        for views, shift in zip(both, (0.0, RIG), strict=True):
            moved = look_at(eye + shift * side, eye + shift * side + ahead)
            views.append(View(moved, (-right, right, -up, up), 0.05, 2000.0, size))
    return both


def make_hall(
    folder: Path,
    size: tuple[int, int] = (320, 240),
    poses: int = 320,
    test_every: int = 16,
    processes: int = 2,
    progress: Callable[[int, int], None] = lambda done, count: None,
) -> Capture:
    """Writes the capture: a photo of each kind at each pose, every `test_every`-th held out.

    `progress` hears how many photos are done, out of how many.
    """
    folder = Path(folder)
    photos, jobs = [], []
    for stop, views in zip(STOPS, photo_views(poses, size), strict=True):
        name = stop.name.lower()
        make_folders(folder, name)
        for i, view in enumerate(views):
            split = "test" if i % test_every == test_every // 2 else "train"
            path = folder / name / f"{split}_{i:04}.png"
            jobs.append((view, radiance, stop.name, path, None))
            photos.append(Photo(view, path, stop.name, None, split))
    for done in write_photos(jobs, processes):
        progress(done, len(jobs))
    points, colors = colored_points(photo_views(80, size)[0])
    capture = Capture(
        folder, STOPS, tuple(photos), points, colors, None,
        {
            "source": "ray-traced: a plant hall of 34 x 22 metres",
            "recipe": {"size": list(size), "poses": poses, "test_every": test_every},
        },
    )  # fmt: skip
    write_capture(capture)
    return capture


def colored_points(views: list[View], count: int = 60000) -> tuple[np.ndarray, np.ndarray]:
    """(count, 3) points on what the views see, 1 cm of scatter, and their paint (count, 3)."""
    here, _ = place()
    points, solids_of_points = surface_points(here, views, count, 0.01)
    return points.astype(np.float32), color_of(here, points, solids_of_points).astype(np.float32)
