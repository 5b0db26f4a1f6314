"""A file's numbers to ours, in place, block by block: metres, 0..1, unit quaternions, our axes and
our zero."""

from dataclasses import replace

import numpy as np

from shapeshift.runtime_models.files.blocks import block_of, each_block
from shapeshift.runtime_models.lint.lint_whole import Sample
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.rotation import normalize
from shapeshift.runtime_models.splats.operations.rotate_splats import rotator
from shapeshift.runtime_models.splats.plain_splats import ARRAYS, RawSplats

ODD = 140  # bytes of an odd splat's numbers in float64, in addition to two copies as they are filed


def activate(raw: RawSplats, rotation: np.ndarray) -> tuple[np.ndarray, RawSplats]:
    """Changes the arrays of `raw`: what they hold afterwards is ours, turned by rotation (3, 3).

    Gives the rows (K,), rising, that are invalid as activate.py says, and those rows as they
    were in the file: what has to be known to judge them.  They are converted like all others; what
    is not finite stays so.  Arrays that may not be written to are copied first.
    """
    for name in ARRAYS:
        array = getattr(raw, name)
        if not array.flags.writeable:
            setattr(raw, name, array.copy())
    rotate_rows = rotator(rotation, raw.sh.shape[1])
    filed = replace(raw)  # the coding, as filed
    raw.log_scales = raw.logits = False
    found: list[tuple[np.ndarray, list[np.ndarray]]] = []

    def work(rows: slice, _: None) -> None:
        if any_invalid(filed, rows):
            odd = rows.start + np.flatnonzero(invalid_in(filed, rows))
            raw.memory.charge(len(odd) * (ODD + 2 * raw.bytes_a_splat), f"{len(odd):,} odd splats")
            found.append((odd, [getattr(filed, name)[odd] for name in ARRAYS]))
        if filed.log_scales:
            np.exp(raw.scales[rows], out=raw.scales[rows])
        if filed.logits:
            sigmoid(raw.opacity[rows])
        raw.wxyz[rows] = normalize(raw.wxyz[rows])
        rotate_rows(raw.means[rows], raw.wxyz[rows], raw.sh[rows])

    with np.errstate(over="ignore", invalid="ignore"):
        each_block(len(raw.means), work, block=block_of(44 + 12 * raw.sh.shape[1]))
    found.sort(key=lambda each: each[0][0] if len(each[0]) else 0)
    if not found:
        found = [(np.empty(0, np.intp), [getattr(filed, name)[:0] for name in ARRAYS])]
    columns = [
        np.concatenate(parts) for parts in zip(*(arrays for _, arrays in found), strict=True)
    ]
    rows = np.concatenate([odd for odd, _ in found])
    return rows, filed.with_arrays(columns, labels=None, extra={})


def sigmoid(logits: np.ndarray) -> None:
    """1 / (1 + exp(-logits)), in place; infinite ones are 0 and 1."""
    logits *= -1  # not negative(): numpy 2.4.6 without AVX-512 errs where one entry in four is it
    np.exp(logits, out=logits)
    logits += 1
    np.divide(1, logits, out=logits)


# Which rows of a file's splats need a second look, found fast: nearly always none does.

LARGEST_LOG = 80.0  # exp of it is a finite float32
SQUARES = (1e-30, 1e30)  # a quaternion's length squared: far from the ends of float32


def ranges(raw: RawSplats) -> tuple[tuple[float, float], tuple[float, float]]:
    """(least, largest) of usual scales and opacities, both themselves usual."""
    largest = float(np.finfo(np.float32).max)
    scales = (-largest, LARGEST_LOG) if raw.log_scales else (0.0, largest)
    return scales, ((-largest, largest) if raw.logits else (0.0, 1.0))


def any_invalid(raw: RawSplats, rows: slice) -> bool:
    """Whether any of these rows may be odd."""
    if raw.usual:
        return False
    largest = float(np.finfo(np.float32).max)
    everything = (-largest, largest)
    scales, opacities = ranges(raw)
    wxyz = raw.wxyz[rows]
    parts = (
        (raw.sh[rows], everything),
        (raw.means[rows], everything),
        (raw.scales[rows], scales),
        (raw.opacity[rows], opacities),
        (np.einsum("nc,nc->n", wxyz, wxyz), SQUARES),
    )
    # NaN is the least and the largest of its block, and no comparison with it holds.
    return not all(low <= part.min() and part.max() <= high for part, (low, high) in parts)


def invalid_in(raw: RawSplats, rows: slice) -> np.ndarray:
    """(n,) bool: the rows themselves."""
    scales, opacities = ranges(raw)
    largest = float(np.finfo(np.float32).max)  # float64 positions may lie beyond
    usual = within(raw.means[rows], (-largest, largest)).all(1) & np.isfinite(raw.sh[rows]).all(
        (1, 2)
    )
    usual &= within(raw.scales[rows], scales).all(1) & within(raw.opacity[rows], opacities)
    with np.errstate(over="ignore", invalid="ignore"):
        usual &= within(np.einsum("nc,nc->n", raw.wxyz[rows], raw.wxyz[rows]), SQUARES)
    return ~usual


def within(array: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    return (ends[0] <= array) & (array <= ends[1])


# Scenes far from zero, as survey coordinates are: about a zero of their own, in float64.

FINE = 0.01  # of the median splat's size: positions need no finer steps than this
COARSE = 0.5  # of it: a file whose own numbers have coarser steps has lost its shape


def origin_of(
    sample: Sample, kind: np.dtype, file: str
) -> tuple[tuple[float, float, float], list[Finding]]:
    """What to take off all means where float32 could not tell splats apart there, and what to say.

    Whole metres, float64; zeros nearly always.  kind: of the file's positions, float32 or float64.
    Scenes that reach from zero to where they are stay: no place of their own helps them.
    """
    centre, half = (sample.low + sample.high) / 2, (sample.high - sample.low) / 2
    size = float(np.median(sample.sigma.max(axis=1)))
    far = np.abs(centre).max()
    step = float(np.spacing(np.float32(far)))
    if not (step > FINE * size and far > half.max()):
        return (0.0, 0.0, 0.0), []
    x, y, z = map(float, np.round(centre) + 0.0)  # no minus before a zero
    what = f"the scene lies far from zero, at {x:,.0f}, {y:,.0f}, {z:,.0f}"
    done = "drawn about a zero of its own; exports put it back"
    found = [Finding(what, 0, done, file=file, repaired=False)]
    if kind == np.float32 and step > COARSE * size:
        what = f"float32 positions have steps of {step:.3g} m there, its splats are {size:.3g} m"
        done = "nothing, that was lost when the file was written; write it about a nearer zero"
        found.append(Finding(what, 0, done, file=file, repaired=False))
    return (x, y, z), found


def recentred(means: np.ndarray, origin: tuple[float, float, float]) -> np.ndarray:
    """(N, 3) float32 means from origin: exact where they are float64, and of float32 nothing lost.

    Nothing is copied where there is nothing to do.
    """
    if any(origin):
        means = means - np.array(origin)  # float64
    return means.astype(np.float32, copy=False)
