"""The two boxes about saving: one asks for a name, one before something is lost."""

from pathlib import Path

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.question_box import answer_row, question_box
from shapeshift.app.editor.state.files.saving import Saving
from shapeshift.app.editor.texts.table import said

OVER = "Over it"  # writes over the file that was opened
SAVE, LOSE = "Save the scene", "Changes are not saved"


def draw_saving(saving: Saving, scene_name: str, ui_scale: float) -> None:
    """Whichever box is open."""
    if saving.name:
        if question_box(SAVE, ui_scale):
            _draw_name(saving, ui_scale)
            imgui.end_popup()
    elif saving.then is not None and question_box(LOSE, ui_scale):
        _draw_lose(saving, scene_name, ui_scale)
        imgui.end_popup()


def _draw_name(saving: Saving, ui_scale: float) -> None:
    imgui.push_item_width(-1)
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true
    entered, name = imgui.input_text("##path", saving.name, flags)
    imgui.pop_item_width()
    saving.retype(name)
    if saving.taken:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(said("{name} is there already.", name=Path(saving.name).name))
        imgui.pop_text_wrap_pos()
    label, original = "Replace it" if saving.taken else "Save", saving.original
    words: tuple[str, ...] = (label, "Cancel")
    if original is not None and not saving.taken:
        imgui.text_disabled(said("{name} was not written by you here.", name=original.name))
        words = (label, OVER, "Cancel")
    clicked = answer_row(words, ui_scale)
    if clicked == label or (entered and not saving.taken):
        saving.named(saving.name, replace=saving.taken)
    elif clicked == OVER:
        saving.ask_over()
    elif clicked == "Cancel":
        saving.cancel_name()
    if not saving.name:
        imgui.close_current_popup()


def _draw_lose(saving: Saving, scene_name: str, ui_scale: float) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_unformatted(said("{name} has changes that are not saved.", name=scene_name))
    imgui.pop_text_wrap_pos()
    clicked = answer_row(("Save", "Discard", "Cancel"), ui_scale)
    if clicked:
        imgui.close_current_popup()
        saving.answer(clicked)
