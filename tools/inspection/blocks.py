"""The plant hall in blocks beside one model of the same steps a worker: dB, seams, memory.

    python3 tools/inspection/blocks.py WORK --out docs/bench/blocks.csv

WORK gets a ray-traced capture of the hall; what is there already is used as it is.  A run of the
whole comes first; from it one model goes on, and so does each block, all of them for --steps.  The
one model may have as many anchors as all blocks together.  The band is what lies within BAND metres
of a cut, by the tracer's own depth.  Memory is the largest of a process, less what the program
takes before it reads the capture.  No posed capture of that size and free to ship was found: this
one is ray-traced, and says nothing of exposures, moving people or wrong poses.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402, F401  # makes the folders its subpackages
from shapeshift.app.charts.chart_rows import write_text  # noqa: E402
from shapeshift.app.training.train_in_blocks import join  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.blocks.read_blocks import turned  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.pose import View  # noqa: E402
from shapeshift.training.blocks.block_start import (  # noqa: E402
    BlockStart,
    begin_block,
    begun_anew,
)
from shapeshift.training.blocks.starts import CutList, read_cut  # noqa: E402
from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint  # noqa: E402
from shapeshift.training.evaluation.evaluate import ModelRenderer  # noqa: E402
from shapeshift.training.photos import BLACK, LoadedPhoto, load_photos  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.tracer import depth_under  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402
from tools.synthetic.hall.hall import make_hall, place  # noqa: E402

BAND = 0.5  # metres on both sides of a cut
LEAST_PIXELS = 100  # of a band, or beside it, for a photo to count
COLUMNS = "what,name,RGB dB,RGB in the band,RGB elsewhere,Thermal dB,Thermal in the band,"
COLUMNS += "Thermal elsewhere,anchors,photos,MB of package,core s,MB of memory"


def launch(words: list[str]) -> None:
    subprocess.run([sys.executable, "-P", str(ROOT / "launch.py"), *words], check=True)


def prepare(work: Path, asked: argparse.Namespace) -> Path:
    """The capture, the run of the whole and its cut."""
    capture = work / "hall"
    if not (capture / "transforms.json").is_file():
        width, height = map(int, asked.size.split("x"))
        make_hall(capture, (width, height), asked.poses, processes=1)
    if not (work / "coarse.shift").is_file():
        words = ["--iterations", str(asked.coarse), "--max-anchors", str(asked.max_anchors)]
        launch(["train", str(capture), "--out", str(work / "coarse.shift"), *words])
    if not (work / "cut").is_dir():
        words = ["--cut", str(work / "coarse.shift"), "--blocks", asked.blocks]
        launch(["train", str(capture), "--out", str(work / "cut"), *words])
    return capture


def resident() -> float:
    """MB of this process at its largest."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def train_part(work: Path, part: str, steps: int, most: int) -> None:
    """In a process of its own: the whole, or a block, and a row of facts beside its package."""
    device, before = open_device(), resident()
    capture = read_capture(work / "hall")
    if part == "whole":
        state, notes = read_checkpoint(checkpoint_path(work / "coarse.shift"))
        settings = TrainSettings(**notes["settings"])
        settings = replace(settings, iterations=steps, max_anchors=most)
        resume = state, begun_anew(notes) | {"run_length": steps}
        trainer = Trainer(device, capture, settings, resume)
    else:
        start = BlockStart.read(work / "cut" / f"{part}.start.npz")
        settings = TrainSettings(**start.notes["settings"])
        settings = replace(settings, iterations=steps, max_anchors=most)
        trainer = begin_block(device, start, capture, settings)
    began = time.process_time()
    for _ in trainer.steps():
        pass
    spent = time.process_time() - began
    facts = {
        "core_s": spent, "memory_mb": resident() - before, "anchors": trainer.anchors_count,
        "photos": sum(map(len, trainer.schedule.photos.values())),
    }  # fmt: skip
    write_package(trainer.model(), work / f"{part}.shift")
    (work / f"{part}.json").write_text(json.dumps(facts))


def facts_of(work: Path, part: str, asked: argparse.Namespace, most: int) -> dict:
    if not (work / f"{part}.json").is_file():
        words = [str(work), "--part", part, "--steps", str(asked.steps)]
        words += ["--max-anchors", str(most), "--out", str(asked.out)]
        subprocess.run([sys.executable, "-P", __file__, *words], check=True)
    return json.loads((work / f"{part}.json").read_text())


def near_cuts(view: View, cut: CutList) -> np.ndarray:
    """(H, W) bool: pixels that show a place within BAND metres of a cut."""
    here, _ = place()
    depth = depth_under(here, view)
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    rows, columns = (grid + 0.5 for grid in np.mgrid[: view.size[1], : view.size[0]])
    eye = [(columns - cx) / fx * depth, (rows - cy) / fy * depth, depth, np.ones_like(depth)]
    world = (np.stack(eye, -1) @ np.linalg.inv(camera_from_world).T)[..., :3]
    places = turned(world.reshape(-1, 3), cut.turn_degrees)
    there = depth.reshape(-1) > 0
    inside = np.stack([row.box.holds(places, BAND) for row in cut.blocks]).sum(axis=0)
    return ((inside > 1) & there).reshape(depth.shape)  # two enlarged boxes hold it


def decibels(square: np.ndarray) -> float:
    return float(-10 * np.log10(max(float(np.mean(square)), 1e-12)))


def scores(
    device, model, photos: list[LoadedPhoto], bands: dict[str, np.ndarray]
) -> tuple[list[float], dict[str, np.ndarray]]:
    """dB of each modality: of all pixels (mean of photos), in the band, elsewhere; the pictures."""
    renderer, out, pictures = ModelRenderer(device, model), [], {}
    for stop in model.stops:
        renderer.set_control(stop.x)
        whole, band, rest = [], [], []
        for photo in (p for p in photos if p.modality == stop.name):
            picture = np.clip(renderer.picture(photo.view, BLACK), 0, 1)
            pictures[photo.name] = picture
            square = ((picture - photo.over(BLACK)) ** 2).mean(axis=2)
            whole.append(decibels(square))
            near = bands[photo.name]
            if LEAST_PIXELS <= near.sum() <= near.size - LEAST_PIXELS:
                band.append(square[near].mean())
                rest.append(square[~near].mean())
        out += [float(np.mean(whole)), decibels(np.array(band)), decibels(np.array(rest))]
    return out, pictures


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("--size", default="128x96")
    parser.add_argument("--poses", type=int, default=240)
    parser.add_argument("--coarse", type=int, default=1500)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--max-anchors", type=int, default=6000, help="of a block")
    parser.add_argument("--blocks", default="2x2")
    parser.add_argument("--part", default="", help="train this one alone: whole, 0, 1, ...")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    if asked.part:
        train_part(asked.work, asked.part, asked.steps, asked.max_anchors)
        return
    capture = read_capture(prepare(asked.work, asked))
    cut = read_cut(asked.work / "cut")
    count = len(cut.blocks)
    most = asked.max_anchors
    whole = facts_of(asked.work, "whole", asked, count * most)
    each = [facts_of(asked.work, str(n), asked, most) for n in range(count)]
    join(asked.work, cut, asked.work / "hall.blocks")
    device, photos = open_device(), load_photos(capture, "test", 1, "object")
    bands = {photo.name: near_cuts(photo.view, cut) for photo in photos}
    files = {"run of the whole": "coarse.shift", "one model": "whole.shift",
             "blocks": "hall.blocks"}  # fmt: skip
    rows, drawn = [], {}
    for name, file in files.items():
        path = asked.work / file
        model = read_model(path)
        assert isinstance(model, AnchorModel)
        values, drawn[name] = scores(device, model, photos, bands)
        size = sum(f.stat().st_size for f in (path.iterdir() if path.is_dir() else [path]))
        rows.append(["scene", name, *(f"{v:.2f}" for v in values), len(model.anchors), "",
                     f"{size / 1e6:.2f}", "", ""])  # fmt: skip
    for name, facts in [("one model", whole), *((f"block {n}", f) for n, f in enumerate(each))]:
        rows.append(["run", name, *[""] * 6, facts["anchors"], facts["photos"], "",
                     f"{facts['core_s']:.0f}", f"{facts['memory_mb']:.0f}"])  # fmt: skip
    head = (
        f"# python3 tools/inspection/blocks.py WORK --size {asked.size} --poses {asked.poses} "
        f"--coarse {asked.coarse} --steps {asked.steps} --max-anchors {most} --blocks "
        f"{asked.blocks} --out docs/bench/blocks.csv\n"
    )
    lines = [",".join(map(str, row)) for row in rows]
    write_text(asked.out, head + COLUMNS + "\n" + "\n".join(lines) + "\n")
    save_pictures(asked.work, photos, bands, drawn)
    sys.stdout.write(asked.out.read_text())


def save_pictures(
    work: Path, photos: list[LoadedPhoto], bands: dict[str, np.ndarray],
    drawn: dict[str, dict[str, np.ndarray]],
) -> None:  # fmt: skip
    """Of the photos that show most of the band: photo, one model, blocks, where the band is."""
    from PIL import Image

    for modality in dict.fromkeys(photo.modality for photo in photos):
        mine = [photo for photo in photos if photo.modality == modality]
        mine.sort(key=lambda photo: -bands[photo.name].sum())
        rows = []
        for photo in mine[:4]:
            band = np.repeat(bands[photo.name][..., None], 3, axis=2).astype(np.float32)
            parts = [photo.over(BLACK), *(drawn[n][photo.name] for n in ("one model", "blocks"))]
            rows.append(np.concatenate([*parts, band], axis=1))
        picture = (255 * np.concatenate(rows)).round().astype(np.uint8)
        image = Image.fromarray(picture)
        size = image.width * 3, image.height * 3
        image.resize(size, Image.Resampling.NEAREST).save(work / f"{modality.lower()}.png")


if __name__ == "__main__":
    main()
