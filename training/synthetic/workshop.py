"""The bundled demo's capture: a workshop bench photographed as it looks, as it radiates, opened.

Three stops on one slider.  RGB and Thermal show the same objects; Opened has other geometry: the
insulation is off the pipe and the motor is cut open.
"""

import signal
from collections.abc import Callable, Iterator
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.whole_file import make_folders
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View, look_at
from shapeshift.training.synthetic.balls import save_png
from shapeshift.training.synthetic.pipework import gauge, joint, line, return_line, valve
from shapeshift.training.synthetic.placing import Clearance, frame, inside
from shapeshift.training.synthetic.things import (
    CABINET,
    MOTOR,
    base_plate,
    bench,
    cabinet,
    conduit,
    motor,
    mug,
    oil_can,
    screwdriver,
    spanner,
)
from shapeshift.training.synthetic.tracer import (
    Light,
    Place,
    Solid,
    look,
    pattern_at,
    photograph,
    shade,
    surface_points,
)

COLD, HOT = 15.0, 95.0  # °C that thermal intensity 0 and 1 stand for
STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 0.5, "thermal", "ironbow", (COLD, HOT), "°C"),
    Stop("Opened", 1.0, "layer"),
)
GREY = 0.08  # the studio's walls, display sRGB; as a temperature it is 21 °C, the room's
LIGHT = Light(
    towards=(-0.45, 0.8, 0.55),
    key=(0.70, 0.66, 0.58),
    sky=(0.56, 0.58, 0.62),
    ground=(0.34, 0.32, 0.30),
    in_shadow=0.1,
    spread=0.045,
)
TARGET = (0.0, 0.07, 0.0)  # metres
FOV_X = np.deg2rad(48)
DISTANCES = (1.55, 2.05)  # metres
CLOSE = 0.95  # metres
FRONT = np.deg2rad(70)  # close cameras stay within this of straight ahead
ELEVATIONS = (8.0, 66.0)  # degrees
GOLDEN = (5**0.5 + 1) / 2
Radiance = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def things(opened: bool) -> list[tuple[str, list[Solid]]]:
    """What stands in the workshop: names and their solids, in the order in which they are traced.

    "bench" is what nobody would take away: the bench and the pipe that is fixed under it.
    """
    return [
        ("bench", bench()),
        ("pipe", line() + joint(opened)),
        ("valve", valve()),
        ("gauge", gauge()),
        ("bench", return_line()),
        ("cabinet", cabinet()),
        ("conduit", conduit()),
        ("mug", mug()),
        ("screwdriver", screwdriver()),
        ("spanner", spanner()),
        ("can", oil_can()),
        ("motor", base_plate() + inside(frame(MOTOR), motor(opened))),
    ]


@lru_cache(maxsize=2)
def place(opened: bool) -> tuple[Place, Clearance]:
    return placed([solid for _, solids in things(opened) for solid in solids])


def placed(solids: list[Solid]) -> tuple[Place, Clearance]:
    here = Place.of(solids)
    return here, Clearance.of(here, (-0.75, -0.2, -0.48), (0.75, 0.5, 0.48))


def radiance(stop: str) -> Radiance:
    """What a ray of that stop's camera brings home: colour (n, 3) and solid (n,)."""
    return radiance_of(*place(stop == "Opened"), stop == "Thermal")


def radiance_of(here: Place, clearance: Clearance, heat: bool):
    """The same of any solids in the workshop's light."""

    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        color = shade(here, hits, d, LIGHT, clearance.openness(hits))
        color[hits.index < 0] = GREY
        return color, hits.index

    def thermal(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        celsius = pattern_at(here, hits, "celsius", 1)[:, 0]
        # Emission falls off at grazing angles, where the cool room is mirrored instead.
        facing = np.abs((hits.normals * d).sum(1))
        celsius = 22 + (celsius - 22) * (0.8 + 0.2 * facing)
        share = np.where(hits.index >= 0, (celsius - COLD) / (HOT - COLD), GREY)
        return np.repeat(np.clip(share, 0, 1)[:, None], 3, axis=1), hits.index

    return thermal if heat else rgb


def dome(count: int, offset: float, size: tuple[int, int]) -> list[View]:
    """Cameras on two domes, spread by the golden angle; `offset` turns one set against another.

    Every sixth one stands closer, in front, and looks at the cabinet or at the motor: what is
    opened there is not seen from elsewhere.
    """
    right = np.tan(FOV_X / 2)
    up = right * size[1] / size[0]
    low, high = np.sin(np.deg2rad(ELEVATIONS))
    out = []
    for i in range(count):
        close = i % 6 == 5
        number = i // 12 if close else i  # in its own sequence, or it would not spread
        turn = GOLDEN * number + offset
        azimuth = FRONT * (2 * (turn % 1) - 1) if close else 2 * np.pi * turn
        height = low + (high - low) * ((number + 0.5) * 2**0.5 % 1) * (0.8 if close else 1)
        level = np.sqrt(1 - height**2)
        away = CLOSE if close else DISTANCES[i % 2]
        target = np.array((MOTOR, CABINET)[i // 6 % 2] if close else TARGET)
        eye = away * np.array([level * np.sin(azimuth), height, level * np.cos(azimuth)])
        pose = look_at(eye + target, target)
        out.append(View(pose, (-right, right, -up, up), 0.05, 1000.0, size))
    return out


def write_photo(job: tuple[View, Callable[[str], Radiance], str, Path, Path | None]) -> None:
    """One photo, and its mask where one is asked for, written to their files."""
    view, radiance_of, stop, path, mask_path = job
    image, mask = photograph(view, radiance_of(stop))
    save_png(path, image)
    if mask_path is not None:
        save_png(mask_path, mask)


def write_photos(jobs: list[tuple], processes: int) -> Iterator[int]:
    """Writes all photos; yields how many are done."""
    if processes == 1:
        for done, job in enumerate(jobs, 1):
            write_photo(job)
            yield done
        return
    with get_context("spawn").Pool(processes, leave_interrupts_to_the_parent) as pool:
        for done, _ in enumerate(pool.imap_unordered(write_photo, jobs, chunksize=4), 1):
            yield done


def leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def make_workshop(
    folder: Path,
    size: tuple[int, int] = (384, 288),
    views: int = 72,
    test_views: int = 8,
    processes: int = 2,
    progress: Callable[[int, int], None] = lambda done, count: None,
) -> Capture:
    """Writes the capture into `folder`: `views` + `test_views` photos a stop, masks, points.

    `progress` hears how many photos are done, out of how many.
    """
    counts = (views, test_views)
    states = (False, True)
    return photograph_bench(folder, STOPS, states, radiance, size, counts, processes, progress)


def photograph_bench(
    folder: Path,
    stops: tuple[Stop, ...],
    states: tuple[bool, ...],
    radiance_of: Callable[[str], Radiance],
    size: tuple[int, int],
    counts: tuple[int, int],
    processes: int,
    progress: Callable[[int, int], None],
) -> Capture:
    """The capture of any stops: `radiance_of` their names, a function of a module; `states`, opened
    or not, that points lie on; `counts` of the photos a stop to train with and to test.
    """
    folder, (views, test_views) = Path(folder), counts
    photos, jobs = [], []
    for number, stop in enumerate(stops):
        name = stop.name.lower()
        make_folders(folder, name)
        make_folders(folder, f"masks/{name}")
        shots = [("train", v) for v in dome(views, number / 3, size)]
        shots += [("test", v) for v in dome(test_views, number / 3 + 0.17, size)]
        for i, (split, view) in enumerate(shots):
            path = folder / name / f"{split}_{i:03}.png"
            mask_path = folder / "masks" / name / path.name
            jobs.append((view, radiance_of, stop.name, path, mask_path))
            photos.append(Photo(view, path, stop.name, None, split))
    for done in write_photos(jobs, processes):
        progress(done, len(jobs))
    points, colors = colored_points(size, states=states)
    capture = Capture(
        folder,
        stops,
        tuple(photos),
        points,
        colors,
        (GREY, GREY, GREY),
        {
            "source": "ray-traced: a workshop bench; masks/ holds the bench's share of each pixel",
            "recipe": {"size": list(size), "views": views, "test_views": test_views},
        },
    )
    write_capture(capture)
    return capture


def colored_points(
    size: tuple[int, int], count: int = 40000, states: tuple[bool, ...] = (False, True)
) -> tuple[np.ndarray, np.ndarray]:
    """Points on the closed and on the opened bench, as many each, with the colours of the paint;
    `states`: whether it is opened.
    """
    points, colors = [], []
    for opened in states:
        here, _ = place(opened)
        each = count // len(states)
        xyz, solids = surface_points(here, dome(24, 0.4, size), each, 0.0015, int(opened))
        for i in np.unique(solids):
            solid, mine = here.solids[i], xyz[solids == i]
            color = solid.surface.color
            points.append(mine)
            paint = np.asarray(color(solid.local(mine)) if callable(color) else color)
            colors.append(np.broadcast_to(paint, mine.shape))
    return np.concatenate(points).astype(np.float32), np.concatenate(colors).astype(np.float32)
