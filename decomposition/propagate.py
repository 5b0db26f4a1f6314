"""Which of a segmenter's candidates is the object, in view after view (OWD section 3.2).

Support is kept on anchors: how much of what an anchor shows lay inside accepted masks, and
outside.  A candidate is judged by the anchors whose side is known and that its view shows.  Unlike
the paper no mask is taken that this support does not confirm: such ones were wrong in 10 of 10
cases, docs/bench/propagation.csv.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from shapeshift.decomposition.masks.segmenter import Candidate
from shapeshift.rasterizer.evidence import SILENT

OF_OWN = 0.8  # of the F score that the user's own mask has: below it it is not this object
MOST_AREA = 1.5  # times the area that the support covers, or the inverse, against the user's mask
LEAST_KNOWN = 30.0  # pixels of support that a view shows: with less nothing is decided
LEAST_SHOWN = 0.5  # pixels that an anchor has shown: less says nothing of its side
TIE = 1e-3  # what a segmenter's certainty counts against support, where masks overlap
HIDDEN = 0.5  # share of a pixel that belongs to an object without a mask there: it says nothing
GIVEN, ACCEPTED, REJECTED, UNKNOWN = "given", "accepted", "rejected", "unknown"

Shown = Callable[[int, list[np.ndarray]], tuple[list[np.ndarray], np.ndarray]]


@dataclass
class Support:
    """Pixels (A,) float64 that anchors showed in an object's masks so far, and out of them."""

    inside: np.ndarray
    outside: np.ndarray

    @staticmethod
    def none(anchors: int) -> "Support":
        return Support(np.zeros(anchors), np.zeros(anchors))

    def belief(self) -> np.ndarray:
        """(A,) from -1, surely not of the object, to 1, surely of it; 0 where it is not known."""
        total = self.inside + self.outside
        lean = (self.inside - self.outside) / np.maximum(total, 1e-9)
        return np.where(total > LEAST_SHOWN, lean, 0.0)

    def learn(self, inside: np.ndarray, shown: np.ndarray) -> None:
        """A view with an accepted mask: what anchors show in it, and at all."""
        self.inside += inside
        self.outside += shown - inside

    def known(self, shown: np.ndarray) -> float:
        """Pixels of the object that a view shows, as far as the support knows."""
        return float((np.maximum(self.belief(), 0) * shown).sum())


@dataclass(frozen=True)
class Judged:
    """A candidate against the support, in pixels that anchors show."""

    f: float  # of recall and precision
    recall: float  # of what is known to be the object, how much lies within
    precision: float  # of what lies within and is known, how much is the object
    area: float  # of the mask, over that of the support in this view


def judge(support: Support, inside: np.ndarray, shown: np.ndarray, pixels: int) -> Judged:
    """inside, shown (A,): what the view shows of each anchor in the mask, and at all."""
    belief = support.belief()
    yes, no = np.maximum(belief, 0), np.maximum(-belief, 0)
    hit, known, wrong = (
        float((a * b).sum()) for a, b in ((yes, inside), (yes, shown), (no, inside))
    )
    recall, precision = hit / max(known, 1e-9), hit / max(hit + wrong, 1e-9)
    f = 2 * recall * precision / max(recall + precision, 1e-9)
    return Judged(f, recall, precision, pixels / max(known, 1e-9))


def is_accepted(judged: Judged, own: Judged) -> bool:
    """Against what the user's own mask has: thin things have little even where a mask is right."""
    ratio = judged.area / max(own.area, 1e-9)
    return judged.f >= OF_OWN * own.f > 0 and 1 / MOST_AREA < ratio < MOST_AREA


def choose(judged: list[Judged], scores: list[float], own: Judged) -> int | None:
    """The candidate that agrees best with the support, if it may be accepted; among those that
    agree alike (to two decimals) the surest.

    Not the next best: where little of the object has been seen, a part of it would be taken.
    """
    order = sorted(range(len(judged)), key=lambda i: (-round(judged[i].f, 2), -scores[i]))
    return order[0] if order and is_accepted(judged[order[0]], own) else None


@dataclass(frozen=True)
class Decision:
    """What became of an object in one view."""

    view: int
    what: str  # GIVEN, ACCEPTED, REJECTED, or UNKNOWN: the view shows nearly nothing of it
    mask: np.ndarray | None = None  # (H, W) bool
    support: float = 0.0  # pixels of it that the mask agrees with, times how well
    score: float = 0.0  # the segmenter's own certainty


def propagate(
    support: Support,
    given: dict[int, np.ndarray],
    eyes: np.ndarray,
    shown: Shown,
    ask: Callable[[int, Support], list[Candidate]],
) -> Iterator[Decision]:
    """One decision a view: first those of the user's masks, then always the view that stands
    nearest to one that is decided.

    support: of nothing yet; it grows with every accepted mask, and is the caller's to look at.
    given: masks (H, W) bool by view, one at least.  eyes: (V, 3) metres.  shown: of a view and
    masks, as ShownAnchors.masks gives it.  ask: a view's candidates, given what is believed.
    """
    seen = []
    for view, mask in given.items():
        (inside,), total = shown(view, [mask])
        support.learn(inside, total)
        seen.append((inside, total, int(mask.sum())))
    owns = [judge(support, *one) for one in seen]
    own = min(owns, key=lambda judged: judged.f)
    for (view, mask), judged, (_, total, _) in zip(given.items(), owns, seen, strict=True):
        yield Decision(view, GIVEN, mask, judged.f * support.known(total), 1.0)
    left = [view for view in range(len(eyes)) if view not in given]
    apart = np.full(len(eyes), np.inf)  # metres to the nearest view that is decided
    for view in given:
        apart = np.minimum(apart, np.linalg.norm(eyes - eyes[view], axis=1))
    while left:
        view = min(left, key=lambda v: apart[v])
        left.remove(view)
        apart = np.minimum(apart, np.linalg.norm(eyes - eyes[view], axis=1))
        yield decide(view, support, own, shown, ask)


def decide(
    view: int,
    support: Support,
    own: Judged,
    shown: Shown,
    ask: Callable[[int, Support], list[Candidate]],
) -> Decision:
    """The decision of one view; an accepted mask is learnt from, nothing else is."""
    _, total = shown(view, [])
    known = support.known(total)
    if not known >= LEAST_KNOWN:
        return Decision(view, UNKNOWN)
    candidates = [c for c in ask(view, support) if c.mask.any() and not c.mask.all()]
    if not candidates:
        return Decision(view, REJECTED)
    insides, total = shown(view, [candidate.mask for candidate in candidates])
    judged = [
        judge(support, inside, total, int(candidate.mask.sum()))
        for inside, candidate in zip(insides, candidates, strict=True)
    ]
    at = choose(judged, [candidate.score for candidate in candidates], own)
    if at is None:
        return Decision(view, REJECTED)
    # Sums are rounded in each part that the masks cut the picture into: measured once more without
    # the others, so that who goes on from this mask alone learns the same from it.
    chosen = candidates[at]
    (inside,), total = shown(view, [chosen.mask])
    alone = judge(support, inside, total, int(chosen.mask.sum()))
    if choose([alone], [chosen.score], own) is None:
        return Decision(view, REJECTED)
    support.learn(inside, total)
    return Decision(view, ACCEPTED, chosen.mask, alone.f * known, chosen.score)


def merge(
    decisions: dict[int, Decision], shape: tuple[int, int], hidden: dict[int, np.ndarray]
) -> np.ndarray:
    """(H, W) uint8 label map of one view, from the decisions by label.

    Where masks overlap, the object of more support a pixel of its mask has them, certainty being
    the tie-breaker.  hidden: of objects without a mask there, the share (H, W) 0..1 of each pixel
    that is believed to be theirs; where it is large the map says nothing.
    """
    labels, best = np.zeros(shape, np.uint8), np.full(shape, -np.inf)
    for label, decision in decisions.items():
        if decision.mask is None:
            continue
        strength = decision.support / max(int(decision.mask.sum()), 1) + TIE * decision.score
        won = decision.mask & (strength > best)
        labels[won], best[won] = label, strength
    for share in hidden.values():
        labels[(labels == 0) & (share > HIDDEN)] = SILENT
    return labels
