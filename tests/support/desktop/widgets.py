"""Where the widgets of the overlay are, by their label, and which of them explain themselves."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels import panel

Box = tuple[float, float, float, float]
KINDS = (
    "button", "checkbox", "selectable", "combo", "slider_float", "slider_int", "drag_float",
    "drag_float3", "input_text", "input_text_with_hint", "color_edit3", "invisible_button",
)  # fmt: skip


def every_section(monkeypatch) -> None:
    """The panel shows those of all tools below each other, whatever tool is chosen."""
    monkeypatch.setattr(panel, "of_tool", lambda tool, sections: sections)


class Widgets:
    """Watches ImGui's functions while it exists: labels of the last frames with their places."""

    def __init__(self, monkeypatch) -> None:
        self.boxes: dict[str, Box] = {}  # label, without what follows ## -> logical pixels
        self.explained: dict[str, bool] = {}  # kind and label -> whether a tip follows it
        self._last = ""
        for kind in KINDS:
            monkeypatch.setattr(imgui, kind, self._watched(kind, getattr(imgui, kind)))
        monkeypatch.setattr(imgui, "is_item_hovered", self._hovered(imgui.is_item_hovered))

    def _watched(self, kind: str, function):
        def call(label: str, *values, **named):
            done = function(label, *values, **named)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            self.boxes[label.split("##")[0] or label] = (low.x, low.y, high.x, high.y)
            self._last = f"{kind} {label}"
            self.explained.setdefault(self._last, False)
            return done

        return call

    def _hovered(self, function):
        def call(flags=0):
            if self._last and flags & imgui.HoveredFlags_.for_tooltip:
                self.explained[self._last] = True
            return function(flags)

        return call

    def middle(self, label: str) -> tuple[float, float]:
        """Of a widget, logical pixels."""
        assert label in self.boxes, f"there is no {label!r} among {sorted(self.boxes)}"
        left, top, right, bottom = self.boxes[label]
        return (left + right) / 2, (top + bottom) / 2
