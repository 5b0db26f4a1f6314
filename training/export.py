"""A trained state as the AnchorModel that a package holds."""

import numpy as np

from shapeshift.runtime_models.model import HEADS, AnchorModel, ControlEncoding, Mlp, Stop
from shapeshift.training.heads.gaussians import REACH, SCALE_CLIP, UNIT
from shapeshift.training.heads.networks import HeadLayout

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
    """The model of an optimiser's state; its networks give metres and colours, ready to draw."""
    gain = {"offset": REACH * voxel, "scale": UNIT * voxel}
    networks = {}
    unpacked = layout.unpack(state["weights.value"])
    for name in HEADS:
        arrays = unpacked[name]
        networks[name] = Mlp(
            arrays[::2], arrays[1::2], ACTIVATION[name], layout.parts_of(name),
            SCALE_CLIP if name == "scale" else None, gain.get(name, 1.0),
        )  # fmt: skip
    return AnchorModel(
        state["anchors.value"],
        np.ascontiguousarray(state["features.value"][:, : layout.features]),
        networks,
        layout.splats,
        encoding,
        stops,
        provenance,
    )
