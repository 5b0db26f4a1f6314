"""A file's numbers to ours, in place, block by block: metres, 0..1, unit quaternions, our axes."""

import numpy as np

from runtime_models.blocks import each_block
from runtime_models.plain_splats import RawSplats
from runtime_models.rotation import normalize
from runtime_models.turn import turner


def to_own_units(raw: RawSplats, rotation: np.ndarray) -> None:
    """Changes the arrays of `raw`: what they hold afterwards is ours, turned by rotation (3, 3).

    Rows that are not finite stay so.  Arrays that may not be written to are copied first.
    """
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        array = getattr(raw, name)
        if not array.flags.writeable:
            setattr(raw, name, array.copy())
    turn_rows = turner(rotation, raw.sh.shape[1])
    logs, logits = raw.log_scales, raw.logits
    raw.log_scales = raw.logits = False

    def work(rows: slice, _: None) -> None:
        if logs:
            np.exp(raw.scales[rows], out=raw.scales[rows])
        if logits:
            sigmoid(raw.opacity[rows])
        raw.wxyz[rows] = normalize(raw.wxyz[rows])
        turn_rows(raw.means[rows], raw.wxyz[rows], raw.sh[rows])

    with np.errstate(over="ignore", invalid="ignore"):
        each_block(len(raw.means), work)


def sigmoid(logits: np.ndarray) -> None:
    """1 / (1 + exp(-logits)), in place; infinite ones are 0 and 1."""
    np.negative(logits, out=logits)
    np.exp(logits, out=logits)
    logits += 1
    np.divide(1, logits, out=logits)
