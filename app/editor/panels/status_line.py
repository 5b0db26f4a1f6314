"""The line at the lower edge that is always there: what is open, and what was wrong with it."""

from collections.abc import Sequence

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.panel_rows import tip
from shapeshift.app.editor.panels.widgets.theme import Box
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.messages import number
from shapeshift.app.editor.texts.table import said
from shapeshift.app.opening import sentence

Vec = imgui.ImVec2
GAP = "   \u00b7   "
UNITS = ("bytes", "kB", "MB", "GB", "TB")


def scene_words(state: EditorState) -> list[str]:
    """Format, splats, degree of the harmonics, stops and bytes of what is shown."""
    objects, sources = state.scene.objects, state.sources
    if not objects:
        return [said("nothing is open")]
    splats = said("{count} splats", count=number(state.scene.splat_count))
    size = sum(source.facts.get("bytes", 0) for source in sources)
    size_words = [bytes_text(size)] if size else []
    if len(objects) != 1:
        return [said("{count} objects", count=len(objects)), splats, *size_words]
    facts = sources[0].facts if sources else {}
    degree = facts.get("sh_degree")
    stops = len(objects[0].model.stops)
    words = [str(facts["format"])] if "format" in facts else []
    words += [splats] + ([f"SH {degree}"] if degree is not None else [])
    return [
        *words,
        said("1 stop") if stops == 1 else said("{count} stops", count=stops),
        *size_words,
    ]


def bytes_text(count: int) -> str:
    """ "33.9 MB": three digits and a unit of a thousand."""
    value, unit = float(count), 0
    while value >= 999.5 and unit < len(UNITS) - 1:
        value, unit = value / 1000, unit + 1
    return f"{value:.{0 if unit == 0 or value >= 99.95 else 1}f} {UNITS[unit]}"


def draw_status(state: EditorState, more: Sequence[str], box: Box, ui_scale: float) -> Box:
    """Draws the line; `more` are words of others, "" has nothing to say.  Returns where it is."""
    left, top, right, low = box
    imgui.set_next_window_pos(Vec(left, top))
    imgui.set_next_window_size(Vec(right - left, low - top))
    flags = imgui.WindowFlags_
    imgui.push_style_var(imgui.StyleVar_.window_padding, Vec(16 * ui_scale, 3 * ui_scale))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_var(imgui.StyleVar_.window_min_size, Vec(1, 1))
    imgui.begin(
        "##status",
        None,
        flags.no_decoration | flags.no_move | flags.no_saved_settings
        | flags.no_focus_on_appearing | flags.no_bring_to_front_on_focus,
    )  # fmt: skip
    imgui.text_disabled(GAP.join(scene_words(state)))
    findings = state.findings
    if findings:
        imgui.same_line(0, 0)
        imgui.text_disabled(GAP)
        imgui.same_line(0, 0)
        count = len(findings)
        words = said("1 finding") if count == 1 else said("{count} findings", count=count)
        imgui.text_colored(imgui.ImVec4(*theme.ACCENT, 1), words)
        tip("\n".join(sentence(finding) for finding in findings), ui_scale)
    told = [words for words in more if words]
    if told:
        imgui.same_line(0, 0)
        imgui.text_disabled(GAP)
        imgui.same_line(0, 0)
        imgui.text_unformatted(GAP.join(told))
    box = theme.window_box()
    imgui.end()
    imgui.pop_style_var(3)
    return box
