"""Four captures like those that people bring, with a truth: depth, labels, what was hidden, up.

    python3 -m tools.synthetic.everyday FOLDER turntable room forward dome
    python3 -m tools.synthetic.everyday FOLDER room --without mug --size 160x120 --count 40

Each writes FOLDER/NAME: photos and poses in the form of a program that people use, in a world that
is not upright and not in metres; objects.json with a box for each thing in one photo; labels/ with
maps of ten photos; and truth/, which no command looks into (truth.json says what lies there).
"""

import argparse
import json
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.whole_file import make_folders, whole_file, write_whole
from shapeshift.scene.pose import Pose, View
from shapeshift.training.synthetic.placing import turned
from shapeshift.training.synthetic.tracer import (
    Hits,
    Pattern,
    Place,
    color_of,
    look,
    photograph,
    shade,
    surface_points,
)
from tools.synthetic.everyday_places import KINDS, LIGHT, TABLE_M, Kind, grain
from tools.synthetic.strangers import Z_UP, frame_of, still_wall

FLIP_YZ = np.diag([1.0, -1, -1])  # OpenGL's camera axes to OpenCV's
EXPOSURE, GRAIN = 0.05, 0.006  # share by which photos are brighter or darker; noise, of 0 to 1
DEPTH_STEP_M = 0.00025  # metres a step of depth pictures, along the view; 0: nothing near
MAPS, HIDDEN = 10, 8  # photos with label maps; photos of the place without its things


def file_from_ours(kind: Kind, first: View) -> np.ndarray:
    """(3, 3) the turn of the world in which the poses are written; lengths aside."""
    if kind.world == "colmap":
        return FLIP_YZ @ first.world_from_eye.matrix()[:3, :3].T
    axes = Z_UP[:3, :3] if kind.world == "+Z" else np.eye(3)
    return axes @ turned("x", kind.tilt_degrees)


def photo_of(
    kind: Kind, place: Place, view: View, wall: Pattern | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(H, W, 3) float32 display sRGB; which solid each pixel's centre shows (H, W), -1: none; and
    metres along the view to it (H, W), 0: none.
    """
    first: list[Hits] = []  # of the pixels' centres, which are traced before finer samples

    def seen(o: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = look(place, o, d)
        if not first:
            along = -d @ view.world_from_eye.matrix()[:3, 2]
            first.append(replace(hits, distance=np.where(hits.index < 0, 0, hits.distance) * along))
        color, missed = shade(place, hits, d, LIGHT), hits.index < 0
        color[missed] = wall(d[missed]) if wall else kind.sky
        return color, hits.index

    photo = photograph(view, seen)[0]
    shape = view.size[::-1]
    return photo, first[0].index.reshape(shape), first[0].distance.reshape(shape)


def save(path: Path, pixels: np.ndarray) -> None:
    with whole_file(path) as file:
        how = {"format": "PNG"} if path.suffix == ".png" else {"format": "JPEG", "quality": 92}
        Image.fromarray(pixels).save(file, **how)


def bytes_of(image: np.ndarray) -> np.ndarray:
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)


def make_one(job: tuple[Path, str, tuple[str, ...], View, int, bool]) -> np.ndarray:
    """Writes a photo with its depth and labels, and gives the labels back."""
    folder, name, without, view, i, hidden = job
    kind = KINDS[name]
    rng = np.random.default_rng([i, 77])
    place, of_solid, empty = photographed(name, without)
    wall = None
    if kind.sky is None:
        wall = still_wall(view, grain((0.42, 0.44, 0.47), (0.6, 0.61, 0.62), 3))
    photo, index, metres = photo_of(kind, place, view, wall)
    photo = photo * (1 + EXPOSURE * rng.uniform(-1, 1)) + GRAIN * rng.normal(size=photo.shape)
    save(folder / f"images/{i:03}.jpg", bytes_of(photo))
    steps = np.where(metres < 65535 * DEPTH_STEP_M, np.rint(metres / DEPTH_STEP_M), 0)
    save(folder / f"truth/depth/{i:03}.png", steps.astype(np.uint16))
    labels = np.where(index >= 0, of_solid[index], 0).astype(np.uint8)
    save(folder / f"truth/labels/{i:03}.png", labels)
    if hidden:
        save(folder / f"truth/hidden/{i:03}.png", bytes_of(photo_of(kind, empty, view, wall)[0]))
    return labels


def photographed(name: str, without: tuple[str, ...]) -> tuple[Place, np.ndarray, Place]:
    """What stands there, the label of each solid, and the same place without its things."""
    kind = KINDS[name]
    things, around = kind.things(), kind.around(np.random.default_rng(list(KINDS).index(name)))
    solids, labels = list(around), [0] * len(around)
    for label, (thing, its) in enumerate(things.items(), 1):
        if thing not in without:
            solids += its
            labels += [label] * len(its)
    return Place.of(solids), np.array(labels, np.uint8), Place.of(around)


def write_colmap(folder: Path, views: list[View], turn: np.ndarray, kind: Kind, xyz, rgb) -> None:
    """sparse/0/*.txt as COLMAP writes them, without which photo saw which point."""
    _, fx, fy, cx, cy = views[0].pinhole()
    w, h = views[0].size
    cameras = f"# Camera list\n1 PINHOLE {w} {h} {fx!r} {fy!r} {cx!r} {cy!r}\n"
    rows = ["# Image list with two lines of data per image"]
    for i, view in enumerate(views):
        turned_back = FLIP_YZ @ view.world_from_eye.matrix()[:3, :3].T @ turn.T
        there = np.eye(4)
        there[:3, :3] = turned_back
        there[:3, 3] = -turned_back @ turn @ view.world_from_eye.position / kind.unit_m
        q, t = Pose.from_matrix(there).wxyz, there[:3, 3]
        words = " ".join(f"{float(v)!r}" for v in (*q, *t))
        rows += [f"{i + 1} {words} 1 {i:03}.jpg", ""]
    points = ["# 3D point list"] + [
        f"{i} {' '.join(f'{v:.6g}' for v in p)} {' '.join(map(str, c))} 0.5"
        for i, (p, c) in enumerate(zip(xyz, rgb, strict=True), 1)
    ]
    for name, text in (("cameras", cameras), ("images", "\n".join(rows) + "\n"),
                       ("points3D", "\n".join(points) + "\n")):  # fmt: skip
        write_whole(folder / f"sparse/0/{name}.txt", text.encode())


def write_transforms(folder: Path, views: list[View], turn: np.ndarray, kind: Kind) -> None:
    """transforms.json as instant-ngp and nerfstudio write it: no word of up, metres or points."""
    frames = []
    for i, view in enumerate(views):
        frames.append(frame_of(f"images/{i:03}.jpg", view, np.eye(4)))
        pose = np.array(frames[-1]["transform_matrix"])
        pose[:3, :3], pose[:3, 3] = turn @ pose[:3, :3], turn @ pose[:3, 3] / kind.unit_m
        frames[-1]["transform_matrix"] = pose.tolist()
    data = {"camera_model": "OPENCV", "aabb_scale": 4, "frames": frames}
    write_whole(folder / "transforms.json", json.dumps(data, indent=1).encode())


def write_prompts(folder: Path, names: list[str], labels: list[np.ndarray]) -> None:
    """objects.json with a box a thing, all in the photo that shows the least seen of them best."""
    pixels = np.array([np.bincount(m.ravel(), minlength=len(names) + 1)[1:] for m in labels])
    seen = pixels.max(axis=0) > 0
    best = int((pixels[:, seen] / pixels[:, seen].max(axis=0)).min(axis=1).argmax())
    rows = []
    for label, name in enumerate(names, 1):
        y, x = np.nonzero(labels[best] == label)
        if len(x):
            sides = [int(v) for v in (x.min(), y.min(), x.max() + 1, y.max() + 1)]
            prompt = {"photo": f"images/{best:03}.jpg", "box": sides}
            rows.append({"label": label, "name": name, "prompts": [prompt]})
    data = {"format": "shapeshift-objects 1", "objects": rows}
    write_whole(folder / "objects.json", json.dumps(data, indent=1).encode())
    for i in np.unique(np.linspace(0, len(labels) - 1, MAPS).round().astype(int)):
        save(folder / f"labels/{i:03}.png", labels[i])


def make_everyday(
    folder: Path,
    name: str,
    without: tuple[str, ...] = (),
    size: tuple[int, int] = (320, 240),
    count: int | None = None,
    processes: int = 1,
) -> dict:
    """Writes the capture of a kind into `folder` without some of its things; gives truth.json."""
    kind = KINDS[name]
    views = kind.views(kind.count if count is None else count, size)
    for part in ("images", "labels", "truth/depth", "truth/labels", "truth/hidden"):
        make_folders(folder, part)
    hidden = set(np.linspace(0, len(views) - 1, HIDDEN).round().astype(int).tolist())
    jobs = [(folder, name, without, v, i, i in hidden) for i, v in enumerate(views)]
    if processes > 1:
        with get_context("spawn").Pool(processes) as pool:
            labels = pool.map(make_one, jobs, chunksize=1)
    else:
        labels = [make_one(job) for job in jobs]
    turn = file_from_ours(kind, views[0])
    if kind.world == "colmap":
        make_folders(folder, "sparse/0")
        place = photographed(name, without)[0]
        xyz, solids = surface_points(place, views, 4000, 0.002)
        rgb = bytes_of(color_of(place, xyz, solids))
        write_colmap(folder, views, turn, kind, xyz @ turn.T / kind.unit_m, rgb)
    else:
        write_transforms(folder, views, turn, kind)
    names = list(kind.things())
    write_prompts(folder, names, labels)
    high = TABLE_M if name in ("room", "forward") else 0.0
    truth = {
        "kind": name,
        "without": list(without),
        "up": (turn @ (0, 1, 0)).tolist(),  # of the file's world
        "metres_a_unit": kind.unit_m,
        "plane_point": (turn @ (0, high, 0) / kind.unit_m).tolist(),  # of what the things stand on
        "labels": {thing: i for i, thing in enumerate(names, 1)},
        "depth_m_a_step": DEPTH_STEP_M,
        "world_from_ours": turn.tolist(),  # of +Y up, whose origin is the file's
    }
    write_whole(folder / "truth/truth.json", json.dumps(truth, indent=1).encode())
    return truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="+", choices=list(KINDS))
    parser.add_argument("--without", nargs="*", default=[])
    parser.add_argument("--size", default="320x240", help="WIDTHxHEIGHT in pixels")
    parser.add_argument("--count", type=int, help="photos; default: as many as the kind has")
    parser.add_argument("--processes", type=int, default=1)
    asked = parser.parse_args()
    width, height = map(int, asked.size.split("x"))
    for name in asked.names:
        folder = asked.folder / "-".join([name, *asked.without])
        make_everyday(folder, name, tuple(asked.without), (width, height), asked.count,
                      asked.processes)  # fmt: skip


if __name__ == "__main__":
    main()
