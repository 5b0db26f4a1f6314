"""How right objects are, by what they were not made from: the cut scene is shown in other photos,
each object's silhouette there prompts a mask afresh, and the two are compared.

What made an object says nothing of it: a wrong mask confirms itself.  docs/bench/agreement.csv has
how the figure goes with the truth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.ndimage import label as pieces_of
from scipy.spatial import cKDTree

from shapeshift.decomposition.completion.plane import Plane
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.anchor_walk import Nodes, nodes_of
from shapeshift.decomposition.masks.pixel_walk import walk_together
from shapeshift.decomposition.masks.segmenter import Prompt
from shapeshift.decomposition.masks.work_photos import WorkPhoto, work_photos
from shapeshift.decomposition.segment_scene import ObjectJudgement, Segmented, SegmentedPart
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.decomposition.upright_scene import planes_under
from shapeshift.decomposition.walk_objects import ON_PLANE, heat_of, heights_of, places_of, ways_of
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import AnchorModel, BadFile, SplatLayers
from shapeshift.runtime_models.stop import Stop
from shapeshift.scene.captures.capture import Capture

MOST_VIEWS, BEST = 5, 3  # that are asked; that count: masks made afresh fail, too, here and there
MOST_SIDE = 512  # pixels of a photo that is asked
LEAST_PIXELS = 12  # of an object in a view, for the view to say something of it
FEW = 100  # pixels of evidence, with less of which nothing is said of an object
SPECK = 0.05  # of the largest piece: smaller ones make no box
ROOM = 0.06  # of the silhouette's longer side, around it: what is missing is to be found, too
DOUBT = 0.75  # agreement below which an object is in doubt
PLANE, SHARED = 0.08, 0.12  # of what is shown, from which a reason is named anyway
REASON = 0.08  # the same, of what is in doubt


@dataclass
class AskedTally:
    """Pixels of one object in views, and how well each of them agrees."""

    ious: list[float] = field(default_factory=list)
    cut_off: list[bool] = field(default_factory=list)  # by the photo's border
    shown: int = 0  # by the cut object
    plane: int = 0  # of those, not in the fresh mask, and on what it stands on
    shared: dict[int, int] = field(default_factory=dict)  # the same, in the mask of another label
    more: int = 0  # the same, neither
    missing: int = 0  # in the fresh mask, and shown by no object

    def add(
        self, label: int, labels: np.ndarray, fresh: np.ndarray, height: np.ndarray | None
    ) -> None:
        """One view's label maps (H, W): of the cut scene and afresh; heights as of heights_of."""
        one, other = labels == label, fresh == label
        self.ious.append(float((one & other).sum() / (one | other).sum()))
        self.cut_off.append(bool(one[[0, -1]].any() or one[:, [0, -1]].any()))
        wrong = one & ~other
        flat = np.zeros_like(one)
        if height is not None:
            flat = np.abs(height.astype(int) - ON_PLANE[0]) < ON_PLANE[1]
        self.shown += int(one.sum())
        self.plane += int((wrong & flat & (fresh == 0)).sum())
        self.more += int((wrong & ~flat & (fresh == 0)).sum())
        self.missing += int((other & (labels == 0)).sum())
        for theirs in np.unique(fresh[wrong & (fresh > 0)]):
            count = int((wrong & (fresh == theirs)).sum())
            self.shared[int(theirs)] = self.shared.get(int(theirs), 0) + count

    def agreement(self) -> float:
        """0..1: the mean IoU of the best views, whole ones if there are; NaN without a view."""
        whole = [iou for iou, cut in zip(self.ious, self.cut_off, strict=True) if not cut]
        best = sorted(whole or self.ious)[-BEST:]
        return float(np.mean(best)) if best else np.nan


def judged(device: Device, found: Segmented, capture: Capture) -> Segmented:
    """With what photos of the capture say of the objects that they were not made from."""
    try:
        photos = work_photos(capture, found.model.stops)
    except BadFile:  # panoramas, in which no masks are made
        photos = []
    used = {picture.photo for picture in found.pictures if picture.photo is not None}
    return replace(found, judged=judge(device, found.model, found.parts, photos, used))


def judge(
    device: Device,
    model: AnchorModel | SplatLayers,
    parts: Sequence[SegmentedPart],
    photos: Sequence[WorkPhoto],
    used: set[Path],
) -> tuple[ObjectJudgement, ...]:
    """What other photos say of each object of a labelled model.

    photos: of the capture; used: those that masks were given of, which are left out where others
    show colours.  Raises BadFile.
    """
    tallies = {part.spec.label: AskedTally() for part in parts if part.rows}
    views = views_to_ask(photos, used)
    seconds: dict[int, float] = {}
    if views and tallies:
        eyes = np.array([photo.view.world_from_eye.position for photo in views])
        nodes = nodes_of(model, eyes.mean(0).astype(np.float32))
        ask(device, model, views, nodes, tallies)
        seconds = second_things(model, parts, nodes)
    names = {part.spec.label: part.spec.name for part in parts}
    return tuple(
        judgement(
            part,
            tallies.get(part.spec.label, AskedTally()),
            seconds.get(part.spec.label, 0.0),
            names,
        )
        for part in parts
    )


def judgement(
    part: SegmentedPart, tally: AskedTally, second: float, names: dict[int, str]
) -> ObjectJudgement:
    """second: what part of the object is another thing; names: of all objects, by label."""
    agreement, doubt = tally.agreement(), ""
    if part.pixels < FEW:
        agreement, doubt = np.nan, f"too little seen: {part.pixels:,.0f} pixels"
    elif not tally.ious:
        doubt = "no other photo shows it"
    else:
        doubt = "; ".join(filter(None, (doubt_of(tally, names), TWO if second else "")))
        agreement *= 1 - second  # no more than that of it is the one thing
    return ObjectJudgement(part.spec.name, agreement, len(tally.ious), doubt)


def ask(
    device: Device,
    model: AnchorModel | SplatLayers,
    views: Sequence[WorkPhoto],
    nodes: Nodes,
    tallies: dict[int, AskedTally],
) -> None:
    """Adds to the tallies what each view says; masks are made there by a walk over its pixels."""
    shown, drawn = ShownAnchors(device, model), LabelPictures(device, model)
    for photo in views:
        labels = drawn.label_map(photo.view, photo.stop.x)
        boxes = {k: box for k in tallies if (box := box_of(labels == k)) is not None}
        prompts = [Prompt(box) for box in boxes.values()]
        if not prompts:
            continue
        image = np.concatenate([photo.pixels(), *heat_of(shown, photo)], axis=2)
        places = places_of(shown, photo.view, photo.stop.x, nodes)
        heights = heights_of(places, photo.view, prompts, nodes)
        fresh = np.zeros(labels.shape, np.uint8)
        answers = walk_together(image, prompts, heights, ways_of(places, photo.view))
        for k, answer in zip(boxes, answers, strict=True):
            assert answer is not None, "it has a box"
            fresh[answer.mask] = k
        for k, height in zip(boxes, heights, strict=True):
            tallies[k].add(k, labels, fresh, height)


def doubt_of(tally: AskedTally, names: dict[int, str]) -> str:
    """Why an object may be wrong, in a few words; "" where nothing speaks against it."""
    shown = max(tally.shown, 1)
    other, most = max(tally.shared.items(), key=lambda item: item[1], default=(0, 0))
    low = tally.agreement() < DOUBT
    reasons = [
        (tally.plane / shown, PLANE, "holds a piece of what it stands on"),
        (most / shown, SHARED, f"shares its mask with {names.get(other, '')}"),
        (tally.more / shown, np.inf, "holds more than other photos show"),
        (tally.missing / shown, np.inf, "a part of it may be missing"),
    ]
    said = [(share, why) for share, least, why in reasons if share > (REASON if low else least)]
    if said:
        return max(said)[1]
    return "other photos show it otherwise" if low else ""


# Two things that are marked as one come out as one in every photo.  The scene itself parts them: in
# two halves, each of its own hue and to one side, that hardly touch and both reach down to what
# carries them.  A thing with a label or a handle, or with a shade on a stem, fails at one of these.

TWO = "may be two things side by side"
MOST_NODES, LEAST_NODES = 1500, 40  # of an object, among which halves are looked for
NEAR = 10  # neighbours of an anchor
ROUNDS = 25  # of expectation and maximization
LEAST_HALF = 0.12  # of the anchors
STANDS = 0.22  # of the object's height, to which the feet of both halves reach
FOOT, TOP = 3, 98  # percent of heights
DARK = 0.06  # of 1: colours so dark have no hue
HUES = 0.4  # logarithms of ratios of red, green and blue, by which the halves differ
TOUCH = 0.03  # what links between the halves count, a root of the smaller one's anchors
MIXED = 0.165  # above which they are one: pairs have at most .146, single things .18 and more


def second_things(
    model: AnchorModel | SplatLayers, parts: Sequence[SegmentedPart], nodes: Nodes
) -> dict[int, float]:
    """By label what part of the object's anchors is another thing, of those that may be two."""
    columns = color_columns(model.stops)
    labels = model.labels
    if columns is None or labels is None:
        return {}
    found = {}
    for label, plane in planes_under(model, parts).items():
        at = np.flatnonzero(labels[nodes.rows] == label)
        at = at[:: len(at) // MOST_NODES + 1]
        colors = nodes.colors[at][:, columns]
        finite = np.isfinite(colors).all(1)
        second = second_thing(nodes.means[at][finite], colors[finite], plane)
        if second > 0:
            found[label] = second
    return found


def color_columns(stops: Sequence[Stop]) -> slice | None:
    """Where a node has the colours of the first stop that shows colours; None without one."""
    at = 0
    for stop in stops:
        if not stop.is_measured:
            return slice(at, at + 3)
        at += 1
    return None


def second_thing(places: np.ndarray, colors: np.ndarray, plane: Plane) -> float:
    """The smaller half's share of an object that may be two things; 0: it is one.

    places (N, 3) metres, colors (N, 3) 0..1; plane: what the object stands on.
    """
    if len(places) < LEAST_NODES:
        return 0.0
    height = plane.height(places)
    least = STANDS * float(np.percentile(height, TOP))
    logs = np.log(colors + DARK)
    hues = logs[:, [0, 2]] - logs[:, 1:2]  # (N, 2), the same in light and shadow
    at = cKDTree(places).query(places, NEAR + 1)[1][:, 1:]
    edges = np.repeat(np.arange(len(places)), NEAR), at.ravel()
    best, share = MIXED, 0.0
    for half in halves_of(places, hues, edges):
        small = int(min(half.sum(), (~half).sum()))
        if not small >= LEAST_HALF * len(half):
            continue
        feet = [np.percentile(height[side], FOOT) for side in (half, ~half)]
        apart = np.linalg.norm(hues[half].mean(0) - hues[~half].mean(0))
        touch = (half[edges[0]] != half[edges[1]]).sum() / (2 * NEAR * np.sqrt(small))
        mixed = 2 - parted(hues, half) - parted(places, half) + TOUCH * touch
        if max(feet) <= least and apart >= HUES and mixed < best:
            best, share = mixed, small / len(half)
    return share


def halves_of(
    places: np.ndarray, hues: np.ndarray, edges: tuple[np.ndarray, np.ndarray]
) -> Iterator[np.ndarray]:
    """(N,) bool each: what is not joined to the largest piece, and pairs of Gaussians of hue and
    place, begun at the median along each axis of the hues and of the places.
    """
    count = len(places)
    links = sparse.coo_array((np.ones(len(edges[0])), edges), shape=(count, count))
    pieces = sparse.csgraph.connected_components(links, directed=False)[1]
    yield pieces != np.bincount(pieces).argmax()
    centered = places - places.mean(0)
    size = max(float(np.linalg.norm(centered.std(0))), 1e-12)
    points = np.concatenate([hues, centered / size], axis=1)  # (N, 5)
    for columns in (hues - hues.mean(0), centered):
        for axis in np.linalg.svd(columns, full_matrices=False)[2]:
            along = columns @ axis
            share = (along > np.median(along)).astype(float)
            for _ in range(ROUNDS):
                odds = log_density(points, share) - log_density(points, 1 - share)
                share = 1 / (1 + np.exp(-np.clip(odds, -50, 50)))
            yield share > 0.5


def log_density(points: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(N,) of points (N, C) in the Gaussian that weights (N,) make of them, times their part."""
    total = max(float(weights.sum()), 1e-9)
    away = points - weights @ points / total
    spread = (weights[:, None] * away).T @ away / total + 2e-3 * np.eye(points.shape[1])
    squares = np.einsum("nc,cd,nd->n", away, np.linalg.inv(spread), away)
    return np.log(total / len(points)) - (squares + np.linalg.slogdet(spread)[1]) / 2


def parted(points: np.ndarray, half: np.ndarray) -> float:
    """0.5 to 1: how often one of a half lies further along than one of the other, in the direction
    that parts them best (Fisher 1936); points (N, C), half (N,) bool.
    """
    one, other = points[half], points[~half]
    spread = np.cov(one.T) + np.cov(other.T)
    spread += 1e-6 * max(float(np.trace(spread)), 1e-12) * np.eye(points.shape[1])
    rank = (points @ np.linalg.solve(spread, one.mean(0) - other.mean(0))).argsort().argsort()
    wins = rank[half].sum() - len(one) * (len(one) - 1) / 2
    return float(wins / (len(one) * len(other)))


def views_to_ask(photos: Sequence[WorkPhoto], used: set[Path]) -> list[WorkPhoto]:
    """Photos in colours that no mask was given of, as far from those and each other as can be."""
    colored = [photo for photo in photos if not photo.stop.is_measured]
    free = [photo for photo in colored if photo.photo.path not in used] or colored
    places = [photo.view.world_from_eye.position for photo in free]
    apart = np.full(len(free), np.inf)
    for photo in colored:
        if photo.photo.path in used:
            apart = np.minimum(apart, distances(places, photo.view.world_from_eye.position))
    chosen: list[int] = []
    while len(chosen) < min(MOST_VIEWS, len(free)):
        chosen.append(int(np.argmax(np.where(np.isin(np.arange(len(free)), chosen), -1, apart))))
        apart = np.minimum(apart, distances(places, places[chosen[-1]]))
    return [smaller(free[i]) for i in chosen]


def distances(places: list[np.ndarray], eye: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.reshape(places, (-1, 3)) - eye, axis=1)


def smaller(photo: WorkPhoto) -> WorkPhoto:
    """The photo, divided so that its longer side has MOST_SIDE pixels at most."""
    factor = max(-(-max(photo.photo.view.size) // MOST_SIDE), photo.factor)
    return replace(photo, factor=factor, view=photo.photo.view.divided(factor))


def box_of(mask: np.ndarray) -> tuple[float, float, float, float] | None:
    """Left, top, right, bottom of a silhouette without specks, and room; None of a few pixels."""
    parts, _ = pieces_of(mask)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    if not sizes.max(initial=0) >= LEAST_PIXELS:
        return None
    kept = (sizes >= SPECK * sizes.max())[parts]
    rows, columns = np.flatnonzero(kept.any(1)), np.flatnonzero(kept.any(0))
    low = np.array([columns[0], rows[0]], float)
    high = np.array([columns[-1] + 1, rows[-1] + 1], float)
    room = max(ROOM * float((high - low).max()), 1.0)
    left, top, right, bottom = (*(low - room), *(high + room))
    return float(left), float(top), float(right), float(bottom)
