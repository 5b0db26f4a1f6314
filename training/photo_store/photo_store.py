"""Photos that are read when they are needed: a window of them in memory, all of them on disk.

The window keeps what was used last.  A thread reads ahead what the schedule asks for next, so that
a step does not wait; the first time from the capture's files, from then on from the store.  What
the photos show is the same to the bit as where all of them are in memory.
"""

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from shapeshift.scene.captures.capture import Photo
from shapeshift.training.photo_store.photo_files import PhotoFiles
from shapeshift.training.photos import LoadedPhoto, PhotoReader, is_masked

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
