"""Photos that EXIF turns by a quarter, in captures that mean them upright.

Pixels are read as they lie in the file, so the camera is turned instead, and its lens with it.
"""

from dataclasses import replace

import numpy as np
from PIL import Image

from shapeshift.scene.captures.colmap_tables import ColmapCamera

ORIENTATION = 0x0112  # of EXIF
# Orientation: upright from file, x right, y down.  6: a clockwise turn makes it upright, 8: one the
# other way.  The others are mirrored, or have the same sides upright and cannot be told.
TURNS = {6: ((0, -1), (1, 0)), 8: ((0, 1), (-1, 0))}
# Lenses that bend alike all around; OpenCV's two have p1 and p2 besides.
ROUND = {
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV_FISHEYE", "FOV", "EUCM",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE",
    "FISHEYE",
}  # fmt: skip
TANGENTIAL = ("OPENCV", "FULL_OPENCV")


def quarter_of(image: Image.Image, lens: ColmapCamera) -> np.ndarray | None:
    """(3, 3) upright from file, axes x right, y down, z forward; None where EXIF says no such turn,
    or where the lens bends in a way that is not turned here.
    """
    turn = TURNS.get(image.getexif().get(ORIENTATION, 1))
    if turn is None or lens.model not in (*ROUND, *TANGENTIAL):
        return None
    matrix = np.eye(3)
    matrix[:2, :2] = turn
    return matrix


def turned_lens(lens: ColmapCamera, upright_from_file: np.ndarray) -> ColmapCamera:
    """The lens of the upright photo as it is for the pixels in the file."""
    (width, height), (x, y) = lens.size, lens.centre
    (_, across), (down, _) = upright_from_file[:2, :2]  # one of them is 1, the other -1
    centre = (y if down > 0 else height - y, x if across > 0 else width - x)
    rest = list(lens.params[len(lens.focals) + 2 :])
    if lens.model in TANGENTIAL:  # x'' = ... + 2 p1 x y + p2 (r^2 + 2 x^2), and so for y with p1
        p1, p2 = rest[2:4]
        rest[2:4] = (across * p2, down * p1)
    return replace(lens, size=(height, width), params=(*lens.focals[::-1], *centre, *rest))
