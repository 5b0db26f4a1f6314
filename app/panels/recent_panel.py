"""The list of recently opened files behind one button of the panel."""

from pathlib import Path

from imgui_bundle import imgui

from app.panels.panel_rows import tip
from app.viewer.recent import RecentFiles

Vec = imgui.ImVec2
POPUP = "recent files"
WIDTH = 200.0  # logical pixels, of the names


class RecentMenu:
    """The button and the list it opens; whether files are still there is looked up once."""

    def __init__(self) -> None:
        self._present: dict[Path, bool] = {}

    def draw(self, recent: RecentFiles | None, ui_scale: float) -> Path | None:
        """Returns the file that was chosen."""
        if recent is None or not recent.paths:
            return None
        if imgui.button("Open recent", Vec(-1, 0)):
            self._present = {path: path.exists() for path in recent.paths}
            imgui.open_popup(POPUP)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
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
