"""Proxies of things of the demo: silhouettes, distances to the true surface, how still they stand.

    python tools/decomposition/proxies.py --out docs/bench/proxies.csv

Labels come from true label maps of 24 views by evidence; silhouettes are scored in 8 other views.
The true surface is what rays from all sides meet of the tracer's solids.  "moves" and "turns" are
what the body does in 2 s on a floor in the plane that the thing stood on; "again": whether a second
run gives the same bits.  "as before": of all its splats, not cut at the plane.
"""

import argparse
import csv
import math
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "decomposition")]

from completion import HELD_OUT, SIZE, VIEWS  # noqa: E402

from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.assemble import (  # noqa: E402
    candidates_of,
    choose_proxy,
    standing_mesh,
)
from shapeshift.decomposition.completion.plane import (  # noqa: E402
    Plane,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.partition import (  # noqa: E402
    LabelledView,
    gather_evidence,
    partition,
)
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel, ObjectLabel  # noqa: E402
from shapeshift.runtime_models.parts import part_of  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.colliders.collider import Making, collider_of_model  # noqa: E402
from shapeshift.scene.pose import Pose  # noqa: E402
from shapeshift.scene.world.physics import Physics  # noqa: E402
from shapeshift.training.synthetic.workshop import dome, things  # noqa: E402
from tools.decomposition.surface_scores import (  # noqa: E402
    score_surfaces,
    surface_of,
    surface_of_solids,
)
from tools.synthetic.labels import LABELS, OBJECTS, label_map  # noqa: E402

THINGS = ("mug", "can", "spanner", "screwdriver", "motor", "cabinet")
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
SECONDS, HZ = 2, 90
MASS_KG = 0.3
FIELDS = (
    "thing", "proxy", "chosen", "pieces", "corners", "iou", "recall", "chamfer_mm", "f1",
    "hausdorff_mm", "moves_mm", "turns_deg", "again", "cpu_s",
)  # fmt: skip


def true_surface(name: str) -> np.ndarray:
    """(N, 3) metres: where rays from all around first meet the thing alone."""
    solids = [solid for thing, group in things(False) for solid in group if thing == name]
    return surface_of_solids(solids)


def at_rest(parts, at: np.ndarray, floor_y: float) -> tuple[float, float, str]:
    """Millimetres and degrees after SECONDS, and the hash of that world."""
    physics = Physics(floor_y=floor_y, hz=HZ)
    body = physics.add_body(parts, Pose(at, UPRIGHT), MASS_KG)
    for _ in range(SECONDS * HZ):
        physics.step()
    pose = physics.pose(body)
    turn = 2 * math.acos(min(abs(float(pose.wxyz @ UPRIGHT)), 1.0))
    return 1e3 * float(np.linalg.norm(pose.position - at)), math.degrees(turn), physics.hash()


def rows_of(device, names):
    """Rows of the table, one by one."""
    model, views = read_model(DEMO), dome(VIEWS, 0.0, SIZE)
    pictures = [LabelledView(view, 0.0, label_map(view)) for view in views]
    sums = gather_evidence(device, model, pictures, len(LABELS))
    objects = tuple(ObjectLabel(LABELS[name], name) for name in OBJECTS)
    assert isinstance(model, AnchorModel)
    model = partition(model, sums, objects)
    assert isinstance(model, AnchorModel) and model.labels is not None
    looks = looks_of(model)
    tests = [LabelledView(view, 0.0, label_map(view)) for view in dome(HELD_OUT, 0.17, SIZE)]
    for name in names:
        label = LABELS[name]
        part, at = part_of(model, label)
        assert isinstance(part, AnchorModel)
        at = np.array(at)
        plane = support_plane(looks, model.labels, label)
        if isinstance(plane, str):
            raise SystemExit(f"{name}: {plane}")
        here = Plane(plane.normal, plane.offset - float(plane.normal @ at))
        floor_y, making = plane.offset / plane.normal[1], Making(kept=False)
        begun = time.process_time()
        evidence = sums[model.labels == label, label]
        mesh = standing_mesh(part, 0.0, evidence, here, making)
        found = candidates_of(mesh, here, making)
        seconds = time.process_time() - begun
        world_from_part = Pose(at, UPRIGHT).matrix()
        chosen, _ = choose_proxy(found, world_from_part, label, pictures)
        old = {"as before": collider_of_model(part, 0.0, making)}
        _, tested = choose_proxy(found | old, world_from_part, label, tests)
        true = true_surface(name) - at
        for proxy in tested:
            parts, score = proxy.collider.parts, score_surfaces(surface_of(proxy.collider), true)
            moves, turns, bits = at_rest(parts, at, floor_y)
            again = at_rest(parts, at, floor_y)[2] == bits
            yield [
                name, proxy.name, "yes" if proxy.name == chosen.name else "", len(parts),
                proxy.corners, f"{proxy.score.iou:.3f}", f"{proxy.score.recall:.3f}",
                f"{1e3 * score.chamfer_m:.2f}", f"{score.f1:.3f}",
                f"{1e3 * score.hausdorff_m:.1f}", f"{moves:.2f}", f"{turns:.2f}",
                "equal" if again else "OTHER", f"{seconds:.1f}",
            ]  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options.add_argument("--things", nargs="+", default=THINGS, choices=OBJECTS)
    told = options.parse_args()
    rows = []
    for row in rows_of(open_device("cpu"), told.things):
        rows.append(row)
        sys.stdout.write("  ".join(map(str, row)) + "\n")
        sys.stdout.flush()
    if told.out:
        with told.out.open("w", newline="") as file:
            chosen = "" if told.things == THINGS else f"--things {' '.join(told.things)} "
            command = f"tools/decomposition/proxies.py {chosen}--out docs/bench/proxies.csv"
            file.write(f"# python {command}\n")
            file.write("# F1 at 4 mm; silhouettes in 8 views of 384x288; 2 s at 90 Hz\n")
            csv.writer(file, lineterminator="\n").writerows([FIELDS, *rows])


if __name__ == "__main__":
    main()
