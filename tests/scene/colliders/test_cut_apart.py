"""Colliders cut apart: of boxes the volumes and the gap are known."""

import numpy as np
import pytest

from shapeshift.scene.colliders.convex_parts import hull_volume
from shapeshift.scene.colliders.cut_apart import (
    GAP,
    LEAST_DEPTH,
    MOST_CUT,
    apart,
    cut_apart,
    least_way,
    volume_of,
)
from tests.support.scene.physics_things import box, cup
from tests.support.scene.world_scenes import BOX, HALF

SIDE = 2 * HALF
CUBE = box(HALF, HALF, HALF).astype(np.float64)


def along(x: float) -> np.ndarray:
    return np.array([x, 0.0, 0.0])


@pytest.mark.parametrize("share", [2.1e-3, 0.01, 0.05, 0.2, 2 * MOST_CUT - 0.01])
def test_two_boxes_lose_half_of_what_they_share_each(share):
    (first, second), refused = cut_apart([[CUBE], [CUBE + along(SIDE * (1 - share))]])
    assert not refused
    each = SIDE**3 * (1 - share / 2) - GAP / 2 * SIDE**2
    assert volume_of(first) == pytest.approx(each, rel=1e-6)
    assert volume_of(second) == pytest.approx(each, rel=1e-6)
    assert second[0][:, 0].min() - first[0][:, 0].max() == pytest.approx(GAP, rel=1e-6)


@pytest.mark.parametrize("share", [2 * MOST_CUT + 0.01, 0.9])
def test_what_would_lose_too_much_stays_whole(share):
    shifted = CUBE + along(SIDE * (1 - share))
    (first, second), refused = cut_apart([[CUBE], [shifted]])
    assert refused == [(0, 1)]
    assert np.array_equal(first[0], CUBE) and np.array_equal(second[0], shifted)


@pytest.mark.parametrize("depth", [-0.01, 0.0, 0.99 * LEAST_DEPTH])
def test_what_touches_is_left_to_the_bit(depth):
    things = {1: BOX, 2: BOX}
    places = {1: np.zeros(3), 2: np.array([SIDE - depth, 0.0, 0.0])}
    found, refused = apart(things, places)
    assert found[1] is BOX and found[2] is BOX and not refused


def test_a_box_in_a_bowl_is_cut_nowhere_and_one_in_its_wall_is():
    bowl = [piece.astype(np.float64) for piece in cup(size=0.08)]
    inside, through = CUBE * 0.4, CUBE * 0.4 + along(0.046)
    (_, same), refused = cut_apart([bowl, [inside]])
    assert not refused and np.array_equal(same[0], inside)
    (walls, cut), refused = cut_apart([bowl, [through]])
    assert not refused and hull_volume(cut[0]) < hull_volume(through)
    depths = [least_way(wall, piece)[1] for wall in walls for piece in cut]
    assert max(depths) <= LEAST_DEPTH
