"""Levels of detail of packages: learned anchors beside averaged ones and beside baked splats.

    python tools/runtime_models/anchor_lod.py PACKAGE ... --out docs/bench/anchor_lod.csv

Each level as `launch.py lod` makes it ("learned"), its anchors before they learn ("averaged"), and
plain splats in as many bytes, baked at the stops and half-way between them, merged, and faded into
each other ("baked").  Rows: PSNR against the package over four views of 640x360 at the stops, at
half-way (where baked splats are exact but for merging) and at a quarter (where they fade), at the
stops also over the model's own pixels alone (that either picture covers by 2 %), and their mean
change, of 255; at the size where the level begins and at about 1, 2, 4 and 8 times the distance
that shows all of it; then the processor time of a frame whose x has changed, networks included,
over that of level 0, in turns in one run.
"""

import argparse
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.commands.exported import ExportLook, Part, bake_part  # noqa: E402
from shapeshift.app.streaming.level_errors import COVERED, LevelMeter, change_of, psnr_of  # noqa: E402
from shapeshift.app.streaming.package_levels import (  # noqa: E402
    SHARES,
    make_levels,
    standing,
)
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.lod.average_anchors import average_anchors, cell_for  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers, Stop  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.layers.read_layers import join_layers  # noqa: E402
from shapeshift.runtime_models.splats.operations.decimate import decimate  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SIZES_PX = (300.0, 150.0, 75.0, 37.5)  # 1, 2, 4 and 8 times as far
SPLAT_BYTES = 14  # of a baked splat, as lod.csv has them
FRAMES = 24
QUARTERS = (0.25, 0.75)
HEAD = (
    "scene,level,form,anchors_or_splats,bytes,of_package,cpu_s_learning,pixels,db_stops,db_halfway,"
    "db_quarter,db_own_pixels,change_255,frame_ratio"
)


def baked(model: AnchorModel, size: int) -> SplatLayers:
    """Splats of all stops and half-way between them in about so many bytes, colours as shown."""
    stops = sorted(stop.x for stop in model.stops)
    xs = sorted([*stops, *((a + b) / 2 for a, b in pairwise(stops))])
    parts = [bake_part(Part(SceneObject("it", model, x=x)), ExportLook(0)) for x in xs]
    names = tuple(Stop(f"at {x:g}", x) for x in xs)
    layers = join_layers(parts, names, "exclusive", [])
    return decimate(layers, size // SPLAT_BYTES)


def at_quarters(meter: LevelMeter) -> None:
    """Lets the meter look at quarters of the way, too, at even pace."""
    stops = meter.xs["stops"]
    pairs = list(pairwise(stops))
    meter.xs["quarter"] = [a + part * (b - a) for a, b in pairs for part in QUARTERS]


def own_psnr(one: list, other: list) -> float:
    """dB over the pixels that either of two pictures covers, the mean of squares over pictures."""
    squares = []
    for (a, alpha), (b, beta) in zip(one, other, strict=True):
        covered = np.maximum(alpha, beta) >= COVERED
        squares.append(np.square(a - b, dtype=np.float64)[covered].mean())
    return float(-10 * np.log10(np.mean(squares)))


def frame_ratio(whole: AnchorModel, other: Model, meter: LevelMeter, pixels: float) -> float:
    """Processor time of frames whose x changes, over that of the whole model."""
    (view,) = meter.views(pixels, 1)
    models, seconds = (whole, other), [0.0, 0.0]
    renderers = [Renderer(None, "tiles") for _ in models]
    for frame in range(FRAMES + 3):
        for i, (renderer, model) in enumerate(zip(renderers, models, strict=True)):
            began = time.process_time()
            renderer.update(Scene((SceneObject("it", model, x=frame / (FRAMES + 3)),)))
            renderer.draw([view])
            seconds[i] += time.process_time() - began if frame >= 3 else 0.0
    for renderer in renderers:
        renderer.close()
    return seconds[1] / seconds[0]


def rows_of(path: Path, seconds: float) -> list[str]:
    model = read_model(path)
    assert isinstance(model, AnchorModel), f"{path} is no package"
    # At even pace x half-way is the middle of the blend: what baked splats were baked at.
    model = replace(model, pace=())
    began = time.process_time()
    made = make_levels(model, seconds, lambda what, part: None)
    rows = [f"# {path.name}: {time.process_time() - began:.0f} processor seconds in all"]
    package = path.stat().st_size
    with LevelMeter(model) as meter:
        at_quarters(meter)
        sizes = [*SIZES_PX, *(level.anchors.from_pixels for level in made.levels)]
        truth = {pixels: meter.pictures(meter.model, pixels) for pixels in sizes}
        for number, level in enumerate(made.levels):
            size, begins = len(level.table), level.anchors.from_pixels
            averaged = average_anchors(meter.model, cell_for(model, SHARES[number]))
            forms: dict[str, Model] = {
                "learned": standing(model, level.anchors),
                "averaged": averaged,
                "baked": baked(model, size),
            }
            for form, other in forms.items():
                count = other.splat_count if form == "baked" else len(cast(Any, other).anchors)
                for pixels in (begins, *SIZES_PX):
                    mine = meter.pictures(cast(Any, other), pixels)
                    db = [psnr_of(mine[at], truth[pixels][at]) for at in mine]
                    db.append(own_psnr(mine["stops"], truth[pixels]["stops"]))
                    change = change_of(mine["stops"], truth[pixels]["stops"])
                    ratio = frame_ratio(meter.model, other, meter, pixels)
                    values = ",".join(f"{value:.2f}" for value in db)
                    took = f"{seconds:g}" if form == "learned" else "0"
                    what = f"{path.name},{number + 1},{form},{count},{size},{size / package:.3f}"
                    rows.append(f"{what},{took},{pixels:.0f},{values},{change:.2f},{ratio:.2f}")
                    print(rows[-1], flush=True)  # noqa: T201
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("packages", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = [row for path in options.packages for row in rows_of(path, options.seconds)]
    if options.out:
        names = " ".join(path.name for path in options.packages)
        command = f"python tools/runtime_models/anchor_lod.py {names}"
        head = f"# {command} --out docs/bench/{options.out.name}"
        options.out.write_text("\n".join([head, HEAD, *rows, ""]))


if __name__ == "__main__":
    main()
