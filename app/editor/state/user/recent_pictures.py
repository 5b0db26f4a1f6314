"""Small pictures of files that were opened before, kept beside the list of them."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from shapeshift.app.drawing import save_png

FOLDER = "recent"
SIZE = (96, 54)  # pixels: what such a picture is held to
LARGEST = 1 << 17  # bytes of a file; a picture so small has never more


class RecentPictures:
    """One PNG a path in a folder of the settings; a broken or missing one is no picture."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._read: dict[Path, np.ndarray | None] = {}

    def of(self, path: Path) -> np.ndarray | None:
        """(54, 96, 3) uint8; None: there is none.  Read once."""
        if path not in self._read:
            self._read[path] = read_picture(self._file(path))
        return self._read[path]

    def keep(self, path: Path, picture: np.ndarray, listed: Iterable[Path]) -> None:
        """Of (H, W, 3) display sRGB 0..1; those of files that are not listed any more go.

        OSError where the folder cannot be written.
        """
        small = shrunk(picture)
        self._folder.mkdir(parents=True, exist_ok=True)
        save_png(small / 255, self._file(path))
        self._read[path] = small
        kept = {self._file(each) for each in (path, *listed)}
        for old in self._folder.glob("*.png"):
            if old not in kept:
                old.unlink(missing_ok=True)

    def _file(self, path: Path) -> Path:
        name = hashlib.sha256(str(path.absolute()).encode("utf-8", "surrogateescape")).hexdigest()
        return self._folder / f"{name[:32]}.png"


def shrunk(picture: np.ndarray) -> np.ndarray:
    """(54, 96, 3) uint8: the middle of a picture (H, W, 3) in 0..1, cut to that shape."""
    high, wide = picture.shape[:2]
    across, down = SIZE
    part = min(wide / across, high / down)
    width, height = part * across, part * down
    left, top = (wide - width) / 2, (high - height) / 2
    shown = (np.clip(np.nan_to_num(picture), 0, 1) * 255 + 0.5).astype(np.uint8)
    box = (left, top, left + width, top + height)
    return np.asarray(Image.fromarray(shown).resize(SIZE, Image.Resampling.BOX, box))


def read_picture(file: Path) -> np.ndarray | None:
    """(54, 96, 3) uint8; None for what is none, or another size."""
    try:
        if file.stat().st_size > LARGEST:
            return None
        with Image.open(file, formats=("PNG",)) as image:
            return np.asarray(image.convert("RGB")) if image.size == SIZE else None
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError):
        return None
