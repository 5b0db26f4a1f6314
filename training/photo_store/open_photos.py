"""The photos of a run: all of them in memory where they fit, else from a store on the disk."""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Collection
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shapeshift.runtime_models.files.memory import amount
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.training.photo_store.photo_files import PhotoFiles
from shapeshift.training.photos import (
    LoadedPhoto,
    PhotoReader,
    is_masked,
    load_photos,
    memory_for_photos,
    memory_of,
    unknown_pixels,
)

# Photos that are read when they are needed: a window of them in memory, all of them on disk.
#
# The window keeps what was used last. A thread reads ahead what the schedule asks for next, so
# that a step does not wait; the first time from the capture's files, from then on from the store.
# What the photos show is the same to the bit as where all of them are in memory.

AHEAD = 8  # photos that are read before their steps


class PhotoStore:
    """The photos of a capture by their numbers.  `get` and `fetch` may be called by any thread."""

    def __init__(
        self, photos: tuple[Photo, ...], reader: PhotoReader, files: PhotoFiles, most: int
    ) -> None:
        """most: bytes of the window; it holds one photo in any case."""
        self.photos, self.reader, self.files, self.most = photos, reader, files, most
        self.window: OrderedDict[int, LoadedPhoto] = OrderedDict()
        self.bytes = 0  # of the window
        self.coming: dict[int, Future[LoadedPhoto]] = {}
        self.lock = threading.Lock()
        self.pool = ThreadPoolExecutor(1, "photos")
        largest = max(map(reader.bytes_of, photos))
        # Between a photo's coming and its step as many others come, and as many are used.
        self.ahead = max(min(AHEAD, (most // largest - 1) // 2), 0)
        self.read_s, self.waited_s = 0.0, 0.0  # processor time of reading; who waited, by the clock
        self.sources = 0  # photos that were read from the capture's own files
        self.trouble = ""  # why photos are not kept any more, in words
        self.shows_background: dict[int, bool] = {}
        self.change: Callable[[LoadedPhoto], LoadedPhoto] | None = None  # of what was read

    def get(self, number: int) -> LoadedPhoto:
        """The photo, in memory.  Raises BadFile where its file cannot be read."""
        with self.lock:
            if (found := self.window.get(number)) is not None:
                self.window.move_to_end(number)
                return found
            future = self.coming.pop(number, None)
        start = time.perf_counter()
        found = self._load(number) if future is None else future.result()
        self.waited_s += time.perf_counter() - start
        return found

    def fetch(self, number: int) -> None:
        """Have the photo read soon."""
        with self.lock:
            if number in self.window:
                self.window.move_to_end(number)  # others would push it out before its step
            elif number not in self.coming:
                self.coming[number] = self.pool.submit(self._load, number)

    def see_through(self, number: int) -> bool:
        """Whether the photo shows the background; once it was read, without its pixels."""
        if number not in self.shows_background:
            self.get(number)
        return self.shows_background[number]

    def _load(self, number: int) -> LoadedPhoto:
        start = time.thread_time()
        found = self.files.read(number)
        source = found is None
        if found is None:
            stamp = self.files.stamp(number)
            found = self.reader.read(self.photos[number])
            self._keep(number, found, stamp)
        if self.change is not None:
            found = self.change(found)
        shown = found.masked and found.see_through
        with self.lock:
            self.shows_background[number] = shown
            self.sources += source
            self._into_window(number, found)
            self.read_s += time.thread_time() - start
        return found

    def change_photos(self, change: Callable[[LoadedPhoto], LoadedPhoto]) -> None:
        """From now on photos are as `change` makes them; nothing may be coming."""
        with self.lock:
            self.change, self.bytes = change, 0
            self.window.clear()
            self.shows_background.clear()

    def _keep(self, number: int, photo: LoadedPhoto, stamp: bytes) -> None:
        """Onto the disk; where that is full, training goes on with the capture's own files."""
        if self.trouble:
            return
        try:
            self.files.write(number, photo, stamp)
        except OSError as error:
            self.trouble = (
                f"{self.files.folder}: photos cannot be kept there any more "
                f"({error.strerror or error}); they are read from the capture each time, which "
                "takes longer."
            )

    def _into_window(self, number: int, photo: LoadedPhoto) -> None:
        self.coming.pop(number, None)
        if number not in self.window:
            self.window[number] = photo
            self.bytes += photo.bytes
        self.window.move_to_end(number)
        while self.bytes > self.most and len(self.window) > 1:
            self.bytes -= self.window.popitem(last=False)[1].bytes

    def close(self, keep: bool) -> None:
        """keep: what is on disk stays for a later run, where a folder was named for it."""
        self.pool.shutdown(cancel_futures=True)
        self.files.close(keep)


class StoredPhoto(LoadedPhoto):
    """A photo of a store: looks as if it were in memory, and is while somebody looks."""

    store: PhotoStore
    number: int

    def __init__(self, store: PhotoStore, number: int) -> None:
        photo = store.photos[number]
        about: dict[str, Any] = {
            "view": photo.view.divided(store.reader.factor), "modality": photo.modality,
            "name": photo.name, "masked": is_masked(photo, store.reader.masks),
            "store": store, "number": number, "unknown": 0,
        }  # fmt: skip
        self.__dict__.update(about)

    def mask(self) -> None:
        """From now on it has an alpha that says what lies outside of its subject."""
        self.__dict__["masked"] = True

    def look(self) -> LoadedPhoto:
        """The photo, read now; it knows then how many of its pixels have no value."""
        found = self.in_memory()
        self.__dict__["unknown"] = found.unknown
        return found

    @property
    def rgba(self) -> np.ndarray:
        return self.store.get(self.number).rgba

    @property
    def weight(self) -> np.ndarray | None:
        return self.store.get(self.number).weight

    @property
    def depth(self) -> np.ndarray | None:
        return self.store.get(self.number).depth if self.has_depth else None

    @property
    def has_depth(self) -> bool:
        return self.store.photos[self.number].depth is not None

    @property
    def normals(self) -> np.ndarray | None:
        return self.store.get(self.number).normals if self.has_normals else None

    @property
    def has_normals(self) -> bool:
        return self.store.photos[self.number].normals is not None

    @property
    def see_through(self) -> bool:
        return self.masked and self.store.see_through(self.number)

    @property
    def bytes(self) -> int:
        return self.in_memory().bytes

    def in_memory(self) -> LoadedPhoto:
        return self.store.get(self.number)


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
