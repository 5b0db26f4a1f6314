"""What a budget of splats shows and costs: --budget on a scene in levels of detail.

python tools/renderer/budget.py FOLDER --view EX,EY,EZ,TX,TY,TZ ... --out docs/bench/budget.csv

FOLDER is streamed SOG, as launch.py lod writes it.  Each row is measured in a process of its own:
"budget" draws one view after the other, "one level" what --max-splats reads, "walk" 120 frames of a
metre and 30 degrees with what frames in motion do, "four" 2 x 2 copies side by side.  dB are
against all splats of the same folder, drawn by the same tiles; first_cpu_ms is the frame that
reads, frame_cpu_ms the median of still ones (of a walk: of its frames), both of all threads;
still_cpu_ms and still_p95_cpu_ms are of a walk's frames drawn once more each, in turns, without
anything that streams.
"""

import argparse
import csv
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.timing import PassTimer
from shapeshift.runtime_models.files.part_cache import PartCache
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import LeafReading, Reading
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.scene import Scene, SceneObject

SIZE = (1280, 720)
STILL = 5  # frames of which the median is taken
WALK = 120  # frames of a metre and 30 degrees
COMPARED = 6  # of them, with all splats
BUDGETS = (500_000, 1_000_000, 2_000_000, 4_000_000)
COLUMNS = (
    "scene", "view", "way", "budget", "splats", "psnr_db", "first_cpu_ms", "frame_cpu_ms",
    "p95_cpu_ms", "still_cpu_ms", "still_p95_cpu_ms", "looks", "peak_mb",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--view", action="append", required=True)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--up", default="")
    parser.add_argument("--cache-mb", type=int, default=2048)
    parser.add_argument("--child", nargs=3, metavar=("WAY", "BUDGET", "PICTURES"))
    given = parser.parse_args()
    views = [view_of(text) for text in given.view]
    if given.child:
        way, budget, pictures = given.child
        rows = list(measure(given.folder, views, way, int(budget), Path(pictures), given))
        sys.stdout.write(json.dumps(rows) + "\n")
        return
    with tempfile.TemporaryDirectory() as pictures:
        run_child(given, "whole", 0, pictures)
        rows = []
        for way, budget in [
            *(("one level", budget) for budget in BUDGETS[2:]),
            *(("budget", budget) for budget in BUDGETS),
            ("walk", 2_000_000), ("four", 2_000_000),
        ]:  # fmt: skip
            rows += run_child(given, way, budget, pictures)
            sys.stderr.write(f"{rows[-len(views) :]}\n")
    if given.out:
        write_rows(given, rows)


def write_rows(given: argparse.Namespace, rows: list[dict]) -> None:
    views = [f"--view={text}" for text in given.view]
    views = " ".join([f"--up={given.up}", *views] if given.up else views)
    with given.out.open("w", newline="") as file:
        file.write(f"# python tools/renderer/budget.py {given.folder.name} {views}\n")
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def run_child(given: argparse.Namespace, way: str, budget: int, pictures: str) -> list[dict]:
    views = [word for text in given.view for word in (f"--view={text}",)]
    words = [sys.executable, __file__, str(given.folder), *views, f"--up={given.up}"]
    words += ["--cache-mb", str(given.cache_mb), "--child", way, str(budget), pictures]
    done = subprocess.run(words, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def view_of(text: str) -> View:
    numbers = np.array([float(word) for word in text.split(",")])
    pose = look_at(numbers[:3], numbers[3:])
    return View(pose, perspective(np.deg2rad(60), SIZE), 0.05, 1000.0, SIZE)


def walk_of(view: View) -> list[View]:
    """A metre to the right while it turns by 30 degrees to the left."""
    start, out = view.world_from_eye.matrix(), []
    for part in np.linspace(0, 1, WALK):
        angle, pose = np.deg2rad(30) * part, start.copy()
        turn = np.eye(3)
        turn[[0, 0, 2, 2], [0, 2, 0, 2]] = (
            np.cos(angle),
            np.sin(angle),
            -np.sin(angle),
            np.cos(angle),
        )
        pose[:3, :3] = turn @ start[:3, :3]
        pose[:3, 3] = start[:3, 3] + part * start[:3, 0]
        out.append(replace(view, world_from_eye=Pose.from_matrix(pose)))
    return out


def compared(views: list[View]) -> list[int]:
    return np.linspace(0, len(views) - 1, COMPARED, dtype=int).tolist()


def measure(
    folder: Path,
    views: list[View],
    way: str,
    budget: int,
    pictures: Path,
    given: argparse.Namespace,
) -> Iterator[dict]:
    """The rows of one way; "whole" keeps its pictures instead."""
    cache = PartCache(given.cache_mb << 20)
    reading = Reading(up=given.up, leaves=LeafReading(budget or 1_000_000_000, cache))
    if way == "one level":
        reading = Reading(up=given.up, most_splats=budget)
    model = read_model(folder, reading)
    assert isinstance(model, SplatLayers)
    with Renderer(None, "tiles") as renderer:
        renderer.update(Scene(tuple(placed(model, 4 if way == "four" else 1))))
        for number, view in enumerate(views):
            row: dict = {"scene": folder.name, "view": number + 1, "way": way, "budget": budget}
            row |= walk(renderer, view, pictures / f"{number}") if way == "walk" else (
                still(renderer, view, way, pictures / f"{number}")
            )  # fmt: skip
            if way != "whole":
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
                yield row | {"peak_mb": round(peak / 1e3)}


def placed(model: SplatLayers, copies: int) -> Iterator[SceneObject]:
    """Side by side, as far apart as the middle half of the splats reaches."""
    low, high = np.percentile(model.means, (2, 98), axis=0)
    side = high - low
    for i in range(copies):
        place = np.array([i % 2 * side[0], 0, -(i // 2) * side[2]])
        yield SceneObject(f"copy {i}", model, Pose(place, np.array([1.0, 0, 0, 0])))


def still(renderer: Renderer, view: View, way: str, picture: Path) -> dict:
    begun = time.process_time()
    stats = renderer.draw([view])
    first = time.process_time() - begun
    image = np.clip(renderer.image(0)[..., :3], 0, 1)
    if way == "whole":
        np.save(picture, image.astype(np.float32))
        for n in compared(walk_of(view)):
            renderer.draw([walk_of(view)[n]])
            walked = np.clip(renderer.image(0)[..., :3], 0, 1)
            np.save(picture.with_name(f"{picture.name}_{n}"), walked.astype(np.float32))
        return {}
    times = []
    for _ in range(STILL):
        begun = time.process_time()
        renderer.draw([view])
        times.append(time.process_time() - begun)
    streamed = stats.streaming
    row: dict[str, float] = {"splats": streamed.shown if streamed else stats.splats}
    if way != "four":
        row["psnr_db"] = round(psnr(image, np.load(f"{picture}.npy")), 2)
    return row | {
        "first_cpu_ms": round(1e3 * first), "frame_cpu_ms": round(1e3 * float(np.median(times)))
    }  # fmt: skip


def walk(renderer: Renderer, view: View, picture: Path) -> dict:
    """Frames in motion, after the first has rested; dB are the mean over COMPARED of them."""
    path, streaming = walk_of(view), renderer.streaming
    streaming.converges = False
    begun = time.process_time()
    stats = renderer.draw([path[0]])
    first = time.process_time() - begun
    for _ in range(400):
        if not stats.streaming or not stats.streaming.pending:
            break
        time.sleep(0.02)  # for the thread that reads
        stats = renderer.draw([path[0]])
    times, stills, scores, most = [], [], [], 0
    for n, each in enumerate(path):
        begun = time.process_time()
        stats = renderer.draw([each])
        times.append(time.process_time() - begun)
        stills.append(draw_still(renderer, each))
        assert stats.streaming is not None
        most = max(most, stats.streaming.shown)
        if n in compared(path):
            image = np.clip(renderer.image(0)[..., :3], 0, 1)
            scores.append(psnr(image, np.load(f"{picture}_{n}.npy")))
    assert streaming.stream is not None
    p50, p95 = np.percentile(times, (50, 95))
    still = np.percentile(stills, (50, 95))
    return {
        "splats": most, "psnr_db": round(float(np.mean(scores)), 2),
        "first_cpu_ms": round(1e3 * first), "frame_cpu_ms": round(1e3 * p50),
        "p95_cpu_ms": round(1e3 * p95), "looks": streaming.stream.weights.looks,
        "still_cpu_ms": round(1e3 * still[0]), "still_p95_cpu_ms": round(1e3 * still[1]),
    }  # fmt: skip


def draw_still(renderer: Renderer, view: View) -> float:
    """Seconds of the passes alone, of what lies in the arena."""
    begun = time.process_time()
    renderer.drawing.draw([view], renderer.settings, PassTimer(None))
    return time.process_time() - begun


if __name__ == "__main__":
    main()
