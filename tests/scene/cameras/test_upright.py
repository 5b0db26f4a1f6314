"""Which way is up: worlds turned on purpose by so many degrees, seen by level and other cameras."""

import numpy as np
import pytest

from shapeshift.scene.cameras.upright import (
    ASSUMED,
    LEAST_POINTS,
    PHOTOS,
    PLANES,
    STATED,
    Up,
    angle,
    believed,
    believed_words,
    disagree,
    doubts_of_up,
    turn_upright,
    up_of_photos,
    up_of_planes,
    up_of_points,
    ways_sentence,
)
from shapeshift.scene.pose import OPENCV_FROM_EYE, look_at

ZERO = Up(ASSUMED, (0.0, 1.0, 0.0))


def tilted(degrees: float, about: str = "x") -> np.ndarray:
    """(3, 3) a world in which +Y is so many degrees off."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    if about == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def cameras(turn: np.ndarray, elevations, azimuths, roll: float = 0.0) -> np.ndarray:
    """(N, 4, 4) OpenCV axes: looking at the origin; hands lean by `roll` degrees at random."""
    rng, out = np.random.default_rng(0), []
    for up, around in zip(np.radians(elevations), np.radians(azimuths), strict=True):
        eye = np.array([np.cos(up) * np.sin(around), np.sin(up), np.cos(up) * np.cos(around)])
        pose = look_at(2 * eye, np.zeros(3)).matrix() @ OPENCV_FROM_EYE
        pose[:3, :3] = pose[:3, :3] @ tilted(roll * rng.normal(), "z")
        out.append(pose)
    poses = np.array(out)
    poses[:, :3] = turn @ poses[:, :3]
    return poses


def plane(degrees: float, about: str = "x") -> np.ndarray:
    return tilted(degrees, about) @ (0, 1, 0)


def up(source: str, degrees: float, sure: bool = True) -> Up:
    return Up(source, tuple(plane(degrees).tolist()), sure)


TILTS = [0, 1, 5, 27, 68, 90, 179.9, 180]


@pytest.mark.parametrize("tilt", TILTS)
def test_level_photos_say_how_far_the_world_is_tilted(tilt):
    """From one side, 40 degrees above: their mean up leans by far more than the bound."""
    turn = tilted(tilt)
    found = up_of_photos(cameras(turn, [40] * 9, np.linspace(-60, 60, 9)))
    assert found.sure and found.off() == pytest.approx(tilt, abs=1e-4)
    assert angle(found.direction, turn[:, 1]) < 1e-4


@pytest.mark.parametrize("count,side,sure", [(100, 150, True), (6, 15, False)])
def test_hands_that_lean_at_random_make_few_photos_of_one_side_unsure(count, side, sure):
    """Six degrees of roll: the standard error over 100 photos all round, and over 6 within 30."""
    azimuths = np.linspace(-side, side, count)
    found = up_of_photos(cameras(np.eye(3), [30] * count, azimuths, roll=6.0))
    assert found.sure is sure and (not sure or found.off() < 2)


def test_cameras_that_only_look_down_know_up_by_where_they_come_from():
    """Headings all round: their up vectors cancel, their horizontal axes are all level."""
    azimuths = np.arange(0, 360, 30)
    for tilt in TILTS:
        turn = tilted(tilt)
        found = up_of_photos(cameras(turn, [89.999] * len(azimuths), azimuths))
        assert angle(found.direction, turn[:, 1]) < 0.01


def test_cameras_that_look_down_with_one_heading_know_nothing_for_sure():
    poses = cameras(np.eye(3), [89.999] * 5, [0] * 5)
    found = up_of_photos(poses)
    assert found is not None and not found.sure
    assert found.off() == pytest.approx(90, abs=0.01)  # it leans as they do
    assert believed([ZERO, found]) is ZERO
    ground = up(PLANES, 0)
    assert believed([up(ASSUMED, 0), found, ground]).off() == 0


def test_photos_held_upright_and_stored_lying_are_seen_to_be():
    quarter = np.diag([1.0, 1, 1, 1])
    quarter[:2, :2] = [[0, 1], [-1, 0]]
    for side in (quarter, quarter.T):
        poses = cameras(tilted(27), [30] * 12, np.arange(0, 360, 30)) @ side
        assert angle(up_of_photos(poses).direction, tilted(27)[:, 1]) < 1e-4


def test_no_photos_and_one_photo():
    assert up_of_photos(np.zeros((0, 4, 4))) is None
    assert not up_of_photos(cameras(np.eye(3), [30], [0])).sure


@pytest.mark.parametrize("degrees,said", [(0, False), (5, False), (5.001, True), (27, True),
                                          (68, True), (180, True)])  # fmt: skip
def test_what_is_more_than_five_degrees_apart_is_said(degrees, said):
    ways = [ZERO, up(PHOTOS, degrees)]
    assert disagree(*ways) is said
    sentence = ways_sentence(ways, believed(ways))
    assert bool(sentence) is said
    assert not said or f"{degrees:.1f} degrees" in sentence


@pytest.mark.parametrize("ways,used", [
    ([ZERO], ASSUMED),
    ([ZERO, up(PHOTOS, 1)], ASSUMED),  # confirms it
    ([ZERO, up(PHOTOS, 1.01)], PHOTOS),
    ([ZERO, up(PHOTOS, 60, sure=False)], ASSUMED),  # leans by what it looks down
    ([ZERO, up(PHOTOS, 180, sure=False)], PHOTOS),  # upside down is no leaning
    ([ZERO, up(PLANES, 27)], PLANES),
    ([ZERO, up(PHOTOS, 27), up(PLANES, 26)], PLANES),
    ([ZERO, up(PHOTOS, 0), up(PLANES, 45)], PLANES),
    ([ZERO, up(PHOTOS, 0), up(PLANES, 45.01)], ASSUMED),  # things that hang on a wall
    ([ZERO, up(PHOTOS, 0, sure=False), up(PLANES, 68)], PLANES),
    ([ZERO, up(PHOTOS, 0, sure=False), up(PLANES, 91)], ASSUMED),
    ([Up(STATED, (0.0, 1.0, 0.0)), up(PHOTOS, 27), up(PLANES, 26)], STATED),
])  # fmt: skip
def test_which_way_is_believed(ways, used):
    assert believed(ways).source == used


def test_of_several_planes_most_things_decide_then_what_is_nearer_to_the_photos():
    near, far = plane(27), plane(90, "z")
    found, others = up_of_planes({"mug": near, "clock": far, "cup": plane(29)}, [ZERO])
    assert found.things == ("mug", "cup") and others == ("clock",)
    assert found.off() == pytest.approx(28, abs=1e-6)  # their mean
    found, others = up_of_planes({"clock": far, "mug": near}, [ZERO, up(PHOTOS, 25)])
    assert found.things == ("mug",) and others == ("clock",)
    assert up_of_planes({}, [ZERO]) == (None, ())


@pytest.mark.parametrize("degrees,one", [(5, True), (5.01, False)])
def test_planes_at_five_degrees_are_one(degrees, one):
    _, others = up_of_planes({"mug": plane(0), "cup": plane(degrees)}, [ZERO])
    assert (not others) is one


@pytest.mark.parametrize("tilt", TILTS)
def test_the_turn_is_a_rotation_that_brings_up_to_y(tilt):
    for about in "xz":
        turn = turn_upright(plane(tilt, about).tolist())
        np.testing.assert_allclose(turn @ plane(tilt, about), (0, 1, 0), atol=1e-8)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-8)
        assert np.linalg.det(turn) > 0
        # the shortest: its own angle is the tilt
        assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) == pytest.approx(tilt, abs=1e-3)


# The plane that most points of a capture lie on.

EYES = np.array([[0.0, 1.0, 2.0], [1.0, 1.2, 2.0], [-1.0, 0.9, -2.0]])


def room_of_points(on: int, beside: int, degrees: float = 0.0) -> np.ndarray:
    """(on + beside, 3): so many on a floor that leans about z, others all over above it."""
    rng = np.random.default_rng(0)
    flat = rng.uniform(-1, 1, (on, 3)) * (1, 0, 1)
    others = rng.uniform((-1, 0.3, -1), (1, 2, 1), (beside, 3))
    return np.concatenate([flat, others]) @ tilted(degrees, "z").T


@pytest.mark.parametrize("degrees", [0.0, 4.0, 30.0, 44.0])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_most_points_of_a_floor_say_up_in_any_unit(degrees, unit):
    points = unit * room_of_points(400, 300, degrees)
    found = up_of_points(points, unit * EYES, [ZERO])
    assert found is not None and found.source == PLANES and not found.things
    assert found.off() == pytest.approx(degrees, abs=0.1)
    under = up_of_points(points * (1, -1, 1), unit * EYES * (1, -1, 1), [Up(ASSUMED, (0, -1, 0))])
    assert under is not None and under.direction[1] == pytest.approx(-found.direction[1])


@pytest.mark.parametrize(
    ("points", "eyes"),
    [(room_of_points(150, 600), EYES),  # a fifth on the floor
     (room_of_points(LEAST_POINTS - 1, 0), EYES), (room_of_points(0, 2000), EYES),
     (room_of_points(400, 300, 60.0), EYES),  # a roof, or a wall
     (room_of_points(400, 300), np.zeros((0, 3))), (np.zeros((0, 3)), EYES),
     (np.zeros((400, 3)), EYES), (np.full((400, 3), np.nan), EYES)],
)  # fmt: skip
def test_other_points_say_nothing_of_up(points, eyes):
    assert up_of_points(points, eyes, [ZERO]) is None


def test_a_floor_far_from_what_was_taken_counts_by_the_photos():
    points, photos = room_of_points(400, 300, 60.0), Up(PHOTOS, tuple(plane(60.0, "z").tolist()))
    found = up_of_points(points, EYES, [ZERO, photos])
    assert found is not None and found.off(photos) < 0.1
    points[::7] = np.nan
    assert up_of_points(points, EYES, [ZERO, photos]) is not None
    assert up_of_points(room_of_points(LEAST_POINTS, 0), EYES, [ZERO]) is not None


def test_a_capture_says_all_ways_in_one_sentence_where_two_disagree():
    leaning = Up(PLANES, (np.sin(np.radians(4)), np.cos(np.radians(4)), 0.0))
    photos = Up(PHOTOS, (-leaning.direction[0], leaning.direction[1], 0.0))  # 8 degrees from it
    (said,) = doubts_of_up([ZERO, photos, leaning], np.eye(4))
    assert "4.0 degrees from up by the photos as they were held, [-0.070, 0.998, 0.000] and" in said
    assert "4.0 degrees from up by the plane of most points, [0.070, 0.998, 0.000] in its" in said
    assert doubts_of_up([ZERO, leaning], np.eye(4)) == ()
    assert believed_words(leaning, ZERO).startswith("the plane of most points is believed")
