"""From a cut to the first fall: seconds until a thing that was cut out of the demo can be thrown.

    python tools/scene/first_fall.py --out docs/bench/first_fall.csv

Seconds are the processor's, of the whole process, with colliders and physics imported and no body
in any cache; the least of several cuts.  "to fall" runs from the cut to the end of the first step
in which the thing moves freely, as the window takes it: rough body, ground at once, world, start.
Then the exact bodies come while the thing is at rest: "inside" is how deep its rough body at rest
would lie in the exact ground, "jumps" how far its middle has moved at most within three seconds.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.app.editor.state.bodies import Bodies  # noqa: E402
from shapeshift.app.editor.state.editor_state import EditorState  # noqa: E402
from shapeshift.app.editor.state.files.open_scene import opened_scene  # noqa: E402
from shapeshift.app.editor.state.files.opened import read_files  # noqa: E402
from shapeshift.app.editor.state.parts.cutting import make_object  # noqa: E402
from shapeshift.app.paths import DEMO  # noqa: E402
from shapeshift.decomposition.masks.anchor_walk import nodes_of  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.cameras.camera_list import CameraReading  # noqa: E402
from shapeshift.scene.colliders.collider import Collider  # noqa: E402
from shapeshift.scene.document.scene_file import BACKGROUND  # noqa: E402
from shapeshift.scene.world.physics import Physics  # noqa: E402
from shapeshift.scene.world.settle import begin, push_apart  # noqa: E402
from tools.synthetic.labels import LABELS, labels_of_places  # noqa: E402

EYE = np.array([0.0, 0.6, 1.8])  # metres: where somebody looks from
THINGS = ("mug", "spanner", "can")
CUTS, HZ = 5, 90
FIELDS = "thing,anchors,to_fall_s,moved_mm,tilted_deg,inside_mm,jumps_mm,exact_s"


class Bench:
    def __init__(self) -> None:
        self.opened = read_files([Path(DEMO)], lambda path, told: read_model(path),
                                 CameraReading(), None)  # fmt: skip
        model = opened_scene(self.opened)[0].objects[0].model
        assert isinstance(model, AnchorModel)
        nodes = nodes_of(model, EYE)
        self.rows, self.count = nodes.rows, len(model.anchors)
        self.true = labels_of_places(nodes.means)[0]

    def cut(self, thing: str) -> tuple[EditorState, int, float]:
        """A state with the thing cut out and falling, its anchors, seconds of that."""
        state = EditorState(read_model)
        scene, edited = opened_scene(self.opened)
        state.open_sources(self.opened.sources, scene, None, edited)
        rows = np.zeros(self.count, bool)
        rows[self.rows[self.true == LABELS[thing]]] = True
        with hearing_later(state.bodies):
            make_object(state, 0, rows, thing)
        began = time.process_time()
        while state.world is None:
            state.bodies.poll(state.edited)
            time.sleep(0.002)
        world = state.world
        begin(world)
        world.paused = False
        world.step()
        return state, int(rows.sum()), time.process_time() - began


@contextmanager
def hearing_later(bodies: Bodies) -> Iterator[None]:
    """The bodies hear of an edit when it is done, so that all they do is counted."""
    bodies.follow = lambda edited: setattr(bodies, "stale", True)
    yield
    del bodies.follow


def inside_mm(world_physics: Physics, thing: Collider, pose, ground: Collider) -> float:
    """How deep a body at a pose lies in a ground."""
    physics = Physics(world_physics.hz)
    physics.add_static(ground.mesh, pose_of_ground(world_physics))
    physics.add_body(thing.parts, pose, 0.3)
    return 1e3 * max((one.depth_m for one in push_apart(physics)[1]), default=0.0)


def pose_of_ground(physics: Physics):
    return next(physics.pose(number) for number in physics.ids() if number not in physics.bodies())


def measure(bench: Bench, thing: str) -> str:
    runs = []
    for _ in range(CUTS):
        state, anchors, spent = bench.cut(thing)
        runs.append(spent)
        if len(runs) < CUTS:
            state.bodies.forget()
    world = state.bodies.living
    start = world.objects[thing].pose
    for _ in range(3 * HZ):
        world.step()
    rough, rest = world.objects[thing].collider, world.objects[thing].pose
    began, most = time.process_time(), 0.0
    while state.bodies.poll(state.edited):
        time.sleep(0.01)
    spent = time.process_time() - began
    ground = world.objects[BACKGROUND].collider
    assert rough is not None and ground is not None, "both have bodies"
    for _ in range(3 * HZ):
        world.step()
        most = max(most, float(np.linalg.norm(world.objects[thing].pose.position - rest.position)))
    moved = float(np.linalg.norm(rest.position - start.position))
    tilted = 2 * np.degrees(np.arccos(min(1.0, abs(float(rest.wxyz @ start.wxyz)))))
    inside = inside_mm(world.physics, rough, rest, ground)
    figures = (min(runs), 1e3 * moved, tilted, inside, 1e3 * most, spent)
    return f"{thing},{anchors}," + ",".join(f"{each:.3f}" for each in figures)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--things", nargs="+", default=THINGS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # no body was made before
        bench = Bench()
        rows = []
        for thing in options.things:
            rows.append(measure(bench, thing))
            sys.stdout.write(rows[-1] + "\n")
            sys.stdout.flush()
    if options.out:
        head = f"# python tools/scene/first_fall.py --out {options.out}"
        options.out.write_text("\n".join([head, FIELDS, *rows]) + "\n")


if __name__ == "__main__":
    main()
