"""A start that does not overshoot: rates that rise, and a hair's pull on what is absent.

The first steps of a run have one direction for all splats alike: where photos are mostly background
that is "away".  The heads can follow it until nothing is left at all, before the features tell the
anchors apart; and what is absent gets no gradient.  So a run that died goes on from its start with
network rates that rise, so that the features learn first, and with a pull that brings absent splats
back to where the photos decide.
"""

from dataclasses import dataclass

import numpy as np

from shapeshift.training.heads.gaussians import Gaussians
from shapeshift.training.heads.networks import KERNELS

LEAST_RATE = 0.01  # of the networks' rates, at the first step
AFTER_A_FALL = 200  # steps
PULL = 0.01  # of mean max(FAINT - opacity, 0) in the loss of a run that fell
FAINT = 0.02  # opacity below which a splat is drawn up; the same number stands in rise.cl


@dataclass(frozen=True)
class Rise:
    """How the networks' rates begin: quadratically from LEAST_RATE over `steps` from `since` on."""

    steps: int = 0
    since: int = 0
    pull: float = 0.0  # on absent splats, for the rest of the run

    def share(self, iteration: int) -> float:
        """Of the networks' rates at a step."""
        done = iteration - self.since + 1
        return 1.0 if done >= self.steps else max((done / self.steps) ** 2, LEAST_RATE)

    def going(self, iteration: int) -> bool:
        """Whether the rates of this step differ from those of the step before."""
        return bool(self.steps) and iteration - self.since < self.steps

    def rates(self, rates: dict[str, np.ndarray], iteration: int) -> dict[str, np.ndarray]:
        """The optimiser's rates at a step."""
        if self.share(iteration) == 1:
            return rates
        return rates | {"weights": rates["weights"] * np.float32(self.share(iteration))}


def after_fall(iteration: int, rate_scale: float, before: Rise) -> Rise:
    """How a run goes on that the guard turned back.

    Rates of more than once those of the preset are taken to be what it died of: they are halved
    first, and only then it is the start that is made gentler.
    """
    return Rise(AFTER_A_FALL, iteration, max(PULL, before.pull)) if rate_scale <= 1 else before


def draw_up(device, splats: Gaussians, grad: Gaussians, pull: float) -> None:
    """Add the gradient of pull * mean max(FAINT - opacity, 0) to `grad` in place."""
    kernel, count = device.program(KERNELS / "rise.cl")["draw_up"], len(splats.opacity)
    device.launch(
        kernel, count, 64, count, np.float32(pull / count), splats.opacity, grad.opacity
    )  # fmt: skip
