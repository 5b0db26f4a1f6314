"""A table with four boxes on it, visited twice: every change is known to the millimetre.

Flat splats on each face, a stop of colours and one of degrees, as folders that every command opens.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.splats.layers.layer_list import write_layer_list
from shapeshift.runtime_models.splats.operations.rotate_splats import rotate_splats
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.scene.change.similarity import Similarity

DC = 0.28209479177387814  # of spherical harmonics of degree 0
RANGE = (0.0, 100.0)  # °C
STOPS = (
    Stop("RGB", 0.0, "rgb"),
    Stop("Thermal", 1.0, "thermal", "ironbow", RANGE, "°C"),
)
SPACING_M = 0.01  # of splats
SQUARE_M = 0.05  # of the pattern that features are found in


@dataclass(frozen=True)
class Block:
    """An upright box."""

    centre: tuple[float, float, float]  # metres
    half: tuple[float, float, float]
    color: tuple[float, float, float]
    celsius: float = 20.0
    spot_c: float = 0.0  # added within 6 cm of the middle of its top


TABLE = Block((0.0, -0.02, 0.0), (0.6, 0.02, 0.5), (0.6, 0.55, 0.5))
RED = Block((-0.35, 0.08, 0.2), (0.07, 0.08, 0.05), (0.8, 0.15, 0.1))
GREEN = Block((0.3, 0.1, -0.2), (0.08, 0.1, 0.06), (0.15, 0.6, 0.2))
BLUE = Block((0.35, 0.06, 0.25), (0.06, 0.06, 0.06), (0.15, 0.25, 0.8))
TALL = Block((-0.3, 0.2, -0.25), (0.06, 0.2, 0.06), (0.7, 0.7, 0.7), 40.0)
WHITE = Block((0.0, 0.05, 0.3), (0.05, 0.05, 0.05), (0.9, 0.9, 0.85))
BEFORE = (TABLE, RED, GREEN, BLUE, TALL)
# Red is moved, blue is taken away, white is put there, green is 15 °C hotter, the tall one 12 °C
# colder, the table has a spot that is 30 °C hotter.
AFTER = (
    replace(TABLE, spot_c=30.0),
    replace(RED, centre=(-0.05, 0.08, -0.3)),
    replace(GREEN, celsius=35.0),
    replace(TALL, celsius=28.0),
    WHITE,
)
MOVED_M = float(np.linalg.norm(np.subtract(AFTER[1].centre, RED.centre)))


def pattern(points: np.ndarray) -> np.ndarray:
    """(n,) 0.6..1: squares of random brightness that stand in the world."""
    cell = np.floor(points / SQUARE_M + 0.5)
    mixed = np.sin(cell @ (127.1, 311.7, 74.7)) * 43758.5453
    return 0.6 + 0.4 * (mixed - np.floor(mixed))


def faces(block: Block, jitter_m: float, rng: np.random.Generator) -> list[tuple]:
    """(points (n, 3), axis) of each face that can be seen."""
    out = []
    half, centre = np.array(block.half), np.array(block.centre)
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        counts = [max(round(2 * half[i] / SPACING_M), 1) for i in others]
        steps = [(np.arange(n) + 0.5) / n * 2 - 1 for n in counts]
        grid = np.stack([g.ravel() for g in np.meshgrid(*steps)], axis=1)
        for side in (-1, 1):
            points = np.zeros((len(grid), 3))
            points[:, others] = grid * half[others]
            points[:, axis] = side * half[axis]
            out.append((points + centre + rng.normal(scale=jitter_m, size=points.shape), axis))
    return out


def splats_of(blocks: tuple[Block, ...], values: bool, seed: int = 0) -> PlainSplats:
    """All faces as splats a millimetre thick, with a millimetre of scatter by the seed."""
    rng = np.random.default_rng(seed)
    means, scales, colors = [], [], []
    for block in blocks:
        for points, axis in faces(block, 0.001, rng):
            size = np.full((len(points), 3), 0.75 * SPACING_M)
            size[:, axis] = 0.001
            local = points - block.centre
            top = np.linalg.norm(local - (0, block.half[1], 0), axis=1) <= 0.06
            celsius = block.celsius + block.spot_c * top
            share = np.repeat(((celsius - RANGE[0]) / (RANGE[1] - RANGE[0]))[:, None], 3, axis=1)
            painted = np.array(block.color) * pattern(local)[:, None]
            means.append(points)
            scales.append(size)
            colors.append(share if values else painted)
    mean, scale, color = (np.concatenate(parts) for parts in (means, scales, colors))
    count = len(mean)
    arrays = (
        mean, scale, np.tile([1.0, 0, 0, 0], (count, 1)), np.full(count, 0.99),
        (color[:, None] - 0.5) / DC,
    )  # fmt: skip
    return PlainSplats(*(a.astype(np.float32) for a in arrays))


def write_visit(
    folder: Path,
    blocks: tuple[Block, ...],
    seed: int = 0,
    world: Similarity | None = None,
    stops: tuple[Stop, ...] = STOPS,
) -> Path:
    """A visit as a folder that every command opens; world: where its capture has the table."""
    layers = []
    for stop in stops:
        splats = splats_of(blocks, stop.kind == "thermal", seed)
        if world is not None:
            splats = rotate_splats(splats, world.rotation)
            means = (splats.means * world.scale + world.shift).astype(np.float32)
            scales = splats.scales * np.float32(world.scale)
            splats = replace(splats, means=means, scales=scales)
        layers.append((stop, splats))
    write_layer_list(layers, folder)
    return folder
