"""Sets of harmonics that stand for those of all splats: median cut, as palettes of pictures are."""

import numpy as np

SPLATS_A_SET = 4  # about; of half as many the file is a third larger and 2.4 dB nearer
MOST_BITS = 16  # of a label
SAMPLE = 8192  # rows that say which axes those are
TINY = 1e-30  # of a range of numbers
AXES = 8  # principal ones, of 9, 24 or 45 numbers, that cells are cut along


def make_palette(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, M - 1, 3) float32 sets and (N,) uint16 labels of harmonics (N, M - 1, 3), N > 0.

    Cells are halved at the median of the axis along which they are longest, all in one sort a
    round (Heckbert 1982, "Color image quantization"); a set is the mean of its cell.
    """
    count, flat = len(rest), rest.reshape(len(rest), -1)
    bits = min(max(int(np.log2(count / SPLATS_A_SET)), 0), MOST_BITS) if count > 1 else 0
    places = along_principal_axes(flat)
    order = rows = np.arange(count)
    for level in range(bits):
        cells = 1 << level
        starts = np.arange(cells) * count >> level
        sizes = np.diff(np.r_[starts, count])
        mean = np.add.reduceat(places, starts) / sizes[:, None]
        spread = np.add.reduceat(places**2, starts) / sizes[:, None] - mean**2
        cell = np.repeat(np.arange(cells), sizes)
        along = places[rows, spread.argmax(axis=1)[cell]].astype(np.float64)
        share = (along - along.min()) / max(float(np.ptp(along)), TINY)  # 0 to 1
        by = np.argsort(cell + 0.999 * share, kind="stable")
        order, places = order[by], places[by]
    starts = np.arange(1 << bits) * count >> bits
    sizes = np.diff(np.r_[starts, count])
    labels = np.empty(count, np.uint16)
    labels[order] = np.repeat(np.arange(1 << bits), sizes)
    sets = np.add.reduceat(flat[order], starts) / sizes[:, None].astype(np.float32)
    return sets.reshape(-1, *rest.shape[1:]), labels


def along_principal_axes(flat: np.ndarray) -> np.ndarray:
    """(N, AXES or fewer) float32: rows (N, D) along the axes in which they differ most."""
    sample = flat[:: -(-len(flat) // SAMPLE)]
    centred = (sample - sample.mean(axis=0)).astype(np.float64)
    # Not a matrix product: its threads wait for each other longer than one takes for all of it.
    _, axes = np.linalg.eigh(np.einsum("na,nb->ab", centred, centred))
    return flat @ axes[:, ::-1][:, :AXES].astype(np.float32)
