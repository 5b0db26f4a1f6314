"""The panel's section "Comfort": how one sits, which hands one has, how one moves and reads."""

from collections.abc import Callable, Sequence
from typing import Any

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import item_label
from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.worn_settings import INSETS, SIZES, VIGNETTES, WornSettings

Vec = imgui.ImVec2
POSTURE_NAMES = {"standing": "Standing", "seated": "Seated"}
HAND_NAMES = {"both": "Both hands", "left": "Left alone", "right": "Right alone"}
PANEL_NAMES = {"left": "Panel: left", "right": "Panel: right"}
WALK_NAMES = {"left": "Walk: left", "right": "Walk: right"}
MODEL_NAMES = {"gloves": "Gloves", "controllers": "Controllers"}
TURN_NAMES = {"snap": "Snap turns", "smooth": "Smooth", "none": "By body"}
SHARP = "sharp around the gaze"
SHARP_NAMES = {
    "off": "All over", "low": "35°", "medium": "25°", "high": "15°", INSETS: "Quad views",
}  # fmt: skip
LATER = "Quad views begin with the next session; until then 25°."
NO_INSETS = "The runtime offers no quad views; 25° instead."
ROOM, NO_ROOM = "the room behind the scene", "The runtime shows no room behind pictures."
EDGE, TEXT = "dark edge while moving", "size of this panel"


def draw_comfort(settings: WornSettings, choose: Callable[..., None]) -> None:
    """Rows of buttons; `choose` gets what was pressed, by the setting's name."""
    _words("posture", POSTURE_NAMES, settings, choose)
    _words("hands", HAND_NAMES, settings, choose)
    if not settings.one_hand:  # one hand alone points, walks and turns
        _words("panel_hand", PANEL_NAMES, settings, choose)
        _words("walking_hand", WALK_NAMES, settings, choose)
    _words("turning", TURN_NAMES, settings, choose)
    _words("hand_model", MODEL_NAMES, settings, choose)
    for name, title, offered in (("vignette", EDGE, VIGNETTES), ("text_size", TEXT, SIZES)):
        imgui.text_disabled(said(title))
        labels = [f"{100 * value:.0f} %" for value in offered]
        _row(name, offered, labels, settings, choose)


def draw_foveation(
    settings: WornSettings, has_insets: bool, offered: bool, choose: Callable[..., None]
) -> None:
    """How far from what one looks at all pixels are drawn; and where the runtime's own insets are
    wanted and not there, what is done instead.
    """
    imgui.text_disabled(said(SHARP))
    _words("foveation", SHARP_NAMES, settings, choose)
    if settings.wants_insets and not has_insets:
        _sentence(LATER if offered else NO_INSETS)


def draw_see_through(shown: bool, offered: bool, choose: Callable[..., None]) -> None:
    """A box to check where the runtime shows the room; else that it does not."""
    if not offered:
        _sentence(NO_ROOM)
        return
    changed, wanted = imgui.checkbox(item_label(ROOM), shown)
    if changed:
        choose(passthrough=wanted)


def _sentence(text: str) -> None:
    imgui.push_text_wrap_pos(0)
    imgui.text_disabled(said(text))
    imgui.pop_text_wrap_pos()


def _words(
    name: str, names: dict[str, str], settings: WornSettings, choose: Callable[..., None]
) -> None:
    _row(name, tuple(names), list(names.values()), settings, choose)


def _row(
    name: str, values: Sequence[Any], labels: Sequence[str], settings: WornSettings,
    choose: Callable[..., None],
) -> None:  # fmt: skip
    """A button each, as wide as its words and an equal share of what is left."""
    imgui.push_id(name)
    shown = [said(label) for label in labels]
    texts = [imgui.calc_text_size(text).x for text in shown]
    gap = imgui.get_style().item_spacing.x
    room = imgui.get_content_region_avail().x - gap * (len(texts) - 1)
    spare = (room - sum(texts)) / len(texts)
    for number, (value, text, wide) in enumerate(zip(values, shown, texts, strict=True)):
        if number:
            imgui.same_line()
        lit = getattr(settings, name) == value
        if lit_button(f"{text}###{labels[number]}", lit, wide + spare) and not lit:
            choose(**{name: value})
    imgui.pop_id()


def lit_button(label: str, lit: bool, width: float) -> bool:
    """A button, in the accent's colour where it is what holds now."""
    if lit:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.ACCENT, 1))
    clicked = imgui.button(label, Vec(width, 0))
    if lit:
        imgui.pop_style_color()
    return clicked
