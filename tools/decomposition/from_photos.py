"""Photos to objects, stage by stage, on three captures: seconds, and what came out.

    python3 tools/decomposition/from_photos.py DATA --work WORK --out docs/bench/from_photos.csv

DATA holds banana16_unposed, plush_snowmiku and maryrose_tankard.  Every stage is a command of the
program as a person starts it, in a process of its own; cpu_s is its processor time with all its
children's.  Objects are found from one box each in one photo (the plush with
clicks on its face, which is of the wall's colour), without a network.  --work is
a new folder; what each stage makes stays there.
"""

import argparse
import csv
import json
import os
import resource
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

COLUMNS = ("capture", "stage", "cpu_s", "result")
STEPS = 1500  # of the training
REST_S = 2.0  # that objects are left alone
LIFT_M, THROW_S = 0.3, 0.4  # a throw: so high, with a hand that moves so long


@dataclass(frozen=True)
class Case:
    """One capture, and the boxes of its objects: pixels of a photo's file."""

    photos: str
    poses: tuple[str, ...]  # options of `poses`
    objects: dict[str, tuple[str, tuple[int, ...]]]  # name: photo; left, top, right, bottom
    clicks: tuple[tuple[int, int], ...] = ()  # on the first object, where its colours mislead


CASES = {
    "banana": Case(
        "banana16_unposed/images", (), {"bananas": ("DSC_0423.JPG", (245, 215, 1070, 775))}
    ),
    "plush": Case(
        "plush_snowmiku/images", ("--every", "3"),
        {
            "plush": ("20240212_003919.jpg", (265, 115, 765, 615)),
            "fox": ("20240212_004049.jpg", (45, 172, 160, 345)),
            "books": ("20240212_003919.jpg", (815, 130, 985, 190)),
        },
        ((440, 320), (470, 300), (500, 310), (540, 310), (560, 330), (500, 368), (460, 380),
         (540, 380), (400, 205), (455, 195), (520, 480), (500, 150), (380, 180), (640, 290)),
    ),
    "tankard": Case(
        "maryrose_tankard/images", ("--every", "2", "--masks", "maryrose_tankard/masks"),
        {"tankard": ("IMG_9669.jpg", (40, 60, 945, 800))},
    ),
}  # fmt: skip


def start(words: list[str]) -> tuple[float, str]:
    """Processor seconds, and all that was said; ends the program where the command fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, str(ROOT / "launch.py"), *words], capture_output=True, text=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(f"{shlex.join(words)}: {done.stderr.strip().splitlines()[-1]}")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, done.stdout + done.stderr


def objects_file(case: Case, path: Path) -> None:
    rows = [
        {
            "label": label,
            "name": name,
            "mass_kg": 0.3,
            "prompts": [
                {
                    "photo": f"images/{photo}",
                    "box": list(box),
                    "inside": [list(place) for place in case.clicks] if label == 1 else [],
                }
            ],
        }
        for label, (name, (photo, box)) in enumerate(case.objects.items(), 1)
    ]
    path.write_text(json.dumps({"format": "shapeshift-objects 1", "objects": rows}, indent=1))


def stages(name: str, case: Case, data: Path, work: Path) -> list[tuple[str, Path, list[str]]]:
    """Each stage with the file that it leaves and its words."""
    capture, model = work / name, work / f"{name}.shift"
    objects, cut = work / f"{name}.objects.json", work / f"{name}_cut" / f"{name}.scene.json"
    options = [str(data / word) if "/" in word else word for word in case.poses]
    objects_file(case, objects)
    script = work / f"{name}.jsonl"
    return [
        ("poses", capture / "poses.json",
         ["poses", str(data / case.photos), "--out", str(capture), *options]),
        ("train", model,
         ["train", str(capture), "--out", str(model), "--iterations", str(STEPS)]),
        ("segment", cut,
         ["segment", str(model), str(capture), "--objects", str(objects), "--out", str(cut),
          "--report", str(work / f"{name}_report")]),
        ("rest", work / f"{name}_rest" / "run.jsonl",
         ["simulate", str(cut), "--seconds", str(REST_S), "--out", str(work / f"{name}_rest")]),
        ("throw", work / f"{name}_throw" / "run.jsonl",
         ["simulate", str(cut), "--script", str(script), "--pictures", "30",
          "--out", str(work / f"{name}_throw")]),
    ]  # fmt: skip


def poses_of(run: Path) -> dict[str, list[list[float]]]:
    """The poses of each object that moved in a run, in order: position (3), quaternion (4)."""
    found: dict[str, list[list[float]]] = {}
    for line in map(json.loads, run.read_text().splitlines()):
        for who, pose in line.get("poses", {}).items():
            found.setdefault(who, []).append(pose)
    return found


def write_throw(rest: Path, script: Path, name: str) -> None:
    """A hand grabs the object where it rests, lifts it, and lets go while it moves sideways."""
    x, y, z = poses_of(rest)[name][-1][:3]
    above = [x, y + LIFT_M, z]
    acts = [
        {"t": 0.0, "do": "hand", "position": [x, y, z]},
        {"t": 0.1, "do": "grab"},
        {"t": 0.2, "do": "hand", "position": [x, y, z]},
        {"t": 0.7, "do": "hand", "position": above},
        {"t": 0.7 + THROW_S, "do": "hand", "position": [x + LIFT_M, y + LIFT_M, z]},
        {"t": 0.7 + THROW_S, "do": "release"},
    ]
    script.write_text("".join(json.dumps(act) + "\n" for act in acts))


def distance(one: list[float], other: list[float]) -> float:
    return sum((a - b) ** 2 for a, b in zip(one[:3], other[:3], strict=True)) ** 0.5


def result_of(stage: str, made: Path, said: str) -> str:
    """What came out, in words."""
    if stage == "poses":
        found = json.loads(made.read_text())
        return f"{found['placed']} of {found['photos']} photos, {found['error_px']:.2f} px"
    if stage in ("rest", "throw"):
        moved = {who: distance(each[0], each[-1]) for who, each in poses_of(made).items()}
        return "; ".join(f"{who} moved {1e3 * far:.1f}" for who, far in moved.items())
    lines = [line.split(": ", 1)[-1] for line in said.splitlines() if ": " in line]
    if stage == "train":
        return next(line for line in lines[::-1] if line.startswith("done"))
    return " ".join(
        line for line in said.splitlines() if " IoU " in line or "background behind" in line
        or "copied" in line
    )  # fmt: skip


def measure(name: str, case: Case, data: Path, work: Path, rows: csv.DictWriter) -> None:
    for stage, made, words in stages(name, case, data, work):
        if stage == "throw":
            first = next(iter(case.objects))
            write_throw(work / f"{name}_rest" / "run.jsonl", work / f"{name}.jsonl", first)
        seconds, said = start(words)
        result = result_of(stage, made, said)
        row = {"capture": name, "stage": stage, "cpu_s": f"{seconds:.1f}", "result": result}
        rows.writerow(row)
        sys.stderr.write(f"{name}: {stage}, {seconds:.1f} s: {result}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=list(CASES))
    options = parser.parse_args()
    from shapeshift.app.measure import processor

    options.work.mkdir(parents=True, exist_ok=True)
    with options.out.open("w", newline="") as file:
        words = ["DATA" if word == str(options.data) else word for word in sys.argv[1:]]
        file.write(f"# python3 tools/decomposition/from_photos.py {shlex.join(words)}\n")
        file.write(f"# {processor()}, {os.cpu_count()} cores; objects move in thousandths of the ")
        file.write("median distance from which photos were taken\n")
        rows = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        rows.writeheader()
        for name in options.only:
            measure(name, CASES[name], options.data, options.work, rows)
            file.flush()


if __name__ == "__main__":
    main()
