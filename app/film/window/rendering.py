"""A film of the timeline, and a page of the scene, made by the program's own commands beside the
window.
"""

import atexit
import importlib
import importlib.util
import os
import re
import subprocess
import sys
import threading
import webbrowser
from abc import ABC, abstractmethod
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import IO

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.saving import scene_unsaved
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name
from shapeshift.app.progress import PERIOD
from shapeshift.runtime_models.program import EXTRAS, ROOT, is_installed
from shapeshift.scene.film.film_path import ENDING, write_film_file

# A command of this program as a process of its own, for long work beside the window.

LINES_EVERY_S = 0.3  # of progress
START = (
    "import sys; sys.path[:0] = {paths!r}; "
    "from shapeshift.app.cli import main; sys.exit(main())"
)  # -P leaves the current folder out
COUNT = re.compile(r"(\d+) of (\d+)")
PERCENT = re.compile(r"(\d+) ?%")
PATIENCE_S = 5.0  # for a process that is told to end
CREATE_NO_WINDOW = 0x08000000  # of Windows


class ProgramChild:
    """Starts at once; `poll` it once a frame.

    It is ended with this program.  What it has written by then stays whole, as after Ctrl-C.
    """

    def __init__(self, words: Sequence[str]) -> None:
        """words: a command with its options.  Raises OSError where it cannot be started."""
        paths = [] if is_installed() else [str(ROOT)]
        command = [sys.executable, "-P", "-c", START.format(paths=paths), *words]
        environment = os.environ | {PERIOD: str(LINES_EVERY_S), "TERM": "dumb"}
        self._child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            env=environment, creationflags=CREATE_NO_WINDOW if sys.platform == "win32" else 0,
        )  # fmt: skip
        assert self._child.stderr is not None
        self._name = words[0]
        self.progress = ("starting", 0.0)  # what is being done, part done 0..1
        self.said = ""  # its last line that is no progress
        self.cancelled = False
        self._reader = threading.Thread(
            target=self._read, args=(self._child.stderr,), name="child", daemon=True
        )
        self._reader.start()
        atexit.register(self.end)

    def _read(self, stream: IO[bytes]) -> None:
        with stream:
            for line in stream:
                self._hear(line.decode("utf-8", "replace").strip())

    def _hear(self, line: str) -> None:
        """A line of progress, as app/progress.py writes it, or a sentence."""
        found = re.fullmatch(rf"{re.escape(self._name)}: (.*) \(\d+ min\)", line)
        if not found:
            self.said = line or self.said
            return
        words = found[1]
        part = self.progress[1]
        if count := COUNT.search(words):
            part = int(count[1]) / max(int(count[2]), 1)
        elif percent := PERCENT.search(words):
            part = int(percent[1]) / 100
        self.progress = (words, min(part, 1.0))

    @property
    def running(self) -> bool:
        """Whether it is under way still."""
        return self._child.poll() is None

    @property
    def code(self) -> int | None:
        """Its exit code; None while it runs, or while its last words are on their way."""
        if self.running or self._reader.is_alive():
            return None
        return self._child.returncode

    def cancel(self) -> None:
        """Asks it to end; what is drawn stays for the same command later."""
        self.cancelled = True
        if self.running:
            self._child.terminate()

    def end(self) -> None:
        """Ends it, and waits until it has."""
        atexit.unregister(self.end)
        self.cancel()
        try:
            self._child.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._reader.join(PATIENCE_S)

    def problem(self) -> str:
        """Why it did not end well, one sentence; "" where it did."""
        if self.code == 0:
            return ""
        before = f"shapeshift {self._name}: "
        return self.said.removeprefix(before) or f"{self._name} ended with code {self.code}."


class ChildWork(ABC):
    """Work of the window that one command at a time does."""

    def __init__(self) -> None:
        self._child: ProgramChild | None = None

    @property
    def running(self) -> bool:
        return self._child is not None

    @property
    def progress(self) -> tuple[str, float]:
        """What is being done, part done."""
        return self._child.progress if self._child else ("", 0.0)

    def cancel(self) -> None:
        """Ends it; what the command keeps of it stays."""
        if self._child is not None:
            self._child.cancel()

    def poll(self) -> bool:
        """Once a frame: says how it ended; True while it is under way."""
        child = self._child
        if child is None or child.code is None:
            return child is not None
        self._child = None
        if child.cancelled:
            self.say_left()
        elif problem := child.problem():
            self.say_failed(problem)
        else:
            self.show(child)
        return True

    @abstractmethod
    def say_left(self) -> None:
        """That it was cancelled."""

    @abstractmethod
    def say_failed(self, why: object) -> None:
        """A sentence of the command, or of why it could not be started."""

    @abstractmethod
    def show(self, child: ProgramChild) -> None:
        """What was made."""


class ExtraInstall(ChildWork):
    """An optional part of the program, installed while the window goes on."""

    def __init__(self, state: EditorState, extra: str) -> None:
        """extra: of EXTRAS."""
        super().__init__()
        self._state, self._extra = state, extra
        module = EXTRAS[extra].modules[0]
        self.missing = importlib.util.find_spec(module) is None

    @property
    def megabytes(self) -> int:
        return EXTRAS[self._extra].megabytes

    def start(self) -> None:
        try:
            self._child = ProgramChild(["extras", self._extra])
        except OSError as error:
            self.say_failed(error)

    def say_left(self) -> None:
        self._state.say(said("The installation was left; its button begins it anew."))

    def say_failed(self, why: object) -> None:
        self._state.problem = said("Nothing was installed: {error}", error=why)

    def show(self, child: ProgramChild) -> None:
        importlib.invalidate_caches()
        self.missing = False
        self._state.say(said("Installed; no new start is needed."))


VIDEOS = (".mp4", ".webm", ".webp", ".gif")
WANT_PYAV = (".mp4", ".webm")


class Rendering(ChildWork):
    """The choices, and the one film that may be under way."""

    def __init__(self, state: EditorState, folder: Path) -> None:
        super().__init__()
        self._state, self._folder = state, folder
        self.pyav = ExtraInstall(state, "film")
        self.ending = ".webp" if self.pyav.missing else ".mp4"
        self._path = Path()

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return said("film {part:.0%}", part=self.progress[1]) if self.running else ""

    def start(self) -> None:
        """Begins to draw; what is moved meanwhile does not show in the film."""
        try:
            self._child = ProgramChild(self._words())
        except (OSError, UsageError) as error:
            self.say_failed(error)

    def _words(self) -> list[str]:
        """The command.  Raises UsageError, OSError."""
        state = self._state
        keys = state.timeline.keys
        scene, reading = scene_on_disk(state)
        make_folder(self._folder)
        self._path = free_name(self._folder, Path(state.title).name, self.ending)
        words = ["film", str(scene), *reading, "--out", str(self._path)]
        if keys.cameras:
            path = self._path.with_suffix(ENDING)
            write_film_file(keys.path(origin_on_disk(state)), path)
            return [*words, "--cameras", str(path)]
        size = f"{keys.size[0]}x{keys.size[1]}"
        words += ["--cameras", "orbit", "--seconds", f"{keys.seconds:g}", "--fps", f"{keys.fps:g}"]
        words += ["--size", size]
        return [*words, "--style-path", keys.style] if keys.style else words

    def save_path(self) -> None:
        """The keys as a file, for the command and for another day."""
        state = self._state
        try:
            make_folder(self._folder)
            path = free_name(self._folder, Path(state.title).name, ENDING)
            write_film_file(state.timeline.keys.path(origin_on_disk(state)), path)
        except (OSError, UsageError) as error:
            state.problem = said("The film cannot be kept: {error}", error=error)
        else:
            state.say(said("Kept in {path}", path=path))

    def say_left(self) -> None:
        folder = frames_of(self._path)
        self._state.say(said("The film was left; its frames are in {folder}", folder=folder))

    def say_failed(self, why: object) -> None:
        self._state.problem = said("There is no film: {error}", error=why)

    def show(self, child: ProgramChild) -> None:
        self._state.say(child.said, seconds=8)


class PageShare(ChildWork):
    """The scene as a page, one file that any browser opens; it is opened once it is made."""

    def __init__(self, state: EditorState, folder: Path) -> None:
        super().__init__()
        self._state, self._folder, self._path = state, folder, Path()
        self._opening: Future[bool] | None = None

    def status(self) -> str:
        """Words for the status line; "" when nothing is under way."""
        return said("page {part:.0%}", part=self.progress[1]) if self.running else ""

    def start(self) -> None:
        """Begins to write; what is moved meanwhile does not show in the page."""
        try:
            scene, reading = scene_on_disk(self._state)
            make_folder(self._folder)
            self._path = free_name(self._folder, Path(self._state.title).name, ".html")
            self._child = ProgramChild(["export", str(scene), *reading, "--out", str(self._path)])
        except (OSError, UsageError) as error:
            self.say_failed(error)

    def poll(self) -> bool:
        """Once a frame: says how it ended; True while it is under way."""
        opening = self._opening
        if opening is None or not opening.done():
            return super().poll() or opening is not None
        self._opening = None
        if not opening.result():
            path = self._path
            told = said("No browser could be started here; the page is {path}", path=path)
            self._state.say(told, seconds=20)
        return True

    def say_left(self) -> None:
        self._state.say(said("The page was left."))

    def say_failed(self, why: object) -> None:
        self._state.problem = said("There is no page: {error}", error=why)

    def show(self, child: ProgramChild) -> None:
        self._state.say(said("The page is {path}", path=self._path), seconds=8)
        thread = ThreadPoolExecutor(1, "browser")
        self._opening = thread.submit(open_in_browser, self._path)
        thread.shutdown(wait=False)


def open_in_browser(path: Path) -> bool:
    """Shows a page in the browser of the desktop; False where there is none."""
    try:
        browser = webbrowser.get()
        in_terminal = type(browser) is webbrowser.GenericBrowser and "BROWSER" not in os.environ
        return not in_terminal and browser.open(path.as_uri())
    except (webbrowser.Error, OSError):
        return False


def scene_on_disk(state: EditorState) -> tuple[Path, list[str]]:
    """The file that shows what the window shows, and the options it is read with.

    Raises UsageError where it has to be saved first.
    """
    if not state.scene.objects:
        raise UsageError("nothing is open.")
    if scene_unsaved(state):
        raise UsageError("the scene has changes that no file has; save it first (Ctrl+S).")
    if state.edited.path is not None:
        return state.edited.path, []
    if len(state.sources) != 1:
        raise UsageError("several files are open; save them as one scene first (Ctrl+S).")
    source = state.sources[0]
    words = ["--up", source.reading.up] if source.reading.up else []
    words += ["--mode", source.reading.mode] if source.reading.mode else []
    words += ["--flip"] if source.reading.flip else []
    return source.path, words


def origin_on_disk(state: EditorState) -> tuple[float, float, float]:
    """Where the shown world's zero lies in the world of that file: metres."""
    if state.edited.path is not None:
        return (0.0, 0.0, 0.0)
    x, y, z = (float(c) for c in state.origin)
    return (x, y, z)


def free_name(folder: Path, title: str, ending: str) -> Path:
    """A name of the scene's that neither a film nor its path nor its frames have."""
    stem = file_name(title.removesuffix(".json").removesuffix(".scene").removesuffix(".shift"))
    taken = {path.name.partition(".")[0] for path in folder.iterdir()}
    stem = stem.replace(".", "_")
    number = 1
    while f"{stem}-{number:03d}" in taken:
        number += 1
    return folder / f"{stem}-{number:03d}{ending}"


def frames_of(path: Path) -> Path:
    """Where the command leaves the frames of a film."""
    return path.with_suffix(".frames")
