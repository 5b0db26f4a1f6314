"""Photos of a corner with textured walls, traced here: poses are known, features are many."""

from pathlib import Path

import numpy as np
from PIL import Image

SIZE, FOCAL = (320, 240), 300.0  # pixels
WIDE = 4.0  # metres of a wall


def texture(seed: int, pixels: int = 512) -> np.ndarray:
    """(pixels, pixels, 3) uint8: noise of many sizes, as plaster and print have."""
    rng, out = np.random.default_rng(seed), np.zeros((pixels, pixels, 3))
    for step in (4, 8, 16, 32, 64):
        coarse = rng.uniform(-1, 1, (pixels // step, pixels // step, 3))
        grown = [Image.fromarray(coarse[..., i].astype(np.float32)).resize((pixels, pixels), 3)
                 for i in range(3)]  # fmt: skip
        out += np.stack([np.asarray(g) for g in grown], axis=2) * step**0.5
    out = (out - out.min()) / np.ptp(out)
    return np.round(out * 255).astype(np.uint8)


# axis that is fixed at 0, and the two that the texture lies on: floor, back wall, left wall
WALLS = [(1, 0, 2, texture(1)), (2, 0, 1, texture(2)), (0, 2, 1, texture(3))]


def camera(i: int, count: int) -> np.ndarray:
    """(4, 4) world from camera, OpenCV axes, +Y up, held level: an arc around the corner."""
    turn = np.radians(20 + 50 * i / max(count - 1, 1))
    eye = np.array([3.2 * np.sin(turn), 1.3 + 0.5 * np.sin(2.3 * i), 3.2 * np.cos(turn)])
    forward = np.array([0.5, 0.7, 0.5]) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    out = np.eye(4)
    out[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    out[:3, 3] = eye
    return out


def hits(world_from_camera: np.ndarray, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) metres where rays through pixels (N, 2) meet the first wall, and (N,) which wall."""
    flat = np.hstack([(xy - np.array(SIZE) / 2) / FOCAL, np.ones((len(xy), 1))])
    rays, eye = flat @ world_from_camera[:3, :3].T, world_from_camera[:3, 3]
    far = np.stack([-eye[axis] / rays[:, axis] for axis, *_ in WALLS], axis=1)
    far[far <= 0] = np.inf
    wall = far.argmin(axis=1)
    return eye + rays * far[np.arange(len(xy)), wall, None], wall


def photo(world_from_camera: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8, four rays a pixel."""
    across, down = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    total = np.zeros((SIZE[1] * SIZE[0], 3))
    for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
        xy = np.stack([across.ravel() + dx, down.ravel() + dy], axis=1)
        place, wall = hits(world_from_camera, xy)
        for number, (_, u, v, picture) in enumerate(WALLS):
            mine = wall == number
            at = np.stack([place[mine, u], place[mine, v]], axis=1) / WIDE * len(picture)
            column, row = np.clip(at.astype(int), 0, len(picture) - 1).T
            total[mine] += picture[row, column]
    return np.round(total / 4).astype(np.uint8).reshape(SIZE[1], SIZE[0], 3)


def write_photos(folder: Path, count: int) -> list[np.ndarray]:
    """PNGs 00.png, 01.png, ... ; gives the poses."""
    folder.mkdir(parents=True, exist_ok=True)
    poses = [camera(i, count) for i in range(count)]
    for i, pose in enumerate(poses):
        Image.fromarray(photo(pose)).save(folder / f"{i:02d}.png")
    return poses


def fitted(found: np.ndarray, true: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Scale, turn and shift with true = s R found + t in least squares (Umeyama 1991), and (N,)
    metres that is left."""
    a, b = found.mean(axis=0), true.mean(axis=0)
    u, size, v = np.linalg.svd((true - b).T @ (found - a) / len(found))
    flip = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    turn = u @ flip @ v
    scale = float(np.trace(np.diag(size) @ flip) / ((found - a) ** 2).sum(axis=1).mean())
    shift = b - scale * turn @ a
    left = np.linalg.norm(scale * found @ turn.T + shift - true, axis=1)
    return scale, turn, shift, left
