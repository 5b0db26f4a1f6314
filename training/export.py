"""A trained state as the AnchorModel that a package holds."""

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
from shapeshift.training.heads.networks import ATTRIBUTE_WIDTH, HeadLayout

ACTIVATION = {
    "offset": "tanh", "scale": "exp", "rotation": "none", "opacity": "tanh", "color": "sigmoid",
}  # fmt: skip


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
    alone looks at.
    """
    gain = {"offset": REACH * voxel, "scale": UNIT * voxel}
    features = state["features.value"][:, : layout.features]
    own_colors = "color" in layout.attributes
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
        networks[name] = mlp
    frames = None
    if "frame" in layout.attributes:
        values = state["frames.value"]
        frames = AnchorFrames(np.exp(values[:, :3]), normalize(values[:, 3:]))
    return AnchorModel(
        state["anchors.value"], np.ascontiguousarray(features), networks, layout.splats, encoding,
        stops, provenance, frames=frames,
    )  # fmt: skip


def with_skip(mlp: Mlp, features: int, more: int, added: int) -> Mlp:
    """The network on `more` features after its `features` first inputs, which it ignores.

    added: 0, or as many as `more`: what the last layer adds to the numbers of every splat.  They
    go through the ReLUs as v = relu(v) - relu(-v), so the sum is exact up to its rounding.
    """
    first = np.insert(mlp.weights[0], [features] * more, 0, axis=1)
    weights, biases = [first, *mlp.weights[1:]], list(mlp.biases)
    if added:
        both = np.concatenate([np.eye(more), -np.eye(more)]).astype(np.float32)  # (2 more, more)
        rows = np.zeros((2 * more, first.shape[1]), np.float32)
        rows[:, features : features + more] = both
        weights[0] = np.concatenate([first, rows])
        splats = len(weights[-1]) // SIZE_PER_SPLAT["color"]
        last = np.tile(both.T, (splats, 1))  # (k * 3, 2 more)
        weights[-1] = np.concatenate([weights[-1], last], axis=1)
        nothing = np.zeros(2 * more, np.float32)
        biases[0] = np.concatenate([biases[0], nothing])
    return Mlp(tuple(weights), tuple(biases), mlp.head, mlp.inputs, mlp.clip, mlp.gain)
