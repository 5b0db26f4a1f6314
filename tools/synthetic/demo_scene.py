"""The bundled demo as a scene of things: its mug and its wrench cut out by `segment`.

    python3 -m tools.synthetic.demo_scene assets/workshop.shift --out assets

photographs the bench anew (minutes; or takes the photos that an earlier run has left in --capture),
writes the true label maps of mug and wrench, and cuts the package by the command that everybody
has.  Written are demo.scene.json, the labelled and completed demo.shift, the folder demo.colliders
and demo.jsonl, a hand that throws both.
"""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.app.cli import main as launch
from shapeshift.decomposition.partition import LabelledView, gather_evidence
from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.files.whole_file import make_folders, write_whole
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.colliders.collider_files import BACKGROUND_FACES
from shapeshift.scene.colliders.collider_pieces import write_collider
from shapeshift.scene.colliders.collider_wrap import simplify
from shapeshift.scene.colliders.read_mesh import read_mesh
from shapeshift.training.synthetic.workshop import STOPS, dome, make_workshop
from tools.synthetic.labels import LABELS, label_map

NAME = "demo"  # of the scene file, the labelled package and the folder of bodies
THINGS = {"mug": ("mug", 0.35), "wrench": ("spanner", 0.25)}  # the tracer's name; kilograms
VIEWS, HELD_OUT = 24, 1  # photos a stop
SIZE = (384, 288)  # of them, pixels
MOST_SEEN = 0.15  # of what a copied anchor shows where the thing is away
FLOOR_Y = -0.7  # metres: what is thrown off the bench comes to rest
SCRIPT = """# Takes the mug, lifts it, throws it at the wrench.
{"t": 0.0, "do": "hand", "position": [-0.13, 0.15, 0.22]}
{"t": 0.3, "do": "hand", "position": [-0.13, 0.05, 0.22]}
{"t": 0.4, "do": "grab"}
{"t": 0.5, "do": "hand", "position": [-0.13, 0.05, 0.22]}
{"t": 1.0, "do": "hand", "position": [-0.15, 0.22, 0.3]}
{"t": 1.3, "do": "hand", "position": [-0.15, 0.22, 0.3]}
{"t": 1.55, "do": "hand", "position": [0.1, 0.25, 0.29]}
{"t": 1.55, "do": "release"}
"""


def write_labels(capture: Path, folder: Path) -> None:
    """A label map for each photo, called as it: 0 the background, then THINGS."""
    x_of = {stop.name: stop.x for stop in STOPS}
    for photo in read_capture(capture).photos:
        found = label_map(photo.view, x_of[photo.modality])
        labels = 0 * found
        for number, (name, _) in enumerate(THINGS.values(), 1):
            labels[found == LABELS[name]] = number
        path = folder / photo.path.relative_to(capture)
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(labels).save(path)


def write_objects(path: Path) -> None:
    rows = [
        {"label": number, "name": name, "mass_kg": mass}
        for number, (name, (_, mass)) in enumerate(THINGS.items(), 1)
    ]
    path.write_text(json.dumps({"format": "shapeshift-objects 1", "objects": rows}))


def cut_things(package: Path, capture: Path, work: Path) -> Path:
    """The scene file that `segment` writes below the folder `work`, with all that it names."""
    labels, objects, out = work / "labels", work / "objects.json", work / f"cut/{NAME}.scene.json"
    write_labels(capture, labels)
    write_objects(objects)
    words = [str(package), str(capture), "--masks", str(labels), "--objects", str(objects)]
    if launch(["segment", *words, "--out", str(out), "--report", str(work / "report")]):
        raise SystemExit(1)
    rows = json.loads(out.read_text()) | {"floor_y": FLOOR_Y}
    write_whole(out, (json.dumps(rows, indent=1) + "\n").encode())
    return out


def without_seen_copies(model: AnchorModel, before: AnchorModel) -> AnchorModel:
    """Leaves out copies of which MOST_SEEN shows while the things stand: with them the demo would
    not look as it was trained, around what casts a shadow on its own edge.
    """
    old = {row.tobytes() for row in before.anchors}
    copied = np.array([row.tobytes() not in old for row in model.anchors])
    device, plain = open_device("cpu"), replace(model, labels=None, objects=())
    nothing = np.zeros(SIZE[::-1], np.uint8)
    views = [LabelledView(view, 0.0, nothing) for view in dome(2 * VIEWS, 0.0, SIZE)]
    seen, alone = gather_evidence(device, plain, views, 1)[:, 0], np.zeros(len(copied))
    left = np.flatnonzero(model.labels == 0)
    alone[left] = gather_evidence(device, plain.with_anchors(left), views, 1)[:, 0]
    return model.with_anchors(~copied | (seen < MOST_SEEN * alone))


def lighten(scene: Path, before: AnchorModel) -> None:
    """What is shipped looks as it did and is small: features of copied anchors are halves, as all
    others are, and the ground has as many faces as `colliders` gives it.
    """
    package = scene.with_name(f"{NAME}.shift")
    ground = scene.with_name(f"{NAME}.colliders") / "background.glb"
    write_package(without_seen_copies(read_package(package), before), package)
    write_collider((), simplify(read_mesh(ground), BACKGROUND_FACES), ground)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("package", type=Path)
    parser.add_argument("--capture", type=Path, default=Path("out/demo_photos"))
    parser.add_argument("--out", type=Path, required=True, help="folder")
    asked = parser.parse_args()
    capture = asked.capture.absolute()
    if not (capture / "transforms.json").is_file():
        make_workshop(capture, SIZE, VIEWS, HELD_OUT)
    with tempfile.TemporaryDirectory() as folder:
        scene = cut_things(asked.package, capture, Path(folder))
        lighten(scene, read_package(asked.package))
        for path in sorted(scene.parent.rglob("*")):
            if path.is_file():
                below = path.relative_to(scene.parent)
                make_folders(asked.out, below.parent)
                write_whole(asked.out / below, path.read_bytes())
    write_whole(asked.out / f"{NAME}.jsonl", SCRIPT.encode())


if __name__ == "__main__":
    main()
