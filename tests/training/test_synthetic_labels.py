"""The demo's true label maps against masks, places of things, and what taking away shows."""

import numpy as np
import pytest

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.synthetic import workshop
from shapeshift.training.synthetic.things import MOTOR, MUG
from shapeshift.training.synthetic.tracer import photograph, pixel_rays, trace
from tools.synthetic.labels import (
    LABELS,
    OBJECTS,
    is_opened,
    label_map,
    labels_of_places,
    labels_of_solids,
)

SIZE = (96, 72)


def at(target: tuple[float, float, float], size: tuple[int, int] = SIZE) -> View:
    eye = np.add(target, (0.1, 0.6, 0.5))
    return View(look_at(eye, target), perspective(0.7, size), 0.05, 100.0, size)


def test_ten_objects_and_every_one_has_solids_closed_and_opened():
    assert len(OBJECTS) == 10 and list(LABELS.values()) == list(range(11))
    for opened in (False, True):
        labels = labels_of_solids(opened)
        assert len(labels) == len(workshop.place(opened)[0].solids)
        assert set(labels) == set(LABELS.values())


def test_the_pixel_in_the_middle_shows_what_stands_there():
    for place, name in (((MUG[0], 0.05, MUG[2]), "mug"), (MOTOR, "motor")):
        assert label_map(at(place))[SIZE[1] // 2, SIZE[0] // 2] == LABELS[name]


def test_what_is_labelled_lies_where_the_ray_ends():
    # Another formula: distance fields at the places that rays reach name the same thing.
    view = workshop.dome(3, 0.1, SIZE)[1]
    for x in (0.0, 0.5, 1.0):
        rows, columns = (g.ravel() + 0.5 for g in np.mgrid[: SIZE[1], : SIZE[0]])
        d = pixel_rays(view, columns, rows)
        eye = np.broadcast_to(view.world_from_eye.position, d.shape)
        t, index = trace(workshop.place(is_opened(x))[0], eye, d)
        hit = index >= 0
        found, near, next_one = labels_of_places(eye[hit] + t[hit, None] * d[hit], x)
        # A cut-away face (the opened motor) is nearer in its distance field than it is in truth.
        clear = (near < 1e-4) & (next_one > 0.002)
        assert clear.mean() > 0.9
        assert np.array_equal(found[clear], label_map(view, x).ravel()[hit][clear])


def test_no_object_is_labelled_where_the_photo_shows_background():
    view = workshop.dome(8, 0.0, SIZE)[2]
    _, mask = photograph(view, workshop.radiance("RGB"))
    assert not label_map(view)[mask == 0].any()


def test_taking_one_away_changes_its_own_pixels_alone():
    view = at((MUG[0], 0.05, MUG[2]))
    before, after = label_map(view), label_map(view, without=("mug",))
    its = before == LABELS["mug"]
    assert its.sum() > 100 and not (after == LABELS["mug"]).any()
    assert np.array_equal(before[~its], after[~its])
    with pytest.raises(ValueError, match="no objects of the workshop: bench"):
        label_map(view, without=("bench",))


def test_the_nearest_stop_decides_what_is_opened():
    assert [is_opened(x) for x in (0, 0.5, 0.75, 0.76, 1)] == [False, False, False, True, True]
    view = at((-0.24, 0.2, -0.2))
    assert not np.array_equal(label_map(view, 0.0), label_map(view, 1.0))
