"""Completion, thing by thing: the background under everything that is taken out of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapeshift.decomposition.completion.plane import (
    ABOVE,
    BELOW,
    AnchorLooks,
    Footprint,
    Plane,
    PlaneCells,
    Refused,
    cells_of,
    footprint_of,
    hidden_inside,
    looks_of,
    support_plane,
)
from shapeshift.decomposition.completion.verify import (
    Cells,
    ModelPictures,
    PhotoView,
    Verdict,
    verify,
)
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import AnchorModel

# A clone stamp in anchor space: the place under a thing filled from beside it.
#
# Anchors of a free place of the same plane are copied with their features and moved, so that the
# patch follows the slider as its surroundings do.  Where no place is as large as the hole, several
# patches fill it.

WHOLE = 0.95  # of a patch's cells that must be good for it to count as one that fits
LEAST_RING = 0.4  # of the ring's cells that must be known beside a patch, too
MOST_PATCHES = 8
LEAST_LEFT = 0.03  # of the hole's cells; so few are left open
LEAST_PATCH = 4  # cells
FEWEST_CELLS = 2  # of a hole
WORTH = 1.5  # shares of the hole that a patch may be smaller for one display unit of seam
EVEN = 16  # anchors whose mean a copy without a texture of its own has
FARTHER = 2e-3  # display units of seam that a place one cell farther away must be better by


@dataclass(frozen=True)
class Stamp:
    rows: np.ndarray  # (m,) anchors that are copied
    shifts: np.ndarray  # (m, 3) metres that the copies are moved
    dropped: np.ndarray  # (A,) bool: what lay in the hole
    patches: int
    cells: int  # of the hole
    filled: int  # of those
    cell_m: float
    footprint: np.ndarray  # (filled, 3) metres: the middles of filled cells, on the plane
    around: np.ndarray  # (n, 3) metres: the same of those around the hole


def find_stamp(
    looks: AnchorLooks,
    labels: np.ndarray,
    label: int,
    plane: Plane,
    evidence: np.ndarray | None = None,
    shadows: bool = False,
    core: bool = True,
) -> Stamp | Refused:
    """What fills the plane under a thing; labels (A,), evidence (A,) pixels of background or None.

    core: all of where it stood is made anew, where photos show something of it, too.  A text says
    why nothing is filled.
    """
    grid = cells_of(looks, labels, plane, label)
    foot = footprint_of(looks, labels, label, grid, evidence, shadows, core)
    cells = int(foot.hole.sum())
    if cells < FEWEST_CELLS:
        return "it hides nothing of the plane"
    patches = find_patches(grid, foot)
    if not patches:
        return f"no free place of the plane is like that under it ({cells} cells)"
    rows, shifts = [], []
    axes = plane.axes()
    for chosen, step in patches:
        source = np.zeros(grid.shape, bool)
        source[tuple((np.argwhere(chosen) + step).T)] = True
        here = np.flatnonzero(grid.on & grid.rows_in(source))
        rows.append(here)
        shifts.append(np.tile(-(step @ axes) * grid.cell_m, (len(here), 1)))
    filled = np.any([chosen for chosen, _ in patches], axis=0)
    slab = (grid.height > -BELOW * looks.spacing_m) & (grid.height < ABOVE * looks.spacing_m)
    slab = np.where(grid.rows_in(foot.shade), grid.on, slab)  # there photos show what is beside it
    dropped = (labels == 0) & grid.rows_in(filled) & slab
    middles = [
        ((np.argwhere(chosen) + 0.5) * grid.cell_m + grid.low) @ axes + plane.offset * plane.normal
        for chosen in (filled, foot.ring)
    ]
    return Stamp(
        np.concatenate(rows), np.concatenate(shifts), dropped, len(patches), cells,
        int(filled.sum()), grid.cell_m, *middles,
    )  # fmt: skip


def find_patches(grid: PlaneCells, foot: Footprint) -> list[tuple[np.ndarray, np.ndarray]]:
    """(cells of the hole (X, Y), step (2,) to where they are copied from), each cell once.

    From places in no shadow first.
    """
    found = patches_from(grid, foot._replace(good=foot.good & ~foot.dark))
    taken = np.any([chosen for chosen, _ in found], axis=0) if found else np.zeros(grid.shape, bool)
    if not foot.dark.any() or taken.sum() >= (1 - LEAST_LEFT) * foot.hole.sum():
        return found
    return found + patches_from(grid, foot._replace(hole=foot.hole & ~taken))


def patches_from(grid: PlaneCells, foot: Footprint) -> list[tuple[np.ndarray, np.ndarray]]:
    """The same, of all that is good."""
    seam = seams(grid, foot)
    left, total = foot.hole.copy(), foot.hole.sum()
    found: list[tuple[np.ndarray, np.ndarray]] = []
    while left.sum() > LEAST_LEFT * total and len(found) < MOST_PATCHES:
        cover = correlate(left, foot.good) / left.sum()  # (2X - 1, 2Y - 1) for each step
        cost = seam - WORTH * np.minimum(cover, WHOLE)
        fits = cover >= WHOLE
        cost[fits] -= 10.0  # one place for all of it comes before any in pieces
        cost[cover * left.sum() < LEAST_PATCH] = np.inf
        best = np.unravel_index(cost.argmin(), cost.shape)
        if not np.isfinite(cost[best]):
            break
        step = np.array(best) - (np.array(grid.shape) - 1)
        chosen = left & shifted(np.ones_like(left) if fits[best] else foot.good, step)
        found.append((chosen, step))
        left &= ~chosen
    return found


def seams(grid: PlaneCells, foot: Footprint) -> np.ndarray:
    """(2X - 1, 2Y - 1) display units: how unlike the surroundings each step's place looks.

    The RMS over the ring beside the copied ring, and how far the copy's mean is from the ring's.
    """
    known = (grid.count > 0).astype(float)
    ring = foot.ring.astype(float)
    beside = np.maximum(correlate(ring, known), 1e-9)
    under = np.maximum(correlate(foot.hole, known * foot.good), 1e-9)
    squares, jump = 0.0, 0.0
    for channel in np.moveaxis(grid.colors, 2, 0):
        here, there = ring * channel, known * channel
        squares += (
            correlate(ring * channel**2, known)
            - 2 * correlate(here, there)
            + correlate(ring, known * channel**2)
        )
        mean = here.sum() / max(ring.sum(), 1)
        jump += np.abs(correlate(foot.hole, there * foot.good) / under - mean)
    channels = grid.colors.shape[2]
    out = np.sqrt(np.maximum(squares, 0) / channels / beside) + jump / channels
    middle = np.array(grid.shape) - 1
    steps = np.indices(out.shape) - middle[:, None, None]
    out += FARTHER * np.hypot(*steps)
    out[beside < LEAST_RING * max(ring.sum(), 1)] = np.inf
    return out


def correlate(cells: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(2X - 1, 2Y - 1): sum of cells(c) others(c + step), steps from 1 - X and 1 - Y."""
    from scipy import fft  # scipy.signal has this, and takes two seconds to import

    whole = np.add(others.shape, cells.shape) - 1
    size = [fft.next_fast_len(int(n), real=True) for n in whole]
    product = fft.rfft2(others.astype(float), size) * fft.rfft2(cells[::-1, ::-1] * 1.0, size)
    return fft.irfft2(product, size)[: whole[0], : whole[1]]


def shifted(cells: np.ndarray, step: np.ndarray) -> np.ndarray:
    """(X, Y) bool: cells(c + step), False outside."""
    out = np.zeros_like(cells)
    x, y = np.nonzero(cells)
    x, y = x - step[0], y - step[1]
    inside = (x >= 0) & (y >= 0) & (x < cells.shape[0]) & (y < cells.shape[1])
    out[x[inside], y[inside]] = True
    return out


def apply_stamp(model: AnchorModel, stamp: Stamp) -> AnchorModel:
    """The model without what was dropped, and with the copies behind the rest; label 0."""
    rows = np.concatenate([np.flatnonzero(~stamp.dropped), stamp.rows])
    out = model.with_anchors(rows)
    anchors = out.anchors.copy()
    copies = slice(len(rows) - len(stamp.rows), None)
    anchors[copies] += stamp.shifts.astype(np.float32)
    return replace(out, anchors=anchors)


BACKGROUND = 0  # its label
Progress = Callable[[str, int, int], None]  # what is being done, things done, things in all


@dataclass(frozen=True)
class Completion:
    """What was tried under one thing, and what came of it."""

    label: int
    plane: Plane | None  # that it stood on; None: none was found
    stamp: Stamp | None  # the one that stays
    verdict: Verdict | None
    why: str = ""  # why nothing was filled, a clause
    ghosts: int = 0  # anchors of background that no photo shows, taken out of its volume

    def sentence(self) -> str:
        """For people, without the thing's name."""
        ghosts = f"{self.ghosts:,} hidden anchors taken out of its inside; " * bool(self.ghosts)
        if self.stamp is None:
            return f"{ghosts}the background behind it stays as it is: {self.why}"
        assert self.verdict is not None, "what stays was verified"
        patches = f"{self.stamp.patches} patch{'es' if self.stamp.patches > 1 else ''}"
        copies = f"{len(self.stamp.rows):,} anchors copied, {int(self.stamp.dropped.sum()):,} taken"
        return f"{ghosts}{patches}, {copies} out; {self.verdict.sentence()}"


def complete(
    device: Device,
    model: AnchorModel,
    views: Sequence[PhotoView],
    things: Sequence[int] | None = None,
    evidence: np.ndarray | None = None,
    *,
    shadows: bool = False,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    progress: Progress = lambda what, done, count: None,
) -> tuple[AnchorModel, list[Completion]]:
    """The model with the background completed under the things of these labels; all, if None.

    Copies are background and stand behind the other anchors.  A step that verify() refuses changes
    nothing and says why.  evidence (A,): pixels of background that each anchor shows; what photos
    show stays.  shadows: also where the thing's contact shadow lies, which no photo can confirm.
    Raises ValueError for a model without labels.
    """
    if model.labels is None:
        raise ValueError("the model has no labels of objects; partition it first.")
    if things is None:
        things = [int(each) for each in np.unique(model.labels) if each != BACKGROUND]
    told: list[Completion] = []
    scene = Scenery(model, looks_of(model), ModelPictures(device, only_background(model)))
    for done, label in enumerate(things):
        progress("completing the background", done, len(things))
        ghosts = 0
        if evidence is not None:
            scene, evidence, ghosts = without_ghosts(device, scene, label, evidence)
        scene, one = complete_one(device, scene, views, label, evidence, shadows, background)
        one = replace(one, ghosts=ghosts)
        if one.stamp is not None and evidence is not None:  # copies look as seen
            kept = evidence[~one.stamp.dropped]
            evidence = np.concatenate([kept, evidence[one.stamp.rows]])
        told.append(one)
    model = scene.model
    progress("completing the background", len(things), len(things))
    return model, told


@dataclass(frozen=True)
class Scenery:
    """A labelled model, how its anchors look, and its background drawn: from thing to thing."""

    model: AnchorModel
    looks: AnchorLooks
    pictures: ModelPictures

    @property
    def labels(self) -> np.ndarray:
        """(A,) of the anchors."""
        assert self.model.labels is not None, "complete() asks for them"
        return self.model.labels


def without_ghosts(
    device: Device, scene: Scenery, label: int, evidence: np.ndarray
) -> tuple[Scenery, np.ndarray, int]:
    """The scene and evidence (A,) without what hidden_inside() finds, and how many that were.

    No photo can confirm it, or is changed by it: none shows these anchors.
    """
    looks, labels = scene.looks, scene.labels
    plane = support_plane(looks, labels, label)
    ghosts = hidden_inside(
        looks, labels, label, evidence, plane if isinstance(plane, Plane) else None
    )
    count = int(ghosts.sum())
    if not count:
        return scene, evidence, 0
    kept = ~ghosts
    looks = replace(
        looks, places=looks.places[kept], there=looks.there[kept], colors=looks.colors[kept]
    )
    model = scene.model.with_anchors(kept)
    return (
        Scenery(model, looks, ModelPictures(device, only_background(model))), evidence[kept], count
    )  # fmt: skip


def complete_one(
    device: Device,
    scene: Scenery,
    views: Sequence[PhotoView],
    label: int,
    evidence: np.ndarray | None,
    shadows: bool,
    background: tuple[float, float, float],
) -> tuple[Scenery, Completion]:
    """The same for one thing: all of its footprint, else the part that no photo shows, else all of
    it with a look as even as that of its surroundings is in the mean.
    """
    looks, labels = scene.looks, scene.labels
    if not (labels == label).any():
        return scene, Completion(label, None, None, None, "no anchor is its")
    plane = support_plane(looks, labels, label)
    if isinstance(plane, str):
        return scene, Completion(label, None, None, None, plane)
    first: Completion | None = None
    seen = evidence is not None and not shadows
    for core, even in ((True, True), (True, False), (False, False))[: 3 if seen else 1]:
        stamp = find_stamp(looks, labels, label, plane, evidence, shadows, core)
        if isinstance(stamp, str):
            first = first or Completion(label, plane, None, None, stamp)
            continue
        after = with_background_copies(apply_stamp(scene.model, stamp), len(stamp.rows))
        if even:
            after = with_even_copies(after, looks, labels, stamp)
        pictures = ModelPictures(device, only_background(after))
        cells = Cells(stamp.footprint, stamp.cell_m, plane.normal, stamp.around)
        pair = scene.pictures, pictures
        verdict = verify(device, *pair, label, views, background, cells, shadows)
        if verdict.is_accepted:
            looks = stamped_looks(looks, stamp)
            return Scenery(after, looks, pictures), Completion(label, plane, stamp, verdict)
        first = first or Completion(label, plane, None, verdict, verdict.sentence())
    assert first is not None, "one step at least was tried"
    return scene, first


def stamped_looks(looks: AnchorLooks, stamp: Stamp) -> AnchorLooks:
    """How anchors look after apply_stamp()."""
    rows = np.concatenate([np.flatnonzero(~stamp.dropped), stamp.rows])
    places = looks.places[rows].copy()
    places[len(rows) - len(stamp.rows) :] += stamp.shifts
    return replace(looks, places=places, there=looks.there[rows], colors=looks.colors[rows])


def with_even_copies(
    model: AnchorModel, looks: AnchorLooks, labels: np.ndarray, stamp: Stamp
) -> AnchorModel:
    """The stamped model whose copies have the mean features of EVEN anchors around each source.

    A texture of its own is farther from what was there than the mean of what is around.
    """
    from scipy.spatial import cKDTree

    ground = np.flatnonzero(looks.there & (labels == BACKGROUND) & ~stamp.dropped)
    near = cKDTree(looks.places[ground]).query(looks.places[stamp.rows], min(EVEN, len(ground)))[1]
    features = model.features.copy()
    source = np.concatenate([np.flatnonzero(~stamp.dropped), stamp.rows])
    original = np.zeros((len(labels), features.shape[1]), features.dtype)
    original[source] = features
    features[len(features) - len(stamp.rows) :] = original[ground[near]].mean(axis=1)
    return replace(model, features=features)


def with_background_copies(model: AnchorModel, copies: int) -> AnchorModel:
    """The model whose last rows belong to the background."""
    assert model.labels is not None, "of a labelled model"
    labels = model.labels.copy()
    labels[len(labels) - copies :] = BACKGROUND
    return replace(model, labels=labels)


def only_background(model: AnchorModel) -> AnchorModel:
    """What stays when every object is taken away."""
    assert model.labels is not None, "of a labelled model"
    return model.with_anchors(model.labels == BACKGROUND)
