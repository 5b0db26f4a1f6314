"""Scenes far from zero, as survey coordinates are: about a zero of their own, in float64."""

import numpy as np

from runtime_models.lint_whole import BOX, sample_of
from runtime_models.model import Finding
from runtime_models.plain_splats import RawSplats

FINE = 0.01  # of the median splat's size: positions need no finer steps than this
COARSE = 0.5  # of it: a file whose own numbers have coarser steps has lost its shape


def recentre(raw: RawSplats) -> tuple[np.ndarray, list[Finding]]:
    """Takes the scene's place off raw.means where float32 could not tell its splats apart there.

    Returns what was taken off, (3,) float64, whole metres, and what was found.
    Scenes that reach from zero to where they are stay: no place of their own helps them.
    """
    means, scales, _ = sample_of(raw)
    none = np.zeros(3), []
    if not len(means):
        return none
    low, high = np.percentile(means, BOX, axis=0)
    centre, half = (low + high) / 2, (high - low) / 2
    with np.errstate(over="ignore"):
        sigma = np.exp(scales) if raw.log_scales else scales
    size = float(np.median(sigma.max(axis=1)))
    far = np.abs(centre).max()
    step = float(np.spacing(np.float32(far)))
    if not (step > FINE * size and far > half.max()) or far > np.finfo(np.float32).max:
        return none
    origin = np.round(centre)
    was_float32 = raw.means.dtype == np.float32
    raw.means = (raw.means - origin).astype(np.float32)  # float64 - float64: exact enough for both
    place = ", ".join(f"{c:,.0f}" for c in origin)
    what = f"the scene lies far from zero, at {place}"
    done = "drawn about a zero of its own; exports put it back"
    found = [Finding(what, 0, done, file=raw.file, repaired=False)]
    if was_float32 and step > COARSE * size:
        what = f"float32 positions have steps of {step:.3g} m there, its splats are {size:.3g} m"
        done = "nothing, that was lost when the file was written; write it about a nearer zero"
        found.append(Finding(what, 0, done, file=raw.file, repaired=False))
    return origin, found
