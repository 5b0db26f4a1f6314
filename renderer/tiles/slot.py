"""One object's rows of the arena, and how they come about: our kernel's, onnxruntime's, layers'."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.colors import shade_sh, upload_sh
from shapeshift.rasterizer.decode_heads import (
    ACTIVATIONS,
    MOST_HIDDEN,
    MOST_SPLATS,
    NO_CLIP,
    AnchorHeads,
    HeadWeights,
)
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pack import pack_color
from shapeshift.renderer.limits import arena_rows
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.colors.color_memory import ColorMemory
from shapeshift.runtime_models.colors.spherical_harmonics import most_light
from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import HEADS, AnchorModel, Mlp, Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls, is_each

if TYPE_CHECKING:
    from pyopencl.array import Array


# The five heads of a model as our kernel runs them: which models it knows, and Psi folded in.

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


@dataclass
class Decoding:
    """What decodes one model; objects that show the same model share it."""

    evaluator: Evaluator  # its sessions open when they are first asked
    heads: ModelHeads | BlockHeads | None = None  # of a model that our kernel knows
    sh: "Array | None" = None  # coefficients of layers
    instead: str = ""  # who runs the networks that the kernel does not, and why


def decoding_of(device: Device, model: Model, mlps: str) -> Decoding:
    """mlps: "opencl", our kernel where it knows the model, or "onnxruntime"."""
    made = Decoding(Evaluator(model, keep=True))
    if isinstance(model, SplatLayers) and model.leaves is None:
        made.sh = upload_sh(device, model.sh)
    elif isinstance(model, AnchorModel):
        if mlps == "opencl" and not (reason := uncovered(model)):
            if isinstance(model, BlockModel):
                made.heads = BlockHeads(device, model)
            else:
                made.heads = ModelHeads(device, model)
        elif mlps == "opencl":
            made.instead = f"onnxruntime for a model: {reason}"
    elif follows_eye(model) and mlps == "opencl":
        made.instead = "Scaffold-GS onnxruntime"
    return made


@dataclass
class Slot:
    """One object's rows of the arena."""

    start: int
    count: int
    decoding: Decoding
    placed: bool = False  # what follows neither x nor the eye is there, since the last decoding
    _colors: ColorMemory = field(init=False)  # that onnxruntime decoded, (n, 3)
    _kept: ColorMemory = field(init=False)  # that the kernel decoded, (n, 4) on the device

    def __post_init__(self) -> None:
        self._colors = ColorMemory(self.decoding.evaluator)
        self._kept = ColorMemory(self.decoding.heads or self.decoding.evaluator)

    @property
    def model(self) -> Model:
        return self.decoding.evaluator.model

    @property
    def rows(self) -> slice:
        return slice(self.start, self.start + self.count)

    def decode_color(
        self, device: Device, key: tuple[int, int], x: Controls, eye: np.ndarray,
        seen: np.ndarray | None, arena: "tuple[Array, Array]", again: bool,
    ) -> None:  # fmt: skip
        """Its colours at x towards an eye, in the object's frame, as they are decoded.

        key: the set and the part of it; arena: mean_opacity (N, 4) and color (N, 4).  again: other
        parts are mixed in, and the same may be asked for soon: kept apart.
        """
        mean_opacity, color = arena
        heads = self.decoding.heads
        if self.decoding.sh is not None:
            shade_sh(device, self.decoding.sh, eye, self.rows, mean_opacity, color, seen)
        elif heads is None or is_each(x):
            pack_color(device, self._colors.at(key, x, eye, seen), self.start, color)
        elif again:
            device.copy_rows(self._kept.at(key, x, eye, seen), color, self.start)
        else:
            self._kept.forget_after(key[0], -1)
            heads.color_into(color, self.start, x, eye, seen)

    def forget_colors(self, which: int, number: int) -> None:
        """Drops the parts of a set that have a higher number: they are mixed in no more."""
        self._colors.forget_after(which, number)
        self._kept.forget_after(which, number)


def slots_of(
    device: Device, models: list[Model], mlps: str, known: dict[int, Decoding]
) -> tuple[list[Slot], dict[int, Decoding]]:
    """One after the other, and what decodes each model, by its id; `known` is gone on with."""
    made = dict(known)
    for model in models:
        if id(model) not in made:
            made[id(model)] = decoding_of(device, model, mlps)
    counts = [arena_rows(model) for model in models]
    rows = zip(np.cumsum([0, *counts]), counts, models, strict=False)
    return [Slot(int(start), count, made[id(m)]) for start, count, m in rows], made


def run_by(mlps: str, slots: list[Slot]) -> str:
    """Who runs the networks, in words."""
    others = dict.fromkeys(slot.decoding.instead for slot in slots if slot.decoding.instead)
    return ", ".join([mlps, *others])
