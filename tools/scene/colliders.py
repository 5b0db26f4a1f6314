"""How colliders of captures turn out: pieces, seconds, how well they cover the splats.

    python tools/scene/colliders.py --out docs/bench/colliders.csv FILE ...
    python tools/scene/colliders.py --rough --out docs/bench/rough_colliders.csv FILE ...

Seconds are those of both processors together: the wrap in this process, CoACD in one of its own.
Of the splats at least half opaque, "outside" are those whose centre is farther from every hull
than 2 % of the object's longest side; "hulls over mesh" is the volume of all pieces, those that
overlap counted twice, over that of the watertight mesh: what is added between leaves and legs.
--rough: of the hull that stands in until the pieces are made, the least of three runs; with the
look into the cache that it begins with.
"""

import argparse
import csv
import resource
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.runtime_models.evaluate import Evaluator  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.colliders.collider import Collider, Making, collider_of_splats, parts_volume  # noqa: E402
from shapeshift.scene.colliders.collider_wrap import (  # noqa: E402
    is_watertight,
    volume,
)

FIELDS = (
    "capture", "splats", "hulls", "faces", "watertight", "wrap_s", "pieces_s", "outside_percent",
    "hulls_over_mesh",
)  # fmt: skip
ROUGH_FIELDS = ("capture", "splats", "rough_s", "outside_percent")
NEAR = 0.02  # of the longest side


def cpu_s() -> tuple[float, float]:
    """Seconds of this process, and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), children.ru_utime + children.ru_stime


def outside_percent(made: Collider, means: np.ndarray) -> float:
    """Of centres (N, 3): how many are farther from every hull than NEAR."""
    from scipy.spatial import ConvexHull

    least = np.full(len(means), np.inf)
    for hull in made.parts:
        planes = ConvexHull(hull.astype(np.float64)).equations  # (F, 4), outward
        away = (means @ planes[:, :3].T + planes[:, 3]).max(1)
        least = np.minimum(least, away)
    longest = np.ptp(made.mesh.vertices, axis=0).max()
    return 100 * float((least > NEAR * longest).mean())


def measure(path: Path) -> tuple:
    columns = Evaluator(read_model(path)).geometry(0.0, eye=None)
    own, children = cpu_s()
    made = collider_of_splats(*columns, Making(kept=False))
    after, after_children = cpu_s()
    known = np.isfinite(columns[0]).all(1) & (columns[3] >= 0.5)
    mesh = made.mesh
    over = parts_volume(made) / volume(mesh.vertices, mesh.faces)
    return (
        path.stem.split(".")[0], len(columns[0]), len(made.parts), len(mesh.faces),
        "yes" if is_watertight(mesh.faces) else "NO", f"{after - own:.1f}",
        f"{after_children - children:.1f}", f"{outside_percent(made, columns[0][known]):.2f}",
        f"{over:.2f}",
    )  # fmt: skip


def measure_rough(path: Path) -> tuple:
    columns = Evaluator(read_model(path)).geometry(0.0, eye=None)
    times, made = [], None
    for _ in range(3):
        began = time.process_time()
        made = collider_of_splats(*columns, Making(rough=True))
        times.append(time.process_time() - began)
    assert made is not None and made.rough, "its pieces are in the user's cache; empty it"
    known = np.isfinite(columns[0]).all(1) & (columns[3] >= 0.5)
    outside = f"{outside_percent(made, columns[0][known]):.2f}"
    return path.stem.split(".")[0], len(columns[0]), f"{min(times):.3f}", outside


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("files", nargs="+", type=Path, metavar="FILE")
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options.add_argument("--rough", action="store_true", help="of rough hulls alone")
    chosen = options.parse_args()
    rows = []
    for path in chosen.files:
        rows.append(measure_rough(path) if chosen.rough else measure(path))
        sys.stdout.write("  ".join(map(str, rows[-1])) + "\n")
        sys.stdout.flush()
    if chosen.out:
        with chosen.out.open("w", newline="") as file:
            rough = "--rough " if chosen.rough else ""
            what = f"CoACD {version('coacd')}, 2,500 faces and 16 hulls at most"
            file.write(
                f"# python tools/scene/colliders.py {rough}--out {chosen.out} FILE ...\n"
                f"# {'processor seconds' if rough else what}\n"
            )
            fields = ROUGH_FIELDS if rough else FIELDS
            csv.writer(file, lineterminator="\n").writerows([fields, *rows])


if __name__ == "__main__":
    main()
