"""Wrong files at every door of the gate: how they end, and the most that one takes.

    python tools/runtime_models/gate.py --count 20000  [--doors mesh USD]

A row a door: mutations of small good files that are made here, how many opened, were refused, were
cut off by a limit; the longest processor time and the largest growth of the process that reads, and
the most of both beyond its budget.  A file beyond that by 2 s or 200 MB, and an error that is no
sentence, end it with 1.  The same numbers make the same files.  Linux.
"""

import argparse
import csv
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from shapeshift.runtime_models.gate import gate  # noqa: E402
from tests.support.hostile.gate_fuzz import MOST_BYTES, MOST_S, Outcome, fuzz  # noqa: E402
from tests.support.hostile.gate_seeds import seeds  # noqa: E402

BATCH = 50  # of a seed at a time, in turns
FIELDS = ("door", "mutations", "opened", "refused", "cut_off", "faults", "longest_s",
          "over_budget_s", "largest_mb", "over_budget_mb")  # fmt: skip


def main() -> int:
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("--count", type=int, default=20_000, help="mutations a door")
    words.add_argument("--seconds", type=float, default=float("inf"), help="for all, at most")
    words.add_argument("--doors", nargs="*", help="these alone")
    words.add_argument("--out", type=Path, help="a CSV file")
    given = words.parse_args()
    end, outcomes = time.monotonic() + given.seconds, {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "made").mkdir()
        held = [seed for seed in seeds(folder / "made")
                if not given.doors or seed.door in given.doors]  # fmt: skip
        start = 0
        while held and time.monotonic() < end:
            for seed in list(held):
                out = outcomes.setdefault(seed.door, Outcome(seed.door))
                if out.mutations >= given.count:
                    held.remove(seed)
                elif time.monotonic() < end:
                    fuzz(seed, folder, min(BATCH, given.count - out.mutations), start, out)
            start += BATCH
    gate.end_all()
    rows = [row_of(out) for out in outcomes.values()]
    for row, out in zip(rows, outcomes.values(), strict=True):
        sys.stdout.write("\n".join([str(row), *out.faults[:5], ""]))
    if given.out:
        with given.out.open("w", newline="") as file:
            file.write(f"# python tools/runtime_models/gate.py --count {given.count}\n")
            writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return any(
        out.faults or out.over_s > MOST_S or out.over_mb * 1e6 > MOST_BYTES
        for out in outcomes.values()
    )


def row_of(out: Outcome) -> dict:
    return {
        "door": out.door, "mutations": out.mutations, "opened": out.opened,
        "refused": out.refused, "cut_off": out.cut_off, "faults": len(out.faults),
        "longest_s": round(out.seconds, 2), "over_budget_s": round(out.over_s, 2),
        "largest_mb": round(out.megabytes, 1), "over_budget_mb": round(out.over_mb, 1),
    }  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main())
