"""Lines over a picture: where they go, what they cover, what they keep."""

import numpy as np
import pytest

from shapeshift.renderer.gl.over_picture import Lines, Wire
from shapeshift.scene.pose import Pose, View

SIZE = (64, 48)
RED = (1.0, 0.0, 0.0, 1.0)


def view(tangents=(-0.5, 0.8, -0.4, 0.6)) -> View:
    return View(Pose(np.array([0.3, 0, 2]), np.array([1.0, 0, 0, 0])), tangents, 0.01, 100.0, SIZE)


def drawn(gpu, eye: View, *wires: Wire, lines: Lines | None = None) -> np.ndarray:
    """(H, W, 3) uint8, row 0 on top, of wires over gray."""
    lines = lines or Lines(gpu)
    target = gpu.target(SIZE, "f1")
    target.clear(0.2, 0.2, 0.2, 1.0)
    lines.draw(target, eye, wires)
    data = np.frombuffer(target.read(components=3, alignment=1), np.uint8)
    return data.reshape(SIZE[1], SIZE[0], 3)[::-1]


def horizontal(y: float, x0: float, x1: float) -> np.ndarray:
    return np.array([[[x0, y, 0], [x1, y, 0]]], np.float32)


@pytest.mark.parametrize("moved", [0.0, 0.4])
def test_a_line_lies_where_the_pinhole_says(gpu, moved):
    eye, matrix = view(), np.eye(4)
    matrix[1, 3] = moved
    picture = drawn(gpu, eye, Wire(horizontal(0.1, -5, 5), matrix, RED))
    rows = np.flatnonzero((picture == (255, 0, 0)).all(axis=2).all(axis=1))
    camera, _, fy, _, cy = eye.pinhole()
    _, y, z, _ = camera @ [0, 0.1 + moved, 0, 1]
    assert list(rows) == [int(fy * y / z + cy)]


def test_ends_are_ends_and_what_is_behind_the_eye_is_not_drawn(gpu):
    eye = view((-1, 1, -0.75, 0.75))
    picture = drawn(gpu, eye, Wire(horizontal(0.01, 0.3 - 1, 0.3 + 1), np.eye(4), RED))
    columns = np.flatnonzero((picture[..., 0] == 255).any(axis=0))
    assert abs(columns[0] - 16) <= 1 and abs(columns[-1] - 47) <= 1
    behind = np.eye(4)
    behind[2, 3] = 5.0
    picture = drawn(gpu, eye, Wire(horizontal(0.01, -1, 1), behind, RED))
    assert (picture == 51).all()


def test_ink_blends_and_nothing_is_left_on_the_device(gpu):
    lines, segments = Lines(gpu), horizontal(0.1, -5, 5)
    half = Wire(segments, np.eye(4), (1.0, 1.0, 1.0, 0.5))
    picture = drawn(gpu, view(), half, lines=lines)
    assert abs(int(picture.max()) - 153) <= 1
    made = gpu.allocations
    drawn(gpu, view(), half, lines=lines)
    assert gpu.allocations == made + 1  # the target alone: the segments are kept
    empty = Wire(np.zeros((0, 2, 3), np.float32), np.eye(4), RED)
    assert (drawn(gpu, view(), empty, lines=lines) == 51).all()
    made = gpu.allocations
    drawn(gpu, view(), half, lines=lines)
    assert gpu.allocations == made + 2, "segments that were not drawn are not kept"
    lines.release()
