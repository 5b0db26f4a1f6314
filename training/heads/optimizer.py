"""Adam on the device over named groups of parameters."""

from dataclasses import dataclass

import numpy as np

from shapeshift.training.heads.networks import KERNELS

BETA1, BETA2 = 0.9, 0.999  # the same numbers stand in adam.cl


@dataclass
class Group:
    value: object  # device array, any shape
    mean: object
    square: object
    rates: object  # (1,) or one a parameter


class Adam:
    """Parameters with their moments.  `state` and `load` take all of it in and out as numpy."""

    def __init__(self, device, values: dict[str, np.ndarray], rates: dict[str, np.ndarray]) -> None:
        """`rates` of each group: (1,), or as many as the group has parameters."""
        self.device, self.steps = device, 0
        self.kernel = device.program(KERNELS / "adam.cl")["adam"]
        self.groups = {
            name: Group(
                device.upload(np.ascontiguousarray(value, np.float32)),
                device.zeros(value.shape),
                device.zeros(value.shape),
                device.upload(np.asarray(rates[name], np.float32)),
            )
            for name, value in values.items()
        }

    def __getitem__(self, name: str):
        return self.groups[name].value

    def set_rates(self, rates: dict[str, np.ndarray]) -> None:
        for name, group in self.groups.items():
            group.rates = self.device.upload(np.asarray(rates[name], np.float32))

    def step(self, grads: dict[str, object], rate_scale: float) -> None:
        """One update of every group by its gradient, at `rate_scale` times its rates."""
        self.steps += 1
        correct = (np.float32(1 / (1 - b**self.steps)) for b in (BETA1, BETA2))
        first, second = correct
        for name, group in self.groups.items():
            count = group.value.size
            self.device.launch(
                self.kernel, count, 64, count, first, second, np.float32(rate_scale),
                int(group.rates.size > 1), group.rates, grads[name],
                group.value, group.mean, group.square,
            )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """Copies of everything that the next step depends on, except the rates."""
        out = {"steps": np.array(self.steps)}
        for name, group in self.groups.items():
            for part in ("value", "mean", "square"):
                out[f"{name}.{part}"] = self.device.download(getattr(group, part)).copy()
        return out

    def load(self, state: dict[str, np.ndarray]) -> None:
        """Go on from a `state`; the groups may have another number of rows than before.

        Where memory does not suffice, everything stays as it was.
        """
        there = {
            (name, part): self.device.upload(
                np.ascontiguousarray(state[f"{name}.{part}"], np.float32)
            )
            for name in self.groups
            for part in ("value", "mean", "square")
        }
        self.steps = int(state["steps"])
        for (name, part), array in there.items():
            setattr(self.groups[name], part, array)
