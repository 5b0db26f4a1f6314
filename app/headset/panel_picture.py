"""The headset's panel as ImGui draws it: a context of its own, into a texture of the eyes' GL."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import moderngl
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.panels.widgets.clean_texts import Box, clean_texts, listing_items
from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer, Textures
from shapeshift.renderer.gl.context import is_software
from shapeshift.vr.panel import PanelPlane, Pointing

# So large that at 0.6 m, an arm's length, a capital is 1.0 degree high (type of 25 dmm), and what
# can be hit 2.3 degrees: 34 by 38 cm.
UNITS, METRES_PER_UNIT = (290, 330), 0.00116
UI_SCALE = 3  # logical pixels a unit: ImGui knows whole ones alone, and a knob shall not stutter
PANEL = PanelPlane((UNITS[0] * UI_SCALE, UNITS[1] * UI_SCALE), METRES_PER_UNIT / UI_SCALE)
FINE, COARSE = 4, 2  # pixels a unit; coarse on software GL, where each costs
AWAY = 3.4028234e38  # FLT_MAX: there ImGui has no mouse
OPAQUE = (True, True, True, False)  # of the texture, what is drawn into: alpha stays 1


class PanelPicture:
    """Runs frames of ImGui with a ray for a mouse; `texture` is what the last one looked like."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        per_unit = COARSE if is_software(ctx) else FINE
        density = per_unit / UI_SCALE  # pixels a logical pixel
        self.texture = ctx.texture((UNITS[0] * per_unit, UNITS[1] * per_unit), 4)
        self.texture.repeat_x = self.texture.repeat_y = False
        self.texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.version = 0  # another one after each frame that was drawn
        self._framebuffer = ctx.framebuffer([self.texture])
        clean_texts()
        self.boxes: dict[str, Box] = {}  # of what can be hit and is in sight, by label
        self.hovered, self.active = 0, 0  # ImGui's names of what is pointed at, and held
        self._pressing = False
        self._context = imgui.create_context()
        with self._current():
            io = imgui.get_io()
            io.set_ini_filename("")
            io.config_input_trickle_event_queue = False  # a place and a press in one frame
            io.display_size = imgui.ImVec2(*PANEL.size)
            io.display_framebuffer_scale = imgui.ImVec2(density, density)
            theme.apply(UI_SCALE, keys=False)
            self._renderer = OverlayRenderer(ctx)
        self.textures = Textures(ctx, self._renderer)

    @contextmanager
    def _current(self) -> Iterator[None]:
        """ImGui's context of the panel; afterwards the one before, such as a window's."""
        before = imgui.get_current_context()
        imgui.set_current_context(self._context)
        try:
            yield
        finally:
            if before is not None:
                imgui.set_current_context(before)

    def draw(
        self, fill: Callable[[], None], pointing: Pointing, notches: float, seconds: float
    ) -> None:
        """One frame: `fill` makes the widgets and lets them act."""
        before = self._ctx.fbo or self._ctx.detect_framebuffer(0)
        with self._current(), listing_items() as self.boxes:
            self._point(pointing, notches, seconds)
            imgui.new_frame()
            if self._pressing and not pointing.pressing and pointing.at is None:
                imgui.internal.clear_active_id()  # the hand is gone: what it held is not clicked
            self._pressing = pointing.pressing
            fill()
            context = imgui.get_current_context()
            self.hovered, self.active = context.hovered_id, context.active_id
            imgui.render()
            self._framebuffer.color_mask = (True, True, True, True)
            self._framebuffer.clear(*theme.SURFACE, 1.0)
            self._framebuffer.color_mask = OPAQUE
            self._framebuffer.use()
            self._renderer.render(imgui.get_draw_data())
        self._ctx.enable_only(moderngl.NOTHING)
        before.use()
        self.texture.build_mipmaps()
        self.version += 1

    def _point(self, pointing: Pointing, notches: float, seconds: float) -> None:
        """The ray's place is the mouse's, and its press the left button."""
        io = imgui.get_io()
        io.delta_time = max(seconds, 1e-4)
        if pointing.at is not None:
            io.add_mouse_pos_event(*pointing.at)
        elif not (pointing.pressing or self._pressing):  # what is held stays where it is
            io.add_mouse_pos_event(-AWAY, -AWAY)
        io.add_mouse_button_event(0, pointing.pressing)
        if notches:
            io.add_mouse_wheel_event(0.0, notches)

    def release(self) -> None:
        self.textures.release()
        with self._current():
            self._renderer.shutdown()
        imgui.destroy_context(self._context)
        self._framebuffer.release()
        self.texture.release()
