"""Masks from boxes and clicks on one photo, without a network.

Histograms of the colours inside and outside give a first guess, a random walk over the pixels
joins it along edges of the photo; repeated, as GrabCut does it with graph cuts (Rother 2004).
What is marked in one photo is decided together.  Long thin things need a segmenter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from shapeshift.decomposition.masks.anchor_click import best_cut
from shapeshift.decomposition.masks.pixel_grid import (
    INSIDE,
    OUTSIDE,
    UNKNOWN,
    Edges,
    box_in,
    box_slices,
    cells_of,
    clicked,
    edges_of,
    graph_of,
    is_level,
    resized,
    shares_of,
    solve,
)
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt

MOST_SIDE = 256  # pixels of what is walked over: more cost time and gain nothing
MARGIN = 0.25  # of the box's longer side: what is looked at around it
ROUNDS = 3
PRIOR = 0.02  # pull of the colours, against an edge of weight 1
SURE = 6.0  # log odds beyond which colours pull no harder
MIDDLE = 0.03  # pull of the middle of the smaller box, where two claim a pixel
LEAST_PIXELS = 9  # fewer inside teach no colours
CORE = 0.3  # of the box's sides: half axes of the ellipse whose colours are the first guess
UNLIKE = 1.0  # log odds of a colour in the box against around it, from which it is the object's
ENOUGH = 0.1  # of the box's pixels: fewer of such colours are no first guess
LOST = 1e-3  # of an edge: the chance that a walk to a click is lost on the way
CLICK = 0.1  # pull of a click where no walk is lost, against an edge of weight 1
MOST, ROOM = 0.3, 0.25  # part of the photo that a click may mean; of its longer side around it
SPECK = 0.05  # of the largest part's pixels: smaller ones are left out
HOLE = 0.15  # of the mask's pixels: smaller ones that it encloses may be filled
STRANGE = -1.5  # mean log odds of a hole's colours, below which it shows what is behind


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
        found = walk_together(encoded, [prompt])[0]
        return [] if found is None else [found]


@dataclass
class WalkArea:
    """What is walked over for one prompt: its box and what lies around it, made small."""

    region: tuple[int, int, int, int]  # left, top, right, bottom: pixels of the photo
    cells: list[tuple[np.ndarray, int]]  # of each histogram (h, w), and its channels
    edges: Edges
    seeds: np.ndarray  # (h, w) int8
    core: np.ndarray  # (h, w) bool: in the box's middle, or clicked at
    clicks: np.ndarray  # (h, w) -1 to 1: how surely a walk meets a click beside it, or on it
    inner: np.ndarray  # (h, w) bool: whose colours are the object's
    outer: np.ndarray  # (h, w) bool: whose colours are not
    odds: np.ndarray  # (h, w) log odds of the colours
    share: np.ndarray  # (h, w) 0 to 1 of the object

    def of_photo(self, plane: np.ndarray) -> np.ndarray:
        """(h, w) bool: of a plane (H, W) bool of the photo."""
        left, top, right, bottom = self.region
        here = plane[top:bottom, left:right].astype(np.float32)
        return resized(here, self.seeds.shape[::-1]) > 0.5

    def in_photo(self, plane: np.ndarray) -> np.ndarray:
        """A plane (h, w) in the pixels of the photo's region."""
        left, top, right, bottom = self.region
        return resized(plane.astype(np.float32), (right - left, bottom - top))


def walk_together(
    image: np.ndarray,
    prompts: Sequence[Prompt],
    heights: Sequence[np.ndarray | None] | None = None,
    ways: np.ndarray | None = None,
) -> list[Candidate | None]:
    """A mask a prompt, none of which overlap; None where a prompt says nothing of a place.

    image (H, W, C) uint8.  heights: of each prompt (H, W) uint8, how high what is seen is over what
    the object stands on; ways: of ways_of().  The order of the prompts changes nothing.
    """
    heights = heights or [None] * len(prompts)
    boxed = [with_box_of_mask(prompt) for prompt in prompts]
    known = [with_box_of_clicks(image, p, boxed[:k] + boxed[k + 1 :], heights[k])
             for k, p in enumerate(boxed)]  # fmt: skip
    # The smallest box first: what lies within another is the more exactly said.
    placed = [k for k, p in enumerate(known) if p.box is not None]
    order = sorted(placed, key=lambda k: rank(known[k]))
    parts = [
        part_of(image, known[k], [known[j] for j in order if j != k], heights[k]) for k in order
    ]
    owner = owners(parts, [part.core for part in parts], image.shape[:2])
    for done in range(ROUNDS):
        for k, part in enumerate(parts):
            # At first the middles of smaller boxes alone are known to be another's.
            theirs = (owner >= 0) & (owner != k if done else owner < k)
            learn(part, part.of_photo(theirs))
        owner = owners(parts, [part.share > 0.5 for part in parts], image.shape[:2])
        for k, part in enumerate(parts):
            theirs = part.of_photo((owner >= 0) & (owner != k))
            part.inner = (part.share > 0.5) & ~theirs
            part.outer = ~part.inner
    found: list[Candidate | None] = [None] * len(prompts)
    for k, (at, part) in enumerate(zip(order, parts, strict=True)):
        found[at] = candidate_of(part, k, owner, ways)
    return found


def rank(prompt: Prompt) -> tuple:
    """By which prompts are sorted: their boxes' areas, then all that they say."""
    box = prompt.box or (0.0, 0.0, np.inf, np.inf)
    clicks = [*prompt.inside.ravel().tolist(), *prompt.outside.ravel().tolist()]
    return (box[2] - box[0]) * (box[3] - box[1]), box, clicks


def candidate_of(
    part: WalkArea, number: int, owner: np.ndarray, ways: np.ndarray | None
) -> Candidate:
    left, top, right, bottom = part.region
    here = owner[top:bottom, left:right]
    mask = np.zeros(owner.shape, bool)
    odds, seeds = part.in_photo(part.odds), part.in_photo(part.seeds == INSIDE) > 0.5
    barred = ((here >= 0) & (here != number)) | (part.in_photo(part.seeds == OUTSIDE) > 0)
    away = None if ways is None else ways[top:bottom, left:right]
    mask[top:bottom, left:right] = tidied(here == number, odds, barred, seeds, away)
    sure = part.share[part.share > 0.5]
    return Candidate(mask, float(np.abs(2 * sure - 1).mean()) if len(sure) else 0.0)


def tidied(
    mask: np.ndarray,
    odds: np.ndarray,
    barred: np.ndarray,
    wanted: np.ndarray,
    ways: np.ndarray | None = None,
) -> np.ndarray:
    """Without specks beside the largest part, and without holes: a light on it, a label.

    A hole stays whose colours are those around the object (odds (h, w)), unless it is level with
    its rim (ways (h, w)): a handle shows the table, eyes are the face's; and one that has a place
    of `barred`.  A speck with a place of `wanted` stays.
    """
    parts, count = label(mask)
    if not count:
        return mask
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    stays = (sizes >= SPECK * sizes.max()) | (np.bincount(parts.ravel(), wanted.ravel()) > 0)
    stays[0] = False
    kept = stays[parts]
    holes, count = label(~kept)
    flat = holes.ravel()
    sizes = np.bincount(flat)
    sizes[0] = kept.sum()  # no hole
    like = np.bincount(flat, odds.ravel()) / np.maximum(np.bincount(flat), 1) > STRANGE
    free = np.bincount(flat, barred.ravel()) == 0
    small = (sizes < HOLE * kept.sum()) & free
    if ways is not None:
        for hole in np.flatnonzero(small & ~like):
            like[hole] = is_level(holes == hole, kept, ways)
    return kept | (small & like)[holes]


def owners(parts: list[WalkArea], claims: list[np.ndarray], shape: tuple[int, int]) -> np.ndarray:
    """(H, W) int16: which part each pixel of the photo belongs to, -1 none.

    Where two claim a pixel, a walk between what each of them alone claims decides.
    """
    owner = np.full(shape, -1, np.int16)
    planes = []
    for k, (part, claim) in enumerate(zip(parts, claims, strict=True)):
        left, top, right, bottom = part.region
        mine = np.zeros(shape, bool)
        mine[top:bottom, left:right] = part.in_photo(claim) > 0.5
        for j, other in enumerate(planes):
            both = mine & other & (owner == j)
            if both.any():
                lost = both & ~settled(parts[j], part, other, mine)
                owner[lost] = -1
        owner[mine & (owner < 0)] = k
        planes.append(mine)
    return owner


def settled(part: WalkArea, other: WalkArea, mine: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """(H, W) bool: what stays the smaller part's of the pixels that it and another claim."""
    one, two = part.of_photo(mine), part.of_photo(theirs)
    seeds = np.full(one.shape, UNKNOWN, np.int8)
    seeds[two & ~one] = OUTSIDE
    seeds[one & ~two] = INSIDE
    seeds[(part.seeds == OUTSIDE) & two] = OUTSIDE
    seeds[(part.seeds == INSIDE) & one] = INSIDE
    left, top, right, bottom = part.region
    out = np.zeros(mine.shape, bool)
    if not (seeds == OUTSIDE).any():
        return mine & theirs
    within, (across, down) = one | two, part.edges
    edges = across * (within[:, 1:] & within[:, :-1]), down * (within[1:] & within[:-1])
    plane = np.zeros(mine.shape, np.float32)
    plane[box_slices(other.region)] = other.in_photo(other.odds)
    theirs_here = resized(plane[box_slices(part.region)], one.shape[::-1])
    prior = 1 / (1 + np.exp(-np.clip(part.odds - theirs_here, -SURE, SURE)))
    pull = PRIOR * np.abs(2 * prior - 1) + 1e-6
    middle = MIDDLE * part.core
    share = solve(edges, seeds, (pull * prior + middle) / (pull + middle), pull + middle)
    out[top:bottom, left:right] = part.in_photo(share) > 0.5
    return out & mine & theirs


def with_box_of_mask(prompt: Prompt) -> Prompt:
    """About where the object is, as a box."""
    if prompt.mask is None:
        return prompt
    rows, columns = np.nonzero(prompt.mask)
    if prompt.box is not None or not len(rows):
        return replace(prompt, mask=None)
    left, top, right, bottom = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    return replace(prompt, box=(float(left), float(top), float(right), float(bottom)), mask=None)


def with_box_of_clicks(
    image: np.ndarray, prompt: Prompt, others: Sequence[Prompt], height: np.ndarray | None = None
) -> Prompt:
    """With a box around what clicks alone mean: of the sets about them that a walk over the photo
    comes by most often, the one that is cut off best.
    """
    if prompt.box is not None or not len(prompt.inside):
        return prompt
    part = part_of(image, prompt, others, height)
    scale = np.divide(part.seeds.shape[::-1], image.shape[1::-1])
    seeds = part.seeds.copy()
    for other in others:  # its middle is no part of this
        middle = seeds_of(moved(other, (0, 0), scale), seeds.shape)[1]
        seeds[middle & (seeds != INSIDE)] = OUTSIDE
    nothing = np.zeros(seeds.shape)
    visits = solve(part.edges, seeds, nothing, np.full(seeds.shape, LOST))
    visits[seeds == OUTSIDE] = -1
    order = np.argsort(-visits.ravel(), kind="stable")[: int((seeds != OUTSIDE).sum())]
    weights = graph_of(part.edges)
    least = int((seeds == INSIDE).sum())
    count = best_cut(
        weights, np.asarray(weights.sum(axis=1)).ravel(), order, least, int(MOST * seeds.size)
    )
    rows, columns = np.divmod(order[:count], seeds.shape[1])
    low = np.array([columns.min(), rows.min()]) / scale
    high = np.array([columns.max() + 1, rows.max() + 1]) / scale
    room = ROOM * (high - low).max()
    low, high = np.maximum(low - room, 0), np.minimum(high + room, image.shape[1::-1])
    meant = np.zeros(seeds.shape, np.float32)
    meant[rows, columns] = 1
    whole = resized(meant, image.shape[1::-1]) > 0.5
    return replace(prompt, box=(*map(float, low), *map(float, high)), mask=whole)


def region_of(prompt: Prompt, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of what is looked at: the box, what lies around it, and clicks on
    the object.
    """
    height, width = shape[:2]
    if prompt.box is None:
        return 0, 0, width, height
    corners = np.concatenate([np.reshape(prompt.box, (2, 2)), prompt.inside])
    (left, top), (right, bottom) = corners.min(0), corners.max(0)
    margin = max(MARGIN * max(right - left, bottom - top), 4)
    low = np.floor(np.clip([left - margin, top - margin], 0, [width - 1, height - 1]))
    high = np.ceil(np.clip([right + margin, bottom + margin], low + 1, [width, height]))
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def moved(prompt: Prompt, corner: tuple[int, int], scale: np.ndarray) -> Prompt:
    """The prompt in the pixels of a part of the photo that begins at `corner`."""

    def places(points: np.ndarray) -> np.ndarray:
        return (np.reshape(points, (-1, 2)) - corner) * scale

    box = None
    if prompt.box is not None:
        (left, top), (right, bottom) = places(np.array(prompt.box))
        box = (left, top, right, bottom)
    return Prompt(box, places(prompt.inside), places(prompt.outside))


def part_of(
    image: np.ndarray, prompt: Prompt, others: Sequence[Prompt], height: np.ndarray | None = None
) -> WalkArea:
    """The part of a photo (H, W, C) uint8 that is walked over for a prompt, beside others."""
    left, top, right, bottom = region = region_of(prompt, image.shape)
    here = image[top:bottom, left:right]
    shrink = max(1.0, max(here.shape[:2]) / MOST_SIDE)
    size = tuple(max(round(n / shrink), 1) for n in here.shape[1::-1])
    small = np.stack([resized(here[..., c], size) for c in range(here.shape[2])], axis=2)
    scale = np.divide(size, here.shape[1::-1])
    meant, prompt = prompt.mask, moved(prompt, (left, top), scale)
    edges = edges_of(small.astype(np.float64) / 255)
    if height is not None:
        low = resized(height[top:bottom, left:right], size)
        small = np.concatenate([small, low[..., None]], axis=2)
    beside = [moved(other, (left, top), scale) for other in others]
    prompt = replace(prompt, outside=np.concatenate([prompt.outside, *(o.inside for o in beside)]))
    seeds, core = seeds_of(prompt, small.shape[:2])
    clicks = np.zeros(seeds.shape)
    if len(prompt.inside) or len(prompt.outside):
        half = np.full(seeds.shape, 0.5)
        clicks = 2 * solve(edges, clicked(prompt, seeds.shape), half, np.full_like(half, LOST)) - 1
    if meant is not None:
        core = resized(meant[top:bottom, left:right].astype(np.float32), size) > 0.5
    core = core & ~(clicks < -0.5) & (seeds != OUTSIDE)
    outer = seeds == OUTSIDE
    for other in beside:  # what lies in its box may be of this one's colours
        if other.box is not None and (outer & ~box_in(other.box, outer.shape)).any():
            outer &= ~box_in(other.box, outer.shape)
    part = WalkArea(
        region, cells_of(small), edges, seeds, core, clicks, core, outer if outer.any() else ~core,
        clicks, clicks,
    )  # fmt: skip
    inside = (seeds != OUTSIDE) & ~(clicks < -0.5)
    if meant is None and outer.any() and inside.any():
        unlike = inside & (color_odds(part, inside, outer) > UNLIKE)
        if unlike.sum() >= ENOUGH * inside.sum():
            for other in beside:  # may be the other's: its middle alone says more of this one
                if other.box is not None:
                    unlike &= ~box_in(other.box, outer.shape)
            part.inner = unlike | core
    part.inner = part.inner | (clicks > 0.5)
    part.outer = part.outer | (clicks < -0.5)
    return part


def seeds_of(prompt: Prompt, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """seeds (h, w) INSIDE, OUTSIDE, UNKNOWN, and bool (h, w): the box's middle and the clicks."""
    seeds = clicked(prompt, shape)
    core = seeds == INSIDE
    if prompt.box is not None:
        seeds[~box_in(prompt.box, shape) & (seeds != INSIDE)] = OUTSIDE
        rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
        left, top, right, bottom = prompt.box
        half = max((right - left) * CORE, 1.0), max((bottom - top) * CORE, 1.0)
        across = (columns - (left + right) / 2) / half[0]
        down = (rows - (top + bottom) / 2) / half[1]
        core |= (across**2 + down**2 < 1) & (seeds != OUTSIDE)
    return seeds, core


def learn(part: WalkArea, others: np.ndarray) -> None:
    """One round of a part: colours inside and outside, and the walk that they pull.

    others (h, w) bool: what belongs to other objects.
    """
    inner = part.inner & ~others
    if inner.sum() < LEAST_PIXELS:
        inner = part.inner
    outer = (part.outer | others) & ~inner
    if inner.sum() < LEAST_PIXELS or not outer.any():
        if not part.share.any():
            part.share = inner.astype(float)
        return
    part.odds = color_odds(part, inner, outer)
    prior = 1 / (1 + np.exp(-np.clip(part.odds, -SURE, SURE)))
    sure = np.abs(part.clicks)
    pull = PRIOR * np.abs(2 * prior - 1) * (1 - sure) + 1e-6
    more = CLICK * sure
    part.share = solve(
        part.edges, part.seeds, (pull * prior + more * (part.clicks > 0)) / (pull + more),
        pull + more,
    )  # fmt: skip


def color_odds(part: WalkArea, inner: np.ndarray, outer: np.ndarray) -> np.ndarray:
    """(h, w) log odds of a pixel's colours, inside over outside."""
    total = np.zeros(inner.shape)
    for index, channels in part.cells:
        ratio = shares_of(index, inner, channels) / shares_of(index, outer, channels)
        total += np.log(ratio)
    return total
