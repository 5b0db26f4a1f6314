"""Prompts in a few photos to label maps of many: a segmenter asked, its answers judged in 3D.

OWD section 3.2, object by object.  decomposition.walk_objects does it without a segmenter.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import ndimage

from shapeshift.decomposition.masks.anchor_walk import (
    AnchorGraph,
    make_graph,
    nodes_of,
    seeds_of_evidence,
)
from shapeshift.decomposition.masks.journal import MaskJournal
from shapeshift.decomposition.masks.pixel_walk import PixelWalk
from shapeshift.decomposition.masks.segmenter import Candidate, Prompt, Segmenter
from shapeshift.decomposition.masks.specs import ObjectSpec, ObjectSpecs
from shapeshift.decomposition.masks.work_photos import (
    WorkPhoto,
    find_photo,
    given_mask,
    prompt_of,
)
from shapeshift.decomposition.propagate import (
    ACCEPTED,
    REJECTED,
    UNKNOWN,
    Decision,
    Support,
    merge,
    propagate,
)
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.runtime_models.model import BadFile

MOST_PHOTOS = 24  # that are asked about: 4 well-spread masks an object equal 48
MOST_ENCODED = 1 << 30  # bytes of encoded photos that are kept
Progress = Callable[[str, int, int], None]  # what is done now, how many of how many


@dataclass
class Counts:
    """What became of an object in the photos."""

    given: int = 0
    accepted: int = 0
    rejected: int = 0
    unknown: int = 0  # photos that show nearly nothing of it

    def count(self, what: str) -> None:
        setattr(self, what, getattr(self, what) + 1)


@dataclass
class PhotoLabels:
    """Label maps of photos, and how they came about."""

    photos: list[WorkPhoto]
    maps: list[np.ndarray]  # (H, W) uint8 each
    counts: dict[int, Counts]  # by label
    finished: bool = True


class EncodedPhotos:
    """What the segmenter made of photos, as many as fit: encoding takes seconds."""

    def __init__(self, segmenter: Segmenter, photos: list[WorkPhoto]) -> None:
        self.segmenter, self.photos = segmenter, photos
        self._kept: OrderedDict[int, tuple[Any, int]] = OrderedDict()

    def candidates(self, view: int, prompt: Prompt) -> list[Candidate]:
        return self.segmenter.candidates(self._encoded(view), prompt)

    def _encoded(self, view: int) -> Any:
        if view not in self._kept:
            encoded = self.segmenter.encode(self.photos[view].pixels())
            self._kept[view] = encoded, bytes_of(encoded)
            while (
                len(self._kept) > 1 and sum(size for _, size in self._kept.values()) > MOST_ENCODED
            ):
                self._kept.popitem(last=False)
        self._kept.move_to_end(view)
        return self._kept[view][0]


def bytes_of(encoded: Any) -> int:
    """Of the arrays in what a segmenter keeps of a photo."""
    if isinstance(encoded, np.ndarray):
        return encoded.nbytes
    if isinstance(encoded, dict):
        return sum(map(bytes_of, encoded.values()))
    return sum(map(bytes_of, encoded)) if isinstance(encoded, tuple | list) else 0


@dataclass
class PhotoLabelling:
    """Which objects the photos of a capture show.  `run` may be stopped at any time."""

    shown: ShownAnchors
    photos: list[WorkPhoto]
    specs: ObjectSpecs
    segmenter: Segmenter
    journal: MaskJournal
    progress: Progress = lambda what, done, of: None
    supports: dict[int, Support] = field(default_factory=dict)
    decisions: dict[int, dict[int, Decision]] = field(default_factory=dict)  # by label, view

    def run(self) -> None:
        """Decides every view of every object.  Raises BadFile."""
        encoded = EncodedPhotos(self.segmenter, self.photos)
        total = len(self.photos) * len(self.specs.objects)
        given = {spec.label: self.given(spec, encoded) for spec in self.specs.objects}
        for i, spec in enumerate(self.specs.objects):
            here = self.decisions.setdefault(spec.label, {})
            for decision in self.decide(spec, given[spec.label], encoded):
                here[decision.view] = decision
                self.progress(spec.name, i * len(self.photos) + len(here), total)

    def given(self, spec: ObjectSpec, encoded: EncodedPhotos) -> dict[int, np.ndarray]:
        """The masks of the photos in which a person says where the object is."""
        found = {}
        for said in spec.prompts:
            view = find_photo(self.photos, said.photo, f"object '{spec.name}'")
            photo = self.photos[view]
            mask = given_mask(self.specs, said, photo)
            if mask is None:
                prompt = prompt_of(spec, said, photo)
                mask = self.asked(spec, view, prompt, encoded)
            found[view] = mask
        if not found:
            raise BadFile(
                f"object '{spec.name}' has no prompt; say in one photo where it is, by 'box', "
                "'inside' or 'mask'."
            )
        return found

    def asked(
        self, spec: ObjectSpec, view: int, prompt: Prompt, encoded: EncodedPhotos
    ) -> np.ndarray:
        """The segmenter's answer to a person's prompt.  Raises BadFile where there is none."""
        size = self.photos[view].view.size
        if self.journal.known(spec.label, view):
            candidates = self.journal.candidates(spec.label, view, size)
        else:
            candidates = encoded.candidates(view, prompt)
            if self.segmenter.wants_click:
                clicked = with_click(self.photos[view].pixels(), prompt)
                more = [] if clicked is prompt else encoded.candidates(view, clicked)
                candidates = [*candidates, *more]
        best = best_of(candidates, prompt)
        if best is None:
            raise BadFile(
                f"object '{spec.name}': {self.segmenter.name} finds nothing at its prompt in "
                f"{self.photos[view].name}; give a tighter box, clicks inside, or a mask."
            )
        if not self.journal.known(spec.label, view):
            self.journal.write(spec.label, view, best)
        return best.mask

    def decide(
        self, spec: ObjectSpec, given: dict[int, np.ndarray], encoded: EncodedPhotos
    ) -> Iterator[Decision]:
        """Every view of one object."""
        support = self.supports[spec.label] = Support.none(self.shown.count)
        eyes = np.array([photo.view.world_from_eye.position for photo in self.photos])

        def shown(view: int, masks: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            photo = self.photos[view]
            return self.shown.masks(photo.view, photo.stop.x, masks)

        def ask(view: int, _: Support) -> list[Candidate]:
            if self.journal.known(spec.label, view):
                return self.journal.candidates(spec.label, view, self.photos[view].view.size)
            prompts = prompts_of(self.believed(spec.label, view), spec.text)
            return [found for prompt in prompts for found in encoded.candidates(view, prompt)]

        for decision in propagate(support, given, eyes, shown, ask):
            if decision.what in (ACCEPTED, REJECTED) and not self.journal.known(
                spec.label, decision.view
            ):
                taken = None
                if decision.mask is not None:
                    taken = Candidate(decision.mask, decision.score)
                self.journal.write(spec.label, decision.view, taken)
            yield decision

    def believed(self, label: int, view: int) -> np.ndarray:
        """(H, W) share of each pixel that is believed to be the object's: by its support, and by a
        walk from there to anchors that no mask has shown yet.
        """
        photo, support = self.photos[view], self.supports[label]
        walked = self.graph.walk(seeds_of_evidence(support.inside, support.outside))
        belief = support.belief()
        values = np.zeros((len(belief), 3))
        values[:, 0] = np.where(belief == 0, walked, np.maximum(belief, 0))
        return self.shown.picture(photo.view, photo.stop.x, values)[..., 0]

    @cached_property
    def graph(self) -> AnchorGraph:
        """Of the scene's anchors."""
        eyes = np.array([photo.view.world_from_eye.position for photo in self.photos])
        return make_graph(nodes_of(self.shown.model, eyes.mean(0).astype(np.float32)), eyes)

    def labels(self) -> PhotoLabels:
        """Of the photos in which every object so far is decided."""
        done = [i for i in range(len(self.photos)) if all(i in d for d in self.decisions.values())]
        counts = {label: Counts() for label in self.decisions}
        for label, decisions in self.decisions.items():
            for decision in decisions.values():
                counts[label].count(decision.what)
        maps = [self.label_map(view) for view in done]
        return PhotoLabels([self.photos[i] for i in done], maps, counts)

    def label_map(self, view: int) -> np.ndarray:
        """(H, W) uint8 of one photo."""
        here = {label: decisions[view] for label, decisions in self.decisions.items()}
        hidden = {
            label: self.believed(label, view)
            for label, decision in here.items()
            if decision.what in (REJECTED, UNKNOWN)
        }
        width, height = self.photos[view].view.size
        return merge(here, (height, width), hidden)


def with_click(image: np.ndarray, prompt: Prompt) -> Prompt:
    """A box without clicks gets one where a walk over the photo's pixels (H, W, 3) finds the object
    deepest.  Networks answer both differently, now one better, now the other, whatever they say of
    it themselves: both are asked, and the box's sides judge.
    """
    if prompt.box is None or len(prompt.inside):
        return prompt
    (found,) = PixelWalk().candidates(image, prompt)
    within = np.zeros_like(found.mask)
    left, top, right, bottom = (max(round(side), 0) for side in prompt.box)
    within[top:bottom, left:right] = True
    mask = found.mask & within
    return replace(prompt, inside=clicks_in(mask)[:1]) if mask.any() else prompt


def best_of(candidates: list[Candidate], prompt: Prompt) -> Candidate | None:
    """The answer that agrees best with what a person said: with the clicks, then with the sides of
    the box, which are the object's; of those that agree alike the surest.
    """

    def agreement(candidate: Candidate) -> tuple[int, float, float]:
        mask = candidate.mask
        right = sum(holds(mask, place) for place in prompt.inside)
        right += sum(not holds(mask, place) for place in prompt.outside)
        return right, round(box_agreement(mask, prompt.box), 1), candidate.score

    real = [c for c in candidates if c.mask.any() and not c.mask.all()]
    return max(real, key=agreement, default=None)


def holds(mask: np.ndarray, place: np.ndarray) -> bool:
    """Whether the mask has the pixel of a place x, y."""
    row = min(max(int(place[1]), 0), mask.shape[0] - 1)
    column = min(max(int(place[0]), 0), mask.shape[1] - 1)
    return bool(mask[row, column])


def box_agreement(mask: np.ndarray, box: tuple[float, float, float, float] | None) -> float:
    """Intersection over union of a box and that of a mask; 1 where no box is given."""
    if box is None:
        return 1.0
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    own = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    across = max(min(own[2], box[2]) - max(own[0], box[0]), 0)
    down = max(min(own[3], box[3]) - max(own[1], box[1]), 0)
    areas = sum((b[2] - b[0]) * (b[3] - b[1]) for b in (own, box))
    return float(across * down / max(areas - across * down, 1e-9))


def choose_photos(
    photos: list[WorkPhoto], specs: ObjectSpecs, most: int = MOST_PHOTOS
) -> list[WorkPhoto]:
    """Those that prompts name, of whose modalities the others are, and others as far apart as
    possible until there are `most`; in the capture's order.  Raises BadFile.
    """
    named = {
        find_photo(photos, said.photo, f"object '{spec.name}'")
        for spec in specs.objects
        for said in spec.prompts
    }
    stops = {photos[i].stop.name for i in named}
    others = [i for i, p in enumerate(photos) if p.stop.name in stops and i not in named]
    eyes = np.array([photo.view.world_from_eye.position for photo in photos])
    chosen = sorted(named)
    apart = np.full(len(photos), np.inf)
    for i in chosen:
        apart = np.minimum(apart, np.linalg.norm(eyes - eyes[i], axis=1))
    while others and len(chosen) < most:
        far = max(others, key=lambda i: apart[i])
        others.remove(far)
        chosen.append(far)
        apart = np.minimum(apart, np.linalg.norm(eyes - eyes[far], axis=1))
    return [photos[i] for i in sorted(chosen)]


# Prompts for a photo in which nobody has marked the object, from where the scene believes it.

THERE = 0.5  # share of a pixel that is believed to be the object's
LEAST_PIXELS = 12  # of a part of the object, to count
SPECK = 0.05  # of the largest part: smaller ones are left out of the box
MARGIN = 0.04  # of the box's longer side, around what is believed
CLICKS = 3  # inside


def prompts_of(share: np.ndarray, text: str = "") -> list[Prompt]:
    """share: (H, W) 0..1 of each pixel that is believed to be the object's.

    A box, the box with clicks and about where the object is, and clicks alone: a segmenter answers
    them differently, and the support chooses.  [] where nothing is believed.
    """
    parts, count = ndimage.label(share > THERE)
    if not count:
        return []
    sizes = np.bincount(parts.ravel())[1:]
    kept = np.flatnonzero(sizes >= max(LEAST_PIXELS, SPECK * sizes.max())) + 1
    there = np.isin(parts, kept)
    if not there.any():
        return []
    box, clicks = box_of(there), clicks_in(there)
    return [
        Prompt(box, text=text),
        Prompt(box, clicks, mask=there, text=text),
        Prompt(inside=clicks, text=text),
    ]


def box_of(mask: np.ndarray) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of the pixels and a margin, within the picture."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    left, top, right, bottom = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    margin = max(MARGIN * max(right - left, bottom - top), 1.0)
    height, width = mask.shape
    return (
        float(max(left - margin, 0)), float(max(top - margin, 0)),
        float(min(right + margin, width)), float(min(bottom + margin, height)),
    )  # fmt: skip


def clicks_in(mask: np.ndarray) -> np.ndarray:
    """(n, 2) x, y: deep inside the mask, and far from each other."""
    depth = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    found: list[tuple[float, float]] = []
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    for _ in range(CLICKS):
        row, column = np.unravel_index(int(depth.argmax()), depth.shape)
        radius = depth[row, column]
        if not radius >= 1:
            break
        found.append((column + 0.5, row + 0.5))
        away = np.hypot(rows - row, columns - column)
        depth = np.where(away < 2 * radius, 0, depth)
    return np.array(found).reshape(-1, 2)
