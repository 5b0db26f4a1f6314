"""What other photos say of cut objects: agreement, each reason for doubt, and boxes that ask.

test_label_photos.py has the demo's mug, cut wrong.
"""

import numpy as np
import pytest

pytest.importorskip("pyopencl")

from shapeshift.decomposition.judge import (
    BEST,
    DOUBT,
    AskedTally,
    box_of,
    doubt_of,
)
from shapeshift.decomposition.walk_objects import ON_PLANE

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
