"""Objects of a scene by prompts in its photos: label maps by a segmenter, or a walk without one."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeshift.decomposition.label_photos import (
    MOST_PHOTOS,
    PhotoLabelling,
    PhotoLabels,
    Progress,
    choose_photos,
)
from shapeshift.decomposition.masks.journal import open_journal
from shapeshift.decomposition.masks.label_maps import SILENT, write_label_map
from shapeshift.decomposition.masks.segmenter import Segmenter
from shapeshift.decomposition.masks.specs import ObjectSpecs
from shapeshift.decomposition.masks.work_photos import WorkPhoto, straight_points, work_photos
from shapeshift.decomposition.shown import ShownAnchors
from shapeshift.runtime_models.files.hashes import hash_file
from shapeshift.runtime_models.files.whole_file import make_folders
from shapeshift.scene.captures.capture import Capture

FORMAT = "shapeshift-masks 1"  # of unfinished ones


def label_by_segmenter(
    shown: ShownAnchors,
    capture: Capture,
    specs: ObjectSpecs,
    segmenter: Segmenter,
    work: Path,
    about: dict[str, object],
    progress: Progress = lambda what, done, of: None,
    most: int = MOST_PHOTOS,
) -> PhotoLabels:
    """Label maps of at most so many photos; what is decided lies in the folder `work` until all is.

    about: what else the answers depend on, such as the model's file: another one begins anew.
    Raises BadFile.
    """
    photos = choose_photos(work_photos(capture, shown.model.stops), specs, most)
    contents = [hash_file(photo.photo.path) for photo in photos]  # another one under its name
    inputs = {"format": FORMAT, "photos": [photo.name for photo in photos], "contents": contents,
              "prompts": digest_of(specs), **about}  # fmt: skip
    journal = open_journal(work, json.loads(json.dumps(inputs)))
    labelling = PhotoLabelling(shown, photos, specs, segmenter, journal, progress)
    labelling.run()
    return labelling.labels()


def digest_of(specs: ObjectSpecs) -> str:
    """Of the prompts, and of the bytes of the masks that they name."""
    digest = hashlib.sha256(repr(specs.objects).encode())
    for spec in specs.objects:
        for said in spec.prompts:
            if said.mask is not None and specs.path(said).is_file():
                digest.update(specs.path(said).read_bytes())
    return digest.hexdigest()


def files_about(paths: Sequence[Path]) -> list[list[object]]:
    """Names, sizes and times of files: of large ones, whose bytes are not looked through."""
    stats = [(path, path.stat()) for path in sorted(paths)]
    return [[path.name, stat.st_size, stat.st_mtime_ns] for path, stat in stats]


def write_label_maps(found: PhotoLabels, folder: Path) -> None:
    """rgb/012.png for rgb/012.jpg, in the shape of the photo's file: as `--masks` reads them."""
    for photo, labels in zip(found.photos, found.maps, strict=True):
        below = Path(photo.name) if not Path(photo.name).is_absolute() else Path(photo.name).name
        path = folder / Path(below).with_suffix(".png")
        make_folders(folder, path.parent.relative_to(folder))
        write_label_map(in_file(labels, photo), path)


def in_file(labels: np.ndarray, photo: WorkPhoto) -> np.ndarray:
    """Labels of a straight photo as its file shows them, which may be bent; silent beside it."""
    if photo.photo.lens is None:
        return labels
    width, height = (max(side // photo.factor, 1) for side in photo.photo.file_size)
    rows, columns = (np.mgrid[:height, :width] + 0.5) * photo.factor
    places = straight_points(photo.photo.lens, np.stack([columns.ravel(), rows.ravel()], axis=1))
    column, row = (np.nan_to_num(places / photo.factor, nan=-1).T // 1).astype(int)
    there = (column >= 0) & (column < labels.shape[1]) & (row >= 0) & (row < labels.shape[0])
    out = np.full(height * width, SILENT, np.uint8)
    out[there] = labels[row[there], column[there]]
    return out.reshape(height, width)
