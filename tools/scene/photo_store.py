"""What a capture of many photos takes of memory and time, in memory and from the store on disk.

    python3 tools/scene/photo_store.py CAPTURE --out docs/bench/photo_store.csv [--photos 5000]

The photos of CAPTURE, made 640x480, are taken again and again until there are --photos of them,
each with its own file.  Each row is a process of its own.  peak_mb: what it took at most, all of
it.  first_step_s: processor seconds from its start to the end of the first step.  read_ms: a photo
that was read.  disk_mb: of the store.  Rows "in turns": two trainings in one process, a step of the
one after a step of the other, of which the one has all photos in memory and the other reads each
from the store; step_ms is processor time with reading, ratio that of the row before it.  package:
the first digits of the SHA-256 of what is written.
"""

import argparse
import csv
import hashlib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

COLUMNS = (
    "photos", "way", "photo_mb", "steps", "peak_mb", "first_step_s", "step_ms", "ratio", "read_ms",
    "read", "disk_mb", "package",
)  # fmt: skip
SIZE = (640, 480)
ALL, WINDOW = 20_000, 300  # MB
STEPS, TURNS, FEW = 40, 120, 300  # steps of a row, steps in turns, photos of these


def made(source: Path, folder: Path, count: int) -> Path:
    """A capture of `count` photos of 640x480, copies of another one's."""
    from PIL import Image

    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.scene.pose import OPENCV_FROM_EYE

    capture, frames = read_capture(source), []
    for number in range(count):
        photo = capture.photos[number % len(capture.photos)]
        file = folder / f"{number:05}.jpg"
        if number < len(capture.photos):
            Image.open(photo.path).convert("RGB").resize(SIZE).save(file, quality=95)
        else:
            os.link(folder / f"{number % len(capture.photos):05}.jpg", file)
        camera_from_world, fx, fy, cx, cy = photo.view.pinhole()
        pose = np.linalg.inv(camera_from_world) @ OPENCV_FROM_EYE
        x, y = (new / old for new, old in zip(SIZE, photo.view.size, strict=True))
        frames.append({
            "file_path": file.name, "transform_matrix": pose.tolist(), "fl_x": fx * x,
            "fl_y": fy * y, "cx": cx * x, "cy": cy * y, "w": SIZE[0], "h": SIZE[1],
        })  # fmt: skip
    assert capture.points is not None
    np.savez(folder / "points.npz", xyz=capture.points)
    about = {"frames": frames, "up": [0, 1, 0], "points": "points.npz"}
    (folder / "transforms.json").write_text(json.dumps(about))
    return folder


def trainer_of(folder: Path, megabytes: int, steps: int):
    from shapeshift.rasterizer.device import open_device
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.photo_store.open_photos import PhotoRoom
    from shapeshift.training.settings import TrainSettings
    from shapeshift.training.train import Trainer

    room = PhotoRoom(int(megabytes * 1e6), folder.with_suffix(".photos"))
    settings = TrainSettings(iterations=steps, max_anchors=4000)
    return Trainer(open_device("cpu"), read_capture(folder), settings, room=room)


def measure(folder: Path, megabytes: int) -> dict:
    """In this process, which does nothing else."""
    from shapeshift.runtime_models.package.write_package import package_files

    trainer, first, start = trainer_of(folder, megabytes, STEPS), 0.0, 0.0
    for _ in trainer.steps():
        first, start = first or time.process_time(), start or trainer.elapsed
    step = (trainer.elapsed - start) / (trainer.iteration - 1)
    files = package_files(trainer.model(), "float16")
    digest = hashlib.sha256(b"".join(files[name] for name in sorted(files))).hexdigest()
    store, row = trainer.photos.store, {"first_step_s": f"{first:.1f}", "package": digest[:12]}
    row |= {"steps": STEPS, "step_ms": f"{1e3 * step:.1f}", "peak_mb": f"{peak() / 1e6:.0f}"}
    row["way"] = "memory" if store is None else "store"
    if store is not None:
        row["read"] = store.sources
        row["read_ms"] = f"{1e3 * store.read_s / max(store.sources, 1):.1f}"
        row["disk_mb"] = f"{store.files.size / 1e6:.0f}"
    trainer.photos.close()
    return row


def in_turns(folder: Path) -> list[dict]:
    """All in memory, and from the store, whose window holds a tenth, after it was filled."""
    megabytes = FEW * SIZE[0] * SIZE[1] * 4 // 10 / 1e6
    ways = [trainer_of(folder, ALL, TURNS), trainer_of(folder, megabytes, TURNS)]  # pyright: ignore[reportArgumentType]
    store = ways[1].photos.store
    for number in range(FEW):
        store.get(number)
    store.read_s, before = 0.0, store.sources
    runs, used, rows = [way.steps() for way in ways], [0.0, 0.0], []
    for step in range(TURNS):
        for which, run in enumerate(runs):
            start = time.process_time()
            next(run)
            used[which] += (time.process_time() - start) * (step > 0)
    for which, way in enumerate(ways):
        rows.append({
            "way": f"{('memory', 'store')[which]}, in turns", "steps": way.iteration,
            "photo_mb": ("", f"{megabytes:.0f}")[which],
            "step_ms": f"{1e3 * used[which] / (TURNS - 1):.1f}",
            "ratio": f"{used[which] / used[0]:.3f}",
        })  # fmt: skip
    rows[1] |= {"read": store.sources - before, "read_ms": f"{1e3 * store.read_s / TURNS:.1f}"}
    ways[1].photos.close()
    return rows


def peak() -> int:
    """Bytes that this process has had in memory at most."""
    return int(re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) << 10


def child(folder: Path, megabytes: int) -> list[dict]:
    words = [sys.executable, __file__, str(folder), "--measure", str(megabytes)]
    done = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--photos", type=int, default=5000)
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)  # MB; 0: in turns
    options = parser.parse_args()
    if options.measure is not None:
        few = not options.measure
        rows = in_turns(options.capture) if few else [measure(options.capture, options.measure)]
        sys.stdout.write(json.dumps(rows))
        return
    from shapeshift.app.measure import processor

    with options.out.open("w", newline="") as file:
        words = [Path(w).name if Path(w) == options.capture else w for w in sys.argv[1:]]
        file.write(f"# python3 tools/scene/photo_store.py {shlex.join(words)}\n# {processor()}, ")
        file.write(f"{os.cpu_count()} cores\n")
        table: csv.DictWriter[str] = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        for count, sizes in ((FEW, (0, ALL, WINDOW // 10)), (options.photos, (WINDOW, ALL))):
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place) / "capture"
                folder.mkdir()
                made(options.capture, folder, count)
                for megabytes in sizes:
                    for row in child(folder, megabytes):
                        table.writerow({"photos": count, "photo_mb": megabytes} | row)
                        file.flush()


if __name__ == "__main__":
    main()
