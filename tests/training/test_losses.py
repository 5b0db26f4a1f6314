"""L1 and SSIM on the device against plain numpy in float64, at every awkward width."""

import numpy as np
import pytest

from shapeshift.training.evaluation.metrics import psnr, ssim, weighted_mean
from shapeshift.training.losses.losses import ImageLoss
from tests.support.training.reference import image_loss_reference


def photo_and_image(width, height, seed=0):
    """(rgba (H, W, 4) uint8, image (H, W, 3) float32), neither equal nor far from each other."""
    rng = np.random.default_rng(seed)
    rgba = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
    rgba[..., 3] = 255
    image = rgba[..., :3] / 255 + rng.normal(size=(height, width, 3)) * 0.2
    return rgba, image.astype(np.float32)


def planar(image):
    return np.ascontiguousarray(image.transpose(2, 0, 1), np.float32)


FORMS = ("cpu", "gpu")
SIZES = [(7, 5), (8, 8), (9, 12), (1, 1), (16, 3), (199, 21), (200, 21), (201, 21), (300, 11)]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_value_and_gradient(device, size, share, form):
    rgba, image = photo_and_image(*size)
    photo = rgba[..., :3].astype(np.float64) / 255
    loss = ImageLoss(device, size, form)
    target = loss.target(device.upload(rgba), (0, 0, 0))
    grad = device.download(loss.compare(device.upload(planar(image)), target, share))
    grad = grad.transpose(1, 2, 0)
    plain = image.astype(np.float64)
    assert loss.value() == pytest.approx(image_loss_reference(plain, photo, share), abs=2e-6)
    check_gradient(grad, plain, photo, share)


def check_gradient(grad, plain, photo, share, weight=None):
    """Central differences at random pixels and at the borders.

    1e-5 of the largest: variances are differences of float32 means, so what SSIM divides by is
    known to about 1e-7 / C2.
    """
    rng = np.random.default_rng(3)
    height, width = photo.shape[:2]
    rows = [0, height - 1, *rng.integers(0, height, 6)]
    columns = [width - 1, 0, *rng.integers(0, width, 6)]
    step, largest = 1e-6, np.abs(grad).max()
    for y, x in zip(rows, columns, strict=True):
        for channel in range(3):
            up, down = plain.copy(), plain.copy()
            up[y, x, channel] += step
            down[y, x, channel] -= step
            numeric = image_loss_reference(up, photo, share, weight) - image_loss_reference(
                down, photo, share, weight
            )
            assert abs(grad[y, x, channel] - numeric / (2 * step)) < 1e-5 * largest


@pytest.mark.parametrize("form", FORMS)
def test_nothing_is_written_beyond_the_image(device, form):
    size = (201, 13)
    rgba, image = photo_and_image(*size)
    loss = ImageLoss(device, size, form)
    loss.grad_image = device.upload(np.full((4, 13, 201), 7, np.float32))  # one plane too many
    target = loss.target(device.upload(rgba), (0, 0, 0))
    loss.compare(device.upload(planar(image)), target, 0.2)
    assert (device.download(loss.grad_image)[3] == 7).all()
    assert not device.download(target.planes)[..., 201:].any()


@pytest.mark.parametrize("form", FORMS)
def test_flat_white_photos_have_a_tame_gradient(device, form):
    """Variances of white are differences of nearly equal numbers: C2 has to hold the quotient."""
    size = (64, 64)
    rgba = np.full((64, 64, 4), 255, np.uint8)
    image = np.ones((64, 64, 3), np.float32)
    loss = ImageLoss(device, size, form)
    target = loss.target(device.upload(rgba), (0, 0, 0))
    grad = device.download(loss.compare(device.upload(planar(image)), target, 1.0))
    assert loss.value() == pytest.approx(0, abs=1e-3)
    assert np.abs(grad).max() * grad.size < 0.1  # an L1 gradient has 1 here


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_weights_leave_pixels_out(device, share, form):
    size = (33, 30)
    rgba, image = photo_and_image(*size)
    photo = rgba[..., :3].astype(np.float64) / 255
    weight = np.zeros((30, 33), np.float32)
    weight[5:25, 3:20] = 1
    weight[10, 10:15] = 0.25
    loss = ImageLoss(device, size, form)
    target = loss.target(device.upload(rgba), (0, 0, 0), weight)
    on_device = device.upload(planar(image))
    grad = device.download(loss.compare(on_device, target, share)).transpose(1, 2, 0)
    plain = image.astype(np.float64)
    assert loss.value() == pytest.approx(
        image_loss_reference(plain, photo, share, weight), abs=3e-6
    )
    assert not grad[weight == 0].any()
    check_gradient(grad, plain, photo, share, weight)
    image[weight == 0] = 1e6  # what is left out has no say, not even through a window
    before = loss.value()
    loss.compare(device.upload(planar(image)), target, share)
    assert loss.value() == pytest.approx(before, rel=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_photos_are_laid_over_the_background(device, form):
    rgba, _ = photo_and_image(11, 6)
    rgba[..., 3] = np.random.default_rng(1).integers(0, 256, (6, 11))
    loss = ImageLoss(device, (11, 6), form)
    target = loss.target(device.upload(rgba), (0.1, 0.5, 1.0))
    alpha = rgba[..., 3:] / 255
    wanted = alpha * rgba[..., :3] / 255 + (1 - alpha) * (0.1, 0.5, 1.0)
    found = device.download(target.planes)[..., :11].transpose(1, 2, 0)
    np.testing.assert_allclose(found, wanted, atol=1e-7)


def test_metrics_know_equal_and_different_pictures():
    rgba, image = photo_and_image(40, 30)
    photo = rgba[..., :3] / 255
    assert ssim(photo, photo) == pytest.approx(1, abs=1e-12)
    assert psnr(photo, photo) == 100
    assert psnr(np.clip(photo + 0.1, 0, 1) * 0 + 0.5, photo * 0 + 0.6) == pytest.approx(20)
    weight = np.zeros((30, 40))
    weight[:15] = 1
    half = image.copy()
    half[:15] = photo[:15]
    assert psnr(half, photo, weight) == 100
    assert weighted_mean(np.ones((30, 40, 3)), weight) == pytest.approx(1)
