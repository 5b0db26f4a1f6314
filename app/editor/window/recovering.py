"""Work that a killed window has left: a box offers it, a thread reads what it needs, it is back."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.boxes import answer_row, question_box
from shapeshift.app.editor.state.arrange import go_to
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.edited_file import ModelKey
from shapeshift.app.editor.state.files.journal import Journal
from shapeshift.app.editor.state.files.left_work import LeftWork, Restoring, left_names, left_work
from shapeshift.app.editor.state.files.opened import Source
from shapeshift.app.editor.state.files.saving import Saving
from shapeshift.app.editor.texts.table import said, said_deed
from shapeshift.app.editor.window.hooks import Hooks
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.scene import Scene

MOST_DEEDS = 6  # that the box names
ANSWERS = ("Take it back", "Discard", "Later")


class Recovering:
    """The journal of a window, and what another one has left of the same scene."""

    def __init__(
        self, state: EditorState, saving: Saving, upload: Callable[[Scene], None],
        taken_back: Callable[[], None],
    ) -> None:  # fmt: skip
        """upload: gives a scene to the device, and raises BadFile where it does not fit."""
        self._state, self._saving = state, saving
        self.journal: Journal | None = None  # nothing is kept
        self._upload, self._taken_back = upload, taken_back
        self.work: LeftWork | None = None  # that is offered
        self._restoring: Restoring | None = None
        self._thread = ThreadPoolExecutor(1, "recovering")
        self._reading: Future[dict[ModelKey, Source]] | None = None
        self._first = True

    def begin(self, journal: Journal, hooks: Hooks) -> None:
        """From now on all is kept; called when what lies beside the scene has been read."""
        self.journal, self._saving.refused = journal, journal.refuse
        self._saving.begins = journal.begin_saving
        hooks.opened.append(self.opened)
        self.opened()

    def asked(self) -> bool:
        """Whether the box is open."""
        return self.work is not None and self._reading is None

    def opened(self) -> None:
        """Another scene: what is left of it is offered, what of others is told at the start."""
        if self.journal is None:
            return
        self._let_go()
        self.journal.opened()
        problems: list[str] = []
        self.work = left_work(self._state, self.journal.folder, problems)
        if self._first and (names := left_names(self._state, self.journal.folder)):
            words = said("Unsaved work is kept of {names}: open that, and it is offered.")
            problems.append(words.format(names=", ".join(names)))
        self._first = False
        if self.work is not None and (path := self._state.edited.path) is not None:
            if self.work.has_written(path):
                self._saving.own(path)
        if self.work is not None and self.work.is_saved:
            names = ", ".join(path.name for path in self.work.saving)
            self._state.say(
                said("All of it was saved before the program ended: {names}.", names=names)
            )
            self.work.file.remove()
            self.work = None
        for problem in problems:
            self._state.problem = problem

    def _let_go(self) -> None:
        if self.work is not None:
            self.work.file.close()
        self.work, self._restoring, self._reading = None, None, None

    def each_frame(self) -> bool:
        """Keeps what was edited, and takes over what has been read; True while that goes on."""
        if self.journal is None:
            return False
        if self._reading is not None and self._reading.done():
            self._take_back()
        waits = self.journal.follow(time.perf_counter())
        return waits or self._reading is not None

    def status(self) -> str:
        """Why nothing is kept, as long as that is so."""
        return self.journal.words if self.journal is not None else ""

    def draw(self, ui_scale: float) -> None:
        """The box, while there is something to offer."""
        work = self.work
        if work is None or not self.asked() or not question_box("Unsaved work", ui_scale):
            return
        imgui.push_text_wrap_pos(0)
        for line in self.lines(work):
            imgui.text_unformatted(line)
        imgui.pop_text_wrap_pos()
        clicked = answer_row(ANSWERS, ui_scale)
        if clicked:
            imgui.close_current_popup()
            self.answer(clicked)
        imgui.end_popup()

    def lines(self, work: LeftWork) -> list[str]:
        """What the box says."""
        when = time.strftime("%Y-%m-%d %H:%M", time.localtime(work.file.modified_s))
        lines = [said("{name} has work of {when} that was not saved:", name=work.name, when=when)]
        deeds = [said_deed(what) for what in work.deeds]
        more = [said("{count} more", count=len(deeds) - MOST_DEEDS)] * (len(deeds) > MOST_DEEDS)
        lines += [", ".join([*deeds[:MOST_DEEDS], *more])]
        path = self._state.edited.path
        if path is not None and work.has_written(path):
            late = [each.name for each in work.saving if not work.has_written(each)]
            lines.append(
                said(
                    "It was being saved: {name} has it already, {late} not yet.",
                    name=path.name, late=", ".join(late),
                )
            )  # fmt: skip
        elif work.stamp != self._state.edited.stamp:
            lines.append(
                said(
                    "The file was written by somebody else since. Taken back, the work is as it "
                    "was before that; saving asks for another name."
                )
            )
        if work.torn:
            lines.append(said("The last entry is torn: less than a second of work is missing."))
        return lines

    def answer(self, word: str) -> None:
        """One of ANSWERS."""
        work = self.work
        if work is None or word == "Later":
            self._let_go()
        elif word == "Discard":
            work.file.remove()
            self.work = None
        else:
            self._begin(work)

    def _begin(self, work: LeftWork) -> None:
        try:
            restoring = self._restoring = Restoring(self._state, work)
        except BadFile as error:
            self._say_failed(error)
            return
        wanted = restoring.wanted()
        self._reading = self._thread.submit(restoring.read, wanted, lambda *_: None)
        if wanted:
            self._state.say(said("Opening {names} \u2026", names=work.name))
        else:
            self._take_back()

    def _take_back(self) -> None:
        reading, restoring, work, state = self._reading, self._restoring, self.work, self._state
        self._reading = self._restoring = None
        if reading is None or restoring is None or work is None:
            return
        before = state.edited.history
        try:
            restoring.take_back(reading.result())
            try:
                self._upload(state.scene)
            except BadFile:
                go_to(state, before)
                raise
        except (BadFile, OSError, MemoryError) as error:
            self._say_failed(error)
            return
        assert self.journal is not None  # it has found the work
        self.journal.follow(time.perf_counter())
        if not self.journal.words:
            work.file.remove()  # it is in the journal of this window
        self._let_go()
        self._taken_back()
        state.say(said("It is back: {what}", what=said_deed(work.deeds[0]) if work.deeds else ""))

    def _say_failed(self, error: Exception) -> None:
        why = str(error).rstrip(".") or said("there is not memory enough")
        self._state.problem = said("The work cannot be taken back, and stays: {why}.", why=why)
        self._let_go()

    def close(self) -> None:
        """The window goes."""
        self._let_go()
        self._thread.shutdown(wait=False, cancel_futures=True)
        if self.journal is not None:
            self.journal.close()
