"""Is the background's body where the place is?  Cameras inside of it, sight lines blocked, floor.

    python tools/decomposition/background.py --out FILE --before DIR CAPTURE ...

CAPTURE is a folder of tools/synthetic/everyday.py with NAME.shift trained on it: its label maps cut
the scene, and the body is made of all splats of the background, as it was, and of the rays of
photos.  Depth and objects are those of CAPTURE/truth.  "cameras inside": winding number of the body
about each camera.  "blocked": of the rays of pixels that show an object, those which meet the body
by more than 1 % of the way before it; a camera is blocked where half of its are.  "floor": pixels
of background that lie level with what carries the objects, at most AROUND sizes of all of them
away: how far from there the ray meets the body, as a part of its length, the median, and the share
within 1 %; "missed" is the share of rays that meet nothing.  made_s: processor seconds of the body,
with the pictures of depth.  Megabytes and seconds of `simulate --seconds 1` with that background
alone are of a process of its own: of the build in DIR for the body of all splats, of this one for
the other; empty where the square matrix of that build would have taken more than MOST_GB.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.decomposition.completion.complete import only_background  # noqa: E402
from shapeshift.decomposition.completion.plane import (  # noqa: E402
    Plane,
    fit_plane,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.photo_views import sights_of  # noqa: E402
from shapeshift.decomposition.proxies.ground import (  # noqa: E402
    ground_mesh,
    seen_depths,
    seen_planes,
)
from shapeshift.decomposition.segment_scene import (  # noqa: E402
    named_objects,
    read_pictures,
    segment,
)
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.package.write_package import write_package  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.colliders.carve import SeenDepth  # noqa: E402
from shapeshift.scene.colliders.collider import Making  # noqa: E402
from shapeshift.scene.colliders.collider_pieces import write_collider  # noqa: E402
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh  # noqa: E402
from shapeshift.scene.pose import Pose, View  # noqa: E402
from shapeshift.scene.world.physics import Physics  # noqa: E402

FIELDS = (
    "capture,body,corners,cameras,cameras_inside,sight_lines,blocked_percent,cameras_blocked,"
    "floor_rays,floor_off_percent,floor_within_1_percent,floor_missed_percent,made_s,simulate_mb,"
    "simulate_s"
)
MOST_GB = 6
NEAR = 0.01  # of the way
EVERY = 3  # pixels, along both sides
LEVEL = 0.95  # cosine to the plane that things stand on, of what counts as floor or table
AROUND = 2.0  # sizes of all things together, from their middle, in which that is looked at
MOST = 100  # photos


def winding(mesh: TriangleMesh, point: np.ndarray) -> float:
    """How often the mesh goes around a point (3,): Van Oosterom and Strackee's solid angles."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(np.arctan2(above, below).sum() / (2 * np.pi))


class Body:
    """The background's mesh alone, to shoot rays at."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._physics = Physics()
        self._physics.add_static(mesh, Pose(np.zeros(3), np.array([1.0, 0, 0, 0])))

    def parts(self, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(n,) where on the way from an eye (3,) to points (n, 3) it is met, 1: there; Inf."""
        way = points - eye
        length = np.linalg.norm(way, axis=1)
        hits = [self._physics.cast_ray(eye, w / far) for w, far in zip(way, length, strict=True)]
        return np.array([hit[1] if hit else np.inf for hit in hits]) / length


@dataclass(frozen=True)
class Truth:
    """What CAPTURE/truth says of a photo, at the pixels of its view."""

    depth_m: np.ndarray  # (H, W) along the view, the capture's units
    objects: np.ndarray  # (H, W) bool


def truth_of(capture: Path, photo: Path, view: View) -> Truth:
    """From truth/depth (16 bits) and truth/labels beside truth.json, of the photo's name."""
    facts = json.loads((capture / "truth" / "truth.json").read_text())
    width, height = view.size
    step = facts["depth_m_a_step"] / facts["metres_a_unit"]
    pictures = []
    for kind in ("depth", "labels"):
        with Image.open(capture / "truth" / kind / f"{photo.stem}.png") as image:
            whole = np.asarray(image).astype(np.float32)
        rows, columns = ((np.arange(n) + 0.5) * (side / n) for n, side in
                         zip((height, width), whole.shape, strict=True))  # fmt: skip
        pictures.append(whole[np.ix_(rows.astype(int), columns.astype(int))])
    return Truth(np.where(pictures[0] > 0, pictures[0] * step, np.inf), pictures[1] > 0)


def bodies(folder: Path, out: Path) -> Iterator[tuple[str, TriangleMesh, float]]:
    """(how, the body, processor seconds) of both ways; each as a scene file HOW.scene.json too."""
    device, model = open_device(), read_model(folder / f"{folder.name}.shift")
    assert isinstance(model, AnchorModel), "of a trained scene"
    capture = read_capture(folder)
    pictures = read_pictures(folder / "labels", capture, model, None)
    objects = named_objects(pictures, ())
    model = segment(device, model, pictures, objects, 0, lambda done, count: None).model
    assert isinstance(model, AnchorModel) and model.labels is not None
    write_package(model, out / "cut.shift", "float32")
    looks, x, alone = looks_of(model), model.stops[0].x, only_background(model)
    found = {spec.label: support_plane(looks, model.labels, spec.label) for spec in objects}
    planes = {label: plane for label, plane in found.items() if isinstance(plane, Plane)}
    making = Making(kept=False, hollow=True, faces=10_000)
    for how in ("all splats", "rays of photos"):
        began = time.process_time()
        sights = sights_of(capture, model.stops) if how != "all splats" else []
        seen = seen_depths(device, model, sights, x, making)
        flat = list(seen_planes(planes, seen, looks.spacing_m).values())
        mesh = ground_mesh(alone, looks, model.labels, flat, x, making, (), seen)
        took = time.process_time() - began
        write_collider((), mesh, out / f"{how}.glb")
        background = {"model": "cut.shift", "part": 0, "collider": f"{how}.glb"}
        scene = {"format": "shapeshift-scene 1", "background": background, "objects": []}
        (out / f"{how}.scene.json").write_text(json.dumps(scene))
        yield how, mesh, took


def figures(mesh: TriangleMesh, folder: Path) -> list[str]:
    """The row of one body, without its name."""
    capture = read_capture(folder)
    photos, body = capture.photos[:: -(-len(capture.photos) // MOST)], Body(mesh)
    views, truths, inside = [], [], 0
    for photo in photos:
        view = photo.view.divided(max(-(-max(photo.view.size) // 160), 1))
        truth = truth_of(folder, photo.path, view)
        views.append(SeenDepth(view, truth.depth_m.astype(np.float32)))
        truths.append(truth)
        inside += winding(mesh, view.world_from_eye.position) > 0.5
    around = np.concatenate([one.points[t.objects] for one, t in zip(views, truths, strict=True)])
    low, high = np.nanpercentile(around, (1, 99), axis=0)
    size = float(np.linalg.norm(high - low))
    ground = np.concatenate(
        [one.points[~t.objects][::7] for one, t in zip(views, truths, strict=True)]
    )
    ground = ground[np.linalg.norm(ground - (low + high) / 2, axis=1) < size]
    plane = fit_plane(ground, 0.01 * size)
    assert plane is not None, "things stand on something"
    blocked, floor, cameras_blocked = [], [], 0
    for one, truth in zip(views, truths, strict=True):
        eye = one.view.world_from_eye.position
        chosen = np.zeros(truth.objects.shape, bool)
        chosen[1::EVERY, 1::EVERY] = True
        chosen &= np.isfinite(truth.depth_m) & ~one.edges
        if (shows := chosen & truth.objects).any():
            met = body.parts(eye, one.points[shows]) < 1 - NEAR
            blocked.append(met)
            cameras_blocked += met.mean() > 0.5
        level = np.abs(one.planes[0] @ plane[0].normal) > LEVEL
        near = np.linalg.norm(one.points - (low + high) / 2, axis=2) < AROUND * size
        carries = chosen & ~truth.objects & level & near & (one.planes[1] > 0.1)
        floor.append(np.abs(body.parts(eye, one.points[carries]) - 1))
    lines, away = (np.concatenate([np.zeros(0), *parts]) for parts in (blocked, floor))
    return [
        f"{len(mesh.vertices)}", f"{len(views)}", f"{inside}", f"{len(lines)}",
        f"{100 * lines.mean():.2f}", f"{cameras_blocked}", f"{len(away)}",
        f"{100 * np.median(away):.2f}", f"{100 * (away < NEAR).mean():.1f}",
        f"{100 * np.isinf(away).mean():.1f}",
    ]  # fmt: skip


# A process starts with the peak of the one that forks it: a small one stands between.
MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stderr=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(f"{used.ru_maxrss / 1024:.0f} {used.ru_utime + used.ru_stime:.1f}")
"""


def simulated(scene: Path, root: Path) -> list[str]:
    """Megabytes and processor seconds of `simulate`, by the program in `root`."""
    with tempfile.TemporaryDirectory() as out:
        program = [sys.executable, "-P", str(root / "shapeshift/__main__.py"), "simulate"]
        found = subprocess.run(
            [sys.executable, "-c", MEASURED, *program, str(scene), "--seconds", "1", "--out", out],
            env=os.environ | {"XDG_CACHE_HOME": out}, check=True, capture_output=True, text=True,
        )  # fmt: skip
    return found.stdout.split()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--before", type=Path, default=ROOT, help="a checkout of another build")
    parser.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options = parser.parse_args()
    rows = []
    for capture in options.captures:
        with tempfile.TemporaryDirectory() as out:
            for how, mesh, took in bodies(capture, Path(out)):
                root = options.before if how == "all splats" else ROOT
                fits = root == ROOT or 16 * len(mesh.vertices) ** 2 < MOST_GB << 30
                scene = Path(out, f"{how}.scene.json")
                simulates = simulated(scene, root) if fits else ["", ""]
                cells = [capture.name, how, *figures(mesh, capture), f"{took:.1f}", *simulates]
                rows.append(",".join(cells))
                sys.stdout.write(rows[-1] + "\n")
                sys.stdout.flush()
    if options.out:
        command = f"# python tools/decomposition/background.py --out {options.out} --before DIR"
        options.out.write_text("\n".join([f"{command} CAPTURE ...", FIELDS, *rows]) + "\n")


if __name__ == "__main__":
    main()
