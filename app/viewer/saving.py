"""Saving the scene that is open, and asking before something is lost: the two boxes for that."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from app.paths import plain
from app.viewer.document import beside, stamp_of, with_regions
from scene.scene_file import ENDING, FAR_M, SceneFile
from scene.write_scene_file import write_scene_file

if TYPE_CHECKING:
    from app.viewer.stage import Stage
    from app.viewer.viewer import Viewer

Vec = imgui.ImVec2
FOLDER = "scenes"  # beside the folder of the pictures: where a first name is proposed
SAVE, LOSE = "Save the scene", "Changes are not saved"
WIDTH = 460.0  # logical pixels
LONGEST_PATH = 1000


class Saving:
    """What is asked now, and what is done once it has been answered."""

    def __init__(self, viewer: "Viewer") -> None:
        self._viewer = viewer
        self._name = ""  # as it is typed; "" = the box is not open
        self._taken = False  # a file of that name is there, and nobody has said to replace it
        self._then: Callable[[], None] | None = None  # what waits for an answer

    @property
    def asking(self) -> bool:
        return bool(self._name) or self._then is not None

    def save(self) -> bool:
        """Writes to where it was opened or saved before, else asks where; True when it did."""
        document = self._viewer.stage.document
        if document.path is None:
            self.ask_name()
            return False
        if document.stamp != stamp_of(document.path):  # somebody else has written it since
            self._name, self._taken = str(document.path), True
            return False
        return self.write(document.path)

    def ask_name(self) -> None:
        """Opens the box that asks for a name; nothing that is there is replaced unasked."""
        viewer = self._viewer
        path = viewer.stage.document.path
        if path is None:
            path = viewer.options.pictures.parent / FOLDER / viewer.stage.document.name
        self._name, self._taken = str(path), False

    def named(self, text: str, replace: bool = False) -> bool:
        """Saves under a name that was typed; a file that is there is asked about first."""
        path = plain(text.strip())
        if not path.name:
            return False
        if not path.name.lower().endswith(ENDING):
            path = path.with_name(path.name.removesuffix(".json") + ENDING)
        document = self._viewer.stage.document
        own = document.path is not None and path.absolute() == document.path.absolute()
        untouched = own and document.stamp == stamp_of(path)
        if path.exists() and not untouched and not replace:
            self._name, self._taken = str(path), True
            return False
        return self.write(path)

    def write(self, path: Path) -> bool:
        """Writes the file; what is wrong is said in the box for problems."""
        stage = self._viewer.stage
        document = stage.document
        try:
            file = filed(document.file, stage, path)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_scene_file(file, path)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            stage.problem = f"{path.name} cannot be saved: {reason}."
            return False
        self._name = ""
        document.path, document.stamp = path, stamp_of(path)
        document.saved, document.saved_regions = document.file, stage.regions.kept
        self._viewer.files.remember(path)
        self._viewer.say(f"Saved {path}")
        self._go_on()
        return True

    def before_losing(self, then: Callable[[], None]) -> None:
        """Does it at once, or after a question where changes would be lost."""
        if unsaved(self._viewer.stage):
            self._then = then
        else:
            then()

    def answer(self, word: str) -> None:
        """One of Save, Discard, Cancel."""
        if word == "Save":
            self.save()
        elif word == "Discard":
            self._go_on()
        else:
            self._then = None

    def _go_on(self) -> None:
        then, self._then = self._then, None
        if then is not None:
            then()

    def cancel_name(self) -> None:
        self._name, self._then = "", None

    # ---- the boxes

    def draw(self, ui_scale: float) -> None:
        """Whichever box is open."""
        if self._name:
            if box(SAVE, ui_scale):
                self._draw_name(ui_scale)
                imgui.end_popup()
        elif self._then is not None and box(LOSE, ui_scale):
            self._draw_lose(ui_scale)
            imgui.end_popup()

    def _draw_name(self, ui_scale: float) -> None:
        imgui.push_item_width(-1)
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        flags = imgui.InputTextFlags_.enter_returns_true
        entered, name = imgui.input_text("##path", self._name, flags)
        imgui.pop_item_width()
        if name != self._name:
            self._name, self._taken = name[:LONGEST_PATH] or " ", False
        if self._taken:
            imgui.push_text_wrap_pos(0)
            imgui.text_unformatted(f"{Path(self._name).name} is there already.")
            imgui.pop_text_wrap_pos()
        label = "Replace it" if self._taken else "Save"
        clicked = answer_row((label, "Cancel"), ui_scale)
        if clicked == label or (entered and not self._taken):
            self.named(self._name, replace=self._taken)
        elif clicked == "Cancel":
            self.cancel_name()
        if not self._name:
            imgui.close_current_popup()

    def _draw_lose(self, ui_scale: float) -> None:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(
            f"{self._viewer.stage.document.name} has changes that are not saved."
        )
        imgui.pop_text_wrap_pos()
        clicked = answer_row(("Save", "Discard", "Cancel"), ui_scale)
        if clicked:
            imgui.close_current_popup()
            self.answer(clicked)


def box(name: str, ui_scale: float) -> bool:
    """Opens a box in the middle of the window; True while it is to be filled, then end_popup."""
    if not imgui.is_popup_open(name):
        imgui.open_popup(name)
    screen = imgui.get_io().display_size
    imgui.set_next_window_pos(Vec(screen.x / 2, screen.y / 2), 0, Vec(0.5, 0.5))
    imgui.set_next_window_size(Vec(min(WIDTH * ui_scale, screen.x * 0.9), 0))
    flags = imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_saved_settings
    return imgui.begin_popup_modal(name, None, flags)[0]


def answer_row(words: tuple[str, ...], ui_scale: float) -> str:
    """Buttons; the word that was clicked, the last one for Escape, else ""."""
    imgui.dummy(Vec(0, 4 * ui_scale))
    clicked = ""
    for number, word in enumerate(words):
        if number:
            imgui.same_line()
        if imgui.button(word, Vec(110 * ui_scale, 0)):
            clicked = word
    return words[-1] if imgui.is_key_pressed(imgui.Key.escape, False) else clicked


def unsaved(stage: "Stage") -> bool:
    """Whether something would be lost; a scene that is no file yet has no regions to lose."""
    changed = stage.regions.kept != stage.document.saved_regions
    return stage.document.unsaved or (changed and stage.document.path is not None)


def filed(file: SceneFile, stage: "Stage", path: Path) -> SceneFile:
    """What is written: with the regions, and with paths from the folder that it goes to.

    ValueError for what could not be read again.
    """
    for item in file.all_items:
        if not all(abs(metres) <= FAR_M for metres in item.position):
            raise ValueError(
                f"'{item.name}' stands farther than {FAR_M:g} m from the first; save them alone"
            )
        if "\\" in item.model:
            raise ValueError(f"a path with a backslash ({item.model}) is no path everywhere")
    view = stage.first_view((640, 360))
    selectors = [stage.regions.selectors(index, view) for index in range(len(file.all_items))]
    return beside(with_regions(file, selectors), path.parent)
