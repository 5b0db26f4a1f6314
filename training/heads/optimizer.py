"""Adam on the device over named groups of parameters."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.training.heads.networks import KERNELS

if TYPE_CHECKING:
    from pyopencl.array import Array

BETA1, BETA2 = 0.9, 0.999  # the same numbers stand in adam.cl
# Towards 0, of a group: each step that shows a value takes so much of it, times the rate, from it.
# Of light that leaves what the photos agree on: their gradients mostly point one way, those of
# chance do not.
PULL = {"light": np.float32(0.25)}


@dataclass
class Group:
    value: "Array"  # any shape
    mean: "Array"
    square: "Array"
    rates: "Array"  # (1,) or one a parameter


class Adam:
    """Parameters with their moments.  `state` and `load` take all of it in and out as numpy."""

    def __init__(self, device, values: dict[str, np.ndarray], rates: dict[str, np.ndarray]) -> None:
        """`rates` of each group: (1,), or as many as the group has parameters."""
        self.device, self.steps = device, 0
        self.kernels = device.program(KERNELS / "adam.cl")
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

    def gather(self, name: str, rows):
        """(R, width) the `rows` (R,) of a group's values; all of them, no copy, for None."""
        table = self.groups[name].value
        if rows is None:
            return table
        count, width = len(rows), table.shape[1]
        out = self.device.empty((count, width))
        self.device.launch(self.kernels["gather_rows"], count, 64, count, width, rows, table, out)
        return out

    def set_rates(self, rates: dict[str, np.ndarray]) -> None:
        for name, group in self.groups.items():
            group.rates = self.device.upload(np.asarray(rates[name], np.float32))

    def step(self, grads: dict[str, object], rate_scale: float, rows: dict | None = None) -> None:
        """One update of every group that has a gradient, at `rate_scale` times its rates.

        rows: (R,) int32 on the device by group: of these groups, whose rate is one for all, only
        those rows take the step, and their gradients are all that `grads` has.
        """
        self.steps += 1
        correct = (np.float32(1 / (1 - b**self.steps)) for b in (BETA1, BETA2))
        first, second = correct
        scale = np.float32(rate_scale)
        for name, group in self.groups.items():
            if name not in grads:
                continue
            moments = group.value, group.mean, group.square
            chosen, pull = None if rows is None else rows.get(name), PULL.get(name, np.float32(0))
            if chosen is None:
                count = group.value.size
                self.device.launch(
                    self.kernels["adam"], count, 64, count, first, second, scale,
                    int(group.rates.size > 1), pull, group.rates, grads[name], *moments,
                )  # fmt: skip
                continue
            self.device.launch(
                self.kernels["adam_rows"], len(chosen), 64, len(chosen), group.value.shape[1],
                chosen, first, second, scale, pull, group.rates, grads[name], *moments,
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
