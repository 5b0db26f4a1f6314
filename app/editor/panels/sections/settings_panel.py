"""The panel's section "Settings": language and units, which the next start keeps."""

from collections.abc import Callable

from imgui_bundle import imgui

from shapeshift.app.editor.panels.scale_bar import KELVIN
from shapeshift.app.editor.panels.widgets.panel_rows import choice, tip
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.fonts import is_offered, why_not
from shapeshift.app.editor.texts.table import all_languages, language_in_use, said


def draw_settings(
    settings: ProgramSettings, speak: Callable[[str], None], keep: Callable[[], None],
    ui_scale: float,
) -> None:  # fmt: skip
    """`speak` shows another language, by its code; `keep` writes the settings."""
    imgui.push_item_width(-1)
    languages = all_languages()
    offered = [code for code in languages if is_offered(code)]
    now = language_in_use().code
    names = [languages[code].name for code in offered]
    chosen = choice("language", now, offered, names, names=True)
    tip("The language of this panel. A file of texts is all that another one needs.", ui_scale)
    if chosen != now:
        speak(chosen)
    missing = [language for code, language in languages.items() if code not in offered]
    imgui.push_text_wrap_pos(0)
    for language in missing:
        imgui.text_disabled(why_not(language))
    imgui.pop_text_wrap_pos()
    units = ["", *KELVIN]
    labels = [said("temperature: as filed"), *(said("temperature: {unit}", unit=u) for u in KELVIN)]
    known = settings.temperature if settings.temperature in units else ""
    unit = choice("temperature", known, units, labels)
    tip("The unit of the legend beside the picture.", ui_scale)
    if unit != known:
        settings.temperature = unit
        keep()
    imgui.pop_item_width()
