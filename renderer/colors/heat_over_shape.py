"""Heat over shape: the fine structure of a photo under the colours of heat.

What inspection cameras do to show at once what a thing is and how hot it is (FLIR's MSX, US patent
8,565,547): edges and small changes of brightness of the photo are added to the thermal picture,
its broad brightness is not, so colours keep telling values.
"""

import numpy as np

from shapeshift.renderer.colors.palette import LUMINANCE

SIGMA = 1 / 240  # of the picture's height: structure finer than about this is fine
TRUNCATE = 3.0  # sigmas to where the blur reaches


def heat_over_shape(heat: np.ndarray, photo: np.ndarray, detail: float = 1.0) -> np.ndarray:
    """(H, W, 3) float32 display sRGB of two pictures (H, W, 3) from one view.

    detail: how much of the photo's fine structure is added, 0 none.  The luminance is that of
    display values; grey is added, so that hues stay.

        both = ss.heat_over_shape(scene.render(x="Thermal"), scene.render(x="RGB"))
    """
    from scipy.ndimage import gaussian_filter1d  # loaded when first wanted: half a second

    luminance = np.asarray(photo, np.float32) @ LUMINANCE.astype(np.float32)
    broad = luminance
    for axis in (0, 1):
        sigma = SIGMA * luminance.shape[0]
        broad = gaussian_filter1d(broad, sigma, axis, mode="nearest", truncate=TRUNCATE)
    fine = (luminance - broad)[..., None]
    return np.clip(np.asarray(heat, np.float32) + np.float32(detail) * fine, 0, 1)


def blur_weights(height: int) -> np.ndarray:
    """(r + 1,) of the pixel itself and those 1 to r pixels away on one side; all sum up to 1."""
    sigma = SIGMA * height
    reach = int(TRUNCATE * sigma + 0.5)
    weights = np.exp(-0.5 * (np.arange(reach + 1) / max(sigma, 1e-6)) ** 2)
    return (weights / (2 * weights.sum() - weights[0])).astype(np.float32)
