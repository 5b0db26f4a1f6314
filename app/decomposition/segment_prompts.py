"""launch.py segment --objects: prompts in a few photos, a segmenter of the user's or none.

Nothing is printed here: `notice` takes sentences, `progress` what is done now.
"""

import hashlib
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapeshift.app.paths import full

if TYPE_CHECKING:
    from shapeshift.decomposition.label_photos import Counts, Progress
    from shapeshift.decomposition.masks.specs import ObjectSpecs
    from shapeshift.decomposition.segment_scene import Segmented
    from shapeshift.decomposition.shown import ShownAnchors
    from shapeshift.rasterizer.device import Device
    from shapeshift.runtime_models.model import AnchorModel, SplatLayers
    from shapeshift.scene.captures.capture import Capture

MASKS, WORK = ".masks", ".masks.unfinished"  # after the scene file's name, without its ending


@dataclass(frozen=True)
class PromptSettings:
    """How masks are made from prompts."""

    out: Path  # NAME.scene.json; label maps of a segmenter go to NAME.masks beside it
    segmenter: Path | None  # a folder; None: a walk over pixels and anchors
    photos: int  # that a segmenter is asked about
    progress: "Progress"
    notice: Callable[[str], None]


def find_by_prompts(
    device: "Device",
    model: "AnchorModel | SplatLayers",
    capture: "Capture",
    specs: "ObjectSpecs",
    settings: PromptSettings,
) -> "tuple[Segmented, dict[int, Counts]]":
    """The labelled model, and what became of each label in the photos: {} without a segmenter.

    Raises BadFile.
    """
    from shapeshift.decomposition.masks.work_photos import work_photos
    from shapeshift.decomposition.shown import ShownAnchors
    from shapeshift.decomposition.walk_objects import segment_by_walk

    shown = ShownAnchors(device, model)
    if settings.segmenter is not None:
        return find_by_segmenter(shown, capture, specs, settings.segmenter, settings)
    found = segment_by_walk(shown, work_photos(capture, model.stops), specs, settings.progress)
    settings.notice(
        "No --segmenter: objects are found by colours, heat and shape alone, which does for "
        "compact things; look at them."
    )
    return found, {}


def find_by_segmenter(
    shown: "ShownAnchors",
    capture: "Capture",
    specs: "ObjectSpecs",
    folder: Path,
    settings: PromptSettings,
) -> "tuple[Segmented, dict[int, Counts]]":
    from shapeshift.decomposition.find_objects import (
        files_about,
        label_by_segmenter,
        write_label_maps,
    )
    from shapeshift.decomposition.masks.sam_files import open_segmenter
    from shapeshift.decomposition.partition import LabelledView
    from shapeshift.decomposition.segment_scene import segment

    segmenter = open_segmenter(folder)
    if not segmenter.reads_text and any(spec.text for spec in specs.objects):
        settings.notice(f"{segmenter.name} does not read: 'text' is not used.")
    if not segmenter.takes_boxes:
        settings.notice(f"{segmenter.name} takes no boxes: each counts as a click in its middle.")
    work, progress = beside(settings.out, WORK), settings.progress
    about: dict[str, object] = {"scene": digest_of(shown.model),
             "segmenter": files_about([p for p in folder.iterdir() if p.is_file()])}  # fmt: skip
    try:
        labels = label_by_segmenter(
            shown, capture, specs, segmenter, work, about, progress, settings.photos
        )
    except KeyboardInterrupt:
        settings.notice(f"{full(work)} keeps the masks so far; the same command goes on there.")
        raise
    write_label_maps(labels, beside(settings.out, MASKS))
    pictures = [
        LabelledView(photo.view, photo.stop.x, here, photo.photo.path)
        for photo, here in zip(labels.photos, labels.maps, strict=True)
    ]
    found = segment(
        shown.device, shown.model, pictures, specs.objects, len(capture.photos),
        lambda done, count: progress("evidence of photos", done, count),
    )  # fmt: skip
    shutil.rmtree(work)
    return found, labels.counts


def digest_of(model: "AnchorModel | SplatLayers") -> str:
    """Of where its anchors or splats are: another training has others."""
    from shapeshift.runtime_models.model import AnchorModel

    places = model.anchors if isinstance(model, AnchorModel) else model.means
    return hashlib.sha256(np.ascontiguousarray(places).tobytes()).hexdigest()


def beside(out: Path, ending: str) -> Path:
    """A folder beside the scene file, named as it."""
    from shapeshift.scene.document.scene_file import ENDING

    return out.with_name(out.name[: -len(ENDING)] + ending)
