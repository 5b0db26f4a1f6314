"""The pixels of a picture: their colours counted, and a random walk over them (Grady 2005)."""

import numpy as np
from PIL import Image
from scipy import sparse
from scipy.ndimage import binary_dilation, gaussian_filter

from shapeshift.decomposition.masks.anchor_walk import conjugate_gradients
from shapeshift.decomposition.masks.segmenter import Prompt

CONTRAST = 6.0  # an edge of so many times the mean squared difference is e times weaker
LEAST_WEIGHT = 1e-4
BINS, BLUR = 12, 0.8  # of a channel's histogram; bins by which it is blurred
LEVEL = 0.5  # of a hole's width: as far behind its rim it is a part of the object, of any colour
RIM = 2  # pixels around a hole
FLOOR = 1e-5  # share of a colour that was never seen
INSIDE, OUTSIDE, UNKNOWN = 1, 0, -1
Edges = tuple[np.ndarray, np.ndarray]  # weights (h, w - 1) to the right, (h - 1, w) downwards


def resized(plane: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """(h, w) of a plane in `size` (width, height): means where it gets smaller, else bilinear."""
    if plane.shape == (size[1], size[0]):
        return plane
    smaller = size[0] < plane.shape[1]
    how = Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR
    return np.asarray(Image.fromarray(np.ascontiguousarray(plane)).resize((size[0], size[1]), how))


def box_in(box: tuple[float, float, float, float], shape: tuple[int, ...]) -> np.ndarray:
    """(h, w) bool: pixels whose centres lie in it."""
    rows, columns = (np.arange(n) + 0.5 for n in shape)
    left, top, right, bottom = box
    return ((rows > top) & (rows < bottom))[:, None] & (columns > left) & (columns < right)


def edges_of(image: np.ndarray) -> Edges:
    """Weights to the right and downwards of an image (h, w, C) 0..1: weak where colours differ."""
    across = ((image[:, 1:] - image[:, :-1]) ** 2).sum(2)
    down = ((image[1:] - image[:-1]) ** 2).sum(2)
    mean = (across.sum() + down.sum()) / max(across.size + down.size, 1)
    fall = CONTRAST / max(mean, 1e-9)
    return np.exp(-fall * across) + LEAST_WEIGHT, np.exp(-fall * down) + LEAST_WEIGHT


def graph_of(edges: Edges) -> sparse.csr_array:
    """(n, n) symmetric weights between pixels, in the order of their rows."""
    across, down = edges
    height, width = len(across), down.shape[1]
    number = np.arange(height * width).reshape(height, width)
    ends = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    one, other = (np.concatenate([pair[k].ravel() for pair in ends]) for k in (0, 1))
    weight = np.concatenate([across.ravel(), down.ravel()])
    rows, columns = np.concatenate([one, other]), np.concatenate([other, one])
    return sparse.csr_array((np.tile(weight, 2), (rows, columns)), shape=(number.size,) * 2)


def solve(edges: Edges, seeds: np.ndarray, prior: np.ndarray, pull: np.ndarray) -> np.ndarray:
    """(h, w) share of the inside: the random walker, pulled to `prior` (h, w) 0..1 by `pull` (h, w)
    against an edge of weight 1 (Grady 2005).
    """
    across, down = edges
    shape, free = seeds.shape, seeds < 0
    degree = pull.copy()
    degree[:, 1:] += across
    degree[:, :-1] += across
    degree[1:] += down
    degree[:-1] += down

    def neighbours(x: np.ndarray) -> np.ndarray:
        out = np.zeros(shape)
        out[:, 1:] += across * x[:, :-1]
        out[:, :-1] += across * x[:, 1:]
        out[1:] += down * x[:-1]
        out[:-1] += down * x[1:]
        return out

    def multiply(x: np.ndarray) -> np.ndarray:
        plane = x.reshape(shape)
        return np.where(free, degree * plane - neighbours(plane), plane).reshape(-1, 1)

    known = (seeds == INSIDE).astype(float)
    right = np.where(free, pull * prior + neighbours(known), 0.0).reshape(-1, 1)
    guess = np.where(free, prior, 0.0).reshape(-1, 1)
    diagonal = np.where(free, degree, 1.0).ravel()
    found = conjugate_gradients(multiply, diagonal, right, guess, 1e-3, 200).reshape(shape)
    return np.where(free, np.clip(found, 0, 1), known)


def cells_of(image: np.ndarray) -> list[tuple[np.ndarray, int]]:
    """Of an image (h, w, C) uint8 the histogram cell (h, w) of each pixel, and how many channels
    that histogram has: of sRGB as a whole, and of each further channel, which are taken to be
    independent.
    """
    cells = np.minimum(image / 255 * BINS, BINS - 1).astype(int)
    groups = [cells[..., :3], *(cells[..., c : c + 1] for c in range(3, image.shape[2]))]
    found = []
    for group in groups:
        each = tuple(np.moveaxis(group, 2, 0))
        found.append((np.asarray(np.ravel_multi_index(each, (BINS,) * group.shape[2])), len(each)))
    return found


def shares_of(index: np.ndarray, where: np.ndarray, channels: int) -> np.ndarray:
    """(h, w) how usual each pixel's colour is among those of `where`."""
    counts = np.bincount(index[where], minlength=BINS**channels).reshape((BINS,) * channels)
    smooth = gaussian_filter(counts.astype(float), BLUR)
    return (smooth / max(smooth.sum(), 1) + FLOOR).ravel()[index]


def clicked(prompt: Prompt, shape: tuple[int, ...]) -> np.ndarray:
    """seeds (h, w) int8: INSIDE and OUTSIDE where clicks are, a pixel around each."""
    seeds = np.full(shape, UNKNOWN, np.int8)
    for places, value in ((prompt.inside, INSIDE), (prompt.outside, OUTSIDE)):
        for x, y in np.floor(places).astype(int):
            seeds[max(y - 1, 0) : max(y + 2, 0), max(x - 1, 0) : max(x + 2, 0)] = value
    return seeds


def is_level(hole: np.ndarray, kept: np.ndarray, ways: np.ndarray) -> bool:
    """Whether a hole (h, w) of a mask lies no farther behind its rim than a dent of its width."""
    near = box_slices_of(hole, RIM)
    hole, kept, ways = hole[near], kept[near], ways[near]
    rim = ways[binary_dilation(hole, iterations=RIM) & kept]
    rim, inner = rim[np.isfinite(rim)], ways[hole]
    if not (len(rim) and np.isfinite(inner).mean() > 0.5):
        return False
    behind = np.nanmedian(inner) - np.median(rim)
    return bool(behind <= LEVEL * np.sqrt(hole.sum()))


def box_slices_of(plane: np.ndarray, margin: int) -> tuple[slice, slice]:
    """The rows and columns of a plane (h, w) bool that is not empty, and so many around."""
    ends = (np.flatnonzero(plane.any(axis))[[0, -1]] for axis in (1, 0))
    rows, columns = (slice(max(low - margin, 0), high + margin + 1) for low, high in ends)
    return rows, columns


def box_slices(region: tuple[int, int, int, int]) -> tuple[slice, slice]:
    left, top, right, bottom = region
    return slice(top, bottom), slice(left, right)
