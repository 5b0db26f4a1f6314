"""A process of its own for structure from motion: `python -P colmap_run.py find|write JOB.json
SECONDS BYTES`, of processor time and memory that it may take at most.

pycolmap is C++ that logs to standard error, holds the interpreter for minutes and ends the process
on what it does not like: none of this may happen to the program.  It ends when its standard input
does, as that of a program that was killed.  Progress goes to standard output, a JSON object a line:
how far it is, or which table of the database to watch.  The program counts its rows, as a second
SQLite in this process would let go of the locks of pycolmap's.  The database keeps features and
matches, so that a second run of the same job goes on.

Reads: JOB.json (Job in find_poses.py); `write` also best/ and best.npz of `find`.
Writes: `find` the model with most photos into best/ and its arrays into best.npz; `write` the
model, turned and scaled, into sparse/.
"""

import importlib.util
import json
import os
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np

ABSENT, UNLIMITED = 3, 4  # exit codes: see colmap_child.py
LIMITS = Path(__file__).resolve().parents[2] / "runtime_models" / "gate" / "limits.py"
MOST_ERROR_PX = 8.0  # a mean reprojection error beyond this is no model
# What is tried where fewer than ENOUGH of the photos find their place: the least angle between the
# two photos that a model begins with, the inliers that a photo needs, whether matches are guided
# by the geometry found so far, and which mapper.  COLMAP's own first; each is dearer than the last.
LADDER: tuple[dict[str, Any], ...] = (
    {"said": "as usual", "angle": 16.0, "inliers": 30, "guided": False, "mapper": "incremental"},
    {"said": "smaller angles", "angle": 8.0, "inliers": 20, "guided": False,
     "mapper": "incremental"},
    {"said": "few points", "angle": 4.0, "inliers": 15, "guided": False, "mapper": "incremental"},
    {"said": "guided matches", "angle": 4.0, "inliers": 15, "guided": True,
     "mapper": "incremental"},
    {"said": "all photos at once", "angle": 4.0, "inliers": 15, "guided": True,
     "mapper": "global"},
)  # fmt: skip
ENOUGH = 0.9  # of the photos
# From so many photos on, poses are found by several threads, whose sums differ in the last bits
# from run to run; below, adjustment is short and the same photos give the same bytes.
THREADED = 100
GUIDED = "guided"  # a file in the folder of the work: see clear_others
BLOCK = 8  # photos by photos whose matches are written at once: progress, and what a kill loses


def report(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def find(job: dict) -> None:
    import pycolmap

    work = Path(job["work"])
    database = work / "database.db"
    pycolmap.set_random_seed(0)
    count = sum(len(group) for group in job["groups"])
    report(watch="keypoints", stage="features", of=count)
    extract(pycolmap, database, job)
    guided, best = None, None
    for rung in LADDER:
        if guided is not rung["guided"]:
            guided = rung["guided"]
            report(watch="two_view_geometries", stage="matches", of=job["pairs"])
            clear_others(pycolmap, database, work / GUIDED, guided)
            match(pycolmap, database, job, guided)
        models = solve(pycolmap, database, job, rung, count)
        found = max((rank(model) for model in models), default=(0, 0))
        others = sorted((model.num_reg_images() for model in models), reverse=True)[1:]
        report(attempt=rung["said"], registered=found[0], of=count, others=others)
        if best is None or found > rank(best):
            best = max(models, key=rank, default=best)
        if found[0] >= ENOUGH * count:
            break
    if best is None:
        report(registered=0)
        return
    (work / "best").mkdir(exist_ok=True)
    best.write(str(work / "best"))
    keep_arrays(best, work / "best.npz", job["measured"], job["ends"])
    report(registered=best.num_reg_images())


def rank(model: Any) -> tuple[int, int]:
    """Photos, then points; a model whose points lie far beside their places counts for nothing."""
    if not model.compute_mean_reprojection_error() <= MOST_ERROR_PX:
        return 0, 0
    return model.num_reg_images(), model.num_points3D()


def extract(pycolmap: Any, database: Path, job: dict) -> None:
    """Features of all photos; photos of a group share a camera, also with those done before."""
    options = pycolmap.FeatureExtractionOptions()
    options.max_image_size, options.num_threads = job["side"], job["threads"]
    options.use_gpu, options.sift.max_num_features = False, job["features"]
    for group in job["groups"]:
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = job["lens"]
        if job["masks"]:
            reader.mask_path = job["masks"]
        # First all photos in their order: extraction numbers them as its threads end.
        pycolmap.Database.open(str(database)).close()
        reader.existing_camera_id = camera_of(pycolmap, database, group)
        pycolmap.import_images(database, job["photos"], pycolmap.CameraMode.SINGLE, group, reader)
        reader.existing_camera_id = camera_of(pycolmap, database, group)
        pycolmap.extract_features(
            database, job["photos"], image_names=group, camera_mode=pycolmap.CameraMode.SINGLE,
            reader_options=reader, extraction_options=options, device=pycolmap.Device.cpu,
        )  # fmt: skip


def camera_of(pycolmap: Any, database: Path, names: list[str]) -> int:
    """The camera that photos of a group have in the database, from a run before; -1: none."""
    if not database.is_file():
        return -1
    with pycolmap.Database.open(str(database)) as base:
        cameras = {image.name: image.camera_id for image in base.read_all_images()}
    return next((cameras[name] for name in names if name in cameras), -1)


def clear_others(pycolmap: Any, database: Path, mark: Path, guided: bool) -> None:
    """Pairs that are known are left as they are: those of the other kind go, also of a run before.

    mark: a file that is there as long as guided matches may be in the database.
    """
    if guided and not mark.exists():
        mark.touch()
    elif guided or not mark.exists():
        return  # they are of this kind, or there are none
    with pycolmap.Database.open(str(database)) as base:
        base.clear_matches()
        base.clear_two_view_geometries()
    if not guided:
        mark.unlink()


def match(pycolmap: Any, database: Path, job: dict, guided: bool) -> None:
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads, options.use_gpu, options.guided_matching = job["threads"], False, guided
    verify = pycolmap.TwoViewGeometryOptions()
    verify.ransac.random_seed = 0  # else a pair's draws are those of the thread that takes it
    if job["neighbours"]:
        pairs = pycolmap.SequentialPairingOptions()
        pairs.overlap, pairs.quadratic_overlap = job["neighbours"], True
        pairs.loop_detection = False
        pycolmap.match_sequential(
            database, matching_options=options, pairing_options=pairs,
            verification_options=verify, device=pycolmap.Device.cpu,
        )  # fmt: skip
    else:
        every = pycolmap.ExhaustivePairingOptions()
        every.block_size = BLOCK
        pycolmap.match_exhaustive(
            database, matching_options=options, pairing_options=every,
            verification_options=verify, device=pycolmap.Device.cpu,
        )  # fmt: skip


def solve(pycolmap: Any, database: Path, job: dict, rung: dict, count: int) -> list:
    """The models that one attempt finds, on the features and matches of the database."""
    folder = Path(job["work"]) / "models"
    folder.mkdir(exist_ok=True)
    if rung["mapper"] == "global":
        plan = pycolmap.GlobalPipelineOptions()
        plan.num_threads, plan.random_seed = job["threads"], 0
        return list(pycolmap.global_mapping(database, job["photos"], folder, plan).values())
    plan = pycolmap.IncrementalPipelineOptions()
    plan.num_threads = 1 if count < THREADED else job["threads"]
    plan.random_seed = 0
    plan.ba_global_max_num_iterations, plan.min_model_size = 30, 3
    plan.mapper.init_min_tri_angle = rung["angle"]
    plan.mapper.abs_pose_min_num_inliers = rung["inliers"]
    done = [0]

    def placed() -> None:
        done[0] += 1
        report(stage=f"poses, {rung['said']}", done=min(done[0] + 1, count), of=count)

    models = pycolmap.incremental_mapping(
        database, job["photos"], folder, options=plan, next_image_callback=placed
    )
    return list(models.values())


def keep_arrays(model: Any, path: Path, measured: str, ends: list) -> None:
    """What the program wants to know of a model, without pycolmap's objects.

    names; world_from_camera (N, 4, 4) OpenCV axes; points (N,) that a photo sees; depth (N,) median
    of those; xyz (P, 3); error_px; and of the photo `measured` at (M, 2) px and away (M,) along
    the view, and rays (2, 3) through the pixels `ends`, 1 long along the view.
    """
    images = sorted((i for i in model.images.values() if i.has_pose), key=lambda i: i.name)
    poses, seen, depths = [], [], []
    at, away, rays = np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3))
    for image in images:
        matrix = np.eye(4)
        matrix[:3] = image.cam_from_world().inverse().matrix()
        points = [p for p in image.points2D if p.has_point3D()]
        xyz = np.array([model.points3D[p.point3D_id].xyz for p in points]).reshape(-1, 3)
        depth = (xyz - matrix[:3, 3]) @ matrix[:3, 2]
        poses.append(matrix)
        seen.append(len(points))
        depths.append(np.median(depth) if len(depth) else np.nan)
        if image.name == measured:
            at, away = np.array([p.xy for p in points]).reshape(-1, 2), depth
            flat = image.camera.cam_from_img(np.array(ends, float))
            rays = np.hstack([flat, np.ones((len(ends), 1))])
    xyz = np.array([p.xyz for p in model.points3D.values()]).reshape(-1, 3)
    np.savez(
        path, names=[i.name for i in images], world_from_camera=poses, points=seen, depth=depths,
        xyz=xyz, error_px=model.compute_mean_reprojection_error(), at=at, away=away,
        rays=rays,
    )  # fmt: skip


def write(job: dict) -> None:
    """The best model in the world frame of job["similarity"], (3, 4), as COLMAP writes it."""
    import pycolmap

    work = Path(job["work"])
    model = pycolmap.Reconstruction(str(work / "best"))
    model.transform(pycolmap.Sim3d(np.array(job["similarity"])))
    target = work / "sparse"
    target.mkdir(exist_ok=True)
    model.write(str(target))
    if job["straight"]:
        options = pycolmap.UndistortCameraOptions()
        pycolmap.undistort_images(
            str(work / "straight"), str(target), job["photos"], undistort_options=options
        )


def end_with_parent() -> None:
    """Waits until the other end of standard input is gone."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


def arm(seconds: float, memory: int) -> None:
    """Sets the limits of the gate for outside parsers: pycolmap reads the photos themselves."""
    spec = importlib.util.spec_from_file_location("limits", LIMITS)
    assert spec is not None and spec.loader is not None
    limits = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(limits)
    if "time" not in limits.arm(seconds, memory):
        sys.exit(UNLIMITED)


def main(what: str, path: str, seconds: str, memory: str) -> None:
    try:
        import pycolmap
    except ImportError as why:
        sys.stderr.write(str(why))
        sys.exit(ABSENT)
    pycolmap.logging.logtostderr = True  # else it leaves files in the temporary folder
    arm(float(seconds), int(memory))
    job = json.loads(Path(path).read_text())
    {"find": find, "write": write}[what](job)


if __name__ == "__main__":
    threading.Thread(target=end_with_parent, daemon=True).start()
    main(*sys.argv[1:])
