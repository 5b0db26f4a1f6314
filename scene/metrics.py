"""How alike two pictures are: PSNR, and SSIM with the window of the 3DGS papers, in numpy."""

import numpy as np

SIDE, SIGMA = 11, 1.5  # pixels: the Gaussian window of Wang et al., 2004
K1, K2 = 0.01, 0.03  # of the same paper; C = (K * peak)^2 with peak 1


def psnr(a: np.ndarray, b: np.ndarray, peak: float = 1.0) -> float:
    """dB between pictures of one shape whose largest value is `peak`; inf where they are equal.

    Nothing is clipped or rounded.  NaN in a picture makes NaN, never a good number.
    """
    check_alike(a, b)
    error = float(np.mean((np.asarray(a, np.float64) - b) ** 2))
    return float("inf") if error == 0 else float(10 * np.log10(peak**2 / error))


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Mean structural similarity of two (H, W, C) pictures in 0..1; 1 where they are equal."""
    return float(ssim_map(a, b).mean())


def ssim_map(a: np.ndarray, b: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
    """(H, W, C) float64 structural similarity around each pixel, each channel by itself.

    Equation 13 of Wang et al., 2004.  Beyond the border lie zeros, as in the loss of 3DGS.
    known: (H, W) bool, of which pixels alone windows take their means; None: of all.
    """
    check_alike(a, b)
    a, b = a.astype(np.float64), b.astype(np.float64)
    whole: float | np.ndarray = 1.0  # over the share of its window that a pixel knows
    if known is not None:
        counts = known[..., None].astype(np.float64)
        a, b = (np.where(known[..., None], of, 0) for of in (a, b))
        whole = windowed(np.ones_like(counts)) / np.maximum(windowed(counts), 1e-12)
    mean_a, mean_b = windowed(a) * whole, windowed(b) * whole
    var_a, var_b = windowed(a * a) * whole - mean_a**2, windowed(b * b) * whole - mean_b**2
    covariance = windowed(a * b) * whole - mean_a * mean_b
    c1, c2 = K1**2, K2**2
    return ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
        (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
    )


def check_alike(a: np.ndarray, b: np.ndarray) -> None:
    """Pictures that numpy would broadcast are refused: their difference means nothing."""
    if a.shape != b.shape:
        raise ValueError(f"pictures of shape {a.shape} and {b.shape}; resize one to the other.")


def windowed(image: np.ndarray) -> np.ndarray:
    """(H, W, C) means under the window; it is separable, so rows first, then columns."""
    taps, half = window(), SIDE // 2
    height, width = image.shape[:2]
    padded = np.pad(image, ((half, half), (half, half), (0, 0)))
    rows = np.asarray(  # (H, W + 10, C)
        sum(t * padded[i : i + height] for i, t in enumerate(taps))
    )
    return np.asarray(sum(t * rows[:, i : i + width] for i, t in enumerate(taps)))


def window() -> np.ndarray:
    """(SIDE,) Gaussian, sum 1."""
    taps = np.exp(-((np.arange(SIDE) - SIDE // 2) ** 2) / (2 * SIGMA**2))
    return taps / taps.sum()
