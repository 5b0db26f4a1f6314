"""Splats of a model in blocks: each run of anchors by the networks of its block."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from shapeshift.runtime_models.blocks.block_model import BlockModel, BlockRun
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.stop_weights import Controls, is_each

Shapes = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class EvaluatesAnchors(Protocol):
    """Evaluator of one anchor model."""

    def geometry(self, x: Controls, unit: bool = True) -> Shapes: ...

    def color(
        self, x: Controls, eye: np.ndarray, seen: np.ndarray | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray: ...  # fmt: skip

    def color_along(self, x: Controls, direction: np.ndarray) -> np.ndarray: ...


class BlockEvaluator:
    """What Evaluator does, one run after the other."""

    def __init__(
        self, model: BlockModel, make: Callable[[AnchorModel], EvaluatesAnchors], keep: bool
    ) -> None:
        self._count = model.splat_count
        self._parts: Sequence[tuple[BlockRun, EvaluatesAnchors]] = [
            (run, make(run.model)) for run in model.runs
        ]
        self._kept: Shapes | None = None
        self._keep = keep

    def geometry(self, x: Controls, unit: bool) -> Shapes:
        whole = self._room()
        for run, evaluator in self._parts:
            found = evaluator.geometry(control_of(x, run), unit)
            for array, part in zip(whole, found, strict=True):
                array[run.splats] = part
        return whole

    def _room(self) -> Shapes:
        """Arrays of all splats; the same again with `keep`."""
        if self._kept is not None:
            return self._kept
        widths = ((3,), (3,), (4,), ())
        means, scales, wxyz, opacity = (np.empty((self._count, *w), np.float32) for w in widths)
        if self._keep:
            self._kept = means, scales, wxyz, opacity
        return means, scales, wxyz, opacity

    def color(
        self, x: Controls, eye: np.ndarray, seen: np.ndarray | None, out: np.ndarray | None
    ) -> np.ndarray:
        out = np.zeros((self._count, 3), np.float32) if out is None else out
        for run, evaluator in self._parts:
            mine = None if seen is None else seen[run.rows]
            if mine is None or mine.any():
                evaluator.color(control_of(x, run), eye, mine, out[run.splats])
        return out

    def color_along(self, x: Controls, direction: np.ndarray) -> np.ndarray:
        out = np.empty((self._count, 3), np.float32)
        for run, evaluator in self._parts:
            out[run.splats] = evaluator.color_along(control_of(x, run), direction[run.rows])
        return out


def control_of(x: Controls, run: BlockRun) -> Controls:
    """The control of a run's anchors, where each anchor has one of its own."""
    return x[run.rows] if is_each(x) else x
