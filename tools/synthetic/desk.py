"""A capture for objects: eight things on a table that masks go wrong on, with true label maps.

    python3 -m tools.synthetic.desk FOLDER

Bricks that touch, a mug whose handle encloses table, a ball on a book, a thin pencil, a lamp with a
thin stem, a crate painted as the table.  FOLDER is the capture, in colours and heat from the same
places; FOLDER/labels/rgb holds the label maps, and objects.json a box an object in the photo in
which most of it is seen.
"""

import json
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from shapeshift.decomposition.masks.label_maps import write_label_map
from shapeshift.runtime_models.files.whole_file import make_folders, write_whole
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View, look_at
from shapeshift.training.synthetic.placing import bar, box, frame, inside, noise, ring, turned
from shapeshift.training.synthetic.solids import Ball
from shapeshift.training.synthetic.tracer import (
    Light,
    Material,
    Place,
    Solid,
    color_of,
    look,
    pattern_at,
    pixel_rays,
    shade,
    surface_points,
    trace,
)
from shapeshift.training.synthetic.workshop import Radiance, write_photos

OBJECTS = ("red brick", "orange brick", "mug", "ball", "book", "pencil", "lamp", "crate")
STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 1.0, "thermal", "ironbow", (15.0, 65.0), "°C"),
)
GREY, COOL = 0.25, 0.1  # the room, display sRGB, and as a share of the thermal range
LIGHT = Light((-0.5, 0.8, 0.4), (0.6, 0.58, 0.54), (0.5, 0.5, 0.52), (0.3, 0.29, 0.28), 0.15, 0.04)
SIZE, VIEWS = (320, 240), 24
RIGHT = float(np.tan(np.deg2rad(52) / 2))
TARGET = np.array([0.0, 0.05, 0.0])  # metres
NEAR, FAR = 0.72, 0.92  # metres from there
LOW, HIGH = 20.0, 60.0  # degrees up
MARGIN = 2  # pixels of a person's box around the object


def table_color(p: np.ndarray) -> np.ndarray:
    grain = noise(p * (6.0, 6.0, 60.0), 3.0)
    fine = noise(p * (1.0, 1.0, 1.0), 160.0)
    return np.array([0.62, 0.47, 0.31]) * (0.78 + 0.22 * grain + 0.12 * fine)[:, None]


def mug_color(p: np.ndarray) -> np.ndarray:
    return np.where((np.sin(180 * p[:, 1]) > 0.3)[:, None], (0.2, 0.35, 0.7), (0.9, 0.9, 0.86))


def brick_color(tone: tuple[float, float, float]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda p: np.array(tone) * (0.75 + 0.35 * noise(p, 90.0))[:, None]


def cover_color(p: np.ndarray) -> np.ndarray:
    title = (np.abs(p[:, 0]) < 0.05) & (np.abs(p[:, 2] + 0.03) < 0.008)
    return np.where(title[:, None], (0.9, 0.8, 0.4), (0.16, 0.4, 0.26))


def mug() -> list[Solid]:
    glaze = Material(mug_color, 55.0, 0.25, 40.0)
    plain = Material((0.9, 0.9, 0.86), 45.0, 0.25, 40.0)
    parts = [
        bar((0, 0.002, 0), (0, 0.1, 0), 0.042, glaze, capped=False),
        bar((0, 0.002, 0), (0, 0.1, 0), 0.038, plain, capped=False),
        bar((0, 0.0, 0), (0, 0.006, 0), 0.042, plain),
        ring((0.044, 0.052, 0), "z", 0.03, 0.0065, plain,
             keep=lambda p: np.hypot(p[:, 0] + 0.044, p[:, 1] * 0) > 0.04),
    ]  # fmt: skip
    return inside(frame((0.02, 0, 0.19), turned("y", -35)), parts)


def lamp() -> list[Solid]:
    metal = Material((0.3, 0.3, 0.33), 30.0, 0.4, 40.0)
    shade_cloth = Material((0.75, 0.25, 0.3), 55.0)
    return inside(frame((-0.19, 0, -0.13)), [
        bar((0, 0, 0), (0, 0.014, 0), 0.055, metal),
        bar((0, 0.014, 0), (0, 0.15, 0), 0.005, metal),
        bar((0, 0.14, 0), (0, 0.21, 0), 0.055, shade_cloth, top_radius=0.035),
    ])  # fmt: skip


def things() -> list[tuple[str, list[Solid]]]:
    """Names and solids; "table" is what nobody takes away."""
    red = Material(brick_color((0.68, 0.2, 0.15)), 24.0)
    orange = Material(brick_color((0.85, 0.45, 0.15)), 30.0)
    yellow, lead = Material((0.95, 0.78, 0.1), 22.0), Material((0.2, 0.2, 0.2), 22.0)
    turn, half = turned("y", 25), np.array([0.05, 0.0275, 0.025])
    ends = (np.array([-0.27, half[1], 0.11]), np.array([-0.27, half[1], 0.11]) + turn @ (0.1, 0, 0))
    pencil = inside(frame((0.2, 0.0045, 0.1), turned("y", 50)), [
        bar((-0.085, 0, 0), (0.07, 0, 0), 0.0045, yellow),
        bar((0.07, 0, 0), (0.088, 0, 0), 0.0045, lead, top_radius=0.001),
    ])  # fmt: skip
    return [
        ("table", [box((0, -0.02, 0), (0.5, 0.02, 0.36), Material(table_color, 22.0, 0.05))]),
        ("red brick", [box(tuple(ends[0]), tuple(half), red, rotation=turn)]),
        ("orange brick", [box(tuple(ends[1]), tuple(half), orange, rotation=turn)]),
        ("mug", mug()),
        ("ball", [Solid(Ball(0.035), Material((0.8, 0.2, 0.55), 22.0, 0.3),
                        frame((0.01, 0.03 + 0.035, -0.1)))]),
        ("book", [box((0.0, 0.015, -0.1), (0.09, 0.015, 0.065), Material(cover_color, 21.0),
                      rotation=turned("y", 12))]),
        ("pencil", pencil),
        ("lamp", lamp()),
        ("crate", [box((0.23, 0.05, -0.11), (0.06, 0.05, 0.05), Material(table_color, 35.0),
                       rotation=turned("y", -20))]),
    ]  # fmt: skip


@lru_cache(maxsize=1)
def place() -> tuple[Place, np.ndarray]:
    """The tracer's place, and each solid's label (solids,) uint8."""
    labels = {"table": 0} | {name: label for label, name in enumerate(OBJECTS, 1)}
    solids = [(labels[name], solid) for name, parts in things() for solid in parts]
    return Place.of([solid for _, solid in solids]), np.array([k for k, _ in solids], np.uint8)


def radiance(stop: str) -> Radiance:
    """What a ray of that stop's camera brings home: colour (n, 3) and solid (n,)."""
    here, _ = place()

    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        color = shade(here, hits, d, LIGHT)
        color[hits.index < 0] = GREY
        return color, hits.index

    def thermal(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        low, high = STOPS[1].value_range or (0.0, 1.0)
        share = (pattern_at(here, hits, "celsius", 1)[:, 0] - low) / (high - low)
        share = np.where(hits.index >= 0, share, COOL)
        return np.repeat(share[:, None], 3, axis=1), hits.index

    return thermal if stop == "Thermal" else rgb


def views(count: int = VIEWS, size: tuple[int, int] = SIZE, turn: float = 0.0) -> list[View]:
    """All round, at heights that change from one to the next."""
    up = RIGHT * size[1] / size[0]
    out = []
    for i in range(count):
        azimuth = 2 * np.pi * (i / count + turn)
        elevation = np.deg2rad(LOW + (HIGH - LOW) * (0.618 * i % 1))
        level = np.cos(elevation)
        along = np.array([level * np.sin(azimuth), np.sin(elevation), level * np.cos(azimuth)])
        eye = TARGET + (NEAR + (FAR - NEAR) * (i % 3) / 2) * along
        out.append(View(look_at(eye, TARGET), (-RIGHT, RIGHT, -up, up), 0.05, 1000.0, size))
    return out


def label_map(view: View) -> np.ndarray:
    """(H, W) uint8: the label of what the ray through each pixel's centre meets first."""
    here, labels = place()
    width, height = view.size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    directions = pixel_rays(view, columns, rows)
    eyes = np.broadcast_to(view.world_from_eye.position, directions.shape)
    _, index = trace(here, eyes, directions)
    return np.where(index >= 0, labels[index], 0).reshape(height, width).astype(np.uint8)


def make_desk(
    folder: Path,
    size: tuple[int, int] = SIZE,
    count: int = VIEWS,
    stops: tuple[Stop, ...] = STOPS,
    processes: int = 1,
) -> Capture:
    """Writes the capture, its label maps and its objects.json into `folder`."""
    folder, photos, jobs, cameras = Path(folder), [], [], views(count, size)
    maps = [label_map(view) for view in cameras]
    for stop in stops:
        name = stop.name.lower()
        make_folders(folder, name)
        for i, view in enumerate(cameras):
            path = folder / name / f"{i:03}.png"
            jobs.append((view, radiance, stop.name, path, None))
            photos.append(Photo(view, path, stop.name))
    for _ in write_photos(jobs, processes):
        pass
    make_folders(folder, "labels/rgb")
    for i, labels in enumerate(maps):
        write_label_map(labels, folder / f"labels/rgb/{i:03}.png")
    here, _ = place()
    points, solids = surface_points(here, cameras, 20000, 0.002)
    colors = color_of(here, points, solids)
    capture = Capture(
        folder, stops, tuple(photos), points.astype(np.float32), colors.astype(np.float32),
        (GREY, GREY, GREY), {"source": "ray-traced: eight things on a table"},
    )  # fmt: skip
    write_capture(capture)
    write_whole(folder / "objects.json", json.dumps(objects_of(maps), indent=1).encode())
    return capture


def objects_of(maps: list[np.ndarray]) -> dict:
    """objects.json: a box an object in the photo that shows most of it, and all of it."""
    rows = []
    for label, name in enumerate(OBJECTS, 1):
        masks = [labels == label for labels in maps]
        whole = [not (m[[0, -1]].any() or m[:, [0, -1]].any()) for m in masks]
        best = int(np.argmax([m.sum() + m.size * w for m, w in zip(masks, whole, strict=True)]))
        down, across = np.nonzero(maps[best] == label)
        height, width = maps[best].shape
        low = np.maximum(np.array([across.min(), down.min()]) - MARGIN, 0)
        high = np.minimum(np.array([across.max(), down.max()]) + 1 + MARGIN, (width, height))
        edge = [*low, *high]
        said = {"photo": f"rgb/{best:03}.png", "box": [int(n) for n in edge]}
        rows.append({"label": label, "name": name, "prompts": [said]})
    return {"format": "shapeshift-objects 1", "objects": rows}


if __name__ == "__main__":
    make_desk(Path(sys.argv[1]))
