"""Scenes far from zero, as survey coordinates are: about a zero of their own, in float64."""

import numpy as np

from shapeshift.runtime_models.lint.lint_whole import Sample
from shapeshift.runtime_models.model import Finding

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
