"""Whether planted changes are found between two visits, and none where nothing was planted.

    python tools/inspection/change.py WORK --out docs/bench/change.csv

WORK gets the visits that tools/inspection/visits.py ray-traces (before, after, again: nothing
changed, other photos, another seed), each trained with the usual settings for --seconds of one
core; what is there already is used as it is.  A row a comparison and place: what was planted, the
place that was found for it, how far its middle is beside the planted one, and what is false:
planted "nothing".  "A part of one" is warm in truth, but was found as a place of its own.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import shapeshift as ss  # noqa: E402
from tools.inspection.visits import MUG_MOVED, PLANTED, SIZE, VIEWS, make_visit, true_warming  # noqa: E402

# name: (changed, turn of the cameras, seed of the training)
VISITS = {"before": (False, 0.0, 0), "after": (True, 0.11, 0), "again": (False, 0.23, 1)}
PAIRS = (("before", "after"), ("again", "after"), ("before", "again"))
COLUMNS = (
    "comparison,residual_cm,shared,planted,found,beside_cm,area_cm2,amount,unit,planted_amount"
)
LEAST_C = 5.0  # of the command's default
# Of the planted changes, in their order; heat falls off at grazing angles by up to a fifth.
AMOUNTS = (float(np.linalg.norm(MUG_MOVED)), None, None, 22.0, None, 20.0)


def trained(work: Path, name: str, seconds: float) -> Path:
    """The package of a visit."""
    changed, turn, seed = VISITS[name]
    capture, package = work / name, work / f"{name}.shift"
    if not (capture / "transforms.json").is_file():
        make_visit(capture, changed, turn)
    if not package.is_file():
        words = ["train", str(capture), "--out", str(package), "--seconds", f"{seconds:g}"]
        words += ["--seed", str(seed)]
        subprocess.run([sys.executable, "-P", str(ROOT / "launch.py"), *words], check=True)
    return package


def matched(places: tuple[ss.ChangedPlace, ...]) -> list[tuple[int, int]]:
    """(planted, place) by the nearest of the same kind within reach, each once."""
    found = []
    for i, planted in enumerate(PLANTED):
        for j, place in enumerate(places):
            beside = float(np.linalg.norm(place.centre - planted.place))
            if place.kind == planted.kind and beside <= planted.reach_m:
                found.append((beside, i, j))
    out: list[tuple[int, int]] = []
    for _, i, j in sorted(found):
        if i not in [a for a, _ in out] and j not in [b for _, b in out]:
            out.append((i, j))
    return sorted(out)


def is_piece(place: ss.ChangedPlace) -> bool:
    """Whether a place beside those that were matched is a part of what did get hotter."""
    return place.kind == "hotter" and float(np.median(true_warming(place.points))) >= LEAST_C


def rows_of(first: str, second: str, changed: ss.SceneChange) -> list[str]:
    head = f"{first} to {second}"
    fit = f"{100 * changed.registration.residual_m:.2f},{changed.registration.shared:.2f}"
    pairs = matched(changed.places) if second == "after" else []
    rows = []
    for i, planted in enumerate(PLANTED if second == "after" else ()):
        wanted = "" if AMOUNTS[i] is None else f"{AMOUNTS[i]:.3g}"
        place = next((changed.places[b] for a, b in pairs if a == i), None)
        if place is None:
            rows.append(f"{head},{fit},{planted.kind},no,,,,,{wanted}")
            continue
        beside = 100 * float(np.linalg.norm(place.centre - planted.place))
        rows.append(f"{head},{fit},{planted.kind},yes,{beside:.1f},{1e4 * place.area_m2:.0f},"
                    f"{place.amount:.3f},{place.unit},{wanted}")  # fmt: skip
    for j, place in enumerate(changed.places):
        if j not in [b for _, b in pairs]:
            truth = "a part of one" if second == "after" and is_piece(place) else "nothing"
            rows.append(f"{head},{fit},{truth},{place.kind},,{1e4 * place.area_m2:.0f},"
                        f"{place.amount:.3f},{place.unit},")  # fmt: skip
    return rows or [f"{head},{fit},nothing,none,,,,,"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    packages = {name: trained(options.work, name, options.seconds) for name in VISITS}
    rows = []
    for first, second in PAIRS:
        rows += rows_of(first, second, ss.change(packages[first], packages[second]))
    head = (
        f"# python tools/inspection/change.py WORK --seconds {options.seconds:g} --out change.csv\n"
        f"# {VIEWS} photos of {SIZE[0]}x{SIZE[1]} a stop and visit, ray-traced\n"
    )
    options.out.write_text(head + COLUMNS + "\n" + "\n".join(rows) + "\n")
    sys.stdout.write(options.out.read_text())


if __name__ == "__main__":
    main()
