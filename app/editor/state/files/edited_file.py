"""The scene file behind the window: what it says now, what it was, and where it is saved."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.parts.piece import Piece
from shapeshift.app.editor.state.regions import Regions
from shapeshift.app.film.window.timeline import Timeline
from shapeshift.app.paths import file_name
from shapeshift.runtime_models.model import Model, Stop
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.document import edits
from shapeshift.scene.document.edits import History
from shapeshift.scene.document.scene_file import ENDING, HULLS, SceneFile, SceneItem
from shapeshift.scene.document.write_scene_file import moved
from shapeshift.scene.inspection.marks_file import MarksFile
from shapeshift.scene.scene import Scene
from shapeshift.scene.selectors.selector import Lens

NO_MARKS = MarksFile()
ModelKey = tuple  # what makes two objects have the same model: path, mode, up, flip, part


@dataclass
class EditedFile:
    """Edits change `history`; a model that was read once stays in `sources`, for undo."""

    history: History
    saved: SceneFile  # as it was opened or lies there; an edit gives another object
    path: Path | None = None  # of the scene file; None: it is none yet
    saved_regions: tuple = ()  # the regions then
    saved_film: object = None  # the keys of a film
    saved_marks: MarksFile = NO_MARKS
    stamps: dict[Path, tuple] = field(default_factory=dict)  # of what lies beside it
    stamp: tuple = ()  # of the file when it was read or written here: changed by others since?
    sources: dict[ModelKey, Source] = field(default_factory=dict)
    pieces: dict[str, Piece] = field(default_factory=dict)  # by what stands for their models
    # Files of pieces that were written here: scene file and what is in them -> path and stamp
    packages: dict[tuple[Path, tuple], tuple[Path, tuple]] = field(default_factory=dict)
    _compared: tuple | None = None  # two files, and how they differ

    @property
    def file(self) -> SceneFile:
        return self.history.file

    @property
    def marks(self) -> MarksFile:
        """Marks and lengths, metres in the world of the window."""
        marks = self.history.marks
        return marks if isinstance(marks, MarksFile) else NO_MARKS

    @property
    def changed(self) -> bool:
        """Whether the file says something else than what lies on the disk."""
        return self._differences[0]

    @property
    def unsaved(self) -> bool:
        """Whether work would be lost; where a slider stands is none."""
        return self._differences[1]

    @property
    def _differences(self) -> tuple[bool, bool]:
        """Edited and unsaved; found once for each edit, however often it is asked."""
        known = self._compared
        if known is None or known[0] is not self.file or known[1] is not self.saved:
            known = self._compared = (self.file, self.saved, compared(self.saved, self.file))
        return known[2]

    def source(self, item: SceneItem) -> Source:
        """Where an object's model comes from: a file, or a piece that was cut in the window."""
        piece = self.pieces.get(item.model)
        return self.sources[key_of(item)] if piece is None else piece.source

    def model(self, item: SceneItem) -> Model:
        return self.source(item).model

    def models_by_name(self) -> dict[str, Model]:
        return {item.name: self.model(item) for item in self.file.all_items}

    def item(self, source: Source) -> SceneItem:
        """An object for what was read from a path of its own, at its first stop."""
        item = replace(item_of(source), x=first_stop(source.model).x)
        self.sources[key_of(item)] = source
        return item

    def record_regions(self, regions: Regions) -> None:
        """Makes what was done to the regions since the last call a step of the history."""
        if not regions.did:
            self.amend_regions(regions)
            return
        self.history = self.history.record(
            self.file, regions.did, regions.together, regions.kept, regions.bytes
        )
        regions.did = ""

    def record_film(self, timeline: Timeline) -> None:
        """Makes what was done to the keys of the film a step of the history."""
        if not timeline.did:
            self.history = self.history.amend(self.file, film=timeline.keys)
            return
        self.history = self.history.record(
            self.file, timeline.did, timeline.together, film=timeline.keys
        )
        timeline.did = ""

    def begin_with(self, **parts: object) -> None:
        """What lay beside the scene is there from the first step on: marks, film."""
        steps = tuple(replace(step, **parts) for step in self.history.steps)
        self.history = replace(self.history, steps=steps)

    def record_marks(self, marks: MarksFile, what: str, together: str = "") -> None:
        """Makes other marks or lengths a step of the history."""
        self.history = self.history.record(self.file, what, together, marks=marks)

    def amend_regions(self, regions: Regions) -> None:
        """Takes regions over that nobody's hand has changed: their objects have."""
        self.history = self.history.amend(self.file, regions.kept)
        regions.did = ""

    def refine(self, index: int, model: Model) -> None:
        """A finer level of detail of one object's model."""
        if index < len(self.file.all_items):
            key = key_of(self.file.all_items[index])
            self.sources[key] = replace(self.sources[key], model=model)

    @property
    def name(self) -> str:
        """For the title, and for saving."""
        if self.path is not None:
            return self.path.name
        first = self.file.all_items[0] if self.file.all_items else None
        if first is None or first is not self.file.background:
            return file_name(first.name if first else "") + ENDING
        return file_name(self.source(first).path.stem) + ENDING  # what it is the background of


def compared(saved: SceneFile, file: SceneFile) -> tuple[bool, bool]:
    """Whether they differ, and whether by more than where sliders stand."""
    if saved is file:
        return False, False
    changed = edits.changes(saved, file)
    names = ("floor_y", "view", "views", "gravity_m_s2", "appearance", "sky", "sections",
             "upright")  # fmt: skip
    scene = any(getattr(file, name) != getattr(saved, name) for name in names)
    return bool(changed) or scene, scene or any(change.fields != {"x"} for change in changed)


def first_stop(model: Model) -> Stop:
    """The stop with the smallest x; a scene without stops starts at 0."""
    return min(model.stops, key=lambda stop: stop.x, default=Stop("", 0.0))


def key_of(item: SceneItem) -> ModelKey:
    return (item.model, item.mode, item.up, item.flip, item.part)


def edited_from_file(path: Path, file: SceneFile, sources: Sequence[Source]) -> EditedFile:
    """A scene file that was opened, and the models of its objects in their order."""
    by_key = {key_of(item): source for item, source in zip(file.all_items, sources, strict=True)}
    stamp = stamp_of(path)
    return EditedFile(History.of(file), file, path, stamp=stamp, sources=by_key)


def edited_from_scene(scene: Scene, sources: Sequence[Source]) -> EditedFile:
    """What was opened without a scene file, as one that is not saved yet."""
    items, by_key = [], {}
    for number, obj in enumerate(scene.objects):
        source = sources[number] if number < len(sources) else Source(Path(obj.name), obj.model)
        item = replace(
            item_of(source),
            name=obj.name,
            position=three(obj.world_from_object.position),
            wxyz=four(obj.world_from_object.wxyz),
            x=obj.x,
        )
        items.append(item)
        by_key[key_of(item)] = source
    file = SceneFile(folder=Path.cwd(), items=tuple(items))
    return EditedFile(History.of(file), file, sources=by_key)


def item_of(source: Source) -> SceneItem:
    """An object for what was opened from a path of its own."""
    path, reading = source.path, source.reading
    name = " ".join((path.name if path.is_dir() else path.stem).split())
    printable = "".join(letter for letter in name if letter.isprintable())
    return SceneItem(
        name=printable[: edits.LONGEST_NAME] or "object",
        model=path.absolute().as_posix(),
        mode=reading.mode,
        up=reading.up,
        flip=reading.flip,
    )


def stamp_of(path: Path) -> tuple:
    """What changes when somebody else writes the file; () where there is none."""
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_mtime_ns, found.st_size


def beside(file: SceneFile, folder: Path) -> SceneFile:
    """The file as it is written into a folder: what lies below that is named from there, so that
    both can be moved together; the rest keeps its place.
    """
    before = file.folder
    for item in file.all_items:
        values = {"model": below(moved(item.model, before, folder), folder)}
        if item.collider not in (None, HULLS):
            values["collider"] = below(moved(item.collider, before, folder), folder)
        file = edits.change(file, item.name, **values)
    return replace(file, folder=folder)


def below(text: str, folder: Path) -> str:
    path, root = Path(text), folder.absolute()
    if path.is_absolute() and path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    return text


def with_regions(file: SceneFile, selectors: Sequence[Sequence]) -> SceneFile:
    """With the regions of each object, in the file's order, as its selectors; a lens is nobody's
    but the eye's.
    """
    for item, more in zip(file.all_items, selectors, strict=True):
        kept = tuple(selector for selector in more if not isinstance(selector, Lens))
        if kept:
            file = edits.change(file, item.name, selectors=(*item.selectors, *kept))
    return file
