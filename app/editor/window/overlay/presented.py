"""What a window shows: a picture and the overlay over it, put there as is cheapest on this GL."""

from collections.abc import Callable

import glfw
import moderngl
import numpy as np
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer, scissor, write
from shapeshift.app.editor.window.overlay.triangles import (
    INDEX,
    DrawList,
    boxes_of,
    changed_boxes,
    read_lists,
    tiles_of,
)
from shapeshift.rasterizer.resolve import WindowOverlay
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.layered import Layered, PixelBox, WindowBytes
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


# The overlay on software GL: a layer of its own, in which only what has changed is drawn anew.
#
# There a pixel that is drawn costs more than all that comes before it: at 1280x720 the overlay
# takes 3 ms of processor time, and it seldom changes in more than a button.

MOST_UNREAD = 64  # boxes: more are read as the whole layer
OVER = (  # colours as ImGui has them; alpha as what they hide, so that the layer is premultiplied
    moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA,
)  # fmt: skip


class KeptOverlay(OverlayRenderer):
    """Draws ImGui into a layer and lays that over the window's picture."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._lists: tuple[DrawList, ...] = ()
        self._anew = True  # nothing of the layer holds
        super().__init__(ctx)
        self._gpu = Gpu(ctx)
        self._layer, self._layered = WindowBytes(self._gpu), Layered(self._gpu)
        self._bytes: np.ndarray | None = None  # the layer once more, as WindowOverlay has it
        self._unread: list[PixelBox] = []  # where it differs from that
        self._tiles: np.ndarray | None = None  # that the overlay covers
        self._covered: list[PixelBox] = []  # these, as few boxes

    @property
    def works(self) -> bool:
        """Whether this context has what it needs."""
        return self._layered.works

    def forget(self) -> None:
        """Nothing of the layer holds: it is drawn whole next time."""
        self._anew = True

    def register_texture(self, texture: moderngl.Texture) -> None:
        """A number of a texture that is gone may come back as another picture."""
        self._anew = True
        super().register_texture(texture)

    def keep_picture(self, window: moderngl.Framebuffer) -> None:
        """The window has the picture, and nothing over it yet."""
        self._layered.keep(window)

    def keep_bytes(self, pixels: np.ndarray) -> None:
        """The same of a picture that the window does not have yet."""
        self._layered.keep_bytes(pixels)

    def show_bytes(self, pixels: np.ndarray, window: moderngl.Framebuffer) -> None:
        """Puts a picture that is made as bytes into the window."""
        self._layered.show_bytes(pixels, window)

    def show_picture(self, window: moderngl.Framebuffer) -> bool:
        """Puts the picture that was kept into the window; False where there is none."""
        return self._layered.show_picture(window)

    def lay_over(
        self, data: imgui.ImDrawData, window: moderngl.Framebuffer, picture_kept: bool
    ) -> bool:
        """The overlay of now over what the window has; True where it differs from the last one.

        picture_kept: that is the kept picture and nothing else.
        """
        boxes = self._update_layer(data, window.viewport[2:])
        if picture_kept:
            self._layered.lay_over_picture(window, self._texture, self._covered, boxes)
        else:
            self._layered.lay_over_window(window, self._texture, self._covered)
        return len(boxes) > 0

    def lay_over_bytes(
        self, data: imgui.ImDrawData, window: moderngl.Framebuffer, make: MakeBytes
    ) -> None:
        """The overlay of now over a picture that is made as bytes and that no window has yet: both
        are laid together before GL has them, and all that it does is to copy.
        """
        self._update_layer(data, window.viewport[2:])
        if self._bytes is None:
            width, height = self._layer.size
            self._bytes = np.empty((height, width, 4), np.uint8)
        for left, top, right, low in self._unread:
            self._bytes[top:low, left:right] = self._layer.read_box((left, top, right, low))
        self._unread = []
        boxes = np.array(self._covered, np.int32).reshape(-1, 4)
        self._layered.show_bytes(make(overlay=WindowOverlay(self._bytes, boxes)), window)

    @property
    def _texture(self) -> moderngl.Texture:
        (texture,) = self._layer.framebuffer.color_attachments
        return texture

    def _update_layer(self, data: imgui.ImDrawData, size: tuple[int, int]) -> list[PixelBox]:
        """Boxes of the layer that were drawn anew."""
        if self._layer.size != size:
            self._layer.lay_out(size)
            self._anew, self._bytes = True, None
        self.update_textures()
        lists = read_lists(data, self._lists)
        if self._anew:
            boxes = [(0, 0, *size)]
        else:
            boxes = boxes_of(tiles_of(changed_boxes(self._lists, lists), size), size)
        if boxes:
            self.draw_boxes(lists, boxes)
            whole = self._anew or len(self._unread) + len(boxes) > MOST_UNREAD
            self._unread = [(0, 0, *size)] if whole else [*self._unread, *boxes]
            tiles = np.logical_or.reduce([each.tiles(size) for each in lists])
            if self._tiles is None or not np.array_equal(tiles, self._tiles):
                self._tiles, self._covered = tiles, boxes_of(tiles, size) if lists else []
        self._lists, self._anew = lists, False
        return boxes

    def draw_boxes(self, lists: tuple[DrawList, ...], boxes: list[PixelBox]) -> None:
        """What of the triangles lies in these boxes, on nothing."""
        layer, ctx = self._layer.framebuffer, self.ctx
        width, height = layer.size
        with self._gpu.drawing_into(layer):
            for left, top, right, low in boxes:
                layer.clear(viewport=(left, height - low, right - left, low - top))
            ctx.enable_only(moderngl.BLEND)
            ctx.blend_equation, ctx.blend_func = moderngl.FUNC_ADD, OVER
            for each in lists:
                self._look_at((2 * each.scale[0] / width, 2 * each.scale[1] / height))
                self._draw_list(each, boxes, height)
            layer.scissor = None

    def _draw_list(self, drawn: DrawList, boxes: list[PixelBox], height: int) -> None:
        jobs: list[tuple[PixelBox, int, np.ndarray]] = []  # a box, a command, its triangles there
        for box in boxes:
            left, top, right, low = box
            of = drawn.boxes
            meets = (of[:, 0] <= right) & (of[:, 2] >= left) & (of[:, 1] <= low)
            meets &= (of[:, 3] >= top) & (of[:, 0] <= of[:, 2])
            (places,) = np.nonzero(meets)
            commands = drawn.of_command[places]
            jobs += [(box, c, places[commands == c]) for c in np.unique(commands).tolist()]
        if not jobs:
            return
        indices = drawn.corners[np.concatenate([places for _, _, places in jobs])]
        write(self._vertex_buffer, drawn.vertices)
        write(self._index_buffer, np.ascontiguousarray(indices, INDEX).tobytes())
        first = 0
        for box, command, places in jobs:
            clip, texture, _ = drawn.commands[command]
            self.textures[texture].use(0)
            self.ctx.scissor = within(scissor(clip, drawn.scale, height), box, height)
            self._vertices.render(moderngl.TRIANGLES, vertices=3 * len(places), first=first)
            first += 3 * len(places)

    def shutdown(self) -> None:
        self._layer.release()
        self._layered.release()
        self._gpu.release()
        super().shutdown()


def within(
    clip: tuple[int, int, int, int], box: PixelBox, height: int
) -> tuple[int, int, int, int]:
    """What of GL's scissor lies in a box."""
    left, below = max(clip[0], box[0]), max(clip[1], height - box[3])
    right, above = min(clip[0] + clip[2], box[2]), min(clip[1] + clip[3], height - box[1])
    return left, below, max(right - left, 0), max(above - below, 0)
