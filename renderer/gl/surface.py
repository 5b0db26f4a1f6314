"""surface: depth, normals and coverage drawn with GL; projected and sorted before.

Of a frame's views depth alone, beside their colours, into smaller targets (DepthPictures).
"""

import moderngl
import numpy as np

from shapeshift.rasterizer.pages import PAGE
from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for, release_framebuffer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.pose import View

VECS = 3  # vec4 a splat
OUTPUTS = {"depth": 0, "normal": 1}  # what one draw leaves in addition to coverage


class DepthPictures:
    """The depth of every view of a frame, drawn from the records and the order of its colours."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._surfaces: moderngl.Buffer | None = None
        self._targets: dict[int, moderngl.Framebuffer] = {}

    def draw(
        self, arena: Arena, i: int, view: View, settings: RenderSettings, row: int = 0
    ) -> None:
        """Into the picture of view i, which was projected as number `row` of its group."""
        part = settings.depth_scale
        target = self._target(i, tuple(max(1, round(part * side)) for side in view.size))
        with self._gpu.drawing_into(target):
            target.clear(0.0, 0.0, 0.0, 0.0)
        if not arena.count:
            return
        surfaces = self._room(arena)
        _measure(self._gpu, arena, view, surfaces)
        _draw_into(self._gpu, target, arena, view, settings, surfaces, OUTPUTS["depth"], row)
        self._gpu.ctx.memory_barrier()  # the next view overwrites what this draw still reads

    def texture(self, i: int) -> moderngl.Texture:
        """Metres times coverage in red, coverage in alpha; row 0 at the bottom."""
        return self._targets[i].color_attachments[0]

    def _room(self, arena: Arena) -> moderngl.Buffer:
        """For all splats; made anew where it is too small."""
        size = 16 * VECS * arena.count
        if self._surfaces is None or self._surfaces.size < size:
            if self._surfaces is not None:
                self._surfaces.release()
                self._surfaces = None
            self._surfaces = self._gpu.reserve(size, "depth of all splats")
        return self._surfaces

    def _target(self, i: int, size: tuple[int, ...]) -> moderngl.Framebuffer:
        old = self._targets.get(i)
        if old is None or old.size != size:
            made = self._gpu.target((size[0], size[1]), "f4")
            if old is not None:
                release_framebuffer(old)
            self._targets[i] = made
        return self._targets[i]

    def release(self) -> None:
        for target in self._targets.values():
            release_framebuffer(target)
        self._targets.clear()
        if self._surfaces is not None:
            self._surfaces.release()
            self._surfaces = None


def draw_surface(gpu: Gpu, arena: Arena, view: View, settings: RenderSettings) -> Surface:
    """The surface of an arena that was projected and sorted for this view alone."""
    surfaces = gpu.reserve(16 * VECS * arena.count, "depth of all splats")
    try:
        _measure(gpu, arena, view, surfaces)
        depth, normal = (_draw(gpu, arena, view, settings, surfaces, n) for n in OUTPUTS.values())
    finally:
        surfaces.release()
    metres, coverage = depth[..., 0], depth[..., 3]
    return Surface(*(np.ascontiguousarray(a) for a in (metres, normal[..., :3], coverage)))


def _measure(gpu: Gpu, arena: Arena, view: View, surfaces: moderngl.Buffer) -> None:
    """Fills `surfaces`, object by object."""
    bind(mean_opacity=arena.mean_opacity, covariance=arena.covariance, surfaces=surfaces)
    left, right, down, up = view.tangents
    focal = (view.size[0] / (right - left), view.size[1] / (up - down))
    each = (view.eye_from_world() @ arena.world_from_object)[:, :3]  # (O, 3, 4)
    each = np.ascontiguousarray(each, np.float32)
    for i, first, last in arena.runs:
        program = gpu.compute("surface.comp")
        program["rows"].write(each[i])
        count = groups_for(last - first, layout.WORKGROUP)
        gpu.run(program, count, first=first, last=last, focal=focal, near=view.near)
    if (pages := arena.pages) is not None:
        bind(pages=pages.upload(each[:, None]))
        gpu.run(
            gpu.compute("surface.comp", PAGED=1, PAGE=PAGE),
            groups_for(pages.rows, layout.WORKGROUP), first=pages.first, last=arena.count,
            focal=focal, near=view.near, first_entry=pages.first_entry,
        )  # fmt: skip


def _draw(
    gpu: Gpu, arena: Arena, view: View, settings: RenderSettings, surfaces: moderngl.Buffer,
    output: int,
) -> np.ndarray:  # fmt: skip
    """(H, W, 4) float32 of one of OUTPUTS and coverage, row 0 on top."""
    width, height = view.size
    target = gpu.target(view.size, "f4")
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
    _draw_into(gpu, target, arena, view, settings, surfaces, output)
    pixels = np.frombuffer(target.color_attachments[0].read(), np.float32)
    release_framebuffer(target)
    return pixels.reshape(height, width, 4)[::-1]


def _draw_into(
    gpu: Gpu, target: moderngl.Framebuffer, arena: Arena, view: View, settings: RenderSettings,
    surfaces: moderngl.Buffer, output: int, row: int = 0,
) -> None:  # fmt: skip
    """One of OUTPUTS over what the target has; it may be smaller than the view."""
    program = gpu.program("surface.vert", "surface.frag")
    program["size"].value, program["min_alpha"].value = view.size, settings.min_alpha
    program["output_kind"].value, program["first"].value = output, row * arena.count
    program["pixels_per_fragment"].value = (
        view.size[0] / target.width, view.size[1] / target.height,
    )  # fmt: skip
    triangles = gpu.ctx.vertex_array(program, [])
    bind(order=arena.order, records=arena.records, counts=arena.counts, surfaces=surfaces)
    with gpu.drawing_into(target):
        gpu.ctx.enable_only(moderngl.BLEND)
        gpu.ctx.blend_func = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
        triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
    triangles.release()
