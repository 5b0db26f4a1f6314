"""The first look at a capture that is larger than its photos: one of them."""

from collections.abc import Sequence

import numpy as np

from shapeshift.scene.pose import View

PARALLEL = 1e-3  # smallest over largest curvature: axes that are nearer to parallel meet nowhere
PART = 0.75  # of the scene's radius: photos that show so much to each side show the scene
ONE_PLACE = 1e-9  # metres that cameras at one place are apart, by rounding
AHEAD = 0.5  # of the cameras: as many have the subject before them


def photo_view(views: Sequence[View], centre: np.ndarray, radius: float) -> dict | None:
    """The most usual of the views, as `default_view` reads it from provenance["view"].

    centre (3,), radius: metres, the bounds of what was captured.  Gives eye, target, fov_y.  None
    where photos show all of it, so that the whole scene is the better first look.  Of a room, or a
    thing on a floor, the whole is mostly the ragged edge that few photos have seen.
    """
    if not views:
        return None
    eyes = np.array([view.world_from_eye.position for view in views])  # (V, 3) metres
    ahead = np.array([-view.world_from_eye.matrix()[:3, 2] for view in views])
    tangents = np.array([view.tangents for view in views])  # left, right, down, up
    depth = depth_of_subject(eyes, ahead, radius)
    shown = depth * (tangents[:, [1, 3]] - tangents[:, [0, 2]]).max(axis=1) / 2  # metres
    if not np.median(shown) < PART * radius:
        return None
    usual, target = np.median(depth), np.median(eyes + depth[:, None] * ahead, axis=0)
    toward = target - eyes
    away = np.linalg.norm(toward, axis=1)  # metres
    cosine = (toward * ahead).sum(axis=1) / np.maximum(away, 1e-9)
    level = ahead.mean(axis=0)
    score = np.arccos(np.clip(cosine, -1, 1)) + np.abs(np.log(np.maximum(away, 1e-9) / usual))
    score -= 0.5 * ahead @ level  # the front is where most look
    best = int(score.argmin())
    (_, _, down, up), eye = tangents[best], eyes[best]
    return {
        "eye": eye.tolist(),
        "target": (eye + max(away[best], 1e-6) * ahead[best]).tolist(),
        "fov_y": float(np.arctan(up) - np.arctan(down)),
    }


def subject_distance(views: Sequence[View]) -> float:
    """Metres (median) to where the cameras look together; 0 where nothing says."""
    eyes = np.array([view.world_from_eye.position for view in views], np.float64)
    ahead = np.array([-view.world_from_eye.matrix()[:3, 2] for view in views])
    radius = float(np.linalg.norm(eyes - eyes.mean(axis=0), axis=1).max())
    if not radius > ONE_PLACE:
        return 0.0
    return float(np.median(depth_of_subject(eyes, ahead, radius)))


def depth_of_subject(eyes: np.ndarray, ahead: np.ndarray, radius: float) -> np.ndarray:
    """(V,) metres along each optical axis to where the axes come nearest to each other.

    eyes, ahead: (V, 3), unit directions.  Where they do not meet before the cameras, or nowhere,
    half the radius.
    """
    across = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]  # (V, 3, 3)
    curvature = across.sum(axis=0)
    values = np.linalg.eigvalsh(curvature)
    if not values[0] > PARALLEL * values[-1]:
        return np.full(len(eyes), radius / 2)
    meeting = np.linalg.solve(curvature, (across @ eyes[:, :, None])[:, :, 0].sum(axis=0))
    depth = ((meeting - eyes) * ahead).sum(axis=1)
    return depth if (depth > 0).mean() > AHEAD else np.full(len(eyes), radius / 2)
