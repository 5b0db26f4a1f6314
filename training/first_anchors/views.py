"""What views see: pixels of points, and the place that several look at together."""

import numpy as np

from shapeshift.scene.pose import View

AT_ONCE = 20  # near planes: as far away is what was photographed from one place
SLACK = 1.5  # distances of samples by which those of one surface may lie behind each other


def pixel_of(view: View, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, 2) pixels, row 0 on top, and (P,) whether the point lies in the image."""
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    in_camera = points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    x, y, z = np.ascontiguousarray(in_camera.T)  # rows of their own: two thirds of the time
    with np.errstate(divide="ignore", invalid="ignore"):
        column, row = fx * x / z + cx, fy * y / z + cy
    width, height = view.size
    inside = (z > view.near) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
    pixel = np.stack([column, row], axis=1)
    return pixel, inside


def pixel_size(points: np.ndarray, views: list[View]) -> np.ndarray:
    """(P,) metres that a pixel of the view that sees a point finest is wide there; Inf where none
    does.
    """
    finest = np.full(len(points), np.inf)
    for view in views:
        camera_from_world, fx, fy, _, _ = view.pinhole()
        _, inside = pixel_of(view, points)
        depth = points[inside] @ camera_from_world[2, :3] + camera_from_world[2, 3]
        finest[inside] = np.minimum(finest[inside], depth / max(fx, fy))
    return finest


def seen_first(points: np.ndarray, edge: float, views: list[View]) -> np.ndarray:
    """(P,) whether any view has nothing of a surface before a point of it.

    points: samples of surfaces, metres, `edge` apart.
    """
    from scipy.ndimage import minimum_filter

    seen = np.zeros(len(points), bool)
    for view in views:
        pixel, inside = pixel_of(view, points)
        rows = np.flatnonzero(inside)
        if not len(rows):
            continue
        camera_from_world, fx, _, _, _ = view.pinhole()
        depth = points[rows] @ camera_from_world[2, :3] + camera_from_world[2, 3]
        side = max(1.0, edge * fx / float(np.median(depth)))  # pixels between the samples
        column, row = (pixel[rows] / side).astype(int).T
        nearest = np.full([int(length / side) + 1 for length in view.size[::-1]], np.inf)
        np.minimum.at(nearest, (row, column), depth)
        nearest = minimum_filter(nearest, 3)  # a surface has no gaps between its samples
        slack = SLACK * side / fx * depth  # metres: the samples', or a pixel where that is more
        seen[rows] |= depth <= nearest[row, column] + slack
    return seen


def common_box(views: list[View]) -> tuple[np.ndarray, float]:
    """(centre (3,), half side) metres of the place that the cameras look at together."""
    eyes = np.array([v.world_from_eye.position for v in views])
    ahead = np.array([-v.world_from_eye.matrix()[:3, 2] for v in views])
    tangent = np.median([max(abs(t) for t in v.tangents) for v in views])
    if least := least_distance(views):
        return (eyes + least * ahead).mean(0), float(1.5 * least * min(tangent, 0.6))
    # nearest point to all viewing axes, least squares; nearly parallel axes are held near the eyes
    away = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]
    spread = max(float(np.linalg.norm(eyes - eyes.mean(0), axis=1).max()), 1e-3)
    weight = 1e-3 * len(views)  # of the guess
    guess = (eyes + spread * ahead).mean(0)
    centre = np.linalg.solve(
        away.sum(0) + weight * np.eye(3), (away @ eyes[:, :, None]).sum(0)[:, 0] + weight * guess
    )
    distance = np.median(np.linalg.norm(eyes - centre, axis=1))
    return centre, float(1.5 * distance * min(tangent, 0.6))


def least_distance(views: list[View]) -> float:
    """Metres to what photos show that were all taken from one place, and so do not say how far it
    is; 0 where they were taken from several.
    """
    eyes, near = np.array([v.world_from_eye.position for v in views]), min(v.near for v in views)
    spread = float(np.linalg.norm(eyes - eyes.mean(0), axis=1).max())
    return 0.0 if spread > near else AT_ONCE * near


def distance_of(views: list[View]) -> float:
    """Median metres from the cameras to the place that they look at together."""
    eyes = np.array([view.world_from_eye.position for view in views])
    distance = float(np.median(np.linalg.norm(eyes - common_box(views)[0], axis=1)))
    return max(distance, least_distance(views))
