"""What first points are worth: `--points` by held-out PSNR, a row a source, seed and modality.

    python3 tools/training/points.py CAPTURE ... [--scan CAPTURE FILE ...] \
        --out docs/bench/points.csv [--iterations 600] [--seeds 1 2] [--max-anchors 6000] \
        [--densities 2000 10000 100000]

CAPTURE is a folder of posed photos, or `workshop`: the demo's bench, made on the spot in small with
depth photos and a scan of its surfaces (2 mm of noise).  --scan: PLY or NPZ files that together are
the scan of a capture.  Of a scan as many points as --densities says are written as LAS, so that
the same surfaces come measured sparsely and densely.  Sources that a capture does not have are rows
without figures, with the program's sentence.  first_db is the PSNR after 100 steps, the mean of the
modalities.
"""

import argparse
import csv
import shlex
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1])]

from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import BadFile  # noqa: E402
from shapeshift.scene.captures.capture import Capture  # noqa: E402
from shapeshift.scene.captures.point_clouds import read_points  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.training.first_anchors.initial import SOURCES  # noqa: E402
from shapeshift.training.photos import choose_downscale, load_photos  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

COLUMNS = (
    "capture", "points", "seed", "modality", "psnr_db", "first_db", "seconds", "first_anchors",
    "anchors", "voxel_m", "origin",
)  # fmt: skip
EARLY = 100  # steps before first_db
WORKSHOP = {"size": (192, 144), "views": 36, "test_views": 8}
SCAN_NOISE = 0.002  # metres


def workshop(folder: Path) -> tuple[Path, np.ndarray]:
    """The demo's bench with depth photos, and points of a scan of it, closed and opened."""
    from shapeshift.scene.captures.write_capture import write_capture
    from shapeshift.training.synthetic.balls import DEPTH_UNIT, save_depth
    from shapeshift.training.synthetic.tracer import depth_under, surface_points
    from shapeshift.training.synthetic.workshop import dome, make_workshop, place

    capture, photos = make_workshop(folder, **WORKSHOP, processes=1), []
    for photo in capture.photos:
        here, _ = place(photo.modality == "Opened")
        beside = folder / "depth" / photo.modality.lower() / photo.path.name
        depth = save_depth(beside, depth_under(here, photo.view))
        photos.append(replace(photo, depth=depth, depth_unit=DEPTH_UNIT))
    write_capture(replace(capture, photos=tuple(photos)))
    scans = [
        surface_points(place(opened)[0], dome(24, 0.4, capture.photos[0].view.size),
                       50_000, SCAN_NOISE, 7 + opened)[0]
        for opened in (False, True)
    ]  # fmt: skip
    return folder, np.concatenate(scans)


def write_las(path: Path, points: np.ndarray) -> None:
    import laspy

    cloud = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
    cloud.header.scales, cloud.header.offsets = np.full(3, 1e-5), points.mean(axis=0)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)


def scans_of(points: np.ndarray, densities: list[int], folder: Path) -> dict[str, Path]:
    """Files of as many of the points as each density says, at random."""
    order = np.random.default_rng(0).permutation(len(points))
    out = {}
    for count in densities:
        some = points[order[:count]]
        path = folder / f"scan-{len(some)}.las"
        write_las(path, some.astype(np.float64))
        out[f"scan of {len(some):,} points"] = path
    return out


def one_run(device, capture: Capture, loaded: dict, settings: TrainSettings) -> list[dict]:
    """A row a modality; one with the program's sentence where there are no such points."""
    try:
        trainer = Trainer(device, capture, settings, loaded=loaded)
    except BadFile as error:
        return [{"origin": str(error).replace(str(capture.folder), capture.folder.name)}]
    first, early = trainer.anchors_count, None
    for now in trainer.steps():
        if now.iteration == EARLY:
            early = float(np.mean(list(held_out(trainer).values())))
    shared = {
        "first_db": "" if early is None else f"{early:.2f}", "seconds": f"{trainer.elapsed:.1f}",
        "first_anchors": first, "anchors": trainer.anchors_count,
        "voxel_m": f"{trainer.voxel:.4g}", "origin": trainer.origin,
    }  # fmt: skip
    psnr = held_out(trainer)
    psnr["mean"] = float(np.mean(list(psnr.values())))
    return [shared | {"modality": name, "psnr_db": f"{db:.2f}"} for name, db in psnr.items()]


def held_out(trainer: Trainer) -> dict[str, float]:
    return trainer.held_out_psnr(most=len(trainer.held_out))


def asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+")
    parser.add_argument("--scan", nargs="+", action="append", default=[])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--iterations", type=int, default=600)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--max-anchors", type=int, default=6000)
    parser.add_argument("--densities", type=int, nargs="+", default=[2_000, 10_000, 100_000])
    parser.add_argument("--downscale", type=int, help="of captures that are folders")
    return parser.parse_args()


def command() -> str:
    """As it was typed, without the places where the files lie."""
    return shlex.join(Path(w).name if Path(w).exists() else w for w in sys.argv[1:])


def main() -> None:
    options, device = asked(), open_device()
    scans = {files[0]: [Path(f) for f in files[1:]] for files in options.scan}
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        file.write(f"# python3 tools/training/points.py {command()}\n")
        file.write(f"# {device.name}, {device.platform}\n")
        rows: csv.DictWriter[str]
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n", restval="")
        rows.writeheader()
        for name in options.captures:
            there, points = Path(name), None
            if name == "workshop":
                there, points = workshop(Path(folder) / name)
            elif name in scans:
                points = np.concatenate([read_points(path)[0] for path in scans[name]])
            clouds = {} if points is None else scans_of(points, options.densities, Path(folder))
            sources = {source: source for source in SOURCES if source != "auto"} | clouds
            settings = TrainSettings(
                iterations=options.iterations, max_anchors=options.max_anchors,
                downscale=None if name == "workshop" else options.downscale,
            )  # fmt: skip
            capture = read_capture(there)
            factor = settings.downscale or choose_downscale(capture.photos)
            loaded = {s: load_photos(capture, s, factor, "object") for s in ("train", "test")}
            for seed in options.seeds:
                for words, source in sources.items():
                    changed = replace(settings, points=str(source), seed=seed)
                    for row in one_run(device, capture, loaded, changed):
                        rows.writerow({"capture": there.name, "points": words, "seed": seed} | row)
                    file.flush()


if __name__ == "__main__":
    main()
