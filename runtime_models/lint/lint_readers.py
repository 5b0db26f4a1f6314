"""What other programs' readers and writers would do to a scene that is right here.

Each was seen with the version that is named (docs/formats.md, "What is checked").
"""

import numpy as np

from shapeshift.runtime_models.lint.lint_rows import FEW
from shapeshift.runtime_models.model import Finding, SplatLayers

SPZ_REACH = 2048.0  # metres: 24 bits with the 12 below the metre that nearly all writers take
HALF_LEAST = 2.0**-12.5  # metres: the square of a smaller sigma is 0 as a half float
HALF_MOST = 65520.0**0.5  # metres: that of a larger one is infinite


def other_readers(model: SplatLayers, file: str) -> tuple[Finding, ...]:
    """Findings about a scene of plain splats."""
    found = []
    rules = (far_for_spz, certain_in_spz, lost_by_halves)
    for rule in rules:
        if said := rule(model):
            what, rows, done = said
            few = tuple(int(row) for row in rows[:FEW])
            found.append(Finding(what, len(rows), done, few, file, repaired=False))
    return (*found, *infinite_for_sog(model, file))


def far_for_spz(model: SplatLayers) -> tuple[str, np.ndarray, str] | None:
    """Niantic's writer, splat-transform 3.7.0, gsply 0.4.6 and gaussforge 0.6.0 do not look."""
    places = model.means.astype(np.float64) + np.array(model.origin)
    reach = np.abs(places).max(axis=1)
    rows = np.flatnonzero((reach >= SPZ_REACH - 2.0**-13) & np.isfinite(reach))
    if not len(rows):
        return None
    what = f"{len(rows):,} splats lie {SPZ_REACH:,.0f} m or more from the file's zero"
    done = (
        "right here; as .spz by other writers (12 bits below the metre) they come back 4,096 m "
        "off; `export` takes coarser steps"
    )
    return what, rows, done


def certain_in_spz(model: SplatLayers) -> tuple[str, np.ndarray, str] | None:
    """gaussforge 0.6.0 and Niantic's loader give infinite logits for the bytes 0 and 255."""
    if not str(model.provenance.get("format", "")).startswith("spz"):
        return None
    rows = np.flatnonzero((model.opacity <= 0) | (model.opacity >= 1))
    if not len(rows):
        return None
    what = f"{len(rows):,} splats have an opacity of exactly 0 or 1"
    done = (
        "right here; gaussforge and the format's own loader give them infinite logits, which some "
        "programs take for damage; written by `export` as .ply they are infinite, too"
    )
    return what, rows, done


def lost_by_halves(model: SplatLayers) -> tuple[str, np.ndarray, str] | None:
    """viser 1.1.1 keeps covariances as half floats."""
    largest = model.scales.max(axis=1)
    rows = np.flatnonzero(((largest > 0) & (largest < HALF_LEAST)) | (largest > HALF_MOST))
    if not len(rows):
        return None
    what = (
        f"{len(rows):,} splats are smaller than {HALF_LEAST * 1000:.2g} mm or larger than "
        f"{HALF_MOST:.0f} m"
    )
    done = "right here; viewers with covariances in half floats (viser) draw nothing or everything"
    return what, rows, done


def infinite_for_sog(model: SplatLayers, file: str) -> tuple[Finding, ...]:
    """splat-transform 3.7.0 takes the range of an axis with the infinite place in it."""
    if not any("Inf position" in finding.what for finding in model.findings):
        return ()
    what = "some positions are not finite"
    done = (
        "dropped here; a SOG that splat-transform makes of this file has one place for all splats "
        "along an axis with an infinite one, a compressed PLY loses 256 for each; `export` a clean "
        "file first"
    )
    return (Finding(what, 0, done, file=file, repaired=False),)
