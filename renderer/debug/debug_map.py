"""The same splats from above: where they are, why they are not drawn, what the eye looks at."""

import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.debug.classify import Points, eye_places
from shapeshift.renderer.debug.points import dot_size, paint_points
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View

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
