"""What --max-splats costs in the picture: ways to fewer splats, at half and less.

    python tools/runtime_models/thin.py SCENE ... --out docs/bench/thin.csv

Each scene is drawn whole and with fewer splats from views around it; the rows are the mean PSNR (dB
of the mean squared error over all views) against the whole one at each stop, and the processor
seconds that the way took.  "merge" is --max-splats (runtime_models/splats/operations/decimate.py),
with two other ways to treat an opacity above 1; "prune" is decimate.py beside it;
"even" draws along the Z-curve with chances by a weight.  Where splat-transform is on the PATH
(`npm install @playcanvas/splat-transform`), what its --decimate makes of the same file is measured
too, reading and writing included in its seconds.
"""

import argparse
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.drawing import open_renderer  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.operations import moment_matching  # noqa: E402
from shapeshift.runtime_models.splats.operations.decimate import (  # noqa: E402
    decimate,
    evenly,
    largest,
    prune_by_importance,
)
from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order  # noqa: E402
from shapeshift.scene.cameras.framing import frame_points, model_points, orbit_path  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SIZE = (640, 360)
VIEWS = 8
PARTS = (0.5, 0.25, 0.1)


Way = Callable[[SplatLayers, int], SplatLayers]
OVERLAPS = {"merge": 0.5, "merge: opacity cut at 1": 0.0, "merge: area takes all above 1": 1.0}


def merged(overlap: float, model: SplatLayers, count: int) -> SplatLayers:
    """Decimated, the area taking this power of what is above an opacity of 1."""
    usual, moment_matching.OVERLAP = moment_matching.OVERLAP, overlap
    try:
        return decimate(model, count)
    finally:
        moment_matching.OVERLAP = usual


def sampled(weigh: Callable[[SplatLayers], np.ndarray], model: SplatLayers, count: int):
    return model.with_rows(evenly(weigh(model), morton_order(model.means), count))


def ranked(weigh: Callable[[SplatLayers], np.ndarray], model: SplatLayers, count: int):
    return model.with_rows(largest(weigh(model), count))


def opacity(model: SplatLayers) -> np.ndarray:
    return model.opacity.astype(np.float64)


def area(model: SplatLayers) -> np.ndarray:
    _, middle, most = np.sort(model.scales, axis=1).T.astype(np.float64)
    return middle * most


PEER = "splat-transform"


def decimated_by_peer(path: Path, model: SplatLayers, count: int) -> SplatLayers:
    """What splat-transform makes of the file."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "fewer.ply"
        command = [PEER, "-q", "-g", "cpu", str(path), "--decimate", str(count), str(out)]
        subprocess.run(command, check=True)
        fewer = read_model(out)
        assert isinstance(fewer, SplatLayers)
        return fewer


def cpu_seconds() -> float:
    """Of this process and of those that it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def ways() -> dict[str, Way]:
    """Ways to fewer splats by name."""
    weights = {
        "all alike": lambda model: np.ones(model.splat_count),
        "opacity": opacity,
        "opacity x area": lambda model: opacity(model) * area(model),
        "root of opacity x area": lambda model: np.sqrt(opacity(model) * area(model)),
    }
    ranks = {
        "largest opacity x area": weights["opacity x area"],
        "largest opacity x root of area": lambda model: opacity(model) * np.sqrt(area(model)),
        "largest opacity": opacity,
        "largest area": area,
        "chance": lambda model: np.random.default_rng(0).random(model.splat_count),
    }
    out: dict[str, Way] = {name: partial(merged, value) for name, value in OVERLAPS.items()}
    out["prune"] = prune_by_importance
    out |= {f"even: {name}": partial(sampled, weigh) for name, weigh in weights.items()}
    return out | {name: partial(ranked, weigh) for name, weigh in ranks.items()}


def pictures(renderer, model: SplatLayers, views: list, x: float) -> np.ndarray:
    """(V, H, W, 3) at x."""
    renderer.update(Scene((SceneObject("scene", model, x=x),)))
    images = []
    for view in views:
        renderer.draw([view])
        images.append(renderer.resolved(0)[..., :3])
    return np.stack(images)


def measure(path: Path, renderer) -> list[str]:
    model = read_model(path)
    assert isinstance(model, SplatLayers)
    views = orbit_path(VIEWS, *frame_points(*model_points(model)), SIZE)
    whole = {stop.x: pictures(renderer, model, views, stop.x) for stop in model.stops}
    rows = []
    offered = ways()
    if shutil.which(PEER) and path.is_file():
        offered[f"{PEER} --decimate"] = partial(decimated_by_peer, path)
    for name, way in offered.items():
        for part in PARTS:
            count = round(part * model.splat_count)
            began = cpu_seconds()
            fewer = way(model, count)
            seconds = cpu_seconds() - began
            facts = f"{path.name},{model.splat_count},{name},{part},{fewer.splat_count}"
            for x, picture in whole.items():
                error = psnr(pictures(renderer, fewer, views, x), picture)
                rows.append(f"{facts},{x:g},{error:.2f},{seconds:.2f}")
                print(rows[-1], flush=True)  # noqa: T201
    return rows


def write_scenes(
    doc: str | None, columns: str, measure: Callable[[Path, Renderer], list[str]]
) -> None:
    """Measures every scene that is named; the rows go below their command into --out."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = []
    with open_renderer("none", "tiles") as (renderer, _):
        for path in options.scenes:
            rows += measure(path, renderer)
    if options.out:
        names = " ".join(path.name for path in options.scenes)
        program = f"python tools/runtime_models/{Path(sys.argv[0]).name}"
        head = [f"# {program} {names} --out docs/bench/{options.out.name}", columns]
        options.out.write_text("\n".join([*head, *rows, ""]))


if __name__ == "__main__":
    write_scenes(__doc__, "scene,splats,way,part,kept,x,psnr_db,cpu_s", measure)
