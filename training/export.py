"""A trained state as the AnchorModel that a package holds."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import (
    HEADS,
    SIZE_PER_SPLAT,
    AnchorFrames,
    AnchorModel,
    ControlEncoding,
    Mlp,
    Stop,
)
from shapeshift.runtime_models.rotation import normalize
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.heads.gaussians import REACH, SCALE_CLIP, UNIT
from shapeshift.training.heads.networks import ATTRIBUTE_WIDTH, HeadLayout

ACTIVATION = {
    "offset": "tanh", "scale": "exp", "rotation": "none", "opacity": "tanh", "color": "sigmoid",
}  # fmt: skip


def origin_in(capture: Capture) -> dict[str, object]:
    """What a package says of where its zero lies in the world of its capture, if elsewhere."""
    return {"origin_m": list(capture.origin)} if any(capture.origin) else {}


def model_of(
    state: dict[str, np.ndarray],
    layout: HeadLayout,
    voxel: float,
    encoding: ControlEncoding,
    stops: tuple[Stop, ...],
    provenance: dict,
) -> AnchorModel:
    """The model of an optimiser's state; its networks give metres and colours, ready to draw.

    Base colours become the last three features, which every network takes and the colour network
    alone looks at; what light by direction gives becomes an input that it alone has.
    """
    gain = {"offset": REACH * voxel, "scale": UNIT * voxel}
    features = state["features.value"][:, : layout.features]
    own_colors, own_light = ("color" in layout.attributes), ("light" in layout.per_anchor)
    if own_colors:
        features = np.concatenate([features, state["colors.value"]], axis=1)
    networks = {}
    unpacked = layout.unpack(state["weights.value"])
    for name in HEADS:
        arrays = unpacked[name]
        mlp = Mlp(
            arrays[::2], arrays[1::2], ACTIVATION[name], layout.parts_of(name),
            SCALE_CLIP if name == "scale" else None, gain.get(name, 1.0),
        )  # fmt: skip
        if own_colors:
            extra = ATTRIBUTE_WIDTH["colors"] if name == "color" else 0
            mlp = with_skip(mlp, layout.features, ATTRIBUTE_WIDTH["colors"], extra)
        if own_light and name == "color":
            mlp = with_light(mlp, features.shape[1])
        networks[name] = mlp
    frames = None
    if "frame" in layout.attributes:
        values = state["frames.value"]
        frames = AnchorFrames(np.exp(values[:, :3]), normalize(values[:, 3:]))
    return AnchorModel(
        state["anchors.value"], np.ascontiguousarray(features), networks, layout.splats, encoding,
        stops, provenance, frames=frames,
        light=np.ascontiguousarray(state["light.value"]) if own_light else None,
    )  # fmt: skip


def with_skip(mlp: Mlp, features: int, more: int, added: int) -> Mlp:
    """The network on `more` features after its `features` first inputs, which it ignores.

    added: 0, or as many as `more`: what the last layer adds to the numbers of every splat.
    """
    first = np.insert(mlp.weights[0], [features] * more, 0, axis=1)
    wide = replace(mlp, weights=(first, *mlp.weights[1:]))
    return with_carried(wide, features, np.eye(more)) if added else wide


def with_light(mlp: Mlp, features: int) -> Mlp:
    """The colour network with an input "light" behind the direction, which follows the features:
    the last layer adds it to every number of every splat.
    """
    at = features + 3
    first = np.insert(mlp.weights[0], at, 0, axis=1)
    inputs = list(mlp.inputs)
    inputs.insert(inputs.index("direction") + 1, "light")
    wide = replace(mlp, weights=(first, *mlp.weights[1:]), inputs=tuple(inputs))
    return with_carried(wide, at, np.ones((SIZE_PER_SPLAT["color"], 1)))


def with_carried(mlp: Mlp, at: int, adds: np.ndarray) -> Mlp:
    """A network of one hidden layer that adds inputs from `at` on to the numbers of every splat.

    adds: (numbers a splat, inputs), how much of each.  They go through the ReLU as
    v = relu(v) - relu(-v), so the sum is exact up to its rounding.
    """
    first, last = mlp.weights
    more = adds.shape[1]
    both = np.concatenate([np.eye(more), -np.eye(more)])  # (2 more, more)
    rows = np.zeros((2 * more, first.shape[1]), np.float32)
    rows[:, at : at + more] = both
    columns = np.tile(adds @ both.T, (len(last) // len(adds), 1)).astype(np.float32)
    weights = np.concatenate([first, rows]), np.concatenate([last, columns], axis=1)
    first_bias = np.concatenate([mlp.biases[0], np.zeros(2 * more, np.float32)])
    return replace(mlp, weights=weights, biases=(first_bias, mlp.biases[1]))
