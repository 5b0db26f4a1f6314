"""Which splats become one: pairs of neighbours, the cheapest first, over and over.

Gaussian mixture reduction.  The cost of a pair is what a picture loses: of its weights w (opacity
times mean area), areas A and colours c, merged into area A_m,

    w_i log(A_m / A_i) + w_j log(A_m / A_j) + COLOR w_i w_j / (w_i + w_j) |c_i - c_j|^2

by (w_i + w_j)^DETAIL, so that small ones stay a little longer.  The first two terms are after
Runnalls 2007, "Kullback-Leibler approach to Gaussian mixture reduction", equation 21, with the
area that a splat shows in place of its volume: discs have none.
"""

from collections.abc import Callable

import numpy as np

from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.rotation import covariance, normalize, rotation_matrices
from shapeshift.runtime_models.splats.operations.moment_matching import (
    PAIRS,
    mean_area,
    shown_area,
)

COLOR = 4.0  # 1 to 16 are within 0.3 dB of each other
DETAIL = 0.2  # exponent; 0: 0.1 to 0.5 dB less on 3 of 4 captures, 0.4: the same
REACH = 6  # places along the curve that a partner is looked for; 4 to 12 are within 0.4 dB
AT_ONCE = 1 << 14  # splats: 1 MB of a mixture's rows
FEW = 64  # a round that finds a pair among fewer than so many splats takes neighbours as they are
MOST_AREA = 1e30  # m^2: sums of so large ones are finite, too
TINY = 1e-37  # m^2 and above: float32 that has an inverse
TURNS = (  # wxyz of the Z-curve, a round each: the borders of its cells lie elsewhere every time
    (1.0, 0.0, 0.0, 0.0),
    (0.8, 0.4, 0.4, 0.2),
    (0.6, -0.2, 0.6, -0.5),
    (0.4, 0.6, -0.4, 0.6),
)
MEAN, COV, COLORS, WEIGHT, LOG_AREA = slice(0, 3), slice(3, 9), slice(9, 12), 12, 13
ROWS = 14  # of a mixture: metres, m^2, display sRGB, m^2, log m^2


def pair_groups(
    layers: SplatLayers,
    most: int,
    progress: Callable[[float], None] | None = None,
    kinds: np.ndarray | None = None,
) -> np.ndarray:
    """(N,) int32: the row that stands for each splat; `most` rows stand for all of them.

    Only splats of one stop and one label meet, or of one of kinds (N,) int32: more than `most` are
    left where there are more of those.  The same input gives the same groups.
    progress(part done 0..1) is called each round.
    """
    count = layers.splat_count
    group = np.arange(count, dtype=np.int32)
    mixture, kinds = mixture_of(layers), kinds_of(layers) if kinds is None else kinds
    ids, rounds = group.copy(), 0
    turns = rotation_matrices(normalize(np.array(TURNS)))
    while len(ids) > most:
        order = curve_order(mixture[MEAN], kinds, turns[rounds % len(turns)])
        mixture, kinds, ids = mixture[:, order], kinds[order], ids[order]
        first, second = cheapest_pairs(mixture, kinds, len(ids) - most)
        if not first.size:
            break
        merge_into(mixture, first, second)
        group[ids[second]] = ids[first]
        stay = np.ones(len(ids), bool)
        stay[second] = False
        mixture, kinds, ids = mixture[:, stay], kinds[stay], ids[stay]
        rounds += 1
        if progress:
            progress((count - len(ids)) / (count - most))
    return last_of(group)


def kinds_of(layers: SplatLayers) -> np.ndarray:
    """(N,) int32: equal where stop and label are."""
    if layers.labels is None:
        return layers.layer.astype(np.int32)
    both = np.stack([layers.layer, layers.labels], axis=1)
    return np.unique(both, axis=0, return_inverse=True)[1].astype(np.int32).reshape(-1)


def mixture_of(layers: SplatLayers) -> np.ndarray:
    """(ROWS, N) float32: what the costs of pairs need of splats."""
    out = np.empty((ROWS, layers.splat_count), np.float32)

    def fill(rows: slice, _: None) -> None:
        scales = layers.scales[rows].astype(np.float64)
        covariances = covariance(scales, layers.wxyz[rows]).T
        with np.errstate(over="ignore", under="ignore"):  # beyond 1e9 m: never cheap
            out[MEAN, rows] = layers.means[rows].T
            out[COV, rows] = covariances
            out[COLORS, rows] = C0 * layers.sh[rows, 0].T
            out[WEIGHT, rows] = np.minimum(shown_area(scales, layers.opacity[rows]), MOST_AREA)
            out[LOG_AREA, rows] = np.log(np.maximum(mean_area(covariances), TINY))

    each_block(layers.splat_count, fill, block=AT_ONCE)
    return out


def curve_order(means: np.ndarray, kinds: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(N,) indices along the Z-curve of the places (3, N) after a turn (3, 3), kind by kind."""
    turned = np.stack([row[0] * means[0] + row[1] * means[1] + row[2] * means[2] for row in turn])
    order = morton_order(turned.T)
    return order[np.argsort(kinds[order], kind="stable")] if kinds.any() else order


def cheapest_pairs(
    mixture: np.ndarray, kinds: np.ndarray, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Columns of each pair's two, at most `most` pairs, none in two of them, the cheapest first.

    Two are a pair where each is the other's cheapest within REACH.
    """
    costs = neighbour_costs(mixture, kinds)
    least, partner = cheapest_partners(costs)
    column = np.arange(len(kinds))
    mutual = (partner > column) & (partner[partner] == column)
    first = np.flatnonzero(mutual)
    if len(first) < min(most, len(kinds) // FEW) or not first.size:
        return neighbours_as_they_are(costs[0], most)
    if len(first) > most:
        cheapest = np.argsort(least[first], kind="stable")[:most]
        first = np.sort(first[cheapest])
    return first, partner[first]


def neighbours_as_they_are(costs: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of columns 2i and 2i + 1, or of those shifted by one; costs (N,) with the next one.

    Where costs rise along the curve, each one's cheapest partner has a cheaper one of its own, and
    pairs would be found one a round.
    """
    halves = [np.flatnonzero(~np.isnan(costs[start::2])) * 2 + start for start in (0, 1)]
    first = max(halves, key=len)
    first = np.sort(first[np.argsort(costs[first], kind="stable")[:most]])
    return first, first + 1


def neighbour_costs(mixture: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    """(REACH, N) float32: of each column with the one k + 1 places further; NaN: no pair."""
    count = len(kinds)
    out = np.full((REACH, count), np.nan, np.float32)

    def fill(rows: slice, _: None) -> None:
        for k in range(1, REACH + 1):
            stop = min(rows.stop, count - k)
            if stop <= rows.start:
                return
            near, far = slice(rows.start, stop), slice(rows.start + k, stop + k)
            cost = pair_costs(mixture[:, near], mixture[:, far])
            cost[np.isnan(cost)] = np.inf  # of no size that float32 can square
            cost[kinds[near] != kinds[far]] = np.nan
            out[k - 1, near] = cost

    each_block(count, fill, block=AT_ONCE)
    return out


def pair_costs(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) of pairs of columns of mixtures (ROWS, n)."""
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        weight = a[WEIGHT] + b[WEIGHT]
        part = a[WEIGHT] / np.maximum(weight, TINY)
        rest = 1 - part
        both = part * rest
        away = a[MEAN] - b[MEAN]
        merged = [
            part * a[3 + k] + rest * b[3 + k] + both * away[i] * away[j]
            for k, (i, j) in enumerate(PAIRS)
        ]
        log_area = np.log(np.maximum(mean_area(np.stack(merged)), TINY))
        # The area of a mixture is at least the mean of its parts': what float32 loses of the
        # areas of needles must not make them cheap.
        log_area = np.maximum(log_area, part * a[LOG_AREA] + rest * b[LOG_AREA])
        color = a[COLORS] - b[COLORS]
        color = color[0] ** 2 + color[1] ** 2 + color[2] ** 2
        spread = a[WEIGHT] * (log_area - a[LOG_AREA]) + b[WEIGHT] * (log_area - b[LOG_AREA])
        cost = spread + COLOR * weight * both * color
        return cost / np.maximum(weight, TINY) ** np.float32(DETAIL)


def cheapest_partners(costs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) least cost and (N,) column of the partner, -1 where there is none.

    Of equal costs the nearer, then the pair whose first column counted in steps of its distance is
    even: both partners of a pair agree, and equal splats are all paired in one round.
    """
    count = costs.shape[1]
    least, partner = np.full(count, np.inf, np.float32), np.full(count, -1, np.int32)

    def fill(rows: slice, _: None) -> None:
        column = np.arange(rows.start, rows.stop, dtype=np.int32)
        best, who = least[rows], partner[rows]
        for k in range(1, REACH + 1):
            ahead = costs[k - 1, rows]
            behind = np.full(len(column), np.nan, np.float32)
            low = max(k - rows.start, 0)
            behind[low:] = costs[k - 1, rows.start + low - k : max(rows.stop - k, 0)]
            even = column // k % 2 == 0
            for is_ahead in (even, ~even):
                cost = np.where(is_ahead, ahead, behind)
                better = (cost < best) | (who < 0) & (cost == best)
                best[better] = cost[better]
                who[better] = (column + np.where(is_ahead, k, -k))[better]

    each_block(count, fill, block=AT_ONCE)
    return least, partner


def merge_into(mixture: np.ndarray, first: np.ndarray, second: np.ndarray) -> None:
    """The columns `first` become the pairs, by their moments; `second` stay as they are."""
    a, b = mixture[:, first], mixture[:, second]
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        weight = a[WEIGHT] + b[WEIGHT]
        part = np.where(weight > 0, a[WEIGHT] / np.maximum(weight, TINY), np.float32(0.5))
        merged = part * a + (1 - part) * b
        away = a[MEAN] - b[MEAN]
        for k, (i, j) in enumerate(PAIRS):
            merged[3 + k] += part * (1 - part) * away[i] * away[j]
        log_area = np.log(np.maximum(mean_area(merged[COV]), TINY))
        merged[LOG_AREA] = np.maximum(merged[LOG_AREA], log_area)
        merged[WEIGHT] = weight
    mixture[:, first] = merged


def merging_losses(layers: SplatLayers, merged: SplatLayers, row_of: np.ndarray) -> np.ndarray:
    """(N,) float64 m^2: what is lost of each splat that became row row_of (N,) of `merged`.

    The cost of a pair, of a group of any size: its terms are sums over the members.
    """
    out = np.empty(layers.splat_count)

    def fill(rows: slice, _: None) -> None:
        into = row_of[rows]
        own, theirs = (
            np.maximum(shown_area(scales, np.ones(len(scales), np.float32)), TINY)
            for scales in (layers.scales[rows], merged.scales[into])
        )
        away = C0 * (layers.sh[rows, 0].astype(np.float64) - merged.sh[into, 0])
        weight = shown_area(layers.scales[rows], layers.opacity[rows])
        out[rows] = weight * (np.log(theirs / own) + COLOR * (away**2).sum(axis=1))

    each_block(layers.splat_count, fill, block=AT_ONCE)
    return out


def last_of(group: np.ndarray) -> np.ndarray:
    """(N,) where each row ends that goes from row to row: who was merged may be merged again."""
    while True:
        further = group[group]
        if np.array_equal(further, group):
            return group
        group = further


# An order of points along a curve that fills space: neighbours in it are neighbours in space.

BITS = 21  # of each axis; three of them fill a 64-bit key
SPREADS = (  # (shift, mask) that move the bits of a number three places apart
    (32, 0x001F00000000FFFF),
    (16, 0x001F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def morton_order(points: np.ndarray) -> np.ndarray:
    """(N,) indices that sort points (N, 3) along the Z-curve; equal places stay in their order.

    Far outliers do not take the bits from the rest: each axis counts nearly linearly in the middle
    of the scene and as a logarithm far outside.
    """
    if len(points) < 2:
        return np.arange(len(points))
    keys = np.zeros(len(points), np.uint64)
    for axis in range(3):  # one after the other: a tenth of the memory
        keys |= spaced(cells(points[:, axis])) << np.uint64(axis)
    return np.argsort(keys, kind="stable")


def cells(places: np.ndarray) -> np.ndarray:
    """(N,) uint64 below 2**BITS of places (N,) along an axis."""
    bent = places.astype(np.float64)
    low, middle, high = np.quantile(bent, (0.05, 0.5, 0.95))
    bent -= middle
    bent /= high - low if high > low else 1.0
    np.arcsinh(bent, out=bent)
    bent -= bent.min()
    largest = bent.max()
    bent /= largest if largest > 0 else 1.0
    bent *= 2**BITS - 1
    return bent.astype(np.uint64)


def spaced(numbers: np.ndarray) -> np.ndarray:
    """(N,) uint64 with the lowest 21 bits of each number three places apart."""
    out = numbers & np.uint64(2**BITS - 1)
    for shift, mask in SPREADS:
        out = (out | out << np.uint64(shift)) & np.uint64(mask)
    return out
