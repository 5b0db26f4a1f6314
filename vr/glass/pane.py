"""Lays the picture of another stop over an eye's, within a glass in the room."""

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.glass.held import HeldGlass, PixelBox
from shapeshift.vr.scene_depth import SOLID_SLACK, EyeDepth, bind_depth
from shapeshift.vr.shown import SHADERS

CUT = (moderngl.ZERO, moderngl.ONE_MINUS_SRC_ALPHA)
ADD = (moderngl.ONE, moderngl.ONE)
SPARE = 1.02  # of the radius: the edge is soft


class Pane:
    """The program for it; use it in a `with` or release it."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "panel.vert", "glass.frag", SHADERS)
        self._corners = ctx.vertex_array(self._program, [])

    def draw(
        self, framebuffer: moderngl.Framebuffer, play_view: View, glass: HeldGlass,
        picture: moderngl.Texture, box: PixelBox, depth: EyeDepth | None = None,
    ) -> None:  # fmt: skip
        """picture: what the pixels of `box` show through the glass, row 0 below.

        What lies behind the splats of `depth` stays as it is.
        """
        ctx, program = self._ctx, self._program
        before = ctx.fbo or ctx.detect_framebuffer(0)
        clip = play_view.clip_from_eye() @ play_view.eye_from_world()
        clip = clip @ glass.play_from_glass.matrix()
        values = {
            "picture": 0, "box": box, "radius": glass.radius_m, "size": framebuffer.size,
            "half_size": (glass.radius_m * SPARE,) * 2, "top_first": False,
        }  # fmt: skip
        for name, value in values.items():
            if name in program:  # a compiler leaves out what is not used
                program[name].value = value
        program["clip_from_panel"].write(clip.T.astype(np.float32).tobytes())
        bind_depth(program, depth, SOLID_SLACK)
        picture.use(0)
        framebuffer.use()
        ctx.enable_only(moderngl.BLEND)
        try:
            for cut, blending in ((True, CUT), (False, ADD)):
                program["cut"].value, ctx.blend_func = cut, blending
                self._corners.render(moderngl.TRIANGLE_STRIP, vertices=4)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        self._corners.release()
        self._program.release()

    def __enter__(self) -> "Pane":
        return self

    def __exit__(self, *failure) -> None:
        self.release()
