"""Our OpenCL networks beside onnxruntime's, packing into the arena included, in one run.

    python3 tools/renderer/decode_heads.py > docs/bench/decode_heads.csv  # --anchors N ...

Processor ms of the process with all its threads, medians of runs in turns; another x and eye each
time.  alone_ms: the five sessions as a package holds them, inputs ready in memory, outputs left
where they fall.  onnxruntime_ms: Psi folded in, and what comes out packed into the arena, as the
tiles did before; opencl_ms: the kernel, which writes there.  likeness: of means, opacities and
colours the largest difference over the larger of 1 and the largest, of covariances that over each
splat's largest variance; of frames dB.  "frame": the bundled demo in 1280x720, another x each time.
"cold": processes of their own that decode 100 anchors, less what the same costs once more: kernels
compiled with an empty cache, then with what that left in it; onnxruntime loaded, its sessions open.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from statistics import median

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.renderer.colors.false_colors import Shade  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.renderer.tiles.tiles import TilesDrawing  # noqa: E402
from shapeshift.runtime_models.evaluate import BATCH, directions  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.package.package_files import write_onnx  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.session import open_session  # noqa: E402
from shapeshift.scene.pose import View, look_at  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from tests.support.splat_scenes import psnr_db, random_model  # noqa: E402

DEMO = ROOT / "assets" / "workshop.shift"
FORMS = ("onnxruntime", "opencl")
RUNS = 15
EYE = np.array([0.0, 1.0, 3.0])
HEADER = "what,scene,anchors,alone_ms,onnxruntime_ms,opencl_ms,over_alone,over_onnxruntime,likeness"


def resampled(model: AnchorModel, anchors: int) -> AnchorModel:
    """The demo's networks for so many anchors: its own again and again, features a little off."""
    model = model.with_anchors(np.arange(anchors) % len(model.anchors))
    noise = np.random.default_rng(0).normal(size=model.features.shape) * 0.01
    return replace(model, features=model.features + noise.astype(np.float32))


def median_ms(jobs: dict[str, Callable[[], object]], runs: int = RUNS) -> dict[str, float]:
    """Processor milliseconds of a run of each job, in turns: load meets all alike."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(runs + 1):  # the first one compiles
        for name, job in jobs.items():
            start = time.process_time()
            job()
            taken[name].append(1e3 * (time.process_time() - start))
    return {name: median(times[1:]) for name, times in taken.items()}


def alone(model: AnchorModel) -> dict[str, Callable[[], object]]:
    """Plain runs of the sessions: of the shape, and of the colours."""
    rows = len(model.anchors)
    inputs = {
        "feature": model.features,
        "direction": directions(model.anchors, EYE),
        "control": np.tile(model.psi(0.4), (rows, 1)).astype(np.float32),
    }
    ready = {}
    for name, mlp in model.networks.items():
        whole = np.concatenate([inputs[part] for part in mlp.inputs], axis=1)
        parts = [np.ascontiguousarray(whole[i : i + BATCH]) for i in range(0, rows, BATCH)]
        ready[name] = (open_session(write_onnx(mlp, name), 1), parts)

    def run(names: tuple[str, ...]) -> None:
        for session, parts in (ready[name] for name in names):
            for part in parts:
                session.run(["output"], {"input": part})

    shape = tuple(name for name in ready if name != "color")
    return {"all five": lambda: run((*shape, "color")), "colours": lambda: run(("color",))}


def decoding(drawing: TilesDrawing) -> dict[str, Callable[[], object]]:
    """The same two jobs into the arena."""
    turn = count()

    def colors(x: float) -> None:
        drawing.decode_color(0, Shade(x), EYE + 0.01 * (next(turn) % 7))
        drawing.wait_decoded()

    def everything() -> None:
        x = next(turn) * 37 % 1000 / 1000
        drawing.decode_geometry(0, x)
        colors(x)

    return {"all five": everything, "colours": lambda: colors(0.4)}


def worst(drawings: dict[str, TilesDrawing]) -> float:
    """The largest difference over some x, as the heading says."""
    largest = 0.0
    for x in (0.0, 0.3, 0.5, 0.8, 1.0):
        found = []
        for drawing in drawings.values():
            drawing.decode_geometry(0, x)
            drawing.decode_color(0, Shade(x), EYE)
            found.append((*drawing.read_splats(0), drawing.read_colors(0)[0]))
        (mean, sigma, color), (mean2, sigma2, color2) = found
        for one, other in ((mean, mean2), (color, color2)):
            difference = float(np.abs(one - other).max()) / max(1.0, float(np.abs(one).max()))
            largest = max(largest, difference)
        of_splat = np.abs(sigma).max(axis=1)
        largest = max(largest, float((np.abs(sigma - sigma2).max(axis=1) / of_splat).max()))
    return largest


def rows_of(name: str, model: AnchorModel) -> list[str]:
    drawings = {form: TilesDrawing(mlps=form) for form in FORMS}
    for drawing in drawings.values():
        drawing.allocate([model])
    jobs, lowest, lines = {f: decoding(d) for f, d in drawings.items()}, alone(model), []
    likeness = worst(drawings)
    for job in lowest:
        ms = median_ms({"alone": lowest[job]} | {form: jobs[form][job] for form in FORMS})
        lines.append(line(job, name, len(model.anchors), ms, f"{likeness:.1e}"))
    for drawing in drawings.values():
        drawing.close()
    return lines


def line(what: str, scene: str, anchors: int, ms: dict[str, float], likeness: str) -> str:
    ours, theirs, least = ms["opencl"], ms["onnxruntime"], ms.get("alone")
    first = ("", "") if least is None else (f"{least:.2f}", f"{ours / least:.2f}")
    return (
        f"{what},{scene},{anchors},{first[0]},{theirs:.2f},{ours:.2f},{first[1]},"
        f"{ours / theirs:.2f},{likeness}"
    )


def frame_row(model: AnchorModel) -> str:
    """A frame of the demo whose x changes each time, and the least dB between the two forms."""
    centre = model.anchors.mean(axis=0).astype(np.float64)
    pose = look_at(centre + np.array([0.6, 0.5, 1.6]), centre)
    view = View(pose, (-0.5, 0.5, -0.28, 0.28), 0.05, 50, (1280, 720))
    renderers = {form: Renderer(None, "tiles", form) for form in FORMS}
    turns = {form: count() for form in FORMS}

    def draw(form: str) -> None:
        x = next(turns[form]) * 37 % 100 / 100
        renderers[form].update(Scene((SceneObject("demo", model, x=x),)))
        renderers[form].draw([view])

    ms = median_ms({form: lambda form=form: draw(form) for form in FORMS}, 40)
    least = np.inf
    for _ in range(8):
        for form in FORMS:
            draw(form)
        least = min(least, psnr_db(*(renderers[form].image(0) for form in FORMS)))
    for renderer in renderers.values():
        renderer.close()
    return line("frame", "demo", len(model.anchors), ms, f"{least:.0f} dB")


def cold(form: str) -> None:
    """In a process of its own: what the first decoding costs more than the second, ms."""
    demo = read_model(DEMO)
    assert isinstance(demo, AnchorModel)
    model = demo.with_anchors(slice(0, 100))
    open_device()
    taken = []
    for _ in range(2):
        start = time.process_time()
        drawing = TilesDrawing(mlps=form)
        drawing.allocate([model])
        drawing.decode_geometry(0, 0.3)
        drawing.decode_color(0, Shade(0.3), EYE)
        drawing.wait_decoded()
        taken.append(1e3 * (time.process_time() - start))
    sys.stdout.write(f"{taken[0] - taken[1]:.1f}\n")


def cold_rows() -> list[str]:
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for what in ("cold, cache empty", "cold, cache warm"):
            ms = {}
            for form in FORMS:
                own = Path(folder) / form
                own.mkdir(exist_ok=True)
                command = [sys.executable, "-P", __file__, "--cold", form]
                surroundings = os.environ | {"POCL_CACHE_DIR": str(own)}
                done = subprocess.run(
                    command, env=surroundings, capture_output=True, text=True, check=True
                )
                ms[form] = float(done.stdout)
            lines.append(line(f'"{what}"', "demo", 100, ms, ""))
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--anchors", type=int, nargs="+", default=[10_000, 50_000, 100_000])
    parser.add_argument("--cold", choices=FORMS, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.cold:
        cold(asked.cold)
        return
    device, demo = open_device(), read_model(DEMO)
    assert isinstance(demo, AnchorModel)
    counts = " ".join(map(str, asked.anchors))
    lines = [
        f"# python3 tools/renderer/decode_heads.py --anchors {counts}",
        f"# {device.name}; {device.platform}; processor ms; load {os.getloadavg()[0]:.1f}",
        HEADER,
    ]
    for anchors in asked.anchors:
        lines += rows_of("demo", resampled(demo, anchors))
        lines += rows_of("random weights", random_model(anchors, per_anchor=5))
    lines += [frame_row(demo), *cold_rows()]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
