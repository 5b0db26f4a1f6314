"""What a frame costs when the same splats are several objects instead of one model.

    python tools/scene/objects.py LEG_FOLDER --out docs/bench/objects.csv

The splats (anchors) of a scene are dealt to 3 to 20 objects, so that all of them lie in each other
and only one order over all of them is right; the merged model holds the same in the same order.
Both are drawn in turns in one run: CPU ms are those of this process with all its threads, and
over_merged is their ratio.  What changes from frame to frame: "eye" - the eye goes around, all
colours run; "poses" - every object moves a little, the merged model as a whole; "x of one" - one
object changes x a little, for which the merged model has to decode all.  equal: whether both
pictures are the same to the bit (dB where they are not).  decode_ms and project_ms are wall ms of
the objects.
"""

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from shapeshift.app.charts.chart_rows import write_lines  # noqa: E402
from shapeshift.app.charts.chart_scene import Walk, arc  # noqa: E402
from shapeshift.renderer.gl.context import NoContext, open_context  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.cameras.framing import default_view, frame_points, model_points  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.pose import Pose, View  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

COUNTS = (3, 5, 10, 20)
CHANGES = ("eye", "poses", "x of one")
WARM_UP = 3
STEP_M = 1e-3  # of the radius, a frame: of objects that move
X_STEP = 1e-4  # a frame: so little that both draw the same, and all that changes is decoded
COLUMNS = (
    "scene,splats,drawing,size,objects,change,cpu_ms_p50,merged_cpu_ms_p50,over_merged,"
    "decode_ms,project_ms,equal"
)


def rows_of(model: Model, rows: np.ndarray) -> Model:
    """The model of these rows alone."""
    if isinstance(model, AnchorModel):
        return model.with_anchors(rows)
    assert isinstance(model, SplatLayers)
    return model.with_rows(rows)


def deal(model: Model, count: int) -> tuple[list[Model], Model]:
    """`count` models that take a row each in turns, and all of them joined in that order."""
    total = model.splat_count if isinstance(model, SplatLayers) else len(model.anchors)
    hands = [np.arange(first, total, count) for first in range(count)]
    return [rows_of(model, rows) for rows in hands], rows_of(model, np.concatenate(hands))


def moved(models: list[Model], x: float, by: np.ndarray, one_x: float) -> Scene:
    """All objects moved by (3,) metres; the first at another x."""
    pose = Pose(by, np.array([1.0, 0.0, 0.0, 0.0]))
    xs = [one_x] + [x] * (len(models) - 1)
    objects = zip(models, xs, strict=True)
    return Scene(tuple(SceneObject(f"{i}", m, pose, x) for i, (m, x) in enumerate(objects)))


def frames_of(
    model: Model, change: str, frames: int, size: tuple[int, int]
) -> list[tuple[Callable[[list[Model]], Scene], View]]:
    """(scene of models, view) of every frame, warm-up first."""
    first = default_view(model, size)
    centre, radius = frame_points(*model_points(model))
    path = arc(first, centre, Walk(frames=frames))
    x, rest = model.stops[0].x, np.zeros(3)
    out = []
    for i, view in enumerate(path, -WARM_UP):
        by = np.array([STEP_M * radius * math.sin(i), 0, 0]) if change == "poses" else rest
        one_x = x + X_STEP * (i + WARM_UP + 1) if change == "x of one" else x
        seen = view if change == "eye" else first
        out.append((lambda m, by=by, one=one_x: moved(m, x, by, one), seen))
    return out


def timed(renderer: Renderer, scene: Scene, view: View, ctx) -> tuple[float, dict]:
    """CPU ms of update and draw, and ms of the passes."""
    start = time.process_time()
    renderer.update(scene)
    stats = renderer.draw([view])
    if ctx is not None:
        ctx.finish()
    return (time.process_time() - start) * 1e3, stats.ms


def compare(
    pair: tuple[Renderer, Renderer], ctx, model: Model, count: int, change: str, options
) -> list:
    """The last columns of one row."""
    parts, merged = deal(model, count)
    apart_ms, merged_ms, passes, decibels = [], [], [], []
    for i, (scene_of, view) in enumerate(frames_of(model, change, options.frames, options.size)):
        jobs = [(pair[0], scene_of(parts)), (pair[1], scene_of([merged]))]
        turns = jobs if i % 2 else jobs[::-1]
        done = {id(r): timed(r, scene, view, ctx) for r, scene in turns}
        if change != "x of one":  # there the merged model has another x as a whole
            decibels.append(psnr(pair[0].image(), pair[1].image()))
        if i >= WARM_UP:
            apart_ms.append(done[id(pair[0])][0])
            merged_ms.append(done[id(pair[1])][0])
            passes.append(done[id(pair[0])][1])
    mine, other = np.median(apart_ms), np.median(merged_ms)
    cells = [f"{np.median([p.get(name, 0) for p in passes]):.2f}" for name in ("decode", "project")]
    least = min(decibels, default=None)
    equal = "" if least is None else "yes" if math.isinf(least) else f"{least:.0f}"
    return [f"{mine:.2f}", f"{other:.2f}", f"{np.median(np.divide(apart_ms, merged_ms)):.2f}",
            *cells, equal]  # fmt: skip


def measure(name: str, model: Model, drawing: str, ctx, options) -> list[str]:
    """Rows of one scene in one drawing."""
    rows = []
    size = f"{options.size[0]}x{options.size[1]}"
    for count in options.counts:
        with Renderer(ctx, drawing) as one, Renderer(ctx, drawing) as other:
            for change in CHANGES:
                cells = compare((one, other), ctx, model, count, change, options)
                about = [name, str(model.splat_count), drawing, size, str(count), change]
                rows.append(",".join(about + cells))
                sys.stderr.write(rows[-1] + "\n")
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("leg", type=Path, help="folder of PLY layers, degree 3")
    parser.add_argument("--out", type=Path, help="CSV file; default: the terminal")
    parser.add_argument("--frames", type=int, default=16)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--drawing", nargs="+", default=("tiles", "quads"))
    options = parser.parse_args()
    options.size = (640, 360)
    models = {
        "leg SH3": read_model(options.leg),
        "workshop": read_model(ROOT / "assets" / "workshop.shift"),
    }
    rows, gl = [], "none"
    for drawing in options.drawing:
        ctx = None
        if drawing == "quads":
            try:
                ctx = open_context()
            except NoContext as reason:
                sys.stderr.write(f"Quads are left out: {reason}\n")
                continue
            gl = ctx.info["GL_RENDERER"]
        for name, model in models.items():
            rows += measure(name, model, drawing, ctx, options)
    from shapeshift.rasterizer.device import open_device

    words = f"python tools/scene/objects.py {options.leg.name} --frames {options.frames}"
    words += f" --out {options.out.name}" if options.out else ""
    load = f"load average {os.getloadavg()[0]:.1f} at the end"
    head = [f"# {words}", f"# OpenCL {open_device().platform}; GL {gl}; {load}", COLUMNS]
    write_lines(options.out, [*head, *rows])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
