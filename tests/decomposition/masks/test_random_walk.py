"""The solver against numpy's, and a walk whose answer physics knows."""

import numpy as np
import pytest

from shapeshift.decomposition.masks.anchor_walk import conjugate_gradients


@pytest.mark.parametrize("count", [1, 2, 17, 60])
@pytest.mark.parametrize("columns", [1, 3])
def test_the_solver_solves(count, columns):
    rng = np.random.default_rng(count)
    half = rng.normal(size=(count, count))
    matrix = half @ half.T + count * np.eye(count)
    right = rng.normal(size=(count, columns)) * [[1, 1e-9, 1e6][:columns]][0]
    found = conjugate_gradients(
        lambda x: matrix @ x, matrix.diagonal(), right, np.zeros_like(right), 1e-10, 1000
    )
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-6, atol=1e-16)


def test_nothing_on_the_right_gives_nothing_and_no_warning():
    with np.errstate(all="raise"):
        found = conjugate_gradients(
            lambda x: 2 * x, np.full(5, 2.0), np.zeros((5, 2)), np.zeros((5, 2)), 1e-6, 10
        )
    assert not found.any()


def test_columns_do_not_touch_each_other():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(30, 30))
    matrix = half @ half.T + np.eye(30)
    right = rng.normal(size=(30, 4))

    def solve(columns: np.ndarray) -> np.ndarray:
        return conjugate_gradients(
            lambda x: matrix @ x, matrix.diagonal(), columns, np.zeros_like(columns), 1e-12, 300
        )

    together = solve(right)
    for k in range(4):
        np.testing.assert_allclose(together[:, k : k + 1], solve(right[:, k : k + 1]), rtol=1e-6)
