"""The mouse as a hand: it stays under the mouse, pushes, pulls and turns."""

import numpy as np
import pytest

from shapeshift.scene.pose import Pose, View, look_at, perspective
from shapeshift.scene.world.grab import (
    NOTCH,
    MouseHand,
    hand_at,
    moved,
    multiply,
    pose,
    pushed,
    ray,
    rolled,
    turned,
)

SIZE = (800.0, 600.0)  # logical pixels, half of the view's
OFF_CENTRE = (-0.9, 0.5, -0.3, 0.6)


def view(tangents=None, eye=(1.0, 2.0, 3.0)) -> View:
    pixels = (1600, 1200)
    return View(look_at(np.array(eye), np.zeros(3)), tangents or perspective(0.8, pixels), 0.01,
                100.0, pixels)  # fmt: skip


def on_picture(view: View, point: np.ndarray) -> np.ndarray:
    """(2,) logical pixels by the projection matrix that the renderer uses."""
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.append(point, 1.0)
    ndc = clip[:2] / clip[3]
    return np.array([(ndc[0] + 1) / 2 * SIZE[0], (1 - ndc[1]) / 2 * SIZE[1]])


@pytest.mark.parametrize("tangents", [None, OFF_CENTRE])
@pytest.mark.parametrize("place", [(0.0, 0.0), (800.0, 600.0), (123.0, 456.0)])
def test_a_ray_goes_through_its_pixel(tangents, place):
    eye = view(tangents)
    origin, unit = ray(eye, place, SIZE)
    assert np.linalg.norm(unit) == pytest.approx(1)
    np.testing.assert_allclose(on_picture(eye, origin + 2.5 * unit), place, atol=1e-6)


@pytest.mark.parametrize("tangents", [None, OFF_CENTRE])
def test_what_is_taken_stays_under_the_mouse(tangents):
    eye = view(tangents)
    point = np.array([0.1, -0.2, 0.3])
    hand = hand_at(eye, SIZE, point)
    np.testing.assert_allclose(hand.place, on_picture(eye, point), atol=1e-9)
    np.testing.assert_allclose(pose(hand, eye, SIZE).position, point, atol=1e-9)
    hand = moved(moved(hand, 30.0, 10.0, SIZE), -7.0, 33.0, SIZE)
    there = pose(hand, eye, SIZE).position
    np.testing.assert_allclose(
        on_picture(eye, there), on_picture(eye, point) + np.array([23, 43]), atol=1e-6
    )
    forward = -eye.world_from_eye.matrix()[:3, 2]
    assert abs(forward @ (there - point)) < 1e-9  # in the plane that it was taken in
    for nearer in (-5, 5):
        away = pose(pushed(hand, nearer, eye), eye, SIZE).position
        np.testing.assert_allclose(on_picture(eye, away), on_picture(eye, there), atol=1e-6)
        ratio = (forward @ (away - eye.world_from_eye.position)) / hand.depth_m
        assert ratio == pytest.approx(NOTCH**nearer)


def test_it_moves_with_the_eye():
    hand = MouseHand((400.0, 300.0), 2.0)
    for eye in (view(), view(eye=(-3, 1, 1))):
        at = pose(hand, eye, SIZE).position
        np.testing.assert_allclose(on_picture(eye, at), [400, 300], atol=1e-6)


def test_it_leaves_neither_the_picture_nor_the_eye():
    eye, hand = view(), MouseHand((400.0, 300.0), 2.0)
    assert moved(hand, 1e6, -1e6, SIZE).place == (800.0, 0.0)
    assert pushed(hand, -1e9, eye).depth_m == 0.02
    assert pushed(hand, 1e9, eye).depth_m == 1000.0
    outside = MouseHand((-50.0, 700.0), 2.0)  # the middle of something large
    assert moved(outside, -10, 10, SIZE).place == outside.place
    assert moved(outside, 10, -10, SIZE).place == (-40.0, 690.0)
    behind = hand_at(eye, SIZE, eye.world_from_eye.position)
    assert behind.depth_m == 0.02


def axes(hand: MouseHand) -> np.ndarray:
    return Pose(np.zeros(3), np.array(hand.wxyz)).matrix()[:3, :3]


def test_a_turn_rolls_what_is_held_under_the_mouse():
    eye, hand = view(), MouseHand((400.0, 300.0), 2.0)
    right, up, back = eye.world_from_eye.matrix()[:3, :3].T
    assert (axes(turned(hand, 20, 0, eye)) @ back) @ right > 0.1  # its near side goes right
    assert (axes(turned(hand, 0, 20, eye)) @ back) @ up < -0.1  # and down
    assert (axes(rolled(hand, 1, eye)) @ up) @ right > 0.1  # its upper side goes right
    for there, back_again in (
        (turned(hand, 20, 0, eye), lambda h: turned(h, -20, 0, eye)),
        (rolled(hand, 3, eye), lambda h: rolled(h, -3, eye)),
    ):
        np.testing.assert_allclose(back_again(there).wxyz, hand.wxyz, atol=1e-12)
    assert turned(hand, 20, 5, eye).place == hand.place
    many = hand
    for _ in range(5000):
        many = turned(many, 3.0, -2.0, eye)
    assert np.linalg.norm(many.wxyz) == pytest.approx(1, abs=1e-12)


def test_two_turns_are_one():
    rng = np.random.default_rng(0)
    a, b = (q / np.linalg.norm(q) for q in rng.normal(size=(2, 4)))
    both = Pose(np.zeros(3), multiply(a, b)).matrix()
    np.testing.assert_allclose(
        both, Pose(np.zeros(3), a).matrix() @ Pose(np.zeros(3), b).matrix(), atol=1e-12
    )
