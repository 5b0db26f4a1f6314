"""Render and verify: each reason to refuse, at its threshold, and a thing of the demo."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.decomposition.completion.verify import (
    LEAST_ALIKE_DB,
    LEAST_FEWER,
    LEAST_PIXELS,
    MOST_AWAY,
    MOST_LOST_DB,
    MOST_STRANGE,
    Cells,
    ModelPictures,
    PhotoView,
    Tally,
    expected_colors,
    judge,
    strangeness,
    verify,
)
from shapeshift.decomposition.partition import LabelledView
from shapeshift.runtime_models.model import AnchorFrames, AnchorModel
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.models import make_random_model

GOOD = Tally(
    views=3, before=1000, after=100, meant=100, met=100, alike_db=45.0,
    error_before=1.0, error_after=1.0, beside=1000, strange=0.0, filled=100,
    away=0.0, placed=100,
)  # fmt: skip


def unlike(before: float, after: float) -> np.ndarray:
    """Of one thing's pixels, as Tally has it."""
    return np.array([[0.0, before], [0.0, after]])


def test_a_good_step_is_accepted():
    verdict = judge(GOOD)
    assert verdict.is_accepted
    assert verdict.sentence() == "holes 1,000 -> 100 pixels in 3 views"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"views": 0}, "no view shows the thing"),
        ({"meant": 0, "met": 0}, "there was no hole"),
        ({"met": int(100 * LEAST_FEWER) - 1}, "it closes 74 % of the holes"),
        ({"alike_db": LEAST_ALIKE_DB - 1e-6}, "it changes what is not behind the thing"),
        ({"alike_db": float("nan")}, "it changes what is not behind the thing"),
        ({"error_after": 1.001 * 10 ** (MOST_LOST_DB / 10)}, "it is less like the photos"),
        ({"error_after": float("nan")}, "it is less like the photos"),
        ({"strange": 100 * MOST_STRANGE + 1e-6}, "its colours are not those around"),
        ({"strange": float("nan")}, "its colours are not those around"),
        ({"away": 100 * MOST_AWAY + 1e-6}, "sides of a cell off the plane"),
        ({"away": float("nan")}, "sides of a cell off the plane"),
        ({"unlike": unlike(1.0, 1.0 + 1e-9)}, "more like the plane around"),
        ({"unlike": unlike(1.0, float("nan"))}, "more like the plane around"),
    ],
)
def test_each_reason_to_refuse(change, word):
    verdict = judge(replace(GOOD, **change))
    assert not verdict.is_accepted
    assert word in verdict.sentence()
    assert verdict.sentence().startswith("refused: ")


@pytest.mark.parametrize(
    "change",
    [
        {"met": int(100 * LEAST_FEWER)},
        {"alike_db": LEAST_ALIKE_DB},
        {"strange": 100 * MOST_STRANGE},
        {"away": 100 * MOST_AWAY},
        {"unlike": unlike(1.0, 1.0)},
        # Half of the plane around looks like a hole, too: of a copy no more can be asked.
        {"met": int(50 * LEAST_FEWER) + 1, "usual": 100, "usual_bad": 50},
    ],
)
def test_the_thresholds_themselves_pass(change):
    assert judge(replace(GOOD, **change)).is_accepted


def test_strangeness_is_the_distance_to_the_nearest_colour():
    known = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
    told = strangeness(np.array([[0.0, 0.0, 0.1], [1.0, 0.8, 1.0]]), known)
    assert np.allclose(told, [0.1, 0.2])


@pytest.mark.parametrize(("own_db", "alike_db", "good"), [
    (25.0, 25.0, True), (25.0, 24.9, False), (40.0, LEAST_ALIKE_DB, True), (40.0, 29.9, False),
    (float("nan"), 29.9, False),
])  # fmt: skip
def test_a_scene_has_to_stay_no_more_alike_than_it_is_like_its_photos(own_db, alike_db, good):
    own_error = 1000 * 10 ** (-own_db / 10)
    tally = replace(GOOD, alike_db=alike_db, own_error=own_error * (1 + 1e-9), own=1000)
    assert judge(tally).is_accepted == good


def flat_model(lift: float) -> tuple[AnchorModel, PhotoView, Cells]:
    """A flat model, lifted by so many sides of the cells, and a view from above, its mask."""
    side = 0.02
    model = make_random_model(400)
    count = len(model.anchors)
    # 1e-4 of their size along the normal: means lie within 1e-4 of an offset of the plane.
    frames = AnchorFrames(
        np.tile(np.array([1, 1e-4, 1], np.float32), (count, 1)),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
    )
    # No splat is turned: each lies in the plane, and so does what one sees of it.
    turn = model.networks["rotation"]
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), model.splats_per_anchor)
    flat = replace(
        turn,
        weights=(*turn.weights[:-1], 0 * turn.weights[-1]),
        biases=(*turn.biases[:-1], upright),
    )
    model = replace(model, networks={**model.networks, "rotation": flat})
    places = np.random.default_rng(0).uniform(-0.1, 0.1, (count, 3)) * (1, 0, 1)
    places[:, 1] = 0.5 + lift * side
    after = replace(model, anchors=places.astype(np.float32), frames=frames)
    pose = look_at(np.array([0.02, 1.1, 0.05]), np.array([0, 0.5, 0.0]))
    view = View(pose, perspective(0.5, (64, 48)), 0.01, 10.0, (64, 48))
    labels = np.zeros((48, 64), np.uint8)
    labels[12:36, 16:48] = 1
    x, z = (g.ravel() for g in np.mgrid[-5:6, -5:6] * side)
    cells = Cells(np.stack([x, 0 * x + 0.5, z], 1), side, np.array([0.0, 1.0, 0.0]))
    return after, PhotoView(LabelledView(view, 0.0, labels)), cells


def test_colours_around_tell_what_is_expected_and_shadow_does_not():
    """Of a plane that is grey on its left and lighter on its right, with a black shadow."""
    photo = np.full((40, 60, 3), 0.4)
    photo[:, 30:] = 0.6
    place = np.zeros((40, 60), bool)
    place[15:25, 5:55] = True
    plane = ~place
    photo[25:28, 5:55] = 0.0
    wanted = np.full(photo.shape, np.nan)
    wanted[place] = expected_colors(photo, plane, place)
    assert wanted[20, 5:55].min() >= 0.4 - 1e-6 and wanted[20, 5:55].max() <= 0.6 + 1e-6
    assert (np.diff(wanted[20, 5:55, 0]) > 0).all()
    # A Gaussian of SPREAD: 24 pixels off the edge its other side weighs erfc(sqrt(2)) / 2 = 2.3 %.
    assert wanted[20, 6, 0] == pytest.approx(0.4, abs=0.2 * 0.03)
    assert expected_colors(photo, ~plane, plane) is not None
    few = np.zeros_like(plane)
    few.ravel()[: LEAST_PIXELS - 1] = True
    assert expected_colors(photo, few, place) is None


def test_pictures_that_are_kept_are_those_that_are_drawn(device):
    model, view, _ = flat_model(0.0)
    pictures, camera = ModelPictures(device, model), view.labelled.view
    picture, metres = pictures.seen(camera, 0.0)
    assert pictures.seen(camera, 0.0)[0] is picture
    # Where less than 1e-4 of the light is left, one of the two may stop (3DGS).
    assert np.abs(picture - pictures.draw(camera, 0.0)).max() < 2e-4
    solid = picture[..., 3] > 0.5
    assert np.isfinite(metres[solid]).all() and solid.any()
    pictures.room, pictures.kept = 0, {}  # none is kept where there is no room
    assert pictures.seen(camera, 0.0)[0] is not picture and not pictures.kept


def test_a_ghost_that_hides_the_plane_is_no_less_a_hole(device):
    """An opaque sheet three sides of a cell above the plane: alpha sees no hole."""
    ghost, view, cells = flat_model(3.0)
    filled, _, _ = flat_model(0.0)
    told = verify(device, ghost, filled, 1, [view], cells=cells)
    assert told.holes_before > 0.9 * 24 * 32 and told.holes_after < 0.1 * told.holes_before
    assert verify(device, filled, ghost, 1, [view], cells=cells).why.startswith("there was no hole")


@pytest.mark.parametrize("lift", [0.0, 0.4, -0.7, 3.0])
def test_fills_are_measured_from_their_plane(device, lift):
    """A flat model, lifted by so many sides of a cell, seen through a hole all over the mask."""
    after, view, cells = flat_model(lift)
    before = after.with_anchors(np.zeros(len(after.anchors), bool))
    told = verify(device, before, after, 1, [view], cells=cells)
    assert told.holes_before == 24 * 32
    assert told.holes_after < told.holes_before  # or nothing was measured
    assert told.away == pytest.approx(abs(lift), abs=0.05)
    assert verify(device, before, after, 1, [view]).away == 0
