"""The panel's row of files: open one, or one of those opened before."""

from pathlib import Path

import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.empty_panel import OPEN
from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.overlay_renderer import Textures
from shapeshift.app.editor.panels.widgets.panel_rows import item_label, tip
from shapeshift.app.editor.state.user.recent import RecentFiles
from shapeshift.app.editor.state.user.recent_pictures import RecentPictures
from shapeshift.app.editor.texts.table import said

Vec = imgui.ImVec2
POPUP = "recent files"
WIDTH = 200.0  # logical pixels, of the names
TALL = 36.0  # of the pictures
NEW = "New"


class OpenRow:
    """The buttons and the list; whether files are still there is looked up once it opens."""

    def __init__(self, textures: Textures) -> None:
        self._textures = textures
        self._present: dict[Path, bool] = {}

    def draw(
        self, recent: RecentFiles | None, pictures: RecentPictures | None, ui_scale: float
    ) -> tuple[str, Path | None]:
        """Returns OPEN or NEW where that was clicked, and the file that was chosen."""
        listed = recent is not None and bool(recent.paths)
        gap, room = imgui.get_style().item_spacing.x, imgui.get_content_region_avail().x
        count = 2 + listed
        width, clicked = (room - gap * (count - 1)) / count, ""
        if imgui.button(item_label(OPEN), Vec(width, 0)):
            clicked = OPEN
        tip("Ctrl+O, or drop files and folders anywhere on the window.", ui_scale)
        imgui.same_line()
        if imgui.button(item_label(NEW), Vec(width, 0)):
            clicked = NEW
        tip("An empty scene. Ctrl+N.", ui_scale)
        chosen = None
        if recent is not None and listed:
            imgui.same_line()
            chosen = self._recent(recent, pictures, ui_scale)
        return clicked, chosen

    def _recent(
        self, recent: RecentFiles, pictures: RecentPictures | None, ui_scale: float
    ) -> Path | None:
        """The button, and the list that it opens."""
        if imgui.button(item_label("Recent"), Vec(-1, 0)):
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
            picture = pictures.of(path) if pictures else None
            draw_recent_picture(self._textures, row, picture, ui_scale)
            label = f"{path.name or path}##{row}"
            width = imgui.calc_text_size(path.name or str(path)).x
            size = Vec(max(width, WIDTH * ui_scale), TALL * ui_scale)
            if imgui.selectable(label, False, 0, size)[0]:
                chosen = path
            imgui.end_disabled()
            tip(
                str(path) if present else said("{path} is not there any more.", path=path), ui_scale
            )
            imgui.same_line()
            imgui.text_disabled(path.parent.name)  # of ten point_cloud.ply the one that is meant
        imgui.end_popup()
        return chosen


def draw_recent_picture(
    textures: Textures, row: int, picture: np.ndarray | None, ui_scale: float
) -> None:
    """How a file looked, or a gray field, with the cursor at its right."""
    corner, high = imgui.get_cursor_screen_pos(), TALL * ui_scale
    end = Vec(corner.x + high * 16 / 9, corner.y + high)
    draw = imgui.get_window_draw_list()
    if picture is None:
        draw.add_rect_filled(corner, end, theme.color(theme.RAISED))
    else:
        draw.add_image(textures.reference(f"recent {row}", picture), corner, end)
    imgui.dummy(Vec(end.x - corner.x, high))
    imgui.same_line()
