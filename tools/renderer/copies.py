"""What copies of one model cost under a budget: their pages, memory and frames.

python tools/renderer/copies.py FOLDER [--drawing tiles quads] --out docs/bench/copies.csv

FOLDER is streamed SOG, as launch.py lod writes it.  Copies stand in a square, a model's width and a
half apart, each turned otherwise, seen from a corner.  Each row is measured in a process of its
own: "shared" are objects of one model, "apart" of as many that were read one by one.  first_cpu_ms
is the frame that reads, frame_cpu_ms the median of still ones, walk_cpu_ms that of 60 frames in
motion, of all threads; copies_drawn are those of which anything is drawn; arena_mb is what the
splats, their colours and harmonics take.  same: the largest difference of a pixel to the picture of
the row "apart".
"""

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shapeshift.renderer.gl.context import open_context
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.files.part_cache import PartCache
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import LeafReading, Reading
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (1280, 720)
STILL, WALK = 5, 60  # frames
WALK_QUADS = 6  # of software GL, which takes ten times as long
WAYS = (("apart", 1), ("shared", 1), ("apart", 10), ("shared", 10), ("apart", 100),
        ("shared", 100), ("shared", 1000))  # fmt: skip
SMALL = (200_000, 60_000, 20_000)  # budgets of the last of these besides
COLUMNS = (
    "scene", "drawing", "way", "copies", "budget", "splats", "copies_drawn", "pages_drawn",
    "pages_stored", "arena_mb", "first_cpu_ms", "frame_cpu_ms", "walk_cpu_ms", "peak_mb", "same",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--budget", type=int, default=2_000_000)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--drawing", nargs="*", default=["tiles", "quads"])
    parser.add_argument("--child", nargs=3, metavar=("WAY", "COPIES", "PICTURES"))
    given = parser.parse_args()
    if given.child:
        way, copies, pictures = given.child
        with open_renderer(given.drawing[0]) as renderer:
            row = measure(renderer, given.folder, way, int(copies), given.budget, Path(pictures))
        sys.stdout.write(json.dumps(row) + "\n")
        return
    rows = []
    with tempfile.TemporaryDirectory() as pictures:
        every = [(*way, given.budget) for way in WAYS]
        every += [(*WAYS[-1], small) for small in SMALL]
        for drawing, (way, copies, budget) in product(given.drawing, every):
            words = [sys.executable, __file__, str(given.folder), "--budget", str(budget)]
            words += ["--drawing", drawing, "--child", way, str(copies), pictures]
            done = subprocess.run(words, stdout=subprocess.PIPE, check=True)
            rows.append(json.loads(done.stdout.splitlines()[-1]))
            sys.stderr.write(f"{rows[-1]}\n")
    if given.out:
        with given.out.open("w", newline="") as file:
            file.write(f"# python tools/renderer/copies.py {given.folder.name}\n")
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


@contextmanager
def open_renderer(drawing: str) -> Iterator[Renderer]:
    """Tiles need no GL."""
    with ExitStack() as opened:
        ctx = opened.enter_context(open_context()) if drawing == "quads" else None
        yield opened.enter_context(Renderer(ctx, drawing))


def open_leaves(folder: Path, budget: int) -> SplatLayers:
    model = read_model(folder, Reading(leaves=LeafReading(budget, PartCache(1 << 30))))
    assert isinstance(model, SplatLayers)
    return model


def square_of(models: list[SplatLayers]) -> tuple[Scene, float]:
    """The scene, and metres from one copy to the next."""
    low, high = np.percentile(models[0].means, (2, 98), axis=0)
    side, step = int(np.ceil(np.sqrt(len(models)))), 1.5 * float(max((high - low)[[0, 2]]))
    objects = []
    for i, model in enumerate(models):
        place = step * np.array([i % side, 0.0, -(i // side)])
        wxyz = np.array([np.cos(2.4 * i), 0, np.sin(2.4 * i), 0])
        objects.append(SceneObject(f"copy {i}", model, Pose(place, wxyz)))
    return Scene(tuple(objects)), step


def view_of(step: float, part: float) -> View:
    """From the first copy's corner over the square; part: of a step to the right."""
    eye = step * np.array([-1 + part, 0.8, 1.2])
    pose = look_at(eye, step * np.array([4 + part, 0, -4.0]))
    return View(pose, perspective(np.deg2rad(60), SIZE), 0.02 * step, 1000 * step, SIZE)


def measure(
    renderer: Renderer, folder: Path, way: str, copies: int, budget: int, pictures: Path
) -> dict:
    first, name = open_leaves(folder, budget), renderer.backends["drawing"].split()[0]
    apart = way == "apart"
    models = [first, *(open_leaves(folder, budget) if apart else first for _ in range(copies - 1))]
    scene, step = square_of(models)
    row: dict = {"scene": folder.name, "drawing": name, "way": way, "copies": copies}
    row["budget"] = budget
    begun = time.process_time()
    renderer.update(scene)
    stats = renderer.draw([view_of(step, 0)])
    row["first_cpu_ms"] = round(1e3 * (time.process_time() - begun))
    image, file = renderer.image(0).copy(), pictures / f"{name}_{copies}.npy"
    if apart:
        np.save(file, image)
    elif file.exists():
        row["same"] = float(np.abs(image - np.load(file)).max())
    row |= memory_of(renderer)
    assert stats.streaming is not None
    row["splats"] = stats.streaming.shown
    row["copies_drawn"] = (
        len(np.unique(cast(Any, renderer.drawing).paged.owner)) - 1
    )  # -1: free pages
    row["frame_cpu_ms"] = frames(renderer, scene, step, np.zeros(STILL))
    renderer.streaming.converges = False
    walk = WALK_QUADS if name == "quads" else WALK
    row["walk_cpu_ms"] = frames(renderer, scene, step, np.linspace(0, 1, WALK)[:walk])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return row | {"peak_mb": round(peak / 1e3)}


def frames(renderer: Renderer, scene: Scene, step: float, parts: np.ndarray) -> int:
    """Median milliseconds, the poses of all objects taken over each time."""
    times = []
    for part in parts:
        begun = time.process_time()
        renderer.update(scene)
        renderer.draw([view_of(step, float(part))])
        times.append(time.process_time() - begun)
    return round(1e3 * float(np.median(times)))


def memory_of(renderer: Renderer) -> dict:
    drawing = cast(Any, renderer.drawing)  # of either kind
    pages = drawing.paged
    if renderer.backends["drawing"].startswith("quads"):
        arena = drawing.arena
        arrays = (arena.mean_opacity, arena.covariance, drawing._sh, *arena.colors)
        taken = sum(buffer.size for buffer in arrays)
    else:
        arrays = (drawing._mean_opacity, drawing._covariance, pages._sh, *drawing._colors)
        taken = sum(array.nbytes for array in arrays)
    return {
        "pages_drawn": int(np.count_nonzero(pages.stored >= 0)),
        "pages_stored": int(np.count_nonzero(pages.uses)),
        "arena_mb": round(taken / 1e6, 1),
    }


if __name__ == "__main__":
    main()
