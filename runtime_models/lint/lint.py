"""What is wrong with a file's splats, and what is done about it, before anything is drawn."""

from collections.abc import Sequence

from shapeshift.runtime_models.lint.lint_rows import repair_rows
from shapeshift.runtime_models.lint.lint_whole import (
    read_coding,
    refuse_boundless,
    refuse_filling,
    sample_of,
)
from shapeshift.runtime_models.model import BadFile, Finding
from shapeshift.runtime_models.splats.moving_splats import motion_of
from shapeshift.runtime_models.splats.operations.activate import ODD, activate
from shapeshift.runtime_models.splats.operations.recentre import origin_of, recentred
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
