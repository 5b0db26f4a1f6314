"""A finished model as what an optimiser holds: the inverse of training/export.py.

The base colours of a package lie among its features, and what adds them to the colour network's
outputs among its hidden units; here they stay there.  Light by direction is taken out of the colour
network, as the kernels add it themselves.  Networks with fewer hidden units than the
widest get units that are 0, and stay 0.
"""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.model import HEADS, AnchorModel, BadFile, Mlp
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
    networks = model.networks | {"color": unlit_color(model)}
    own = ("frame", model.frames is not None), ("light", model.light is not None)
    return HeadLayout(
        model.splats_per_anchor,
        model.features.shape[1],
        max(len(mlp.biases[0]) for mlp in networks.values()),
        model.encoding.d,
        tuple(name for name in HEADS if "control" not in model.networks[name].inputs),
        "direction" in model.networks["color"].inputs,
        tuple(name for name, there in own if there),
        light_channels=model.input_widths["light"],
    )


def unlit_color(model: AnchorModel) -> Mlp:
    """The colour network without its input "light" and the units that carry it to the outputs.

    Raises BadFile where these do otherwise than add it to every logit.
    """
    color = model.networks["color"]
    if model.light is None:
        return color
    at = np.repeat(color.inputs, [model.input_widths[part] for part in color.inputs]) == "light"
    (first, last), (bias, _) = color.weights, color.biases
    slopes = first[:, at]  # (units, channels)
    carry, channels = slopes.any(axis=1), slopes.shape[1]
    # What each channel adds, where it is above 0 and where it is below.
    adds = [
        last @ np.where(side, slopes, 0) for side in (slopes > 0, slopes < 0)
    ]  # (outputs, channels)
    wanted = np.arange(len(last))[:, None] % channels == np.arange(channels)
    mixes = first[carry][:, ~at].any() or bias[carry].any()
    mixes = mixes or (np.count_nonzero(slopes, axis=1) > 1).any()
    if mixes or not all((a == wanted).all() for a in adds):
        raise BadFile(
            "the color network of this scene mixes light by direction with its other inputs; "
            "scenes of `train`, where it is added to them, can be updated."
        )
    return replace(
        color,
        weights=(first[~carry][:, ~at], last[:, ~carry]),
        biases=(bias[~carry], color.biases[1]),
        inputs=tuple(part for part in color.inputs if part != "light"),
    )


def voxel_of(model: AnchorModel) -> float:
    """Metres: the size in which its anchors' steps and the reach of its splats are counted."""
    return float(model.networks["offset"].gain) / REACH


def packed_weights(model: AnchorModel, layout: HeadLayout) -> np.ndarray:
    """The model's networks as the device's flat weights."""
    networks: dict[str, Layers] = {}
    for name in HEADS:
        mlp = unlit_color(model) if name == "color" else model.networks[name]
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
    if model.light is not None:
        rows["light"] = model.light.astype(np.float32)
    return rows
