"""Which candidate is the object: limits one by one, and the order in which views are decided."""

import numpy as np
import pytest

from shapeshift.decomposition.masks.segmenter import Candidate
from shapeshift.decomposition.propagate import (
    ACCEPTED,
    GIVEN,
    LEAST_KNOWN,
    MOST_AREA,
    OF_OWN,
    REJECTED,
    UNKNOWN,
    Decision,
    Judged,
    Support,
    choose,
    is_accepted,
    judge,
    merge,
    propagate,
)
from shapeshift.rasterizer.evidence import SILENT

SIDE = 20  # pixels of the flat world: one anchor a pixel, every view shows all
OBJECT = np.zeros((SIDE, SIDE), bool)
OBJECT[4:12, 5:15] = True


def flat(view: int, masks: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    return [mask.ravel().astype(float) for mask in masks], np.ones(SIDE * SIDE)


def grown(by: int) -> np.ndarray:
    mask = np.zeros_like(OBJECT)
    mask[4 - by : 12 + by, 5 - by : 15 + by] = True
    return mask


def learnt() -> Support:
    support = Support.none(SIDE * SIDE)
    (inside,), total = flat(0, [OBJECT])
    support.learn(inside, total)
    return support


def judged(mask: np.ndarray) -> Judged:
    (inside,), total = flat(0, [mask])
    return judge(learnt(), inside, total, int(mask.sum()))


def test_belief_needs_something_shown():
    support = Support(np.array([0.0, 0.5, 0.51, 3, 0, 1]), np.array([0.0, 0, 0, 1, 2, 1]))
    assert support.belief().tolist() == [0, 0, 1, 0.5, -1, 0]
    assert support.known(np.array([1.0, 1, 2, 4, 8, 16])) == 4


def test_figures_of_a_candidate_are_those_of_its_pixels():
    """In the flat world recall and precision are those of the masks themselves."""
    assert judged(OBJECT) == Judged(1, 1, 1, 1)
    half = OBJECT.copy()
    half[:, 10:] = False
    found = judged(half)
    assert (found.recall, found.precision, found.area) == (0.5, 1, 0.5)
    assert found.f == pytest.approx(2 / 3)
    wide = judged(grown(2))
    size = 12 * 14
    assert (wide.recall, wide.precision) == (1, pytest.approx(80 / size))
    assert wide.area == pytest.approx(size / 80)
    assert judged(~OBJECT).f == 0 and judged(np.zeros_like(OBJECT)).f == 0


@pytest.mark.parametrize("own", [Judged(1, 1, 1, 1), Judged(0.9, 0.9, 0.9, 1.32)])
def test_limits_are_relative_to_the_users_mask(own):
    def accepted(f: float, area: float) -> bool:
        return is_accepted(Judged(own.f * f, 0, 0, own.area * area), own)

    assert accepted(OF_OWN, 1) and accepted(1, 1)
    assert not accepted(OF_OWN - 1e-6, 1)
    assert accepted(1, MOST_AREA - 1e-6) and not accepted(1, MOST_AREA + 1e-6)
    assert accepted(1, 1 / MOST_AREA + 1e-6) and not accepted(1, 1 / MOST_AREA - 1e-6)
    assert not accepted(np.nan, 1) and not accepted(1, np.nan)


def test_a_mask_of_the_user_that_shows_nothing_accepts_nothing():
    nothing = Judged(0, 0, 0, 0)
    assert not is_accepted(nothing, nothing) and not is_accepted(Judged(1, 1, 1, 1), nothing)


def test_the_surest_of_those_that_agree_alike():
    own = Judged(1, 1, 1, 1)
    alike = [Judged(0.951, 1, 1, 1), Judged(0.949, 1, 1, 1), Judged(0.90, 1, 1, 1)]
    assert choose(alike, [0.1, 0.9, 0.95], own) == 1
    assert choose(alike, [0.9, 0.1, 0.95], own) == 0
    assert choose([Judged(0.99, 1, 1, 2), *alike], [1, 0, 0, 0], own) is None  # it is too large
    assert choose([Judged(0.5, 1, 1, 1)], [1], own) is None
    assert choose([], [], own) is None


def test_views_are_decided_from_near_to_far():
    eyes = np.array([[0.0, 0, 0], [5, 0, 0], [1, 0, 0], [2.5, 0, 0], [9, 0, 0]])
    asked = []

    def ask(view: int, support: Support) -> list[Candidate]:
        asked.append(view)
        return [Candidate(OBJECT, 0.5)]

    found = list(propagate(Support.none(SIDE**2), {0: OBJECT}, eyes, flat, ask))
    assert [d.view for d in found] == [0, 2, 3, 1, 4] and asked == [2, 3, 1, 4]
    assert [d.what for d in found] == [GIVEN] + [ACCEPTED] * 4
    found = list(propagate(Support.none(SIDE**2), {0: OBJECT, 4: OBJECT}, eyes, flat, ask))
    assert [d.view for d in found] == [0, 4, 2, 3, 1]


def test_what_is_not_confirmed_is_rejected_and_teaches_nothing():
    eyes = np.arange(3)[:, None] * np.ones(3)
    offers = {1: [Candidate(grown(2), 0.99), Candidate(~OBJECT, 0.9)], 2: [Candidate(OBJECT, 0.1)]}
    support = Support.none(SIDE**2)
    steps = propagate(support, {0: OBJECT}, eyes, flat, lambda view, _: offers[view])
    assert next(steps).what == GIVEN
    before = support.inside.copy(), support.outside.copy()
    rejected = next(steps)
    assert (rejected.what, rejected.mask) == (REJECTED, None)
    assert (support.inside == before[0]).all() and (support.outside == before[1]).all()
    taken = next(steps)
    assert taken.what == ACCEPTED and (taken.mask == OBJECT).all()
    assert (support.inside == 2 * before[0]).all() and (support.outside == 2 * before[1]).all()


@pytest.mark.parametrize("pixels", [0, LEAST_KNOWN - 1, LEAST_KNOWN, LEAST_KNOWN + 1])
def test_a_view_that_shows_little_decides_nothing_and_asks_nobody(pixels):
    total = np.zeros(SIDE**2)
    total[np.flatnonzero(OBJECT.ravel())[: int(pixels)]] = 1
    asked = []

    def shown(view: int, masks: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        here = total if view else np.ones(SIDE**2)
        return [mask.ravel() * here for mask in masks], here

    def ask(view: int, support: Support) -> list[Candidate]:
        asked.append(view)
        return [Candidate(OBJECT & total.reshape(OBJECT.shape).astype(bool), 1.0)]

    found = list(propagate(Support.none(SIDE**2), {0: OBJECT}, np.eye(2, 3), shown, ask))
    assert found[1].what == (ACCEPTED if pixels >= LEAST_KNOWN else UNKNOWN)
    assert asked == ([1] if pixels >= LEAST_KNOWN else [])


def test_candidates_of_nothing_and_of_everything_are_none():
    offers = [Candidate(np.zeros_like(OBJECT), 1.0), Candidate(np.ones_like(OBJECT), 1.0)]
    steps = propagate(Support.none(SIDE**2), {0: OBJECT}, np.eye(2, 3), flat, lambda *_: offers)
    assert [d.what for d in steps] == [GIVEN, REJECTED]


def test_overlapping_pixels_go_to_the_object_of_more_support_a_pixel():
    left, right = np.zeros((4, 6), bool), np.zeros((4, 6), bool)
    left[:, :4], right[:, 2:] = True, True
    strong, weak = Decision(0, ACCEPTED, left, 160.0, 0.1), Decision(0, ACCEPTED, right, 80.0, 0.9)
    labels = merge({7: strong, 3: weak}, (4, 6), {})
    assert (labels == [[7, 7, 7, 7, 3, 3]] * 4).all()
    assert (merge({3: weak, 7: strong}, (4, 6), {}) == labels).all()  # in any order
    tie = Decision(0, ACCEPTED, right, 160.0, 0.9)  # as many pixels, as much support: the surer
    assert (merge({7: strong, 3: tie}, (4, 6), {}) == [[7, 7, 3, 3, 3, 3]] * 4).all()


def test_an_object_without_a_mask_says_nothing_of_its_own_pixels():
    mask = np.zeros((2, 4), bool)
    mask[:, 0] = True
    share = np.array([[1, 0.51, 0.5, 0.0]] * 2)
    found = merge(
        {1: Decision(0, GIVEN, mask, 2.0, 1.0), 2: Decision(0, REJECTED)}, (2, 4), {2: share}
    )
    assert (found == [[1, SILENT, 0, 0]] * 2).all() and found.dtype == np.uint8
