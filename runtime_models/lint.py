"""What is wrong with a file's splats, row by row, and what is done about it, before any drawing."""

import numpy as np

from runtime_models.model import BadFile, Finding
from runtime_models.odd_rows import odd_rows
from runtime_models.own_units import to_own_units
from runtime_models.plain_splats import PlainSplats, RawSplats, Reading
from runtime_models.turn import ours_from_file

FEW = 10  # rows that a finding names


def judge(raw: RawSplats, reading: Reading) -> PlainSplats:
    """The splats in our units and axes, and what was found wrong.  Raises BadFile.

    Rows with NaN or Inf go (an infinite logit is a plain 0 or 1, an infinitely small scale is
    legal); quaternions become unit ones.  The arrays of `raw` are changed and become the result's.
    """
    findings, count = list(raw.findings), len(raw.means)
    odd = odd_rows(raw)
    bad = odd[~finite(raw, odd)]
    if len(bad) == count:
        raise BadFile(f"{raw.file}: not one of {count} splats is finite.")
    if len(bad):
        found = finding_of("splats have NaN or Inf", bad, "dropped", raw.file)
        if reading.strict:
            raise BadFile(f"{raw.file}: {found.what}; --strict repairs nothing, export it again.")
        findings.append(found)
        drop(raw, bad)
    to_own_units(raw, ours_from_file(reading.up or raw.up, reading.flip))
    return PlainSplats(
        raw.means.astype(np.float32, copy=False),
        raw.scales,
        raw.wxyz,
        raw.opacity,
        raw.sh,
        antialiased=raw.antialiased,
        labels=raw.labels,
        extra=raw.extra,
        findings=tuple(findings),
        format=raw.format,
    )


def finite(raw: RawSplats, rows: np.ndarray) -> np.ndarray:
    """(n,) bool: rows that can be drawn."""
    with np.errstate(over="ignore"):
        scales = np.exp(raw.scales[rows]) if raw.log_scales else raw.scales[rows]
    good = np.isfinite(raw.means[rows]).all(1) & np.isfinite(scales).all(1)
    good &= np.isfinite(raw.wxyz[rows]).all(1) & np.isfinite(raw.sh[rows]).all((1, 2))
    return good & ~(np.isnan(raw.opacity[rows]) if raw.logits else ~np.isfinite(raw.opacity[rows]))


def drop(raw: RawSplats, rows: np.ndarray) -> None:
    """Takes rows out of the arrays of a file, one array after the other."""
    kept = np.ones(len(raw.means), bool)
    kept[rows] = False
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        setattr(raw, name, getattr(raw, name)[kept])
    raw.labels = raw.labels if raw.labels is None else raw.labels[kept]
    raw.extra = {name: column[kept] for name, column in raw.extra.items()}


def finding_of(what: str, rows: np.ndarray, done: str, file: str) -> Finding:
    """A finding that counts its rows and names the first few."""
    few = tuple(int(row) for row in rows[:FEW])
    return Finding(f"{len(rows):,} {what}", len(rows), done, few, file)
