"""The five heads of a model as our kernel runs them: which models it knows, and Psi folded in."""

from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.decode.decode_heads import (
    ACTIVATIONS,
    MOST_HIDDEN,
    MOST_SPLATS,
    NO_CLIP,
    AnchorHeads,
    HeadWeights,
)
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.colors.light_harmonics import most_light
from shapeshift.runtime_models.model import HEADS, AnchorModel, Mlp
from shapeshift.runtime_models.stop_weights import Controls, is_each

if TYPE_CHECKING:
    from pyopencl.array import Array

LAYERS = 2  # one hidden layer, as the paper and our trainer have it


def uncovered(model: AnchorModel) -> str:
    """Why the kernel cannot run a model's networks, so that onnxruntime has to; "": it can."""
    if model.splats_per_anchor > MOST_SPLATS:
        return f"{model.splats_per_anchor} splats an anchor, more than {MOST_SPLATS}"
    known = model.networks_of_blocks if isinstance(model, BlockModel) else (model.networks,)
    for name, mlp in (pair for networks in known for pair in networks.items()):
        if len(mlp.weights) != LAYERS:
            return f"its {name} network has {len(mlp.weights)} layers instead of {LAYERS}"
        if len(mlp.weights[0]) > MOST_HIDDEN:
            return (
                f"its {name} network has {len(mlp.weights[0])} hidden units, more than "
                f"{MOST_HIDDEN}"
            )
        if mlp.head not in ACTIVATIONS:
            return f"its {name} network ends with {mlp.head}"
        if name != "color" and "direction" in mlp.inputs:
            return f"its {name} network looks at the direction"
    return ""


class ModelHeads:
    """One model on a device: what Evaluator does with onnxruntime, straight into the arena."""

    def __init__(self, device: Device, model: AnchorModel) -> None:
        self.model, self._device = model, device
        parts = [_Folded(model, model.networks[name]) for name in HEADS]
        self._bias = np.concatenate([part.bias for part in parts])  # float64, of all heads
        self._control = np.concatenate([part.control for part in parts])  # (units, d)
        self.shapes_follow = any(
            "control" in model.networks[name].inputs for name in HEADS[:3]
        )  # means and covariances depend on x
        frames = model.frames
        own = None if frames is None else np.hstack([frames.scales, frames.wxyz])
        heads = [part.head for part in parts]
        self.anchors = AnchorHeads(
            device, model.anchors, model.features, heads, model.splats_per_anchor, own,
            light=model.light,
        )  # fmt: skip

    def parts(self) -> "list[tuple[int, ModelHeads]]":
        """What decodes the model's splats, and the first of them that each decodes."""
        return [(0, self)]

    def color_into(
        self, color: "Array", start: int, x: Controls, eye: np.ndarray,
        seen: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """Rows start... of color (N, 4) at one control, display sRGB towards an eye (3,) in the
        object's frame; of anchors not `seen` (A,) anything.
        """
        self.anchors.decode_colors(self.folded(x), eye, start, color, seen)

    def color(
        self, x: Controls, eye: np.ndarray, seen: np.ndarray | None = None,
        out: "Array | None" = None,
    ) -> "Array":  # fmt: skip
        """The same in an array (n, 4) of its own, or in `out`."""
        out = self._device.zeros((self.model.splat_count, 4)) if out is None else out
        self.color_into(out, 0, x, eye, seen)
        return out

    def folded(self, x: Controls) -> np.ndarray:
        """(units,) first biases with Psi(x) in them: the same for every anchor, so exact."""
        assert not is_each(x), "one control for all"
        return self._bias + self._control @ self.model.psi(x)[0].astype(np.float64)


class BlockHeads:
    """A model in blocks on a device: each run of its anchors by the heads of its block."""

    def __init__(self, device: Device, model: BlockModel) -> None:
        self.model, self._device = model, device
        self._parts = [(run, ModelHeads(device, run.model)) for run in model.runs]
        self.shapes_follow = any(heads.shapes_follow for _, heads in self._parts)

    def parts(self) -> list[tuple[int, ModelHeads]]:
        return [(run.splats.start, heads) for run, heads in self._parts]

    def color_into(
        self, color: "Array", start: int, x: Controls, eye: np.ndarray,
        seen: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        for run, heads in self._parts:
            mine = None if seen is None else seen[run.rows]
            if mine is None or mine.any():
                heads.color_into(color, start + run.splats.start, x, eye, mine)

    def color(
        self, x: Controls, eye: np.ndarray, seen: np.ndarray | None = None,
        out: "Array | None" = None,
    ) -> "Array":  # fmt: skip
        out = self._device.zeros((self.model.splat_count, 4)) if out is None else out
        self.color_into(out, 0, x, eye, seen)
        return out


class _Folded:
    """One network, cut into what meets features and direction, and what meets Psi(x)."""

    def __init__(self, model: AnchorModel, mlp: Mlp) -> None:
        features, d = model.features.shape[1], model.encoding.d
        widths = model.input_widths
        part_of = np.repeat(mlp.inputs, [widths[part] for part in mlp.inputs])
        first, last = mlp.weights
        columns = {part: first[:, part_of == part] for part in widths}
        nothing = np.zeros((len(first), features + d), np.float32)  # of an input that it lacks
        self.bias = mlp.biases[0].astype(np.float64)
        control = columns["control"] if "control" in mlp.inputs else nothing[:, :d]
        self.control = control.astype(np.float64)
        # (units, 3), or 4 or 6 with light behind the direction, or none of both.
        look = np.concatenate([columns["direction"], columns["light"]], axis=1)
        light = model.light if "light" in mlp.inputs else None
        self.head = HeadWeights(
            columns["feature"] if "feature" in mlp.inputs else nothing[:, :features],
            look if "direction" in mlp.inputs else None,
            last, mlp.biases[1], mlp.head, mlp.clip or NO_CLIP, mlp.gain,
            None if light is None else most_light(light).max(axis=0),
        )  # fmt: skip
