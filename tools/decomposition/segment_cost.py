"""What `segment` by boxes costs beside another build of the program: processor time and memory.

    python tools/decomposition/segment_cost.py BEFORE scene.shift capture objects.json true \
        --out docs/bench/segment_cost.csv

BEFORE is the checkout of an older build (`git worktree add`); any number of scenes follows, four
paths each: the package, its capture, its boxes, true label maps.  Each build runs the whole
command, with completion and colliders, as a process of its own, in turns; of several rounds the
least time counts, and the largest memory.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ("capture", "build", "cpu_s", "of_before", "peak_mb", "peak_of_before", "iou")


def cost(build: Path, scene: Sequence[Path], out: Path) -> tuple[float, float, float]:
    """Seconds of processor time, peak of resident megabytes, mean IoU of one run."""
    package, capture, objects, true = map(str, scene)
    command = [sys.executable, "-P", str(build / "shapeshift/__main__.py"), "segment", package,
               capture, "--objects", objects, "--score", true, "--json", "--overwrite",
               "--out", str(out / "cut.scene.json")]  # fmt: skip
    with open(out / "told.json", "wb") as told, open(out / "said.txt", "wb") as said:
        process = subprocess.Popen(command, stdout=told, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit((out / "said.txt").read_text()[-2000:])
    facts = json.loads((out / "told.json").read_text())
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, facts["miou"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows: list[tuple] = []
    for at in range(0, len(options.scenes), 4):
        scene = options.scenes[at : at + 4]
        best: dict[str, tuple[float, float, float]] = {}
        for _ in range(options.rounds):
            for build, root in (("before", options.before), ("now", ROOT)):
                with tempfile.TemporaryDirectory() as out:
                    found = cost(root, scene, Path(out))
                old = best.get(build, (float("inf"), 0.0, 0.0))
                best[build] = (min(found[0], old[0]), max(found[1], old[1]), found[2])
        for build, (seconds, peak, iou) in best.items():
            rows.append((scene[1].name, build, f"{seconds:.1f}",
                         f"{seconds / best['before'][0]:.2f}", f"{peak:.0f}",
                         f"{peak / best['before'][1]:.2f}", f"{iou:.3f}"))  # fmt: skip
    names = " ".join("/".join(path.parts[-2:]) for path in options.scenes)
    with options.out.open("w", newline="") as file:
        file.write(f"# python tools/decomposition/segment_cost.py BEFORE {names} ")
        file.write(f"--out {options.out}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    for row in rows:
        sys.stdout.write(" ".join(map(str, row)) + "\n")


if __name__ == "__main__":
    main()
