"""Lengths over a picture: lines where points are seen, nothing of what is behind the eye."""

import numpy as np

from shapeshift.app.inspection.length_pictures import with_lengths
from shapeshift.scene.inspection.length_marks import LengthMark
from shapeshift.scene.inspection.value_picture import ValuePicture
from tests.support.scene.warm_wall import wall_view

GRAY = 0.4


def test_points_and_lines_are_where_they_are_seen_and_the_rest_stays():
    view = wall_view().resized((480, 360))
    picture = np.full((360, 480, 3), GRAY, np.float32)
    ends = np.array([(-0.2, 0.1, 0.0), (0.2, 0.1, 0.0)])
    behind = ends + 2 * np.array([0, 0, view.world_from_eye.position[2]])
    shown = [(LengthMark("L1", "distance", ends), "0.400 m")]
    drawn = with_lengths(picture, view, shown)
    nothing = np.zeros((0, 0))
    pixels, _ = ValuePicture(view, nothing, nothing).pixel_of(ends)
    for column, row in (*pixels, pixels.mean(axis=0)):
        assert drawn[int(row), int(column)].min() > 0.9  # white: points, and the line between
    assert np.abs(drawn[:60] - GRAY).max() < 0.01  # above it nothing was drawn
    both = with_lengths(picture, view, [*shown, (LengthMark("L2", "distance", behind), "0.400 m")])
    np.testing.assert_array_equal(both, drawn)
    assert with_lengths(picture, view, []) is picture
    square = np.array([(-0.2, 0.1, 0), (0.2, 0.1, 0), (0.2, -0.1, 0), (-0.2, -0.1, 0)])
    for kind, closed in (("area", True), ("polyline", False)):
        drawn = with_lengths(picture, view, [(LengthMark("A1", kind, square), "")])
        middle = square[[0, 3]].mean(axis=0)
        ((column, row),), _ = ValuePicture(view, nothing, nothing).pixel_of(middle[None])
        assert (drawn[int(row), int(column)].min() > 0.9) == closed  # from the last to the first
