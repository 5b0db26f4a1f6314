"""The picture in docs/viewer.md: the demo at its stops and half-way between, from three places.

python3 tools/pictures/demo_picture.py [docs/demo.png]
"""

import argparse
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.drawing import save_png  # noqa: E402
from shapeshift.app.stability_cases.case_context import turned_about  # noqa: E402
from shapeshift.renderer.renderer import Renderer  # noqa: E402
from shapeshift.renderer.settings import RenderSettings  # noqa: E402
from shapeshift.runtime_models.package.read_package import read_package  # noqa: E402
from shapeshift.scene.cameras.framing import default_view  # noqa: E402
from shapeshift.scene.scene import Scene, SceneObject  # noqa: E402

SIZE = (300, 200)
DEGREES = (0.0, 28.0, -35.0)  # around the middle of the bench
MIDDLE = np.array([0.0, 0.1, 0.0])  # metres
BACKGROUND = (0.075, 0.078, 0.085)  # that of the viewer


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, nargs="?", default=ROOT / "docs" / "demo.png")
    path = parser.parse_args().out
    model = read_package(ROOT / "assets" / "workshop.shift")
    stops = [stop.x for stop in model.stops]
    xs = sorted([*stops, *((a + b) / 2 for a, b in pairwise(stops))])
    first = default_view(model, SIZE)
    rows = []
    with Renderer(None) as renderer:
        renderer.settings = RenderSettings(background=BACKGROUND)
        for view in (turned_about(first, MIDDLE, degrees) for degrees in DEGREES):
            row = []
            for x in xs:
                renderer.update(Scene((SceneObject("demo", model, x=x),)))
                renderer.draw([view])
                row.append(renderer.resolved().copy())
            rows.append(np.hstack(row))
    save_png(np.vstack(rows), path)


if __name__ == "__main__":
    main()
