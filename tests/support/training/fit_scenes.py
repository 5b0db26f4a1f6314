"""Small ray-traced captures for the need report: stops of one shape, and of two."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.synthetic.balls import celsius, dome_views, moved, radiance, save_png
from shapeshift.training.synthetic.solids import Ball, Cuboid, Disc
from shapeshift.training.synthetic.tracer import Material, Place, Solid, photograph, surface_points


def stripes(p: np.ndarray) -> np.ndarray:
    share = 0.5 + 0.5 * np.sin(12 * p[:, 1])
    return np.stack([0.9 * share + 0.1, 0.3 + 0.2 * share, np.full_like(share, 0.2)], axis=1)


def warm_top(p: np.ndarray) -> np.ndarray:
    return celsius(0.5 + 0.4 * np.tanh(6 * p[:, 1]))


BALL = Solid(Ball(0.4), Material(stripes, warm_top), moved(-0.45, 0.4, 0.0))
CUBE = Solid(Cuboid((0.3, 0.3, 0.3)), Material((0.3, 0.5, 0.9), warm_top), moved(0.5, 0.3, 0.0))
FLOOR = Solid(Disc(1.0), Material((0.6, 0.55, 0.5), 30.0))
HEAT = Stop("Thermal", 1.0, "thermal", "ironbow", (20.0, 100.0), "°C")
SHAPES = {  # of each: stop, what is there, and how it is photographed
    "shared": (
        (Stop("RGB", 0.0), (FLOOR, BALL, CUBE), "RGB"),
        (HEAT, (FLOOR, BALL, CUBE), "Thermal"),
    ),
    "apart": ((Stop("Ball", 0.0), (FLOOR, BALL), "RGB"), (Stop("Cube", 1.0), (FLOOR, CUBE), "RGB")),
}


WHITE = 1.0  # behind everything: over black, what is gone and what is dark look the same


def over_white(rays):
    """The radiance with white where rays meet nothing."""

    def radiance(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        color, index = rays(o, d)
        return np.where(index[:, None] >= 0, color, WHITE), index

    return radiance


def make_shapes(
    folder: Path, which: str, size: int = 48, views: int = 14, tests: int = 4, rig: bool = False
) -> Capture:
    """The capture "shared" or "apart" in `folder`, over white; rig: both stops from each place."""
    photos = []
    for number, (stop, solids, light) in enumerate(SHAPES[which]):
        number = 0 if rig else number
        (folder / stop.name).mkdir(parents=True, exist_ok=True)
        here = Place.of(list(solids))
        for split, count, seed in (("train", views, number), ("test", tests, 50 + number)):
            for i, view in enumerate(dome_views(count, seed, size)):
                path = folder / stop.name / f"{split}_{i:03}.png"
                save_png(path, photograph(view, over_white(radiance(here, light)))[0])
                photos.append(Photo(view, path, stop.name, None, split))
    points, _ = surface_points(Place.of([FLOOR, BALL, CUBE]), dome_views(12, 99, size), 4000, 0.004)
    stops = tuple(stop for stop, _, _ in SHAPES[which])
    capture = Capture(
        folder, stops, tuple(photos), points.astype(np.float32), background=(WHITE,) * 3
    )
    write_capture(capture)
    return capture
