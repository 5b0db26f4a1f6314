"""What a sharp middle saves: python3 tools/vr/foveation.py --out docs/bench/foveation.csv

Processor time of `Renderer.draw` of both eyes, all threads, in ms: medians of frames drawn in
turns, so that whatever else the machine does meets all cases alike; as a ratio to all pixels.  dB
against these, within the level's angle and beyond it (of `scale` within 25 degrees and beyond),
over both eyes; `equal`: no bit differs.  `near`: the scene fills the picture; `crowded`: a ring of
eight copies of the bundled scene about the person.  Quads on software GL, which draws whole
pictures there, are made to draw as on a GPU.
"""

import argparse
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, cast

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import moderngl
import numpy as np
from eyes import eyes_of

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.document import Document
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.paths import ASSETS, DEMO
from shapeshift.renderer.foveation import RADIUS_DEGREES, fovea_of
from shapeshift.renderer.gl.context import open_context
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject

TOUCH = ASSETS.parent / "examples" / "touch.scene.json"
TURNS = 11
COLUMNS = "drawing,scene,splats,eye,case,cpu_ms,ratio,inside_db,outside_db"
CASES = {
    "all pixels": {}, **{level: {"foveation": level} for level in RADIUS_DEGREES},
    "75 % scale": {"render_scale": 0.75}, "50 % scale": {"render_scale": 0.5},
}  # fmt: skip
MIDDLE = "medium"  # whose circle parts the rows that have none
COPIES, AWAY_M = 8, 1.2


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    out = options.parse_args().out
    rows = [f"# python3 tools/vr/foveation.py --out {out}", COLUMNS]
    ctx = open_context()
    demo, touch = (open_xr(path, Options())[0] for path in (DEMO, TOUCH))
    for name, document, near in (
        ("touch", touch, 1.0), ("workshop", demo, 1.0), ("workshop near", demo, 0.3),
    ):  # fmt: skip
        for size in ((960, 1080), (1440, 1600)):
            rows += measure(None, name, document.scene, eyes_of(document, size, near))
    scene = crowd(demo)
    rows += measure(None, "crowded", scene, eyes_in(scene, demo, (960, 1080)))
    rows += measure(ctx, "workshop near", demo.scene, eyes_of(demo, (480, 540), 0.3))
    out.write_text("\n".join(rows) + "\n")


def crowd(demo: Document) -> Scene:
    """Copies of the bundled scene in a ring, each turned to the middle."""
    (one,) = demo.scene.objects
    made = []
    for i in range(COPIES):
        angle = 2 * math.pi * i / COPIES
        turned = np.array([math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0])
        turn = Pose(np.zeros(3), turned).matrix()[:3, :3]
        pose = Pose(turn @ np.array([0.0, 0.0, -AWAY_M]), turned)
        made.append(SceneObject(f"copy {i}", one.model, pose, one.x))
    return Scene(tuple(made))


def eyes_in(scene: Scene, demo: Document, size: tuple[int, int]) -> list[View]:
    """In the middle of the ring, at a height of half a metre over the copies' origin."""
    looking = look_at(np.array([0.0, 0.45, 0.0]), np.array([0.0, 0.2, -AWAY_M]))
    plain = eyes_of(demo, size)
    away = plain[1].world_from_eye.position - plain[0].world_from_eye.position
    apart = float(np.linalg.norm(away))
    aside = looking.matrix()[:3, 0]
    return [
        replace(view, world_from_eye=Pose(looking.position + side * apart * aside, looking.wxyz))
        for view, side in zip(plain, (-0.5, 0.5), strict=True)
    ]


def measure(ctx: moderngl.Context | None, name: str, scene: Scene, views: list[View]) -> list[str]:
    turns, drawing = (TURNS, "tiles") if ctx is None else (3, "quads, software")
    took: dict[str, list[float]] = {case: [] for case in CASES}
    shown: dict[str, list[np.ndarray]] = {}
    with Renderer(ctx, "tiles" if ctx is None else "quads") as renderer:
        if ctx is not None:
            cast(Any, renderer.drawing).foveates = True
        renderer.update(scene)
        for _ in range(turns + 1):
            for case, changes in CASES.items():
                renderer.settings = RenderSettings(**changes)
                start = time.process_time()
                renderer.draw(views)
                if ctx is not None:
                    ctx.finish()
                took[case].append((time.process_time() - start) * 1e3)
                shown[case] = [renderer.resolved(i).copy() for i in range(len(views))]
    ms = {case: median(times[1:]) for case, times in took.items()}
    head = f"{drawing!r},{name},{scene.splat_count},{views[0].size[0]}x{views[0].size[1]}"
    rows = []
    for case in CASES:
        level = case if case in RADIUS_DEGREES else MIDDLE
        inside = [is_inside(view, level) for view in views]
        parts = []
        for within in (True, False):
            pairs = [
                np.concatenate([shown[of][i][inside[i] == within] for i in range(len(views))])
                for of in (case, "all pixels")
            ]
            one, other = pairs
            same = np.array_equal(one, other)
            parts.append("equal" if same else f"{psnr(one, other):.2f}")
        row = f"{head},{case},{ms[case]:.2f},{ms[case] / ms['all pixels']:.3f},{','.join(parts)}"
        rows.append(row.replace("'", '"'))
    return rows


def is_inside(view: View, level: str) -> np.ndarray:
    """(H, W) bool: nearer to straight on than the level's angle."""
    fovea = fovea_of(view, level)
    x, y = (np.arange(side) + 0.5 for side in view.size)
    across, down = (x - fovea.centre[0]) * fovea.unit[0], (y - fovea.centre[1]) * fovea.unit[1]
    return np.hypot(across[None], down[:, None]) < fovea.inner


if __name__ == "__main__":
    main()
