"""The editor's files: those it opens while the window goes on, and those it opened before."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapeshift.app.camera_files import camera_reading, in_scene
from shapeshift.app.editor.options import Options
from shapeshift.app.editor.panels.empty_panel import OPEN, draw_empty
from shapeshift.app.editor.panels.open_row import NEW, OpenRow
from shapeshift.app.editor.panels.widgets.boxes import PathBox
from shapeshift.app.editor.panels.widgets.overlay_renderer import Textures
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.open_scene import first_look, opened_scene, repair_notes
from shapeshift.app.editor.state.files.opened import OpenedFiles, Opener, ReadModel, read_files
from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.state.user.recent_pictures import RecentPictures
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.window import Drop, Event, KeyDown
from shapeshift.app.paths import TOUCH, config_folder
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.scene import Scene


@dataclass(frozen=True)
class OpenActions:
    """What opening a scene asks of the window that shows it."""

    upload: Callable[[Scene], None]  # gives it to the device; raises BadFile where it does not fit
    before_losing: Callable[[Callable[[], None]], None]  # does it, first asking where work is lost
    opened: Callable[[], None]  # the state has another scene


class Files:
    """Opens what is dropped or chosen; the scene changes when all of it has been read."""

    def __init__(
        self, state: EditorState, viewpoint: Viewpoint, options: Options, actions: OpenActions,
        textures: Textures,
    ) -> None:  # fmt: skip
        self._state, self._viewpoint = state, viewpoint
        self._options, self._actions = options, actions
        self._opener = Opener()
        self.recent: RecentFiles | None = None  # None: nothing is kept
        self.pictures: RecentPictures | None = None  # of those
        self.picture_due: Path | None = None  # what is open, of which a picture is wanted
        # Reads one scene, in the thread that opens; replaced where progress can be shown.
        self.read: ReadModel = lambda path, progress: state.read_model(path)
        self._row = OpenRow(textures)
        self._box = PathBox("Open a scene", "Open")

    @property
    def busy(self) -> bool:
        return self._opener.busy

    def open_soon(self, paths: tuple[Path, ...]) -> None:
        """Begins to read files; the window stays alive meanwhile."""
        reading, plain = camera_reading(self._options), self._options.reading()
        self._opener.start(
            paths, lambda paths, progress: read_files(paths, self.read, reading, progress, plain)
        )
        self._state.say(self._opener.note)

    def started(self, found: OpenedFiles) -> None:
        """The scene and cameras with which the window opens."""
        options = self._options
        if options.screenshot is None:
            self.recent = RecentFiles.read(config_folder())
            self.pictures = RecentPictures(config_folder())
            if options.scenes:
                self.remember_all(found)
        self.use_cameras(found, look_through=options.camera is not None)
        self._state.say(repair_notes(found))

    def ask(self) -> None:
        """Opens the box that takes a path; what is dropped meanwhile is opened as well."""
        self._box.ask()

    def new(self) -> None:
        """An empty scene, once nothing is lost by it."""
        self._actions.before_losing(self._show_nothing)

    def _show_nothing(self) -> None:
        self._state.open_sources((), Scene(()))
        self._actions.upload(Scene(()))
        self.picture_due = None
        self._state.messages.problems = []
        self._actions.opened()
        self._viewpoint.follow_cameras(None, False)

    def keep_picture(self, picture: np.ndarray) -> None:
        """Of what is open, (H, W, 3) display sRGB, for the list of recent files."""
        path, self.picture_due = self.picture_due, None
        if path is None or self.pictures is None or self.recent is None:
            return
        try:
            self.pictures.keep(path, picture, self.recent.paths)
        except OSError:
            self.pictures = None  # the list does without

    def asked(self) -> bool:
        """Whether the box is open."""
        return self._box.asking

    def handle_event(self, event: Event) -> bool:
        """True for Ctrl+O and Ctrl+N, and while the box is open for keys and what is dropped."""
        match event:
            case KeyDown(shortcut="o") if not self._box.asking:
                self.ask()
            case KeyDown(shortcut="n") if not self._box.asking:
                self.new()
            case KeyDown() if self._box.asking:
                pass
            case Drop() if self._box.asking:
                self._box.close()
                return False
            case _:
                return False
        return True

    def poll(self) -> bool:
        """Takes over what has been read; True while something is being read or looked for."""
        busy = poll_opener(self._state, self._opener, self._ask_and_show)
        return busy or self._box.browsing or self.picture_due is not None

    def _ask_and_show(self, found: OpenedFiles) -> None:
        if found.sources:
            self._actions.before_losing(lambda: self.show_opened(found))
        else:
            self.show_opened(found)

    def show_opened(self, found: OpenedFiles) -> None:
        """Shows what has been read; a scene that the device cannot hold leaves the old one."""
        state = self._state
        if found.sources:
            try:
                scene, edited = opened_scene(found)
                self._actions.upload(scene)
            except BadFile as error:
                state.problem = str(error)
                return
            state.open_sources(found.sources, scene, first_look(found), edited)
            state.messages.problems = []
            self._actions.opened()
        self.use_cameras(found, look_through=not found.sources)
        self.remember_all(found)
        self._state.say(repair_notes(found))

    def use_cameras(self, found: OpenedFiles, look_through: bool) -> None:
        """The cameras of a file for n and p; of a scene without any there are none."""
        cameras, objects = found.cameras, self._state.scene.objects
        if cameras is None and found.floor is not None and not found.sources:
            cameras = found.floor
        if cameras is None and not found.sources:
            return
        if cameras is not None and objects:
            cameras = in_scene(cameras, objects[0].model)
        self._viewpoint.follow_cameras(cameras, look_through)

    def draw_row(self, ui_scale: float) -> None:
        """The buttons under the panel's title."""
        clicked, chosen = self._row.draw(self.recent, self.pictures, ui_scale)
        if clicked == OPEN:
            self.ask()
        elif clicked == NEW:
            self.new()
        elif chosen is not None:
            self.open_soon((chosen,))

    def draw_box(self, ui_scale: float) -> None:
        """The box for a path, while it is open."""
        if chosen := self._box.draw(self.recent.paths if self.recent else (), ui_scale):
            self.open_soon(chosen)

    def draw_empty(self, free: Box, ui_scale: float) -> Box | None:
        """What can be opened, while nothing is."""
        if self._state.scene.objects or self.busy:
            return None
        box, clicked = draw_empty(free, ui_scale)
        if clicked == OPEN:
            self.ask()
        elif clicked:
            self.open_soon((TOUCH,))
        return box

    def remember_all(self, found: OpenedFiles) -> None:
        """What was opened by name: the scene file, not what is in it."""
        inside = len(found.file.all_items) if found.file else 0
        if found.path is not None and inside > 0:
            self.remember(found.path)
        for source in found.sources[inside:]:
            self.remember(source.path)

    def remember(self, path: Path) -> None:
        """Puts a file first in the list of recent ones."""
        if self.recent is None:
            return
        try:
            self.recent.add(path)
            self.picture_due = path.absolute()
        except OSError as error:
            why = error.strerror
            self._state.messages.fail(
                said("The list of recent files cannot be kept: {why}.", why=why)
            )
            self.recent = None


def poll_opener(state: EditorState, opener: Opener, show: Callable[[OpenedFiles], None]) -> bool:
    """Gives what a thread has read to `show`, its failure to the messages; True while it reads."""
    if not opener.busy:
        return False
    name = opener.paths[0].name
    try:
        found = opener.poll()
    except (BadFile, OSError) as error:
        state.problem = str(error)
        state.say("")
    except MemoryError:
        state.problem = said("{name} needs more memory than there is.", name=name)
        state.say("")
    else:
        if found is not None:
            state.say("")
            show(found)
    if opener.busy:
        state.messages.hold(opener.note, time.perf_counter())
    return opener.busy
