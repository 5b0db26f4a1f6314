"""The headset's panel beside the real window: the same sections, and neither in the other's way."""

from imgui_bundle import imgui

from shapeshift.app.editor.panels.sections.objects_panel import draw_object_list
from shapeshift.app.editor.panels.sections.plain_sections import draw_look
from shapeshift.app.editor.panels.sections.stops_panel import draw_stops
from shapeshift.app.editor.panels.sections.touch_panel import draw_touch
from shapeshift.app.editor.panels.slider import draw_slider
from shapeshift.app.editor.state.object_edits import ObjectEdits
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.panel_picture import UI_SCALE, PanelPicture
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.vr.panel import NOBODY
from tests.support.desktop.widgets import Widgets
from tests.support.touch_scene import TOUCH


def recorded(monkeypatch, draw) -> list[str]:
    """Kinds and labels of what ImGui was asked for, in order."""
    with monkeypatch.context() as patch:
        widgets = Widgets(patch)
        draw()
        return list(widgets.explained)


def test_a_section_has_the_desktops_widgets(window, monkeypatch):
    """Each exists once: drawn in the window and in the texture it asks for the very same items."""
    _, editor = open_xr(TOUCH, Options())
    touch = TouchState(editor, True)
    objects = ObjectEdits(editor, None, lambda: None)
    sections = {
        "Stops": lambda scale: draw_stops(editor, scale),
        "Look": lambda scale: draw_look(editor, scale),
        "Touch": lambda scale: draw_touch(touch, scale, False),
        "Objects": lambda scale: draw_object_list(objects, scale),
    }
    panel = PanelPicture(window.ctx)

    def within(draw, scale: float) -> None:
        imgui.set_next_window_size(imgui.ImVec2(290 * scale, 340 * scale))
        imgui.begin("##any")
        draw(scale)
        imgui.end()

    for name, draw in sections.items():
        window.wait(0)
        window.begin_frame()
        on_desk = recorded(monkeypatch, lambda draw=draw: within(draw, window.ui_scale))
        window.end_frame()
        worn = recorded(
            monkeypatch,
            lambda draw=draw: panel.draw(lambda: within(draw, UI_SCALE), NOBODY, 0.0, 0.01),
        )
        assert worn == on_desk and len(worn) >= 2, name
    slider = editor.sliders[0]
    worn = recorded(
        monkeypatch,
        lambda: panel.draw(
            lambda: within(lambda s: draw_slider(editor, slider, s), UI_SCALE), NOBODY, 0.0, 0.01
        ),
    )
    assert not [kind for kind in worn if kind.startswith("input_text")], "there are no keys"
    panel.release()


def test_the_window_draws_on_after_a_panel_was_there(window):
    """Two contexts of ImGui in one program, each with its own mouse and fonts."""
    panel = PanelPicture(window.ctx)
    for _ in range(2):
        window.wait(0)
        window.begin_frame()
        imgui.begin("##desk")
        imgui.button("on the desk")
        assert imgui.get_io().display_size.x == window.logical_size[0]
        imgui.end()
        window.end_frame()
        panel.draw(lambda: imgui.get_io().display_size, NOBODY, 0.0, 0.01)
    panel.release()
    window.begin_frame()
    window.end_frame()
    assert window.ctx.error == "GL_NO_ERROR"
