"""What completion fills under things of the demo, against the ray tracer without them.

    python tools/decomposition/completion.py --out docs/bench/completion.csv [--sheets FOLDER]

Labels come from true label maps of 24 views by evidence; 12 of them with their photos verify.  All
other figures are of 8 views that nothing was made from: holes are pixels of the thing's mask with
alpha below .5; "stood" is the PSNR there against the tracer without the thing, over all views;
"rest" is how alike all other pixels stay, in the worst view, "rest_before" and "rest_after" their
PSNR against the tracer, over all views; "off_plane" is how far fills lie off
the plane, in sides of a cell.  "lifted" and "foreign" are stamps made wrong on purpose: copies
30 mm too high, and copies of the pipe: both have to be refused.
"""

import argparse
import csv
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.completion.complete import (  # noqa: E402
    Stamp,
    apply_stamp,
    complete,
    find_stamp,
    only_background,
    with_background_copies,
)
from shapeshift.decomposition.completion.plane import (  # noqa: E402
    Plane,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.completion.verify import (  # noqa: E402
    MARGIN,
    OPEN,
    Cells,
    ModelPictures,
    PhotoView,
    decibels,
    over,
    verify,
)
from shapeshift.decomposition.partition import (  # noqa: E402
    LabelledView,
    gather_evidence,
    partition,
)
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.training.synthetic.placing import Clearance  # noqa: E402
from shapeshift.training.synthetic.tracer import Place, look, photograph, shade  # noqa: E402
from shapeshift.training.synthetic.workshop import GREY, LIGHT, dome, radiance, things  # noqa: E402
from tools.synthetic.labels import LABELS, OBJECTS, label_map  # noqa: E402

SIZE = (384, 288)
STUDIO = (GREY, GREY, GREY)
VIEWS, VERIFYING, HELD_OUT = 24, 12, 8
FIELDS = (
    "thing", "step", "anchors_copied", "anchors_dropped", "patches", "holes_before", "holes_after",
    "stood_before_db", "stood_after_db", "rest_db",
    "rest_before_db", "rest_after_db", "photo_before_db", "photo_after_db", "strange",
    "off_plane", "cpu_s", "verdict",
)  # fmt: skip


def photos_without(name: str, views: list) -> list[np.ndarray]:
    """The tracer's photos (H, W, 3) of the bench without that thing."""
    kept = [solid for thing, solids in things(False) for solid in solids if thing != name]
    here = Place.of(kept)
    clearance = Clearance.of(here, (-0.75, -0.2, -0.48), (0.75, 0.5, 0.48))

    def rgb(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(here, o, d)
        color = shade(here, hits, d, LIGHT, clearance.openness(hits))
        color[hits.index < 0] = GREY
        return color, hits.index

    return [photograph(view, rgb, samples=1)[0] for view in views]


def labelled_demo(device) -> tuple:
    """(model with labels, evidence of background (A,), views that verify)."""
    model, views = read_model(DEMO), dome(VIEWS, 0.0, SIZE)
    assert isinstance(model, AnchorModel)
    pictures = [LabelledView(view, 0.0, label_map(view)) for view in views]
    sums = gather_evidence(device, model, pictures, len(LABELS))
    objects = tuple(ObjectLabel(LABELS[name], name) for name in OBJECTS)
    few = pictures[:: VIEWS // VERIFYING]
    photos = [photograph(each.view, radiance("RGB"), samples=1)[0] for each in few]
    verifying = [PhotoView(*pair) for pair in zip(few, photos, strict=True)]
    return partition(model, sums, objects), sums[:, 0], verifying


def held_out(device, name: str, before, after, views: list, maps: list, real: list, sheet) -> list:
    """Holes, PSNR where it stood, likeness and PSNR of the rest; a sheet of the first view."""
    from scipy import ndimage

    drawings = [ModelPictures(device, each) for each in (before, after)]
    holes, errors, pixels, rest = [0, 0], [0.0, 0.0], 0, np.inf
    beside, aside = [0.0, 0.0], 0
    for view, labels, truth in zip(views, maps, real, strict=True):
        mask = labels == LABELS[name]
        if mask.sum() < 60:
            continue
        pair = [each.draw(view, 0.0) for each in drawings]
        stood = ndimage.binary_dilation(mask, iterations=2)
        away = ~ndimage.binary_dilation(mask, iterations=MARGIN)
        pixels, aside = pixels + int(stood.sum()), aside + int(away.sum())
        for i, picture in enumerate(pair):
            holes[i] += int((mask & (picture[..., 3] < OPEN)).sum())
            error = ((over(picture, STUDIO) - truth) ** 2).mean(2)
            errors[i] += float(error[stood].sum())
            beside[i] += float(error[away].sum())
        apart = over(pair[0], STUDIO) - over(pair[1], STUDIO)
        rest = min(rest, decibels(float((apart[away] ** 2).mean())))
        if sheet is not None:
            sheet([*(over(picture, STUDIO) for picture in pair), truth])
            sheet = None
    stood_db = [decibels(error / max(pixels, 1)) for error in errors]
    rest_db = [decibels(error / max(aside, 1)) for error in beside]
    return [*holes, *(f"{db:.2f}" for db in stood_db), f"{rest:.1f}",
            *(f"{db:.2f}" for db in rest_db)]  # fmt: skip


def wrong_stamps(device, model, evidence, views: list, label: int) -> list:
    """(step, verdict) of stamps that must be refused."""
    looks = looks_of(model)
    plane = support_plane(looks, model.labels, label)
    assert isinstance(plane, Plane)
    stamp = find_stamp(looks, model.labels, label, plane, evidence)
    assert isinstance(stamp, Stamp)
    pipe = np.flatnonzero(model.labels == LABELS["pipe"])[: len(stamp.rows)]
    target = looks.places[stamp.rows[: len(pipe)]] + stamp.shifts[: len(pipe)]
    wrong = {
        "lifted": replace(stamp, shifts=stamp.shifts + 0.03 * plane.normal),
        "foreign": replace(stamp, rows=pipe, shifts=target - looks.places[pipe]),
    }
    before = only_background(model)
    told = []
    for step, each in wrong.items():
        after = only_background(with_background_copies(apply_stamp(model, each), len(each.rows)))
        cells = Cells(each.footprint, each.cell_m, plane.normal, each.around)
        told.append((step, each, verify(device, before, after, label, views, STUDIO, cells)))
    return told


def save_sheet(path: Path):
    """Writes pictures side by side."""

    def save(pictures: list[np.ndarray]) -> None:
        from PIL import Image

        wide = np.clip(np.concatenate(pictures, 1), 0, 1)
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray((wide * 255 + 0.5).astype(np.uint8)).save(path)

    return save


def told_of(verdict) -> list:
    """The verdict's own columns."""
    if verdict is None:
        return [""] * 4
    return [f"{verdict.photo_before_db:.2f}", f"{verdict.photo_after_db:.2f}",
            f"{verdict.strange:.3f}", f"{verdict.away:.2f}"]  # fmt: skip


def rows_of(device, names: list[str], sheets: Path | None):
    """Rows of the table, one by one."""
    model, evidence, verifying = labelled_demo(device)
    views = dome(HELD_OUT, 0.17, SIZE)
    maps = [label_map(view) for view in views]
    for name in names:
        label, real = LABELS[name], photos_without(name, views)
        for shadows in (False, True):
            step = "with shadow" if shadows else "footprint"
            begun = time.process_time()
            after, (told,) = complete(
                device, model, verifying, [label], evidence, shadows=shadows, background=STUDIO
            )
            seconds = time.process_time() - begun
            sheet = save_sheet(sheets / f"{name}-{step.split()[-1]}.png") if sheets else None
            before, then = (each.with_anchors(each.labels != label) for each in (model, after))
            figures = held_out(device, name, before, then, views, maps, real, sheet)
            stamp = told.stamp
            counts = (
                [len(stamp.rows), int(stamp.dropped.sum()), stamp.patches] if stamp else [0] * 3
            )
            word = "accepted" if stamp else told.why
            yield [name, step, *counts, *figures, *told_of(told.verdict), f"{seconds:.2f}", word]
    for step, stamp, verdict in wrong_stamps(device, model, evidence, verifying, LABELS["mug"]):
        counts = [len(stamp.rows), int(stamp.dropped.sum()), stamp.patches]
        holes = [verdict.holes_before, verdict.holes_after]
        yield ["mug", step, *counts, *holes, "", "", f"{verdict.alike_db:.1f}", "", "",
               *told_of(verdict), "", verdict.sentence()]  # fmt: skip
    nothing = replace(model, labels=np.zeros(len(model.anchors), np.uint8))
    after, (told,) = complete(device, nothing, verifying, [LABELS["mug"]], evidence)
    added = len(after.anchors) - len(model.anchors)
    yield ["nothing", "footprint", added, 0, 0, *[""] * 12, told.why]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options.add_argument("--sheets", type=Path, help="folder for pictures: before, after, truth")
    options.add_argument("--things", nargs="+", default=list(OBJECTS), choices=OBJECTS)
    told = options.parse_args()
    device, rows = open_device("cpu"), []
    for row in rows_of(device, told.things, told.sheets):
        rows.append(row)
        sys.stdout.write("  ".join(map(str, row)) + "\n")
        sys.stdout.flush()
    if told.out:
        with told.out.open("w", newline="") as file:
            file.write(
                "# python tools/decomposition/completion.py --out docs/bench/completion.csv\n"
            )
            file.write(f"# OpenCL {device.platform}\n")
            csv.writer(file, lineterminator="\n").writerows([FIELDS, *rows])


if __name__ == "__main__":
    main()
