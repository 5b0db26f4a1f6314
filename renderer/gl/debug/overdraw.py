"""overdraw: how many splats each pixel blends, drawn with GL; for debug pictures alone."""

import moderngl
import numpy as np

from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, overwrite
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View


def count_overdraw(
    gpu: Gpu, projector: Projector, arena: Arena, view: View, settings: RenderSettings
) -> np.ndarray:
    """(H, W) float32, row 0 on top.  Projects the arena again: records and keys become the view's;
    the counts of the frame before stay.
    """
    width, height = view.size
    if not arena.count:
        return np.zeros((height, width), np.float32)
    counts = arena.counts.read()
    projector.project(arena, [view], settings)
    overwrite(arena.counts, counts)
    program = gpu.program("overdraw.vert", "overdraw.frag")
    program["size"].value, program["min_alpha"].value = view.size, settings.min_alpha
    target = gpu.target(view.size, "f4")
    triangles = gpu.ctx.vertex_array(program, [])
    bind(records=arena.records, keys=arena.keys)
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
        gpu.ctx.enable_only(moderngl.BLEND)
        gpu.ctx.blend_func = (moderngl.ONE, moderngl.ONE)
        triangles.render(moderngl.TRIANGLES, vertices=3 * arena.count)
    texture = target.color_attachments[0]
    number = np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1, :, 0]
    for made in (triangles, target, texture):
        made.release()
    return np.ascontiguousarray(number)
