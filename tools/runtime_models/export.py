"""What an export keeps: bytes, splats and likeness of the written file, by format and SH degree.

    python3 tools/runtime_models/export.py --out docs/bench/export.csv [--leg FOLDER_OF_LAYERS]

The bundled demo at its stops and between them, and the Leg at x = 0.5.  Each file is written as
`launch.py export` does, read back, and drawn from an orbit beside the scene itself at that x.
psnr_db is the worst and psnr_mean_db the mean picture; codes_db is the mean against the same splats
before they were written: what the format's own rounding costs.
"""

import argparse
import csv
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.app.commands.exported import ExportLook, Part, bake_part, export  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.runtime_models.model import SplatLayers, Stop  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.runtime_models.splats.plain_splats import PlainSplats  # noqa: E402
from shapeshift.runtime_models.splats.write_plain import WRITERS  # noqa: E402
from shapeshift.scene.cameras.framing import (  # noqa: E402
    default_background,
    frame_points,
    model_points,
    orbit_path,
)
from shapeshift.scene.metrics import psnr  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

DEMO = HERE.parents[1] / "assets" / "workshop.shift"
SIZE = (480, 320)
VIEWS = 8
DEGREES = (0, 1, 2, 3)
MOST_DB = 200.0  # stands for equal pictures
COLUMNS = (
    "scene", "x", "stop", "format", "sh_degree", "splats", "bytes", "psnr_db", "psnr_mean_db",
    "codes_db",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--leg", type=Path)
    options = parser.parse_args()
    demo = read_model(DEMO)
    stops = sorted(stop.x for stop in demo.stops)
    values = sorted(stops + [(a + b) / 2 for a, b in pairwise(stops)])
    cases = [("workshop", demo, x) for x in values]
    if options.leg:
        cases.append(("leg", read_model(options.leg), 0.5))
    with options.out.open("w", newline="") as file:
        file.write(
            f"# python3 tools/runtime_models/{Path(__file__).name} --out export.csv --leg LEG\n"
        )
        file.write(f"# {VIEWS} views of {SIZE[0]}x{SIZE[1]}, tiles\n")
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        with Renderer(None) as renderer, tempfile.TemporaryDirectory() as folder:
            for name, model, x in cases:
                rows.writerows(measure(renderer, name, model, x, Path(folder)))
                file.flush()


def measure(renderer: Renderer, name: str, model, x: float, folder: Path) -> list[dict]:
    """The rows of one scene at one x."""
    background = default_background(model, (0.0, 0.0, 0.0))
    renderer.settings = type(renderer.settings)(background=background)
    obj = SceneObject(name, model, x=x)
    views = orbit_path(VIEWS, *frame_points(*model_points(model)), SIZE)
    wanted = draw(renderer, obj, views)
    stop = next((stop.name for stop in model.stops if stop.x == x), "")
    rows = []
    for degree in DEGREES:
        look = ExportLook(degree)
        baked = draw(renderer, as_object(bake_part(Part(obj), look)), views)
        for writer in WRITERS:
            if degree > writer.sh_degree:
                continue
            path = folder / f"out{writer.ending}"
            splats = export([Part(obj)], look, path, lambda *_: None)
            found = draw(renderer, SceneObject("file", read_model(path)), views)
            likeness = [psnr(a, b) for a, b in zip(found, wanted, strict=True)]
            codes = [psnr(a, b) for a, b in zip(found, baked, strict=True)]
            row = (
                name, f"{x:g}", stop, writer.ending, degree, len(splats.means),
                path.stat().st_size, db_text(min(likeness)), db_text(float(np.mean(likeness))),
                db_text(float(np.mean(np.minimum(codes, MOST_DB)))),
            )  # fmt: skip
            rows.append(dict(zip(COLUMNS, row, strict=True)))
    return rows


def as_object(splats: PlainSplats) -> SceneObject:
    """Plain splats as an object with one stop, at the same places."""
    arrays = (splats.means, splats.scales, splats.wxyz, splats.opacity, splats.sh)
    layer, stops = np.zeros(len(splats.means), np.int32), (Stop("only", 0.0),)
    return SceneObject("baked", SplatLayers(*arrays, layer, stops))


def draw(renderer: Renderer, obj: SceneObject, views: list) -> list[np.ndarray]:
    renderer.update(Scene((obj,)))
    pictures = []
    for view in views:
        renderer.draw([view])
        pictures.append(renderer.resolved(0))
    return pictures


def db_text(db: float) -> str:
    return f"{min(db, MOST_DB):.2f}"


if __name__ == "__main__":
    main()
