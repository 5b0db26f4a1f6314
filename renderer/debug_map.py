"""The same splats from above: where they are, why they are not drawn, what the eye looks at."""

import numpy as np

from renderer import layout
from renderer.classify import Points, eye_places
from renderer.points import paint_points
from renderer.settings import RenderSettings
from scene.pose import View

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
    """((H, W, 3) float32, metres from its left to its right): +x to the right, -z to the top."""
    width, height = view.size
    place = eye_places(points, poses, np.eye(4))  # (3, N) world
    eye = view.world_from_eye.position
    centre, metres_per_pixel = fit(place[:, reason != 1], eye, view.size)
    pixel = np.stack([place[0] - np.float32(centre[0]), place[2] - np.float32(centre[1])])
    pixel = pixel / np.float32(metres_per_pixel) + np.float32([[width / 2], [height / 2]])
    picture = np.full((height, width, 3), BACKGROUND, np.float32)
    known = np.isfinite(pixel).all(axis=0)
    dot = 1 if min(view.size) < 400 else 2
    for names, size in (((1,), 1), ((3,), 1), ((0,), 1), ((2, 5, 6), dot), ((4,), dot + 1)):
        which = known & np.isin(reason, names)
        paint_points(picture, pixel, -place[1], reason, colors, which, size)  # higher covers
    lines = outline(view, place, reason, eye)
    draw_lines(picture, lines, eye, centre, metres_per_pixel, settings.max_distance)
    return picture, float(metres_per_pixel * width)


def fit(place: np.ndarray, eye: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, float]:
    """(centre (2,) world x and z, metres a pixel) that show nearly all places, and the eye."""
    flat = place[[0, 2]]
    flat = flat[:, np.isfinite(flat).all(axis=0)]
    corners = [eye[[0, 2]]]
    if flat.size:
        corners += list(np.percentile(flat, [0.5, 99.5], axis=1))  # a few stray far away
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    extent = np.maximum((high - low) * MARGIN, 1e-3)
    return (low + high) / 2, float(np.max(extent / np.array(size)))


def outline(view: View, place: np.ndarray, reason: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(4, 3) world: where the corners of the view are at the depth of the farthest splat drawn."""
    world_from_eye = view.world_from_eye.matrix()
    back = world_from_eye[:3, 2]
    drawn = place[:, reason == 0]
    depth = -(back @ (drawn - eye[:, None])) if drawn.size else np.ones(1)
    reach = max(float(np.percentile(depth, 99)) * 1.1, view.near)
    left, right, down, up = view.tangents
    corners = np.array([[left, up, -1], [right, up, -1], [right, down, -1], [left, down, -1]])
    return eye + reach * corners @ world_from_eye[:3, :3].T


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

    def on_map(world: np.ndarray) -> tuple[float, float]:
        at = (np.asarray(world)[[0, 2]] - centre) / metres_per_pixel + (width / 2, height / 2)
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
