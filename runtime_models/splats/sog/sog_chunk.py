"""A SOG kept as the bytes of its pictures, 17 a splat: any of its rows become splats when asked."""

from copy import copy
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.files.memory import Account, unlimited
from shapeshift.runtime_models.leaf_levels import Throttle, unpaced
from shapeshift.runtime_models.splats.plain_splats import RawSplats
from shapeshift.runtime_models.splats.sog.read_sog import (
    PICTURES,
    Sog,
    open_sog,
    raw_splats,
    read_palette,
)

CHANNELS = {"means": 3, "scales": 3, "quats": 4, "sh0": 4, "shN": 2}  # of the pixels


class SogChunk:
    """Decoded pictures of one SOG; `size` bytes of them are charged until `release`."""

    def __init__(self, path: Path, memory: Account, pace: Throttle = unpaced) -> None:
        """pace is called after each picture, with its splats.  Raises BadFile."""
        sog = open_sog(path, memory)
        self._sog, self._memory = sog, memory
        self.count = sog.count
        self._palette = read_palette(sog) if sog.names("shN") else None
        self._pixels: dict[tuple[str, int], np.ndarray] = {}
        for part in PICTURES:
            for number in range(len(sog.names(part))):
                if part == "shN" and number == 0:  # the palette
                    continue
                pixels = sog.pixels(part, number)
                columns = [pixels[:, channel] for channel in range(CHANNELS[part])]
                self._pixels[part, number] = np.stack(columns, axis=1)  # a slice: 4 times slower
                del pixels, columns
                memory.release(sog.files.held)
                sog.files.held = 0
                pace(sog.count)
        kept = [*self._pixels.values()] + ([] if self._palette is None else [self._palette])
        self.size = sum(array.nbytes for array in kept)  # bytes
        memory.charge(self.size, f"{sog.count:,} splats")

    def release(self) -> None:
        """Gives back what is charged."""
        self._memory.release(self.size)

    def rows(self, rows: np.ndarray) -> RawSplats:
        """The splats of these rows (n,), in their order, as read_raw_sog gives them."""
        pixels = {key: kept[rows] for key, kept in self._pixels.items()}
        return raw_splats(SogRows(self._sog, len(rows), pixels, self._palette))


class SogRows(Sog):
    """Some rows of a SOG as one of their own."""

    def __init__(
        self, sog: Sog, count: int, pixels: dict[tuple[str, int], np.ndarray],
        palette: np.ndarray | None,
    ) -> None:  # fmt: skip
        files = copy(sog.files)
        files.memory, files.held = unlimited(), 0  # few rows, and for a moment
        super().__init__(files, sog.meta, sog.version, count, known=sog.known, named=sog.named)
        self._kept, self._palette = pixels, palette

    def pixels(self, part: str, number: int = 0) -> np.ndarray:
        return self._kept[part, number]

    def palette(self) -> np.ndarray:
        return super().palette() if self._palette is None else self._palette
