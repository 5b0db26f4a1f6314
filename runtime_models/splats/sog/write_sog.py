"""Plain splats to PlayCanvas's SOG, version 2: the inverse of read_sog."""

import io
import json
from pathlib import Path

import numpy as np
from PIL import Image

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.runtime_models.splats.operations.moment_matching import shown_area
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.sog.read_sog import COEFFICIENTS, FIRST_MODE, PALETTE_ROW
from shapeshift.runtime_models.splats.sog.sog_files import META

CODES = 256  # of a codebook
SAMPLE = 200_000  # numbers that a codebook is made of, at most
ROUNDS = 6  # of Lloyd's algorithm
FEW = 8  # numbers of a code; of fewer the code stays where it is
LEAST_SCALE = 1e-12  # metres: of a splat of no extent
LARGEST_CODE = 65535  # of a place


# Sets of harmonics stand for those of all splats: median cut, as palettes of pictures are,
# then k-means with what each splat shows as its weight.

SPLATS_A_SET = 4  # about; of half as many the file is a third larger and 2.4 dB nearer
MOST_BITS = 16  # of a label
AXIS_SAMPLE = 8192  # rows that say which axes those are
TINY = 1e-30  # of a range of numbers
AXES = 8  # principal ones, of 9, 24 or 45 numbers, that cells are cut along
COUSINS = 8  # cells of the same cell three cuts before: a splat may move between their sets
PALETTE_ROUNDS = 2  # of k-means; a third takes 2 % more of the error
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
    for _ in range(PALETTE_ROUNDS if bits else 0):
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
    sample = flat[:: -(-len(flat) // AXIS_SAMPLE)]
    centred = (sample - sample.mean(axis=0)).astype(np.float64)
    # Not a matrix product: its threads wait for each other longer than one takes for all of it.
    _, axes = np.linalg.eigh(np.einsum("na,nb->ab", centred, centred))
    return flat @ axes[:, ::-1][:, :AXES].astype(np.float32)


def write_sog(splats: PlainSplats, folder: Path, generator: str) -> None:
    """meta.json and its pictures in an existing folder; the splats are in the format's axes.

    What is lost: half of 1/65535 of the range of sign(x) log(1 + |x|) in place, half a step of the
    codebooks in the logarithm of a scale and in colour, 1/510 in opacity, 3e-3 in a quaternion's
    entries; about four splats share the harmonics above degree 0 (sh_palette.py).
    """
    means = splats.means.astype(np.float64) + splats.origin
    bent = np.sign(means) * np.log1p(np.abs(means))
    low, high = bent.min(axis=0), bent.max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    places = np.rint((bent - low) / span * LARGEST_CODE).astype(np.uint16)
    scale_book, scales = coded(np.log(np.maximum(splats.scales, LEAST_SCALE)))
    color_book, colors = coded(splats.sh[:, 0])
    opacity = np.rint(255 * splats.opacity.clip(0, 1)).astype(np.uint8)
    pictures = {
        "means_l": places.astype(np.uint8),  # the lower 8 bits
        "means_u": (places >> 8).astype(np.uint8),
        "scales": scales,
        "quats": smallest_three(splats.wxyz),
        "sh0": np.concatenate([colors, opacity[:, None]], axis=1),
    }
    harmonics = {}
    if splats.sh.shape[1] > 1:
        shown = shown_area(splats.scales, splats.opacity)
        harmonics = {"shN": coded_harmonics(splats.sh[:, 1:], shown, pictures)}
    for name, pixels in pictures.items():
        write_picture(pixels, folder / f"{name}.webp")
    meta = {
        "version": 2,
        "asset": {"generator": generator},
        "count": len(means),
        **({"antialias": True} if splats.antialiased else {}),
        "means": {
            "mins": low.tolist(), "maxs": high.tolist(),
            "files": ["means_l.webp", "means_u.webp"],
        },
        "scales": {"codebook": shortest(scale_book), "files": ["scales.webp"]},
        "quats": {"files": ["quats.webp"]},
        "sh0": {"codebook": shortest(color_book), "files": ["sh0.webp"]},
        **harmonics,
    }  # fmt: skip
    write_whole(folder / META, json.dumps(meta).encode())


def coded_harmonics(
    rest: np.ndarray, shown: np.ndarray, pictures: dict[str, np.ndarray]
) -> dict:  # fmt: skip
    """What meta.json says of harmonics (N, M - 1, 3) of splats that show so much (N,); their two
    pictures are put beside others.
    """
    sets, labels = make_palette(rest, shown)
    book, codes = coded(sets.reshape(-1, 3))
    rows = -(-len(sets) // PALETTE_ROW)
    padded = np.zeros((rows * PALETTE_ROW * rest.shape[1], 3), np.uint8)
    padded[: len(codes)] = codes
    pictures["shN_centroids"] = padded.reshape(rows, -1, 3)
    low, high = (labels & 255).astype(np.uint8), (labels >> 8).astype(np.uint8)
    pictures["shN_labels"] = np.stack([low, high, np.zeros_like(low)], axis=1)
    return {
        "count": len(sets),
        "bands": COEFFICIENTS.index(rest.shape[1]),
        "codebook": shortest(book),
        "files": ["shN_centroids.webp", "shN_labels.webp"],
    }


def coded(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(CODES,) float32 rising numbers, and uint8 of values (N, 3): the nearest of them."""
    book = codebook(values)
    return book, np.searchsorted((book[1:] + book[:-1]) / 2, values).astype(np.uint8)


def codebook(values: np.ndarray) -> np.ndarray:
    """(CODES,) float32 rising: one-dimensional k-means.

    Half of the codes begin where values are frequent, half evenly over the range: with quantiles
    alone the few largest splats, which cover the picture, are off by e^1.2.
    """
    flat = values.reshape(-1)
    rising = np.sort(flat[:: -(-flat.size // SAMPLE)].astype(np.float64))
    sums = np.r_[0.0, np.cumsum(rising)]
    low, high = float(flat.min()), float(flat.max())
    frequent = rising[((np.arange(CODES // 2) + 0.5) / (CODES // 2) * len(rising)).astype(int)]
    book = np.sort(np.r_[frequent, np.linspace(low, high, CODES // 2)])
    for _ in range(ROUNDS):
        ends = np.r_[0, np.searchsorted(rising, (book[1:] + book[:-1]) / 2), len(rising)]
        number = np.diff(ends)  # of those that are nearest to each code
        mean = np.diff(sums[ends]) / np.maximum(number, 1)
        book = np.sort(np.where(number > FEW, mean, book))
    book[0], book[-1] = low, high
    return book.astype(np.float32)


def shortest(book: np.ndarray) -> list[float]:
    """The numbers with the fewest digits that are these float32 (n,): 10, not 17."""
    return [float(str(number)) for number in book]


def smallest_three(wxyz: np.ndarray) -> np.ndarray:
    """(N, 4) uint8 of unit quaternions: the three smaller entries, and which one is left out."""
    rows = np.arange(len(wxyz))
    largest = np.abs(wxyz).argmax(axis=1)
    sign = np.where(wxyz[rows, largest] < 0, -1, 1)  # q and -q turn alike
    places = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[largest]
    small = np.take_along_axis(wxyz, places, axis=1) * sign[:, None]
    codes = np.rint((small / 2**0.5 + 0.5) * 255).clip(0, 255)
    return np.concatenate([codes, FIRST_MODE + largest[:, None]], axis=1).astype(np.uint8)


def write_picture(pixels: np.ndarray, path: Path) -> None:
    """A lossless WebP of (H, W, 3) pixels, or of (N, 3 or 4), as square as can be."""
    if pixels.ndim == 3:
        height, width = pixels.shape[:2]
        pixels = pixels.reshape(-1, 3)
    else:
        width = 4 * -(-int(np.ceil(len(pixels) ** 0.5)) // 4)
        height = 4 * -(-len(pixels) // (4 * width))
    out = np.zeros((height * width, 4), np.uint8)
    out[:, 3] = 255
    out[: len(pixels), : pixels.shape[1]] = pixels
    picture = Image.fromarray(out.reshape(height, width, 4))
    # exact: colours of pixels whose alpha is 0 are codes, too.  method 1 is a tenth smaller than 0
    # and read a quarter quicker; those above gain nothing more.
    data = io.BytesIO()
    picture.save(data, "WEBP", lossless=True, exact=True, quality=20, method=1)
    write_whole(path, data.getvalue())
