"""A mask from a box and clicks on one photo, without a network.

Histograms of the colours inside and outside give a first guess, a random walk over the pixels
joins it along edges of the photo; repeated, as GrabCut does it with graph cuts (Rother 2004).
Good for compact things; long thin ones need a segmenter (docs/objects.md).
"""

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, label

from shapeshift.decomposition.masks.anchor_walk import conjugate_gradients
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt

MOST_SIDE = 256  # pixels of what is walked over: more cost time and gain nothing
MARGIN = 0.25  # of the box's longer side: what is looked at around it
BINS, BLUR = 12, 0.8  # of a channel's histogram; bins by which it is blurred
FLOOR = 1e-5  # share of a colour that was never seen
ROUNDS = 3
CONTRAST = 6.0  # an edge of so many times the mean squared difference is e times weaker
LEAST_WEIGHT = 1e-4
PRIOR = 0.02  # pull of the colours, against an edge of weight 1
SURE = 6.0  # log odds beyond which colours pull no harder
LEAST_PIXELS = 9  # fewer inside teach no colours
CORE = 0.3  # of the box's sides: half axes of the ellipse whose colours are the first guess
SPECK = 0.05  # of the largest part's pixels: smaller ones are left out
HOLE = 0.15  # of the mask's pixels: smaller ones that it encloses are filled
INSIDE, OUTSIDE, UNKNOWN = 1, 0, -1


@dataclass(frozen=True)
class PixelWalk:
    """A segmenter of two lines of linear algebra; photos of any number of channels."""

    name = "random walk over pixels"
    reads_text = False
    takes_boxes = True
    wants_click = False

    def encode(self, image: np.ndarray) -> np.ndarray:
        """image (H, W, C) uint8: the first three channels display sRGB, each other one its own."""
        return image

    def candidates(self, encoded: np.ndarray, prompt: Prompt) -> list[Candidate]:
        """One candidate, or none where the prompt says nothing of a place."""
        if prompt.mask is not None:
            prompt = with_box_of_mask(prompt)
        if prompt.box is None and not len(prompt.inside):
            return []
        left, top, right, bottom = region_of(prompt, encoded.shape)
        part = encoded[top:bottom, left:right]
        shrink = max(1.0, max(part.shape[:2]) / MOST_SIDE)
        size = tuple(max(round(n / shrink), 1) for n in part.shape[1::-1])
        small = np.stack([resized(part[..., c], size) for c in range(part.shape[2])], axis=2)
        seeds = seeds_of(moved(prompt, (left, top), np.divide(size, part.shape[1::-1])), small)
        share = walk(small.astype(np.float64) / 255, *seeds)
        mask = np.zeros(encoded.shape[:2], bool)
        found = resized(share.astype(np.float32), part.shape[1::-1]) > 0.5
        mask[top:bottom, left:right] = tidied(found)
        sure = float(np.abs(2 * share - 1)[share > 0.5].mean()) if (share > 0.5).any() else 0.0
        return [Candidate(mask, sure)]


def tidied(mask: np.ndarray) -> np.ndarray:
    """Without specks beside the largest part, and without holes: a face of the wall's colour."""
    parts, count = label(mask)
    if not count:
        return mask
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    kept = (sizes >= SPECK * sizes.max())[parts]
    holes, count = label(~kept)
    sizes = np.bincount(holes.ravel())
    sizes[0] = kept.sum()  # no hole
    return kept | (sizes < HOLE * kept.sum())[holes]


def with_box_of_mask(prompt: Prompt) -> Prompt:
    """About where the object is, as a box."""
    assert prompt.mask is not None
    rows, columns = np.nonzero(prompt.mask)
    if prompt.box is not None or not len(rows):
        return replace(prompt, mask=None)
    left, top, right, bottom = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    return replace(prompt, box=(float(left), float(top), float(right), float(bottom)), mask=None)


def region_of(prompt: Prompt, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of what is looked at: the box and what lies around it."""
    height, width = shape[:2]
    if prompt.box is None:
        return 0, 0, width, height
    left, top, right, bottom = prompt.box
    margin = max(MARGIN * max(right - left, bottom - top), 4)
    low = np.floor(np.clip([left - margin, top - margin], 0, [width - 1, height - 1]))
    high = np.ceil(np.clip([right + margin, bottom + margin], low + 1, [width, height]))
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def resized(plane: np.ndarray, size: tuple[int, ...]) -> np.ndarray:
    """(h, w) of a plane in `size` (width, height): means where it gets smaller, else bilinear."""
    if plane.shape == (size[1], size[0]):
        return plane
    smaller = size[0] < plane.shape[1]
    how = Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR
    return np.asarray(Image.fromarray(np.ascontiguousarray(plane)).resize((size[0], size[1]), how))


def moved(prompt: Prompt, corner: tuple[int, int], scale: np.ndarray) -> Prompt:
    """The prompt in the pixels of a part of the photo that begins at `corner`."""

    def places(points: np.ndarray) -> np.ndarray:
        return (np.reshape(points, (-1, 2)) - corner) * scale

    box = None
    if prompt.box is not None:
        (left, top), (right, bottom) = places(np.array(prompt.box))
        box = (left, top, right, bottom)
    return Prompt(box, places(prompt.inside), places(prompt.outside))


def seeds_of(prompt: Prompt, image: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """seeds (h, w) INSIDE, OUTSIDE, UNKNOWN, and bool (h, w): where the first colours inside and
    outside are taken from."""
    height, width = image.shape[:2]
    seeds = np.full((height, width), UNKNOWN)
    rows, columns = np.mgrid[:height, :width] + 0.5
    if prompt.box is not None:
        left, top, right, bottom = prompt.box
        within = (columns > left) & (columns < right) & (rows > top) & (rows < bottom)
        seeds[~within] = OUTSIDE
    for places, value in ((prompt.inside, INSIDE), (prompt.outside, OUTSIDE)):
        for x, y in places.astype(int):
            seeds[max(y - 1, 0) : max(y + 2, 0), max(x - 1, 0) : max(x + 2, 0)] = value
    inner = seeds == INSIDE
    if prompt.box is not None:
        left, top, right, bottom = prompt.box
        half = max((right - left) * CORE, 1.0), max((bottom - top) * CORE, 1.0)
        across, down = (
            (columns - (left + right) / 2) / half[0],
            (rows - (top + bottom) / 2) / half[1],
        )
        inner |= (across**2 + down**2 < 1) & (seeds != OUTSIDE)
    outer = seeds == OUTSIDE
    return seeds, inner, outer if outer.any() else ~inner


def walk(image: np.ndarray, seeds: np.ndarray, inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """(h, w) share of the inside of an image (h, w, C) 0..1."""
    edges = edges_of(image)
    share = inner.astype(float)
    for _ in range(ROUNDS):
        odds = color_odds(image, inner, outer)
        share = solve(edges, seeds, odds)
        inner = share > 0.5
        outer = ~inner
        if inner.sum() < LEAST_PIXELS or not outer.any():
            break
    return share


def color_odds(image: np.ndarray, inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """(h, w) log odds of a pixel's colours, inside over outside: of sRGB as a whole, and of each
    further channel, which are taken to be independent."""
    cells = np.minimum((image * BINS).astype(int), BINS - 1)
    groups = [cells[..., :3], *(cells[..., c : c + 1] for c in range(3, image.shape[2]))]
    total = np.zeros(image.shape[:2])
    for group in groups:
        each = tuple(np.moveaxis(group, 2, 0))
        index = np.asarray(np.ravel_multi_index(each, (BINS,) * group.shape[2]))
        total += np.log(
            shares_of(index, inner, group.shape[2]) / shares_of(index, outer, group.shape[2])
        )
    return total


def shares_of(index: np.ndarray, where: np.ndarray, channels: int) -> np.ndarray:
    """(h, w) how usual each pixel's colour is among those of `where`."""
    counts = np.bincount(index[where], minlength=BINS**channels).reshape((BINS,) * channels)
    smooth = gaussian_filter(counts.astype(float), BLUR)
    return (smooth / max(smooth.sum(), 1) + FLOOR).ravel()[index]


def edges_of(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights (h, w - 1) to the right and (h - 1, w) downwards: weak where colours differ."""
    across = ((image[:, 1:] - image[:, :-1]) ** 2).sum(2)
    down = ((image[1:] - image[:-1]) ** 2).sum(2)
    mean = (across.sum() + down.sum()) / max(across.size + down.size, 1)
    fall = CONTRAST / max(mean, 1e-9)
    return np.exp(-fall * across) + LEAST_WEIGHT, np.exp(-fall * down) + LEAST_WEIGHT


def solve(edges: tuple[np.ndarray, np.ndarray], seeds: np.ndarray, odds: np.ndarray) -> np.ndarray:
    """(h, w) share of the inside: the random walker with the colours as a prior (Grady 2005)."""
    across, down = edges
    shape, free = seeds.shape, seeds < 0
    prior = 1 / (1 + np.exp(-np.clip(odds, -SURE, SURE)))
    pull = PRIOR * np.abs(2 * prior - 1) + 1e-6
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
