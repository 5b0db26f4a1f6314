"""Shadows over the room itself: each darkens what the cameras show where its plane lies."""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.shadow.occlusion import CELLS, Shadow
from shapeshift.vr.shown import SHADERS


@dataclass(frozen=True)
class Cast:
    """A shadow where it lies."""

    name: str  # of the object
    shadow: Shadow
    place: np.ndarray  # (3,) metres of the world: the object's x and z, the height of its plane


class Shadows:
    """The program for them, and a texture an object; the context may be anybody's."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "shadow.vert", "shadow.frag", SHADERS)
        self._square = ctx.vertex_array(self._program, [])
        self._pictures: dict[str, tuple[Shadow, moderngl.Texture]] = {}

    def draw(self, framebuffer: moderngl.Framebuffer, view: View, casts: Iterable[Cast]) -> None:
        """Below the premultiplied picture of an eye, `view` in the world; none from underneath."""
        ctx, program = self._ctx, self._program
        eye = view.world_from_eye.position
        seen = [cast for cast in casts if eye[1] > cast.place[1]]
        if not seen:
            return
        before = ctx.fbo or ctx.detect_framebuffer(0)
        framebuffer.use()
        ctx.enable_only(moderngl.BLEND)
        # What is below shows through by what alpha has left: splats, then the shadows one by one.
        ctx.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
        matrix = view.clip_from_eye() @ view.eye_from_world()
        try:
            for cast in seen:
                shadow = cast.shadow
                self._picture(cast).use(0)
                program["occlusion"].value, program["side_m"].value = 0, shadow.side_m
                corner = cast.place + np.array([shadow.corner[0], 0.0, shadow.corner[1]])
                # From the eye on, so that floats stay exact far from the origin.
                moved = matrix.copy()
                moved[:, 3] += matrix[:, :3] @ eye
                program["clip_from_world"].write(moved.T.astype(np.float32).tobytes())
                program["corner"].value = tuple(corner - eye)
                self._square.render(moderngl.TRIANGLE_STRIP, vertices=4)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def _picture(self, cast: Cast) -> moderngl.Texture:
        kept = self._pictures.get(cast.name)
        if kept is not None and kept[0] is cast.shadow:
            return kept[1]
        texture = kept[1] if kept is not None else self._ctx.texture((CELLS, CELLS), 1, dtype="f4")
        texture.filter = moderngl.LINEAR, moderngl.LINEAR
        texture.repeat_x = texture.repeat_y = False
        texture.write(cast.shadow.occlusion)
        self._pictures[cast.name] = cast.shadow, texture
        return texture

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        for _, texture in self._pictures.values():
            texture.release()
        self._pictures.clear()
        self._square.release()
        self._program.release()
