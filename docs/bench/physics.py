"""What a frame (a step of 1/90 s) of the physics costs, for 5, 20 and 100 objects of 8 hulls each.

    python docs/bench/physics.py --out docs/bench/physics.csv

Objects fall in layers onto a table, collide, roll and settle for 4 s.  CPU ms are those of this
process, so that other load does not count in full; over_free is the cost over that of as many
objects of one hull each in the same run: a ratio that holds on other machines too.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from physics_things import at, box, cup, lowest  # noqa: E402

from scene.physics import Physics  # noqa: E402

COUNTS = (5, 20, 100)
LIMITS = {5: 0.5, 20: 1.0, 100: 8.0}  # ms, mean
SECONDS = 4
COLUMNS = "objects,hulls,cpu_ms_mean,cpu_ms_p95,limit_mean,over_one_hull,contacts_a_step,rest_mm"


def drop(count: int, hulls: list[np.ndarray]) -> tuple[np.ndarray, float, float]:
    """CPU ms of every step (n,), contacts a step, and how deep the deepest rests in mm."""
    physics = Physics()
    physics.add_static([box(1, 0.15, 1)], at(0, -0.15, 0))
    rng, side = np.random.default_rng(0), int(np.ceil(np.sqrt(min(count, 25))))
    bodies = []
    for i in range(count):
        layer, cell = divmod(i, side * side)
        x, z = ((cell % side, cell // side) - np.array([1, 1]) * (side - 1) / 2) * 0.16
        place = x + rng.normal() * 0.01, 0.1 + 0.17 * layer, z + rng.normal() * 0.01
        bodies.append(physics.add_body(hulls, at(*place), 0.3))
    spent, contacts = [], 0
    for _ in range(SECONDS * 90):
        start = time.process_time()
        contacts += len(physics.step())
        spent.append((time.process_time() - start) * 1e3)
    rest = max(-lowest(physics, body, hulls) for body in bodies) * 1e3
    return np.array(spent), contacts / len(spent), rest


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    told = options.parse_args()
    import rapier3d

    lines = ["# python docs/bench/physics.py --out docs/bench/physics.csv"]
    load = os.getloadavg()[0]
    version = getattr(rapier3d, "__version__", "0.36.1")
    lines += [
        f"# Rapier {version}, 90 Hz, 4 substeps, one thread; load average {load:.1f}",
        COLUMNS,
    ]
    for count in COUNTS:
        one, _, _ = drop(count, [box(0.06, 0.06, 0.06)])
        spent, contacts, rest = drop(count, cup(8))
        lines.append(
            f"{count},8,{spent.mean():.2f},{np.percentile(spent, 95):.2f},{LIMITS[count]},"
            f"{spent.mean() / one.mean():.2f},{contacts:.1f},{rest:.2f}"
        )
        sys.stdout.write(lines[-1] + "\n")
    if told.out:
        told.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
