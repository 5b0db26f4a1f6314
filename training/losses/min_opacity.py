"""A loss that keeps absent splats from staying absent: what is absent gets no gradient of a photo.

The heads are shared by all anchors.  Where stops have shapes of their own, the network that sends
one stop's splats away takes others along that the stop would need; in the first steps of a run over
mostly background it may send all of them away.
"""

import numpy as np

from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS

MIN_OPACITY = 0.02  # below it the loss is above 0; the same number stands in min_opacity.cl
SHARE = 0.05  # of mean max(MIN_OPACITY - opacity, 0); bone of the leg gains 1 dB, docs/growth.md

UNTIL = 0.3  # of a run of several stops


def min_opacity_share(stops: int, blended_shapes: float, done: float) -> float:
    """The weight of the loss once so much of a run is `done`, 0..1.

    It ends once stops have told their splats apart: what is absent at one would stay faint in its
    pictures, and cost its steps as much as what shows.  Where some steps draw shapes between stops,
    it goes on: what is absent on one side grows from faint splats.
    """
    return 0.0 if stops > 1 and not blended_shapes and done > UNTIL else SHARE


def add_min_opacity_gradient(device, splats: Gaussians, grad: Gaussians, share: float) -> None:
    """Add the gradient of share * mean max(MIN_OPACITY - opacity, 0) to `grad` in place."""
    kernel, count = device.program(KERNELS / "min_opacity.cl")["min_opacity"], len(splats.opacity)
    device.launch(
        kernel, count, 64, count, np.float32(share / count), splats.opacity, grad.opacity
    )  # fmt: skip
