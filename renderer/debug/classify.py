"""Why each splat is not drawn, in numpy: the twin of project's gates for debug pictures.

float32 and a column at a time: 400,000 splats take some 50 ms.  The slow and exact one is
renderer/reference/reference.py.
"""

from itertools import pairwise

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View

Points = tuple[np.ndarray, np.ndarray, np.ndarray]  # mean_opacity (N, 4), object (N,), covariance


def eye_places(points: Points, poses: np.ndarray, frame_from_world: np.ndarray) -> np.ndarray:
    """(3, N) float32 metres in a frame; poses (O, 4, 4), NaN where hidden."""
    mean_opacity, owner, _ = points
    out = np.empty((3, len(owner)), np.float32)
    matrices = rows_of(frame_from_world @ poses)
    for i, start, end in runs(owner, len(poses)):
        matrix = matrices[i]
        with np.errstate(invalid="ignore"):  # what is not finite is nowhere
            out[:, start:end] = matrix[:, :3] @ mean_opacity[start:end, :3].T + matrix[:, 3:]
    return out


def runs(owner: np.ndarray, objects: int) -> list[tuple[int, int, int]]:
    """(object, its first splat, after its last) of those that have any; they lie together."""
    edges = np.searchsorted(owner, np.arange(objects + 1)).tolist()
    return [(i, a, b) for i, (a, b) in enumerate(pairwise(edges)) if b > a]


def rows_of(frame_from_objects: np.ndarray) -> np.ndarray:
    """(O, 3, 4) float32, for numbers that are float32 all the way."""
    return np.asarray(frame_from_objects, np.float32)[:, :3]


def classify(
    points: Points,
    poses: np.ndarray,
    view: View,
    settings: RenderSettings,
    antialiased: tuple[bool, ...] = (),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """reason (N,) uint8 (0 drawn, else 1 + index into CULL_REASONS), pixel (2, N) row 0 on top,
    depth (N,) metres.  Colours are not looked at: one that is not finite culls, too.
    antialiased: one an object; none: no object is.
    """
    mean_opacity, owner, covariance = points
    count = len(owner)
    a, b, c = (np.empty(count, np.float32) for _ in range(3))
    place = eye_places(points, poses, view.eye_from_world())
    left, right, down, up = view.tangents
    focal_x, focal_y = view.size[0] / (right - left), view.size[1] / (up - down)
    with np.errstate(all="ignore"):  # what is level with the eye or not finite fails its gate below
        depth = -place[2]
        per_depth = 1 / depth
        tangent_x, tangent_y = place[0] * per_depth, place[1] * per_depth
        most_x, most_y = (np.float32(layout.JACOBIAN_MARGIN * t) for t in view.widest_tangents())
        held_x, held_y = np.clip(tangent_x, -most_x, most_x), np.clip(tangent_y, -most_y, most_y)
        matrices = rows_of(view.eye_from_world() @ poses)
        for i, start, end in runs(owner, len(poses)):
            part, matrix = slice(start, end), matrices[i]
            sigma = covariance[part, :6].T  # xx xy xz yy yz zz
            scale_x, scale_y = (
                per_depth[part] * np.float32(focal_x),
                per_depth[part] * np.float32(focal_y),
            )
            u = [scale_x * (matrix[0, k] + held_x[part] * matrix[2, k]) for k in range(3)]
            v = [scale_y * (matrix[1, k] + held_y[part] * matrix[2, k]) for k in range(3)]
            sigma_u, sigma_v = turned(sigma, u), turned(sigma, v)
            a[part], b[part], c[part] = dot(u, sigma_u), dot(v, sigma_u), dot(v, sigma_v)
        pixel = np.stack(
            [
                (tangent_x - np.float32(left)) * np.float32(focal_x),
                (np.float32(up) - tangent_y) * np.float32(focal_y),
            ]
        )
        thin = np.array(antialiased, bool)[owner] if any(antialiased) else None
        reason = gate(place, pixel, a, b, c, mean_opacity[:, 3], thin, view, settings)
    return reason, pixel, depth


def turned(sigma: np.ndarray, u: list[np.ndarray]) -> list[np.ndarray]:
    """Sigma u, columns of a symmetric matrix given as xx xy xz yy yz zz."""
    xx, xy, xz, yy, yz, zz = sigma
    return [
        xx * u[0] + xy * u[1] + xz * u[2],
        xy * u[0] + yy * u[1] + yz * u[2],
        xz * u[0] + yz * u[1] + zz * u[2],
    ]


def dot(u: list[np.ndarray], v: list[np.ndarray]) -> np.ndarray:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def gate(
    place: np.ndarray, pixel: np.ndarray, bare_a: np.ndarray, b: np.ndarray, bare_c: np.ndarray,
    opacity: np.ndarray, antialiased: np.ndarray | None, view: View, settings: RenderSettings,
) -> np.ndarray:  # fmt: skip
    """(N,) uint8 as project.comp: the last gate first, so that the first that fails counts."""
    least, low_pass = np.float32(settings.min_alpha), np.float32(settings.low_pass)
    largest, farthest, smallest = (
        np.float32(min(limit, layout.HUGE))
        for limit in (settings.max_pixels, settings.max_distance, settings.min_pixels)
    )
    distance2 = place[0] * place[0] + place[1] * place[1] + place[2] * place[2]
    a, c = bare_a + low_pass, bare_c + low_pass
    mid, off = (a + c) / 2, (a - c) / 2
    major = mid + np.sqrt(off * off + b * b)  # px^2
    bare = np.maximum(bare_a * bare_c - b * b, 0)
    determinant = bare + low_pass * (bare_a + bare_c) + low_pass * low_pass
    minor = determinant / major
    seen = opacity  # on the screen
    if antialiased is not None:
        kept = np.fmin(np.sqrt(bare / determinant), 1)
        seen = np.where(antialiased, opacity * kept, opacity)
    cutoff_sigmas = np.sqrt(np.maximum(2 * np.log(seen / least), 0))
    sigma = np.sqrt(major)
    reach = cutoff_sigmas * sigma  # pixels
    shaped = np.isfinite(pixel[0] + pixel[1] + major + minor + cutoff_sigmas) & (minor > 0)
    half_x, half_y = cutoff_sigmas * np.sqrt(a), cutoff_sigmas * np.sqrt(c)
    inside = (pixel[0] - half_x < view.size[0]) & (pixel[0] + half_x > 0)
    inside &= (pixel[1] - half_y < view.size[1]) & (pixel[1] + half_y > 0)
    passes = [
        np.isfinite(opacity) & (opacity >= least),
        distance2 <= farthest * farthest,
        (-place[2] > np.float32(view.near)) & (inside | ~shaped),
        shaped & (major <= largest * largest),
        reach >= smallest,
    ]
    if settings.fade > 0 or antialiased is not None:
        faded = seen.copy()
        for within, limit in (
            (largest - sigma, settings.max_pixels),
            (farthest - np.sqrt(distance2), settings.max_distance),
            (reach - smallest, settings.min_pixels),
        ):
            if settings.fade > 0 and 0 < limit < layout.HUGE:
                faded *= np.clip(within * np.float32(1 / (settings.fade * limit)), 0, 1)
        passes.append(faded >= least)
    reason = np.zeros(len(opacity), np.uint8)
    for i in reversed(range(len(passes))):
        reason[~passes[i]] = i + 1
    return reason
