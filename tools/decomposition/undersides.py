"""Ways to the undersides of objects cut from the demo, against the ray tracer from below.

    python tools/decomposition/undersides.py --out docs/bench/undersides.csv [--sheets FOLDER]
    python tools/decomposition/undersides.py --out docs/bench/undersides.csv --held

Each object is labelled from true label maps of 24 views, so its underside was never photographed.
Three ways are judged in 8 views from below the object alone, the tracer's object without the bench:
turned copies of its own anchors ("symmetry"), a second capture of 24 photos in which it lies turned
over, trained for --seconds of processor time and registered by ICP ("second capture"), and none
("as cut").  "holes" are pixels of the true silhouette with alpha below .5, "spill" such outside
with alpha above .5, both in percent of the silhouette; "stood" is the PSNR in the silhouette under
the light that the object stood in, "turned" under the light of the second capture.  "agreeing" is
the share of turned anchors that photos agree with; of a second capture the IoU of the first's
silhouettes with its masks.  "union": its anchors where the first has none that photos show;
"carved": without those of the first outside its masks; "second first": the first's only where the
second has none; "instead": nothing of the first, so its top is lost.
"""

import argparse
import csv
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "decomposition")]

from object_alone import (  # noqa: E402
    Cut,
    Truth,
    cut_objects,
    draw_together,
    moved,
    truth_of,
)
from second_capture import (  # noqa: E402
    STUDIO,
    by_second_capture,
    icp,
    second_capture,
)

from shapeshift.decomposition.completion.verify import (  # noqa: E402
    OPEN,
    decibels,
    over,
)
from shapeshift.rasterizer.device import Device, open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.scene.pose import Pose  # noqa: E402
from shapeshift.training.synthetic.balls import save_png  # noqa: E402

NEAR = 1.5  # spacings of anchors that count as the same place
ALIKE = 0.1  # display units, RMS over channels, that count as the same colour
LEAST_AGREEING = 0.9  # of the turned anchors that photos can judge
FOLDS = (2, 3, 4, 6)
FEWEST_DB = 1.0  # more, to pass
HEAD = (
    "# python tools/decomposition/undersides.py --out docs/bench/undersides.csv; the same --held\n",
    "# OpenCL {platform}\n",
)
FIELDS = (
    "thing", "way", "agreeing", "copied", "dropped", "holes_before", "holes_after",
    "spill_before", "spill_after", "stood_before_db", "stood_after_db", "turned_before_db",
    "turned_after_db", "off_mm", "off_degrees", "cpu_s", "verdict",
)  # fmt: skip


def score(device: Device, parts: list[AnchorModel], truth: Truth) -> tuple[list[float], np.ndarray]:
    """Holes %, spill %, PSNR as it stood, PSNR turned over; pictures (views, H, W, 3)."""
    holes = spill = solid = 0
    errors, shown = [0.0, 0.0], []
    for view, stood, lying in zip(truth.views, truth.stood, truth.turned, strict=True):
        picture, mask = draw_together(device, parts, view), stood[1] > 0.5
        solid += int(mask.sum())
        holes += int((picture[..., 3][mask] < OPEN).sum())
        spill += int((picture[..., 3][~mask] > OPEN).sum())
        shown.append(over(picture, STUDIO))
        for i, photo in enumerate((stood[0], lying[0])):
            errors[i] += float(((shown[-1] - photo)[mask] ** 2).mean(1).sum())
    decibel = [decibels(error / solid) for error in errors]
    return [100 * holes / solid, 100 * spill / solid, *decibel], np.stack(shown)


def is_refuted(cut: Cut, points: np.ndarray) -> np.ndarray:
    """(n,) bool: points (n, 3) under the plane, or where a view shows bench or studio."""
    out = cut.plane.height(points) < -cut.looks.spacing_m
    for picture in cut.pictures:
        eye_from_world, fx, fy, cx, cy = picture.view.pinhole()
        x, y, z = (np.c_[points, np.ones(len(points))] @ eye_from_world.T)[:, :3].T
        z = np.maximum(z, 1e-6)
        u, v = np.floor(fx * x / z + cx).astype(int), np.floor(fy * y / z + cy).astype(int)
        height, width = picture.labels.shape
        here = (u >= 0) & (v >= 0) & (u < width) & (v < height)
        out[here] |= picture.labels[v[here], u[here]] == 0
    return out


def symmetries(cut: Cut) -> Iterator[tuple[str, np.ndarray]]:
    """(name, pose (4, 4)) of rotations about the object's axes, refined by ICP."""
    places = cut.looks.places[cut.known]
    points = np.c_[places, cut.looks.colors[cut.known]]
    flat = np.cov((places - (places @ cut.plane.normal)[:, None] * cut.plane.normal).T)
    long = np.linalg.eigh(flat)[1][:, 2]  # along the plane
    axes = {"upright": cut.plane.normal, "long": long, "cross": np.cross(cut.plane.normal, long)}
    for name, axis in axes.items():
        for fold in FOLDS if name == "upright" else (2,):
            angle = 2 * np.pi / fold
            half = np.r_[np.cos(angle / 2), np.sin(angle / 2) * axis / np.linalg.norm(axis)]
            start = Pose(np.zeros(3), half).matrix()
            start[:3, 3] = cut.middle - start[:3, :3] @ cut.middle
            pose, _ = icp(points, points, start, 0.25 * NEAR * cut.looks.spacing_m / ALIKE)
            yield f"{name} axis, 1/{fold} turn", pose


def copies_under(cut: Cut, pose: np.ndarray) -> tuple[float, np.ndarray]:
    """The share of turned anchors that photos agree with, and rows whose copies no photo shows."""
    from scipy.spatial import cKDTree

    rows = cut.known
    places, colors = cut.looks.places[rows], cut.looks.colors[rows]
    at = places @ pose[:3, :3].T + pose[:3, 3]
    away, which = cKDTree(places).query(at)
    same = away < NEAR * cut.looks.spacing_m
    alike = np.sqrt(((colors - colors[which]) ** 2).mean(1)) < ALIKE
    refuted = is_refuted(cut, at) & ~same
    judged = same | refuted
    agreeing = float((same & alike).sum() / max(judged.sum(), 1))
    return agreeing, rows[~judged]


def by_symmetry(cut: Cut) -> Iterator[tuple[str, float, list[AnchorModel], int, int]]:
    """(way, agreement, parts, copied, dropped) of every rotation, whatever photos say of it."""
    from scipy.spatial import cKDTree

    for name, pose in symmetries(cut):
        agreeing, rows = copies_under(cut, pose)
        copies = moved(cut.model.with_anchors(rows), pose)
        stay = np.ones(len(cut.seen), bool)
        if len(rows):
            away, _ = cKDTree(copies.anchors).query(cut.looks.places)
            stay = cut.seen | (away > NEAR * cut.looks.spacing_m)
        parts = [cut.model.with_anchors(stay), *([copies] if len(rows) else [])]
        yield f"symmetry: {name}", agreeing, parts, len(rows), int((~stay).sum())


def verdict_of(before: list[float], after: list[float], agreeing: float = 1.0) -> str:
    """What it is worth in either light, and whether the photos alone would have told."""
    words = []
    for light, i in (("as it stood", 2), ("in the second light", 3)):
        wrong = []
        if not after[0] < before[0]:
            wrong.append("holes")
        if not after[1] <= before[1]:
            wrong.append("spill")
        if not after[i] >= before[i] + FEWEST_DB:
            wrong.append("PSNR")
        words.append(f"{light}: {'fails by ' + ' and '.join(wrong) if wrong else 'passes'}")
    told = "; ".join(words)
    return told if agreeing >= LEAST_AGREEING else f"{told}; photos refuse it"


def rows_of(device: Device, asked: argparse.Namespace, folder: Path) -> Iterator[list]:
    """Rows of the table, one by one."""
    for cut in cut_objects(device, asked.things):
        truth = truth_of(cut)
        before, pictures = score(device, [cut.model], truth)
        sheet = [[photo for photo, _ in truth.stood], [p for p, _ in truth.turned], pictures]

        def row(way: str, agreeing: str, counts: list, after: list, off: list, seconds: float,
                verdict: str) -> list:  # fmt: skip
            pairs = [f"{value:.2f}" for pair in zip(before, after, strict=True) for value in pair]  # noqa: B023
            return [cut.name, way, agreeing, *counts, *pairs, *off, f"{seconds:.1f}", verdict]  # noqa: B023

        if not asked.held:
            yield row("as cut", "", [0, 0], before, ["", ""], 0, "")
        begun = time.process_time()
        for way, agreeing, parts, *counts in () if asked.held else by_symmetry(cut):
            seconds = time.process_time() - begun
            after, shown = score(device, parts, truth)
            sheet.append(shown)
            word = verdict_of(before, after, agreeing)
            yield row(way, f"{agreeing:.2f}", counts, after, ["", ""], seconds, word)
            begun = time.process_time()
        model, photos = second_capture(device, cut, folder, asked.seconds, asked.held)
        merged = by_second_capture(device, cut, model, photos, asked.held)
        for way, iou, parts, *counts, off in merged:
            seconds = time.process_time() - begun
            after, shown = score(device, parts, truth)
            sheet.append(shown)
            told = [f"{value:.1f}" for value in off]
            yield row(way, f"{iou:.2f}", counts, after, told, seconds, verdict_of(before, after))
            begun = time.process_time()
        if asked.sheets:
            asked.sheets.mkdir(parents=True, exist_ok=True)
            lines = [np.concatenate(list(line)[1::2], 1) for line in sheet]
            save_png(asked.sheets / f"{cut.name}.png", np.concatenate(lines))


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options.add_argument("--sheets", type=Path, help="folder for pictures: two truths, then ways")
    options.add_argument("--things", nargs="+", default=["mug", "can", "spanner", "motor"])
    options.add_argument("--seconds", type=float, default=45.0, help="of each training")
    options.add_argument(
        "--held", action="store_true",
        help="only the second capture from below in the first light; rows are added to --out",
    )  # fmt: skip
    asked, rows = options.parse_args(), []
    if asked.held and asked.out:
        with asked.out.open(newline="") as file:
            rows = list(csv.reader(file))[len(HEAD) + 1 :]
    device = open_device("cpu")
    with tempfile.TemporaryDirectory() as folder:
        for row in rows_of(device, asked, Path(folder)):
            rows.append(row)
            sys.stdout.write("  ".join(map(str, row)) + "\n")
            sys.stdout.flush()
            if asked.out:  # what is done stays
                with asked.out.open("w", newline="") as file:
                    file.write("".join(HEAD).format(platform=device.platform))
                    csv.writer(file, lineterminator="\n").writerows([FIELDS, *rows])


if __name__ == "__main__":
    main()
