"""Photos of a capture with what they say of a labelled model: from given label maps, else from what
the model itself shows there.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapeshift.decomposition.assemble import RowEvidence
from shapeshift.decomposition.completion.verify import PhotoView
from shapeshift.decomposition.label_folder import stop_of
from shapeshift.decomposition.label_pictures import LabelPictures
from shapeshift.decomposition.partition import LabelledView, gather_evidence
from shapeshift.decomposition.segment_scene import Segmented, factor_of
from shapeshift.rasterizer.device import Device
from shapeshift.rasterizer.evidence import SILENT
from shapeshift.runtime_models.model import AnchorModel, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.captures.depth_photo import load_depth
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.colliders.carve import PhotoSight

MOST_VIEWS = 24  # that verify and score: well spread, they say what all would
MOST_SIGHTS, SIGHT_SIDE = 80, 160  # photos that carve what is free, pixels of their longest side


def photo_views(
    device: Device, found: Segmented, capture: Capture, trained: int | None
) -> list[PhotoView]:
    """MOST_VIEWS photos, those with label maps first, each group evenly; their pixels where they
    show colours.

    trained: by what the sides were divided in the training, if that is known.  Raises BadFile.
    """
    given = {picture.photo: picture for picture in found.pictures}
    mapped = [photo for photo in capture.photos if photo.path in given]
    others = [photo for photo in capture.photos if photo.path not in given]
    chosen = evenly(mapped, MOST_VIEWS)
    chosen += evenly(others, MOST_VIEWS - len(chosen))
    drawn, stops = LabelPictures(device, found.model), found.model.stops
    views = []
    for photo in chosen:
        factor, stop = factor_of(photo, trained), stop_of(photo, stops)
        picture = given.get(photo.path)
        if picture is not None:
            factor = round(photo.view.size[0] / picture.view.size[0])
        view = photo.view.divided(factor) if picture is None else picture.view
        labels = drawn.label_map(view, stop.x)
        if picture is not None:
            labels = np.where(picture.labels == SILENT, labels, picture.labels)
        pixels = None
        if not stop.is_measured:  # false colours are no display values
            pixels = load_photo(photo, factor).rgb.astype(np.float32) / 255
        fits = pixels is not None and pixels.shape[:2] == labels.shape
        labelled = LabelledView(view, stop.x, labels, photo.path)
        views.append(PhotoView(labelled, pixels if fits else None))
    return views


def sights_of(capture: Capture, stops: tuple[Stop, ...]) -> list[PhotoSight]:
    """MOST_SIGHTS photos, evenly, in few pixels; of those of the first stop with measured depth."""
    sights = []
    for photo in evenly(list(capture.photos), MOST_SIGHTS):
        factor = max(-(-max(photo.view.size) // SIGHT_SIDE), 1)
        measured = None
        if photo.depth is not None and stop_of(photo, stops).x == stops[0].x:
            measured = load_depth(photo, factor)
        sights.append(PhotoSight(photo.view.divided(factor), measured))
    return sights


def evenly(photos: list[Photo], most: int) -> list[Photo]:
    """At most so many of them, the first among them."""
    return photos[:: -(-len(photos) // most)] if photos and most > 0 else []


def row_evidence(device: Device, model: AnchorModel, views: Sequence[PhotoView]) -> RowEvidence:
    """What the views show of every anchor.  Raises ValueError for a model without labels."""
    if model.labels is None:
        raise ValueError("the model has no labels of objects; partition it first.")
    numbers = np.unique(np.append(model.labels, 0))
    column_of = np.full(256, SILENT, np.uint8)
    column_of[numbers] = np.arange(len(numbers))
    pictures = [replace(v.labelled, labels=column_of[v.labelled.labels]) for v in views]
    sums = gather_evidence(device, model, pictures, len(numbers))
    return RowEvidence(sums[np.arange(len(sums)), column_of[model.labels]], sums[:, 0])
