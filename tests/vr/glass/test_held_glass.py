"""Where a hand holds the glass, when its edge hides it, and which pixels of the eyes it covers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.frame import LOST
from shapeshift.vr.glass import (
    FACES,
    HANDLE_M,
    RADIUS_M,
    SIDEWAYS,
    STEP_PX,
    HeldGlass,
    boxes_of,
    frame_of,
    held_glass,
)
from tests.support.vr.vr_glass import BEFORE, upright
from tests.support.vr.vr_hands import HEAD, eyes

SIZE = (640, 580)
EYES = eyes(SIZE)


def test_it_stands_on_the_thumb_s_side_and_looks_at_the_head():
    glass = held_glass(upright(), HEAD)
    above = glass.play_from_glass.position - BEFORE
    np.testing.assert_allclose(above, (0, HANDLE_M + RADIUS_M, 0), atol=1e-12)
    axes = glass.play_from_glass.matrix()[:3, :3]
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(axes[:, 2], (0, 0, 1), atol=1e-12)
    assert held_glass(LOST, HEAD) is None


def test_from_its_back_it_is_a_glass_as_well():
    """Its name is to be read from there, too: right stays right."""
    axes = held_glass(upright(turned=math.pi), HEAD).play_from_glass.matrix()[:3, :3]
    np.testing.assert_allclose(axes, np.eye(3), atol=1e-12)


def test_turned_sideways_it_is_hidden_and_does_not_tremble():
    """The thresholds are cosines to the line of sight; from below straight ahead is not level."""
    middle = np.add(BEFORE, (0, HANDLE_M + RADIUS_M, 0))
    sight = HEAD.position - middle
    level, length = math.hypot(sight[0], sight[2]), float(np.linalg.norm(sight))
    start = math.atan2(sight[0], sight[2])

    def seen(cosine: float, was: bool) -> bool:
        turned = start + math.acos(cosine * length / level)
        return held_glass(upright(turned=turned), HEAD, was) is not None

    assert not seen(0.0, True)
    assert seen(FACES + 1e-6, False) and not seen(FACES - 1e-6, False)
    assert seen(SIDEWAYS + 1e-6, True) and not seen(SIDEWAYS - 1e-6, True)


def test_a_head_in_it_sees_none():
    glass = held_glass(upright(), HEAD)
    inside = Pose(glass.play_from_glass.position + np.array([0, 0, RADIUS_M * 0.9]), HEAD.wxyz)
    assert held_glass(upright(), inside) is None


def points_of(glass: HeldGlass) -> np.ndarray:
    """(n, 3) all over the disc, its edge too: not as boxes_of takes them."""
    rng = np.random.default_rng(5)
    turns, parts = rng.uniform(0, 2 * np.pi, 4000), np.sqrt(rng.uniform(0, 1, 4000))
    parts[:2000] = 1.0
    return np.array([
        glass.point(r * math.cos(t) * RADIUS_M, r * math.sin(t) * RADIUS_M)
        for t, r in zip(turns, parts, strict=True)
    ])  # fmt: skip


@pytest.mark.parametrize("turned", [0.0, 0.9, -1.1])
@pytest.mark.parametrize(
    "position", [BEFORE, (-0.55, 1.2, -0.4), (0.3, 1.75, -0.25), (0.0, 1.4, -0.12)]
)
def test_both_boxes_are_as_large_and_hold_every_pixel_of_the_disc(position, turned):
    glass = held_glass(upright(position, turned), HEAD)
    if glass is None:
        assert turned, "its edge is turned to the head there"
        return
    boxes = boxes_of(glass, EYES)
    places = points_of(glass)
    sizes = {box[2:] for box in boxes or ()}
    assert len(sizes) == (boxes is not None)
    for view, box in zip(EYES, boxes or (None, None), strict=True):
        clip = view.clip_from_eye() @ view.eye_from_world() @ np.c_[places, np.ones(len(places))].T
        at = (clip[:2] / clip[3] + 1) / 2 * np.array([[SIZE[0]], [SIZE[1]]])
        seen = (clip[3] > view.near) & (at >= 0).all(axis=0) & (at.T < SIZE).all(axis=1)
        if box is None:
            assert not seen.any()
            continue
        left, bottom, width, height = box
        assert 0 <= left <= left + width <= SIZE[0] and 0 <= bottom <= bottom + height <= SIZE[1]
        inside = (at.T >= (left, bottom)) & (at.T < (left + width, bottom + height))
        assert inside.all(axis=1)[seen].all()


def test_a_small_disc_has_a_small_box_and_none_where_nobody_sees_it():
    glass = held_glass(upright(), HEAD)
    (_, _, width, height), _ = boxes_of(glass, EYES)
    assert width * height < 0.15 * SIZE[0] * SIZE[1]
    assert width % STEP_PX == height % STEP_PX == 0, "its textures are not made anew each frame"
    behind = Pose(HEAD.position + np.array([0.0, 0.0, 1.0]), HEAD.wxyz)
    assert boxes_of(HeldGlass(behind), EYES) is None
    aside = Pose(HEAD.position + np.array([3.0, 0.0, -0.5]), HEAD.wxyz)
    assert boxes_of(HeldGlass(aside), EYES) is None


def test_the_rim_is_around_it_and_the_handle_reaches_into_the_hand():
    glass = held_glass(upright(), HEAD)
    *rim, handle, neck = frame_of(glass)
    for part in rim:
        for end in (part.a, part.b):
            away = np.linalg.norm(end - glass.play_from_glass.position)
            assert away == pytest.approx(RADIUS_M, abs=1e-9)
    np.testing.assert_array_equal(rim[0].a, rim[-1].b)
    low, high = sorted((handle.a[1], handle.b[1]))
    assert low < BEFORE[1] < high and neck.b[1] > high


def test_boxes_of_insets_are_their_own():
    """As many pixels of a glass as an inset has more than a wide view, and few where it sees none.

    The wide views' boxes are those that they have alone.
    """
    glass = held_glass(upright(), HEAD)
    wide = boxes_of(glass, EYES)
    near = [replace(view.resized((900, 800)), whole=view.tangents) for view in EYES]
    boxes = boxes_of(glass, [*EYES, *near])
    assert boxes[:2] == wide
    for box, (_, _, width, height) in zip(boxes[2:], wide, strict=True):
        assert box[2] > 1.2 * width and box[3] > 1.2 * height
    away = [replace(view, tangents=(0.8, 0.9, 0.9, 1.0)) for view in near]
    boxes = boxes_of(glass, [*EYES, *away])
    assert boxes[:2] == wide and [box[2:] for box in boxes[2:]] == [(STEP_PX, STEP_PX)] * 2
    small = [view.resized((5, 7)) for view in away]
    assert [box[2:] for box in boxes_of(glass, [*EYES, *small])[2:]] == [(5, 7)] * 2
