"""Images at another size: the twin of GL's linear filter, for pictures that no GL has drawn."""

import numpy as np

from shapeshift.scene.pose import View


def bilinear(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) float32 -> (height, width, C): between the centres of pixels, edges held."""
    width, height = size
    if image.shape[:2] == (height, width):
        return image
    for axis, wanted in ((0, height), (1, width)):
        have = image.shape[axis]
        at = np.clip((np.arange(wanted) + 0.5) * have / wanted - 0.5, 0, have - 1)
        low = np.minimum(at.astype(int), max(have - 2, 0))
        shape = [1, 1, 1]
        shape[axis] = wanted
        part = (at - low).astype(np.float32).reshape(shape)
        first, second = (
            np.take(image, low, axis),
            np.take(image, np.minimum(low + 1, have - 1), axis),
        )
        image = first + part * (second - first)
    return image


def scaled(view: View, part: float) -> View:
    """The view in `part` times its pixels a side, at least one."""
    width, height = (max(1, round(part * side)) for side in view.size)
    return view if part == 1 else view.resized((width, height))
