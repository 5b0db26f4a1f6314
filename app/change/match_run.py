"""A process of its own for where one world lies in another: `python -P match_run.py IN OUT`.

SIFT features (Lowe 2004) of pictures that were drawn of two scenes, each of one with each of the
other, matched by pycolmap; the places that they show in both worlds give the similarity by
LO-RANSAC (Chum et al. 2003), one thread, the same every time.  See colmap_child.py for why it is a
process.

Reads: IN.npz with a0 a1 ... b0 b1 ... (H, W) uint8, pa0 ... pb0 ... (H, W, 3) places in metres, NaN
where nothing is, error_m and counts (2,), how many of each.
Writes: OUT.npz with matrix (3, 4) of A from B, inliers and matches; matrix is all NaN where there
is none.  Progress goes to standard output, a JSON object a line.
"""

import json
import os
import sys
import threading
from typing import Any

import numpy as np

ABSENT = 3  # the exit code where pycolmap is not installed: see colmap_child.py
FEATURES = 2048  # of a picture, at most
PEAK = 0.003  # contrast of a feature
LEAST = 8  # matches of two pictures; fewer are mostly wrong


def report(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def extract(pycolmap: Any, job: Any, side: str, count: int) -> list[tuple]:
    """(keypoints, descriptors, places (F, 3)) of each picture, where it shows the scene."""
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = 1, False
    options.sift.max_num_features, options.sift.peak_threshold = FEATURES, PEAK
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    found = []
    for i in range(count):
        report(stage="features", done=i, of=count)
        keypoints, descriptors = extractor.extract_from_uint8_array(job[f"{side}{i}"])
        at = np.array([(k.x, k.y) for k in keypoints], float).reshape(-1, 2).astype(int)
        places = job[f"p{side}{i}"][at[:, 1], at[:, 0]]
        kept = np.flatnonzero(np.isfinite(places).all(axis=1))
        keypoints = pycolmap.FeatureKeypoints([keypoints[k] for k in kept])
        descriptors.data = descriptors.data[kept]
        found.append((keypoints, descriptors, places[kept]))
    return found


def match(pycolmap: Any, first: list[tuple], second: list[tuple]) -> tuple[np.ndarray, np.ndarray]:
    """(M, 3) places of A and (M, 3) of B that look alike."""
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads, options.use_gpu = 1, False
    matcher = pycolmap.FeatureMatcher.create(options, pycolmap.Device.cpu)
    of_a, of_b = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for done, (keys_a, words_a, places_a) in enumerate(first):
        report(stage="matches", done=done, of=len(first))
        for keys_b, words_b, places_b in second:
            if not (len(keys_a) and len(keys_b)):
                continue
            pairs = matcher.match(keys_a, words_a, keys_b, words_b).astype(int)
            if len(pairs) >= LEAST:
                of_a.append(places_a[pairs[:, 0]])
                of_b.append(places_b[pairs[:, 1]])
    return np.concatenate(of_a), np.concatenate(of_b)


def main(given: str, wanted: str) -> None:
    try:
        import pycolmap
    except ImportError as why:
        sys.stderr.write(str(why))
        sys.exit(ABSENT)
    pycolmap.logging.logtostderr = True  # else it leaves files in the temporary folder
    pycolmap.set_random_seed(0)
    with np.load(given) as job:
        count_a, count_b = job["counts"].tolist()
        first = extract(pycolmap, job, "a", count_a)
        second = extract(pycolmap, job, "b", count_b)
        error = float(job["error_m"])
    of_a, of_b = match(pycolmap, first, second)
    matrix, inliers = np.full((3, 4), np.nan), 0
    if len(of_a) >= LEAST:
        ransac = pycolmap.RANSACOptions()
        ransac.max_error, ransac.random_seed = error, 0
        found: Any = pycolmap.estimate_sim3d_robust(of_b, of_a, ransac)
        if found is not None:  # a dict, though its signature says a Sim3d
            matrix = found["tgt_from_src"].matrix()
            moved = of_b @ matrix[:, :3].T + matrix[:, 3]
            inliers = int((np.linalg.norm(moved - of_a, axis=1) <= error).sum())
    np.savez(wanted, matrix=matrix, inliers=inliers, matches=len(of_a))


def end_with_parent() -> None:
    """Waits until the other end of standard input is gone."""
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=end_with_parent, daemon=True).start()
    main(*sys.argv[1:])
