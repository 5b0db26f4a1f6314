"""What --max-splats costs in the picture: ways to choose the splats that stay, at half and less.

    python tools/runtime_models/thin.py SCENE ... --out docs/bench/thin.csv

Each scene is drawn whole and with a part of its splats from views around it; the rows are the mean
PSNR (dB of the mean squared error over all views) against the whole one.  "thin" is what
runtime_models/splats/operations/prune_by_importance.py does; "even"
draws along the Z-curve with chances by a weight.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.drawing import open_renderer  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.operations.morton import morton_order  # noqa: E402
from shapeshift.runtime_models.splats.operations.prune_by_importance import (  # noqa: E402
    evenly,
    largest,
    prominence,
)
from shapeshift.scene.cameras.framing import frame_points, model_points, orbit_path  # noqa: E402
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SIZE = (640, 360)
VIEWS = 8
PARTS = (0.5, 0.25, 0.1)


def ways(model: SplatLayers) -> dict[str, Callable[[int], np.ndarray]]:
    """Ways to choose rows, each a function of how many."""
    _, middle, most = np.sort(model.scales, axis=1).T.astype(np.float64)
    opacity, area = model.opacity.astype(np.float64), middle * most
    order = morton_order(model.means)
    evened = {
        "thin": prominence(model),
        "even: all alike": np.ones_like(area),
        "even: opacity": opacity,
        "even: opacity x area": opacity * area,
        "even: root of opacity x area": np.sqrt(opacity * area),
    }
    ranked = {
        "largest opacity x area": opacity * area,
        "largest opacity x root of area": opacity * np.sqrt(area),
        "largest opacity": opacity,
        "largest area": area,
        "chance": np.random.default_rng(0).random(model.splat_count),
    }
    return {name: partial(evenly, values, order) for name, values in evened.items()} | {
        name: partial(largest, values) for name, values in ranked.items()
    }


def subset(model: SplatLayers, rows: np.ndarray) -> SplatLayers:
    names = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    arrays = {name: getattr(model, name)[rows] for name in names}
    return replace(model, **arrays, labels=None, extra={})


def pictures(renderer, model: SplatLayers, views: list) -> np.ndarray:
    """(V, H, W, 3) of the last stop, where every layer of a cumulative scene is there."""
    renderer.update(Scene((SceneObject("scene", model, x=1.0),)))
    images = []
    for view in views:
        renderer.draw([view])
        images.append(renderer.resolved(0)[..., :3])
    return np.stack(images)


def measure(path: Path, renderer) -> list[str]:
    model = read_model(path)
    views = orbit_path(VIEWS, *frame_points(*model_points(model)), SIZE)
    whole = pictures(renderer, model, views)
    rows = []
    for way, choose in ways(model).items():
        for part in PARTS:
            count = round(part * model.splat_count)
            kept = subset(model, choose(count))
            error = psnr(pictures(renderer, kept, views), whole)
            rows.append(f"{path.name},{model.splat_count},{way},{part},{count},{error:.2f}")
            print(rows[-1], flush=True)  # noqa: T201
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows = []
    with open_renderer("none", "tiles") as (renderer, _):
        for path in options.scenes:
            rows += measure(path, renderer)
    if options.out:
        command = "python tools/runtime_models/thin.py " + " ".join(
            path.name for path in options.scenes
        )
        head = [f"# {command} --out docs/bench/{options.out.name}"]
        head += ["scene,splats,way,part,kept,psnr_db"]
        options.out.write_text("\n".join([*head, *rows, ""]))


if __name__ == "__main__":
    main()
