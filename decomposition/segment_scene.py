"""From label maps of photos to a labelled model and a scene file whose objects are its parts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapeshift.decomposition.label_folder import find_maps, read_map, stop_of
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.masks.label_maps import SILENT
from shapeshift.decomposition.masks.specs import ObjectSpec
from shapeshift.decomposition.partition import (
    LEAST_PIXELS,
    LabelledView,
    Progress,
    gather_evidence,
    partition,
)
from shapeshift.decomposition.score import LabelScore, score_maps
from shapeshift.rasterizer.device import Device
from shapeshift.runtime_models.model import (
    AnchorModel,
    BadFile,
    Model,
    ObjectLabel,
    SplatLayers,
)
from shapeshift.runtime_models.parts import BACKGROUND as BACKGROUND_LABEL
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.document.scene_file import (
    BACKGROUND,
    HULLS,
    FirstView,
    SceneFile,
    SceneItem,
)
from shapeshift.scene.world.settle import Rest

MOSTLY = 9  # times as many silent pixels as labelled ones: white masks with soft edges
LONGEST_SIDE = 1024  # pixels of a photo whose training size nobody knows


@dataclass(frozen=True)
class SegmentedPart:
    """What became of one object."""

    spec: ObjectSpec
    photos: int  # in which a label map shows it
    rows: int  # anchors, of plain splats splats
    pixels: float  # of evidence that its rows have


@dataclass(frozen=True)
class ObjectJudgement:
    """What photos that an object was not made from say of it."""

    name: str
    agreement: float  # 0..1: IoU with masks made afresh there; NaN where nothing can be said
    photos: int  # that show it
    doubt: str  # why it may be wrong, in a few words; "": nothing speaks against it


@dataclass(frozen=True)
class Segmented:
    model: AnchorModel | SplatLayers  # labelled
    parts: tuple[SegmentedPart, ...]
    pictures: tuple[LabelledView, ...]  # what the label maps said
    silent: int  # photos without a label map
    judged: tuple[ObjectJudgement, ...] = ()  # of each part, in their order
    rests: tuple[Rest, ...] = ()  # of each body, as the scene is written; (): nothing was tested


def factor_of(photo: Photo, trained: int | None) -> int:
    """By what a photo's sides are divided: as in the training, or such that evidence is quick."""
    return trained or max(-(-max(photo.view.size) // LONGEST_SIDE), 1)


def read_pictures(
    folder: Path, capture: Capture, model: Model, trained: int | None
) -> list[LabelledView]:
    """The label map of every photo that has one, at its stop's x.  Raises BadFile."""
    pictures = []
    for photo, path in find_maps(folder, capture):
        view, labels = read_map(path, photo, factor_of(photo, trained))
        pictures.append(LabelledView(view, stop_of(photo, model.stops).x, labels, photo.path))
    return pictures


def named_objects(
    pictures: Sequence[LabelledView], known: Sequence[ObjectSpec]
) -> tuple[ObjectSpec, ...]:
    """The objects that are looked for: those of objects.json, or a name for each label there is.

    Raises BadFile for a label that objects.json does not know, and where there is none.
    """
    pixels = np.zeros(256, np.int64)
    for picture in pictures:
        pixels += np.bincount(picture.labels.ravel(), minlength=256)
    silent, pixels[[BACKGROUND_LABEL, SILENT]] = int(pixels[SILENT]), 0
    labels = np.flatnonzero(pixels).tolist()
    if not labels:
        raise BadFile(
            f"the label maps of {len(pictures)} photos show the background alone; an object has a "
            "label from 1 to 254."
        )
    if not known and silent > MOSTLY * pixels.sum():
        raise BadFile(
            "nearly all pixels of the label maps that are not 0 are 255, which says nothing: these "
            "look like masks in black and white; write an object's label, 1 to 254, into its "
            "pixels."
        )
    if not known:
        return tuple(ObjectSpec(label, f"object {label}") for label in labels)
    strange = sorted(set(labels) - {spec.label for spec in known})
    if strange:
        raise BadFile(
            f"the label maps have the label {strange[0]}, which no object of objects.json has; "
            "add it there, or write 0 for the background."
        )
    return tuple(known)


def segment(
    device: Device,
    model: AnchorModel | SplatLayers,
    pictures: Sequence[LabelledView],
    specs: Sequence[ObjectSpec],
    photos: int,
    progress: Progress,
) -> Segmented:
    """The model with labels, and what each object got.  Raises BadFile."""
    objects = tuple(ObjectLabel(spec.label, spec.name) for spec in specs)
    # A column a label that there is, however large its number: the table is as wide as that.
    numbers = np.array([BACKGROUND_LABEL, *sorted(spec.label for spec in specs)])
    column_of = np.full(256, SILENT, np.uint8)
    column_of[numbers] = np.arange(len(numbers))
    columns = [replace(picture, labels=column_of[picture.labels]) for picture in pictures]
    sums = gather_evidence(device, model, columns, len(numbers), progress)
    if not (sums.sum(axis=1) > LEAST_PIXELS).any():
        raise BadFile(
            "none of the photos shows anything of the scene; name the capture that it was trained "
            "on."
        )
    cut = partition(model, sums, objects, numbers)
    assert cut.labels is not None
    parts = []
    for spec in specs:
        mine = cut.labels == spec.label
        pixels = float(sums[mine].sum())
        seen = sum(bool((picture.labels == spec.label).any()) for picture in pictures)
        parts.append(SegmentedPart(spec, seen, int(mine.sum()), pixels))
    silent = photos - len(pictures)
    return Segmented(cut, tuple(parts), tuple(pictures), silent)


def scores_of(
    device: Device, found: Segmented, true: Sequence[LabelledView]
) -> tuple[LabelScore, ...]:
    """How well the labelled model shows the true label maps, an object at a time."""
    objects = [ObjectLabel(part.spec.label, part.spec.name) for part in found.parts]
    pictures = LabelPictures(device, found.model)
    pairs = ((pictures.label_map(t.view, t.x), t.labels) for t in true)
    return tuple(score_maps(pairs, objects))


def scene_of_parts(found: Segmented, model: str, folder: Path) -> SceneFile:
    """The background and every object that has anchors, where they stand; `model` is the path.

    They have no poses: a part without one stands where its model has it.
    """
    names = [part.spec.name for part in found.parts if part.rows]
    doubts = {judged.name: judged.doubt for judged in found.judged}
    items = tuple(
        SceneItem(
            name=part.spec.name,
            model=model,
            part=part.spec.label if isinstance(found.model, SplatLayers) else part.spec.name,
            placed=False,
            x=found.model.stops[0].x,
            collider=part.spec.collider,
            static=part.spec.static,
            mass_kg=part.spec.mass_kg,
            doubt=doubts.get(part.spec.name, ""),
        )
        for part in found.parts
        if part.spec.name in names
    )
    background = SceneItem(
        name=BACKGROUND, model=model, part=BACKGROUND_LABEL, placed=False, static=True,
        x=found.model.stops[0].x, collider=HULLS,
    )  # fmt: skip
    return SceneFile(folder=folder, items=items, background=background, view=view_of(found.model))


def view_of(model: Model) -> FirstView | None:
    """The first look that a package asks for; the reader has checked it."""
    view = model.provenance.get("view")
    if not isinstance(view, dict):
        return None
    eye, target = three(view["eye"]), three(view["target"])
    return FirstView(eye, target, float(view.get("fov_y", 1.0)))
