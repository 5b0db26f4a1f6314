"""Decoding beside onnxruntime with one thread, in CPU milliseconds of the process, all in one run.

    python3 tools/renderer/decode_gl.py [--anchors 4000 40000 100000] > docs/bench/decode_gl.csv

floor: the networks as a package holds them, inputs ready in memory, outputs left where they fall.
The back ends end with splats in the arena, uploaded and packed; "networks alone" is what of it
the default back end spends before that.  Medians; a new x and a new eye each time.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from statistics import median

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.rasterizer.device import NoDevice  # noqa: E402
from shapeshift.renderer.colors.false_colors import Shade  # noqa: E402
from shapeshift.renderer.gl.buffers import Arena  # noqa: E402
from shapeshift.renderer.gl.context import open_context  # noqa: E402
from shapeshift.renderer.gl.decode import MLPS, Decoder  # noqa: E402
from shapeshift.renderer.gl.gpu import Gpu  # noqa: E402
from shapeshift.runtime_models.evaluate import BATCH, Evaluator, directions  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.package.package_files import write_onnx  # noqa: E402
from shapeshift.runtime_models.session import open_session  # noqa: E402
from tests.support.splat_scenes import random_model  # noqa: E402

LIMITS = {"onnxruntime": 1.2, "gl": 15.0}  # times the floor
RUNS = 7
EYE = np.array([0.0, 0.3, 3.0])


def median_ms(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """CPU milliseconds of the process for one run of each job, in turns: load meets all alike."""
    taken = {name: [] for name in jobs}
    for _ in range(RUNS + 1):  # the first one compiles
        for name, job in jobs.items():
            start = time.process_time()
            job()
            taken[name].append(1e3 * (time.process_time() - start))
    return {name: median(times[1:]) for name, times in taken.items()}


def floors(model: AnchorModel) -> dict[str, Callable[[], object]]:
    """Plain runs of the sessions, all five networks and colour alone."""
    rows = np.arange(len(model.anchors))
    inputs = {
        "feature": model.features,
        "direction": directions(model.anchors, EYE),
        "control": np.tile(model.encoding.encode(0.4), (len(rows), 1)).astype(np.float32),
    }
    ready = {}
    for name, mlp in model.networks.items():
        whole = np.concatenate([inputs[part] for part in mlp.inputs], axis=1)
        parts = [np.ascontiguousarray(whole[i : i + BATCH]) for i in range(0, len(rows), BATCH)]
        ready[name] = (open_session(write_onnx(mlp, name), 1), parts)

    def run(names: tuple[str, ...]) -> None:
        for session, parts in (ready[name] for name in names):
            for part in parts:
                session.run(["output"], {"input": part})

    return {"all five": lambda: run(tuple(ready)), "colour alone": lambda: run(("color",))}


def decoding(geometry: Callable, color: Callable, finish: Callable) -> dict[str, Callable]:
    """The same two jobs by one of ours."""
    turn = count()

    def colors(x: float) -> None:
        color(0, x, EYE + 0.01 * next(turn))
        finish()

    def everything() -> None:
        x = next(turn) % 1000 / 1000
        geometry(0, x)
        colors(x)

    return {"all five": everything, "colour alone": lambda: colors(0.4)}


def rows_of(gpu: Gpu, anchors: int) -> list[tuple]:
    """(back end, job, ms, floor, limit) of one number of anchors."""
    model = random_model(anchors)
    rows, lowest = [], floors(model)

    def add(back_end: str, limit: float, jobs: dict[str, Callable]) -> None:
        for job, work in jobs.items():
            ms = median_ms({"ours": work, "floor": lowest[job]})
            rows.append((back_end, job, ms["ours"], ms["floor"], limit))

    evaluator = Evaluator(model, keep=True)  # as the drawings have it
    room = np.empty((model.splat_count, 3), np.float32)
    parts = (
        lambda i, x: evaluator.geometry(x, unit=False),
        lambda i, x, eye: evaluator.color(x, eye, out=room),
        int,
    )
    add("networks alone", LIMITS["onnxruntime"], decoding(*parts))
    for mlps in MLPS:
        with Arena(gpu, [model.splat_count]) as arena, Decoder(gpu, arena, [model], mlps) as made:
            add(f"quads, {mlps}", LIMITS[mlps], decoding(made.geometry, made.color, gpu.ctx.finish))
    try:
        from shapeshift.renderer.tiles.tiles import TilesDrawing

        forms = {form: TilesDrawing(mlps=form) for form in ("onnxruntime", "opencl")}
    except NoDevice as reason:
        sys.stderr.write(f"no rows of the tiles: {reason}\n")
        return rows
    for form, drawing in forms.items():
        drawing.allocate([model])

        def shaded(i: int, x: float, eye: np.ndarray, drawing: TilesDrawing = drawing) -> None:
            drawing.decode_color(i, Shade(x), eye)

        parts = (drawing.decode_geometry, shaded, drawing.device.queue.finish)
        add(f"tiles, {form}", LIMITS["onnxruntime"], decoding(*parts))
        drawing.close()
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--anchors", type=int, nargs="+", default=[4_000, 40_000, 100_000])
    counts = parser.parse_args().anchors
    with open_context() as ctx, Gpu(ctx) as gpu:
        lines = [
            f"# python3 tools/renderer/decode_gl.py --anchors {' '.join(map(str, counts))}",
            f"# {ctx.info['GL_RENDERER']}; CPU ms; load {os.getloadavg()[0]:.1f}",
            "anchors,back_end,networks,cpu_ms,floor_ms,over_floor,limit",
        ]
        for anchors in counts:
            for back_end, job, ms, floor, limit in rows_of(gpu, anchors):
                lines.append(
                    f'{anchors},"{back_end}",{job},{ms:.2f},{floor:.2f},{ms / floor:.2f},{limit:g}'
                )
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
