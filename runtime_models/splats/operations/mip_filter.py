"""Mip-Splatting's 3D filter: a column of a PLY, without which its splats are far too thin.

Mip-Splatting, Gaussian Opacity Fields and RaDe-GS save scales and opacities as they are before the
filter, and the filter beside them, in metres.
"""

import numpy as np

from shapeshift.runtime_models.files.blocks import each_block
from shapeshift.runtime_models.model import Finding
from shapeshift.runtime_models.splats.plain_splats import RawSplats

COLUMN = "filter_3D"


def take_filter_3d(raw: RawSplats) -> None:
    """Takes the column, where there is one, into scales and opacities, and out of `raw.extra`.

    sigma' = sqrt(sigma^2 + f^2) along each axis, opacity' = opacity sqrt(prod sigma^2 / prod
    sigma'^2) (Yu et al. 2024, equation 9).  A filter that is no number leaves no scale behind.
    """
    column = raw.extra.pop(COLUMN, None)
    if column is None:
        return

    def work(rows: slice, _: None) -> None:
        added = np.square(column[rows].astype(np.float64))[:, None]
        logs = raw.scales[rows].astype(np.float64)
        wider = 0.5 * np.logaddexp(2 * logs, np.log(added))
        thinner = (logs - wider).sum(axis=1)  # the logarithm of how much fainter
        thinner[np.isneginf(logs).any(axis=1) & np.isneginf(wider).any(axis=1)] = 0
        logits = raw.opacity[rows].astype(np.float64)
        log_opacity = thinner - np.logaddexp(0, -logits)  # of opacity'
        raw.scales[rows] = wider
        raw.opacity[rows] = log_opacity - np.log(-np.expm1(log_opacity))

    with np.errstate(all="ignore"):  # odd numbers are for the judge
        each_block(len(raw.means), work)
    sizes = np.abs(column[np.isfinite(column)])  # of -f as of f: squares are taken
    median = float(np.median(sizes)) if len(sizes) else 0.0
    what = f"Mip-Splatting's filter beside the splats ({COLUMN}, half of it over {median:.3g} m)"
    done = "taken into sizes and opacities, as its own viewer does; exports have it in them"
    raw.findings = (*raw.findings, Finding(what, 0, done, file=raw.file, repaired=False))
