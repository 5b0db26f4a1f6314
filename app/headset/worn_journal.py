"""What is done in a headset, kept as on a desk and in the same place, and offered at a next start.

Hands move things without editing the scene: "Put back" knows where they were.  So the journal gets,
as one step more, the scene as it stands, once a second.
"""

import math
import time
from pathlib import Path

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.boxes import answer_row
from shapeshift.app.editor.state.arrange import stands_elsewhere_at
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.saving import Saving
from shapeshift.app.editor.state.user.own_files import OwnFiles
from shapeshift.app.editor.texts.table import said
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.app.editor.window.recovering import ANSWERS, Recovering
from shapeshift.app.paths import WorkFolders, config_folder, is_bundled
from shapeshift.scene.document import edits
from shapeshift.scene.document.scene_file import SceneFile

EVERY_S = 1.0  # between two looks at where things stand


class WornJournal:
    """The journal of one scene, as long as that is open in the headset."""

    def __init__(self, editor: EditorState, folder: Path | None) -> None:
        """folder: of journals; None: nothing is kept, as in a run that is measured."""
        self._editor = editor
        self._standing: SceneFile | None = None
        self._looked_s = -math.inf
        saving = Saving(editor, OwnFiles(config_folder()), WorkFolders.of().scenes, lambda _: None)
        self._recovering = Recovering(editor, saving, lambda scene: None, self._taken_back)
        if folder is not None:
            self._recovering.begin(Journal(editor, folder, self._stands), Hooks())
        if self.offers:
            editor.say(said("The panel offers unsaved work of an earlier start."), 9.0)

    def __enter__(self) -> "WornJournal":
        return self

    def __exit__(self, *_: object) -> None:
        """The scene is left: what is not saved is offered when it is opened again."""
        self._looked_s = -math.inf
        self._recovering.each_frame()
        self._recovering.close()

    @property
    def offers(self) -> bool:
        """Whether there is unsaved work that nobody has said anything about."""
        return self._recovering.asked()

    def each_frame(self) -> None:
        """Keeps what was done, and takes over what has been read."""
        self._recovering.each_frame()

    def draw(self, ui_scale: float) -> None:
        """A section of the panel: what there is, and three buttons."""
        work = self._recovering.work
        if work is None:
            return
        imgui.push_text_wrap_pos(0)
        for line in self._recovering.lines(work):
            imgui.text_unformatted(line)
        imgui.pop_text_wrap_pos()
        clicked = answer_row(ANSWERS, ui_scale)
        if clicked:
            self._recovering.answer(clicked)

    def answer(self, word: str) -> None:
        """One of ANSWERS."""
        self._recovering.answer(word)

    def _taken_back(self) -> None:
        self._editor.follow_world()

    def _stands(self) -> SceneFile | None:
        """The scene with things where hands have left them; None: where it says.

        Our own scenes are there to be played with: nothing of that is work.
        """
        now_s = time.perf_counter()
        if now_s - self._looked_s < EVERY_S:
            return self._standing
        self._looked_s, path = now_s, self._editor.edited.path
        file = self._editor.edited.file
        if path is None or is_bundled(path):
            return None
        for obj in self._editor.scene.objects:
            item = edits.item_named(file, obj.name)
            if stands_elsewhere_at(obj, item):
                try:
                    file = edits.set_pose(file, obj.name, obj.world_from_object)
                except ValueError:
                    continue  # it has flown off
        if file is self._editor.edited.file:
            self._standing = None
        elif self._standing is None or edits.changes(self._standing, file):
            self._standing = file
        return self._standing
