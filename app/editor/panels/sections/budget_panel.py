"""The panel's section "Budget": a dial for the frame time, a floor for the likeness."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import item_label, labelled_slider, tip
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.quality_controller import QualityController
from shapeshift.app.editor.texts.table import said

MS_RANGE = (2.0, 200.0)
DB_RANGE = (20.0, 80.0)


def draw_budget(state: EditorState, dial: QualityController, ui_scale: float) -> None:
    """Moves the dial, starts and stops measuring, says what was chosen and what it costs."""
    imgui.push_item_width(-1)
    flags = imgui.SliderFlags_
    moved, ms = labelled_slider(
        "target", dial.target_ms, *MS_RANGE, "a frame in at most %.1f ms",
        flags.logarithmic | flags.always_clamp,
    )  # fmt: skip
    tip("Whole frame. A headset of 90 Hz needs 11 ms.", ui_scale)
    changed, db = labelled_slider(
        "floor", dial.floor_db, *DB_RANGE, "as the exact picture to %.0f dB"
    )
    tip(
        "PSNR against the exact picture. 30 dB is visible, 40 dB hardly, 50 dB is not.", ui_scale
    )  # fmt: skip
    imgui.pop_item_width()
    if moved or changed:
        dial.target_ms, dial.floor_db = ms, db
        if dial.rows:
            dial.choose()
            state.settings = dial.applied(state.settings)
    if dial.measuring:
        _progress(dial, ui_scale)
    else:
        if imgui.button(
            item_label("Measure again" if dial.rows else "Measure and choose"), imgui.ImVec2(-1, 0)
        ):
            dial.wanted = True
        tip(
            "Times a dozen settings on this scene, on this machine, around this view. Then the "
            "dials above choose at once.", ui_scale,
        )  # fmt: skip
    _, dial.dynamic = imgui.checkbox(item_label("fewer pixels while moving"), dial.dynamic)
    tip(
        "Dynamic resolution: where frames are slower than the dial says, moving pictures get "
        "fewer pixels, never below the floor once it is measured. At rest all are drawn.",
        ui_scale,
    )
    if dial.choice is not None:
        imgui.push_text_wrap_pos(0)
        imgui.text_unformatted(dial.choice.sentence)
        imgui.pop_text_wrap_pos()


def _progress(dial: QualityController, ui_scale: float) -> None:
    """How far it is, and the way out."""
    gap = imgui.get_style().item_spacing.x
    width = imgui.get_content_region_avail().x
    button = 76 * ui_scale
    imgui.progress_bar(dial.progress, imgui.ImVec2(width - button - gap, 0), said("measuring"))
    imgui.same_line()
    if imgui.button(item_label("Cancel"), imgui.ImVec2(button, 0)):
        dial.cancel()
