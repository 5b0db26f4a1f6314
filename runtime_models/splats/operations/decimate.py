"""--max-splats: fewer splats that show nearly the same, by merging neighbours."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.runtime_models.model import AnchorModel, Finding, SplatLayers
from shapeshift.runtime_models.splats.operations.merge_pairs import morton_order, pair_groups
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups
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


# Keeps the splats that show most, where they cannot be merged: see decimate.py.

LEAST = 1e-9  # of the least weight: what shows nothing goes first, but sums are never zero
PHASE = 0.618  # of 0..1: equal weights do not add up to just this
NEARLY_SURE = 0.999  # chance from which a splat stays for certain


def prune_by_importance(layers: SplatLayers, most: int) -> SplatLayers:
    """`most` of the splats in their order, or all of them where most is 0 or there are no more.

    Merging is 5 to 13 dB better, but not of splats that move, nor across stops and labels.

    Not simply the largest: those leave holes where detail was, which costs 1 to 3.4 dB at
    half of a scene (docs/bench/thin.csv).  A finding says how many stay.
    """
    count = layers.splat_count
    if not 0 < most < count:
        return layers
    kept = evenly(prominence(layers), morton_order(layers.means), most)
    found = Finding(
        f"{count:,} splats, --max-splats asks for {most:,}",
        0,
        f"{most:,} are kept, evenly over the scene, rather those that show more",
        file=", ".join(layers.provenance.get("files", ())[:3]),
        repaired=False,
    )
    return replace(layers.with_rows(kept), findings=(*layers.findings, found))


def left_whole(model: AnchorModel, most: int, file: str) -> AnchorModel:
    """The model with a finding where it has more than `most` splats: anchors are not thinned."""
    if not 0 < most < model.splat_count:
        return model
    found = Finding(
        f"{model.splat_count:,} splats of anchors, --max-splats asks for {most:,}",
        0,
        "all are shown, a model of anchors has no splats that could go",
        file=file,
        repaired=False,
    )
    return replace(model, findings=(*model.findings, found))


def prominence(layers: SplatLayers) -> np.ndarray:
    """(N,) float64: opacity times the area of the ellipse of the two larger scales, fourth root."""
    _, middle, most = np.sort(layers.scales, axis=1).T.astype(np.float64)
    return (np.maximum(layers.opacity, 0) * middle * most) ** 0.25


def evenly(weights: np.ndarray, order: np.ndarray, count: int) -> np.ndarray:
    """(count,) rising rows: along `order` each stays with a chance proportional to its weight.

    No dice: the chances are added up on the way, and who makes the sum pass another whole number
    stays (systematic sampling).  The same input gives the same rows; count <= N.
    """
    shows = weights > 0
    weights = np.where(shows, weights, LEAST * weights[shows].min() if shows.any() else 1.0)
    by_weight = np.argsort(-weights, kind="stable")
    certain = certain_ones(weights[by_weight], count)
    kept = np.zeros(len(weights), bool)
    kept[by_weight[:certain]] = True
    if count > certain:
        others = order[~kept[order]]
        sums = np.cumsum(weights[others])
        sums *= (count - certain) / sums[-1]
        sums[-1] = count - certain
        kept[others[np.diff(np.floor(sums + PHASE), prepend=0) > 0]] = True
    return np.flatnonzero(kept)


def certain_ones(falling: np.ndarray, count: int) -> int:
    """How many of falling weights have a chance of 1, when `count` are drawn."""
    left = np.cumsum(falling[::-1])[::-1]  # this weight and all smaller ones
    places = count - np.arange(len(falling))  # left when all larger ones stay
    return int(np.argmax((places <= 0) | (places * falling < NEARLY_SURE * left)))


def largest(values: np.ndarray, count: int) -> np.ndarray:
    """(count,) rows of the largest values, rising; of equal values the earlier rows."""
    return np.sort(np.argsort(-values, kind="stable")[:count])
