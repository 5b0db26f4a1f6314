"""Pictures of what the headset sees, by a button: the next frame without the panel, as a PNG."""

import math
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import moderngl
import numpy as np

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.pictures import write_numbered_png, write_png
from shapeshift.app.errors import UsageError
from shapeshift.app.headset.scene_shelf import SceneShelf
from shapeshift.runtime_models.files.whole_file import write_whole
from shapeshift.vr.openxr.graphics import read_color

# A recording of what the left eye sees, as numbered PNGs, while the session goes on.

RATE = 10.0  # frames a second of the session's clock
MOST_WAITING = 8  # frames in memory: one more is left out
MOST_BYTES = 2_000_000_000  # of files: then it ends
TIMES = "frames.csv"  # when each of them was seen


class Recorder:
    """`recording`: whether it is; `left_out`: frames for which the disk was too slow.

    folders: where recordings that the panel begins are made, numbered.
    """

    def __init__(self, folders: Path, rate: float = RATE, most_bytes: int = MOST_BYTES) -> None:
        self._folders, self._rate, self._most_bytes = folders, rate, most_bytes
        self.folder: Path | None = None
        self.count = self.left_out = self.bytes = 0
        self._start_s: float | None = None
        self._slot = -1  # of the last frame: rate times seconds since the start
        self._threads = ThreadPoolExecutor(1, "recording")
        self.writing: list[Future[int]] = []
        self._rows: list[str] = []

    @property
    def recording(self) -> bool:
        return self.folder is not None

    def start(self, folder: Path) -> None:
        """Into a folder that is new or empty.  Raises UsageError."""
        make_folder(folder)
        if any(folder.iterdir()):
            raise UsageError(f"{folder} is not empty; choose another folder for --record.")
        self.folder, self._start_s, self._slot = folder, None, -1
        self.count = self.left_out = self.bytes = 0
        self._rows = ["frame,seconds"]

    def toggle(self, messages: Messages, now: float) -> None:
        """The panel's button: begins in a folder of its own, or ends."""
        if self.recording:
            self.stop(messages, now)
            return
        number = 1
        while (self._folders / f"recording-{number:03d}").exists():
            number += 1
        try:
            self.start(self._folders / f"recording-{number:03d}")
        except UsageError as error:
            messages.fail(str(error))

    def wants(self, seen_s: float) -> bool:
        """Whether a frame that is seen then is one of the recording's."""
        return self.recording and self._slot_of(seen_s) > self._slot

    def _slot_of(self, seen_s: float) -> int:
        start_s = seen_s if self._start_s is None else self._start_s
        return math.floor((seen_s - start_s) * self._rate + 1e-6)

    def saw(self, seen_s: float, framebuffer: moderngl.Framebuffer) -> None:
        """A frame that was handed over: kept where it is due and there is room."""
        if not self.wants(seen_s) or self.folder is None:
            return
        self._start_s = seen_s if self._start_s is None else self._start_s
        self._slot = self._slot_of(seen_s)
        if len(self.writing) >= MOST_WAITING:
            self.left_out += 1
            return
        pixels = (np.clip(read_color(framebuffer), 0, 1) * 255 + 0.5).astype(np.uint8)
        path = self.folder / f"{self.count:05d}.png"
        self._rows.append(f"{self.count},{seen_s - self._start_s:.3f}")
        self.count += 1
        self.writing.append(self._threads.submit(write_frame, pixels, path))

    def poll(self, messages: Messages, now: float) -> None:
        """Once a frame: what has been written; what fails, or has no more room, ends it."""
        while self.writing and self.writing[0].done():
            try:
                self.bytes += self.writing.pop(0).result()
            except (OSError, UsageError) as error:
                why = getattr(error, "strerror", None) or error
                messages.fail(said("The recording cannot be written: {why}.", why=why))
                self.folder = None
                self.writing.clear()
        if self.recording and self.bytes >= self._most_bytes:
            self.stop(messages, now)

    def stop(self, messages: Messages, now: float) -> None:
        """Writes when its frames were seen, behind them."""
        if self.folder is None:
            return
        text = "\n".join(self._rows) + "\n"
        self._threads.submit(_write_times, self.folder / TIMES, text)
        name, count = self.folder.name, self.count
        messages.say(said("{name}: {count} frames are written.", name=name, count=count), now)
        self.folder = None

    def close(self) -> None:
        """Waits for what is being written."""
        self.stop(Messages(), 0.0)
        self._threads.shutdown()


def write_frame(pixels: np.ndarray, path: Path) -> int:
    write_png(pixels, path)
    return path.stat().st_size


def _write_times(path: Path, text: str) -> None:
    write_whole(path, text.encode())


class Shutter:
    """`due`: the next frame is to be kept.  Files are written aside; the end waits for them."""

    def __init__(self, folder: Path, recorder: Recorder | None = None) -> None:
        self.due = False
        self.recorder = recorder or Recorder(folder)
        self._folder = folder
        self._threads = ThreadPoolExecutor(1, "pictures")
        self._written: Future[Path] | None = None

    def press(self) -> None:
        self.due = self._written is None  # one after the other

    def wants(self, seen_s: float) -> bool:
        """Whether anything keeps the frame that is seen then."""
        return self.due or self.recorder.wants(seen_s)

    def expose(self, picture: np.ndarray) -> None:
        """Of (H, W, 3) display sRGB 0..1."""
        self.due = False
        pixels = (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
        self._written = self._threads.submit(write_numbered_png, pixels, self._folder)

    def poll(self, written: Callable[[Path], None], failed: Callable[[str], None]) -> None:
        """Says once what became of it."""
        if self._written is None or not self._written.done():
            return
        done, self._written = self._written, None
        try:
            written(done.result())
        except UsageError as error:
            failed(str(error))
        except OSError as error:
            why = error.strerror or error
            failed(said("The picture cannot be written: {why}.", why=why))

    def keep(
        self, shelf: SceneShelf, framebuffer: moderngl.Framebuffer, messages: Messages,
        seen_s: float,
    ) -> None:  # fmt: skip
        """Of what an eye has just seen, where somebody has asked for a picture or a recording."""
        if self.due:
            self.expose(read_color(framebuffer))
        shelf.saw(lambda: read_color(framebuffer))
        self.recorder.saw(seen_s, framebuffer)
        self.recorder.poll(messages, time.perf_counter())

        def say_written(path: Path) -> None:
            messages.say(said("{name} is written.", name=path.name), time.perf_counter())

        self.poll(say_written, messages.fail)

    def close(self) -> None:
        self.recorder.close()
        self._threads.shutdown()
