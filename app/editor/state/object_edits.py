"""What a person does to the objects of the scene that is open: edit, copy, delete, undo."""

from collections.abc import Callable

from shapeshift.app.editor.state.arrange import as_it_stands, copy_offset, edit, redo, undo
from shapeshift.app.editor.state.camera.viewpoint import Viewpoint
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import said, said_deed
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.cameras.framing import model_points
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import SceneFile, SceneItem
from shapeshift.scene.pose import Pose


class ObjectEdits:
    """`count_changed` hears that there are more or fewer objects; `viewpoint` is of the window,
    None where there is none.
    """

    def __init__(
        self, state: EditorState, viewpoint: Viewpoint | None, count_changed: Callable[[], None]
    ) -> None:
        self.state, self._viewpoint, self.count_changed = state, viewpoint, count_changed
        self.typed: tuple[str, str] = ("", "")  # the chosen object, and its name as it is typed

    def edit(
        self, change: Callable[..., SceneFile], *values: object, what: str, together: str = "",
        made_of: str = "",
    ) -> bool:  # fmt: skip
        """Does an edit of scene/document/edits.py; where it cannot be done False, and says why.

        made_of: name of the object of which all is made that comes.
        """
        state, before = self.state, self.state.edited.file
        try:
            file = change(before, *values)
            known = {item.name for item in before.all_items}
            come = [item.name for item in file.all_items if item.name not in known]
            edit(state, file, what, together, dict.fromkeys(come * bool(made_of), made_of))
        except ValueError as error:  # BadFile is one
            self.state.messages.fail(str(error))
            return False
        return True

    def change(self, item: SceneItem, what: str, together: str = "", **values: object) -> bool:
        """Other values of an object's fields."""
        return self.edit(
            lambda file: edits.change(file, item.name, **values), what=what, together=together
        )

    def keep_standing(self) -> None:
        """Where everything is now, and its x, is where it starts."""
        self.edit(lambda file: as_it_stands(self.state), what="keep as it stands")

    def duplicate(self) -> None:
        """A copy beside the chosen object, which is chosen then."""
        state, name = self.state, self.state.chosen
        index = state.chosen_index
        if index is None:
            return
        obj = state.scene.objects[index]
        by = copy_offset(obj, model_points(obj.model)[0])
        known = {item.name for item in state.edited.file.all_items}
        pose = obj.world_from_object

        def beside(file: SceneFile) -> SceneFile:
            """The copy stands by what is seen, wherever that may have gone since the start."""
            file = edits.duplicate(file, name, by)
            copy = next(item.name for item in file.items if item.name not in known)
            file = edits.set_pose(file, copy, Pose(pose.position + by, pose.wxyz))
            return edits.set_x(file, copy, obj.x)

        if self.edit(beside, what=f"copy {name}", made_of=name):
            state.chosen = next(i.name for i in state.edited.file.items if i.name not in known)
            self.count_changed()

    def delete(self) -> None:
        if self.state.chosen_index is not None:
            name = self.state.chosen
            if self.edit(edits.remove, name, what=f"delete {name}"):
                self.count_changed()

    def undo(self) -> None:
        self._step(undo, said("Undone: {what}"), said("Nothing to be undone"))

    def redo(self) -> None:
        self._step(redo, said("Done again: {what}"), said("Nothing to be done again"))

    def _step(self, step: Callable, words: str, nothing: str) -> None:
        count = len(self.state.scene.objects)
        try:
            what = step(self.state)
        except BadFile as error:
            self.state.say(str(error))
            return
        self.state.say(words.format(what=said_deed(what)) if what else nothing)
        if len(self.state.scene.objects) != count:
            self.count_changed()
