"""The .splat format, 32 bytes a row: position, scale, colour and alpha, rotation; no header."""

from pathlib import Path

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.memory import Account
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.splats.plain_splats import RawSplats, Reading

KEPT, CODED = 60, 48  # bytes a splat: of the arrays, of their colours and turns on the way
ROW = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("wxyz", "u1", 4)])


def read_raw_splat(path: Path, reading: Reading) -> RawSplats:
    """Splats of SH degree 0.  Raises BadFile."""
    size, memory = path.stat().st_size, reading.within(path).account
    if size == 0 or size % ROW.itemsize:
        raise BadFile(f"{path.name} has {size} bytes, expected a multiple of 32: it is cut off.")
    count = size // ROW.itemsize
    memory.charge(count * KEPT, f"{count:,} splats")
    with memory.lend(count * CODED, f"{count:,} splats"):
        return read_rows(path, memory)


def read_rows(path: Path, memory: Account) -> RawSplats:
    table = np.fromfile(path, ROW)
    rgba = table["rgba"].astype(np.float32) / 255
    return RawSplats(
        means=table["mean"],
        scales=table["scale"],
        wxyz=(table["wxyz"].astype(np.float32) - 128) / 128,
        opacity=rgba[:, 3],
        sh=((rgba[:, None, :3] - 0.5) / C0).astype(np.float32),
        file=path.name,
        format="splat",
        log_scales=False,
        logits=False,
        memory=memory,
    )
