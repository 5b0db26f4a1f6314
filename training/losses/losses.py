"""What an image should be: L1 and SSIM against a photo with their gradient (paper 3.3); and how
large splats should be, and when they come back.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shapeshift.scene.pose import View
from shapeshift.training.heads.gaussians import Gaussians
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


# A loss that keeps splats from being smaller than any training photo could tell.  Drawn at the size
# of the photos, a splat thinner than a pixel looks as the screen's filter makes it; closer by, it
# is as thin as it was left.  The bound is that of Mip-Splatting's 3D smoothing filter
# (Yu et al., CVPR 2024, section 4.1: the highest sampling rate of any photo in which a place is),
# held by a slope, since a package has nothing that could widen what the networks say.

SLOPE = 1e-6  # of the loss, by the logarithm of one scale below the bound; docs/bench/zooms.csv


class MinScale:
    """The bound of every anchor's splats, metres, and the gradient by scales below it."""

    def __init__(self, device, views: list[View], splats: int, least_px: float) -> None:
        """views: of the training photos, as large as they are trained; splats: an anchor's.

        least_px: one sigma in pixels of the photo that sees a place finest; 0: there is no bound.
        """
        self.device, self.splats, self.least_px = device, splats, np.float32(least_px)
        self.kernels = device.program(KERNELS / "min_scale.cl", SPLATS=splats)
        self.near = min(view.near for view in views)
        self.cameras, self.count = device.upload(camera_rows(views)), len(views)
        self.pixels = device.zeros(1)  # (A,) metres that a pixel spans; 0 where no photo looks
        self.everything = device.zeros(1, np.int32)

    def look(self, anchors) -> None:
        """Take the bound of these anchors (A, 3), on the device."""
        count = len(anchors)
        self.pixels = self.device.empty(count)
        self.everything = self.device.upload(np.arange(count, dtype=np.int32))
        self.device.launch(
            self.kernels["pixel_sizes"], count, 16, count, self.count, np.float32(self.near),
            self.cameras, anchors, self.pixels,
        )  # fmt: skip

    def add_gradient(self, splats: Gaussians, grad: Gaussians, rows) -> None:
        """To `grad` in place, of a step that ran the anchors `rows` (R,); None: all."""
        if not self.least_px > 0:
            return
        count = len(splats.opacity)
        self.device.launch(
            self.kernels["min_scale"], count, 64, count, self.least_px, np.float32(SLOPE),
            self.everything if rows is None else rows, self.pixels, splats.scales, grad.scales,
        )  # fmt: skip

    def state(self) -> dict[str, np.ndarray]:
        """What a pixel spans: anchors move on, and a run goes on to the same bits."""
        if not self.least_px > 0:
            return {}
        return {"min_scale.pixels": self.device.download(self.pixels).copy()}

    def load(self, state: dict[str, np.ndarray], anchors) -> None:
        """Of `state`; without it as for new anchors."""
        self.look(anchors)
        if (kept := state.get("min_scale.pixels")) is not None and len(kept) == len(anchors):
            self.pixels = self.device.upload(kept)


def camera_rows(views: list[View]) -> np.ndarray:
    """(V, 18) float32 as min_scale.cl reads them."""
    rows = []
    for view in views:
        camera_from_world, *lens = view.pinhole()
        rows.append([*camera_from_world[:3].ravel(), *lens, *view.size])
    return np.array(rows, np.float32)


# A loss that keeps absent splats from staying absent: what is absent gets no gradient of a photo.
#
# The heads are shared by all anchors. Where stops have shapes of their own, the network that
# sends one stop's splats away takes others along that the stop would need; in the first steps of
# a run over mostly background it may send all of them away.

MIN_OPACITY = 0.02  # below it the loss is above 0; the same number stands in min_opacity.cl
MIN_OPACITY_SHARE = (
    0.05  # of mean max(MIN_OPACITY - opacity, 0); bone of the leg gains 1 dB, docs/growth.md
)

UNTIL = 0.3  # of a run of several stops


def min_opacity_share(stops: int, blended_shapes: float, done: float) -> float:
    """The weight of the loss once so much of a run is `done`, 0..1.

    It ends once stops have told their splats apart: what is absent at one would stay faint in its
    pictures, and cost its steps as much as what shows.  Where some steps draw shapes between stops,
    it goes on: what is absent on one side grows from faint splats.
    """
    return 0.0 if stops > 1 and not blended_shapes and done > UNTIL else MIN_OPACITY_SHARE


def add_min_opacity_gradient(device, splats: Gaussians, grad: Gaussians, share: float) -> None:
    """Add the gradient of share * mean max(MIN_OPACITY - opacity, 0) to `grad` in place."""
    kernel, count = device.program(KERNELS / "min_opacity.cl")["min_opacity"], len(splats.opacity)
    device.launch(
        kernel, count, 64, count, np.float32(share / count), splats.opacity, grad.opacity
    )  # fmt: skip
