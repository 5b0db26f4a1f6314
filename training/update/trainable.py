"""A finished model as what an optimiser holds: the inverse of training/export.py.

The base colours of a package lie among its features, and what adds them to the colour network's
outputs among its hidden units; here they stay there.  Networks with fewer hidden units than the
widest get units that are 0, and stay 0.
"""

import numpy as np

from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile
from shapeshift.training.heads.gaussians import REACH
from shapeshift.training.heads.networks import HeadLayout, Layers, padded
from shapeshift.training.styles.stop_trainer import refuse_unusual


def layout_of(model: AnchorModel) -> HeadLayout:
    """How the kernels lay the model's networks out.  Raises BadFile for those they cannot run."""
    refuse_unusual(model)
    for name in HEADS:
        if len(model.networks[name].weights) != 2:
            raise BadFile(
                f"the {name} network of this scene has {len(model.networks[name].weights) - 1} "
                "hidden layers; scenes with one in every network can be updated."
            )
    return HeadLayout(
        model.splats_per_anchor,
        model.features.shape[1],
        max(len(model.networks[name].biases[0]) for name in HEADS),
        model.encoding.d,
        tuple(name for name in HEADS if "control" not in model.networks[name].inputs),
        "direction" in model.networks["color"].inputs,
        () if model.frames is None else ("frame",),
    )


def voxel_of(model: AnchorModel) -> float:
    """Metres: the size in which its anchors' steps and the reach of its splats are counted."""
    return float(model.networks["offset"].gain) / REACH


def packed_weights(model: AnchorModel, layout: HeadLayout) -> np.ndarray:
    """The model's networks as the device's flat weights."""
    networks: dict[str, Layers] = {}
    for name in HEADS:
        mlp = model.networks[name]
        more = layout.hidden - len(mlp.biases[0])
        networks[name] = (
            np.pad(mlp.weights[0], ((0, more), (0, 0))),
            np.pad(mlp.biases[0], (0, more)),
            np.pad(mlp.weights[1], ((0, 0), (0, more))),
            mlp.biases[1],
        )
    return layout.pack(networks)


def rows_of(model: AnchorModel, layout: HeadLayout) -> dict[str, np.ndarray]:
    """What its anchors have, by the optimiser's groups, float32."""
    features = np.zeros((len(model.anchors), padded(layout.features)), np.float32)
    features[:, : layout.features] = model.features
    rows = {"anchors": model.anchors.astype(np.float32), "features": features}
    if model.frames is not None:
        frames = [np.log(model.frames.scales), model.frames.wxyz]
        rows["frames"] = np.hstack(frames).astype(np.float32)
    return rows
