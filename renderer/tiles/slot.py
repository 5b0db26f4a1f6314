"""One object's rows of the arena, and how they come about: our kernel's, onnxruntime's, layers'."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.pack import pack_color
from shapeshift.rasterizer.shade_sh import shade_sh, upload_sh
from shapeshift.renderer.limits import arena_rows
from shapeshift.renderer.tiles.heads import BlockHeads, ModelHeads, uncovered
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.colors.color_memory import ColorMemory
from shapeshift.runtime_models.evaluate import Evaluator, follows_eye
from shapeshift.runtime_models.model import AnchorModel, Model, SplatLayers
from shapeshift.runtime_models.stop_weights import Controls, is_each

if TYPE_CHECKING:
    from pyopencl.array import Array


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
