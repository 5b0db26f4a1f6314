"""What quad views cost: python3 tools/vr/quad_views.py --out docs/bench/quad_views.csv

Processor time of `Renderer.draw` of both eyes, all threads, by tiles, in ms: medians of frames
drawn in turns, as tools/vr/foveation.py measures; as a ratio to all pixels.  `quad A / B`: insets
of A of the width and height about straight on in all pixels, wide views of B of the pixels a side.
`pixels` is the share that is drawn.  dB against all pixels, over both eyes, within the inset of the
case (of `medium`: of the first quad case) and outside it, the wide view made larger as a compositor
does; `equal`: no bit differs.
"""

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from eyes import eyes_of
from foveation import crowd, eyes_in

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.paths import ASSETS, DEMO
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.resolution import bilinear
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from shapeshift.vr.openxr.view_configuration import with_insets

TOUCH = ASSETS.parent / "examples" / "touch.scene.json"
TURNS = 11
COLUMNS = "scene,splats,eye,case,pixels,cpu_ms,ratio,inside_db,outside_db"
Box = tuple[int, int, int, int]  # left, top, width, height, pixels


@dataclass(frozen=True)
class Case:
    """How the eyes are drawn."""

    inset: float = 0.5  # of the sides
    wide: float = 0.0  # of the pixels a side; 0: no quad views
    foveation: str = "off"


CASES = {
    "all pixels": Case(), "medium": Case(foveation="medium"),
    "quad 50 % / 40 %": Case(0.5, 0.4), "quad 35 % / 40 %": Case(0.35, 0.4),
    "quad 35 % / 50 %": Case(0.35, 0.5),
}  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    out = options.parse_args().out
    rows = [f"# python3 tools/vr/quad_views.py --out {out}", COLUMNS]
    demo, touch = (open_xr(path, Options())[0] for path in (DEMO, TOUCH))
    rows += measure("touch", touch.scene, eyes_of(touch, (960, 1080), 1.0))
    for size in ((960, 1080), (1440, 1600)):
        rows += measure("workshop near", demo.scene, eyes_of(demo, size, 0.3))
    scene = crowd(demo)
    rows += measure("crowded", scene, eyes_in(scene, demo, (960, 1080)))
    out.write_text("\n".join(rows) + "\n")


def box_of(view: View, part: float) -> Box:
    """Of an inset about straight on, as far as that is within the picture."""
    left, right, down, up = view.tangents
    width, height = view.size
    size = round(part * width), round(part * height)
    x, y = -left / (right - left) * width, up / (up - down) * height
    first = (round(x - size[0] / 2), round(y - size[1] / 2))
    x, y = (min(max(a, 0), n - s) for a, n, s in zip(first, view.size, size, strict=True))
    return x, y, *size


def views_of(case: Case, views: list[View]) -> list[View]:
    if not case.wide:
        return views
    wide = [
        view.resized((round(case.wide * view.size[0]), round(case.wide * view.size[1])))
        for view in views
    ]
    boxes = [box_of(view, case.inset) for view in views]
    insets = [
        replace(view.part(box[0], box[1], box[2:]), whole=None)
        for view, box in zip(views, boxes, strict=True)
    ]
    return list(with_insets([*wide, *insets]))


def shown(case: Case, views: list[View], pictures: list[np.ndarray]) -> list[np.ndarray]:
    """What each eye sees: insets over the wide views, as large as all pixels."""
    if not case.wide:
        return pictures
    made = []
    for i, view in enumerate(views):
        picture = bilinear(pictures[i], view.size).copy()
        left, top, width, height = box_of(view, case.inset)
        picture[top : top + height, left : left + width] = pictures[len(views) + i]
        made.append(picture)
    return made


def measure(name: str, scene: Scene, views: list[View]) -> list[str]:
    took: dict[str, list[float]] = {case: [] for case in CASES}
    pictures: dict[str, list[np.ndarray]] = {}
    with Renderer(None, "tiles") as renderer:
        renderer.update(scene)
        for _ in range(TURNS + 1):
            for title, case in CASES.items():
                asked = views_of(case, views)
                renderer.settings = RenderSettings(foveation=case.foveation)
                start = time.process_time()
                renderer.draw(asked)
                took[title].append((time.process_time() - start) * 1e3)
                found = [renderer.resolved(i).copy() for i in range(len(asked))]
                pictures[title] = shown(case, views, found)
    ms = {title: median(times[1:]) for title, times in took.items()}
    whole = sum(view.size[0] * view.size[1] for view in views)
    head = f"{name},{scene.splat_count},{views[0].size[0]}x{views[0].size[1]}"
    rows = []
    for title, case in CASES.items():
        drawn = sum(view.size[0] * view.size[1] for view in views_of(case, views)) / whole
        share = "" if case.foveation != "off" else f"{drawn:.3f}"
        parts = errors(case, views, pictures[title], pictures["all pixels"])
        ratio = ms[title] / ms["all pixels"]
        rows.append(f"{head},{title},{share},{ms[title]:.2f},{ratio:.3f},{','.join(parts)}")
    return rows


def errors(
    case: Case, views: list[View], found: list[np.ndarray], wanted: list[np.ndarray]
) -> list[str]:
    """dB within the inset and outside it."""
    parts = []
    for within in (True, False):
        pairs: list[list[np.ndarray]] = [[], []]
        for view, *both in zip(views, found, wanted, strict=True):
            inside = np.zeros(view.size[::-1], bool)
            left, top, width, height = box_of(view, case.inset)
            inside[top : top + height, left : left + width] = True
            for kept, picture in zip(pairs, both, strict=True):
                kept.append(picture[inside == within])
        a, b = (np.concatenate(each) for each in pairs)
        parts.append("equal" if np.array_equal(a, b) else f"{psnr(a, b):.2f}")
    return parts


if __name__ == "__main__":
    main()
