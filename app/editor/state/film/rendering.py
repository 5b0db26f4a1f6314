"""A film of the timeline, drawn by the program's own command beside the window."""

from pathlib import Path

from shapeshift.app.drawing import make_folder
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.saving import unsaved
from shapeshift.app.editor.state.film.program_child import ChildWork, ProgramChild
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.paths import file_name
from shapeshift.scene.film.film_file import ENDING, write_film_file

VIDEOS = (".mp4", ".webm", ".webp", ".gif")


class Rendering(ChildWork):
    """The choices, and the one film that may be under way."""

    def __init__(self, state: EditorState, folder: Path) -> None:
        super().__init__()
        self._state, self._folder = state, folder
        self.ending = VIDEOS[0]
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


def scene_on_disk(state: EditorState) -> tuple[Path, list[str]]:
    """The file that shows what the window shows, and the options it is read with.

    Raises UsageError where it has to be saved first.
    """
    if not state.scene.objects:
        raise UsageError("nothing is open.")
    if unsaved(state):
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
