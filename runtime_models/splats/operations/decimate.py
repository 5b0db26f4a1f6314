"""--max-splats: fewer splats that show nearly the same, by merging neighbours."""

from dataclasses import replace
from pathlib import Path

from shapeshift.runtime_models.model import Finding, SplatLayers
from shapeshift.runtime_models.splats.operations.merge_pairs import pair_groups
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups
from shapeshift.runtime_models.splats.operations.prune_by_importance import prune_by_importance
from shapeshift.runtime_models.splats.plain_splats import Reading

MERGING = 160  # bytes a splat on the way, in addition to what is kept
PAIRING = 0.8  # of the time; the rest goes into the moments


def within_most_splats(layers: SplatLayers, path: Path, reading: Reading) -> SplatLayers:
    """decimate() to what the reading asks for, within the memory of its file.  Raises BadFile."""
    count, most = layers.splat_count, reading.most_splats
    if not 0 < most < count:
        return layers
    # By the splats, not by the file: a meta.json of a few bytes names others that hold them.
    size = count * (44 + 12 * layers.sh.shape[1])
    with reading.within(path, size).account.lend(MERGING * count, f"merging {count:,} splats"):
        return decimate(layers, most, reading)


def decimate(layers: SplatLayers, most: int, reading: Reading | None = None) -> SplatLayers:
    """`most` splats that show nearly what all show, or the layers themselves where most is 0 or
    there are no more.

    Pairs of neighbours become one splat of the same moments, the cheapest first, again and again;
    never across stops or labels.  Where there are more of those than `most`, and of splats that
    move (the moments of a group are not those of any motion), splats go instead, as
    prune_by_importance has it.  A finding says how many are left of how many.
    """
    count = layers.splat_count
    if not 0 < most < count:
        return layers
    if layers.motion is not None:
        return prune_by_importance(layers, most)
    report = (reading or Reading()).report
    what = f"merging {count:,} splats into {most:,}"
    group = pair_groups(layers, most, lambda part: report(what, PAIRING * part))
    merged, _ = merge_groups(
        layers, group, lambda part: report(what, PAIRING + (1 - PAIRING) * part)
    )
    found = Finding(
        f"{count:,} splats, --max-splats asks for {most:,}",
        0,
        f"neighbours are merged into {merged.splat_count:,}",
        file=", ".join(layers.provenance.get("files", ())[:3]),
        repaired=False,
    )
    merged = replace(merged, findings=(*layers.findings, found))
    return prune_by_importance(merged, most)
