"""Levels of detail in the viewer: the coarsest is shown at once, finer ones are read meanwhile."""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.texts.table import said
from shapeshift.app.opening import ReadingOptions, open_model
from shapeshift.runtime_models.model import BadFile, Model, SplatLayers
from shapeshift.runtime_models.read_scene import describe
from shapeshift.runtime_models.splats.sog.read_streamed import is_streamed, levels

POLL_S = 0.05  # how often a waiting reader looks whether it is still wanted
THREAD = "finer levels"  # its name
PATIENCE_S = 5.0  # longest wait at the end for a level that is being read


class Refiner:
    """Opens scenes for the viewer and reads finer levels of them in a thread of its own.

    `open`, `follow` and `next_level` are for the window's thread; numpy and Pillow let it draw.
    """

    def __init__(self, options: ReadingOptions) -> None:
        self._options = options
        self._by_leaves = options.reading().leaves is not None  # the renderer asks for them itself
        self._opened: list[tuple[SplatLayers, Iterator[SplatLayers]]] = []  # not followed yet
        self._finer: queue.Queue[tuple[SplatLayers, SplatLayers]] = queue.Queue(maxsize=1)
        self._unwanted = threading.Event()
        self._thread: threading.Thread | None = None
        self._level = ""
        self.problem = ""  # one sentence: why no finer level comes; "" = nothing is wrong

    def __enter__(self) -> "Refiner":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self, path: Path, progress: Callable[[str, float], None] | None = None) -> Model:
        """The model at `path`; of a streamed scene its coarsest level.  Raises BadFile."""
        if self._by_leaves or not path.exists() or not is_streamed(path):
            return open_model(path, self._options, progress)
        finer = levels(path, self._options.reading())
        first = next(finer)
        self._opened.append((first, finer))
        return first

    def follow(self, models: Sequence[Model]) -> None:
        """Refines those of the shown models that were opened coarse, and no others any more."""
        self._unwanted.set()  # the thread before ends by itself after the level that it reads
        shown = [(first, finer) for first, finer in self._opened if any(first is m for m in models)]
        self._opened, self._finer, self._thread = [], queue.Queue(maxsize=1), None
        self._level = ", ".join(level_words(first) for first, _ in shown)
        self.problem = ""
        if not shown:
            return
        self._unwanted = threading.Event()
        given = (shown, self._finer, self._unwanted)
        self._thread = threading.Thread(target=self._read, args=given, name=THREAD, daemon=True)
        self._thread.start()

    def next_level(self) -> tuple[SplatLayers, SplatLayers] | None:
        """(a model that is shown, a finer one for its place), or None while there is none."""
        try:
            before, after = self._finer.get_nowait()
        except queue.Empty:
            return None
        self._level = level_words(after)
        return before, after

    @property
    def running(self) -> bool:
        """Whether finer levels are still to come."""
        reading = self._thread is not None and self._thread.is_alive()
        return reading or not self._finer.empty()

    @property
    def status(self) -> str:
        """Short words on the level that is shown; "" where the scene has no levels."""
        return f"{self._level} …" if self.running else self._level

    def close(self) -> None:
        """Ends the reading; a level that is being read is waited for, then dropped."""
        self._unwanted.set()
        if self._thread is not None:
            self._thread.join(PATIENCE_S)
            self._thread = None
        self._finer = queue.Queue(maxsize=1)

    def stop_at(self, model: SplatLayers) -> None:
        """Reads no finer levels than that of `model`."""
        self.close()
        self._level = level_words(model)

    def _read(
        self,
        shown: list[tuple[SplatLayers, Iterator[SplatLayers]]],
        out: queue.Queue,
        unwanted: threading.Event,
    ) -> None:
        try:
            for before, finer in shown:
                for after in finer:
                    if not put_when_free(out, (before, after), unwanted):
                        return
                    before = after
        except (BadFile, OSError, MemoryError) as error:
            if not unwanted.is_set():
                self.problem = said("no finer level can be shown: {error}", error=error)


def put_when_free(out: queue.Queue, item: tuple, unwanted: threading.Event) -> bool:
    """Puts an item as soon as there is room; False when it is not wanted any more."""
    while not unwanted.is_set():
        try:
            out.put(item, timeout=POLL_S)
            return True
        except queue.Full:
            continue
    return False


def level_words(model: SplatLayers) -> str:
    """ "detail 3 of 7", counted from the coarsest."""
    of = len(model.provenance["level_splats"])
    return f"detail {of - model.provenance['level']} of {of}"


def show_level(state: EditorState, index: int, model: SplatLayers) -> None:
    """Another level for one of the state's objects, with the facts that the status line tells."""
    state.replace_model(index, model)
    path = state.sources[index].path
    source = Source(path, model, describe(model, path))
    state.sources = (*state.sources[:index], source, *state.sources[index + 1 :])
