"""launch.py segment --objects: prompts in a few photos, a segmenter of the user's or none."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.app.paths import full
from shapeshift.app.terminal import say

if TYPE_CHECKING:
    from shapeshift.decomposition.label_photos import PhotoLabels
    from shapeshift.decomposition.masks.specs import ObjectSpecs
    from shapeshift.decomposition.segment_scene import Segmented
    from shapeshift.rasterizer.device import Device
    from shapeshift.runtime_models.model import AnchorModel, SplatLayers
    from shapeshift.scene.captures.capture import Capture

MASKS, WORK = ".masks", ".masks.unfinished"  # after the scene file's name, without its ending


def find_by_prompts(
    device: "Device",
    model: "AnchorModel | SplatLayers",
    capture: "Capture",
    specs: "ObjectSpecs",
    folder: Path | None,
    out: Path,
    scene: Path,
    photos: int,
) -> "Segmented":
    """The labelled model.  folder: a segmenter's; None: a walk over pixels and anchors.

    out: NAME.scene.json; label maps go to NAME.masks beside it, with a segmenter.  scene: the
    model's file.  Raises BadFile.
    """
    from shapeshift.decomposition.masks.work_photos import work_photos
    from shapeshift.decomposition.shown import ShownAnchors
    from shapeshift.decomposition.walk_objects import segment_by_walk

    shown = ShownAnchors(device, model)
    if folder is None:
        with told() as progress:
            found = segment_by_walk(shown, work_photos(capture, model.stops), specs, progress)
        say(
            "No --segmenter: objects are found by colours, heat and shape alone, which does for "
            "compact things; look at them."
        )
        return found
    return find_by_segmenter(shown, capture, specs, folder, out, scene, photos)


def find_by_segmenter(shown, capture, specs, folder, out, scene, photos) -> "Segmented":
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
        say(f"{segmenter.name} does not read: 'text' is not used.")
    work = beside(out, WORK)
    about = {"scene": files_about([scene] if scene.is_file() else list(scene.iterdir())),
             "segmenter": files_about([p for p in folder.iterdir() if p.is_file()])}  # fmt: skip
    try:
        with told() as progress:
            labels = label_by_segmenter(
                shown, capture, specs, segmenter, work, about, progress, photos
            )
    except KeyboardInterrupt:
        say(f"{full(work)} keeps the masks so far; the same command goes on there.")
        raise
    write_label_maps(labels, beside(out, MASKS))
    print_counts(labels, specs)
    pictures = [
        LabelledView(photo.view, photo.stop.x, here)
        for photo, here in zip(labels.photos, labels.maps, strict=True)
    ]
    left = len(capture.photos) - len(pictures)
    with told() as progress:
        found = segment(
            shown.device, shown.model, pictures, specs.objects, left + len(pictures),
            lambda done, count: progress("evidence of photos", done, count),
        )  # fmt: skip
    shutil.rmtree(work)
    return found


def print_counts(labels: "PhotoLabels", specs: "ObjectSpecs") -> None:
    from rich.table import Table

    from shapeshift.app.terminal import open_console

    table = Table("object", "photos given", "accepted", "rejected", "unknown")
    for spec in specs.objects:
        counts = labels.counts[spec.label]
        cells = (counts.given, counts.accepted, counts.rejected, counts.unknown)
        table.add_row(spec.name, *map(str, cells))
    open_console(stderr=True).print(table)


def beside(out: Path, ending: str) -> Path:
    """A folder beside the scene file, named as it."""
    from shapeshift.scene.document.scene_file import ENDING

    return out.with_name(out.name[: -len(ENDING)] + ending)


@contextmanager
def told() -> Iterator[Callable[[str, int, int], None]]:
    """A bar, or a line a minute without a terminal."""
    from shapeshift.app.progress import progress_bar

    with progress_bar() as bar:
        task = bar.add_task("photos", total=None)

        def progress(what: str, done: int, of: int) -> None:
            bar.update(task, description=what, completed=done, total=of)

        yield progress
