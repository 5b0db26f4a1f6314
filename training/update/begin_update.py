"""Everything that an update is begun with: scene, later capture and region, checked and cut."""

from dataclasses import replace

from shapeshift.runtime_models.files.memory import amount
from shapeshift.runtime_models.model import AnchorModel, BadFile, Stop
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.first_anchors.initial import Report
from shapeshift.training.photo_store.open_photos import open_photos
from shapeshift.training.photos import LoadedPhoto, choose_downscale, memory_for_photos
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.still_background import leave_out_still
from shapeshift.training.update.regions import cut_photos, refuse_unseen
from shapeshift.training.update.trainable import layout_of
from shapeshift.training.update.update_trainer import UpdateBase, UpdateTrainer


def capture_for(model: AnchorModel, capture: Capture) -> tuple[Capture, tuple[str, ...]]:
    """The capture with the scene's stops, and what a person should know.

    Its modalities and those stops have the same names, whatever their letters' case; values are
    read over the scene's range.  Raises BadFile.
    """
    names = {stop.name.casefold(): stop for stop in model.stops}
    said, photos = [], []
    known = {stop.name: stop for stop in capture.stops}
    for modality in known:
        if modality.casefold() not in names:
            said.append(f"photos of '{modality}' are left out: the scene has no such stop.")
    for photo in capture.photos:
        stop = names.get(photo.modality.casefold())
        if stop is not None:
            counts = counts_of(photo.counts, known[photo.modality], stop, capture)
            photos.append(replace(photo, modality=stop.name, counts=counts))
    for stop in model.stops:
        if not any(photo.modality == stop.name for photo in photos):
            raise BadFile(
                f"{capture.folder} has no photos of the stop '{stop.name}', which would stay as it "
                "was where the others change; add some, or take the stop out with style --remove."
            )
    return replace(capture, stops=model.stops, photos=tuple(photos)), tuple(said)


def counts_of(
    counts: tuple[float, float] | None, of_photo: Stop, of_scene: Stop, capture: Capture
) -> tuple[float, float] | None:
    """Numbers of a grey photo that stand for the ends of the scene's range.  Raises BadFile."""
    was, now = of_photo.value_range, of_scene.value_range
    if was is None or now is None or was == now:
        return counts
    if of_photo.unit != of_scene.unit:
        raise BadFile(
            f"{capture.folder}: '{of_photo.name}' is in '{of_photo.unit}', in the scene in "
            f"'{of_scene.unit}'; one unit is wanted."
        )
    if counts is None:
        raise BadFile(
            f"{capture.folder}: black and white of '{of_photo.name}' stand for {was[0]:g} and "
            f"{was[1]:g}, in the scene for {now[0]:g} and {now[1]:g}; write the photos in the "
            "scene's range."
        )
    a_value = (counts[1] - counts[0]) / (was[1] - was[0])
    return (counts[0] + a_value * (now[0] - was[0]), counts[0] + a_value * (now[1] - was[0]))


def refuse_large(photos: dict[str, list[LoadedPhoto]], factor: int) -> None:
    """BadFile where what photos show of the region does not fit into memory."""
    needed, may = sum(p.bytes for each in photos.values() for p in each), memory_for_photos()
    if not needed <= may:
        raise BadFile(
            f"what the photos show of the region takes {amount(needed)} of memory, photos may take "
            f"{amount(may)}; name a smaller box, or give --downscale {factor + 1} or more --memory."
        )


def begin_update(
    device, base: UpdateBase, capture: Capture, settings: TrainSettings,
    resume: tuple | None = None, report: Report | None = None,
) -> UpdateTrainer:  # fmt: skip
    """The trainer, before its first step.  Raises BadFile."""
    layout_of(base.model)  # refused before photos are read
    if resume is not None and resume[1].get("updates") != base.digest:
        raise BadFile(
            "the checkpoint is of another scene, capture or region; train anew without resuming."
        )
    fitting, said = capture_for(base.model, capture)
    factor = settings.downscale or choose_downscale(fitting.photos)
    settings = replace(settings, downscale=factor)
    photos, _ = leave_out_still(
        open_photos(fitting, factor, settings.masks), settings.background, fitting.background
    )
    cut = cut_photos({"train": photos.train, "test": photos.test}, base.region)
    photos.close()
    refuse_large(cut, factor)
    refuse_unseen(cut, tuple(stop.name for stop in base.model.stops), str(capture.folder))
    trainer = UpdateTrainer(device, base, fitting, settings, cut, resume, report)
    trainer.warnings = [*said, *trainer.warnings]
    return trainer
