"""What both eyes cost with less drawn: python3 tools/vr/eyes.py --out docs/bench/eyes.csv

Processor time of `Renderer.draw` by tiles, all threads, in ms: medians of frames drawn in turns, so
that whatever else the machine does meets all cases alike.  Depth for the compositor at all pixels
and at half the width and height, as a ratio to the frame without; a lens that hides the four
corners (as Monado's default mask), and one that hides a frame of 64 %.  `near`: the scene fills the
picture.
"""

import argparse
import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.document import Document
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.paths import ASSETS, DEMO
from shapeshift.renderer.foveation import hidden_pixels
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import HiddenMesh, Pose, View
from tests.support.xr.masked_eyes import frame_mesh
from tests.support.xr.remote import EYE_DEGREES, EYES_APART_M

TOUCH = ASSETS.parent / "examples" / "touch.scene.json"
TURNS = 15
COLUMNS = "scene,eye,case,hidden,cpu_ms,depth_ms,ratio"
NEAR = 0.3  # so near the bundled scene fills the picture
CORNER = 0.25  # of half a picture's side: Monado's default octagon


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    out = options.parse_args().out
    rows = [f"# python3 tools/vr/eyes.py --out {out}", COLUMNS]
    for scene, near in ((TOUCH, 1.0), (DEMO, 1.0), (DEMO, NEAR)):
        for size in ((320, 240), (960, 1080)):
            document, place = open_xr(scene, Options())[0], " near" if near < 1 else ""
            head = f"{scene.stem.split('.')[0]}{place},{size[0]}x{size[1]}"
            rows += [f"{head},{row}" for row in measure(document, eyes_of(document, size, near))]
    out.write_text("\n".join(rows) + "\n")


def eyes_of(document: Document, size: tuple[int, int], near: float = 1.0) -> list[View]:
    """Both, at the first view, through lenses like an Index's; near: of the way from the middle."""
    first = document.view(size).world_from_eye
    centre = document.bounds()[0]
    first = Pose(centre + near * (first.position - centre), first.wxyz)
    views = []
    for side, (left, right, up, down) in zip((-0.5, 0.5), EYE_DEGREES, strict=True):
        a, b, c, d = (math.tan(math.radians(angle)) for angle in (left, right, down, up))
        at = first.position + first.matrix()[:3, 0] * side * EYES_APART_M
        views.append(View(Pose(at, first.wxyz), (a, b, c, d), 0.05, 1000.0, size))
    return views


def corners_of(view: View) -> HiddenMesh:
    left, right, down, up = view.tangents
    w, h = CORNER * (right - left) / 2, CORNER * (up - down) / 2
    return HiddenMesh(
        np.array(
            [
                [(x, y), (x + sx * w, y), (x, y + sy * h)]
                for x, sx in ((left, 1), (right, -1))
                for y, sy in ((down, 1), (up, -1))
            ]
        )
    )


def frame_of(view: View) -> HiddenMesh:
    corners, order = frame_mesh(view.tangents)
    return HiddenMesh(np.array(corners)[order].reshape(-1, 3, 2))


def measure(document: Document, plain: list[View]) -> list[str]:
    def masked(mesh: Callable[[View], HiddenMesh]) -> list[View]:
        return [replace(view, hidden=mesh(view)) for view in plain]

    cases = {
        "plain": (plain, 0.0), "depth, all pixels": (plain, 1.0),
        "depth, half the sides": (plain, 0.5), "corners hidden": (masked(corners_of), 0.0),
        "frame hidden": (masked(frame_of), 0.0),
    }  # fmt: skip
    took: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    with Renderer(None) as renderer:
        renderer.update(document.scene)
        for _ in range(TURNS + 1):
            for name, (views, part) in cases.items():
                took[name].append(cpu_ms(renderer, views, part))
    whole = median(ms for ms, _ in took["plain"][1:])
    rows = []
    for name, (views, _) in cases.items():
        cpu, deep = (median(times) for times in zip(*took[name][1:], strict=True))
        hidden = np.mean([hidden_pixels(view).mean() for view in views])
        rows.append(f'"{name}",{hidden:.3f},{cpu:.2f},{deep:.2f},{cpu / whole:.3f}')
    return rows


def cpu_ms(renderer: Renderer, views: list[View], part: float) -> tuple[float, float]:
    """Of the frame, and of its depth by the wall."""
    renderer.settings = RenderSettings(depth_scale=part)
    start = time.process_time()
    stats = renderer.draw(views)
    return (time.process_time() - start) * 1e3, stats.ms.get("depth", 0.0)


if __name__ == "__main__":
    main()
