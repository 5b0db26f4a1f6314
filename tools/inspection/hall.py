"""The plant hall: photos along a walk, one model of it, its error on held-out photos, its faults.

    python3 tools/inspection/hall.py WORK --seconds 1200 --out docs/bench/hall.csv

WORK gets the capture that tools/synthetic/hall ray-traces, and the package; what is there
already is used as it is.  Rows: PSNR a modality on held-out photos (mean, median, worst), the
package's megabytes; a fault's degrees as the scene reads them in a view that no photo was taken
from, the hottest within REACH metres of the fault, beside the tracer's own.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402
from shapeshift.app.charts.chart_rows import write_text  # noqa: E402
from shapeshift.scene.cameras.camera_list import moved  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.synthetic.tracer import pixel_rays, trace  # noqa: E402
from tools.synthetic.hall.hall import (  # noqa: E402
    Fault,
    degrees,
    faults,
    make_hall,
    photo_views,
    place,
)

REACH = 0.35  # metres
OTHER_POSES = 150  # of a walk that meets none of the photos' poses
LEAST_PIXELS = 20  # of a fault in a view that it is read in
COLUMNS = "what,name,value,truth,unit"


def made(work: Path, size: tuple[int, int]) -> Path:
    capture = work / "hall"
    if not (capture / "transforms.json").is_file():

        def say(done: int, count: int) -> None:
            if done % 32 == 0:
                sys.stderr.write(f"{done} of {count} photos\n")

        make_hall(capture, size, progress=say)
    return capture


def trained(work: Path, capture: Path, words: list[str]) -> Path:
    package = work / "hall.shift"
    if not package.is_file():
        launch(["train", str(capture), "--out", str(package), *words])
    return package


def launch(words: list[str], stdout: int | None = None) -> bytes:
    program = [sys.executable, "-P", str(ROOT / "launch.py"), *words]
    return subprocess.run(program, check=True, stdout=stdout).stdout


def quality(package: Path, capture: Path) -> list[str]:
    words = ["eval", str(package), str(capture), "--json"]
    rows, scores = [], json.loads(launch(words, subprocess.PIPE))
    for name, score in scores["modalities"].items():
        each = list(score["psnr_db_each"].values())
        for what, value in (("mean", score["psnr_db"]), ("median", score["median_db"]),
                            ("worst", min(each))):  # fmt: skip
            rows.append(f"{what} of {len(each)} held-out photos,{name},{value:.2f},,dB")
    rows.append(f"package,hall.shift,{package.stat().st_size / 1e6:.2f},,MB")
    return rows


def near_fault(view: View, fault: Fault) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) whether a pixel shows a place within REACH of a fault; the tracer's °C (H, W)."""
    here, _ = place()
    width, height = view.size
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:height, :width])
    d = pixel_rays(view, columns, rows)
    eye = np.broadcast_to(np.asarray(view.world_from_eye.position), d.shape)
    distance, index = trace(here, eye, d)
    points = eye + np.where(index >= 0, distance, 1e9)[:, None] * d
    near = np.linalg.norm(points - np.array(fault.place), axis=1) < REACH
    celsius, _ = degrees(eye, d)
    return near.reshape(height, width), celsius.reshape(height, width)


def best_view(views: list[View], fault: Fault) -> tuple[View, np.ndarray, float]:
    """The view that shows most of a fault, which of its pixels do, and their hottest, °C."""
    best = None
    for view in views:
        eye = np.asarray(view.world_from_eye.position)
        if np.linalg.norm(eye - fault.place) > 9:
            continue
        near, celsius = near_fault(view, fault)
        if near.sum() > (LEAST_PIXELS if best is None else best[1].sum()):
            if celsius[near].max() > fault.celsius - 12:
                best = (view, near, float(celsius[near].max()))
    if best is None:
        raise SystemExit(f"no view shows {fault.name}")
    return best


def readings(package: Path, size: tuple[int, int]) -> list[str]:
    scene = ss.load(package)
    views = photo_views(OTHER_POSES, size)[1]
    rows, errors = [], []
    for fault in faults():
        view, near, truth = best_view(views, fault)
        (shown,) = moved([view], tuple(-scene.origin))
        values = scene.values(shown).values
        found = float(np.nanmax(np.where(near, values, np.nan)))
        errors.append(abs(found - truth))
        rows.append(f"hottest near a fault,{fault.name},{found:.1f},{truth:.1f},°C")
    return [*rows, f"mean error at faults,,{np.mean(errors):.2f},,°C"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("--seconds", type=float, default=1200.0)
    parser.add_argument("--max-anchors", type=int, default=40000)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    width, height = map(int, asked.size.split("x"))
    size = (width, height)
    capture = made(asked.work, size)
    words = ["--seconds", f"{asked.seconds:g}", "--max-anchors", str(asked.max_anchors)]
    package = trained(asked.work, capture, words)
    rows = quality(package, capture) + readings(package, size)
    head = (
        f"# python3 tools/inspection/hall.py WORK --seconds {asked.seconds:g} --max-anchors "
        f"{asked.max_anchors} --size {asked.size} --out docs/bench/hall.csv\n"
        "# one model of the whole hall: 320 poses, a photo of each kind at each, 20 held out\n"
    )
    write_text(asked.out, head + COLUMNS + "\n" + "\n".join(rows) + "\n")
    sys.stdout.write(asked.out.read_text())


if __name__ == "__main__":
    main()
