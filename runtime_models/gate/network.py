"""A network of the user's, run behind the gate as if by a session of onnxruntime."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.gate.doors import DOORS
from shapeshift.runtime_models.gate.gate import Held, in_utf8

A_GIVEN_BYTE = 128  # of memory for each byte that a network is given: 64 channels, some at once
A_THREAD = 16 << 20  # bytes that a thread reserves
# Seconds for each byte of a file and number that it is given: every weight once at every number,
# 2e9 of them a second, which the slowest machines do.
A_WEIGHT_S = 1 / (4 * 2e9)


class Value(NamedTuple):
    """An input or an output, as onnxruntime describes it."""

    name: str
    type: str
    shape: list


class StrangeNetwork:
    """The session of one ONNX file in a process of its own; its methods are onnxruntime's."""

    def __init__(self, path: Path, threads: int, data: bytes | None = None) -> None:
        """data: its bytes, where it is not to be opened by its path.  Raises BadFile."""
        account = Memory().of(path)
        self.free = DOORS["network"].memory + A_THREAD * (threads or os.cpu_count() or 1)
        self.free += account.left
        with in_utf8(path.absolute()) as name:
            given = name if data is None else data
            self._held = Held("network", path, [given, threads], self.free)
        self._inputs, self._outputs = (
            [Value(*value) for value in self._held.facts[what]] for what in ("inputs", "outputs")
        )

    def get_inputs(self) -> list[Value]:
        return self._inputs

    def get_outputs(self) -> list[Value]:
        return self._outputs

    def run(
        self, outputs: Sequence[str] | None, given: Mapping[str, np.ndarray], then: str = ""
    ) -> Any:
        """The outputs' arrays, or what the function `then` makes of them.  Raises BadFile."""
        numbers = sum(array.size for array in given.values())
        size = sum(array.nbytes for array in given.values())
        return self._held.call(
            "run", None if outputs is None else list(outputs), dict(given), then,
            seconds=DOORS["network"].seconds + A_WEIGHT_S * self._held.size * numbers,
            memory=self.free + A_GIVEN_BYTE * size,
        )  # fmt: skip
