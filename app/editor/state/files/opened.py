"""Opening files while the window goes on: a thread reads, the window asks whether it is done."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path

from shapeshift.app.editor.texts.table import said
from shapeshift.app.opening import PATIENCE_S, progress_after
from shapeshift.app.scene_files import print_findings
from shapeshift.runtime_models.model import BadFile, Model
from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.read_scene import describe
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.read_output_folder import newest_cloud
from shapeshift.scene.cameras.camera_list import CameraList, CameraReading
from shapeshift.scene.cameras.read_cameras import (
    SPLITS,
    find_cameras,
    find_floor,
    is_cameras,
    read_camera_list,
)
from shapeshift.scene.captures.colmap_tables import TABLES, find_model
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.document.scene_file import SceneFile, is_scene_file, read_models

Progress = Callable[[str, float], None]  # what is being done, part done 0..1
ReadModel = Callable[[Path, Progress | None], Model]


@dataclass(frozen=True)
class Source:
    """A scene as it was opened: where from, and what `launch.py info` says about it."""

    path: Path
    model: Model
    facts: dict = field(default_factory=dict)
    reading: Reading = field(default_factory=Reading)  # how it was read


@dataclass(frozen=True)
class OpenedFiles:
    """What the files hold that were dropped or named together."""

    sources: tuple[Source, ...] = ()  # of a scene file: its objects, the background first
    file: SceneFile | None = None  # the scene file that was among them
    path: Path | None = None  # of the scene file
    cameras: CameraList | None = None
    floor: CameraList | None = None  # where to stand, of splatapult's NAME_vr.json
    notes: tuple[str, ...] = ()


def read_files(
    paths: Sequence[Path],
    read_model: ReadModel,
    reading: CameraReading,
    progress: Progress | None,
    plain: Reading | None = None,
    beside: bool = True,
) -> OpenedFiles:
    """Reads scenes and files of cameras, told apart by what is in them.  Raises BadFile, OSError.

    `plain` is how models are read.  Cameras that lie with the first scene are read too unless
    others were named, unless not `beside`; what is wrong with those is a note.
    """
    plain = plain or Reading()
    scene_files = [path for path in paths if is_scene_file(path)]
    if len(scene_files) > 1:
        raise BadFile(
            f"{scene_files[0].name} and {scene_files[1].name} are two scene files; open one, then "
            "add what else is wanted."
        )
    file, sources = read_scene(scene_files[0], plain, progress) if scene_files else (None, [])
    camera_paths = [path for path in paths if path not in scene_files and means_cameras(path)]
    for path in paths:
        if path not in (*camera_paths, *scene_files):
            model = read_model(path, progress)
            sources.append(Source(path, model, describe(model, path), plain))
    cameras = [read_camera_list(path, reading) for path in camera_paths]
    floors = [c for c in cameras if c.format == "splatapult floor"]
    lists = [c for c in cameras if c not in floors]
    notes = [note for found in cameras for note in found.notes]
    if sources and file is None and beside:
        first = sources[0].path
        for found, find in ((lists, find_cameras), (floors, find_floor)):
            near = None if found else find(first)
            if near is not None:
                more, note = read_beside(near, reading)
                found += more
                notes += note
    scene_file = scene_files[0] if scene_files else None
    return OpenedFiles(tuple(sources), file, scene_file, last(lists), last(floors), tuple(notes))


def read_scene(
    path: Path, plain: Reading, progress: Progress | None
) -> tuple[SceneFile, list[Source]]:
    """A scene file and the model of each of its objects; findings go to stderr."""
    if plain.mode or plain.up or plain.flip:
        raise BadFile(f"{path.name} says for each object how layers add up and which way is up.")
    file = read_scene_file(path)
    with nullcontext(progress) if progress else progress_after(PATIENCE_S) as shown_progress:
        file, models = read_models(file, replace(plain, progress=shown_progress))
    print_findings(models)
    facts: dict[tuple, dict] = {}
    counted: set[Path] = set()
    sources = []
    for item in file.all_items:
        at, model = file.path(item.model), models[item.name]
        key = (at, item.part)
        facts[key] = facts[key] if key in facts else describe(model, at)
        if at in counted:  # bytes count once, however many objects share a file
            facts[key] = facts[key] | {"bytes": 0}
        counted.add(at)
        sources.append(Source(at, model, facts[key], Reading(item.mode, item.up, item.flip)))
    return file, sources


def read_beside(path: Path, reading: CameraReading) -> tuple[list[CameraList], list[str]]:
    """Cameras nobody asked for: at most one list, and a note where they cannot be read.

    Their own notes are shown once somebody steps to them.
    """
    try:
        cameras = read_camera_list(path, reading)
    except BadFile as error:
        return [], [f"The cameras beside it cannot be read: {error}"]
    return [cameras], []


def means_cameras(path: Path) -> bool:
    """Whether a file or folder is for its cameras rather than a scene."""
    if path.is_dir():
        if (path / MANIFEST).exists() or newest_cloud(path) is not None:
            return False
        capture = [path / "transforms.json", path / f"transforms_{SPLITS[0]}.json"]
        return find_model(path) is not None or any(file.is_file() for file in capture)
    if path.suffix in (".bin", ".txt"):
        return path.stem in TABLES
    return path.suffix.lower() == ".json" and path.is_file() and is_cameras(path)


def last(found: list[CameraList]) -> CameraList | None:
    return found[-1] if found else None


class Opener:
    """One reading at a time, in a thread that the program's end does not wait for."""

    def __init__(self) -> None:
        self._future: Future | None = None
        self._paths: tuple[Path, ...] = ()
        self._next: tuple | None = None
        self._progress = ("", 0.0)

    @property
    def busy(self) -> bool:
        return self._future is not None

    @property
    def paths(self) -> tuple[Path, ...]:
        return self._paths

    @property
    def note(self) -> str:
        """What is being opened, and how far it is."""
        names = ", ".join(path.name or str(path) for path in self._paths)
        what, part = self._progress
        words = said("Opening {names} \u2026", names=names)
        return words + (f" {part:.0%}" if what and part > 0 else "")

    def start(
        self, paths: tuple[Path, ...], read: Callable[[tuple[Path, ...], Progress], OpenedFiles]
    ) -> None:
        """Begins; while another reading is under way, after that one, whose result is forgotten."""
        if self.busy:
            self._next = (paths, read)
            return
        self._paths, self._progress = paths, ("", 0.0)
        future = self._future = Future()

        def work() -> None:
            try:
                future.set_result(read(paths, self._show_progress))
            except BaseException as error:  # handed to the window's thread, which raises it again
                future.set_exception(error)

        threading.Thread(target=work, name="opening", daemon=True).start()

    def poll(self) -> OpenedFiles | None:
        """The result, once; raises what the reading raised."""
        if self._future is None or not self._future.done():
            return None
        future, self._future = self._future, None
        if self._next is not None:
            wanted, self._next = self._next, None
            self.start(*wanted)
            return None
        return future.result()

    def _show_progress(self, what: str, part: float) -> None:
        self._progress = (what, part)
