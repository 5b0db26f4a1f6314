"""The panel's row of files: open one, one of those opened before, or what else there is to see."""

from collections.abc import Mapping
from pathlib import Path

from imgui_bundle import imgui

from shapeshift.app.editor.panels.empty_panel import CHOICES
from shapeshift.app.editor.panels.widgets.panel_rows import tip
from shapeshift.app.editor.state.user.recent import RecentFiles

Vec = imgui.ImVec2
POPUP = "recent files"
WIDTH = 200.0  # logical pixels, of the names


class OpenRow:
    """The buttons and the list; whether files are still there is looked up once it opens."""

    def __init__(self) -> None:
        self._present: dict[Path, bool] = {}

    def draw(
        self, recent: RecentFiles | None, others: Mapping[str, Path], ui_scale: float
    ) -> tuple[bool, Path | None]:
        """Returns whether a box is wanted that asks for a file, and the file that was chosen.

        `others` of CHOICES have a button each.
        """
        listed = recent is not None and bool(recent.paths)
        gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
        wants = imgui.button("Open\u2026", Vec((room - gap) / 2 if listed else -1, 0))
        tip("Ctrl+O, or drop files and folders anywhere on the window.", ui_scale)
        chosen = None
        if recent is not None and listed:
            imgui.same_line()
            chosen = self._recent(recent, ui_scale)
        for label, path in others.items():
            if imgui.button(label, Vec(-1, 0)):
                chosen = path
            tip(CHOICES[label], ui_scale)
        return wants, chosen

    def _recent(self, recent: RecentFiles, ui_scale: float) -> Path | None:
        """The button, and the list that it opens."""
        if imgui.button("Recent", Vec(-1, 0)):
            self._present = {path: path.exists() for path in recent.paths}
            imgui.open_popup(POPUP)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        tip("Files that were opened before.", ui_scale)
        imgui.set_next_window_pos(Vec(low.x, high.y))
        if not imgui.begin_popup(POPUP):
            return None
        chosen = None
        for row, path in enumerate(recent.paths):
            present = self._present.get(path, True)
            imgui.begin_disabled(not present)
            label = f"{path.name or path}##{row}"
            width = imgui.calc_text_size(path.name or str(path)).x
            if imgui.selectable(label, False, 0, Vec(max(width, WIDTH * ui_scale), 0))[0]:
                chosen = path
            imgui.end_disabled()
            tip(f"{path}" if present else f"{path} is not there any more.", ui_scale)
            imgui.same_line()
            imgui.text_disabled(path.parent.name)  # of ten point_cloud.ply the one that is meant
        imgui.end_popup()
        return chosen
