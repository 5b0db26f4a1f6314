"""What was read from files as what is shown: its scene, its document, its first look, in words."""

from dataclasses import replace
from pathlib import Path

from shapeshift.app.camera_files import camera_reading, in_scene
from shapeshift.app.document import file_at, placed
from shapeshift.app.editor.state.camera.framed import FirstLook
from shapeshift.app.editor.state.files.edited_file import (
    EditedFile,
    edited_from_file,
    edited_from_scene,
)
from shapeshift.app.editor.state.files.opened import OpenedFiles
from shapeshift.app.editor.state.scene_objects import scene_of
from shapeshift.app.errors import UsageError
from shapeshift.app.opening import ReadingOptions, sentence
from shapeshift.scene.cameras.framing import common_side
from shapeshift.scene.cameras.read_cameras import read_camera_list
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import scene_of as scene_of_file
from shapeshift.scene.scene import Scene
from shapeshift.scene.sections.section import SceneSection

MOST_NOTES = 2  # findings that the note at opening spells out; the status line has them all


def opened_scene(
    found: OpenedFiles, x: str = "", cuts: tuple[SceneSection, ...] = ()
) -> tuple[Scene, EditedFile]:
    """What is drawn of what was opened, and its file: each at its own x, or where the text x says.

    cuts: of all objects, in addition to those of a scene file.  Raises BadFile for a scene file
    whose objects cannot be as it says, UsageError for x.
    """
    scene, edited = _opened_at(found, x)
    if not cuts:
        return scene, edited
    try:
        file = edits.set_sections(edited.file, "", (*edited.file.sections, *cuts))
    except ValueError as error:
        raise UsageError(f"--section: {error}") from None
    edited.history = edits.History.of(file)  # asked for at the start: nothing to be undone
    if edited.path is None:
        edited.saved = file  # nor to be saved, where no file could have it
    return scene_of_file(file, edited.models_by_name()), edited


def _opened_at(found: OpenedFiles, x: str) -> tuple[Scene, EditedFile]:
    if found.file is None:
        scene = scene_of(found.sources)
        scene = Scene(placed(scene.objects, x)) if x else scene
        return scene, edited_from_scene(scene, found.sources)
    assert found.path is not None  # of the scene file
    file, inside = found.file, len(found.file.all_items)
    edited = edited_from_file(found.path, file, found.sources[:inside])
    for source in found.sources[inside:]:
        file = edits.add(file, edited.item(source))
        edited.history = edited.history.record(file, f"add {file.items[-1].name}")
    models = edited.models_by_name()
    if x:
        file = file_at(file, models, x)
        edited.history = edits.History.of(file)
    return scene_of_file(file, models), edited


def repair_notes(found: OpenedFiles) -> str:
    """What was repaired in the files and assumed about the cameras, a line each; "" = nothing."""
    findings = [finding for source in found.sources for finding in source.model.findings]
    lines = [sentence(finding) for finding in findings if finding.repaired]
    more = [f"and {len(lines) - MOST_NOTES} more."] if len(lines) > MOST_NOTES else []
    return "\n".join([*lines[:MOST_NOTES], *more, *found.notes])


def first_look(found: OpenedFiles) -> FirstLook:
    """What lies next to the first scene and says from where to look: a floor, cameras of a side."""
    if not found.sources:
        return FirstLook()
    model, home, front = found.sources[0].model, None, None
    if found.floor is not None:
        home = in_scene(found.floor, model).views[0]
    if found.cameras is not None:
        front = common_side(in_scene(found.cameras, model).views)
    return FirstLook(home, front)


def named_cameras(camera: Path | None, options: ReadingOptions, found: OpenedFiles) -> OpenedFiles:
    """With the cameras that are named instead of those beside the scene.  Raises BadFile."""
    if camera is None:
        return found
    cameras = read_camera_list(camera, camera_reading(options))
    return replace(found, cameras=cameras, notes=cameras.notes)
