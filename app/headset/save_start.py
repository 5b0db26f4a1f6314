"""Saves the scene, with the place of who wears the headset as its first look or without."""

from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.saving import Saving, free_path
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.paths import WorkFolders, config_folder
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import FirstView
from shapeshift.scene.pose import Pose

AHEAD_M = 1.0  # from the eye to what it looks at


def save_start(editor: EditorState, eye: Pose) -> bool:
    """eye: world_from_eye.  A file that this person has saved before is written over; else a new
    one is made in the folder of scenes.  False, and said why, where that cannot be.
    """
    ahead = -eye.matrix()[:3, 2]
    view = FirstView(three(eye.position), three(eye.position + AHEAD_M * ahead))
    view = edits.rounded(view)
    if not ObjectEdits(editor, None, lambda: None).edit(edits.look_from, view, what="first look"):
        return False
    return save_scene(editor)


def save_scene(editor: EditorState) -> bool:
    """The same with the first look that it has."""
    folder = WorkFolders.of().scenes
    saving = Saving(editor, OwnFiles(config_folder()), folder, lambda path: None)
    if saving.save():
        return True
    saving.cancel_name()  # nobody can type one here
    return saving.write(free_path(folder / editor.edited.name))
