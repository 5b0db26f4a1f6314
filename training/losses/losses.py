"""What an image should be: L1 and SSIM against a photo with their gradient (paper 3.3)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.training.heads.networks import KERNELS, padded

REACH = 5  # of the SSIM window, pixels each side
SSIM_SHARE = 0.2  # of the image loss; eq. 8 read literally says 0.8, which is worse


@dataclass(frozen=True)
class Target:
    """A photo on the device with the windowed maps that stay the same from step to step."""

    size: tuple[int, int]  # width, height
    planes: Any  # (3, H, stride) display sRGB 0..1
    mean: Any  # (3, H, stride) windowed photo
    square: Any  # (3, H, stride) windowed photo^2
    weight: Any | None  # (H, W) 0..1, what counts; None = everything
    values: float  # how many values count: 3 * the sum of the weights

    @property
    def bytes(self) -> int:
        return self.planes.nbytes * 3 + (0 if self.weight is None else self.weight.nbytes)


class ImageLoss:
    """(1 - share) L1 + share (1 - SSIM) for images of one size; buffers are reused.

    form: "cpu" or "gpu", by default the device's kind; they agree to float rounding.
    """

    def __init__(self, device, size: tuple[int, int], form: str | None = None) -> None:
        self.device, self.size, self.form = device, size, form or device.kind
        width, height = size
        self.stride = padded(width)
        row = -(-(self.stride + 2 * REACH + 8) // 256) * 256  # few sizes, few compilations
        file, defines = {
            "cpu": ("losses.cl", {"ROW": row}), "gpu": ("losses_gpu.cl", {}),
        }[self.form]  # fmt: skip
        self.kernels = device.program(KERNELS / file, **defines)
        self.blurred = device.empty((3, 3, height, self.stride))
        self.derivative = device.empty((3, 3, height, self.stride))
        self.grad_image = device.empty((3, height, width))
        self.ssim_rows, self.l1_rows = device.empty(3 * height), device.empty(3 * height)
        self.sums = self.ssim_rows, self.l1_rows  # what the kernels fill
        if self.form == "gpu":  # a value a pixel, summed up when it is asked for
            self.sums = tuple(device.empty((3, height, self.stride)) for _ in range(2))
        self.nothing = device.zeros(1)

    def launch(self, name: str, *arguments) -> None:
        """A kernel over the whole image: an item a row, or one a pixel."""
        (width, height), stride = self.size, self.stride
        items, group = (3 * height, 1) if self.form == "cpu" else (3 * height * stride, 64)
        self.device.launch(self.kernels[name], items, group, width, height, stride, *arguments)

    def target(self, rgba, background, weight=None, gain=(1.0, 1.0, 1.0)) -> Target:
        """A Target of photo bytes (H, W, 4) on the device, over their gain, over a background."""
        times = [np.float32(1 / channel) for channel in gain]
        (width, height), stride, device = self.size, self.stride, self.device
        planes, mean, square = (device.empty((3, height, stride)) for _ in range(3))
        self.launch("compose_target", *map(np.float32, background), *times, rgba, planes)
        self.launch("target_rows", planes, self.blurred)
        self.launch("target_columns", self.blurred, mean, square)
        values = 3.0 * width * height
        if weight is not None:
            values = 3.0 * float(weight.sum(dtype=np.float64))
            weight = device.upload(np.ascontiguousarray(weight, np.float32))
        return Target(self.size, planes, mean, square, weight, values)

    def compare(self, image, target: Target, ssim_share: float = SSIM_SHARE):
        """Gradient (3, H, W) of the loss by the drawn image (3, H, W); then `value` tells it."""
        masked = int(target.weight is not None)
        weight = target.weight if masked else self.nothing
        self.ssim_share, self.values = ssim_share, target.values
        self.launch("image_rows", masked, image, target.planes, weight, self.blurred)
        self.launch(
            "ssim_columns", self.blurred, target.mean, target.square, self.derivative, self.sums[0]
        )
        self.launch("derivative_rows", self.derivative, self.blurred)
        self.launch(
            "gradient_columns", masked, np.float32(ssim_share), np.float32(1 / target.values),
            self.blurred, image, target.planes, weight, self.grad_image, self.sums[1],
        )  # fmt: skip
        return self.grad_image

    def parts(self) -> tuple[float, float]:
        """(L1, SSIM) of the last `compare`, over what counts."""
        width, height = self.size
        if self.form == "gpu":
            self.device.launch(
                self.kernels["sum_rows"], 3 * height, 64, width, 3 * height, self.stride,
                *self.sums, self.ssim_rows, self.l1_rows,
            )  # fmt: skip
        everything = 3.0 * width * height
        ssim = self.device.download(self.ssim_rows).sum(dtype=np.float64)
        l1 = self.device.download(self.l1_rows).sum(dtype=np.float64)
        return float(l1 / self.values), float(1 - (everything - ssim) / self.values)

    def value(self) -> float:
        """The loss of the last `compare`."""
        l1, ssim = self.parts()
        return (1 - self.ssim_share) * l1 + self.ssim_share * (1 - ssim)
