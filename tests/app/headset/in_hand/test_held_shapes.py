"""Sections and regions by hand: they follow the hand that squeezes, and stay when it opens."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.state.arrange import undo
from shapeshift.app.headset.in_hand.hand_tools import REACH_M
from shapeshift.scene.pose import Pose
from shapeshift.scene.sections.section import BoxShape, PlaneShape, moved_shape
from shapeshift.vr.frame import LOST, SIDES
from tests.support.vr.vr_hands import a_frame, moved
from tests.support.vr.vr_tools import Hands

TURN = np.array([0.8660254, 0.0, 0.5, 0.0])


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("plane", [True, False], ids=["plane", "box"])
def test_it_follows_the_hand_as_a_rigid_thing_and_stays_when_let_go(side, plane):
    """Against the two poses of the palm: what it was before, moved by all that the hand moved."""
    hands = Hands()
    tool = hands.tools.sections
    tool.add(plane=plane)
    shape = tool.shape
    place = tool.pivot if plane else np.array(shape.centre) + shape.axes[:, 0] * shape.half[0] * 0.8
    hands.at(np.add(place, (0.0, 0.02, 0.0)), side)
    before = hands.room.pose(hands.hands[side].grip).matrix()
    left = hands.squeeze(side)
    assert hands.tools.shapes.side == side and left.hands[side].squeeze == 0.0
    np.testing.assert_allclose(numbers(tool.shape), numbers(shape), atol=2e-6)
    grip = hands.hands[side].grip
    there = Pose(np.add(grip.position, (0.1, 0.2, -0.3)), TURN)
    hands.act(**{side: replace(hands.hands[side], grip=there)})
    after = hands.room.pose(there).matrix()
    wanted = moved_shape(shape, Pose.from_matrix(after @ np.linalg.inv(before)))
    # A file has six decimals of each number.
    np.testing.assert_allclose(numbers(tool.shape), numbers(wanted), atol=5e-6)
    drawn = hands.editor.scene.objects[0].sections
    assert drawn[0].shape == tool.current.shape, "what is drawn is cut so"
    hands.squeeze(side, 0.5)
    assert hands.tools.shapes.side == side, "a grip that weakens a little holds"
    hands.squeeze(side, 0.3)
    assert hands.tools.shapes.side == ""
    hands.act(**{side: moved(hands.hands[side], (0.5, 0.0, 0.0))})
    np.testing.assert_allclose(numbers(tool.shape), numbers(wanted), atol=5e-6)
    assert undo(hands.editor) == "move a section", "all of it is one step"
    np.testing.assert_allclose(numbers(tool.shape), numbers(shape), atol=1e-12)


def numbers(shape: PlaneShape | BoxShape) -> np.ndarray:
    if isinstance(shape, PlaneShape):
        return np.array([*shape.normal, shape.offset_m])
    wxyz = np.array(shape.wxyz)
    return np.array([*shape.centre, *shape.half, *(wxyz * np.sign(wxyz[0]))])


@pytest.mark.parametrize(
    ("away_m", "takes"), [(0.9 * REACH_M, True), (1.1 * REACH_M, False)], ids=["near", "farther"]
)
def test_a_plane_is_taken_from_a_reach_of_the_room_and_no_farther(away_m, takes):
    hands = Hands()
    hands.tools.sections.add(plane=True)
    normal = np.array(hands.tools.sections.shape.normal)
    aside = np.array([0.0, 0.2, 0.1]) * hands.editor.radius  # still of what is drawn
    hands.at(hands.tools.sections.pivot + aside - away_m * hands.room.scale * normal)
    left = hands.squeeze()
    assert (hands.tools.shapes.side == "right") == takes
    assert left.hands["right"].squeeze == (0.0 if takes else 1.0), "else it is the world's"


def test_beyond_what_is_drawn_of_it_a_plane_is_not_there():
    hands = Hands()
    hands.tools.sections.add(plane=True)
    hands.at(np.add(hands.tools.sections.pivot, (0.0, 3 * hands.editor.radius + 1.0, 0.0)))
    hands.squeeze()
    assert hands.tools.shapes.side == ""


def test_a_hand_that_comes_squeezing_or_comes_back_has_to_open_first():
    hands = Hands()
    hands.tools.sections.add(plane=True)
    hands.squeeze()  # far away
    hands.at(hands.tools.sections.pivot, squeeze=1.0)
    assert hands.tools.shapes.side == ""
    hands.squeeze(how=0.0)
    hands.squeeze()
    assert hands.tools.shapes.side == "right"
    held = hands.hands["right"]
    hands.act(right=LOST)
    assert hands.tools.shapes.side == "", "a hand that is lost has let go"
    hands.act(right=held)
    assert hands.tools.shapes.side == ""


def test_nothing_is_taken_while_the_tool_is_away_and_a_bare_hand_pinches_it():
    hands = Hands()
    tool = hands.tools.sections
    tool.add(plane=True)
    tool.on = False
    hands.at(tool.pivot)
    hands.squeeze()
    assert hands.tools.shapes.side == "" and len(hands.tools.shapes.lines()) == 0
    hands.squeeze(how=0.0)
    tool.on = True
    pinch = replace(hands.hands["right"], squeeze=1.0, trigger=1.0, joints=np.zeros((26, 4)))
    left = hands.act(right=pinch)
    assert hands.tools.shapes.side == "right"
    assert (left.hands["right"].squeeze, left.hands["right"].trigger) == (0.0, 0.0)
    tool.remove(0)
    hands.act()
    assert hands.tools.shapes.side == "", "what it held is gone"


def test_a_dot_of_a_box_moves_that_side_alone():
    hands = Hands()
    tool = hands.tools.sections
    tool.add(plane=False)
    shape = tool.shape
    handle = tool.handles()[1]
    hands.at(handle.place)
    hands.squeeze()
    by = 0.03
    step = hands.room.world_from_play.matrix()[:3, :3].T @ (by * handle.normal) / hands.room.scale
    hands.act(right=moved(hands.hands["right"], step))
    now = tool.shape
    np.testing.assert_allclose(now.half, np.add(shape.half, (0, by / 2, 0)), atol=2e-6)
    opposite = np.array(now.centre) - np.array(now.half)
    np.testing.assert_allclose(opposite, np.array(shape.centre) - np.array(shape.half), atol=4e-6)


def test_the_arrows_tip_turns_a_plane_about_its_dot():
    hands = Hands()
    tool = hands.tools.sections
    tool.add(plane=True)
    pivot, tip = (handle.place for handle in tool.handles())
    hands.at(tip)
    hands.squeeze()
    hands.at(np.add(pivot, (0.0, 0.4, 0.0)), squeeze=1.0)
    np.testing.assert_allclose(tool.shape.normal, (0, 1, 0), atol=2e-6)
    np.testing.assert_allclose(tool.shape.offset_m, pivot[1], atol=2e-6)


def test_it_is_brought_before_the_eyes_upright_and_keeps_the_left():
    hands = Hands()
    tool = hands.tools.sections
    tool.add(plane=True)
    hands.tools.bring()
    head = hands.room.pose(a_frame().head).matrix()
    np.testing.assert_allclose(tool.shape.normal, head[:3, 0], atol=2e-6)
    left, right = (head[:3, 3] + side * 0.5 * head[:3, 0] for side in (-1, 1))
    normal = np.array(tool.shape.normal)
    assert normal @ left < tool.shape.offset_m < normal @ right
    assert abs(normal @ (head[:3, 3] - head[:3, 2]) - tool.shape.offset_m) < 1e-5, "ahead"
    tool.add(plane=False)
    half = tool.shape.half
    hands.tools.bring()
    away = np.array(tool.shape.centre) - head[:3, 3]
    assert away @ -head[:3, 2] == pytest.approx(0.45 * hands.room.scale, abs=1e-5)
    assert tool.shape.half == half


@pytest.mark.parametrize("kind", ["box", "sphere", "half-space"])
def test_a_region_that_is_chosen_follows_the_hand_too(kind):
    hands = Hands()
    hands.editor.add_region(kind)
    regions = hands.editor.regions
    region, world = regions.current, hands.editor.scene.objects[0].world_from_object.matrix()
    centre = (world @ np.append(region.centre, 1.0))[:3]
    hands.at(centre)
    before = hands.room.pose(hands.hands["right"].grip).matrix()
    hands.squeeze()
    there = Pose(np.add(hands.hands["right"].grip.position, (0.1, 0.0, 0.1)), TURN)
    hands.act(right=replace(hands.hands["right"], grip=there))
    motion = hands.room.pose(there).matrix() @ np.linalg.inv(before)
    now = (world @ np.append(regions.current.centre, 1.0))[:3]
    np.testing.assert_allclose(now, (motion @ np.append(centre, 1.0))[:3], atol=1e-9)
    turned = motion[:3, :3] @ region.normal if kind == "half-space" else region.normal
    np.testing.assert_allclose(world[:3, :3] @ regions.current.normal, turned, atol=1e-9)
    hands.squeeze(how=0.0)
    assert undo(hands.editor) == f"move {region.name}"
    np.testing.assert_allclose(regions.current.centre, region.centre)
