"""Scenes that can be opened without taking the headset off: those opened before, and our own."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapeshift.app.document import Document, control_of_text, file_at, pace_of
from shapeshift.app.editor.panels.empty_panel import DEMO_LABEL
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import EditedFile, edited_from_file
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.state.user.recent_pictures import RecentPictures
from shapeshift.app.editor.texts.table import said
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, open_model, progress_after, sentence
from shapeshift.app.paths import TOUCH, is_bundled
from shapeshift.app.scene_files import open_scene_file
from shapeshift.app.terminal import say
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.colliders.collider_files import colliders_of
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, is_scene_file
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.world.settle import begin
from shapeshift.scene.world.world import World

Opened = tuple[Document, EditorState]
Open = Callable[[Path], Opened]
PICTURE_AFTER = 45  # frames that a scene is seen before its picture is kept


class SceneShelf:
    """Reads one scene at a time in a thread; the session goes on meanwhile.

    folder: of the settings; None: no list is there.  keeps: what is opened is put into the list.
    """

    def __init__(
        self, folder: Path | None = None, options: ReadingOptions | None = None,
        shown: Path = TOUCH, keeps: bool = False,
    ) -> None:  # fmt: skip
        options = options or ReadingOptions()
        self._open: Open = lambda path: open_xr(path, options)
        self._keeps, self.shown = keeps, shown
        self.recent = RecentFiles.read(folder) if folder is not None else None
        self.pictures = RecentPictures(folder) if folder is not None else None
        self.opening: Path | None = None
        self._future: Future[Opened] | None = None
        self._frames = 0  # that the scene was seen
        self._remember()

    @property
    def rows(self) -> list[tuple[str, Path]]:
        """What stands on each row, and the file that it opens."""
        before = self.recent.paths if self.recent is not None else ()
        rows = [(path.name or str(path), path) for path in before if not is_bundled(path)]
        return [*rows, (said(DEMO_LABEL), TOUCH)]

    def open(self, path: Path) -> None:
        """Begins to read; while another scene is read nothing happens."""
        if self.opening is not None:
            return
        future: Future[Opened] = Future()
        self.opening, self._future = path, future

        def work() -> None:
            try:
                future.set_result(self._open(path))
            except BaseException as error:  # handed to the session's thread
                future.set_exception(error)

        threading.Thread(target=work, name="opening", daemon=True).start()

    def poll(self, fail: Callable[[str], None]) -> Opened | None:
        """What was read, once; `fail` hears in a sentence why nothing was."""
        future, path = self._future, self.opening
        if future is None or path is None or not future.done():
            return None
        self._future = self.opening = None
        try:
            opened = future.result()
        except (BadFile, UsageError, OSError) as error:
            fail(str(error))
            return None
        except MemoryError:
            fail(said("{name} needs more memory than there is.", name=path.name))
            return None
        self.shown, self._frames = path, 0
        self._remember()
        return opened

    def remember(self, path: Path | None) -> None:
        """The scene that is shown has been saved there."""
        if path is not None:
            self.shown = path
            self._remember()

    def _remember(self) -> None:
        """The file that is shown comes first in the list."""
        if self._keeps and self.recent is not None and not is_bundled(self.shown):
            try:
                self.recent.add(self.shown)
            except OSError:
                self._keeps = False  # the list stays as it was

    def saw(self, picture: Callable[[], np.ndarray]) -> None:
        """Once a frame; `picture` reads what an eye sees, (H, W, 3) display sRGB."""
        self._frames += 1
        due = self._keeps and self._frames == PICTURE_AFTER and not is_bundled(self.shown)
        if due and self.pictures is not None and self.recent is not None:
            try:
                self.pictures.keep(self.shown, picture(), self.recent.paths)
            except OSError:
                pass  # the list does without


# Opens what is to be seen in a headset as a world of objects: a scene file, or one scene alone.

HZ = 90  # steps of the physics a second


def open_xr(path: Path, options: ReadingOptions, x: str = "") -> tuple[Document, EditorState]:
    """The scene, and what edits it over its world, read with progress and findings on stderr.

    x: where the sliders stand, in words; "": as the scene says.  Raises BadFile, UsageError.
    """
    if not is_scene_file(path):
        return open_alone(path, options, x)
    file, models, scene = open_scene_file(path, options)
    file = file_at(file, models, x) if x else file
    with progress_after(PATIENCE_S) as progress:
        colliders = colliders_of(file, models, progress, rough=True)  # exact ones come
    world = World(file, models, colliders, hz=HZ)
    begin(world)
    for finding in world.findings:
        say(sentence(finding))
    sources = [Source(path, models[item.name]) for item in file.all_items]
    return Document(scene, file), editor_of(world, edited_from_file(path, file, sources))


def open_alone(path: Path, options: ReadingOptions, x: str = "") -> tuple[Document, EditorState]:
    """One model that nothing can touch, where its file has it."""
    model = open_model(path, options)
    first = min((stop.x for stop in model.stops), default=0.0)
    start = control_of_text(x, model.stops, pace=pace_of(model)) if x else first
    item = SceneItem(name=path.stem or path.name, model=str(path), x=start, static=True)
    file = SceneFile(folder=Path(), items=(item,), gravity_m_s2=0.0)
    world = World(file, {item.name: model}, {}, hz=HZ)
    edited = replace(edited_from_file(path, file, [Source(path, model)]), path=None)
    document = Document(Scene((SceneObject(item.name, model, x=start),)))
    return document, editor_of(world, edited)


def editor_of(world: World, edited: EditedFile) -> EditorState:
    """The editor's state over a world that lives already: what the panel's sections work on."""
    editor = EditorState(read_model)
    sources = tuple(edited.source(item) for item in edited.file.all_items)  # two may be of one file
    editor.open_sources(sources, world.drawn(), None, edited)
    editor.bodies.adopt(world, edited)
    editor.most_sliders = 1  # on the panel: the chosen object's
    editor.follow_world()
    return editor
