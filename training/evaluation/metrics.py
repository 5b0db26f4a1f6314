"""PSNR and SSIM of a picture against a photo of which not every pixel need count."""

import numpy as np

from shapeshift.scene.metrics import ssim_map


def weighted_mean(values: np.ndarray, weight: np.ndarray | None) -> float:
    """Mean over (H, W, 3) values of the pixels that count."""
    if weight is None:
        return float(values.mean(dtype=np.float64))
    values = np.where(weight[..., None] > 0, values, 0)  # of nothing known, NaN even
    return float((values * weight[..., None]).sum(dtype=np.float64) / (3 * weight.sum()))


def ssim(image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None = None) -> float:
    """Mean structural similarity where it counts, of what counts alone: what a photo does not know
    is in no window.
    """
    known = None if weight is None else weight > 0
    return weighted_mean(ssim_map(np.clip(image, 0, 1), photo, known), weight)


def psnr(image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None = None) -> float:
    """dB of (H, W, 3) images in 0..1, the picture clipped first; 100 where they are equal."""
    error = weighted_mean((np.clip(image, 0, 1) - photo) ** 2, weight)
    return float(-10 * np.log10(max(error, 1e-10)))
