"""surface: depth, normals and coverage drawn with GL, for pictures; projected and sorted before."""

from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.renderer import layout
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, groups_for
from shapeshift.renderer.settings import RenderSettings
from shapeshift.renderer.surface import Surface
from shapeshift.scene.pose import View

VECS = 3  # vec4 a splat
OUTPUTS = {"depth": 0, "normal": 1}  # what one draw leaves in addition to coverage


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
    program = gpu.compute("surface.comp")
    bind(mean_opacity=arena.mean_opacity, covariance=arena.covariance, surfaces=surfaces)
    left, right, down, up = view.tangents
    program["focal"].value = (view.size[0] / (right - left), view.size[1] / (up - down))
    program["near"].value = view.near
    for i, (first, last) in enumerate(pairwise(arena.starts)):
        if last > first:
            rows = (view.eye_from_world() @ arena.world_from_object[i])[:3]
            program["first"].value, program["last"].value = first, last
            program["rows"].write(np.ascontiguousarray(rows, np.float32))
            program.run(groups_for(last - first, layout.WORKGROUP))
    gpu.ctx.memory_barrier()


def _draw(
    gpu: Gpu, arena: Arena, view: View, settings: RenderSettings, surfaces: moderngl.Buffer,
    output: int,
) -> np.ndarray:  # fmt: skip
    """(H, W, 4) float32 of one of OUTPUTS and coverage, row 0 on top."""
    width, height = view.size
    program, target = gpu.program("surface.vert", "surface.frag"), gpu.target(view.size, "f4")
    program["size"].value, program["min_alpha"].value = view.size, settings.min_alpha
    program["output_kind"].value = output
    triangles = gpu.ctx.vertex_array(program, [])
    bind(order=arena.order, records=arena.records, counts=arena.counts, surfaces=surfaces)
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
        gpu.ctx.enable_only(moderngl.BLEND)
        gpu.ctx.blend_func = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
        triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
    texture = target.color_attachments[0]
    pixels = np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1]
    for made in (triangles, target, texture):
        made.release()
    return pixels
