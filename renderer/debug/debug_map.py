"""The same splats from above: where they are, why they are not drawn, what the eye looks at."""

from itertools import pairwise

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View

# Why each splat is not drawn, in numpy: the twin of project's gates for debug pictures.
#
# float32 and a column at a time: 400,000 splats take some 50 ms.  The slow and exact one is
# renderer/reference.py.

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


BACKGROUND = 0.06  # grey
MARGIN = 1.12  # of what has to fit
LINE = (255, 255, 255)
LIMIT = (184, 92, 255)  # max_distance around the eye


def birdseye(
    points: Points,
    poses: np.ndarray,
    reason: np.ndarray,
    colors: np.ndarray,
    view: View,
    settings: RenderSettings,
) -> tuple[np.ndarray, float]:
    """((H, W, 3) float32, metres from its left to its right); where the eye looks is upwards."""
    width, height = view.size
    map_from_world = heading(view)
    place = eye_places(points, poses, map_from_world)  # (3, N) metres: right, up to us, down
    map_from_eye = map_from_world @ view.world_from_eye.matrix()
    eye = map_from_eye[:3, 3]
    centre, metres_per_pixel = fit(place[:, reason != 1], eye, view.size)
    pixel = np.stack([place[0] - np.float32(centre[0]), place[2] - np.float32(centre[1])])
    pixel = pixel / np.asarray(metres_per_pixel, np.float32) + np.asarray(
        [[width / 2], [height / 2]], np.float32
    )
    picture = np.full((height, width, 3), BACKGROUND, np.float32)
    known = np.isfinite(pixel).all(axis=0)
    unit = dot_size(view.size)
    for names, dot in (((1,), 1), ((3,), unit), ((0, 2), unit), ((5, 6), unit), ((4,), unit + 1)):
        which = known & np.isin(reason, names)
        paint_points(picture, pixel, -place[1], reason, colors, which, dot)  # higher covers
    corners = outline(view, map_from_eye, place[:, reason == 0])
    draw_lines(picture, corners, eye, centre, metres_per_pixel, settings.max_distance)
    return picture, float(metres_per_pixel * width)


def heading(view: View) -> np.ndarray:
    """(4, 4) rotation from the world: x to the eye's right, y up, -z where it looks, all level."""
    axes = view.world_from_eye.matrix()[:3, :3]
    forward, up = -axes[:, 2], axes[:, 1]
    level = np.array([forward[0], 0, forward[2]])
    if np.linalg.norm(level) < 0.05:  # straight down or up: what is on top in the picture
        level = np.array([up[0], 0, up[2]])
    level /= max(np.linalg.norm(level), 1e-9)
    map_from_world = np.eye(4)
    map_from_world[:3, :3] = [[-level[2], 0, level[0]], [0, 1, 0], (-level).tolist()]
    return map_from_world


def fit(place: np.ndarray, eye: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, float]:
    """(centre (2,) x and z, metres a pixel) that show nearly all places, and the eye."""
    flat = place[[0, 2]]
    flat = flat[:, np.isfinite(flat).all(axis=0)]
    corners = [eye[[0, 2]]]
    if flat.size:
        corners += list(np.percentile(flat, [0.5, 99.5], axis=1))  # a few stray far away
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    extent = np.maximum((high - low) * MARGIN, 1e-3)
    return (low + high) / 2, float(np.max(extent / np.array(size)))


def outline(view: View, map_from_eye: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """(4, 3) on the map: the corners of the view as deep as the farthest splats drawn (3, M)."""
    eye, back = map_from_eye[:3, 3], map_from_eye[:3, 2]
    depth = -(back @ (drawn - eye[:, None])) if drawn.size else np.ones(1)
    reach = max(float(np.percentile(depth, 99)) * 1.1, view.near)
    left, right, down, up = view.tangents
    corners = np.array([[left, up, -1], [right, up, -1], [right, down, -1], [left, down, -1]])
    return eye + reach * corners @ map_from_eye[:3, :3].T


def draw_lines(
    picture: np.ndarray,
    corners: np.ndarray,
    eye: np.ndarray,
    centre: np.ndarray,
    metres_per_pixel: float,
    max_distance: float,
) -> None:
    """The eye, its four corner rays, the far rectangle, and the circle of max_distance."""
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]

    def on_map(place: np.ndarray) -> tuple[float, float]:
        at = (place[[0, 2]] - centre) / metres_per_pixel + (width / 2, height / 2)
        return tuple(np.clip(at, -1e5, 1e5).tolist())

    image = Image.fromarray((np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    x, y = on_map(eye)
    radius = max_distance / metres_per_pixel
    if max_distance < layout.HUGE and radius < 1e5:
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=LIMIT)
    far = [on_map(corner) for corner in corners]
    draw.line([*far, far[0]], fill=LINE, width=1)
    for corner in far:
        draw.line([(x, y), corner], fill=LINE, width=1)
    draw.ellipse((x - 4, y - 4, x + 4, y + 4), fill=(0, 0, 0), outline=LINE, width=2)
    picture[:] = np.asarray(image, np.float32) / 255


# Round values along a scale, and how they are written.

TICKS = 6


def nice_ticks(low: float, high: float, count: int = TICKS) -> list[float]:
    """About `count` round values (1, 2 or 5 times a power of ten apart) within low..high."""
    if not high > low:
        return [low]
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1, 2, 5, 10), key=lambda m: abs(np.log(m * power / raw)))
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(i * step) + 0.0 for i in np.arange(first, last + 1)]  # no minus zero


def tick_text(values: list[float]) -> list[str]:
    """The values with as many decimals as their distance needs."""
    step = min(np.diff(values), default=1.0)
    decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
    return [f"{value:.{decimals}f}".replace("-", "\u2212") for value in values]


# Splats as coloured dots in a picture, the nearest on top.

DIM = 0.35  # of the picture's brightness under the dots
FARTHEST_SHADE = 0.45  # of a dot's brightness


def dim(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32: darker and nearly grey, so that only dots have colours."""
    grey = picture.mean(axis=2, keepdims=True)
    return np.clip(np.nan_to_num(grey * 0.8 + picture * 0.2) * DIM, 0, 1).astype(np.float32)


def dot_size(size: tuple[int, int]) -> int:
    """Pixels across the dot of a splat that is drawn, in a picture of this size."""
    return max(1, round(min(size) / 480))


def paint_points(
    picture: np.ndarray,
    pixel: np.ndarray,
    depth: np.ndarray,
    group: np.ndarray,
    colors: np.ndarray,
    which: np.ndarray,
    dot: int,
) -> None:
    """Paints squares of dot x dot pixels at pixel (2, N) into a picture (H, W, 3) in place.

    depth (N,): smaller covers larger, and shines brighter.  colors (K, 3) by group (N,).
    """
    height, width = picture.shape[:2]
    x, y = pixel
    within = which & (x >= 0) & (x < width) & (y >= 0) & (y < height) & np.isfinite(depth)
    index = np.flatnonzero(within)
    if not len(index):
        return
    far, near = float(depth[index].max()), float(depth[index].min())
    part = (depth[index] - near) / max(far - near, 1e-12)  # 0 near, 1 far
    # 16 bits: numpy sorts those with a radix sort.  Of equal pixels the last written stays.
    order = np.argsort((65535 * (1 - part)).astype(np.uint16), kind="stable")
    index, part = index[order], part[order]
    shade = 1 - (1 - FARTHEST_SHADE) * part[:, None].astype(np.float32)
    color = colors[group[index]] * shade
    column, row = x[index].astype(int), y[index].astype(int)
    for dy in range(dot):
        for dx in range(dot):
            at_y = np.clip(row + dy - dot // 2, 0, height - 1)
            at_x = np.clip(column + dx - dot // 2, 0, width - 1)
            picture[at_y, at_x] = color
