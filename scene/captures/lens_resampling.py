"""Undistortion as one sparse matrix a lens, for the many photos of one camera."""

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from shapeshift.scene.captures.colmap_tables import ColmapCamera
from shapeshift.scene.captures.undistort import straight_pixels

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Making the matrix takes as long as a dozen photos take with Pillow's mesh.
LEAST_PHOTOS = 16
LARGEST = 1 << 20  # pixels of the result: 130 MB of matrix at most
SAMPLES = 2  # a pixel and side, as many as Image.reduce takes in photo.smaller
ROWS = 64  # of the result whose samples are placed at a time


@lru_cache(maxsize=1)
def resampling_matrix(
    lens: ColmapCamera,
    size: tuple[int, int],
    factor: int,
    pitch: int,
    source: tuple[int, int],
) -> "csr_array":
    """(width * height, source pixels) float32: each pixel the mean of bilinear samples of a photo.

    size: of the result, each pixel of which covers `factor` x `factor` of the straight camera's.
    source: columns and rows of the photo, each pixel of which is `pitch` of the file's.
    Samples beyond the photo count as 0, as Pillow fills what it does not know.
    """
    from scipy.sparse import vstack

    return vstack(list(matrix_rows(lens, size, factor, pitch, source)), format="csr")


def matrix_rows(
    lens: ColmapCamera, size: tuple[int, int], factor: int, pitch: int, source: tuple[int, int]
) -> "Iterator[csr_array]":
    """The rows of `resampling_matrix`, those of some rows of the result at a time."""
    from scipy.sparse import csr_array

    (width, height), (columns, rows) = size, source
    x = (np.arange(width * SAMPLES) + 0.5) * (factor / SAMPLES)
    y = (np.arange(height * SAMPLES) + 0.5) * (factor / SAMPLES)
    for start in range(0, height, ROWS):
        end = min(start + ROWS, height)
        at = straight_pixels(lens, x, y[start * SAMPLES : end * SAMPLES]) / pitch
        u, v = at.reshape(-1, 2).T
        inside = (u >= 0) & (v >= 0) & (u < columns) & (v < rows)
        # Which pixel of the result a sample belongs to.
        row, column = np.divmod(np.arange(u.size), width * SAMPLES)
        pixel = (row // SAMPLES * width + column // SAMPLES)[inside]
        u, v = u[inside] - 0.5, v[inside] - 0.5
        left, top = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
        right_share, bottom_share = u - left, v - top
        taps = []
        for down, across in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = (bottom_share if down else 1 - bottom_share) * (
                right_share if across else 1 - right_share
            )
            of = np.clip(top + down, 0, rows - 1) * columns + np.clip(left + across, 0, columns - 1)
            taps.append((share / SAMPLES**2, of))
        shares, places = (np.concatenate(tap) for tap in zip(*taps, strict=True))
        shape = ((end - start) * width, columns * rows)
        entries = (shares.astype(np.float32), (np.tile(pixel, 4), places))
        yield csr_array(entries, shape=shape)


def resampled(
    image: Image.Image,
    lens: ColmapCamera,
    size: tuple[int, int],
    factor: int,
    pitch: int,
    one_of_many: bool = True,
) -> Image.Image:
    """The photo as its straight camera sees it, see `resampling_matrix`; a mode of bytes.

    one_of_many: the matrix is kept for the next photo.
    """  # fmt: skip
    about = (lens, size, factor, pitch, image.size)
    pixels = np.asarray(image, np.float32).reshape(image.width * image.height, -1)
    rows = [resampling_matrix(*about)] if one_of_many else matrix_rows(*about)
    straight = np.concatenate([np.rint(part @ pixels).astype(np.uint8) for part in rows])
    straight = straight.reshape(size[1], size[0], -1)
    return Image.fromarray(straight[..., 0] if straight.shape[2] == 1 else straight)
