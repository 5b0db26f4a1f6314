"""Pictures in a panel: arrays on the GPU that ImGui can draw."""

import ctypes

import moderngl
import numpy as np
from imgui_bundle import imgui

# Draws what ImGui wants drawn, and keeps the textures that it asks for: its fonts grow as letters
# are needed, and the renderer uploads what is new (ImGui calls this RendererHasTextures).

VERTEX_SHADER = """
#version 330
uniform mat4 clip_from_logical;
in vec2 place;
in vec2 uv;
in vec4 color;
out vec2 texture_uv;
out vec4 corner_color;
void main() {
    texture_uv = uv;
    corner_color = color;
    gl_Position = clip_from_logical * vec4(place, 0, 1);
}
"""
FRAGMENT_SHADER = """
#version 330
uniform sampler2D picture;
in vec2 texture_uv;
in vec4 corner_color;
out vec4 color;
void main() {
    color = corner_color * texture(picture, texture_uv);
}
"""
FIRST_CORNERS = 65536  # room in the buffers, which grow


class OverlayRenderer:
    """Of one ImGui context, the one that is current when this is made.

    All that draws with a context runs while that is current.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self.ctx = ctx
        self._io = imgui.get_io()
        self._io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
        self._platform = imgui.get_platform_io()
        most = int(ctx.info["GL_MAX_TEXTURE_SIZE"])
        self._platform.renderer_texture_max_width = most
        self._platform.renderer_texture_max_height = most
        self.textures: dict[int, moderngl.Texture] = {}  # all that are drawn with, by GL's number
        self._program = ctx.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        self._program["picture"] = 0
        self._vertex_buffer = ctx.buffer(reserve=imgui.VERTEX_SIZE * FIRST_CORNERS)
        self._index_buffer = ctx.buffer(reserve=imgui.INDEX_SIZE * FIRST_CORNERS)
        self._vertices = ctx.vertex_array(
            self._program,
            [(self._vertex_buffer, "2f 2f 4f1", "place", "uv", "color")],
            index_buffer=self._index_buffer,
            index_element_size=imgui.INDEX_SIZE,
        )

    def register_texture(self, texture: moderngl.Texture) -> None:
        """From now on it can be drawn, under its `glo`."""
        self.textures[texture.glo] = texture

    def remove_texture(self, texture: moderngl.Texture) -> None:
        """Before it is released."""
        del self.textures[texture.glo]

    def render(self, data: imgui.ImDrawData) -> None:
        """Over what the framebuffer in use has."""
        self.update_textures()
        scale = (data.framebuffer_scale.x, data.framebuffer_scale.y)
        width, height = (int(side * s) for side, s in zip(data.display_size, scale, strict=True))
        if not (width > 0 and height > 0):
            return
        self.ctx.enable_only(moderngl.BLEND)
        self.ctx.blend_equation = moderngl.FUNC_ADD
        self.ctx.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._look_at((2 / data.display_size.x, 2 / data.display_size.y))
        for each in data.cmd_lists:
            vertices, indices = each.vtx_buffer, each.idx_buffer
            write(self._vertex_buffer, bytes_of(vertices, imgui.VERTEX_SIZE))
            write(self._index_buffer, bytes_of(indices, imgui.INDEX_SIZE))
            for command in each.cmd_buffer:
                self.textures[command.get_tex_id()].use(0)
                self.ctx.scissor = scissor(tuple(command.clip_rect), scale, height)
                self._vertices.render(
                    moderngl.TRIANGLES, vertices=command.elem_count, first=command.idx_offset
                )
        self.ctx.scissor = None

    def _look_at(self, clip_from_logical: tuple[float, float]) -> None:
        """Logical pixels count from the upper left; by what to multiply them, across and down."""
        across, down = clip_from_logical
        matrix = (across, 0, 0, 0, 0, -down, 0, 0, 0, 0, -1, 0, -1, 1, 0, 1)
        self._program["clip_from_logical"] = matrix

    def update_textures(self) -> None:
        """What ImGui wants of its own textures since the last frame; before anything is drawn."""
        status = imgui.ImTextureStatus
        for wanted in self._platform.textures:
            if wanted.status == status.want_create:
                size = (wanted.width, wanted.height)
                texture = self.ctx.texture(size, 4, pixels_of(wanted).tobytes(), alignment=1)
                texture.repeat_x = texture.repeat_y = False
                self.register_texture(texture)
                wanted.set_tex_id(texture.glo)
                wanted.set_status(status.ok)
            elif wanted.status == status.want_updates:
                box = wanted.update_rect
                new = pixels_of(wanted)[box.y : box.y + box.h, box.x : box.x + box.w]
                viewport = (box.x, box.y, box.w, box.h)
                self.textures[wanted.tex_id].write(new.tobytes(), viewport, alignment=1)
                wanted.set_status(status.ok)
            elif wanted.status == status.want_destroy and wanted.unused_frames > 0:
                self._destroy(wanted)

    def _destroy(self, wanted: imgui.ImTextureData) -> None:
        texture = self.textures[wanted.tex_id]
        self.remove_texture(texture)
        texture.release()
        wanted.set_tex_id(0)
        wanted.set_status(imgui.ImTextureStatus.destroyed)

    def shutdown(self) -> None:
        for own in self._platform.textures:
            if own.tex_id in self.textures:
                self._destroy(own)
        self._io.backend_flags &= ~imgui.BackendFlags_.renderer_has_textures
        for part in (self._vertices, self._vertex_buffer, self._index_buffer, self._program):
            part.release()


def pixels_of(texture: imgui.ImTextureData) -> np.ndarray:
    """(height, width, 4) uint8 of a texture of ImGui's, row 0 on top."""
    return texture.get_pixels_array().reshape(texture.height, texture.width, 4)


def bytes_of(vector, item_bytes: int) -> ctypes.Array:
    """An ImVector's own memory."""
    return (ctypes.c_char * (vector.size() * item_bytes)).from_address(vector.data_address())


def write(buffer: moderngl.Buffer, data: bytes | ctypes.Array) -> None:
    """Fills a buffer, which grows where that is needed."""
    if len(data) > buffer.size:
        buffer.orphan(2 * len(data))
    buffer.write(data)


def scissor(
    clip: tuple[float, ...], scale: tuple[float, float], height: int
) -> tuple[int, int, int, int]:
    """GL's of a clip rectangle in logical pixels: left, below, width, height in pixels."""
    left, top, right, low = (side * scale[i % 2] for i, side in enumerate(clip))
    return int(left), int(height - low), int(right - left), int(low - top)


class Textures:
    """Those of one ImGui context; each is uploaded once and kept until its name has another."""

    def __init__(self, ctx: moderngl.Context, overlay: OverlayRenderer) -> None:
        self._ctx, self._overlay = ctx, overlay
        self._kept: dict[str, tuple[np.ndarray, moderngl.Texture]] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def reference(self, name: str, picture: np.ndarray) -> imgui.ImTextureRef:
        """What ImGui draws a picture by, (H, W, 3) or, with alpha, (H, W, 4) uint8; `name` has one
        at a time.
        """
        kept = self._kept.get(name)
        if kept is not None and kept[0] is picture:
            return imgui.ImTextureRef(kept[1].glo)
        if kept is not None:
            self._overlay.remove_texture(kept[1])
            kept[1].release()
        height, width, channels = picture.shape
        texture = self._ctx.texture((width, height), channels, picture.tobytes(), alignment=1)
        self._overlay.register_texture(texture)
        self._kept[name] = (picture, texture)
        return imgui.ImTextureRef(texture.glo)

    def release(self) -> None:
        for _, texture in self._kept.values():
            self._overlay.remove_texture(texture)
            texture.release()
        self._kept.clear()
