"""What is wrong with a file's splats, row by row, and what is done about it, before any drawing."""

import numpy as np

from runtime_models.model import BadFile, Finding
from runtime_models.plain_splats import PlainSplats, RawSplats, Reading
from runtime_models.rotation import normalize
from runtime_models.turn import ours_from_file, turn

FEW = 10  # rows that a finding names


def judge(raw: RawSplats, reading: Reading) -> PlainSplats:
    """The splats in our units and axes, and what was found wrong.  Raises BadFile.

    Rows with NaN or Inf go (an infinite logit is a plain 0 or 1, an infinitely small scale is
    legal); quaternions become unit ones.
    """
    with np.errstate(over="ignore"):
        opacity = 1 / (1 + np.exp(-raw.opacity)) if raw.logits else raw.opacity
        scales = np.exp(raw.scales) if raw.log_scales else raw.scales
    good = np.isfinite(raw.means).all(1) & np.isfinite(scales).all(1)
    good &= np.isfinite(raw.wxyz).all(1)
    good &= np.isfinite(opacity) & np.isfinite(raw.sh).all((1, 2))
    if not good.any():
        raise BadFile(f"{raw.file}: not one of {len(good)} splats is finite.")
    findings = list(raw.findings)
    arrays = [raw.means, scales, raw.wxyz, opacity, raw.sh]
    if not good.all():
        rows = np.flatnonzero(~good)
        found = finding_of("splats have NaN or Inf", rows, "dropped", raw.file)
        if reading.strict:
            raise BadFile(f"{raw.file}: {found.what}; --strict repairs nothing, export it again.")
        findings.append(found)
        arrays = [a[good] for a in arrays]
    means, scales, wxyz, opacity, sh = arrays
    plain = PlainSplats(
        means.astype(np.float32, copy=False),
        scales,
        normalize(wxyz),
        opacity,
        sh,
        antialiased=raw.antialiased,
        labels=raw.labels if raw.labels is None else raw.labels[good],
        extra={name: column[good] for name, column in raw.extra.items()},
        findings=tuple(findings),
        format=raw.format,
    )
    return turn(plain, ours_from_file(reading.up or raw.up, reading.flip))


def finding_of(what: str, rows: np.ndarray, done: str, file: str) -> Finding:
    """A finding that counts its rows and names the first few."""
    few = tuple(int(row) for row in rows[:FEW])
    return Finding(f"{len(rows):,} {what}", len(rows), done, few, file)
