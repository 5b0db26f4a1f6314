"""Levels of detail of plain splats: each with half of the splats of the one before, by merging."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.splats.lod.leaves import Leaves
from shapeshift.runtime_models.splats.operations.merge_pairs import merging_losses, pair_groups
from shapeshift.runtime_models.splats.operations.moment_matching import merge_groups, shown_area

LEAST = 32  # splats of a leaf on average; coarser levels would only add to the files
MOST_LEVELS = 10
PAIRING = 0.7  # of the time that a level takes; the rest is for its moments and errors
LEAST_WEIGHT = 1e-300  # m^2: of a leaf that shows nothing, whose errors are 0


@dataclass(frozen=True)
class Level:
    """All leaves at one level of detail, leaf after leaf."""

    number: int  # 0 is the finest
    splats: SplatLayers  # (N,) of one stop
    leaf: np.ndarray  # (N,) int32, rising
    errors: np.ndarray  # (leaves,) what merging costs beside all that the leaf shows; level 0: 0


def count_levels(splats: int, leaves: int) -> int:
    """How many levels are worth it."""
    number = 1
    while number < MOST_LEVELS and splats >> number >= LEAST * leaves:
        number += 1
    return number


def make_levels(
    splats: SplatLayers, leaves: Leaves, count: int, merged: Callable[[int, float], None]
) -> Iterator[Level]:
    """`count` levels, the finest first.  merged(level, part 0..1): how far each coarser one is.

    Merging does not cross leaves, and chooses over all of them at once: a smooth leaf gets coarse
    sooner than one of fine detail.  The error of a leaf is the loss of merge_pairs from level 0 on,
    by the weight of its splats; it never falls from level to level.
    """
    order = np.argsort(leaves.of_splat, kind="stable")
    splats, leaf = splats.with_rows(order), leaves.of_splat[order]
    finest, row_of = splats, np.arange(len(order))
    first_leaf = leaf
    weight = np.bincount(leaf, shown_area(splats.scales, splats.opacity), leaves.count)
    errors = np.zeros(leaves.count)
    yield Level(0, splats, leaf, errors)
    for number in range(1, count):

        def paired(part: float, number: int = number) -> None:
            merged(number, PAIRING * part)

        group = pair_groups(splats, len(leaf) // 2, paired, kinds=leaf)
        splats, into = merge_groups(splats, group)
        rows = np.empty(splats.splat_count, np.int32)
        rows[into] = leaf
        leaf, row_of = rows, into[row_of]
        losses = np.bincount(first_leaf, merging_losses(finest, splats, row_of), leaves.count)
        errors = np.maximum(errors, losses / np.maximum(weight, LEAST_WEIGHT))
        merged(number, 1.0)
        yield Level(number, splats, leaf, errors)
