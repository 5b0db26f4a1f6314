"""splat_edges: splats as ellipses, points or rings, drawn with GL; for debug pictures alone."""

import moderngl
import numpy as np

from shapeshift.rasterizer.splat_edges import BAND_PX, EDGE_POWER, KINDS, POINT_PX
from shapeshift.renderer.gl.buffers import Arena, bind
from shapeshift.renderer.gl.gpu import Gpu, overwrite
from shapeshift.renderer.gl.project import Projector
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View


def draw_edges(
    gpu: Gpu, projector: Projector, arena: Arena, view: View, settings: RenderSettings, kind: str
) -> np.ndarray:
    """(H, W, 4) float32 display sRGB and coverage, row 0 on top, in the order that is there.

    Projects the arena again: records and keys become the view's; the counts of before stay.
    """
    width, height = view.size
    if not arena.count:
        return np.zeros((height, width, 4), np.float32)
    counts = arena.counts.read()
    projector.project(arena, [view], settings, keep_outside=True)
    overwrite(arena.counts, counts)
    program = gpu.program("splat.vert", "splat_edges.frag", HEAT=0, KIND=KINDS.index(kind))
    values = {
        "size": view.size, "min_alpha": settings.min_alpha, "first": 0, "per_unit": 1.0,
        "edge_power": EDGE_POWER, "radius": POINT_PX, "band": BAND_PX,
    }  # fmt: skip
    for name, value in values.items():
        if name in program:  # a kind does not ask for all of them
            program[name].value = value
    target = gpu.target(view.size, "f4")
    triangles = gpu.ctx.vertex_array(program, [])
    bind(order=arena.order, records=arena.records, counts=arena.counts)
    with gpu.drawing_into(target):
        target.clear(0.0, 0.0, 0.0, 0.0)
        gpu.ctx.enable_only(moderngl.NOTHING)
        triangles.render_indirect(arena.command, moderngl.TRIANGLES, count=1)
    texture = target.color_attachments[0]
    image = np.frombuffer(texture.read(), np.float32).reshape(height, width, 4)[::-1].copy()
    for made in (triangles, target, texture):
        made.release()
    return image
