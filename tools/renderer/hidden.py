"""What a frame of the OpenCL tiles costs where part of a scene is out of view or behind others,
with and without leaving it out, and beside an earlier checkout.

    python tools/renderer/foveation.py LEG_FOLDER --before CHECKOUT --out docs/bench/hidden.csv

Scenes are made of one model: thinned, or jittered copies within its splats, smaller so that they
cover as much; "field" is a square of copies; "building" is a square of rooms of opaque walls with
doors, a copy in each.  Views go around it in steps of 1.1 degrees, close by ("near": a sixth of it
in view), turn in the middle of the field, or walk and turn in a room ("walk").  Each row is one
scene, size and path: processor ms of whole frames (update and draw), medians over the frames after
those in which boxes are made, in turns frame by frame between processes: "now", "in view" (what is
behind others is not left out), "whole" (nothing is left out) and "before".  Ratios are medians of
those of each frame.  splats_hidden and tiles_drawn_again are parts of all.  same_bits: whether all
pictures of now and whole are equal to the bit; db_before: of the last picture to that of the
earlier checkout.
"""

import argparse
import base64
import hashlib
import json
import os
import subprocess
import sys
import time
import zlib
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve()
EYE_DISTANCE = 0.06  # of the distance to the middle of the object
WARM_UP = 8
ROOMS, ROOM = 5, 1.5  # in a row; metres
FRAMES = 12
PARTS = ("left", "hidden", "again")
COLUMNS = (
    "scene,splats,size,eyes,path,now_cpu_ms,in_view_cpu_ms,whole_cpu_ms,before_cpu_ms,"
    "now_over_in_view,now_over_whole,now_over_before,clusters_left_out,splats_hidden,"
    "tiles_drawn_again,same_bits,db_before"
)


@dataclass(frozen=True)
class Case:
    """One row."""

    scene: str  # resampled | field | building | as it is
    splats: int
    size: tuple[int, int]
    eyes: int
    path: str  # orbit | near | within | walk


SMALL, LARGE, UHD, HEADSET = (640, 360), (1280, 720), (3840, 2160), (2064, 2208)
CASES = [
    *(Case("as it is", 0, size, eyes, "orbit") for size in (SMALL, LARGE) for eyes in (1, 2)),
    *(
        Case("resampled", n, size, eyes, "orbit")
        for n in (10_000, 100_000, 366_000)
        for size in (SMALL, LARGE)
        for eyes in (1, 2)
    ),
    Case("resampled", 366_000, UHD, 1, "orbit"),
    Case("resampled", 366_000, HEADSET, 2, "orbit"),
    Case("resampled", 1_000_000, LARGE, 1, "orbit"),
    Case("resampled", 4_000_000, LARGE, 1, "orbit"),
    *(
        Case(scene, n, LARGE, eyes, path)
        for scene, n, path in (
            ("as it is", 0, "near"), ("resampled", 366_000, "near"), ("field", 366_000, "within"),
            ("field", 1_000_000, "within"),
        )
        for eyes in (1, 2)
    ),
    Case("field", 4_000_000, LARGE, 1, "within"),
    *(
        Case("building", n, size, eyes, "walk")
        for n, size, eyes in (
            (100_000, LARGE, 1), (366_000, SMALL, 1), (366_000, LARGE, 1), (366_000, LARGE, 2),
            (366_000, UHD, 1), (1_000_000, LARGE, 1), (1_000_000, LARGE, 2), (4_000_000, LARGE, 1),
        )
    ),
]  # fmt: skip


def made_of(model, case: Case):
    """The scene of a case."""
    import numpy as np

    from shapeshift.runtime_models.model import SplatLayers, Stop
    from shapeshift.runtime_models.rotation import rotation_matrices
    from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order

    if case.scene == "as it is":
        return model
    rng, here, side = np.random.default_rng(1), model.splat_count, ROOMS
    count = case.splats if case.scene == "resampled" else case.splats // side**2
    walls = count // 2 if case.scene == "building" else 0
    count -= walls
    pick = rng.permutation(here)[:count] if count <= here else rng.integers(0, here, count)
    scales, wxyz = model.scales[pick], model.wxyz[pick]
    jitter = rng.normal(size=(count, 3)) * scales * (0.7 if count > here else 0)
    means = model.means[pick] + np.einsum("nij,nj->ni", rotation_matrices(wxyz), jitter)
    arrays = [scales * (here / count) ** 0.5, wxyz, model.opacity[pick], model.sh[pick][:, :1]]
    if case.scene == "building":
        means, arrays = rooms_of(means, arrays, walls)
    if case.scene == "field":
        step = 0.8 * np.ptp(means, axis=0).max()
        places = step * (
            np.stack(np.meshgrid(*[np.arange(side)] * 2), -1).reshape(-1, 2) - side // 2
        )
        offsets = np.column_stack([places[:, 0], np.zeros(side**2), places[:, 1]])
        means = (offsets[:, None] + means).reshape(-1, 3)
        arrays = [np.concatenate([a] * side**2) for a in arrays]
    order = morton_order(means)
    arrays = [np.ascontiguousarray(a[order], np.float32) for a in (means, *arrays)]
    layer = np.zeros(len(order), np.int32)
    return SplatLayers(*arrays, layer=layer, stops=(Stop("all", 1.0),))


def rooms_of(means, arrays: list, walls: int) -> tuple:
    """ROOMS x ROOMS rooms of one metre and a half, each with these splats, scaled to half of it,
    and so many more as walls, floors and ceilings; doors are a fifth of a wall.
    """
    import numpy as np

    rng = np.random.default_rng(2)
    low, high = means.min(axis=0), means.max(axis=0)
    part = 0.5 * ROOM / np.ptp(means, axis=0).max()
    means = (means - (low + high) / 2) * part
    arrays = [arrays[0] * part, *arrays[1:]]
    # Two walls, a floor and a ceiling a room, flat; where a door is nothing stands.
    across, up = rng.uniform(-0.5, 0.5, (2, walls)) * ROOM
    kind = np.arange(walls) % 4
    side, level = np.full(walls, ROOM / 2), np.where(kind == 2, -1, 1) * ROOM / 2
    places = np.where(
        (kind < 2)[:, None],
        np.where(
            (kind == 0)[:, None], np.stack([side, up, across], 1), np.stack([across, up, side], 1)
        ),
        np.stack([across, level, up], 1),
    )
    open_ = (kind < 2) & (np.abs(across) < 0.1 * ROOM) & (up < 0.2 * ROOM)
    places, kind = places[~open_], kind[~open_]
    flat, thin = 1.5 * ROOM / np.sqrt(walls / 4), 0.004 * ROOM
    sigma = np.full((len(places), 3), flat)
    sigma[np.arange(len(places)), np.array([0, 2, 1, 1])[kind]] = thin
    color = 0.4 + 0.3 * rng.normal(size=(len(places), 1, 3))
    wxyz = np.tile([1.0, 0, 0, 0], (len(places), 1))
    made = [sigma, wxyz, np.full(len(places), 0.97), color]
    arrays = [np.concatenate([a, b]) for a, b in zip(arrays, made, strict=True)]
    means = np.concatenate([means, places])
    at = np.stack(np.meshgrid(*[ROOM * (np.arange(ROOMS) - ROOMS // 2)] * 2), -1).reshape(-1, 2)
    offsets = np.column_stack([at[:, 0], np.zeros(len(at)), at[:, 1]])
    means = (offsets[:, None] + means).reshape(-1, 3)
    return means, [np.concatenate([a] * len(at)) for a in arrays]


def eyes_of(view, centre) -> list:
    """Two parallel eyes beside that of a view; of an earlier checkout, too, hence the imports."""
    from dataclasses import replace

    import numpy as np

    from shapeshift.scene.pose import Pose

    pose = view.world_from_eye
    right = pose.matrix()[:3, 0] * EYE_DISTANCE * np.linalg.norm(pose.position - centre) / 2
    return [
        replace(view, world_from_eye=Pose(pose.position + s * right, pose.wxyz)) for s in (-1, 1)
    ]


def views_of(model, case: Case) -> list:
    """WARM_UP + FRAMES frames, a list of eyes each."""
    import numpy as np

    from shapeshift.scene.cameras.framing import fit_distance, frame_points, view_from

    centre, radius = frame_points(model.means, model.opacity)
    fov_y, frames = np.radians(45.0), []
    for i in range(WARM_UP + FRAMES):
        turn = np.radians(130 + 1.1 * i)
        side = np.array([np.sin(turn), 0.2, np.cos(turn)])
        away = fit_distance(radius, case.size, fov_y)
        eye, aim = centre + 0.45 * away * side, centre
        if case.path == "near":
            aim = centre + 0.3 * radius * np.array([0, np.sin(0.05 * i), 0])
            eye = aim + 0.18 * away * side
        elif case.path == "within":
            eye = centre + 0.1 * radius * np.array([1, 0.2, 1])
            aim = eye + radius * np.array([np.sin(turn), 0, np.cos(turn)])
        elif case.path == "walk":  # along a diagonal of rooms, past what stands in them
            way = -1.45 * ROOM + 0.01 * ROOM * i
            eye = np.array([way, 0.1 * ROOM, -0.3 * ROOM + 0.003 * ROOM * i])
            aim = eye + np.array([np.cos(turn - 2.6), -0.1, np.sin(turn - 2.6)])
        view = view_from(eye, aim, radius, case.size, fov_y)
        frames.append([view] if case.eyes == 1 else eyes_of(view, centre))
    return frames


def work(leg: Path, tree: Path, leaves_out: bool, hides: bool) -> None:
    """Draws what stdin asks for: a case a line, then "frame" for each frame of it."""
    sys.path[:0] = [str(tree), str(HERE.parent)]
    import numpy as np

    from shapeshift.renderer.renderer import Renderer
    from shapeshift.runtime_models.read_scene import read_model
    from shapeshift.scene.scene import Scene, SceneObject

    model = read_model(leg)
    asked = json.loads(sys.stdin.readline())
    case = Case(**{**asked, "size": tuple(asked["size"])})
    made = made_of(model, case)
    views = views_of(made, case)
    renderer, scene = Renderer(None, "tiles"), Scene((SceneObject("scene", made, x=1.0),))
    culling = getattr(renderer.drawing, "culling", None)
    occlusion = getattr(renderer.drawing, "occlusion", None)
    if culling is not None:
        culling.allowed = leaves_out
    if occlusion is not None:
        occlusion.allowed = hides
    for number, line in enumerate(sys.stdin):
        if line != "frame\n":
            break
        cpu = time.process_time()
        renderer.update(scene)
        stats = renderer.draw(views[number])
        took = 1e3 * (time.process_time() - cpu)
        images = [renderer.image(i) for i in range(case.eyes)]
        # Of what is hidden no later gate was asked.
        counts = [stats.culled[gate] for gate in ("opacity", "distance")]
        digest = hashlib.sha256(repr(counts).encode())
        for image in images:
            digest.update(image.tobytes())
        left = (culling.left_out or 0) / max(1, -(-made.splat_count // 256)) if culling else 0
        told = {"ms": took, "digest": digest.hexdigest(), "left": left, "splats": made.splat_count}
        if occlusion is not None:
            tiles = case.eyes * np.prod([-(-side // 16) for side in case.size])
            told["hidden"] = occlusion.hidden / max(1, made.splat_count)
            told["again"] = float(occlusion.redrawn / tiles)
        if number == WARM_UP + FRAMES - 1:
            packed = zlib.compress(images[0].astype("float16").tobytes(), 1)
            told["picture"] = base64.b64encode(packed).decode()
        sys.stdout.write(json.dumps(told) + "\n")
        sys.stdout.flush()


def measure(leg: Path, case: Case, trees: dict[str, Path]) -> str:
    """A row: the frames of a case, in turns between processes."""
    import numpy as np

    workers = {}
    for name, tree in trees.items():
        words = [sys.executable, str(HERE), str(leg), "--work", str(tree)]
        words += {"whole": ["--whole"], "in view": ["--shown"]}.get(name, [])
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        workers[name] = subprocess.Popen(words, **pipes)
    told: dict[str, list[dict]] = {name: [] for name in workers}
    for worker in workers.values():
        worker.stdin.write(json.dumps(vars(case)) + "\n")
    for number in range(WARM_UP + FRAMES):
        for name in list(workers)[:: 1 if number % 2 else -1]:
            workers[name].stdin.write("frame\n")
            workers[name].stdin.flush()
            told[name].append(json.loads(workers[name].stdout.readline()))
    for worker in workers.values():
        worker.stdin.close()
        worker.wait()
    frames = {n: np.array([t["ms"] for t in told[n][WARM_UP:]]) for n in told}
    ms = {n: float(np.median(each)) for n, each in frames.items()}
    over = {n: f"{np.median(frames['now'] / each):.3f}" for n, each in frames.items()}
    same = all(a["digest"] == b["digest"] for a, b in zip(told["now"], told["whole"], strict=True))
    before, db = ms.get("before"), ""
    if before is not None:
        last = [told[n][-1]["picture"] for n in ("now", "before")]
        a, b = (np.frombuffer(zlib.decompress(base64.b64decode(p)), np.float16) for p in last)
        error = np.mean((a.astype(float) - b) ** 2)
        db = "same" if error == 0 else f"{-10 * np.log10(error):.1f}"
    row = [
        case.scene, told["now"][-1]["splats"], "x".join(map(str, case.size)), case.eyes, case.path,
        *(f"{ms[n]:.2f}" for n in ("now", "in view", "whole")),
        "" if before is None else f"{before:.2f}",
        over["in view"], over["whole"], over.get("before", ""),
        *(f"{np.mean([t[part] for t in told['now'][WARM_UP:]]):.3f}" for part in PARTS),
        "yes" if same else "NO", db,
    ]  # fmt: skip
    return ",".join(map(str, row))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("leg", type=Path, help="folder of PLY layers, joined at x = 1")
    parser.add_argument("--before", type=Path, help="an earlier checkout, drawn in turns")
    parser.add_argument("--out", type=Path, help="CSV file; default: the terminal")
    parser.add_argument("--most", type=int, default=4_000_000, help="splats of the largest scene")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--whole", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--shown", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--only", help="word of the scenes that are drawn, by default all")
    options = parser.parse_args()
    if options.work:
        work(options.leg, options.work, not options.whole, not (options.whole or options.shown))
        return 0
    here = HERE.parents[2]
    sys.path.insert(0, str(here))
    from shapeshift.app.charts.chart_rows import write_lines

    trees = {"now": here, "in view": here, "whole": here}
    if options.before:
        trees["before"] = options.before
    words = f"python tools/renderer/foveation.py {options.leg.name}"
    words += " --before CHECKOUT" if options.before else ""
    words += f" --out {options.out.name}" if options.out else ""
    load = f"load average {os.getloadavg()[0]:.1f} at the start"
    rows = [f"# {words}", f"# OpenCL tiles, {os.cpu_count()} processors; {load}", COLUMNS]
    for case in CASES:
        if case.splats <= options.most and (options.only or "") in case.scene:
            rows.append(measure(options.leg, case, trees))
            sys.stderr.write(rows[-1] + "\n")
    write_lines(options.out, rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
