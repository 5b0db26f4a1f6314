"""Splats as coloured dots in a picture, the nearest on top."""

import numpy as np

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
