"""What other photos say of cut objects: agreement, each reason for doubt, and boxes that ask.

test_label_photos.py has the demo's mug, cut wrong.
"""

import numpy as np
import pytest

pytest.importorskip("pyopencl")

from shapeshift.decomposition.completion.plane import Plane
from shapeshift.decomposition.judge import (
    BEST,
    DOUBT,
    FEW,
    LEAST_NODES,
    TWO,
    AskedTally,
    box_of,
    color_columns,
    doubt_of,
    judgement,
    second_thing,
)
from shapeshift.decomposition.masks.specs import ObjectSpec
from shapeshift.decomposition.segment_scene import SegmentedPart
from shapeshift.decomposition.walk_objects import ON_PLANE
from shapeshift.runtime_models.stop import Stop

NAMES = {1: "mug", 2: "banana"}


def told(
    shown: int, fresh: int, height: int | None = None, of: int = 1, views: int = 1
) -> AskedTally:
    """Of views in which label `of` has rows 2 to `shown`, and afresh rows 2 to `fresh`."""
    tally = AskedTally()
    for _ in range(views):
        labels, again = np.zeros((40, 12), np.uint8), np.zeros((40, 12), np.uint8)
        labels[2:shown, 2:10], again[2:fresh, 2:10] = of, of
        high = None if height is None else np.full(labels.shape, height, np.uint8)
        tally.add(of, labels, again, high)
    return tally


def test_agreement_is_that_of_the_best_whole_views():
    tally = told(22, 22)
    for fresh in (12, 17, 21, 22):
        tally.ious += told(22, fresh).ious
        tally.cut_off += [False]
    assert tally.agreement() == pytest.approx(np.mean(sorted(tally.ious)[-BEST:]))
    tally.cut_off = [True] * 4 + [False]
    assert tally.agreement() == 1.0  # the one that no border cuts
    tally.cut_off = [True] * 5
    assert tally.agreement() == pytest.approx(np.mean(sorted(tally.ious)[-BEST:]))
    assert np.isnan(AskedTally().agreement())


@pytest.mark.parametrize(
    ("tally", "doubt"),
    [(told(22, 22), ""), (told(22, 21, ON_PLANE[0]), ""),
     (told(22, 20, ON_PLANE[0]), "holds a piece of what it stands on"),
     (told(22, 12, 255), "holds more than other photos show"),
     (told(22, 20, 255), ""), (told(12, 22), "a part of it may be missing"),
     (told(22, 12, ON_PLANE[0] + ON_PLANE[1]), "holds more than other photos show"),
     (told(22, 12, ON_PLANE[0] + ON_PLANE[1] - 1), "holds a piece of what it stands on")],
)  # fmt: skip
def test_each_reason_is_said_in_words(tally, doubt):
    assert doubt_of(tally, NAMES) == doubt


def test_what_another_one_has_is_named():
    labels, again = np.zeros((40, 12), np.uint8), np.zeros((40, 12), np.uint8)
    labels[2:22, 2:10], again[2:12, 2:10], again[12:22, 2:10] = 1, 1, 2
    tally = AskedTally()
    tally.add(1, labels, again, None)
    assert doubt_of(tally, NAMES) == "shares its mask with banana"
    assert tally.agreement() < DOUBT and tally.missing == 0


@pytest.mark.parametrize(
    ("pixels", "tally", "second", "agreement", "doubt"),
    [(FEW, told(22, 22), 0.0, 1.0, ""), (FEW, told(22, 22), 0.25, 0.75, TWO),
     (FEW, told(12, 22), 0.5, 0.25, f"a part of it may be missing; {TWO}"),
     (FEW - 1, told(22, 22), 0.25, np.nan, "too little seen: 99 pixels"),
     (FEW, AskedTally(), 0.25, np.nan, "no other photo shows it")],
)  # fmt: skip
def test_a_row_has_what_was_found(pixels, tally, second, agreement, doubt):
    part = SegmentedPart(ObjectSpec(1, "mug"), 1, 50, float(pixels))
    found = judgement(part, tally, second, NAMES)
    assert found.agreement == pytest.approx(agreement, nan_ok=True)
    assert (found.name, found.photos, found.doubt) == ("mug", len(tally.ious), doubt)


def test_a_silhouettes_box_has_room_and_no_specks():
    mask = np.zeros((50, 60), bool)
    assert box_of(mask) is None
    mask[10:12, 20:25] = True  # 10 pixels
    assert box_of(mask) is None
    mask[12, 20:22] = True  # 12
    assert box_of(mask) == (19.0, 9.0, 26.0, 14.0)
    mask[10:40, 20:50] = True
    mask[0, 0] = True
    assert box_of(mask) == pytest.approx((18.2, 8.2, 51.8, 41.8))


# Two things that were marked as one: points of solids on a table, made here.

TABLE = Plane(np.array([0.0, 1.0, 0.0]), 0.0)
RED, YELLOW, GREEN, WHITE = (0.75, 0.1, 0.08), (0.9, 0.74, 0.16), (0.2, 0.5, 0.3), (0.9, 0.9, 0.85)


def ball_at(x: float, y: float, radius: float, count: int = 400) -> np.ndarray:
    """(count, 3) about even on a sphere."""
    k = np.arange(count) + 0.5
    up, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(1 - up**2)
    unit = np.stack([flat * np.cos(turn), up, flat * np.sin(turn)], axis=1)
    return unit * radius + (x, y, 0)


def block_at(x: float, y: float, half: float) -> np.ndarray:
    """The sides and the top of a cube, in steps of a tenth of its half side."""
    line = np.arange(-1, 1.001, 0.1)
    grid = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
    outer = (np.abs(grid) > 0.999).any(1) & (grid[:, 1] > -0.999)
    return grid[outer] * half + (x, y, 0)


def lit(places: np.ndarray, color: tuple) -> np.ndarray:
    """The colour in light from above: a third of it below, with some noise."""
    up = (places[:, 1:2] - places[:, 1].min()) / np.ptp(places[:, 1])
    noise = np.random.default_rng(0).normal(0, 0.01, (len(places), 3))
    return np.clip((0.33 + 0.67 * up) * color + noise, 0, 1)


def second_of(*solids: tuple[np.ndarray, tuple]) -> float:
    places = np.concatenate([at for at, _ in solids])
    return second_thing(places, np.concatenate([lit(*solid) for solid in solids]), TABLE)


BALL, OTHER = ball_at(0, 0.037, 0.037), ball_at(0.07, 0.033, 0.033)


@pytest.mark.parametrize(
    "solids",
    [[(BALL, RED), (OTHER, YELLOW)],  # two fruits that touch
     [(block_at(-0.04, 0.04, 0.04), RED), (block_at(0.04, 0.04, 0.04), YELLOW)],  # with whole sides
     [(BALL, RED), (ball_at(0.2, 0.033, 0.033), GREEN)],  # apart, in one box
     [(BALL, WHITE), (block_at(0.075, 0.037, 0.037), RED)]],
)  # fmt: skip
def test_an_unlisted_neighbour_is_a_second_thing(solids):
    one, other = (len(places) for places, _ in solids)
    assert second_of(*solids) == pytest.approx(min(one, other) / (one + other), abs=0.05)


@pytest.mark.parametrize(
    "solids",
    [[(BALL, RED)], [(BALL, YELLOW)], [(block_at(0, 0.04, 0.04), WHITE)],
     [(BALL[BALL[:, 1] > 0.037], RED), (BALL[BALL[:, 1] <= 0.037], WHITE)],  # its upper half
     [(block_at(0, 0.03, 0.03), GREEN), (ball_at(0, 0.09, 0.03), RED)],  # a knob on it
     [(BALL, RED), (OTHER[:40], YELLOW)],  # a leaf of less than an eighth
     [(BALL, RED), (OTHER, RED)],  # of one colour: nothing tells them from a dumb-bell
     [(BALL[::11], RED), (OTHER[:2], YELLOW)]],  # of 39 places nothing is said
)  # fmt: skip
def test_one_thing_has_no_second(solids):
    assert second_of(*solids) == 0


@pytest.mark.parametrize("count", [0, 1, LEAST_NODES - 1, LEAST_NODES])
def test_few_places_or_one_of_them_say_nothing(count):
    assert second_thing(np.zeros((count, 3)), np.zeros((count, 3)), TABLE) == 0


def test_colours_are_those_of_the_first_stop_that_has_them():
    heat, rgb = Stop("Thermal", 1.0, "thermal"), Stop("RGB", 0.0)
    assert color_columns([rgb, heat]) == slice(0, 3)
    assert color_columns([heat, heat, rgb]) == slice(2, 5)
    assert color_columns([heat]) is None
