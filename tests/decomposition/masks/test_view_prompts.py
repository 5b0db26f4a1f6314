"""Prompts from where the scene believes an object."""

import numpy as np
import pytest

from shapeshift.decomposition.label_photos import CLICKS, prompts_of


def test_a_box_about_it_and_clicks_deep_inside():
    share = np.zeros((60, 100))
    share[20:40, 30:70] = 0.9
    share[5, 5] = 1.0  # a speck
    box, both, clicks = prompts_of(share, "mug")
    assert box.text == "mug" and not len(box.inside)
    left, top, right, bottom = box.box
    assert 27 <= left <= 29 and 17 <= top <= 19 and 71 <= right <= 73 and 41 <= bottom <= 43
    assert both.box == box.box and (both.mask == (share == 0.9)).all()
    assert clicks.box is None and 1 <= len(clicks.inside) <= CLICKS
    for x, y in clicks.inside:
        assert share[int(y), int(x)] == 0.9 and min(x - 30, 70 - x, y - 20, 40 - y) > 4


def test_two_parts_are_one_object():
    share = np.zeros((40, 100))
    share[10:30, 10:30] = share[10:30, 70:90] = 1
    box, both, _ = prompts_of(share)
    assert box.box[0] < 10 and box.box[2] > 90
    assert {bool(x > 50) for x, _ in both.inside} == {True, False}


@pytest.mark.parametrize("share", [np.zeros((5, 5)), np.full((5, 5), 0.5), np.full((5, 5), np.nan)])
def test_where_nothing_is_believed_nothing_is_asked(share):
    assert prompts_of(share) == []


def test_a_whole_picture_and_a_thin_line():
    box, *_ = prompts_of(np.ones((8, 8)))
    assert box.box == (0, 0, 8, 8)
    line = np.zeros((30, 30))
    line[10] = 1
    assert len(prompts_of(line)) == 3
    line[:] = 0
    line[10, 10] = 1
    assert prompts_of(line) == []  # one pixel is none
