"""Which way is up in a world that structure from motion has made, and how long a metre is in it.

Structure from motion knows neither: its world is right but for a similarity.  People hold cameras
level, so the rows of their photos lie in planes through the horizon.
"""

import numpy as np

CLEAR_UP = 0.2  # mean length of the photos' up vectors under which they say nothing
CLEAR_PLANE = 0.5  # of the second singular value that the third may have: rows lie in a plane
LEAST_TURN = 0.1  # of the first singular value in the second: photos look in different directions
MOST_TILT = np.cos(np.radians(45))  # between the normal of that plane and the mean up vector
NEAREST = 8  # points around a pixel that say how far what it shows is
NEAR_PX = 0.05  # of the photo's longest side: no point nearer than that, and nobody knows
# Up in a photo's own axes (x right, y down) by the EXIF orientation of its file
UP_BY_ORIENTATION = {1: (0, -1), 2: (0, -1), 3: (0, 1), 4: (0, 1),
                     5: (-1, 0), 6: (-1, 0), 7: (1, 0), 8: (1, 0)}  # fmt: skip
COLMAP_UP = np.array([0.0, -1.0, 0.0])


def find_up(world_from_camera: np.ndarray, orientations: list[int]) -> np.ndarray | None:
    """(3,) unit vector of the world, or None where the photos do not agree.

    world_from_camera: (N, 4, 4) OpenCV axes.  The normal of the plane that the photos' horizontal
    axes lie in, where they lie in one and look in different directions; else the mean of their up
    vectors, which a person who looks down from above on one side makes lean.
    """
    turns = np.asarray(world_from_camera)[:, :3, :3]
    ups = np.array([UP_BY_ORIENTATION.get(o, (0, -1)) for o in orientations], float)  # (N, 2)
    up_w = np.einsum("nij,nj->ni", turns[:, :, :2], ups)
    across_w = np.einsum("nij,nj->ni", turns[:, :, :2], np.stack([-ups[:, 1], ups[:, 0]], axis=1))
    mean = up_w.mean(axis=0)
    if not np.linalg.norm(mean) > CLEAR_UP:
        return None
    mean /= np.linalg.norm(mean)
    if len(turns) > 2:
        _, size, axes = np.linalg.svd(across_w, full_matrices=False)
        normal = axes[2] * np.sign(axes[2] @ mean)
        turned = size[1] >= LEAST_TURN * size[0]
        if turned and size[2] <= CLEAR_PLANE * size[1] and normal @ mean >= MOST_TILT:
            return normal
    return mean


def similarity(up: np.ndarray, scale: float, centre: np.ndarray) -> np.ndarray:
    """(3, 4) new from old: `up` becomes COLMAP's -Y by the shortest turn, `centre` the origin."""
    axis, cosine = np.cross(up, COLMAP_UP), float(up @ COLMAP_UP)
    if cosine < -1 + 1e-12:
        turn = np.diag([1.0, -1.0, -1.0])
    else:
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + cross + cross @ cross / (1 + cosine)
    return np.hstack([scale * turn, -scale * (turn @ centre)[:, None]])


def length_between(
    ends: np.ndarray, at: np.ndarray, away: np.ndarray, rays: np.ndarray, side: int
) -> float:
    """Between what two pixels of a photo show, in the units of the model; NaN: nobody knows.

    ends: (2, 2) px; at: (M, 2) px and away: (M,) depth along the view of the points that the
    photo sees; rays: (2, 3) directions through the ends, 1 long along the view.
    """
    if len(at) < 3:
        return np.nan
    places = []
    for end, ray in zip(ends, rays, strict=True):
        far = np.linalg.norm(at - end, axis=1)
        near = np.argsort(far)[:NEAREST]
        if not far[near[0]] <= NEAR_PX * side:
            return np.nan
        places.append(ray * np.median(away[near]))
    return float(np.linalg.norm(places[0] - places[1]))
