"""Where `update` and ss.update train anew: boxes that are typed, or the places of `change`."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.plain_text import json_text
from shapeshift.runtime_models.model import AnchorModel, Model
from shapeshift.runtime_models.package.feature_codes import EXACT
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.scene.change.read_change import read_change
from shapeshift.scene.change.similarity import Similarity
from shapeshift.scene.sections.read_section import read_box
from shapeshift.training.styles.add_style import refuse_plain
from shapeshift.training.update.regions import UpdateRegion
from shapeshift.training.update.update_trainer import UpdateBase


def region_of(
    where: Sequence[str], change: Path | None, said: str = "--"
) -> tuple[UpdateRegion, Similarity | None]:
    """What may change, and the scene's world from the capture's; None: they are one.

    said: what stands before a name where it is typed.  Raises BadFile, UsageError.
    """
    known = None if change is None else read_change(change)
    try:
        boxes = tuple(read_box(text) for text in where)
    except ValueError as error:
        raise UsageError(f"{said}where {error}") from None
    if not boxes and known is None:
        raise UsageError(
            f"nothing says what may change; give {said}where box:x,y,z:hx,hy,hz in metres, or "
            f"{said}change with the folder that `change` wrote."
        )
    if not boxes and known is not None and not known.boxes:
        raise UsageError(f"{change} names no place that changed; there is nothing to update.")
    chosen = boxes or (known.boxes if known is not None else ())
    return UpdateRegion(chosen), None if known is None else known.a_from_b


def base_of(model: Model, region: UpdateRegion) -> UpdateBase:
    """The scene with what a run is known by when it resumes.  Raises BadFile."""
    anchors: AnchorModel = refuse_plain(model)
    digest = hashlib.sha256()
    for name, data in sorted(package_files(anchors, EXACT).items()):
        digest.update(name.encode() + data)
    boxes = [[box.centre, box.half, box.wxyz] for box in region.boxes]
    digest.update(json_text(boxes).encode())
    return UpdateBase(anchors, region, digest.hexdigest())
