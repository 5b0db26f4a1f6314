"""Is the background's body where the place is?  Cameras inside of it, sight lines blocked, floor.

    python tools/decomposition/background.py --out docs/bench/background.csv NAME=SCENE=CAPTURE ...

SCENE is what `segment` wrote, CAPTURE its folder of photos; given twice, of two builds, they are
compared.  Depth and objects are those of CAPTURE/truth where there is one (tools/synthetic/
everyday.py), else the model's.  "cameras inside": winding number of the body about each camera.
"sight lines blocked": of the rays of pixels that show an object, those which meet the body by more
than 1 % of the way before it; a camera is blocked where half of its are.  "floor off": of pixels of
background that lie level with what carries the objects, how far from there the ray meets the body,
as a part of its length, the median.  Megabytes and seconds are those of `simulate SCENE --seconds
1` in a process of its own, children with it, without kept colliders.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from shapeshift.decomposition.completion.plane import fit_plane  # noqa: E402
from shapeshift.decomposition.completion.verify import ModelPictures  # noqa: E402
from shapeshift.rasterizer.device import open_device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.runtime_models.parts import splat_labels  # noqa: E402
from shapeshift.runtime_models.read_scene import read_model  # noqa: E402
from shapeshift.scene.captures.read_capture import read_capture  # noqa: E402
from shapeshift.scene.colliders.carve import SeenDepth  # noqa: E402
from shapeshift.scene.colliders.collider import Making, collider_of_mesh  # noqa: E402
from shapeshift.scene.colliders.triangle_mesh import TriangleMesh  # noqa: E402
from shapeshift.scene.document.read_scene_file import read_scene_file  # noqa: E402
from shapeshift.scene.pose import Pose, View  # noqa: E402
from shapeshift.scene.world.physics import Physics  # noqa: E402

FIELDS = (
    "scene,corners,cameras,cameras_inside,sight_lines,blocked_percent,cameras_blocked,"
    "floor_rays,floor_off_percent,floor_within_1_percent,simulate_mb,simulate_s"
)
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
    """What CAPTURE/truth says of a photo, at the pixels of its view; else the model's word."""

    depth_m: np.ndarray  # (H, W) along the view, the capture's units
    objects: np.ndarray  # (H, W) bool
    known: bool


def truth_of(capture: Path, photo: Path, view: View, drawn: tuple) -> Truth:
    """From truth/depth (16 bits) and truth/labels beside truth.json, of the photo's name."""
    told = capture / "truth" / "truth.json"
    if not told.is_file():
        return Truth(drawn[0], drawn[1] > 0.9, False)
    facts, (width, height) = json.loads(told.read_text()), view.size
    step = facts["depth_m_a_step"] / facts["metres_a_unit"]
    pictures = []
    for kind in ("depth", "labels"):
        with Image.open(capture / "truth" / kind / f"{photo.stem}.png") as image:
            whole = np.asarray(image).astype(np.float32)
        rows, columns = ((np.arange(n) + 0.5) * (side / n) for n, side in
                         zip((height, width), whole.shape, strict=True))  # fmt: skip
        pictures.append(whole[np.ix_(rows.astype(int), columns.astype(int))])
    return Truth(np.where(pictures[0] > 0, pictures[0] * step, np.inf), pictures[1] > 0, True)


def figures(scene: Path, folder: Path) -> list[str]:
    """The row of one scene, without its name."""
    file, capture = read_scene_file(scene), read_capture(folder)
    assert file.background is not None and file.background.collider, "segment names one"
    mesh = collider_of_mesh(file.path(file.background.collider), Making(hollow=True)).mesh
    model = read_model(file.path(file.background.model))
    assert isinstance(model, AnchorModel), "of a trained scene"
    pictures, x, objects = ModelPictures(open_device(), model), model.stops[0].x, None
    objects = splat_labels(model) != 0
    photos, body = capture.photos[:: -(-len(capture.photos) // MOST)], Body(mesh)
    views, truths, inside = [], [], 0
    for photo in photos:
        view = photo.view.divided(max(-(-max(photo.view.size) // 160), 1))
        truth = truth_of(folder, photo.path, view, pictures.depth(view, x, objects))
        views.append(SeenDepth(view, truth.depth_m.astype(np.float32)))
        truths.append(truth)
        inside += winding(mesh, view.world_from_eye.position) > 0.5
    around = np.concatenate([one.points[t.objects] for one, t in zip(views, truths, strict=True)])
    low, high = np.nanpercentile(around, (1, 99), axis=0)
    size = np.linalg.norm(high - low)
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
    ]  # fmt: skip


def simulated(scene: Path, root: Path) -> list[str]:
    """Megabytes and seconds of both processors of `simulate`, by the program in `root`."""
    with tempfile.TemporaryDirectory() as out:
        program = [sys.executable, "-P", str(root / "shapeshift/__main__.py")]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [*program, "simulate", str(scene), "--seconds", "1", "--out", out], check=True,
            env=os.environ | {"XDG_CACHE_HOME": out}, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [f"{after.ru_maxrss / 1024:.0f}", f"{seconds:.1f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", metavar="NAME=SCENE=CAPTURE")
    parser.add_argument("--root", type=Path, default=ROOT, help="the build that simulates")
    parser.add_argument("--out", type=Path, help="the table; without, it is printed alone")
    options = parser.parse_args()
    rows = []
    for text in options.scenes:
        name, scene, capture = text.split("=")
        found = figures(Path(scene), Path(capture))
        rows.append(",".join([name, *found, *simulated(Path(scene), options.root)]))
        sys.stdout.write(rows[-1] + "\n")
        sys.stdout.flush()
    if options.out:
        head = f"# python tools/decomposition/background.py --out {options.out} NAME=SCENE=CAPTURE"
        options.out.write_text("\n".join([head, FIELDS, *rows]) + "\n")


if __name__ == "__main__":
    main()
