"""The clone stamp on planes made of numbers: where copies come from and where they land."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.decomposition.completion.complete import LEAST_LEFT, Stamp, find_stamp
from shapeshift.decomposition.completion.plane import (
    CELL,
    SHADOW,
    AnchorLooks,
    Plane,
    fit_plane,
    hidden_inside,
    support_plane,
)

STEP = 0.01  # metres between anchors
THING, OTHER = 1, 2
TURN = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]  # of the whole scene


def scene(
    half: int = 30, thing: int = 4, others: int = 0, seed: int = 0
) -> tuple[AnchorLooks, np.ndarray, np.ndarray]:
    """(looks, labels (A,), stripe (A,)): a striped plane, a block in its middle, hidden below.

    others: blocks of another label on a ring of that many anchors around the thing.
    """
    random = np.random.default_rng(seed)
    x, z = (g.ravel() for g in np.mgrid[-half : half + 1, -half : half + 1])
    hidden = (np.abs(x) < thing) & (np.abs(z) < thing)
    x, z = x[~hidden], z[~hidden]
    ground = np.stack([x, 0 * x, z], 1) * STEP + 5e-4 * random.standard_normal((len(x), 3))
    bx, by, bz = (
        g.ravel() for g in np.mgrid[-thing : thing + 1, 0 : 2 * thing, -thing : thing + 1]
    )
    block = np.stack([bx, by + 0.3, bz], 1) * STEP
    labels = [np.zeros(len(ground), int), np.full(len(block), THING)]
    places = [ground, block]
    if others:
        away = np.abs(ground).max(1) / STEP
        ring = ground[(away > thing + 3) & (away < thing + 3 + others)]
        places.append(ring + np.array([0, 0.02, 0]))
        labels.append(np.full(len(ring), OTHER))
    places, labels = np.concatenate(places), np.concatenate(labels)
    stripe = np.floor(places[:, 2] / (5 * STEP)) % 2
    colors = np.repeat((0.3 + 0.4 * stripe)[:, None], 3, 1)
    return AnchorLooks(places @ TURN.T, np.ones(len(places), bool), colors, STEP), labels, stripe


def test_the_plane_of_most_points_is_found():
    random = np.random.default_rng(0)
    flat = np.c_[random.uniform(-1, 1, (500, 2)), 1e-3 * random.standard_normal(500)] @ TURN.T
    junk = random.uniform(-1, 1, (400, 3))
    plane, on = fit_plane(np.concatenate([flat, junk]) + 3.0, 4e-3)
    # Least squares through 500 points of 1 mm: 1e-3 / sqrt(500) / .58 = 8e-5 radians a degree of
    # freedom; junk within 4 mm adds twice that at most.
    assert abs(plane.normal @ TURN[:, 2]) > 1 - 1e-6
    assert on[:500].mean() > 0.99
    assert on[500:].mean() < 0.05


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_points_have_no_plane(count):
    assert fit_plane(np.zeros((count, 3)), 0.01) is None


def test_points_on_a_line_have_no_plane():
    assert fit_plane(np.arange(9.0)[:, None] * np.ones(3), 0.01) is None


def test_a_thing_above_the_plane_stands_on_none():
    looks, labels, _ = scene()
    mine = labels == THING
    looks.places[mine] += 0.1 * TURN[:, 1]
    told = support_plane(looks, labels, THING)
    assert "stands on no plane" in told
    assert "103 mm" in told


def test_the_normal_points_to_the_thing():
    looks, labels, _ = scene()
    plane = support_plane(looks, labels, THING)
    assert isinstance(plane, Plane)
    assert plane.normal @ TURN[:, 1] > 1 - 1e-5
    looks.places[labels == THING] *= -1
    assert support_plane(looks, labels, THING).normal @ TURN[:, 1] < -1 + 1e-5


def test_one_patch_fills_the_hole_and_stripes_go_on():
    looks, labels, stripe = scene()
    stamp = find_stamp(looks, labels, THING, support_plane(looks, labels, THING))
    assert stamp.patches == 1
    assert stamp.filled == stamp.cells
    landed = (looks.places[stamp.rows] + stamp.shifts) @ TURN  # in the upright frame
    assert np.abs(landed[:, 1]).max() < 2e-3  # on the plane: noise of .5 mm
    # The footprint is 9 x 9 anchors; closing and growing add at most three cells on each side.
    assert np.abs(landed[:, [0, 2]]).max() < (4 + 3 * CELL) * STEP
    assert (labels[stamp.rows] == 0).all()
    # As dense as the plane around: within a row of anchors along its rim.
    dense = len(stamp.rows) / (stamp.filled * (stamp.cell_m / STEP) ** 2)
    assert 0.8 < dense < 1.2
    same = (np.floor(landed[:, 2] / (5 * STEP)) % 2) == stripe[stamp.rows]
    # Copies move by whole cells of 1.8 anchors, so by .9 of a stripe's 5 beside it at most.
    assert same.mean() > 1 - CELL / 2 / 5


def test_what_lay_in_the_hole_is_dropped_and_nothing_else():
    looks, labels, _ = scene()
    stamp = find_stamp(looks, labels, THING, support_plane(looks, labels, THING))
    upright = looks.places[stamp.dropped] @ TURN
    assert (labels[stamp.dropped] == 0).all()
    assert np.abs(upright[:, [0, 2]]).max() < (4 + 3 * CELL) * STEP


def test_what_photos_show_around_the_thing_stays():
    looks, labels, _ = scene()
    plane, evidence = support_plane(looks, labels, THING), np.ones(len(labels))
    all_anew = find_stamp(looks, labels, THING, plane)
    seen = find_stamp(looks, labels, THING, plane, evidence)
    unseen = find_stamp(looks, labels, THING, plane, evidence, core=False)
    assert unseen.cells < seen.cells < all_anew.cells
    assert unseen.dropped.sum() < all_anew.dropped.sum() / 3


def plane_under(looks, labels) -> Plane:
    found = support_plane(looks, labels, THING)
    assert isinstance(found, Plane)
    return found


def test_what_lies_in_a_shadow_is_copied_last():
    looks, labels, _ = scene(half=40)
    upright = looks.places @ TURN
    away = np.abs(upright[:, [0, 2]]).max(1) / STEP
    dark = (labels == 0) & (away < 12)  # a ring of shadow around the block
    colors = np.where(dark[:, None], 0.9 * SHADOW * 0.5, 0.5) * np.ones((1, 3))
    looks = replace(looks, colors=colors)
    stamp = find_stamp(looks, labels, THING, plane_under(looks, labels))
    assert isinstance(stamp, Stamp)
    assert stamp.filled == stamp.cells and not dark[stamp.rows].any()
    everywhere = replace(looks, colors=np.where(labels[:, None] == 0, 0.1, 0.5) * np.ones((1, 3)))
    assert isinstance(find_stamp(everywhere, labels, THING, plane_under(looks, labels)), Stamp)


def test_only_what_no_photo_shows_inside_and_above_the_plane_is_a_ghost():
    looks, labels, _ = scene()
    plane = plane_under(looks, labels)
    evidence = np.ones(len(labels))
    inside = np.array([[0, 4, 0], [1, 3, 1], [0, 4, 1], [0, -2, 0], [0, 30, 0], [9, 4, 0]]) * STEP
    places = np.concatenate([looks.places, inside @ TURN.T])
    more = replace(
        looks, places=places, there=np.ones(len(places), bool),
        colors=np.concatenate([looks.colors, np.zeros((6, 3))]),
    )  # fmt: skip
    labels = np.append(labels, np.zeros(6, int))
    evidence = np.append(evidence, [0.0, 0.24, 0.26, 0.0, 0.0, 0.0])  # of the median 1
    found = hidden_inside(more, labels, THING, evidence, plane)
    assert np.flatnonzero(found).tolist() == [len(labels) - 6, len(labels) - 5]
    under = hidden_inside(more, labels, THING, evidence, None)
    assert np.array_equal(under, found)  # it lies below the block, too
    assert not hidden_inside(more, labels, 7, evidence, plane).any()
    assert not hidden_inside(more, labels, THING, np.zeros(len(labels)), plane).any()


def test_several_patches_where_none_is_as_large():
    looks, labels, _ = scene(half=26, thing=9, others=8)
    stamp = find_stamp(looks, labels, THING, support_plane(looks, labels, THING))
    assert stamp.patches > 1
    assert stamp.filled >= (1 - LEAST_LEFT) * stamp.cells - 4


def test_no_free_place_is_said():
    looks, labels, _ = scene(half=12, thing=4, others=30)
    assert "no free place" in find_stamp(looks, labels, THING, support_plane(looks, labels, THING))


def test_nothing_removed_nothing_found():
    looks, labels, _ = scene()
    assert support_plane(looks, labels, 7) == "nothing of it can be seen"
