"""Several anchor models side by side as one: each anchor is decoded by the networks of its block.

All that anchors have lies in one table, so whoever draws, chooses, labels or cuts anchors need not
know.  Who runs the networks goes through `runs`; `one_network` makes networks that all blocks
share, exactly, for whoever knows only one set of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import channels_of, most_light
from shapeshift.runtime_models.eyes import LOOKS, eyes_of, looks_of, spread_eyes
from shapeshift.runtime_models.model import HEADS, AnchorFrames, AnchorModel, BadFile, Finding, Mlp

FORMAT = "shapeshift-blocks 1"
MOST_BLOCKS = 1024  # of a scene, the far surroundings among them
OF_FILES = ("blocks", "files")  # what the provenance of a scene in blocks has besides


@dataclass(frozen=True)
class BlockRun:
    """Anchors one after the other that have the same networks."""

    rows: slice  # of the anchors
    splats: slice
    model: AnchorModel  # these anchors with their networks


@dataclass(frozen=True)
class BlockModel(AnchorModel):
    """`networks` are those of block 0; the others, alike but for their weights, are in `more`."""

    block: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # (A,) of each anchor
    more: tuple[dict[str, Mlp], ...] = ()  # of the blocks 1, 2, ...

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.block.shape != (len(self.anchors),):
            raise ValueError(
                f"block has shape {self.block.shape}, expected ({len(self.anchors)},): one an "
                "anchor"
            )
        if len(self.block) and not 0 <= self.block.min() <= self.block.max() <= len(self.more):
            raise ValueError(f"anchors name the blocks {self.block.min()} to {self.block.max()}")

    @property
    def networks_of_blocks(self) -> tuple[dict[str, Mlp], ...]:
        return self.networks, *self.more

    @cached_property
    def runs(self) -> tuple[BlockRun, ...]:
        """The anchors in their order, each with its networks; a block is one run as it is read."""
        ends = np.flatnonzero(np.diff(self.block)) + 1
        edges = [0, *ends.tolist(), len(self.block)]
        k, shared = self.splats_per_anchor, self._shared()
        found = []
        for start, stop in pairwise(edges):
            if start == stop:
                continue
            rows = slice(start, stop)
            networks = self.networks_of_blocks[self.block[start]]
            model = AnchorModel(**(shared | {"networks": networks})).with_anchors(rows)
            found.append(BlockRun(rows, slice(start * k, stop * k), model))
        return tuple(found)

    def _shared(self) -> dict[str, Any]:
        """What every anchor model has, by name."""
        return {each.name: getattr(self, each.name) for each in fields(AnchorModel)}

    def with_anchors(self, rows: np.ndarray | slice) -> "BlockModel":
        few = AnchorModel(**self._shared()).with_anchors(rows)
        parts = {each.name: getattr(few, each.name) for each in fields(AnchorModel)}
        return BlockModel(**parts, block=np.ascontiguousarray(self.block[rows]), more=self.more)


def joined(models: Sequence[AnchorModel], names: Sequence[str]) -> BlockModel:
    """The models as one, in their order.  Raises BadFile where they do not fit together.

    names: of their files, for messages.
    """
    first = models[0]
    for model, name in zip(models[1:], names[1:], strict=True):
        refuse_unlike(first, model, f"{names[0]} and {name}")
    if labelled := [n for m, n in zip(models, names, strict=True) if m.labels is not None]:
        raise BadFile(
            f"{labelled[0]} has labels of objects; blocks have none: export the scene as one "
            "package and segment that."
        )
    counts = [len(model.anchors) for model in models]
    frames = None
    if first.frames is not None:
        known = [model.frames for model in models if model.frames is not None]
        frames = AnchorFrames(stacked([f.scales for f in known]), stacked([f.wxyz for f in known]))
    lights = [model.light for model in models if model.light is not None]
    findings: tuple[Finding, ...] = sum((model.findings for model in models), ())
    places = np.concatenate([eyes_of(model) for model in models])
    looks = np.concatenate([looks_of(model) for model in models])
    eyes = spread_eyes(places, looks) if len(places) else {}
    first_notes = {k: v for k, v in first.provenance.items() if k != LOOKS}
    return BlockModel(
        stacked([model.anchors for model in models]),
        stacked([model.features for model in models]),
        first.networks, first.splats_per_anchor, first.encoding, first.stops,
        first_notes | eyes | {"blocks": len(models), "files": list(names)}, findings,
        first.pace,
        first.between_stops, frames, light=stacked(lights) if lights else None,
        block=np.repeat(np.arange(len(models), dtype=np.int32), counts),
        more=tuple(model.networks for model in models[1:]),
    )  # fmt: skip


def stacked(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.ascontiguousarray(np.concatenate(arrays))


def refuse_unlike(one: AnchorModel, other: AnchorModel, names: str) -> None:
    """BadFile where two models cannot be blocks of one scene: all but weights has to be alike."""
    alike = {
        "splats an anchor": (one.splats_per_anchor, other.splats_per_anchor),
        "features": (one.features.shape[1], other.features.shape[1]),
        "stops": (one.stops, other.stops),
        "paces": (one.pace, other.pace),
        "ways between stops": (one.between_stops, other.between_stops),
        "control encodings": (one.encoding, other.encoding),
        "frames of anchors": (one.frames is None, other.frames is None),
        "light by direction": tuple(
            0 if light is None else channels_of(light) for light in (one.light, other.light)
        ),
    }
    for head in HEADS:
        a, b = one.networks[head], other.networks[head]
        alike[f"inputs of the {head} network"] = (a.inputs, b.inputs)
        alike[f"last functions of the {head} network"] = (
            (a.head, a.clip, a.gain), (b.head, b.clip, b.gain),
        )  # fmt: skip
    for what, (a, b) in alike.items():
        if a != b:
            raise BadFile(
                f"{names} have other {what}; the blocks of a scene are made by one training."
            )


def one_network(model: AnchorModel) -> AnchorModel:
    """The same model with one set of networks for all anchors; it draws the same.

    Anchors get a feature more a block, 1 in their own.  A hidden unit of a block takes so much off
    for anchors of other blocks that its ReLU gives exactly 0; the last biases come in by units that
    are that feature.  Networks are as wide as all blocks' together.  Raises BadFile for networks of
    more than one hidden layer.
    """
    if not isinstance(model, BlockModel):
        return model
    count = len(model.networks_of_blocks)
    own = np.eye(count, dtype=np.float32)[model.block]  # (A, blocks)
    provenance = {n: v for n, v in model.provenance.items() if n not in OF_FILES}
    shared = model._shared() | {
        "features": np.hstack([model.features, own]),
        "networks": {head: merged(model, head) for head in HEADS},
        "provenance": provenance | {"merged_blocks": count},
    }
    return AnchorModel(**shared)


def merged(model: BlockModel, head: str) -> Mlp:
    """One head of all blocks: (hidden of all + blocks) units, that see which block they are for."""
    mlps = [networks[head] for networks in model.networks_of_blocks]
    if any(len(mlp.weights) != 2 for mlp in mlps):
        raise BadFile(
            f"a {head} network of these blocks has more than one hidden layer; such blocks cannot "
            "become one package."
        )
    count, widths = len(mlps), model.input_widths
    inputs = mlps[0].inputs
    if "feature" in inputs:
        before = inputs[: inputs.index("feature") + 1]
        at = sum(widths[part] for part in before)
    else:
        inputs, at = ("feature", *inputs), 0
    lacking = widths["feature"] if "feature" not in mlps[0].inputs else 0
    gate = 2 * max(largest_sum(model, mlp) for mlp in mlps) + 1
    first, first_bias, last = [], [], []
    for number, mlp in enumerate(mlps):
        weights, bias = mlp.weights[0], mlp.biases[0]
        off = np.full((len(bias), count), -gate, np.float32)
        off[:, number] = 0
        nothing = np.zeros((len(bias), lacking), np.float32)
        first.append(np.hstack([weights[:, :at], nothing, off, weights[:, at:]]))
        first_bias.append(bias)
        last.append(mlp.weights[1])
    carry = np.zeros((count, first[0].shape[1]), np.float32)
    carry[:, at + lacking : at + lacking + count] = np.eye(count)
    biases = np.stack([mlp.biases[1] for mlp in mlps], axis=1)  # (out, blocks)
    layers = np.concatenate([*first, carry]), np.concatenate([*last, biases], axis=1)
    bias = np.concatenate([*first_bias, np.zeros(count, np.float32)])
    return Mlp(
        tuple(layer.astype(np.float32) for layer in layers),
        (bias, np.zeros(len(biases), np.float32)),
        mlps[0].head, inputs, mlps[0].clip, mlps[0].gain,
    )  # fmt: skip


def largest_sum(model: BlockModel, mlp: Mlp) -> float:
    """More than a unit of the first layer ever sums up, whatever the anchor, the eye and x."""
    light = np.zeros(1) if model.light is None else most_light(model.light).max(axis=0, initial=0)
    most = {
        "feature": np.abs(model.features).max(axis=0, initial=0),
        "direction": np.ones(3),
        "light": light,
        "control": np.ones(model.encoding.d),
    }
    each = np.concatenate([most[part] for part in mlp.inputs])
    sums = np.abs(mlp.weights[0]).astype(np.float64) @ each + np.abs(mlp.biases[0])
    return float(sums.max(initial=0))
