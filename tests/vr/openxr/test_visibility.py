"""The hidden mesh of an eye, in pyopenxr's own structure, as triangles."""

import ctypes

import numpy as np
import pytest

from shapeshift.vr.openxr.view_configuration import MOST, read_mask
from tests.support.xr.masked_eyes import answer, frame_mesh

xr = pytest.importorskip("xr", reason="pyopenxr is not installed", exc_type=ImportError)
CORNERS, ORDER = frame_mesh((-1.0, 0.5, -2.0, 1.0))


def test_corners_are_put_in_their_order():
    mesh = read_mask(xr, lambda mask: answer(mask, CORNERS, ORDER))
    wanted = np.array(CORNERS, np.float32)[ORDER].reshape(-1, 3, 2)
    np.testing.assert_array_equal(mesh.triangles, wanted)
    sides = mesh.triangles[:, 1:] - mesh.triangles[:, :1]
    area = np.abs(np.linalg.det(sides)).sum() / 2
    assert area == pytest.approx(1.5 * 3 * (1 - 0.6**2), rel=1e-6)


@pytest.mark.parametrize(
    ("corners", "order"),
    [
        ([], []),  # a runtime that hides nothing
        (CORNERS, [0, 1]),  # no whole triangle
        (CORNERS, [0, 1, 8]),  # a corner that is not there
        ([(0.0, float("nan")), (1.0, 0.0), (0.0, 1.0)], [0, 1, 2]),
        ([(0.0, float("inf")), (1.0, 0.0), (0.0, 1.0)], [0, 1, 2]),
    ],
)
def test_what_is_no_mesh_hides_nothing(corners, order):
    assert read_mask(xr, lambda mask: answer(mask, corners, order)) is None


def test_a_runtime_that_answers_with_nonsense_or_fails_hides_nothing():
    def huge(mask) -> bool:
        mask.vertex_count_output = mask.index_count_output = MOST + 1
        return True

    def fails_at_last(mask) -> bool:
        return not mask.vertex_capacity_input and answer(mask, CORNERS, ORDER)

    for fill in (huge, fails_at_last, lambda mask: False):
        assert read_mask(xr, fill) is None


def test_corners_beyond_the_last_whole_triangle_are_left_out():
    mesh = read_mask(xr, lambda mask: answer(mask, CORNERS, [*ORDER, 0, 1]))
    assert mesh.triangles.shape == (8, 3, 2)
    assert ctypes.sizeof(xr.Vector2f) == 8  # what is pointed at
