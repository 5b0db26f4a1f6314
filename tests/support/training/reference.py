"""The slow twin of a training step in plain numpy float64: heads, activations and losses; and what
plain splats decode to.
"""

from collections.abc import Callable

import numpy as np

from shapeshift.rasterizer.project import Camera
from shapeshift.runtime_models.colors.spherical_harmonics import C1, basis
from shapeshift.runtime_models.model import HEADS
from shapeshift.runtime_models.rotation import normalize, product, rotation_matrices
from shapeshift.scene.metrics import ssim_map
from shapeshift.training.heads.gaussians import REACH, SCALE_CLIP, UNIT
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.losses.losses import MIN_OPACITY
from tests.support.renderer.rasterizer_reference import finite_differences, render_reference


def directions(anchors: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(A, 3) unit vectors from the eye to the anchors (eq. 4)."""
    away = anchors - eye
    return away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-8)


def head_inputs(
    parts: tuple[str, ...], features: np.ndarray, direction: np.ndarray, control: np.ndarray
) -> np.ndarray:
    """(A, in): the parts that a head takes, side by side (eq. 5)."""
    repeated = np.repeat(np.asarray(control, np.float64)[None], len(features), axis=0)
    values = {"feature": features, "direction": direction, "control": repeated}
    return np.concatenate([values[part] for part in parts], axis=1)


def heads_reference(
    layout: HeadLayout, networks: dict, features, direction, control
) -> dict[str, tuple]:
    """(units of every hidden layer [(A, H)], raw (A, out)) of every head; networks as unpacked.

    Of networks (B, out, in) and (B, out) they are (B, A, H) and (B, A, out).
    """
    out = {}
    for name in HEADS:
        arrays = [np.asarray(a, np.float64) for a in networks[name]]
        value, units = head_inputs(layout.parts_of(name), features, direction, control), []
        for weight, bias in zip(arrays[:-2:2], arrays[1:-2:2], strict=True):
            value = np.maximum(value @ weight.swapaxes(-1, -2) + bias[..., None, :], 0)
            units.append(value)
        out[name] = (units, value @ arrays[-2].swapaxes(-1, -2) + arrays[-1][..., None, :])
    return out


def activate_reference(
    raw: dict[str, np.ndarray], anchors: np.ndarray, voxel: float,
    frames: np.ndarray | None = None, colors: np.ndarray | None = None,
    light: np.ndarray | None = None, direction: np.ndarray | None = None,
) -> tuple:  # fmt: skip
    """(means, scales, wxyz, opacity, color) of raw outputs (A, out) by head.

    frames (A, 7), base colours (A, 3) and light (A, 8 C), by directions (A, 3) from the eye, where
    anchors have such: see gaussians.cl.
    """
    count, k = raw["opacity"].shape
    frames = np.tile([0.0, 0, 0, 1, 0, 0, 0], (count, 1)) if frames is None else frames
    colors = np.zeros((count, 3)) if colors is None else colors
    if light is not None and direction is not None:
        colors = colors + light_of(light, direction)
    frames, base = np.repeat(frames, k, axis=0), np.repeat(colors, k, axis=0)
    size, turn = np.exp(frames[:, :3]), normalize(frames[:, 3:])
    offset = size * REACH * voxel * np.tanh(raw["offset"].reshape(-1, 3))
    return (
        np.repeat(anchors, k, axis=0) + (rotation_matrices(turn) @ offset[..., None])[..., 0],
        size * UNIT * voxel * np.exp(np.clip(raw["scale"].reshape(-1, 3), *SCALE_CLIP)),
        product(turn, raw["rotation"].reshape(-1, 4)),
        np.tanh(raw["opacity"].ravel()),
        1 / (1 + np.exp(-raw["color"].reshape(-1, 3) - base)),
    )


def light_of(light: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(A, C) logits that coefficients (A, 8 C) add along directions (A, 3), by 3DGS's table."""
    there = basis(direction, 9)[:, [3, 1, 2, 4, 5, 7, 6, 8]] * [-1, -1, 1, 1, -1, -1, 1, 1] / C1
    return (light.reshape(len(light), -1, 8) * there[:, None]).sum(axis=2)


def decode_reference(
    layout: HeadLayout, parameters: dict[str, np.ndarray], control, eye, voxel: float,
    stop: int = 0,
) -> tuple:  # fmt: skip
    """The splats of an optimiser's values: weights (flat), anchors (A, 3), features (A, F).

    stop: whose base colours they have, where anchors have some for each.
    Of weights (B, flat) there are the splats of B networks, one set after the other.
    """
    anchors = np.asarray(parameters["anchors"], np.float64)
    features = np.asarray(parameters["features"], np.float64)[:, : layout.features]
    sets = np.atleast_2d(parameters["weights"])
    places = layout.unpack(np.arange(sets.shape[1]))
    networks = {name: [sets[:, place] for place in layers] for name, layers in places.items()}
    heads = heads_reference(layout, networks, features, directions(anchors, eye), control)
    anchors = np.tile(anchors, (len(sets), 1))
    of_color = layout.color_groups
    groups = dict(zip(layout.own, layout.own, strict=True))
    if of_color:
        groups["colors"] = of_color[stop if len(of_color) > 1 else 0]
    own = {
        name: np.tile(np.asarray(parameters[group], np.float64), (len(sets), 1))
        for name, group in groups.items()
    }
    raw = {name: outputs.reshape(len(anchors), -1) for name, (_, outputs) in heads.items()}
    return activate_reference(raw, anchors, voxel, **own, direction=directions(anchors, eye))


def differences(
    loss: Callable[[tuple], float], decode: Callable[[dict], tuple],
    parameters: dict[str, np.ndarray], layout: HeadLayout | None = None, step: float = 1e-6,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Central differences of loss(decode(parameters)) for every entry of every group.

    By the chain rule: those of the loss for each number of the splats, times those of the splats.
    So a picture is drawn twice for a splat's 14 numbers and not for each weight.  Of anchors, one
    makes no other's splats: a column of all moves at once.
    """

    def rows(moved: dict) -> np.ndarray:
        return np.column_stack(decode(parameters | moved))  # (splats, 14)

    def splats(values: np.ndarray) -> tuple:
        means, scales, wxyz, opacity, color = np.split(values, (3, 6, 10, 11), axis=1)
        return means, scales, wxyz, opacity[:, 0], color

    slopes = finite_differences(lambda values: loss(splats(values)), rows({}), step)
    found = {}
    for name, array in parameters.items():
        values = array.astype(np.float64)
        grads = np.zeros(values.shape)
        if name == "weights":  # what no head sees is frozen; the reference does not know it at all
            assert layout is not None
            real = np.flatnonzero(layout.pack(layout.unpack(np.ones(values.size))))
            moves = step * np.eye(values.size)[real]
            change = rows({name: values + moves}) - rows({name: values - moves})
            each = (change.reshape(len(real), *slopes.shape) * slopes).sum(axis=(1, 2))
            grads[real] = each / (2 * step)
        else:
            for column in np.ndindex(values.shape[1:]):
                move = np.zeros(values.shape)
                move[:, *column] = step
                change = rows({name: values + move}) - rows({name: values - move})
                each = (change * slopes).reshape(len(values), -1).sum(axis=1)
                grads[:, *column] = each / (2 * step)
        found[name] = grads
    return found


def image_loss_reference(image, photo, share: float, weight=None) -> float:
    """(1 - share) L1 + share (1 - SSIM) of (H, W, 3) images, over the pixels that count."""
    values = 3 * photo.shape[0] * photo.shape[1]
    if weight is not None:
        image = photo + weight[..., None] * (image - photo)
        values = 3 * weight.sum()
    l1 = np.abs(image - photo).sum() / values
    return (1 - share) * l1 + share * (1 - ssim_map(image, photo)).sum() / values


def step_loss_reference(
    splats: tuple, camera: Camera, photo, background, shares: tuple[float, float]
) -> float:
    """Eq. 8 of drawn splats and the loss of losses.py; shares: of D-SSIM, and of that."""
    ssim_share, min_opacity_share = shares
    image, _ = render_reference(splats, camera, background)
    image_loss = image_loss_reference(image.transpose(1, 2, 0), photo, ssim_share)
    return float(image_loss + min_opacity_share * np.maximum(MIN_OPACITY - splats[3], 0).mean())


def decode_plain_reference(parameters: dict[str, np.ndarray], eye: np.ndarray, used: int) -> tuple:
    """(means, scales, wxyz, opacity, color) of an optimiser's values seen from `eye` (3,).

    used: how many coefficients count besides the first.
    """
    values = {name: np.asarray(array, np.float64) for name, array in parameters.items()}
    harmonics = np.concatenate([values["base"][:, None], values["rest"][:, :used]], axis=1)
    weights = basis(directions(values["means"], eye), 1 + used)
    return (
        values["means"],
        np.exp(values["scales"]),
        values["wxyz"],
        1 / (1 + np.exp(-values["opacity"])),
        np.maximum(0.5 + np.einsum("nm,nmc->nc", weights, harmonics), 0),
    )
