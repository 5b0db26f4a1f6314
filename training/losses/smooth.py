"""Heat has few edges: a pull on neighbouring pixels of thermal pictures (ThermalGaussian)."""

import numpy as np

from shapeshift.training.heads.networks import KERNELS


def smooth_picture(device, image, grad_image, share: float) -> None:
    """Add the gradient of `share` times the picture's roughness to grad_image in place.

    Roughness of (3, H, W) is the mean over its values of |difference| to the four neighbours over
    4; what lies beyond the border counts as alike.
    """
    _, height, width = image.shape
    kernel, values = device.program(KERNELS / "between.cl")["smooth"], image.size
    device.launch(
        kernel, values, 64, width, height, np.float32(share / (4 * values)), image, grad_image
    )


def roughness(image: np.ndarray) -> float:
    """The slow twin: the roughness of (3, H, W)."""
    rows, columns = (np.abs(np.diff(image, axis=axis)).sum() for axis in (1, 2))
    return float(2 * (rows + columns) / (4 * image.size))
