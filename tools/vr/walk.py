"""A walk of minutes in a headset: python3 tools/vr/walk.py --seconds 600 --out docs/bench/walk.csv

`launch.py vr` on the runtime of the tests (tests/xr/monado.sh), whose head and hands follow a
script: looking about, walking and turning by stick, taking things, carrying them, putting them
back.  Each row is one session: exact, or held in the period by --quality auto.  The runtime's
display has one period, 50 ms; `--eye-part` says how many of its pixels are drawn, so that this
machine needs the budget on the scene and can meet the period with it.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

import shapeshift  # noqa: F401  makes the folders its packages
from shapeshift.app.paths import ASSETS, DEMO
from tests.support.xr.person import Person
from tests.support.xr.walk import walk
from tests.support.xr.xr_stand import Program, Stand, find_runtime, start_program

TOUCH = ASSETS.parent / "examples" / "touch.scene.json"
TIMES = ("own_ms", "wait_ms", "shown_ms")
COLUMNS = [
    "quality", "around", "depth", "eye", "seconds", "frames", "period_ms", "in_time", "dropped",
    *(f"{name[:-3]}_{p}" for name in TIMES for p in ("p50", "p95", "p99", "worst")),
    "target_ms", "exact_ms", "chosen", "scale", "floor_db", "chosen_db", "reached", "taken",
    "rss_minute1_mb", "rss_end_mb", "mb_a_minute",
]  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--seconds", type=float, default=600.0)
    options.add_argument("--around", type=int, default=0, help="copies of the bundled scene")
    options.add_argument("--eye-part", type=float, default=1.0)
    options.add_argument("--floor-db", type=float, default=35.0)
    options.add_argument("--target-ms", type=float, default=0.0, help="of --quality auto")
    options.add_argument("--quality", nargs="+", default=["auto", "best"])
    options.add_argument("--exact-seconds", type=float, default=0.0, help="of --quality best")
    options.add_argument("--depth", action="store_true", help="depth for the compositor, too")
    asked = options.parse_args()
    command = " ".join(["python3 tools/vr/walk.py", *sys.argv[1:]])
    rows = [f"# {command}", ",".join(COLUMNS)]
    for quality in asked.quality:
        row = measure(asked, quality)
        rows.append(",".join(str(row[name]) for name in COLUMNS))
        asked.out.write_text("\n".join(rows) + "\n")  # what is there stays, whatever comes


def measure(asked: argparse.Namespace, quality: str) -> dict:
    """One session of its own; what its report says, and how much memory it held."""
    with tempfile.TemporaryDirectory() as folder:
        stand = Stand(find_runtime(), Path(folder))
        scene = crowded(Path(folder), asked.around)
        words = [str(scene), "--quality", quality, "--eye-part", str(asked.eye_part)]
        if quality == "auto":
            words += ["--floor-db", str(asked.floor_db)]
            words += ["--target-ms", str(asked.target_ms)] if asked.target_ms else []
        words += [] if asked.depth else ["--no-depth"]
        program = start_program(stand, *words)
        try:
            return measured(asked, quality, stand, program)
        finally:
            program.close()
            stand.close()


def crowded(folder: Path, copies: int) -> Path:
    """The things on the table with a ring of the bundled scene's copies around them, which make
    the exact picture slow.
    """
    scene = json.loads(TOUCH.read_text())
    for item in [scene["background"], *scene["objects"]]:
        for name in ("model", "collider"):
            if name in item:
                item[name] = str(TOUCH.parent / item[name])
    for i in range(copies):
        angle = 2 * math.pi * i / copies
        place = [2.5 * math.sin(angle), 0.0, -2.5 * math.cos(angle)]
        row = {"name": f"bench {i}", "model": str(DEMO), "static": True}
        scene["objects"].append(row | {"pose": {"position": place, "wxyz": [1.0, 0.0, 0.0, 0.0]}})
    path = folder / "crowded.scene.json"
    path.write_text(json.dumps(scene))
    return path


def measured(asked: argparse.Namespace, quality: str, stand: Stand, program: Program) -> dict:
    memory: list[tuple[float, float]] = []  # seconds of the session, MB
    with program.headset(stand.port) as remote:
        person = Person(program, remote)
        start = person.until(lambda line: line["focused"], "focused")["seen_s"]
        did = walk(
            person,
            asked.seconds if quality == "auto" else asked.exact_seconds or asked.seconds,
            lambda line: memory.append((line["seen_s"] - start, rss_mb(program.process.pid))),
        )
        program.interrupt()
    report = json.loads((stand.folder / "report.json").read_text())
    settled = memory_after_a_minute(memory)
    row = {
        **report, **did, "around": asked.around,
        "depth": report["depth"] if asked.depth else "none",
        "eye": "x".join(map(str, report["eyes"][0])),
        "seconds": round(memory[-1][0]), "floor_db": asked.floor_db if quality == "auto" else "",
        "target_ms": asked.target_ms if quality == "auto" else "",
        "chosen": f'"{report["chosen"]}"',
        "rss_minute1_mb": round(settled[0, 1]), "rss_end_mb": round(settled[-1, 1]),
        "mb_a_minute": round(slope(settled), 2),
    }  # fmt: skip
    for name in TIMES:
        row |= {f"{name[:-3]}_{p}": report[name][p] for p in report[name]}
    return row


def rss_mb(pid: int) -> float:
    """Memory of a process, in MB, that is really there."""
    rows = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").open())
    return int(rows["VmRSS"].split()[0]) / 1024


def memory_after_a_minute(memory: list[tuple[float, float]]) -> np.ndarray:
    """(n, 2) of seconds and MB: what comes once is there after a minute; all of a shorter walk."""
    whole = np.array(memory)
    later = whole[whole[:, 0] >= 60]
    return later if len(later) > 1 else whole


def slope(memory: np.ndarray) -> float:
    """MB a minute, by least squares; 0 of a single row."""
    if len(memory) < 2:
        return 0.0
    return float(np.polyfit(memory[:, 0] / 60, memory[:, 1], 1)[0])


if __name__ == "__main__":
    main()
