"""The first look at a capture: a photo where photos show only a part of it."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.cameras.photo_view import PART, depth_of_subject, photo_view
from shapeshift.scene.pose import View, look_at, perspective
from tests.support.models import make_random_model

SUBJECT = np.array([0.3, 0.2, -0.1])  # metres


def ring(count=12, away=2.0, fov_y=0.4, out=False):
    """Views on a level circle about the subject; out: they look away from it."""
    views = []
    for angle in np.arange(count) * (2 * np.pi / count):
        eye = SUBJECT + away * np.array([np.sin(angle), 0.3, np.cos(angle)])
        target = 2 * eye - SUBJECT if out else SUBJECT
        size = (160, 120)
        views.append(View(look_at(eye, target), perspective(fov_y, size), 0.01, 100.0, size))
    return views


def test_where_photos_show_all_the_whole_is_the_first_look():
    views = ring()
    half = 2.0 * np.sqrt(1.09) * np.tan(0.2) * 160 / 120  # metres that a photo shows to each side
    assert photo_view(views, SUBJECT, 0.999 * half / PART) is None
    assert photo_view(views, SUBJECT, 1.001 * half / PART) is not None
    assert photo_view([], SUBJECT, 1.0) is None


def test_the_look_is_that_of_a_photo_toward_what_all_photos_show():
    views = ring()
    found = photo_view(views, SUBJECT, 3.0)
    distance = np.linalg.norm([v.world_from_eye.position - found["eye"] for v in views], axis=1)
    assert distance.min() == 0
    np.testing.assert_allclose(found["target"], SUBJECT, atol=1e-9)  # every axis passes it
    assert found["fov_y"] == pytest.approx(0.4)


def test_an_odd_photo_is_not_the_one():
    """One from far away, one that looks past: neither is what a person expects."""
    far, past = ring(1, away=9.0)[0], ring(1, out=True)[0]
    usual = ring()
    found = photo_view([far, past, *usual], SUBJECT, 3.0)
    eyes = [tuple(v.world_from_eye.position) for v in usual]
    assert tuple(found["eye"]) in eyes


def test_a_room_photographed_from_its_middle():
    """Axes meet behind the cameras: the subject is then half the radius away."""
    views = ring(away=0.2, out=True)
    eyes = np.array([v.world_from_eye.position for v in views])
    ahead = -np.array([v.world_from_eye.matrix()[:3, 2] for v in views])
    assert (depth_of_subject(eyes, ahead, 4.0) == 2.0).all()
    found = photo_view(views, SUBJECT, 4.0)
    toward = np.array(found["target"]) - found["eye"]
    assert toward @ (np.array(found["eye"]) - SUBJECT) > 0  # outwards, as the photo does


def test_parallel_axes_meet_nowhere():
    one = ring(1)[0]
    eyes = np.array([one.world_from_eye.position + np.array([x, 0, 0]) for x in (0.0, 0.1, 0.2)])
    ahead = -np.tile(one.world_from_eye.matrix()[:3, 2], (3, 1))
    assert (depth_of_subject(eyes, ahead, 1.0) == 0.5).all()
    assert (depth_of_subject(eyes[:1], ahead[:1], 1.0) == 0.5).all()


def test_a_package_opens_there():
    model = make_random_model(anchors=30)
    found = photo_view(ring(), SUBJECT, 3.0)
    view = default_view(replace(model, provenance={"view": found}), (320, 180))
    np.testing.assert_allclose(view.world_from_eye.position, found["eye"], atol=1e-6)
