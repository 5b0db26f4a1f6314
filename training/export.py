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
from shapeshift.training.heads.gaussians import REACH, SCALE_CLIP, UNIT
from shapeshift.training.heads.networks import (
    ATTRIBUTE_WIDTH,
    LOBE_AXES,
    LOBE_EDGE,
    LOBE_SLOPE,
    HeadLayout,
)

ACTIVATION = {
    "offset": "tanh", "scale": "exp", "rotation": "none", "opacity": "tanh", "color": "sigmoid",
}  # fmt: skip

OWN_COLORS = ("colors", "lobes")  # groups of the optimiser that become features, in this order


def model_of(
    state: dict[str, np.ndarray],
    layout: HeadLayout,
    voxel: float,
    encoding: ControlEncoding,
    stops: tuple[Stop, ...],
    provenance: dict,
) -> AnchorModel:
    """The model of an optimiser's state; its networks give metres and colours, ready to draw.

    Base colours and lobes become the last features, which every network takes and the colour
    network alone looks at.
    """
    gain = {"offset": REACH * voxel, "scale": UNIT * voxel}
    features = state["features.value"][:, : layout.features]
    own = [name for name in OWN_COLORS if name in layout.per_anchor]
    features = np.concatenate([features, *(state[f"{name}.value"] for name in own)], axis=1)
    networks = {}
    unpacked = layout.unpack(state["weights.value"])
    for name in HEADS:
        arrays = unpacked[name]
        mlp = Mlp(
            arrays[::2], arrays[1::2], ACTIVATION[name], layout.parts_of(name),
            SCALE_CLIP if name == "scale" else None, gain.get(name, 1.0),
        )  # fmt: skip
        mlp = with_columns(mlp, layout.features, features.shape[1] - layout.features)
        networks[name] = with_own_colors(mlp, layout.features, own) if name == "color" else mlp
    frames = None
    if "frame" in layout.attributes:
        values = state["frames.value"]
        frames = AnchorFrames(np.exp(values[:, :3]), normalize(values[:, 3:]))
    return AnchorModel(
        state["anchors.value"], np.ascontiguousarray(features), networks, layout.splats, encoding,
        stops, provenance, frames=frames,
    )  # fmt: skip


def with_columns(mlp: Mlp, features: int, more: int) -> Mlp:
    """The network on `more` features after its `features` first inputs, which it ignores."""
    first = np.insert(mlp.weights[0], [features] * more, 0, axis=1)
    return replace(mlp, weights=(first, *mlp.weights[1:]))


def with_own_colors(mlp: Mlp, at: int, own: list[str]) -> Mlp:
    """The colour network with what base colours and lobes add to every splat, from input `at` on.

    Base colours go through the ReLUs as v = relu(v) - relu(-v), lobes are made of ReLUs: see
    gaussians.cl.  So the sum is exact up to its rounding.
    """
    end = at + sum(ATTRIBUTE_WIDTH[name] for name in own)  # the direction follows the features
    for name in own:
        width = ATTRIBUTE_WIDTH[name]
        if name == "colors":
            units = np.zeros((2 * width, mlp.width_in), np.float32)
            units[:, at : at + width] = np.concatenate([np.eye(width), -np.eye(width)])
            bias, gives = np.zeros(len(units)), units[:, at : at + width].T  # (3, units)
        else:
            units = np.zeros((2 * width, mlp.width_in), np.float32)
            units[:width, at : at + width] = np.eye(width)
            units[:, end : end + 3] = np.tile(LOBE_SLOPE * LOBE_AXES, (2, 1))
            bias = np.full(len(units), -LOBE_SLOPE * LOBE_EDGE)
            gives = np.repeat([[1.0, -1.0]], width, axis=1).repeat(3, axis=0)  # (3, units)
        mlp = with_units(mlp, units, bias, gives)
        at += width
    return mlp


def with_units(mlp: Mlp, units: np.ndarray, bias: np.ndarray, gives: np.ndarray) -> Mlp:
    """A colour network with more hidden units: what each takes (units, in), its bias (units,), and
    what it gives to the three channels of every splat, (3, units).
    """
    splats = mlp.width_out // SIZE_PER_SPLAT["color"]
    last = np.concatenate([mlp.weights[-1], np.tile(gives, (splats, 1))], axis=1)
    return replace(
        mlp,
        weights=(np.concatenate([mlp.weights[0], units]), last.astype(np.float32)),
        biases=(np.concatenate([mlp.biases[0], bias]).astype(np.float32), mlp.biases[-1]),
    )
