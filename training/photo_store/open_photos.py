"""The photos of a run: all of them in memory where they fit, else from a store on the disk."""

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapeshift.runtime_models.files.memory import amount
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.photo_store.photo_files import PhotoFiles
from shapeshift.training.photo_store.photo_store import PhotoStore, StoredPhoto
from shapeshift.training.photos import (
    LoadedPhoto,
    PhotoReader,
    load_photos,
    memory_for_photos,
    memory_of,
    unknown_pixels,
)


@dataclass(frozen=True)
class PhotoRoom:
    """Where photos may lie."""

    most: int | None = None  # bytes of memory; None: half of what files may take
    folder: Path | None = None  # for what does not fit; None: one in the user's cache, for this run


class TrainingPhotos:
    """Photos to train on and photos that are held out, and how long it takes to read them."""

    def __init__(
        self, train: list[LoadedPhoto], test: list[LoadedPhoto], store: PhotoStore | None = None
    ) -> None:
        self.train, self.test, self.store = train, test, store
        self.said: list[str] = []  # of pixels without a value
        self.load_s = 0.0  # processor time of those that were all read at the beginning
        self.left_out: Any = None  # what leave_out_still found in them, once it has looked
        self.asked = 0  # the first iteration whose photo was not asked for

    def read_ahead(self, photo_of: Callable[[int], LoadedPhoto], iteration: int) -> None:
        """Have the photos of the next steps read.  photo_of: the schedule, by iteration."""
        if self.store is None:
            return
        end = iteration + self.store.ahead + 1
        if not iteration < self.asked <= end:  # another run's, or one that was turned back
            self.asked = iteration + 1
        for i in range(self.asked, end):
            if isinstance(photo := photo_of(i), StoredPhoto):
                self.store.fetch(photo.number)
        self.asked = end

    def seconds(self, processor: bool) -> float:
        """Of reading from the store: of processors, or waited for by the clock."""
        if self.store is None:
            return 0.0
        return self.store.read_s if processor else self.store.waited_s

    @property
    def read_s(self) -> float:
        """Processor seconds that reading photos has taken in all; no budget counts them."""
        return self.load_s + self.seconds(True)

    @property
    def most(self) -> int | None:
        """Bytes that photos, and what is made of them, may take in memory; None: as they need."""
        return None if self.store is None else self.store.most

    @property
    def trouble(self) -> str:
        """What a person should know of the disk by now, in words."""
        return "" if self.store is None else self.store.trouble

    def changed(
        self, change: Callable[[LoadedPhoto], LoadedPhoto], cameras: Collection[tuple]
    ) -> "TrainingPhotos":
        """The photos after a change, which masks those of some cameras (modality and size).

        Photos of a store are changed when they are read, what is on disk stays as it is.
        """
        if self.store is None:
            out = TrainingPhotos([change(p) for p in self.train], [change(p) for p in self.test])
            out.load_s, out.said = self.load_s, self.said
            return out
        self.store.change_photos(change)
        for photo in (*self.train, *self.test):
            if isinstance(photo, StoredPhoto) and (photo.modality, photo.view.size) in cameras:
                photo.mask()
        return self

    def warnings(self) -> list[str]:
        """What a person should know of where the photos are, a sentence each."""
        if self.store is None:
            return self.said
        store, folder = self.store, self.store.files.folder
        width, height = (*self.train, *self.test)[0].view.size
        return [
            *self.said,
            f"{len(store.photos):,} photos of {width}x{height} pixels take "
            f"{amount(store.files.size)}, in memory they may take {amount(store.most)}: they are "
            f"read as they are needed and kept in {folder} until the run is done; --memory GB or "
            "--photo-mb MB allows more.",
        ]

    def close(self, keep: bool = False) -> None:
        """keep: what is on disk stays where a run that goes on finds it."""
        if self.store is not None:
            self.store.close(keep)


def open_photos(
    capture: Capture, factor: int, masks: str, room: PhotoRoom | None = None
) -> TrainingPhotos:
    """The photos of a capture with their sides divided by `factor`.

    Photos without any value are left out.  Raises BadFile where one cannot be read, where they fit
    neither into memory nor on the disk, or where no photo of a modality has a value.  Photos of a
    store are read later, and refused then; those that may lack values are read now.
    """
    room = room or PhotoRoom()
    most = memory_for_photos() if room.most is None else room.most
    if memory_of(capture.photos, factor) <= most:
        began = time.process_time()
        train, test = (load_photos(capture, split, factor, masks) for split in ("train", "test"))
        opened = TrainingPhotos(train, test)
        opened.load_s = time.process_time() - began
    else:
        opened = stored_photos(capture, factor, masks, room.folder, most)
    used = {photo.name for photo in (*opened.train, *opened.test)}
    blank = [photo for photo in capture.photos if photo.name not in used]
    opened.said = unknown_pixels((*opened.train, *opened.test), blank)
    for name in {photo.modality for photo in blank if photo.split == "train"}:
        if not any(photo.modality == name for photo in opened.train):
            raise BadFile(
                f"{capture.folder}: no pixel of the photos of '{name}' has a value (no data, NaN, "
                "or beyond what was measured); copy them again, or drop the modality"
            )
    return opened


def stored_photos(
    capture: Capture, factor: int, masks: str, folder: Path | None, most: int
) -> TrainingPhotos:
    """Photos that do not fit into memory: as `open_photos`."""
    reader = PhotoReader.of(capture.photos, factor, masks)
    store = PhotoStore(capture.photos, reader, PhotoFiles(capture.photos, reader, folder), most)
    split: dict[str, list[LoadedPhoto]] = {"train": [], "test": []}
    for number, photo in enumerate(capture.photos):
        stored = StoredPhoto(store, number)
        if not (photo.may_lack_values and stored.look().is_blank):
            split[photo.split].append(stored)
    return TrainingPhotos(split["train"], split["test"], store)
