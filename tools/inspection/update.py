"""A part of a scene trained anew from a second visit: dB inside, and whether all else stays.

    python tools/inspection/update.py WORK --out docs/bench/update.csv

WORK is that of tools/inspection/change.py: two visits and their packages, made where they lack.
Rows: the earlier scene as it is, updated where `change` found something (so many steps), and the
later visit trained whole; dB of the later visit's held-out photos where they see the region, dB
where they do not; how many pixels no splat touches which left or came, from what light left on
(tiles stop at less, eight pixels together), how many of these differ in any bit; and the largest
difference of all untouched pixels, colours 0 to 1.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.change.similarity import read_change  # noqa: E402
from shapeshift.training.evaluation.metrics import psnr  # noqa: E402
from shapeshift.training.photos import load_photos  # noqa: E402
from shapeshift.training.update.regions import UpdateRegion  # noqa: E402
from tools.inspection.change import trained  # noqa: E402

COLUMNS = ("scene,steps,core_s,anchors_inside,anchors_outside_kept,rgb_inside_db,"
           "thermal_inside_db,rgb_outside_db,thermal_outside_db,untouched_pixels,"
           "least_light_left,differ_of_these,largest_difference")  # fmt: skip


def rows_as_bytes(model: AnchorModel) -> list[bytes]:
    """All that each anchor has."""
    parts = [model.anchors, model.features]
    if model.frames is not None:
        parts += [model.frames.scales, model.frames.wxyz]
    return [b"".join(row.tobytes() for row in rows) for rows in zip(*parts, strict=True)]


def untouched(renderer, before: AnchorModel, after: AnchorModel, views) -> str:
    """The last columns: of pixels where neither who left nor who came alone covers anything."""
    was, now = rows_as_bytes(before), rows_as_bytes(after)
    were, are = set(was), set(now)
    left, came = np.array([r not in are for r in was]), np.array([r not in were for r in now])
    pixels, differ, largest = 0, 0, 0.0
    light = renderer.settings.min_transmittance
    for stop, view in views:
        whole = [renderer.premultiplied(at(model, stop), view) for model in (before, after)]
        alone = [
            renderer.premultiplied(at(model.with_anchors(rows), stop), view)[..., 3]
            for model, rows in ((before, left), (after, came))
        ]
        free = (alone[0] == 0) & (alone[1] == 0)
        apart = np.abs(whole[0] - whole[1]).max(axis=-1)
        seen = free & (1 - np.maximum(whole[0], whole[1])[..., 3] >= light)
        pixels, differ = pixels + int(seen.sum()), differ + int((apart[seen] > 0).sum())
        largest = max(largest, float(apart[free].max(initial=0)))
    return f"{pixels},{light:g},{differ},{largest:.1e}"


def at(model: AnchorModel, stop: str) -> ss.Scene:
    """Drawn as it was trained: values, without a palette."""
    stops = tuple(replace(each, palette="") for each in model.stops)
    return ss.Scene.from_model(replace(model, stops=stops)).at(stop)


def score(renderer, model: AnchorModel, photos, region: UpdateRegion, background) -> list[float]:
    """dB inside of RGB and Thermal, then outside of both; means over photos."""
    renderer.settings = replace(renderer.settings, background=background)
    found: dict[tuple[str, bool], list[float]] = {}
    for photo in photos:
        shown = renderer.render(at(model, photo.modality), photo.view)
        seen = region.shadow(photo.view)
        for inside in (True, False):
            weight = (seen if inside else ~seen).astype(np.float32)
            value = psnr(shown, photo.over(background), weight)
            found.setdefault((photo.modality, inside), []).append(value)
    keys = [(name, inside) for inside in (True, False) for name in ("RGB", "Thermal")]
    return [float(np.mean(found[key])) for key in keys]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--iterations", type=int, nargs="+", default=[600, 2000])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    work = options.work
    before, whole = (trained(work, name, options.seconds) for name in ("before", "after"))
    changed = work / "changed"
    if not changed.is_dir():
        ss.change(before, whole, out=changed)
    region = UpdateRegion(read_change(changed).boxes)
    capture = read_capture(work / "after")
    photos = load_photos(capture, "test", 1, "object")
    views = [(photo.modality, photo.view) for photo in photos]
    models = [("as it was", 0, 0.0, ss.load(before).model)]
    for steps in options.iterations:
        start = time.process_time()
        made = ss.update(before, work / "after", change=changed, iterations=steps)
        models.append(("updated", steps, time.process_time() - start, made.model))
    models.append(("trained whole", 0, options.seconds, ss.load(whole).model))
    rows = []
    with ss.Renderer("tiles") as renderer:
        first = models[0][3]
        assert isinstance(first, ss.AnchorModel)
        for name, steps, seconds, model in models:
            assert isinstance(model, ss.AnchorModel)
            inside = int(region.holds(model.anchors).sum())
            kept = len(set(rows_as_bytes(first)) & set(rows_as_bytes(model)))
            values = score(renderer, model, photos, region, capture.background or (0, 0, 0))
            same = ",,,"
            if name == "updated":
                same = untouched(renderer, first, model, views)
            rows.append(f"{name},{steps or ''},{seconds:.0f},{inside},{kept},"
                        + ",".join(f"{v:.2f}" for v in values) + f",{same}")  # fmt: skip
    head = "# python tools/inspection/update.py WORK --out update.csv\n"
    options.out.write_text(head + COLUMNS + "\n" + "\n".join(rows) + "\n")
    sys.stdout.write(options.out.read_text())


if __name__ == "__main__":
    main()
