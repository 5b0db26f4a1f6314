"""A picture as a numpy array that shows itself in a notebook."""

from io import BytesIO
from os import PathLike
from pathlib import Path

import numpy as np

from shapeshift.app.errors import UsageError

KINDS = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".webp": "WebP"}  # in addition to .npy
JPEG_QUALITY = 92
NOTHING = 0.25  # grey of pixels that hold no number, in what a notebook shows of depth


class Picture(np.ndarray):
    """(H, W, 3) float32 display sRGB, 0..1 and above, row 0 on top; depth is (H, W) metres.

    A numpy array in every respect: slices, sums, `np.from_dlpack` and `torch.from_dlpack` take it
    as it is, without a copy.  A notebook that shows it shows the picture.

        picture = ss.load("workshop.shift").render()
        picture.save("workshop.png")
    """

    # np.concatenate of pictures is a picture.
    __array_priority__ = 1.0  # pyright: ignore[reportAssignmentType]  # a property in numpy

    def to_uint8(self) -> np.ndarray:
        """The same shape in bytes, 0..255, rounded; values beyond 0..1 are cut, NaN is 0.

        picture.to_uint8()[0, 0]  # red, green, blue of the upper left pixel
        """
        shown = np.clip(np.nan_to_num(np.asarray(self)), 0, 1)
        return (shown * 255 + 0.5).astype(np.uint8)

    def save(self, path: str | PathLike) -> Path:
        """Writes a .png, .jpg or .webp of 8 bits, or a .npy of all bits, and gives its path back.

        Its folder is made, and a file of that name replaced, whole or not at all.  Raises
        UsageError for another ending or an array that is no picture, OSError where it cannot be
        written.

            path = picture.save("workshop.png")
        """
        from shapeshift.runtime_models.files.whole_file import whole_file

        path = Path(path)
        kind = path.suffix.lower()
        if kind != ".npy" and kind not in KINDS:
            endings = ", ".join([*KINDS, ".npy"])
            raise UsageError(f"{path} has no ending of a picture; known are {endings}.")
        if kind != ".npy" and not self._is_picture():
            raise UsageError(
                f"an array of shape {self.shape} is no picture; (H, W, 3) or (H, W) is wanted, "
                "or the ending .npy."
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as file:
            if kind == ".npy":
                np.save(file, np.asarray(self))
            else:
                file.write(encoded(self, KINDS[kind]))
        return path

    def _is_picture(self) -> bool:
        three = self.ndim == 3 and self.shape[2] in (3, 4)
        return (three or self.ndim == 2) and self.size > 0 and self.dtype.kind in "fiub"

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows; None, the numbers, for what is no picture."""
        return encoded(self, "PNG") if self._is_picture() else None


def encoded(picture: Picture, kind: str) -> bytes:
    """The bytes of an image file; (H, W) is shown from its least number, black, to its largest."""
    from PIL import Image

    if picture.ndim == 2:
        picture = shown_numbers(np.asarray(picture)).view(Picture)
    elif picture.dtype.kind != "f":
        picture = (np.asarray(picture, np.float32) / 255).view(Picture)
    pixels = picture.to_uint8()
    if kind == "JPEG":
        pixels = pixels[..., :3]
    held = BytesIO()
    Image.fromarray(pixels).save(held, format=kind, quality=JPEG_QUALITY)
    return held.getvalue()


def shown_numbers(values: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32 grey of numbers (H, W): the least is black, the largest white."""
    known = np.isfinite(values)
    out = np.full(values.shape, NOTHING, np.float32)
    if known.any():
        least, largest = float(values[known].min()), float(values[known].max())
        out[known] = (values[known] - least) / ((largest - least) or 1.0)
    return np.repeat(out[..., None], 3, axis=2)
