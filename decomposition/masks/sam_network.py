"""One ONNX file of the user's: its inputs and outputs by name, and refusals in a sentence."""

from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.gate.network import StrangeNetwork
from shapeshift.runtime_models.model import BadFile

A_BYTE = 3  # of memory for each byte of a network: read, opened, optimised
TYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(int64)": np.int64,
         "tensor(int32)": np.int32, "tensor(bool)": np.bool_,
         "tensor(uint8)": np.uint8}  # fmt: skip


class Network:
    """Opened on the CPU, behind the gate.  Raises BadFile for what is no ONNX file."""

    def __init__(self, path: Path, threads: int) -> None:
        self.path = path
        Memory().of(path).charge(A_BYTE * path.stat().st_size, "its weights")
        # By its path: weights of large networks lie in a file beside it.
        self.session = StrangeNetwork(path, threads)
        self.inputs: dict[str, Any] = {entry.name: entry for entry in self.session.get_inputs()}
        self.outputs = [out.name for out in self.session.get_outputs()]

    def shape(self, name: str) -> list[int | None]:
        """Of an input; None where a side may have any length."""
        return [n if isinstance(n, int) and n > 0 else None for n in self.inputs[name].shape]

    def run(self, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Outputs by name; each input is turned into the type that it has.  Raises BadFile."""
        fed: dict[str, np.ndarray] = {}
        for name, entry in self.inputs.items():
            if name not in given:
                raise BadFile(f"{self.path}: it asks for '{name}', which no known segmenter has.")
            if entry.type not in TYPES:
                raise BadFile(f"{self.path}: its input '{name}' is {entry.type}, which is unknown.")
            fed[name] = np.asarray(given[name]).astype(TYPES[entry.type], copy=False)
        found = self.session.run(None, fed)
        return dict(zip(self.outputs, found, strict=True))

    def floats(self, found: dict[str, np.ndarray], name: str, rank: int) -> np.ndarray:
        """An output as float32, checked.  Raises BadFile where it cannot be what its name says."""
        if name not in found:
            raise BadFile(f"{self.path}: it gives {list_of(self.outputs)}; '{name}' is wanted.")
        array = np.asarray(found[name])
        if array.ndim != rank or not all(array.shape):
            raise BadFile(
                f"{self.path}: its '{name}' has the shape {list(array.shape)}; {rank} sides are "
                "wanted."
            )
        array = array.astype(np.float32)
        if not np.isfinite(array).all():
            raise BadFile(f"{self.path}: its '{name}' holds NaN or Inf; export it again.")
        return array


def list_of(names: list[str]) -> str:
    return ", ".join(f"'{name:.40}'" for name in names[:6]) or "nothing"
