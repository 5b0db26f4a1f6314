"""How right objects are, by what they were not made from: the cut scene is shown in other photos,
each object's silhouette there prompts a mask afresh, and the two are compared.

What made an object says nothing of it: a wrong mask confirms itself.  docs/bench/agreement.csv has
how the figure goes with the truth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import label as pieces_of

from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.anchor_walk import nodes_of
from shapeshift.decomposition.masks.pixel_walk import walk_together
from shapeshift.decomposition.masks.segmenter import Prompt
from shapeshift.decomposition.masks.work_photos import WorkPhoto, work_photos
from shapeshift.decomposition.segment_scene import ObjectJudgement, Segmented, SegmentedPart
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.decomposition.walk_objects import ON_PLANE, heat_of, heights_of
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import AnchorModel, BadFile, SplatLayers
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
    if views and tallies:
        ask(device, model, views, tallies)
    names = {part.spec.label: part.spec.name for part in parts}
    found = []
    for part in parts:
        tally = tallies.get(part.spec.label, AskedTally())
        agreement, doubt = tally.agreement(), ""
        if part.pixels < FEW:
            agreement, doubt = np.nan, f"too little seen: {part.pixels:,.0f} pixels"
        elif not tally.ious:
            doubt = "no other photo shows it"
        else:
            doubt = doubt_of(tally, names)
        found.append(ObjectJudgement(part.spec.name, agreement, len(tally.ious), doubt))
    return tuple(found)


def ask(
    device: Device,
    model: AnchorModel | SplatLayers,
    views: Sequence[WorkPhoto],
    tallies: dict[int, AskedTally],
) -> None:
    """Adds to the tallies what each view says; masks are made there by a walk over its pixels."""
    shown, drawn = ShownAnchors(device, model), LabelPictures(device, model)
    eyes = np.array([photo.view.world_from_eye.position for photo in views])
    nodes = nodes_of(model, eyes.mean(0).astype(np.float32))
    for photo in views:
        labels = drawn.label_map(photo.view, photo.stop.x)
        boxes = {k: box for k in tallies if (box := box_of(labels == k)) is not None}
        prompts = [Prompt(box) for box in boxes.values()]
        if not prompts:
            continue
        image = np.concatenate([photo.pixels(), *heat_of(shown, photo)], axis=2)
        heights = heights_of(shown, photo.view, photo.stop.x, prompts, nodes)
        fresh = np.zeros(labels.shape, np.uint8)
        for k, answer in zip(boxes, walk_together(image, prompts, heights), strict=True):
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
