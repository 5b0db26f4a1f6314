"""A test capture that is made in seconds: three balls and a box on a disc, RGB and thermal.

The two modalities are photographed from different places.  Some of what one shows the other does
not: the box hides a hot band, and one ball is nearly as cool as the floor.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.whole_file import make_folders, whole_file
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View, look_at
from shapeshift.training.synthetic.solids import Ball, Cuboid, Disc
from shapeshift.training.synthetic.tracer import (
    Light,
    Material,
    Place,
    Solid,
    depth_under,
    look,
    pattern_at,
    photograph,
    shade,
    surface_points,
)

STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 1.0, "thermal", "ironbow", (20.0, 100.0), "°C"),
)
LIGHT = Light(towards=(0.4, 0.77, 0.5))
FOCAL = 1.2  # focal length over image width
TARGET = (0.0, 0.25, 0.0)  # metres; every camera looks there
GOLDEN = (5**0.5 + 1) / 2
DEPTH_UNIT = 0.0001  # metres a step of depth photos


def celsius(share: Any) -> Any:
    """Degrees of a share 0 to 1 of the range: a number, or an array of them."""
    return 20 + 80 * share


def floor_color(p: np.ndarray) -> np.ndarray:
    checker = (np.floor(4 * p[:, 0]) + np.floor(-4 * p[:, 2])) % 2
    return np.where(checker[:, None] > 0, (0.85, 0.8, 0.7), (0.25, 0.3, 0.4))


def floor_celsius(p: np.ndarray) -> np.ndarray:
    from_hot_ball = (p[:, 0] + 0.45) ** 2 + (p[:, 2] - 0.25) ** 2
    return celsius(0.12 + 0.25 * np.exp(-from_hot_ball / 0.15))


def red_stripes(p: np.ndarray) -> np.ndarray:
    s = 0.5 + 0.5 * np.sin(14 * (p[:, 1] + 0.35) + 3 * (p[:, 0] - 0.45))
    return np.stack([0.9 * s + 0.1, 0.2 + 0.3 * s, np.full_like(s, 0.15)], axis=1)


def green_spots(p: np.ndarray) -> np.ndarray:
    s = 0.5 + 0.5 * np.sin(20 * (p[:, 0] + 0.5)) * np.sin(20 * (0.35 - p[:, 2]))
    return np.stack([0.1 + 0.3 * s, 0.3 + 0.6 * s, np.full_like(s, 0.2)], axis=1)


def blue_checker(p: np.ndarray) -> np.ndarray:
    # The box ends on the edges of its checks: a little aside, rounding cannot choose a colour.
    aside = p + 1e-4  # metres
    checker = (np.floor(10 * (aside[:, 1] + 0.3)) + np.floor(10 * aside[:, 0])) % 2
    return np.where(checker[:, None] > 0, (0.2, 0.35, 0.8), (0.75, 0.8, 0.95))


def moved(x: float, y: float, z: float) -> np.ndarray:
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def place() -> Place:
    shiny = {"gloss": 0.35, "shininess": 30.0}
    red = Material(
        red_stripes, lambda p: celsius(0.6 + 0.35 * np.cos(3 * (p[:, 1] + 0.35))), **shiny
    )
    green = Material(green_spots, float(celsius(0.16)))
    yellow = Material((0.9, 0.75, 0.1), float(celsius(0.85)), **shiny)
    blue = Material(
        blue_checker, lambda p: celsius(0.25 + 0.5 * np.exp(-((p[:, 1] - 0.05) ** 2) / 0.01))
    )
    return Place.of(
        [
            Solid(Disc(1.15), Material(floor_color, floor_celsius)),
            Solid(Ball(0.35), red, moved(-0.45, 0.35, 0.25)),
            Solid(Ball(0.25), green, moved(0.5, 0.25, -0.35)),
            Solid(Ball(0.18), yellow, moved(0.15, 0.18, 0.55)),
            Solid(Cuboid((0.3, 0.3, 0.2)), blue, moved(0.0, 0.3, -0.45)),
        ]
    )


def dome_views(count: int, seed: int, size: int) -> list[View]:
    """Cameras on a dome about 3 m away, elevations 15 to 65 degrees, all round."""
    random = np.random.default_rng(seed)
    out = []
    for i in range(count):
        jitter = random.random(3)
        turn = i / count + 0.02 * jitter[0]
        azimuth = 2 * np.pi * turn * (GOLDEN * count if count > 10 else 1)
        elevation = np.deg2rad(15 + 50 * ((0.618 * i + 0.1 * jitter[1]) % 1))
        away = 3 * (1 + 0.15 * (jitter[2] - 0.5))
        level = away * np.cos(elevation)
        eye = np.array(
            [level * np.cos(azimuth), away * np.sin(elevation) + 0.2, -level * np.sin(azimuth)]
        )
        half = 0.5 / FOCAL
        tangents = (-half, half, -half, half)
        out.append(View(look_at(eye, np.array(TARGET)), tangents, 0.05, 1000.0, (size, size)))
    return out


def radiance(here: Place, modality: str):
    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        return shade(here, hits, d, LIGHT), hits.index

    def thermal(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        low, high = STOPS[1].value_range or (0.0, 1.0)
        share = (pattern_at(here, hits, "celsius", 1) - low) / (high - low)
        return np.repeat(np.where(hits.index[:, None] >= 0, share, 0), 3, axis=1), hits.index

    return rgb if modality == "RGB" else thermal


def save_png(path: Path, image: np.ndarray) -> None:
    with whole_file(path) as file:
        Image.fromarray(np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)).save(file, "PNG")


def save_depth(path: Path, metres: np.ndarray) -> Path:
    """A depth photo of 16 bits, DEPTH_UNIT metres a step."""
    make_folders(path.parent.parent, path.parent.name)
    with whole_file(path) as file:
        Image.fromarray(np.rint(metres / DEPTH_UNIT).astype(np.uint16)).save(file, "PNG")
    return path


def make_balls(
    folder: Path, size: int = 200, views: int = 40, test_views: int = 8, depth: bool = False,
    rig: bool = False,
) -> Capture:  # fmt: skip
    """Writes the capture into `folder` (size x size pixels, that many views a modality).

    depth: each photo gets a depth photo.  rig: both modalities are photographed from each place.
    """
    here, photos = place(), []
    for number, stop in enumerate(STOPS):
        number = 0 if rig else number
        make_folders(folder, stop.name.lower())
        for split, count, seed in (
            ("train", views, number),
            ("test", test_views, 50 + number),
        ):
            for i, view in enumerate(dome_views(count, seed, size)):
                path = folder / stop.name.lower() / f"{split}_{i:03}.png"
                image, _ = photograph(view, radiance(here, stop.name))
                save_png(path, image)
                photo = Photo(view, path, stop.name, None, split)
                if depth:
                    beside = folder / f"{stop.name.lower()}_depth" / path.name
                    beside = save_depth(beside, depth_under(here, view))
                    photo = replace(photo, depth=beside, depth_unit=DEPTH_UNIT)
                photos.append(photo)
    points, solids = surface_points(here, dome_views(12, 99, size), 20000, 0.004)
    hues = np.array(
        [(0.5, 0.5, 0.5), (0.5, 0.3, 0.2), (0.2, 0.5, 0.2), (0.9, 0.75, 0.1), (0.4, 0.5, 0.9)]
    )
    capture = Capture(
        Path(folder),
        STOPS,
        tuple(photos),
        points.astype(np.float32),
        hues[solids].astype(np.float32),
        (0.0, 0.0, 0.0),
        {"source": "ray-traced: three balls and a box on a disc"},
    )
    write_capture(capture)
    return capture
