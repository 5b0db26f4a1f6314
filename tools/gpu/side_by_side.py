"""What drawing and training ask of a graphics card, counted without one.

    python3 tools/gpu/side_by_side.py --part counts > docs/bench/gpu_counts.csv

Frames of every kind by quads (GL, on software where there is no other) and by tiles (the kernels
for a card, on PoCL), and training steps: how often each waits for the card, what it launches,
uploads and makes.  Scenes are small and made by rule, since their size changes no number but bytes:
anchors with a thermal stop, plain splats in layers.  --demo counts the frames of the demo, too.

Times beside other programs need a card; there is no part for them yet.
"""

import argparse
import csv
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.terminal import print_text  # noqa: E402
from shapeshift.renderer.gl.context import open_context  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.cameras.framing import orbit_path  # noqa: E402
from shapeshift.scene.pose import stereo_pair  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.balls import make_balls  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from tests.support.renderer.heat_scenes import model as anchors_model  # noqa: E402
from tests.support.splat_scenes import random_layers  # noqa: E402
from tools.gpu.counting import COUNTS, Counted, counting_cl, counting_gl  # noqa: E402

COLUMNS = ("drawing", "scene", "frame", *COUNTS, "bytes_a_splat")
SIZE = (64, 36)
BETWEEN = 0.34  # an x between two stops, of which the second is of values where there are anchors
# kind of frame: (x before and now, does the camera move, eyes, presented, depth)
FRAMES = {
    "at rest": ((0.0, 0.0), False, 1, False, False),
    "camera": ((0.0, 0.0), True, 1, False, False),
    "camera, between stops, presented": ((BETWEEN, BETWEEN), True, 1, True, False),
    "slider": ((BETWEEN - 0.03, BETWEEN), False, 1, False, False),
    "slider and camera, presented": ((BETWEEN - 0.03, BETWEEN), True, 1, True, False),
    "two eyes, between stops": ((BETWEEN, BETWEEN), True, 2, False, False),
    "two eyes, slider": ((BETWEEN - 0.03, BETWEEN), False, 2, False, False),
    "two eyes and depth, on a stop": ((0.0, 0.0), True, 2, False, True),
}
PLAIN = ("at rest", "camera", "slider", "two eyes, between stops")  # of plain splats
WARM = 4  # frames of a kind before the one that is counted
STEPS = 10  # of training; the first two compile and make


def made_scenes() -> dict[str, Scene]:
    """Name -> scene."""
    layers = random_layers(300, coefficients=4, layers=3)
    models = {"anchors": anchors_model(), "layers": layers}
    return {name: Scene((SceneObject("thing", made),)) for name, made in models.items()}


def at(scene: Scene, x: float) -> Scene:
    return Scene(tuple(replace(obj, x=x) for obj in scene.objects))


def frames_of(renderer: Renderer, scene: Scene, told: Counted) -> Iterator[tuple[str, dict]]:
    """(kind, counts) of frames that a renderer draws of a scene, each after WARM of its kind."""
    gpu, path = renderer.gpu, iter(orbit_path(200, np.zeros(3), 1.0, SIZE))
    screen = gpu.ctx.framebuffer([gpu.ctx.texture(SIZE, 4)]) if gpu is not None else None
    layers = isinstance(scene.objects[0].model, SplatLayers)
    for kind, (xs, moves, eyes, presented, depth) in FRAMES.items():
        if (layers and kind not in PLAIN) or (presented and screen is None):
            continue
        renderer.settings = replace(renderer.settings, depth_scale=0.5 if depth else 0.0)
        view = next(path)
        for x in np.linspace(*xs, WARM + 1):
            view = next(path) if moves else view
            if gpu is not None:
                gpu.ctx.finish()  # so that what is counted depends on no clock
            told.counts.clear()
            renderer.update(at(scene, float(x)))
            renderer.draw(stereo_pair(view, 0.064) if eyes == 2 else [view],
                          screen if presented else None)  # fmt: skip
        yield kind, {name: told.counts[name] for name in COUNTS}


def bytes_a_splat(renderer: Renderer) -> int:
    """Of the arena's buffers that have a row a splat, as large as the frames have made them."""
    arena = renderer.drawing.arena  # type: ignore[attr-defined]  # of quads
    rows = (arena.mean_opacity, arena.covariance, *arena.colors, arena.records, arena.keys,
            arena.keys_spare, arena.order, arena.order_spare)  # fmt: skip
    return sum(buffer.size for buffer in rows) // arena.count


def count_quads(scenes: dict[str, Scene]) -> Iterator[dict]:
    """Rows of the frames that GL draws."""
    with counting_gl() as told, open_context() as ctx:
        for name, scene in scenes.items():
            with Renderer(ctx, "quads", "gl", "gl") as renderer:
                for kind, counts in frames_of(renderer, scene, told):
                    memory = bytes_a_splat(renderer)
                    row = {"drawing": "quads", "scene": name, "frame": kind, **counts}
                    yield {**row, "bytes_a_splat": memory}


def count_tiles(scenes: dict[str, Scene]) -> Iterator[dict]:
    """Rows of the frames that OpenCL draws."""
    with counting_cl() as (told, _):
        for name, scene in scenes.items():
            with Renderer(None, "tiles") as renderer:
                for kind, counts in frames_of(renderer, scene, told):
                    yield {"drawing": "tiles", "scene": name, "frame": kind, **counts}


def count_training(folder: Path) -> Iterator[dict]:
    """A row of the steps of a small capture: the most that one of them asks for."""
    capture = make_balls(folder, size=32, views=2, test_views=1)
    settings = TrainSettings(iterations=STEPS, grow=False, max_anchors=200)
    most = dict.fromkeys(COUNTS, 0)
    with counting_cl() as (told, device):
        steps = Trainer(device, capture, settings).steps()
        for number in range(STEPS):
            told.counts.clear()
            next(steps)
            if number >= 2:
                most = {name: max(most[name], told.counts[name]) for name in COUNTS}
    yield {"drawing": "training", "scene": "balls", "frame": "a step, at most", **most}


def count_rows(scenes: dict[str, Scene], folder: Path) -> Iterator[dict]:
    """All rows, of COLUMNS."""
    yield from count_quads(scenes)
    yield from count_tiles(scenes)
    yield from count_training(folder)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--part", choices=("counts",), default="counts")
    parser.add_argument("--demo", action="store_true", help="count the demo's frames, too")
    options = parser.parse_args()
    scenes = made_scenes()
    if options.demo:
        demo = read_model(ROOT / "assets/workshop.shift")
        scenes["demo"] = Scene((SceneObject("demo", demo),))
    print_text("# python3 tools/gpu/side_by_side.py --part counts" + " --demo" * options.demo)
    print_text("# one frame each on llvmpipe (quads), and on PoCL with a card's kernels (tiles and "
               "training); counted, no time is in it")  # fmt: skip
    out = csv.DictWriter(sys.stdout, COLUMNS, lineterminator="\n")
    out.writeheader()
    with tempfile.TemporaryDirectory() as folder:
        out.writerows(count_rows(scenes, Path(folder)))


if __name__ == "__main__":
    main()
