"""Rows of one arena of the tiles in another: what stays decoded where other objects change."""

from typing import TYPE_CHECKING, TypeAlias

from shapeshift.rasterizer.device import Device
from shapeshift.renderer.tiles.slot import Slot

if TYPE_CHECKING:
    from pyopencl.array import Array

    Tables: TypeAlias = "list[Array | None]"  # with a row a splat


def keep_rows(
    device: Device, before: list[Slot], after: list[Slot], tables: "list[tuple[Tables, Tables]]"
) -> list[bool]:
    """Copies what objects of the same model have decoded, and puts their slots in place of new
    ones; which objects these are.  tables: pairs of the same, of the arena before and after.
    """
    kept = [False] * len(after)
    for i, (old, new) in enumerate(zip(before, after, strict=False)):
        if old.model is not new.model:
            continue
        kept[i] = True
        for sources, targets in tables:
            for source, target in zip(sources, targets, strict=True):
                if source is not None and target is not None and old.count:
                    device.copy_rows(source[old.rows], target, new.start)
        old.start, after[i] = new.start, old
    return kept
