"""What is wrong with a file's splats, and what is done about it, before anything is drawn."""

from collections.abc import Sequence

import numpy as np

from shapeshift.runtime_models.lint.lint_rows import FEW, repair_rows
from shapeshift.runtime_models.lint.lint_whole import (
    read_coding,
    refuse_boundless,
    refuse_filling,
    sample_of,
)
from shapeshift.runtime_models.model import BadFile, Finding, SplatLayers
from shapeshift.runtime_models.splats.moving_splats import motion_of
from shapeshift.runtime_models.splats.operations.activate import ODD, activate, origin_of, recentred
from shapeshift.runtime_models.splats.operations.rotate_splats import ours_from_file
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats, Reading


def judge(raw: RawSplats, reading: Reading) -> PlainSplats:
    """The splats in our units and axes, and what was found wrong.  Raises BadFile.

    What cannot be drawn goes, what is legal but odd stays, what is coded otherwise than its format
    says is read as what it is; each is a finding.  The arrays of `raw` are changed and become the
    result's.
    """
    count, ours = len(raw.means), ours_from_file(reading.up or raw.up, reading.flip, raw.front)
    memory = raw.memory
    findings = [*raw.findings, *read_coding(raw)]
    odd, filed = activate(raw, ours)
    dropping = 12 * raw.sh.shape[1] * count if len(odd) else 0  # one array at a time
    with memory.lend(dropping, f"the check of {count:,} splats"):
        findings += repair_rows(raw, odd, filed)
    memory.release(len(odd) * (ODD + 2 * raw.bytes_a_splat))
    if not len(raw.means):
        raise BadFile(f"{raw.file}: not one of {count:,} splats can be drawn{because(findings)}.")
    sample = sample_of(raw.means, raw.scales, raw.opacity)
    refuse_boundless(raw.file, sample)
    if not reading.allow_huge:
        refuse_filling(raw.file, sample)
    origin, found = origin_of(sample, raw.means.dtype, raw.file)
    if any(origin):
        memory.charge(36 * len(raw.means), f"moving {len(raw.means):,} splats")
    findings += found
    if reading.strict:
        refuse_repairs(raw.file, findings)
    return PlainSplats(
        recentred(raw.means, origin),
        raw.scales,
        raw.wxyz,
        raw.opacity,
        raw.sh,
        origin=origin,
        antialiased=raw.antialiased,
        labels=raw.labels,
        extra=raw.extra,
        findings=tuple(findings),
        format=raw.format,
        axes=raw.axes,
        motion=motion_of(raw.extra, ours),
        memory=memory,
    )


def because(findings: Sequence[Finding]) -> str:
    """What took the most rows."""
    worst = max(findings, key=lambda finding: finding.count, default=None)
    return f", as {worst.what}" if worst else ""


def refuse_repairs(file: str, findings: Sequence[Finding]) -> None:
    """BadFile, for --strict, where anything had to be repaired."""
    repaired = [finding for finding in findings if finding.repaired]
    if not repaired:
        return
    others = len(repaired) - 1
    more = f" ({others} more finding{'s' * (others > 1)})" if others else ""
    raise BadFile(
        f"{file}: {repaired[0].what}{more}; --strict repairs nothing, leave it out or export the "
        "file again."
    )


# What other programs' readers and writers would do to a scene that is right here: each
# was seen with the version that is named (docs/formats.md, "What is checked").

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
