"""The slow twin of plain splats in training: from what the optimiser holds, in numpy float64."""

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import basis
from shapeshift.training.reference import directions


def decode_plain_reference(parameters: dict[str, np.ndarray], eye: np.ndarray, used: int) -> tuple:
    """(means, scales, wxyz, opacity, color) of an optimiser's values seen from `eye` (3,).

    used: how many coefficients count besides the first.
    """
    values = {name: np.asarray(array, np.float64) for name, array in parameters.items()}
    harmonics = np.concatenate([values["base"][:, None], values["rest"][:, :used]], axis=1)
    weights = basis(directions(values["means"], eye), 1 + used)
    return (
        values["means"],
        np.exp(values["scales"]),
        values["wxyz"],
        1 / (1 + np.exp(-values["opacity"])),
        np.maximum(0.5 + np.einsum("nm,nmc->nc", weights, harmonics), 0),
    )
