"""Where a scene is cut: half-open boxes side by side in a frame turned to its smallest rectangle.

Cuts are vertical.  The outermost blocks reach to infinity; what lies far outside of where the
cameras are is no block's.
"""

import math
import re
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.blocks.block_model import MOST_BLOCKS
from shapeshift.runtime_models.blocks.read_blocks import BlockBox, turned

FAR = 3.0  # times the largest side of the box of all cameras: what is farther from it is far
HORIZONTAL = (0, 2)  # axes that are cut
DECIMALS = 3  # of degrees
ENDLESS = (math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class Cut:
    """Boxes in a turned frame."""

    turn_degrees: float
    boxes: tuple[BlockBox, ...]


@dataclass(frozen=True)
class Wanted:
    """What --blocks says: a number, a grid, or None and None: as many as it takes."""

    count: int | None = None
    grid: tuple[int, int] | None = None

    @staticmethod
    def of(text: str) -> "Wanted":
        """Raises ValueError, one sentence."""
        word = text.strip().lower()
        if word == "auto":
            return Wanted()
        grid = re.fullmatch(r"(\d{1,4})x(\d{1,4})", word)
        numbers = [int(n) for n in grid.groups()] if grid else []
        if not grid and re.fullmatch(r"\d{1,4}", word):
            numbers = [int(word)]
        count = math.prod(numbers) if numbers else 0
        if not 1 <= count < MOST_BLOCKS:
            raise ValueError(
                f"blocks is '{text:.20}'; auto, a number from 1 to {MOST_BLOCKS - 1} or a grid "
                "such as 4x2 is wanted."
            )
        return Wanted(grid=(numbers[0], numbers[1])) if grid else Wanted(count=count)


def far_away(places: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """(N,) bool of places (N, 3): farther than FAR times the largest side of the box of all cameras
    eyes (C, 3) from its middle, half of it each way.

    The largest side counts for all axes: cameras along a walk are all at one height.
    """
    low, high = eyes.min(axis=0), eyes.max(axis=0)
    half = FAR / 2 * float((high - low).max())
    if not half > 0:  # one camera, or all at one place: nothing says what is far
        return np.zeros(len(places), bool)
    return np.asarray((np.abs(places - (low + high) / 2) > half).any(axis=1))


def smallest_rectangle(places: np.ndarray) -> float:
    """Degrees, above -45 up to 45: about the vertical, of the smallest rectangle around places
    (N, 3) as seen from above, by the edges of their convex hull.
    """
    from scipy.spatial import ConvexHull, QhullError

    flat = np.unique(np.asarray(places, np.float64)[:, HORIZONTAL], axis=0)
    if len(flat) < 3:
        return 0.0
    try:
        corners = flat[ConvexHull(flat).vertices]
    except QhullError:  # all on one line
        way = flat[-1] - flat[0]
        return folded_degrees(math.degrees(math.atan2(-way[1], way[0])))
    edges = np.roll(corners, -1, axis=0) - corners
    angles = [folded_degrees(math.degrees(math.atan2(-z, x))) for x, z in edges]
    return min(sorted({0.0, *angles}, key=abs), key=lambda a: rectangle_area(corners, a))


def folded_degrees(degrees: float) -> float:
    """The same rectangle's angle above -45 up to 45, rounded as blocks.json keeps it."""
    found = round((degrees + 45) % 90 - 45, DECIMALS)
    return (45.0 if found <= -45 else found) + 0.0  # never -0


def rectangle_area(corners: np.ndarray, degrees: float) -> float:
    """Square metres of the rectangle turned so far around places (N, 2) from above."""
    level = np.stack([corners[:, 0], np.zeros(len(corners)), corners[:, 1]], axis=1)
    return float(np.prod(np.ptp(turned(level, degrees)[:, HORIZONTAL], axis=0)))


def cut_whole(anchors: np.ndarray, wanted: Wanted, expected: np.ndarray, most: int) -> Cut:
    """The blocks of anchors (A, 3), of which none is far.

    expected (P, 3) metres: where as many anchors are expected; without a number of blocks they are
    cut until none expects more than `most`.
    """
    degrees = smallest_rectangle(anchors)
    if wanted.grid is not None:
        return Cut(degrees, grid_boxes(turned(anchors, degrees), wanted.grid))
    if wanted.count is not None:
        return Cut(degrees, halved(turned(anchors, degrees), wanted.count, 0))
    return Cut(degrees, halved(turned(expected, degrees), MOST_BLOCKS - 1, most))


def halved(places: np.ndarray, count: int, most: int) -> tuple[BlockBox, ...]:
    """The fullest box is cut across its longer side at the median of its places (P, 3), until there
    are `count`, or none has more than `most`, or none can be cut any more.
    """
    parts = [(BlockBox(tuple(-v for v in ENDLESS), ENDLESS), places)]  # type: ignore[arg-type]
    whole: list[BlockBox] = []  # that cannot be cut
    while parts and len(parts) + len(whole) < count:
        parts.sort(key=lambda part: len(part[1]))
        box, inside = parts.pop()
        if len(inside) <= most:
            parts.append((box, inside))
            break
        halves = halve(box, inside)
        if halves is None:
            whole.append(box)
        else:
            parts += halves
    found = [*whole, *(box for box, _ in parts)]
    return tuple(sorted(found, key=lambda box: (box.low[0], box.low[2])))


def halve(box: BlockBox, places: np.ndarray) -> list[tuple[BlockBox, np.ndarray]] | None:
    """Two boxes with their places; None where these all stand at one place."""
    if len(places) < 2:
        return None
    axis = max(HORIZONTAL, key=lambda a: float(np.ptp(places[:, a])))
    along = places[:, axis]
    at = float(np.median(along))
    if not along.min() < at:
        above = along[along > at]
        if not len(above):
            return None
        at = float(above.min())
    before, after = split(box, axis, at)
    return [(before, places[along < at]), (after, places[along >= at])]


def split(box: BlockBox, axis: int, at: float) -> tuple[BlockBox, BlockBox]:
    high, low = list(box.high), list(box.low)
    high[axis] = low[axis] = at
    return BlockBox(box.low, tuple(high)), BlockBox(tuple(low), box.high)  # type: ignore[arg-type]


def grid_boxes(places: np.ndarray, grid: tuple[int, int]) -> tuple[BlockBox, ...]:
    """So many blocks along the longer side of places (P, 3), so many across each: with equally many
    places in all, as far as places differ.
    """
    longer, shorter = HORIZONTAL
    if np.ptp(places[:, longer]) < np.ptp(places[:, shorter]):
        longer, shorter = shorter, longer
    endless = BlockBox(tuple(-v for v in ENDLESS), ENDLESS)  # type: ignore[arg-type]
    found: list[BlockBox] = []
    for column, inside in by_quantiles(endless, places, longer, grid[0]):
        found += [box for box, _ in by_quantiles(column, inside, shorter, grid[1])]
    return tuple(found)


def by_quantiles(
    box: BlockBox, places: np.ndarray, axis: int, count: int
) -> list[tuple[BlockBox, np.ndarray]]:
    """`count` boxes along an axis, or fewer where places do not differ enough."""
    found, rest, inside = [], box, places
    shares = np.arange(1, count) / count
    edges = np.unique(np.quantile(places[:, axis], shares)) if len(places) else np.zeros(0)
    for at in edges.tolist():
        along = inside[:, axis]
        if not (along < at).any():
            continue
        before, rest = split(rest, axis, at)
        found.append((before, inside[along < at]))
        inside = inside[along >= at]
    return [*found, (rest, inside)]
