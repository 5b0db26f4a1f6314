"""Style pictures drawn by this program: what the tests, the rows and the gallery are made with."""

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

GLASS = ((191, 31, 26), (242, 166, 26), (26, 77, 153), (26, 128, 89), (230, 217, 153),
         (89, 26, 102), (13, 31, 77))  # fmt: skip
NIGHT = ((240, 220, 120), (30, 70, 150), (60, 120, 190), (15, 35, 90), (140, 180, 210),
         (235, 170, 60))  # fmt: skip
INK = ((24, 22, 30), (60, 54, 60), (120, 108, 100))
PAPER = (238, 228, 208)


def stained_glass(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: cells of bright colours between dark leads."""
    rng = np.random.default_rng(seed)
    count = 140
    places = rng.random((count, 2)) * size
    color = np.array(GLASS)[rng.integers(len(GLASS), size=count)] / 255
    color = color * rng.uniform(0.8, 1.15, (count, 1))
    down, across = np.mgrid[:size, :size] + 0.5
    distance = np.hypot(across[..., None] - places[:, 0], down[..., None] - places[:, 1])
    nearest = np.argsort(distance, axis=2)[..., :2]
    first, second = np.moveaxis(np.take_along_axis(distance, nearest, 2), 2, 0)
    lead = np.clip((second - first) / (4 * size / 256), 0, 1)[..., None]
    grain = 0.85 + 0.15 * rng.random((size, size, 1))
    return np.clip(color[nearest[..., 0]] * lead * grain, 0, 1).astype(np.float32)


def swirl(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: short strokes of blue and gold that follow a swirl."""
    rng = np.random.default_rng(seed)
    image, unit = Image.new("RGB", (size, size), (20, 40, 90)), size / 256
    draw = ImageDraw.Draw(image)
    for _ in range(2600):
        x, y = rng.random(2) * 256
        turn = np.sin(x / 35) * 1.5 + np.cos(y / 28) * 1.8
        length = rng.uniform(6, 14)
        kind = int((np.sin(x / 50 + y / 60) + 1) / 2 * 3) + (rng.random() < 0.25) * 2
        shade = tuple(int(np.clip(c + rng.normal() * 18, 0, 255)) for c in NIGHT[kind % 6])
        ends = [x, y, x + length * np.cos(turn), y + length * np.sin(turn)]
        draw.line([unit * e for e in ends], fill=shade, width=round(unit * rng.integers(2, 5)))
    return np.asarray(image, np.float32) / 255


def ink_hatching(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: dark strokes on paper, dense in some places, crossed in others."""
    rng = np.random.default_rng(seed)
    image, unit = Image.new("RGB", (size, size), PAPER), size / 256
    draw = ImageDraw.Draw(image)
    for _ in range(1900):
        x, y = rng.random(2) * 256
        dark = (np.sin(x / 31 + 1) * np.cos(y / 43) + 1) / 2
        if rng.random() > dark:
            continue
        turn = 0.8 if rng.random() < 0.7 else -0.7
        length = rng.uniform(12, 34)
        ends = [x, y, x + length * np.cos(turn), y + length * np.sin(turn)]
        shade = INK[rng.integers(len(INK))]
        draw.line([unit * e for e in ends], fill=shade, width=max(round(unit * 1.4), 1))
    return np.asarray(image, np.float32) / 255


MADE_STYLES: dict[str, Callable[[int, int], np.ndarray]] = {
    "glass": stained_glass,
    "swirl": swirl,
    "ink": ink_hatching,
}
