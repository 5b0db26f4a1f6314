"""What still pixels do where a leaf changes its level: at once, and faded over frames.

python tools/renderer/switching.py FOLDER --view EX,EY,EZ,TX,TY,TZ --out docs/bench/switching.csv

FOLDER is streamed SOG, as launch.py lod writes it.  At rest under a budget one leaf after the other
goes a level coarser, and back.  A change is the mean difference of the colours, of 255, over the
pixels that show the leaf, each as far as it does, which is measured by drawing it black and
white.  The worst and the mean of all leaves that were tried, of the frame that changes most; and
the mean of each frame as the finer level comes, the last one that which shows it alone.
"""

import argparse
import csv
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.streaming import changing
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.files.part_cache import PartCache
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import LeafReading, Reading
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (1280, 720)
LEAVES = 12  # that are tried, of those seen in PIXELS or more
PIXELS = 250
COLUMNS = (
    "scene",
    "budget",
    "finer_parts",
    "leaves",
    "mean_change",
    "worst_change",
    "as_finer_comes",
)
PARTS = ((), (0.30,), (0.16, 0.50), (0.25, 0.50, 0.75), changing.PARTS)  # of the finer level


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--view", required=True)
    parser.add_argument("--budget", type=int, default=2_000_000)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    rows = list(measure(given.folder, view_of(given.view), given.budget))
    sys.stderr.write("".join(f"{row}\n" for row in rows))
    if given.out:
        with given.out.open("w", newline="") as file:
            name, view = given.folder.name, given.view
            file.write(f"# python tools/renderer/switching.py {name} --view={view}\n")
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


def view_of(text: str) -> View:
    numbers = np.array([float(word) for word in text.split(",")])
    pose = look_at(numbers[:3], numbers[3:])
    return View(pose, perspective(np.deg2rad(60), SIZE), 0.05, 1000.0, SIZE)


def measure(folder: Path, view: View, budget: int) -> Iterator[dict]:
    model = read_model(folder, Reading(leaves=LeafReading(budget, PartCache(2 << 30))))
    with Renderer(None, "tiles") as renderer:
        renderer.update(Scene((SceneObject("scene", model),)))
        renderer.draw([view])
        stream = renderer.streaming.stream
        level, pixels = stream.table.level, stream.weights.pixels
        assert isinstance(model, SplatLayers)
        coarsest = model.leaves.levels.coarsest
        able = np.flatnonzero((level >= 0) & (level < coarsest) & (pixels >= PIXELS))
        leaves = np.random.default_rng(0).permutation(able)[:LEAVES]
        stream.converges = False
        shown = [weight_of(renderer, view, leaf) for leaf in leaves]
        for parts in PARTS:
            changing.PARTS = parts or (0.5,)
            changes = {1: [], -1: []}
            for leaf, weight in zip(leaves, shown, strict=True):
                if weight.sum() > PIXELS / 4:
                    for step, found in changes.items():
                        found.append(change(renderer, view, leaf, step, weight, not parts))
            both = np.max(changes[1] + changes[-1], axis=1)
            finer = np.mean(changes[-1], axis=0)
            yield {
                "scene": folder.name, "budget": budget,
                "finer_parts": " ".join(f"{part:g}" for part in parts),
                "leaves": len(changes[1]), "mean_change": round(float(both.mean()), 2),
                "worst_change": round(float(both.max()), 2),
                "as_finer_comes": " ".join(f"{step:.2f}" for step in finer),
            }  # fmt: skip


def picture(renderer: Renderer, view: View) -> np.ndarray:
    renderer.drawing.draw([view], renderer.settings, PassTimer(None))
    return np.clip(renderer.image(0)[..., :3], 0, 1).copy()


def weight_of(renderer: Renderer, view: View, leaf: int) -> np.ndarray:
    """(H, W) how far each pixel shows a leaf."""
    drawing = cast(Any, renderer.drawing)  # of tiles, which have pages
    pages = renderer.streaming.stream.table.pages_of(np.array([leaf]))
    kept = drawing.device.download(drawing.paged.read(pages, drawing._color))
    seen = []
    for value in (0.0, 1.0):
        drawing.paged.write(pages, np.full_like(kept, value), drawing._color)
        seen.append(picture(renderer, view).mean(axis=2))
    drawing.paged.write(pages, kept, drawing._color)
    return seen[1] - seen[0]


def change(
    renderer: Renderer, view: View, leaf: int, step: int, weight: np.ndarray, at_once: bool
) -> list[float]:
    """Of each frame, as a leaf goes `step` levels."""
    stream, one = renderer.streaming.stream, np.array([leaf])
    pictures = [picture(renderer, view)]
    level = stream.table.level[one] + step
    stream.table.retire(one)
    stream._upload(one, level)
    stream.fades.begin(one, np.array([step < 0]))
    if at_once:
        stream.fades.end(one)
    while True:
        pictures.append(picture(renderer, view))
        if not stream.fades.leaves.any():
            break
        stream.fades.advance()
    differences = [np.abs(b - a).mean(axis=2) for a, b in pairwise(pictures)]
    return [255 * float((d * weight).sum() / weight.sum()) for d in differences]


if __name__ == "__main__":
    main()
