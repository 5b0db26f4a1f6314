"""Plain splats' whole step against finite differences in float64: every parameter, every degree."""

import numpy as np
import pytest

from shapeshift.training.baselines.plain_step import (
    GROUPS,
    REST,
    PlainDensificationStats,
    PlainStep,
)
from shapeshift.training.drawing import camera_of
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import SSIM_SHARE, ImageLoss
from tests.support.training.plain_situations import SIZE, situation
from tests.support.training.reference import (
    decode_plain_reference,
    differences,
    step_loss_reference,
)

BACKGROUND = (0.2, 0.5, 0.9)
SHARES = SSIM_SHARE, 0.0  # no loss of faint splats


@pytest.mark.parametrize(
    ("degree", "used", "seed"), [(0, 0, 0), (1, 3, 0), (2, 8, 1), (3, 15, 0), (3, 15, 2), (3, 3, 1)]
)
def test_every_gradient(device, degree, used, seed):
    parameters, view, rgba = situation(seed, degree)
    step = PlainStep(device, Adam(device, parameters, dict.fromkeys(GROUPS, np.ones(1))), degree)
    step.used = used
    loss = ImageLoss(device, SIZE)
    target = loss.target(device.upload(rgba), BACKGROUND)
    drawing = step.draw(view, BACKGROUND)
    grads = step.gradients(drawing, loss, target)
    photo, camera, eye = rgba[..., :3] / 255, camera_of(view), view.world_from_eye.position
    assert (device.download(drawing.splats.color) == 0).any()  # colours that are cut are there

    all_wanted = differences(
        lambda splats: step_loss_reference(splats, camera, photo, BACKGROUND, SHARES),
        lambda values: decode_plain_reference(values, eye, used), parameters,
    )  # fmt: skip
    assert grads.keys() == parameters.keys()
    for name in GROUPS:
        if not parameters[name].size:
            continue
        found, wanted = device.download(grads[name]), all_wanted[name]
        difference = np.abs(found - wanted).max() / np.abs(wanted).max()
        assert difference < 1e-5, (name, difference)
        if name == "rest":
            assert (found[:, used:] == 0).all()  # what is not switched on stays


@pytest.mark.parametrize("degree", [0, 3])
def test_the_kernel_decodes_as_its_twin(device, degree):
    for count in (1, 63, 64, 65):
        parameters, view, _ = situation(3, degree, count)
        adam = Adam(device, parameters, dict.fromkeys(GROUPS, np.ones(1)))
        eye = view.world_from_eye.position
        splats = PlainStep(device, adam, degree).decode(eye)
        wanted = decode_plain_reference(parameters, eye, REST[degree])
        for found, want in zip(splats.fields(), wanted, strict=True):
            np.testing.assert_allclose(device.download(found), want, rtol=2e-6, atol=2e-6)


def test_a_splat_that_is_not_a_number_is_not_drawn_as_black(device):
    parameters, view, _ = situation(0, 3)
    parameters["rest"][2] = np.nan
    adam = Adam(device, parameters, dict.fromkeys(GROUPS, np.ones(1)))
    step = PlainStep(device, adam, 3)
    assert np.isnan(device.download(step.decode(np.zeros(3)).color)[2]).all()
    drawing = step.draw(view, BACKGROUND)
    assert np.isfinite(device.download(drawing.frame.image)).all()


def test_evidence_is_the_mean_screen_gradient_of_what_was_seen(device):
    parameters, view, rgba = situation(0, 1)
    parameters["means"][4] = (0, 0, 50)  # behind the eye
    step = PlainStep(device, Adam(device, parameters, dict.fromkeys(GROUPS, np.ones(1))), 1)
    loss, stats = ImageLoss(device, SIZE), PlainDensificationStats(device, 7)
    target = loss.target(device.upload(rgba), BACKGROUND)
    for _ in range(3):
        step.gradients(step.draw(view, BACKGROUND), loss, target, stats)
    sums = device.download(stats.sums)
    assert sums[4].tolist() == [0, 0] and (np.delete(sums[:, 1], 4) == 3).all()
    assert (np.delete(sums[:, 0], 4) > 0).all()
