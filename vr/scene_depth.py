"""How far the splats are in an eye's picture: for what is drawn over them, and the compositor.

Expected depth, of the renderer's `presentable_depth`: the same blending as of colours, so both
drawings have it, and opaque surfaces lie where they are.  Before a half-transparent veil a thing
is seen, behind it, it fades.  A median would be sharper at edges; blending back to front, which
quads do, does not know it.
"""

from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.shown import SHADERS

NO_SLACK = (0.0, 0.0)
SOLID_SLACK = (0.01, 0.01)  # metres, and part of the depth, that hands and the panel may lie behind
LINE_SLACK = (0.03, 0.03)  # what lies on a surface: a captured floor is as rough


@dataclass(frozen=True)
class EyeDepth:
    """Of one eye, in a frame."""

    texture: moderngl.Texture  # metres of the world times coverage, ..., coverage; row 0 below
    scale: float  # metres of the world a metre of the room


class SceneDepth:
    """The depth of one eye, from whichever drawing; use it in a `with` or release it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "full.vert", "clip_depth.frag", SHADERS)
        self._triangle = ctx.vertex_array(self._program, [])
        self._uploaded: moderngl.Texture | None = None

    def of(self, source: moderngl.Texture | np.ndarray, scale: float) -> EyeDepth:
        """What a drawing has: a texture, or (H, W, 4) with row 0 on top."""
        texture = self._upload(source) if isinstance(source, np.ndarray) else source
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x = texture.repeat_y = False
        return EyeDepth(texture, scale)

    def write(self, framebuffer: moderngl.Framebuffer, play_view: View, depth: EyeDepth) -> None:
        """Fills a framebuffer's depth, 0 at the view's near and 1 at its far, and nothing else."""
        ctx, program = self._ctx, self._program
        bind_depth(program, depth, NO_SLACK)
        program["near_m"].value, program["far_m"].value = play_view.near, play_view.far
        before = ctx.fbo or ctx.detect_framebuffer(0)
        framebuffer.use()
        try:
            framebuffer.depth_mask = True
            framebuffer.clear(depth=1.0)
            ctx.enable_only(moderngl.DEPTH_TEST)
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()  # the runtime may take its texture away, and with it the framebuffer

    def _upload(self, source: np.ndarray) -> moderngl.Texture:
        size = (source.shape[1], source.shape[0])
        if self._uploaded is None or self._uploaded.size != size:
            self._release_upload()
            self._uploaded = self._ctx.texture(size, 4, dtype="f4")
        self._uploaded.write(np.ascontiguousarray(source[::-1], np.float32))
        return self._uploaded

    def _release_upload(self) -> None:
        if self._uploaded is not None:
            self._uploaded.release()
            self._uploaded = None

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        self._release_upload()
        self._triangle.release()
        self._program.release()

    def __enter__(self) -> "SceneDepth":
        return self

    def __exit__(self, *failure) -> None:
        self.release()


def bind_depth(
    program: moderngl.Program, depth: EyeDepth | None, slack: tuple[float, float]
) -> None:
    """Sets what scene_depth.glsl reads; None: nothing is hidden."""
    for name, value in (
        ("scene_depth", 3), ("has_depth", depth is not None), ("slack", slack),
        ("play_per_world", 1 / depth.scale if depth else 1.0),
    ):  # fmt: skip
        if name in program:  # a compiler leaves out what is not used
            program[name].value = value
    if depth is not None:
        depth.texture.use(3)
