"""An AnchorModel on the GPU: anchors and features pinned, its five networks as compute passes."""

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import moderngl
import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import PARTS, Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, overwrite
from shapeshift.runtime_models.blocks.block_model import BlockModel
from shapeshift.runtime_models.blocks.evaluate_blocks import control_of
from shapeshift.runtime_models.model import HEADS, SIZE_PER_SPLAT, AnchorModel, Mlp
from shapeshift.runtime_models.stop_weights import Control, Controls, is_each

ACTIVATIONS = ("none", "tanh", "sigmoid", "softplus", "exp")  # their numbers in activation.glsl
DIRECTION = 3  # inputs
LEAST_VECS = 16  # vec4 a layer; fewer sizes, fewer programs to compile
FOLDS = 3  # controls a frame that colours are decoded at: two value stops and what is between


def vecs(width: int) -> int:
    """How many vec4 hold `width` floats."""
    return -(-width // 4)


@dataclass(frozen=True)
class PackedMlp:
    """One network as decode_mlp.comp reads it.

    rows (V, 4) float32: first one row a layer (inputs, outputs, in vec4), then layer by layer its
    biases and its weights, both padded with zeros; weights by output vec4, input, output.
    """

    rows: np.ndarray
    bias: np.ndarray  # (hidden,) of the first layer, float64
    control: np.ndarray  # (hidden, d) columns of the first layer that meet Psi(x)
    layers: int
    widest: int  # vec4

    def folded_bias(self, encoding: np.ndarray) -> np.ndarray:
        """First-layer bias with Psi(x) (d,) in it: the same for every anchor, so exact."""
        folded = np.zeros(4 * vecs(len(self.bias)), np.float32)
        folded[: len(self.bias)] = self.bias + self.control @ encoding.astype(np.float64)
        return folded

    @property
    def bias_at(self) -> int:
        """Byte of `rows` where the first layer's bias begins."""
        return 16 * self.layers


def pack_mlp(
    mlp: Mlp, features: int, d: int, own_control: bool = False, channels: int = 1
) -> PackedMlp:
    """Pads and orders one network; its inputs become features, then direction and light of so many
    channels; Psi is cut out, or comes third with `own_control`.
    """
    width_of = {"feature": features, "direction": DIRECTION, "light": channels, "control": d}
    at = np.cumsum([0, *(width_of[part] for part in mlp.inputs)])
    columns = {part: slice(at[i], at[i + 1]) for i, part in enumerate(mlp.inputs)}
    first = np.asarray(mlp.weights[0], np.float64)  # (hidden, inputs)
    if first.shape[1] != at[-1]:
        raise ValueError(
            f"the first layer takes {first.shape[1]} inputs, but {' + '.join(mlp.inputs)} "
            f"are {at[-1]}; write the network or the inputs anew."
        )
    look = 4 * vecs(features)  # features, then direction, light
    seen = np.zeros((len(first), look + 4 * vecs(DIRECTION + channels)))
    if "feature" in columns:
        seen[:, :features] = first[:, columns["feature"]]
    if "direction" in columns:
        seen[:, look : look + DIRECTION] = first[:, columns["direction"]]
    if "light" in columns:
        seen[:, look + DIRECTION :][:, :channels] = first[:, columns["light"]]
    control = first[:, columns["control"]] if "control" in columns else np.zeros((len(first), d))

    if own_control:
        seen = np.concatenate([seen, control], axis=1)
    weights = [seen, *(np.asarray(w, np.float64) for w in mlp.weights[1:])]
    header = np.zeros((len(weights), 4))
    parts = [header]
    for layer, (w, b) in enumerate(zip(weights, mlp.biases, strict=True)):
        outs, ins = vecs(w.shape[0]), vecs(w.shape[1])
        header[layer] = ins, outs, 0, 0
        padded = np.zeros((4 * outs, 4 * ins))
        padded[: w.shape[0], : w.shape[1]] = w
        bias = np.zeros(4 * outs)
        bias[: len(b)] = b
        parts.append(bias.reshape(outs, 4))
        # (out vec, in vec, input, output): four rows are the mat4 of an output and an input vec4
        parts.append(padded.reshape(outs, 4, ins, 4).transpose(0, 2, 3, 1).reshape(-1, 4))
    widest = max(vecs(max(w.shape)) for w in weights)
    rows = np.ascontiguousarray(np.concatenate(parts), np.float32)
    return PackedMlp(rows, np.asarray(mlp.biases[0], np.float64), control, len(weights), widest)


class GlNetworks:
    """The five networks of one model.  Weights lie in uniform blocks (2 times faster than storage
    on software GL); a network too large for a block is read from storage, said once on stderr.
    """

    def __init__(self, gpu: Gpu, model: AnchorModel) -> None:
        if not len(model.anchors):
            raise ValueError("the model has no anchors; there is nothing to decode.")
        self._gpu, self._model = gpu, model
        count, features = model.features.shape
        anchors = np.zeros((count, 4), np.float32)
        anchors[:, :3] = model.anchors
        anchors.view(np.uint32)[:, 3] = model.splats_per_anchor  # read as bits by pack.comp
        rows = np.zeros((count, 4 * vecs(features)), np.float32)
        rows[:, :features] = model.features
        self._anchors = gpu.upload(anchors, "the model's anchors")
        self._features = gpu.upload(rows, "the model's features")
        self._frames: moderngl.Buffer | None = None
        if model.frames is not None:
            frames = np.zeros((count, 2, 4), np.float32)
            frames[:, 0, :3], frames[:, 1] = model.frames.scales, model.frames.wxyz
            self._frames = gpu.upload(frames, "the anchors' own axes")
        self._light: moderngl.Buffer | None = None
        if model.light is not None:
            light = np.ascontiguousarray(model.light, np.float32)
            self._light = gpu.upload(light, "the anchors' light")
        self._heads = {name: self._prepare(name) for name in HEADS}
        self._own: dict[str, _Head] = {}  # for a control an anchor, made when there is one
        self._control: moderngl.Buffer | None = None  # Psi of these
        self._own_x: np.ndarray | None = None  # whose

    def _prepare(self, name: str, own_control: bool = False) -> "_Head":
        model, gpu, mlp = self._model, self._gpu, self._model.networks[name]
        if name != "color" and not {"direction", "light"}.isdisjoint(mlp.inputs):
            raise ValueError(f"the {name} network takes the view direction; only color may.")
        wanted = model.splats_per_anchor * SIZE_PER_SPLAT[name]
        if mlp.width_out != wanted:
            raise ValueError(
                f"the {name} network gives {mlp.width_out} numbers an anchor, but "
                f"{model.splats_per_anchor} splats take {wanted}; write one of the two anew."
            )
        channels = model.input_widths["light"] if name == "color" else 1
        packed = pack_mlp(mlp, model.features.shape[1], model.encoding.d, own_control, channels)
        block = min(gpu.max_uniforms, 65536)
        stored = packed.rows.nbytes > block
        if stored:
            logging.getLogger("renderer").warning(
                f"the {name} network takes {packed.rows.nbytes:,} bytes, more than a "
                f"uniform block ({block:,}); it is read from a storage buffer, which is slower."
            )
        folds = FOLDS if name == "color" and not own_control else 1
        weights = [
            gpu.reserve(packed.rows.nbytes if stored else block, f"the {name} network")
            for _ in range(folds)  # the whole block that the shader declares, each time
        ]
        for each in weights:
            each.write(packed.rows)
        size = max(LEAST_VECS, 1 << (packed.widest - 1).bit_length())
        program = gpu.compute(
            "decode_mlp.comp", LAYER_VECS=size, BLOCK_VECS=block // 16, STORED_WEIGHTS=int(stored),
            OWN_CONTROL=int(own_control),
        )  # fmt: skip
        return _Head(name, mlp, packed, weights, stored, program)

    def _heads_for(self, x: Controls, names: Iterable[str]) -> dict[str, "_Head"]:
        """The networks, of which those named are ready for one control or for one an anchor."""
        if not is_each(x):
            assert not isinstance(x, np.ndarray), "one control for all"
            for name in names:
                self._heads[name].set_control(self._model, x)
            return self._heads
        if self._control is None:
            self._own = {name: self._prepare(name, own_control=True) for name in HEADS}
            size = 16 * vecs(self._model.encoding.d) * len(self._model.anchors)
            self._control = self._gpu.reserve(size, "control encodings")
        width = self._model.encoding.d
        for head in self._own.values():  # models share programs
            head.program["control_vecs"].value = vecs(width)
        if self._own_x is None or not np.array_equal(x, self._own_x):
            self._own_x = np.array(x)
            rows = np.zeros((len(self._model.anchors), 4 * vecs(width)), np.float32)
            rows[:, :width] = self._model.psi(x)
            overwrite(self._control, rows)
        return self._own

    def geometry(self, arena: Arena, start: int, x: Controls) -> None:
        """Four networks at a control, or one an anchor -> rows start... of the arena."""
        heads = self._heads_for(x, PARTS)
        k, count = self._model.splats_per_anchor, len(self._model.anchors)
        at_once = arena.staged // k  # anchors
        for first in range(0, count, at_once):
            n = min(at_once, count - first)
            for name, size in PARTS.items():
                self._run(heads[name], arena.staging, arena.staging_at(name), size, first, n)
            arena.pack_staged(start + first * k, n * k, self._anchors, first, self._frames)

    def color(self, arena: Arena, start: int, x: Controls, eye: np.ndarray) -> None:
        """The colour network at x towards an eye (3,) in the object's frame -> rows start..."""
        head = self._heads_for(x, ("color",))["color"]
        head.program["eye"].value = tuple(float(v) for v in eye)
        self._run(head, arena.color, 4 * start, 4, 0, len(self._model.anchors))

    def _run(
        self, head: "_Head", output: moderngl.Buffer, base: int, stride: int, first: int, count: int
    ) -> None:
        """Anchors first... through one network; splat j's numbers go to base + stride * j."""
        bind(anchors=self._anchors, features=self._features, output=output)
        bind(light=self._light or self._anchors)
        if self._control is not None:
            bind(control=self._control)
        if head.stored:
            bind(weights=head.weights[0])
        else:
            head.weights[0].bind_to_uniform_block(layout.WEIGHTS_BLOCK)
        lit = self._light is not None and head.name == "color"
        low, high = head.mlp.clip or (-math.inf, math.inf)
        self._gpu.run(
            head.program, groups_for(count, layout.DECODE_WORKGROUP),
            first=first, count=count, base=base, stride=stride, size=SIZE_PER_SPLAT[head.name],
            splats_per_anchor=self._model.splats_per_anchor, layers=head.packed.layers,
            feature_vecs=vecs(self._model.features.shape[1]),
            light_channels=self._model.input_widths["light"] if lit else 0,
            activation=ACTIVATIONS.index(head.mlp.head), low=low, high=high, gain=head.mlp.gain,
        )  # fmt: skip

    def release(self) -> None:
        for head in (*self._heads.values(), *self._own.values()):
            for weights in head.weights:
                weights.release()
        if self._control is not None:
            self._control.release()
        for own in (self._frames, self._light):
            if own is not None:
                own.release()
        self._anchors.release()
        self._features.release()


class GlBlocks:
    """The same of a model in blocks: each run of anchors by networks of its own."""

    def __init__(self, gpu: Gpu, model: BlockModel) -> None:
        self._parts = [(run, GlNetworks(gpu, run.model)) for run in model.runs]

    def geometry(self, arena: Arena, start: int, x: Controls) -> None:
        for run, networks in self._parts:
            networks.geometry(arena, start + run.splats.start, control_of(x, run))

    def color(self, arena: Arena, start: int, x: Controls, eye: np.ndarray) -> None:
        for run, networks in self._parts:
            networks.color(arena, start + run.splats.start, control_of(x, run), eye)

    def release(self) -> None:
        for _, networks in self._parts:
            networks.release()


@dataclass
class _Head:
    """One network on the GPU."""

    name: str
    mlp: Mlp
    packed: PackedMlp
    weights: list[moderngl.Buffer]  # the same but for their first bias; the first is in use
    stored: bool  # weights in a storage buffer, not a uniform block
    program: moderngl.ComputeShader
    folded: list[Control | None] = field(default_factory=list)  # control in the bias of each

    def set_control(self, model: AnchorModel, x: Control) -> None:
        """Takes the weights whose first bias has Psi(x) in it; folded where none has it yet."""
        self.folded = self.folded or [None] * len(self.weights)
        if x in self.folded:
            at = self.folded.index(x)
        else:
            at = len(self.weights) - 1  # used longest ago
            bias = self.packed.folded_bias(model.psi(x)[0])
            overwrite(self.weights[at], bias, offset=self.packed.bias_at)
            self.folded[at] = x
        self.weights.insert(0, self.weights.pop(at))
        self.folded.insert(0, self.folded.pop(at))
