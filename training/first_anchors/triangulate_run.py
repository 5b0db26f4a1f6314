"""A process of its own for points out of posed photos: `python -P triangulate_run.py IN OUT`.

SIFT features (Lowe 2004) of each photo, matched along the epipolar lines that the known poses give,
and triangulated with the poses held still, all by pycolmap (Schoenberger and Frahm 2016) and with
one thread, so that the same photos give the same points to the byte.  See colmap_child.py for why
it is a process.  It ends when its standard input does, as that of a program that was killed.

Reads: IN.npz, see write_job in triangulation.py.
Writes: OUT.npz with xyz (P, 3) metres.  Progress goes to standard output, a JSON object a line.
"""

import json
import math
import os
import sys
import threading
from typing import Any

import numpy as np

ABSENT = 3  # the exit code where pycolmap is not installed: see colmap_child.py
ERROR_PX = 2.0  # that a match may lie beside its epipolar line, and a point beside its features
LEAST_ANGLE = 2.0  # degrees between the rays of a point that meet at the widest angle
FEATURES = 4096  # of a photo, at most
PEAK = 0.003  # contrast of a feature; COLMAP's 0.0067 leaves a third of them at these sizes
CAMERA, IMAGE = 1, 1  # the first ids: COLMAP counts from one


def report(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def extract(pycolmap: Any, job: Any, count: int) -> list[tuple]:
    """(keypoints, descriptors) of each photo, where the photo counts."""
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = 1, False
    options.sift.max_num_features, options.sift.peak_threshold = FEATURES, PEAK
    options.sift.first_octave = int(job["first_octave"])
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    found = []
    for i in range(count):
        report(stage="features", done=i, of=count)
        keypoints, descriptors = extractor.extract_from_uint8_array(job[f"gray{i}"])
        if f"counts{i}" in job.files:
            at = places(keypoints).astype(int)
            kept = np.flatnonzero(job[f"counts{i}"][at[:, 1], at[:, 0]])
            keypoints = pycolmap.FeatureKeypoints([keypoints[k] for k in kept])
            descriptors.data = descriptors.data[kept]
        found.append((keypoints, descriptors))
    return found


def places(keypoints: Any) -> np.ndarray:
    """(F, 2) pixels of keypoints, (0.5, 0.5) the middle of the upper left one."""
    return np.array([(k.x, k.y) for k in keypoints], float).reshape(-1, 2)


def essential(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(3, 3) E with x2 E x1 = 0 of two camera_from_world (4, 4)."""
    second_from_first = second @ np.linalg.inv(first)
    x, y, z = second_from_first[:3, 3]
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ second_from_first[:3, :3]


def match(pycolmap: Any, job: Any, cameras: list, features: list[tuple]) -> Any:
    """The graph of features that lie on each other's epipolar lines and look alike."""
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads, options.use_gpu = 1, False
    matcher = pycolmap.FeatureMatcher.create(options, pycolmap.Device.cpu)
    graph = pycolmap.CorrespondenceGraph()
    for i, (keypoints, _) in enumerate(features):
        graph.add_image(IMAGE + i, len(keypoints))
    poses, pairs = job["camera_from_world"], job["pairs"]
    for done, (i, j) in enumerate(pairs.tolist()):
        report(stage="matches", done=done, of=len(pairs))
        apart = essential(poses[i], poses[j])
        if not (len(features[i][0]) and len(features[j][0]) and apart.any()):
            continue  # nothing to match, or photos from one place, which tell no depth
        two = pycolmap.TwoViewGeometry()
        two.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
        two.E = apart
        matcher.match_guided(ERROR_PX, *features[i], cameras[i], *features[j], cameras[j], two)
        if len(two.inlier_matches):
            graph.add_two_view_geometry(IMAGE + i, IMAGE + j, two)
    graph.finalize()
    return graph


def reconstruction_of(pycolmap: Any, job: Any, cameras: list, features: list[tuple]) -> Any:
    """The photos at their poses, without points."""
    model = pycolmap.Reconstruction()
    for i, (camera, (keypoints, _)) in enumerate(zip(cameras, features, strict=True)):
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(
            name=str(i), keypoints=places(keypoints), camera_id=camera.camera_id, image_id=IMAGE + i
        )
        pose = pycolmap.Rigid3d(job["camera_from_world"][i, :3])
        model.add_image_with_trivial_frame(image, pose)
    return model


def triangulate(pycolmap: Any, job: Any, model: Any, graph: Any) -> np.ndarray:
    """(P, 3) points that as many photos show as job["least"] says of their modality."""
    angle = math.degrees(math.atan(ERROR_PX / float(np.median(job["pinholes"][:, 0]))))
    options = pycolmap.IncrementalTriangulatorOptions()
    options.create_max_angle_error = options.continue_max_angle_error = angle
    options.merge_max_reproj_error = options.complete_max_reproj_error = ERROR_PX
    options.min_angle, options.random_seed = LEAST_ANGLE, 0
    options.ignore_two_view_tracks = bool(job["least"].min() > 2)
    observed = pycolmap.ObservationManager(model, graph)
    triangulator = pycolmap.IncrementalTriangulator(graph, model, observed)
    count = len(job["least"])
    for i in range(count):
        report(stage="triangulation", done=i, of=count)
        triangulator.triangulate_image(options, IMAGE + i)
    triangulator.complete_all_tracks(options)
    triangulator.merge_all_tracks(options)
    observed.filter_all_points3D(ERROR_PX, LEAST_ANGLE)
    kept = [
        model.points3D[number].xyz
        for number in sorted(model.points3D)
        if seen_enough(model.points3D[number], job["least"])
    ]
    return np.array(kept).reshape(-1, 3)


def seen_enough(point: Any, least: np.ndarray) -> bool:
    """Whether so many photos show a point as it takes in its modality."""
    photos = {element.image_id - IMAGE for element in point.track.elements}
    return bool(len(photos) >= least[next(iter(photos))])


def main(given: str, wanted: str) -> None:
    try:
        import pycolmap
    except ImportError as why:
        sys.stderr.write(str(why))
        sys.exit(ABSENT)
    pycolmap.logging.logtostderr = True  # else it leaves files in the temporary folder
    pycolmap.set_random_seed(0)
    with np.load(given) as job:
        cameras = [
            pycolmap.Camera(
                camera_id=CAMERA + i, model="PINHOLE", width=int(width), height=int(height),
                params=pinhole,
            )
            for i, (pinhole, (width, height)) in enumerate(
                zip(job["pinholes"], job["sizes"], strict=True)
            )
        ]  # fmt: skip
        features = extract(pycolmap, job, len(cameras))
        graph = match(pycolmap, job, cameras, features)
        model = reconstruction_of(pycolmap, job, cameras, features)
        np.savez(wanted, xyz=triangulate(pycolmap, job, model, graph))


def end_with_parent() -> None:
    """Waits until the other end of standard input is gone."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=end_with_parent, daemon=True).start()
    main(*sys.argv[1:])
