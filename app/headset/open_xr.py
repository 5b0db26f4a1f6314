"""Opens what is to be seen in a headset as a world of objects: a scene file, or one scene alone."""

from dataclasses import replace
from pathlib import Path

from shapeshift.app.document import Document, control_of_text, file_at, pace_of
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import EditedFile, edited_from_file
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.opening import PATIENCE_S, ReadingOptions, open_model, progress_after, sentence
from shapeshift.app.scene_files import open_scene_file
from shapeshift.app.terminal import say
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.colliders.collider_files import colliders_of
from shapeshift.scene.document.scene_file import SceneFile, SceneItem, is_scene_file
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.world.world import World

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
        colliders = colliders_of(file, models, progress)
    world = World(file, models, colliders, hz=HZ)
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
    editor.open_sources(tuple(edited.sources.values()), world.drawn(), None, edited)
    editor.bodies.adopt(world, edited)
    editor.most_sliders = 1  # on the panel: the chosen object's
    editor.follow_world()
    return editor
