"""The panel's section "Export": what is shown now, as a file for other programs."""

from pathlib import Path

from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.panel_rows import choice, item_label, tip
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.files.exporting import EVERYTHING, PACKAGE, Exporting
from shapeshift.app.editor.texts.table import said
from shapeshift.runtime_models.splats.write_plain import WRITERS, writer_of

DEGREES = ("colours: one from all sides", *(f"colours: SH degree {n}" for n in (1, 2, 3)))
FORMAT_TIPS = {
    PACKAGE: "The model without what was deleted, at every x; this program opens it.",
    ".ply": "What 3DGS writes; every viewer opens it. The largest.",
    ".compressed.ply": "A quarter of the size or less; SuperSplat and PlayCanvas.",
    ".spz": "The smallest; Niantic's viewers, Spark, glTF tools.",
    ".glb": "glTF 2.0 with KHR_gaussian_splatting; not everywhere yet.",
    ".splat": "One colour from all sides; web viewers.",
    ".usdz": "USD with ParticleField3DGaussianSplat; Omniverse, Houdini. Needs usd-core.",
}


def draw_export(exporting: Exporting, state: EditorState, ui_scale: float) -> None:
    """Format, what, SH degree, the button, or how far it is."""
    objects = state.scene.objects
    if not objects:
        imgui.text_disabled(said("There is nothing to export."))
        return
    imgui.push_item_width(-1)
    endings = [writer.ending for writer in WRITERS]
    names = [f"{w.ending}  {w.name if w.name not in w.ending else ''}" for w in WRITERS]
    if exporting.package is not None:
        endings, names = [PACKAGE, *endings], [f"{PACKAGE}  package, with its slider", *names]
    elif exporting.ending == PACKAGE:
        exporting.ending = endings[0]
    exporting.ending = choice("format", exporting.ending, endings, names)
    tip(FORMAT_TIPS[exporting.ending], ui_scale)
    values, labels = exporting.choices()
    exporting.what = exporting.what if exporting.what in values else EVERYTHING
    exporting.what = choice("what", exporting.what, values, labels)
    imgui.pop_item_width()
    if exporting.ending == PACKAGE:
        tip("The whole model, not what is shown at this x.", ui_scale)
    else:
        tip("As it is shown now: at this x, with the regions.", ui_scale)
        _draw_colors(exporting, state, ui_scale)
    if exporting.running:
        imgui.progress_bar(exporting.progress[1], imgui.ImVec2(-1, 0), exporting.progress[0])
    elif imgui.button(item_label("Export"), imgui.ImVec2(-1, 0)):
        exporting.start()
    tip("A new file in Shapeshift/exports of your documents; none is written over.", ui_scale)


def _draw_colors(exporting: Exporting, state: EditorState, ui_scale: float) -> None:
    """How much of the colours is kept: their degree, and what a palette makes of them."""
    most = writer_of(Path(exporting.ending)).sh_degree
    degree = min(exporting.sh_degree, most)
    imgui.push_item_width(-1)
    chosen = choice("degree", degree, range(most + 1), DEGREES[: most + 1])
    imgui.pop_item_width()
    exporting.sh_degree = chosen if chosen != degree else exporting.sh_degree
    tip("How colours may change with the direction; less is smaller.", ui_scale)
    if state.has_palettes:
        _, exporting.palette = imgui.checkbox(item_label("with the palette"), exporting.palette)
        tip("False colours of a stop of values, as they are shown; else gray.", ui_scale)
