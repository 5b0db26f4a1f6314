"""PSNR and SSIM of a picture against a photo, in numpy: what is reported, and the losses' twin."""

import numpy as np


def window() -> np.ndarray:
    """(11,) the Gaussian of sigma 1.5 that SSIM is usually measured with, sum 1."""
    taps = np.exp(-((np.arange(11) - 5.0) ** 2) / (2 * 1.5**2))
    return taps / taps.sum()


def windowed(image: np.ndarray) -> np.ndarray:
    """(H, W, C) means under the window, zeros beyond the border."""
    taps = window()
    rows = np.pad(image, ((5, 5), (0, 0), (0, 0)))
    image = sum(t * rows[i : i + len(image)] for i, t in enumerate(taps))
    columns = np.pad(image, ((0, 0), (5, 5), (0, 0)))
    return sum(t * columns[:, i : i + image.shape[1]] for i, t in enumerate(taps))


def ssim_map(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(H, W, 3) float64 structural similarity (Wang et al., 2004) of images in 0..1."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    mean_a, mean_b = windowed(a), windowed(b)
    var_a, var_b = windowed(a * a) - mean_a**2, windowed(b * b) - mean_b**2
    covariance = windowed(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
        (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    )


def weighted_mean(values: np.ndarray, weight: np.ndarray | None) -> float:
    """Mean over (H, W, 3) values of the pixels that count."""
    if weight is None:
        return float(values.mean(dtype=np.float64))
    return float((values * weight[..., None]).sum(dtype=np.float64) / (3 * weight.sum()))


def ssim(image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None = None) -> float:
    return weighted_mean(ssim_map(np.clip(image, 0, 1), photo), weight)


def psnr(image: np.ndarray, photo: np.ndarray, weight: np.ndarray | None = None) -> float:
    """dB of (H, W, 3) images in 0..1, the picture clipped first; 100 where they are equal."""
    error = weighted_mean((np.clip(image, 0, 1) - photo) ** 2, weight)
    return float(-10 * np.log10(max(error, 1e-10)))
