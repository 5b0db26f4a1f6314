"""A trained state as the AnchorModel that a package holds."""

from dataclasses import replace
from typing import Any

import numpy as np

from shapeshift.runtime_models.eyes import spread_eyes
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
from shapeshift.training.heads.networks import HeadLayout

ACTIVATION = {
    "offset": "tanh", "scale": "exp", "rotation": "none", "opacity": "tanh", "color": "sigmoid",
}  # fmt: skip
# The hidden units of a gated base colour c, of a stop of weight w: how much of c, of M w and of M
# each has, and what it adds to the output; see with_gates.
GATE = ((1, 1, -1, 0.5), (-1, 1, -1, -0.5), (1, 1, 0, 0.5), (1, -1, 0, -0.5))


def notes_of(capture: Capture) -> dict[str, Any]:
    """What a package says of its capture: its name, where its photos were taken, and where the
    package's zero lies in the capture's world, if elsewhere."""
    taken = [p.view for p in capture.photos if p.split == "train"]
    places = np.array([view.world_from_eye.position for view in taken])
    looks = np.array([(*view.world_from_eye.wxyz, *view.tangents) for view in taken])
    notes: dict[str, Any] = {"capture": capture.folder.name, **spread_eyes(places, looks)}
    return notes | ({"origin_m": list(capture.origin)} if any(capture.origin) else {})


def model_of(
    state: dict[str, np.ndarray],
    layout: HeadLayout,
    voxel: float,
    encoding: ControlEncoding,
    stops: tuple[Stop, ...],
    provenance: dict,
) -> AnchorModel:
    """The model of an optimiser's state; its networks give metres and colours, ready to draw.

    Base colours become the last features, three of all stops or three of each, which every network
    takes and the colour network alone looks at; what light by direction gives becomes an input that
    it alone has.
    """
    gain = {"offset": REACH * voxel, "scale": UNIT * voxel}
    features = state["features.value"][:, : layout.features]
    own_colors = [state[f"{group}.value"] for group in layout.color_groups]
    own_light = "light" in layout.own
    features = np.concatenate([features, *own_colors], axis=1)
    colors = features[:, layout.features :]
    networks = {}
    unpacked = layout.unpack(state["weights.value"])
    for name in HEADS:
        arrays = unpacked[name]
        mlp = Mlp(
            arrays[::2], arrays[1::2], ACTIVATION[name], layout.parts_of(name),
            SCALE_CLIP if name == "scale" else None, gain.get(name, 1.0),
        )  # fmt: skip
        if own_colors:
            one = len(own_colors) == 1 and name == "color"
            mlp = with_skip(mlp, layout.features, colors.shape[1], colors.shape[1] if one else 0)
        if len(own_colors) > 1 and name == "color":
            mlp = with_gates(mlp, layout.features, gate_rows(encoding, stops), gate_bound(colors))
        if own_light and name == "color":
            mlp = with_light(mlp, features.shape[1], layout.light_channels)
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


def gate_rows(encoding: ControlEncoding, stops: tuple[Stop, ...]) -> np.ndarray:
    """(S, d) float64: rows whose products with Psi are the weights of the stops, which add up to 1
    at each of them and in every blend.
    """
    at_stops = np.stack([encoding.encode(stop.x) for stop in stops]).astype(np.float64)
    return np.linalg.pinv(at_stops).T


def gate_bound(colors: np.ndarray) -> float:
    """What no base colour's logit exceeds, also once it was rounded, or moved a little."""
    return 1.0 + 1.25 * float(np.abs(colors).max(initial=0.0))


def with_gates(mlp: Mlp, at: int, weights: np.ndarray, bound: float) -> Mlp:
    """A network of one hidden layer that adds the base colours of a control's stops.

    The inputs from `at` on are three logits a stop, at most `bound` in size; weights: (S, d), so
    that w = weights Psi.  A ReLU cannot multiply, but of c within +-M and w between 0 and 1

        (relu(c + M (w - 1)) - relu(-c + M (w - 1)) + relu(c + M w) - relu(c - M w) - M w) / 2

    is c at w = 1, 0 at w = 0 and c / 2 at w = 1/2, and lies between c and 0 elsewhere.  So it is
    exact at every stop, up to rounding.
    """
    first, last = mlp.weights
    width, (stops, units) = SIZE_PER_SPLAT["color"], weights.shape
    assert mlp.inputs[-1] == "control"
    of_color, of_weight, bias, adds = np.array(GATE, np.float64).T  # (4,) each
    rows = np.zeros((stops, width, len(GATE), first.shape[1]))
    for stop, channel in np.ndindex(stops, width):
        rows[stop, channel, :, at + width * stop + channel] = of_color
        rows[stop, channel, :, -units:] = bound * np.outer(of_weight, weights[stop])
    columns = np.tile(np.kron(np.eye(width), adds), (len(last) // width, stops))
    # The weights of all stops add up to 1, so that all M w / 2 are M / 2 together.
    last_bias = mlp.biases[1] - np.float32(bound / 2)
    return replace(
        mlp,
        weights=(
            np.concatenate([first, rows.reshape(-1, first.shape[1])]).astype(np.float32),
            np.concatenate([last, columns], axis=1).astype(np.float32),
        ),
        biases=(
            np.append(mlp.biases[0], np.tile(bound * bias, stops * width)).astype(np.float32),
            last_bias,
        ),
    )


def with_light(mlp: Mlp, features: int, channels: int) -> Mlp:
    """The colour network with an input "light" behind the direction, which follows the features:
    the last layer adds it to every number of every splat, or each of three to its own.
    """
    at, size = features + 3, SIZE_PER_SPLAT["color"]
    first = np.insert(mlp.weights[0], [at] * channels, 0, axis=1)
    inputs = list(mlp.inputs)
    inputs.insert(inputs.index("direction") + 1, "light")
    wide = replace(mlp, weights=(first, *mlp.weights[1:]), inputs=tuple(inputs))
    return with_carried(wide, at, np.eye(size) if channels > 1 else np.ones((size, 1)))


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
