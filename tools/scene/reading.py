"""What it costs to read the photos of a large capture: processor time and memory a photo.

    python3 tools/scene/reading.py CAPTURE ... --out docs/bench/reading.csv [--photos 2000]

The photos of each CAPTURE are taken again and again until there are --photos of them; with a bent
lens (k1 = 0.1) and without one, with sides up to 640 pixels and whole.  capture_s: the capture
without its pixels.  pixels_s: `load_photos`, as training does it.  pillow_s: Pillow decoding the
same files into bytes, whole, in the same run.  peak_mb: what the process grew by, at most; kept_mb:
bytes of the photos that come out.
"""

import argparse
import csv
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
    "capture", "photos", "file_size", "lens", "factor", "capture_s", "pixels_s", "pillow_s",
    "ms_a_megapixel", "kept_mb", "peak_mb",
)  # fmt: skip
WHOLE = 200  # photos of those that are not made smaller


def repeated(source: Path, folder: Path, count: int, bent: bool) -> Path:
    """A capture of `count` photos, links to those of another one."""
    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.scene.pose import OPENCV_FROM_EYE

    capture, frames = read_capture(source), []
    for number in range(count):
        photo = capture.photos[number % len(capture.photos)]
        link = folder / f"{number:05}{photo.path.suffix}"
        link.symlink_to(photo.path)
        camera_from_world, fx, fy, cx, cy = photo.view.pinhole()
        pose = np.linalg.inv(camera_from_world) @ OPENCV_FROM_EYE
        frames.append({
            "file_path": link.name, "transform_matrix": pose.tolist(), "fl_x": fx, "fl_y": fy,
            "cx": cx, "cy": cy, "w": photo.view.size[0], "h": photo.view.size[1],
            "k1": 0.1 * bent,
        })  # fmt: skip
    (folder / "transforms.json").write_text(json.dumps({"frames": frames, "up": [0, 1, 0]}))
    return folder


def measure(folder: Path, factor: int) -> dict:
    """In this process, which does nothing else."""
    from PIL import Image

    from shapeshift.scene.captures.read_capture import read_capture
    from shapeshift.training.photos import choose_downscale, load_photos

    began = time.process_time()
    capture = read_capture(folder)
    captured = time.process_time()
    factor = factor or choose_downscale(capture.photos)
    Path("/proc/self/clear_refs").write_text("5")  # the most begins anew
    before = resident("VmRSS")
    start = time.process_time()
    loaded = [
        photo for s in ("train", "test") for photo in load_photos(capture, s, factor, "object")
    ]
    read, most = time.process_time(), resident("VmHWM") - before
    pixels = 0
    plain = time.process_time()
    for photo in capture.photos:
        with Image.open(photo.path) as image:
            pixels += len(np.asarray(image.convert("RGB")).reshape(-1, 3))
    ended = time.process_time()
    size, kept = capture.photos[0].file_size, sum(p.rgba.nbytes for p in loaded)
    kept += sum(p.weight.nbytes for p in loaded if p.weight is not None)
    return {
        "photos": len(loaded), "file_size": "{}x{}".format(*size), "factor": factor,
        "capture_s": f"{captured - began:.1f}", "pixels_s": f"{read - start:.1f}",
        "pillow_s": f"{ended - plain:.1f}",
        "ms_a_megapixel": f"{1e9 * (read - start) / pixels:.1f}",
        "kept_mb": f"{kept / 1e6:.0f}", "peak_mb": f"{most / 1e6:.0f}",
    }  # fmt: skip


def resident(name: str) -> int:
    """Bytes of this process in memory, now (VmRSS) or at most (VmHWM)."""
    return int(re.search(rf"{name}:\s+(\d+) kB", Path("/proc/self/status").read_text())[1]) << 10


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--photos", type=int, default=2000)
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)  # a factor; 0: the usual one
    options = parser.parse_args()
    if options.measure is not None:
        sys.stdout.write(json.dumps(measure(options.captures[0], options.measure)))
        return
    from shapeshift.app.measure import processor

    with options.out.open("w", newline="") as file:
        words = [Path(w).name if Path(w) in options.captures else w for w in sys.argv[1:]]
        file.write(f"# python3 tools/scene/reading.py {shlex.join(words)}\n# {processor()}, ")
        file.write(f"{os.cpu_count()} cores\n")
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        for capture in options.captures:
            for factor in (0, 1):
                for bent in (False, True):
                    count = options.photos if not factor else WHOLE
                    with tempfile.TemporaryDirectory() as place:
                        folder = repeated(capture, Path(place), count, bent)
                        words = [sys.executable, __file__, str(folder), "--measure", str(factor)]
                        done = subprocess.run(words, check=True, capture_output=True, text=True)
                    about = {"capture": capture.name, "lens": "k1 = 0.1" if bent else "straight"}
                    rows.writerow(about | json.loads(done.stdout))
                    file.flush()


if __name__ == "__main__":
    main()
