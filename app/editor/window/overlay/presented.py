"""What a window shows: a picture and the overlay over it, put there as is cheapest on this GL."""

from collections.abc import Callable

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer
from shapeshift.app.editor.window.overlay.kept_overlay import KeptOverlay
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.resolve import MakeBytes


class Presented:
    """On a GPU the overlay is drawn over the picture in every frame.  On software GL the picture
    and a layer with the overlay are kept, and only what changes is drawn.
    """

    def __init__(self, ctx: moderngl.Context, size: Callable[[], tuple[int, int]]) -> None:
        """`size` tells that of the window's framebuffer, pixels."""
        self._ctx, self._size = ctx, size
        self.kept = KeptOverlay(ctx) if is_software(ctx) else None
        if self.kept is not None and not self.kept.works:
            self.kept.shutdown()
            self.kept = None
        self.renderer = self.kept or OverlayRenderer(ctx)
        self._pending: MakeBytes | None = None  # makes what the window is to have
        self._kept_alone = False  # it is kept already, and the window does not have it
        self._other = True  # the window has not just the picture that is kept
        self._kept_now, self._kept_before = False, False  # in this frame, in the last one
        self._other_before = True
        self.due = True  # the window has something that is not on the screen yet

    def screen(self) -> moderngl.Framebuffer:
        """The window's framebuffer with the viewport on all of it, to draw into: over a picture
        that was taken, if that is not on the screen yet.
        """
        self._other, screen = True, self._whole_screen()
        make, kept_alone = self._taken(), self._kept_alone
        self._kept_alone = False
        if self.kept is not None and make is not None:
            self.kept.show_bytes(make(), screen)
        elif self.kept is not None and kept_alone:
            self.kept.show_picture(screen)
        return screen

    def _taken(self) -> MakeBytes | None:
        """What was taken, once."""
        make, self._pending = self._pending, None
        return make

    def take_picture(self, make: MakeBytes, framebuffer: moderngl.Framebuffer) -> bool:
        """A renderer's WindowTaker: a picture of the whole window waits for what lies over it."""
        whole = framebuffer.glo == 0 and framebuffer.viewport == (0, 0, *self._size())
        self._pending = make if whole and self.kept is not None else None
        return self._pending is not None

    def _whole_screen(self) -> moderngl.Framebuffer:
        self._ctx.screen.viewport = (0, 0, *self._size())
        return self._ctx.screen

    def keep_picture(self) -> None:
        """The window has the picture and nothing over it; worth it where the next frame is likely
        to show it again.
        """
        if self.kept is not None and self._other:
            if (make := self._taken()) is not None:
                self.kept.keep_bytes(make())
                self._kept_alone = True
            else:
                self.kept.keep_picture(self._whole_screen())
            self._other, self._kept_now, self.due = False, True, True

    def show_picture_again(self) -> bool:
        """Puts the picture of the last frame into the window; False where it was not kept, or had
        another size.  Whoever draws over it takes screen().
        """
        if self.kept is None or not self._kept_before:
            return False
        shown = self.kept.show_picture(self._whole_screen())
        self._other, self._kept_now = not shown, shown
        return shown

    def lay_over(self, data: imgui.ImDrawData) -> None:
        """The overlay over what the window has, or is to have."""
        screen, self._kept_alone = self._whole_screen(), False
        if self.kept is None:
            screen.use()
            self.renderer.render(data)
            self.due = True
            return
        if (make := self._taken()) is not None:
            self.kept.lay_over_bytes(data, screen, make)
            self._other_before, self._kept_before, self._kept_now = True, False, False
            self.due = True
            return
        changed = self.kept.lay_over(data, screen, not self._other)
        self.due |= changed or self._other or self._other_before
        self._other_before, self._kept_before, self._kept_now = self._other, self._kept_now, False

    def swap(self, handle) -> None:
        """Brings to the screen what is new, by GLFW's handle of the window."""
        if self.due:
            glfw.swap_buffers(handle)
            self.due = False

    def read(self) -> np.ndarray:
        """(H, W, 3) uint8 of what the window has, row 0 on top."""
        if self._pending is not None or self._kept_alone:
            self.screen()  # has it then
        width, height = self._size()
        data = self._ctx.screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1]

    def release(self) -> None:
        self.renderer.shutdown()
