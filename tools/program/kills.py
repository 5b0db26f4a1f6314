"""Kills commands at random instants, starts them again, and looks at what there is then.

    python tools/program/kills.py --kills 20 --work WORK --out docs/bench/kills.csv

Each job is a command on a small capture of its own.  It runs undisturbed twice, which gives its
bytes and how long it takes; then, `kills` times, it is killed (SIGKILL, with its children) at an
instant of that time, each in a share of its own, and the same command is started again.  went_on:
it did what was left, or all; resumed: it asked for --resume and did it with that; whole: all had
been written before the kill.  refused, other_bytes and left_over (files that the undisturbed run
does not leave, beside the result, among temporary files, in caches; claims) are faults.
Checkpoints and the work of blocks hold what a clock said: that they are there is compared, their
bytes are not.
"""

import argparse
import csv
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

COLUMNS = ("job", "undisturbed_s", "kills", "went_on", "resumed", "whole", "refused",
           "other_bytes", "left_over")  # fmt: skip
PROGRAM = (sys.executable, "-P", str(ROOT / "shapeshift/__main__.py"))
CLOCKED = (".checkpoint.npz", ".work/")  # the end of a file's name, a part of its path
CACHED = ("pocl", "starts", "matplotlib")  # below our caches: how a cache fills differs


@dataclass(frozen=True)
class Job:
    """A command; IN is the folder of inputs, OUT an empty one."""

    words: str
    cold: bool = False  # with empty caches


JOBS = {
    "first start": Job("render IN/room.shift --size 48x36 --out OUT/pictures", cold=True),
    "poses": Job("poses IN/photos --out OUT/room"),
    "poses of a video": Job("poses IN/walk.mp4 --frames 6 --out OUT/room"),
    "train": Job("train IN/capture --out OUT/a.shift --iterations 60 --max-anchors 300"),
    "train --blocks": Job(
        "train IN/capture --out OUT/a.blocks --blocks 2 --block-photos 4 --max-anchors 200 "
        "--iterations 20 --coarse-iterations 10"
    ),
    "segment": Job(
        "segment IN/demo.shift IN/demo --masks IN/masks --out OUT/cut.scene.json --downscale 2"
    ),
    "segment --segmenter": Job(
        "segment IN/demo.shift IN/demo --objects IN/objects.json --segmenter IN/sam --photos 3 "
        "--no-complete --out OUT/cut.scene.json"
    ),
    "style": Job("style IN/room.shift --shape melt --out OUT/a.shift"),
    "film": Job("film IN/room.shift --out OUT/a.webp --seconds 1 --fps 8 --size 96x72"),
    "lod": Job("lod IN/a.ply --out OUT/a --leaf 500"),
    "update": Job(
        "update IN/balls.shift IN/capture --where box:0.15,0.18,0.55:0.32,0.3,0.32 "
        "--out OUT/b.shift --iterations 40"
    ),
}


def make_inputs(folder: Path, jobs: Sequence[str]) -> None:
    """What the jobs read, made by the tests' own rules; what is there stays."""
    from shapeshift.runtime_models.package.write_package import write_package
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.new_stops import framed_model
    from tests.support.splats.ply_files import some_splats

    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "room.shift").exists():
        write_package(framed_model(2000), folder / "room.shift")
        write_ply(some_splats(4000, 4, opacities=(0.3, 0.9)), folder / "a.ply")
    names = " ".join(JOBS[job].words for job in jobs)
    if "IN/capture" in names and not (folder / "balls.shift").exists():
        make_capture(folder)
    if "IN/photos" in names or "IN/walk.mp4" in names:
        make_photos(folder)
    if "IN/demo" in names and not (folder / "demo.shift").exists():
        make_prompts(folder)


def make_capture(folder: Path) -> None:
    import shapeshift as ss
    from shapeshift.training.synthetic.balls import make_balls

    make_balls(folder / "capture", size=48, views=6, test_views=2)
    ss.train(folder / "capture", folder / "balls.shift", iterations=30, max_anchors=300, pace=False)


def make_photos(folder: Path) -> None:
    import av

    from tests.support.scene.textured_room import camera, photo, write_photos

    if (folder / "walk.mp4").exists():
        return
    write_photos(folder / "photos", 6)
    with av.open(str(folder / "walk.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        stream.bit_rate = 20_000_000
        for i in range(18):
            frame = av.VideoFrame.from_ndarray(photo(camera(i // 3, 6)), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def make_prompts(folder: Path) -> None:
    import json

    from shapeshift.app.paths import DEMO
    from shapeshift.decomposition.masks.label_maps import write_label_map
    from tests.support.decomposition.demo_photos import box_of_object, true_maps, write_demo_capture
    from tests.support.decomposition.sam_stand_ins import write_sam
    from tools.synthetic.labels import LABELS

    write_demo_capture(folder / "demo")
    maps = true_maps()[1]
    (folder / "masks/rgb").mkdir(parents=True)
    for i, labels in enumerate(maps):
        write_label_map(np.where(labels == LABELS["mug"], labels, 0).astype(np.uint8),
                        folder / f"masks/rgb/{i:03}.png")  # fmt: skip
    view = int(np.argmax([(labels == LABELS["mug"]).sum() for labels in maps]))
    said = {"photo": f"rgb/{view:03}.png", "box": box_of_object(view, LABELS["mug"])}
    rows = [{"label": 1, "name": "mug", "prompts": [said]}]
    (folder / "objects.json").write_text(
        json.dumps({"format": "shapeshift-objects 1", "objects": rows})
    )
    (folder / "sam").mkdir()
    write_sam(folder / "sam", "sam", 256)
    shutil.copyfile(DEMO, folder / "demo.shift")


class Bench:
    """One job: its folders, its starts."""

    def __init__(self, name: str, work: Path, job: Job, program: Sequence[str] = PROGRAM) -> None:
        self.name, self.job, self.program, self.inputs = name, job, program, work / "inputs"
        self.place = work / name.replace(" ", "_").replace("-", "")
        self.caches = self.place / "caches" if self.job.cold else work / "caches"
        self.faults: list[str] = []

    def clean(self) -> None:
        shutil.rmtree(self.place, ignore_errors=True)
        for folder in (self.place / "out", self.place / "tmp", self.caches):
            folder.mkdir(parents=True, exist_ok=True)

    def start(self, *more: str) -> subprocess.Popen:
        words = [
            word.replace("IN/", f"{self.inputs}/").replace("OUT/", f"{self.place / 'out'}/")
            for word in self.job.words.split()
        ]
        here = {name: str(self.place / "tmp") for name in ("TMPDIR", "HOME")}
        here |= {"XDG_CACHE_HOME": str(self.caches), "XDG_CONFIG_HOME": str(self.place / "tmp"),
                 "XDG_DATA_HOME": str(self.place / "tmp")}  # fmt: skip
        with (self.place / "said").open("wb") as said:
            return subprocess.Popen(
                [*self.program, *words, *more],
                stdin=subprocess.DEVNULL, stdout=said, stderr=said, env=os.environ | here,
                cwd=self.place, start_new_session=True,
            )  # fmt: skip

    def run(self, *more: str) -> tuple[int, str]:
        code = self.start(*more).wait()
        return code, (self.place / "said").read_text("utf-8", "replace")

    def result(self) -> dict[str, str]:
        """Each file's bytes as a hash, by its path below the folder of results."""
        out = self.place / "out"
        found = {path.relative_to(out).as_posix(): path for path in sorted(out.rglob("*"))}
        return {
            name: "there"
            if path.is_dir() or any(end in name for end in CLOCKED)
            else hashlib.sha256(path.read_bytes()).hexdigest()
            for name, path in found.items()
        }

    def litter(self) -> list[str]:
        """What lies among temporary files and claims, and parts in caches."""
        found = [path for path in (self.place / "tmp").rglob("*") if path.is_file()]
        ours = self.caches / "shapeshift"
        found += [
            path for path in ours.rglob("*")
            if path.is_file() and path.relative_to(ours).parts[0] not in CACHED
            and (path.suffix in (".part", ".lock") or path.name.startswith("."))
        ]  # fmt: skip
        return [str(path.relative_to(self.place.parent)) for path in found]

    def go_on(self, whole: dict[str, str]) -> str:
        """Starts the killed command again: what became of it."""
        before = self.result()
        code, said = self.run()
        if code == 2 and "--resume" in said:
            code, said = self.run("--resume")
            if code == 0:
                return "resumed"
        if code == 2 and "--overwrite" in said and before == whole:
            return "whole"
        if code == 0:
            return "went_on"
        self.faults.append(f"exit {code}: {said.strip()[-300:]}")
        return "refused"

    def undisturbed(self) -> tuple[float, dict[str, str], set[str]]:
        """Seconds, bytes and what stays elsewhere; of the second of two runs, with warm kernels."""
        results: list[dict[str, str]] = []
        took = 0.0
        for _ in range(2):
            self.clean()
            begun = time.monotonic()
            code, said = self.run()
            took = time.monotonic() - begun
            if code != 0:
                raise SystemExit(f"{self.name}: {said}")
            results.append(self.result())
        if results[0] != results[1]:
            self.faults.append("two undisturbed runs have other bytes")
        return took, results[1], set(self.litter())

    def row(self, kills: int, seed: int) -> dict:
        took, whole, usual = self.undisturbed()
        random, counts = np.random.default_rng([seed, len(self.name)]), Counter()
        for kill in range(kills):
            self.clean()
            running = self.start()
            time.sleep(took * (kill + random.random()) / kills)
            os.killpg(running.pid, signal.SIGKILL)
            running.wait()
            counts[self.go_on(whole)] += 1
            found = self.result()
            changed = [name for name in whole if found.get(name) != whole[name]]
            more = sorted(set(found) - set(whole)) + sorted(set(self.litter()) - usual)
            counts["other_bytes"] += bool(changed)
            counts["left_over"] += bool(more)
            self.faults += [f"other bytes: {changed}"] * bool(changed)
            self.faults += [f"left over: {more}"] * bool(more)
        return {"job": self.name, "undisturbed_s": f"{took:.1f}", "kills": kills} | {
            column: counts[column] for column in COLUMNS[3:]
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=2, help="of each job")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--only", nargs="+", default=list(JOBS), choices=JOBS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    make_inputs(options.work.resolve() / "inputs", options.only)
    rows = []
    for name in options.only:
        bench = Bench(name, options.work.resolve(), JOBS[name])
        rows.append(bench.row(options.kills, options.seed))
        sys.stdout.write(f"{rows[-1]}\n" + "".join(f"  {fault}\n" for fault in bench.faults))
        sys.stdout.flush()
    if options.out:
        with options.out.open("w", newline="") as file:
            file.write(f"# python tools/program/kills.py --kills {options.kills} --work WORK ")
            file.write("--out docs/bench/kills.csv\n")
            table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


if __name__ == "__main__":
    main()
