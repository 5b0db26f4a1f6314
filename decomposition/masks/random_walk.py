"""Grady's random walker: from places whose label is known to all others, along strong edges.

The share of a label at a node is the chance that a walk from there first meets a seed of that
label; it solves L x = 0 with the seeds fixed, L the graph's Laplacian (Grady 2006, equation 11).
"""

from collections.abc import Callable

import numpy as np

TINY = 1e-300


def conjugate_gradients(
    multiply: Callable[[np.ndarray], np.ndarray],
    diagonal: np.ndarray,
    right: np.ndarray,
    guess: np.ndarray,
    tolerance: float,
    most: int,
) -> np.ndarray:
    """x (n, k) of A x = right (n, k) for a symmetric positive definite A, column by column.

    multiply: A times (n, k); diagonal (n,) of A, its preconditioner.  Ends at residuals of
    `tolerance` times the right-hand sides, or after `most` steps.
    Its sums are numpy's own loops: scipy's solver calls BLAS, whose threads take 20 times the
    processor time on a busy machine, and whose bits depend on their number.
    """
    x = guess.copy()
    residual = right - multiply(x)
    enough = np.maximum(tolerance**2 * dots(right, right), TINY)
    step = residual / diagonal[:, None]
    slope = dots(residual, step)
    for _ in range(most):
        if (dots(residual, residual) <= enough).all():
            break
        moved = multiply(step)
        length = slope / np.maximum(dots(step, moved), TINY)
        x += length * step
        residual -= length * moved
        scaled = residual / diagonal[:, None]
        before, slope = slope, dots(residual, scaled)
        step = scaled + slope / np.maximum(before, TINY) * step
    return x


def dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k,) of columns (n, k)."""
    return np.einsum("nk,nk->k", a, b)
