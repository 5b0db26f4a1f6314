"""Mip-Splatting's 3D filter: a column of a PLY, without which its splats are far too thin.

Mip-Splatting, Gaussian Opacity Fields and RaDe-GS save scales and opacities as they are before the
filter, and the filter beside them, in metres.
"""

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.lint.lint_rows import UNSEEN, row_findings
from shapeshift.runtime_models.lint.lint_whole import LARGEST_SCENE, MIN_ALPHA
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import RawSplats

COLUMN = "filter_3D"


def take_filter_3d(raw: RawSplats) -> None:
    """Takes the column, where there is one, into scales and opacities, and out of `raw.extra`.

    sigma' = sqrt(sigma^2 + f^2) along each axis, opacity' = opacity sqrt(prod sigma^2 / prod
    sigma'^2) (Yu et al. 2024, equation 9).  A filter that is no size leaves no scale behind, which
    the judge drops; that, signs, and splats that become too faint to be drawn are findings.
    """
    column = raw.extra.pop(COLUMN, None)
    if column is None:
        return
    hidden = np.zeros(len(column), bool)

    def work(rows: slice, _: None) -> None:
        filed = column[rows].astype(np.float64)
        filed[~(np.abs(filed) <= LARGEST_SCENE)] = np.nan
        logs = raw.scales[rows].astype(np.float64)
        wider = 0.5 * np.logaddexp(2 * logs, np.log(np.square(filed))[:, None])
        thinner = (logs - wider).sum(axis=1)  # the logarithm of how much fainter
        thinner[np.isneginf(logs).any(axis=1) & np.isneginf(wider).any(axis=1)] = 0
        log_before = -np.logaddexp(0, -raw.opacity[rows].astype(np.float64))  # of the opacity
        log_opacity = log_before + thinner
        least = np.log(MIN_ALPHA)
        hidden[rows] = (log_before >= least) & (log_opacity < least)
        raw.scales[rows] = wider
        raw.opacity[rows] = log_opacity - np.log(-np.expm1(log_opacity))

    with np.errstate(all="ignore"):  # odd numbers are for the judge
        each_block(len(raw.means), work)
        size = np.abs(column) <= LARGEST_SCENE
        told = (
            (~size, f"a {COLUMN} that is no size in metres", "they have no size"),
            (size & (column < 0), f"a negative {COLUMN}", "read without its sign"),
            (hidden, f"a {COLUMN} that leaves them too faint to be seen", UNSEEN),
        )
    median = float(np.median(np.abs(column[size]))) if size.any() else 0.0  # squares are taken
    what = f"Mip-Splatting's filter beside the splats ({COLUMN}, half of it over {median:.3g} m)"
    done = "taken into sizes and opacities, as its own viewer does; exports have it in them"
    found = [Finding(what, 0, done, file=raw.file, repaired=False)]
    for rows, what, done in told:
        found += row_findings(what, np.flatnonzero(rows), done, raw)
    raw.findings = (*raw.findings, *found)
