"""A second capture of an object turned over: trained, registered, merged with the first."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "decomposition")]

from object_alone import (  # noqa: E402
    LEAST_SEEN,
    Cut,
    around,
    draw_together,
    moved,
    moved_view,
    photos_alone,
    turned_over,
)

from shapeshift.decomposition.completion.plane import AnchorLooks, looks_of  # noqa: E402
from shapeshift.decomposition.completion.verify import OPEN  # noqa: E402
from shapeshift.decomposition.partition import (  # noqa: E402
    LEAST_SHARE,
    LabelledView,
    gather_evidence,
)
from shapeshift.rasterizer.device import Device  # noqa: E402
from shapeshift.runtime_models.model import AnchorModel  # noqa: E402
from shapeshift.scene.captures.capture import Capture, Photo  # noqa: E402
from shapeshift.scene.pose import Pose  # noqa: E402
from shapeshift.training.settings import TrainSettings  # noqa: E402
from shapeshift.training.synthetic.balls import save_png  # noqa: E402
from shapeshift.training.synthetic.placing import frame  # noqa: E402
from shapeshift.training.synthetic.workshop import GREY, STOPS  # noqa: E402
from shapeshift.training.train import Trainer  # noqa: E402

STUDIO = (GREY, GREY, GREY)
SECOND, SECOND_SIZE = 24, (256, 192)  # photos of the second capture
STARTS, STEPS, KEPT = 240, 20, 0.6  # of ICP; the share of pairs that counts
CANDIDATES = 30  # poses that silhouettes choose from


def second_capture(device: Device, cut: Cut, folder: Path, seconds: float, held: bool) -> tuple:
    """(model, [(view, mask)]) of the object turned over, in the second capture's own frame.

    held: lifted as it stood, under its light, and photographed from below.
    """
    pose = turned_over(cut)
    heights = np.sin(np.deg2rad(np.tile([10.0, 30.0, 50.0, 70.0], SECOND // 4)))
    if held:
        below = around(cut.middle, cut.reach, -heights, SECOND_SIZE)
        views, taken = [moved_view(v, pose) for v in below], photos_alone(cut, below, np.eye(4))
    else:
        middle = pose[:3, :3] @ cut.middle + pose[:3, 3]
        views = around(middle, cut.reach, heights, SECOND_SIZE)
        taken = photos_alone(cut, views, pose)
    photos, masks = [], []
    for i, (image, mask) in enumerate(taken):
        paths = [folder / f"{cut.name}_{i:02}{end}.png" for end in ("", "_mask")]
        save_png(paths[0], image)
        save_png(paths[1], mask)
        masks.append((views[i], mask > 0.5))
        photos.append(Photo(views[i], paths[0], STOPS[0].name, paths[1]))
    capture = Capture(folder, STOPS[:1], tuple(photos), background=STUDIO)
    settings = TrainSettings(seconds=seconds, iterations=None, max_anchors=3000, points="hull")
    trainer = Trainer(device, capture, settings)
    for _ in trainer.steps():
        pass
    return trainer.model(), masks


def tones(looks: AnchorLooks, rows: np.ndarray) -> np.ndarray:
    """(n, 6) metres and the first stop's colour without its brightness: light differs."""
    rgb = looks.colors[rows, :3]
    return np.c_[looks.places[rows], rgb / (rgb.sum(1, keepdims=True) + 0.1)]


def rigid(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(4, 4) target from source by least squares (Kabsch)."""
    a, b = source.mean(0), target.mean(0)
    u, _, vt = np.linalg.svd((source - a).T @ (target - b))
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    rotation = vt.T @ sign @ u.T
    return frame(b - rotation @ a, rotation)


def icp(
    source: np.ndarray, target: np.ndarray, pose: np.ndarray, weight: float, steps: int = STEPS
) -> tuple[np.ndarray, float]:
    """Pose (4, 4) and the trimmed residual, metres; points are (n, 3 + c): place and tone."""
    from scipy.spatial import cKDTree

    scaled = np.c_[target[:, :3], weight * target[:, 3:]]
    tree, residual = cKDTree(scaled), np.inf
    for _ in range(steps):
        at = source[:, :3] @ pose[:3, :3].T + pose[:3, 3]
        away, which = tree.query(np.c_[at, weight * source[:, 3:]])
        near = np.argsort(away)[: int(KEPT * len(away))]
        residual = float(np.sqrt((away[near] ** 2).mean()))
        pose = rigid(source[near, :3], target[which[near], :3])
    return pose, residual


def register(device: Device, cut: Cut, looks: AnchorLooks, photos: list) -> np.ndarray:
    """(4, 4) first from second, from nothing known: ICP of many starts, then silhouettes choose.

    photos: (view, mask) of the second capture.
    """
    random, weight = np.random.default_rng(0), 0.3 * cut.reach
    points = tones(looks, np.flatnonzero(looks.there)), tones(cut.looks, cut.known)
    few, others = (p[random.permutation(len(p))[:300]] for p in points)
    centres = [(np.percentile(p[:, :3], 1, 0) + np.percentile(p[:, :3], 99, 0)) / 2 for p in points]
    found = []
    for _ in range(STARTS):
        q = random.standard_normal(4)
        start = Pose(np.zeros(3), q / np.linalg.norm(q)).matrix()
        start[:3, 3] = centres[1] - start[:3, :3] @ centres[0]
        found.append(icp(few, others, start, weight))
    distinct: list[np.ndarray] = []
    for pose, _ in sorted(found, key=lambda each: each[1]):
        if all(np.trace(pose[:3, :3].T @ each[:3, :3]) < 2.9 for each in distinct):  # 18 degrees
            distinct.append(pose)
    poses = [icp(*points, pose, weight, 2 * STEPS)[0] for pose in distinct[:CANDIDATES]]
    return max(poses, key=lambda pose: overlap(device, cut, pose, photos))


def overlap(device: Device, cut: Cut, pose: np.ndarray, photos: list) -> float:
    """Mean IoU of the first object's silhouette with the masks of every fourth second photo."""
    shown, ious = moved(cut.model, np.linalg.inv(pose)), []
    for view, mask in photos[::4]:
        mine = draw_together(device, [shown], view)[..., 3] > OPEN
        ious.append((mine & mask).sum() / max((mine | mask).sum(), 1))
    return float(np.mean(ious))


def carved(device: Device, cut: Cut, pose: np.ndarray, photos: list) -> np.ndarray:
    """(A,) bool: anchors of the first that the second's masks do not show to be outside."""
    pictures = [LabelledView(view, 0.0, mask.astype(np.uint8)) for view, mask in photos]
    sums = gather_evidence(device, moved(cut.model, np.linalg.inv(pose)), pictures, 2)
    return ~(sums[:, 0] > LEAST_SHARE * np.maximum(sums.sum(1), LEAST_SEEN))


def by_second_capture(
    device: Device, cut: Cut, second: AnchorModel, photos: list, held: bool
) -> Iterator[tuple[str, float, list[AnchorModel], int, int, list[float]]]:
    """(way, IoU, parts, copied, dropped, how far off mm and degrees) of merging by evidence."""
    from scipy.spatial import cKDTree

    looks, right, first = looks_of(second), np.linalg.inv(turned_over(cut)), "second capture"
    poses = {"true pose": right}
    if held:  # registration is judged on the capture turned over
        first = "second capture from below"
    else:
        poses = {"ICP": register(device, cut, looks, photos)} | poses
    for name, pose in poses.items():
        off = pose @ np.linalg.inv(right)
        degrees = np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1)))
        millimetres = 1e3 * np.linalg.norm(off[:3, :3] @ cut.middle + off[:3, 3] - cut.middle)
        at = looks.places @ pose[:3, :3].T + pose[:3, 3]
        away, _ = cKDTree(cut.looks.places[cut.known]).query(at)
        new = looks.there & (away > cut.looks.spacing_m)
        told, iou = [millimetres, degrees], overlap(device, cut, pose, photos)
        added = moved(second.with_anchors(new), pose)
        kept = {"union": cut.seen, "carved union": cut.seen & carved(device, cut, pose, photos)}
        for way, stay in kept.items():
            parts = [cut.model.with_anchors(stay), added]
            yield (
                f"{first}: {way}, {name}",
                iou,
                parts,
                int(new.sum()),
                int((~stay).sum()),
                told,
            )
        away, _ = cKDTree(at[looks.there]).query(cut.looks.places)
        whole, far = [moved(second, pose)], cut.seen & (away > cut.looks.spacing_m)
        parts, dropped = [cut.model.with_anchors(far), *whole], int((~far).sum())
        yield f"{first}: second first, {name}", iou, parts, len(second.anchors), dropped, told
        way = f"{first}: instead, {name}"
        yield way, iou, whole, len(second.anchors), len(cut.seen), told
