"""A network of the user's in onnxruntime, behind the gate: what it asks for is not known before."""

import importlib
from typing import Any

import numpy as np

from shapeshift.runtime_models.gate.refusal import Unreadable
from shapeshift.runtime_models.session import load_onnxruntime, open_session


class OpenNetwork:
    """One ONNX file, by its path or its bytes, on the CPU.  Raises Unreadable."""

    def __init__(self, given: str | bytes, threads: int) -> None:
        try:
            self.session = open_session(given, threads)
        except errors() as error:
            raise refusal("not a network that opens", error) from None

    def facts(self) -> dict:
        """Inputs and outputs, each [name, type, shape]."""
        session = self.session
        return {
            what: [[node.name, node.type, list(node.shape)] for node in nodes]
            for what, nodes in (
                ("inputs", session.get_inputs()), ("outputs", session.get_outputs()),
            )
        }  # fmt: skip

    def run(self, wanted: list[str] | None, given: dict[str, np.ndarray], then: str) -> Any:
        """The outputs in their order; then: module:function that makes less of them, or ""."""
        try:
            found = self.session.run(wanted, given)
        except errors() as error:
            shapes = ", ".join(str(array.shape) for array in given.values())
            raise refusal(f"it does not run on what it is given, {shapes}", error) from None
        if not then:
            return [np.asarray(array) for array in found]
        module, _, name = then.partition(":")
        return getattr(importlib.import_module(module), name)(found)


def refusal(what: str, error: Exception) -> Exception:
    """Of an error of onnxruntime, which may have a hundred lines; MemoryError where it is that."""
    text = " ".join(str(error).split())
    if "bad allocation" in text or "bad_alloc" in text or "Failed to allocate memory" in text:
        return MemoryError(text[:120])
    return Unreadable(f"{what} ({text[:120]})")


def errors() -> tuple[type[Exception], ...]:
    """Of onnxruntime: they have no class in common."""
    kinds = load_onnxruntime().capi.onnxruntime_pybind11_state
    return (
        kinds.Fail, kinds.InvalidArgument, kinds.InvalidGraph, kinds.InvalidProtobuf,
        kinds.NotImplemented, kinds.RuntimeException, kinds.NoSuchFile, kinds.EPFail,
    )  # fmt: skip
