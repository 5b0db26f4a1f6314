"""Sets of harmonics that stand for those of all splats: median cut, as palettes of pictures are,
then k-means with what each splat shows as its weight.
"""

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block

SPLATS_A_SET = 4  # about; of half as many the file is a third larger and 2.4 dB nearer
MOST_BITS = 16  # of a label
SAMPLE = 8192  # rows that say which axes those are
TINY = 1e-30  # of a range of numbers
AXES = 8  # principal ones, of 9, 24 or 45 numbers, that cells are cut along
COUSINS = 8  # cells of the same cell three cuts before: a splat may move between their sets
ROUNDS = 2  # of k-means; a third takes 2 % more of the error
LEAST_WEIGHT = 1e-3  # of the mean one: of what shows nothing


def make_palette(rest: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P, M - 1, 3) float32 sets and (N,) uint16 labels of harmonics (N, M - 1, 3), N > 0.

    weight (N,), 0 or more: what an error of each costs.  Cells are halved at the median of the axis
    along which they are longest, all in one sort a round (Heckbert 1982, "Color image
    quantization"); a set is the weighted mean of its cell.  Then splats go to the nearest set of
    COUSINS, and sets to their means (Lloyd 1982, "Least squares quantization in PCM").
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
    labels = np.empty(count, np.uint16)
    labels[order] = np.repeat(np.arange(1 << bits), np.diff(np.r_[starts, count]))
    weight = weight / max(float(weight.mean()), TINY) + LEAST_WEIGHT
    sets = weighted_means(flat, weight, labels, np.zeros((1 << bits, flat.shape[1]), np.float32))
    for _ in range(ROUNDS if bits else 0):
        labels = nearest_cousins(flat, sets, labels)
        sets = weighted_means(flat, weight, labels, sets)
    return sets.reshape(-1, *rest.shape[1:]), labels


def weighted_means(
    flat: np.ndarray, weight: np.ndarray, labels: np.ndarray, before: np.ndarray
) -> np.ndarray:
    """(P, D) float32: of the rows (N, D) of each label; as `before` where none has it."""
    whole = np.bincount(labels, weight, len(before))
    sums = [np.bincount(labels, weight * column, len(before)) for column in flat.T]
    means = np.stack(sums, axis=1) / np.maximum(whole, TINY)[:, None]
    return np.where(whole[:, None] > 0, means, before).astype(np.float32)


def nearest_cousins(flat: np.ndarray, sets: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """(N,) uint16: the set nearest to each row (N, D), of the COUSINS that its label is one of."""
    out, cousins = np.empty_like(labels), min(COUSINS, len(sets))

    def work(rows: slice, _: None) -> None:
        first = labels[rows].astype(np.int64) // cousins * cousins
        away = [((sets[first + k] - flat[rows]) ** 2).sum(axis=1) for k in range(cousins)]
        out[rows] = first + np.argmin(away, axis=0)

    each_block(len(flat), work)
    return out


def along_principal_axes(flat: np.ndarray) -> np.ndarray:
    """(N, AXES or fewer) float32: rows (N, D) along the axes in which they differ most."""
    sample = flat[:: -(-len(flat) // SAMPLE)]
    centred = (sample - sample.mean(axis=0)).astype(np.float64)
    # Not a matrix product: its threads wait for each other longer than one takes for all of it.
    _, axes = np.linalg.eigh(np.einsum("na,nb->ab", centred, centred))
    return flat @ axes[:, ::-1][:, :AXES].astype(np.float32)
