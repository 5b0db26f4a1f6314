"""Pictures of what the headset sees, by a button: the next frame without the panel, as a PNG."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import moderngl
import numpy as np

from shapeshift.app.editor.state.messages import Messages
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.pictures import write_numbered_png
from shapeshift.app.errors import UsageError
from shapeshift.app.headset.scene_shelf import SceneShelf
from shapeshift.app.headset.session.recorder import Recorder
from shapeshift.vr.openxr.swapchain import read


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
            self.expose(read(framebuffer))
        shelf.saw(lambda: read(framebuffer))
        self.recorder.saw(seen_s, framebuffer)
        self.recorder.poll(messages, time.perf_counter())

        def say_written(path: Path) -> None:
            messages.say(said("{name} is written.", name=path.name), time.perf_counter())

        self.poll(say_written, messages.fail)

    def close(self) -> None:
        self.recorder.close()
        self._threads.shutdown()
