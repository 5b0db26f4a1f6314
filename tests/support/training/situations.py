"""A training step held still: scene, view and target whose gradients are checked."""

from dataclasses import replace

import numpy as np

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.drawing import camera_of
from shapeshift.training.heads.networks import HeadLayout, initial_weights
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import SSIM_SHARE, ImageLoss
from shapeshift.training.step import TrainingStep
from tests.support.training.reference import decode_reference, differences, step_loss_reference

LAYOUT = HeadLayout(
    splats=2, features=8, hidden=8, control=4, attributes=("frame", "color", "light")
)
OTHERS = {
    "shape fixed": replace(LAYOUT, fixed=("offset", "scale", "rotation")),
    "colour alike from everywhere": replace(LAYOUT, view_dependent=False),
    "all at once": replace(LAYOUT, fixed=("opacity", "color"), view_dependent=False),
    "no frames": replace(LAYOUT, attributes=("color", "light")),
    "no base colours": replace(LAYOUT, attributes=("frame", "light")),
    "no light": replace(LAYOUT, attributes=("frame", "color")),
}
VOXEL = 0.5
SIZE = (21, 18)  # neither a multiple of a tile nor of a vector
BACKGROUND = (0.2, 0.5, 0.9)
MIN_OPACITY_SHARE = 0.7  # of the loss: as large as the image's, so that an error of either shows


def situation(seed: int, layout: HeadLayout = LAYOUT):
    """(parameters, control, view, rgba): a few large splats, some absent, all heads active."""
    rng = np.random.default_rng(seed)
    parameters = {
        "weights": (2 * initial_weights(layout, rng)).astype(np.float32),
        "anchors": rng.uniform(-0.6, 0.6, (5, 3)).astype(np.float32),
        "features": rng.normal(size=(5, 8)).astype(np.float32),
    }
    own = {
        "frames": rng.normal(0, 0.5, (5, 7)), "colors": rng.normal(size=(5, 3)),
        "light": rng.normal(0, 0.5, (5, 24)),
    }  # fmt: skip
    parameters |= {n: own[n].astype(np.float32) for n in layout.per_anchor[2:]}
    control = rng.random(4).astype(np.float32)
    eye = look_at(np.array([0.5, 0.7, 3.0]), np.zeros(3))
    view = View(eye, perspective(np.deg2rad(40), SIZE), 0.05, 100.0, SIZE)
    rgba = rng.integers(0, 256, (SIZE[1], SIZE[0], 4)).astype(np.uint8)
    rgba[..., 3] = 255
    return parameters, control, view, rgba


def compare_gradients(device, layout: HeadLayout, seed: int) -> None:
    """What the kernels give beside finite differences of the float64 reference."""
    parameters, control, view, rgba = situation(seed, layout)
    rates = {name: np.ones(1) for name in parameters}
    adam = Adam(device, parameters, rates)
    step = TrainingStep(device, layout, VOXEL, adam)
    loss = ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND)
    drawing = step.draw(view, control, BACKGROUND)
    grads = step.gradients(drawing, loss, target, min_opacity_share=MIN_OPACITY_SHARE)
    shares = SSIM_SHARE, MIN_OPACITY_SHARE
    photo, camera = rgba[..., :3] / 255, camera_of(view)
    eye = view.world_from_eye.position
    wanted = differences(
        lambda splats: step_loss_reference(splats, camera, photo, BACKGROUND, shares),
        lambda moved: decode_reference(layout, moved, control, eye, VOXEL),
        parameters, layout,
    )  # fmt: skip
    for name, found in grads.items():
        difference = np.abs(device.download(found) - wanted[name]).max()
        # float32 all the way, sums of some hundred terms: a few units in the seventh digit each
        assert difference < 1e-5 * np.abs(wanted[name]).max(), (name, difference)
