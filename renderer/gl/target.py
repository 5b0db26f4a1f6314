"""What quads blend into: settings.target made into a format, and the unit its colours count in.

GL_RGBA16 holds 0 to 1 in steps of 1/65535: many faint layers add up to 82 dB where half floats, of
the same bytes, leave 46, since their steps near 1 are 1/2048.  Colours above 1 do not fit; so they
are divided by the brightest that the scene can have, which blending does not notice, and multiplied
again on the way out.  GL 4.3 says that every driver draws into it and blends (8.5.1, 17.3.8).
"""

import logging
import math
from functools import cache

import moderngl
import numpy as np

from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.runtime_models.colors.color_bounds import color_range
from shapeshift.runtime_models.model import Model
from shapeshift.scene.pose import HiddenMesh, View

DTYPES = {"rgba8": "f1", "rgba16": "nu2", "rgba16f": "f2", "rgba32f": "f4"}  # moderngl's
# There 100,000 faint layers and a leg are still 5 to 8 dB better than in half floats; twice that
# would be the end of it (each doubling costs up to 6 dB).
MOST_UNIT = 64.0


def brightest(models: list[Model]) -> float:
    """The largest display value of any colour, at least 1; infinite where a colour may be below 0
    or nothing bounds it.
    """
    ranges = [color_range(model) for model in models]
    if any(least < 0 for least, _ in ranges):
        return math.inf
    return max((most for _, most in ranges), default=1.0)


def choose_target(gpu: Gpu, asked: str, most: float) -> tuple[str, float]:
    """(name in DTYPES, unit) for a settings.target and the brightest colour.

    "auto": rgba16 where all colours fit, else half floats, which hold any.
    """
    if asked not in ("auto", "rgba16"):
        return asked, 1.0
    if not draws_into(gpu, "rgba16"):
        warn_once(
            f"this driver ({gpu.ctx.info['GL_RENDERER']}) does not draw into GL_RGBA16, which GL "
            "4.3 asks for; half floats are blended instead: many faint layers get too dark."
        )
        return "rgba16f", 1.0
    fits = most <= MOST_UNIT
    if asked == "auto" and not fits:
        return "rgba16f", 1.0
    return "rgba16", max(most, 1.0) if fits else 1.0


def draws_into(gpu: Gpu, name: str) -> bool:
    """Whether a picture of that format can be drawn into; asked once of a context."""
    if name not in gpu.targets:
        try:
            made = gpu.target((1, 1), DTYPES[name])
        except moderngl.Error:  # the framebuffer is not complete
            gpu.targets[name] = False
        else:
            made.color_attachments[0].release()
            made.release()
            gpu.targets[name] = True
    return gpu.targets[name]


@cache
def warn_once(sentence: str) -> None:
    logging.getLogger("renderer").warning(sentence)


class HiddenDepths:
    """Depth beside the pictures of views that have a hidden mesh: what nobody sees is drawn first,
    nearest, so that no splat is shaded there.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._program: moderngl.Program | None = None
        self._meshes: dict[int, tuple[HiddenMesh, moderngl.VertexArray, moderngl.Buffer]] = {}
        self._targets: dict[int, moderngl.Framebuffer] = {}

    def around(self, i: int, picture: moderngl.Framebuffer, view: View) -> moderngl.Framebuffer:
        """The picture of view i with depth 0 where it is hidden and 1 elsewhere, and no colours."""
        assert view.hidden is not None
        target, ctx = self._target(i, picture), self._gpu.ctx
        program, triangles = self._mesh(i, view.hidden)
        left, right, down, up = view.tangents
        program["low"].value, program["high"].value = (left, down), (right, up)
        with self._gpu.drawing_into(target):
            target.depth_mask = True
            target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            ctx.enable_only(moderngl.DEPTH_TEST)
            triangles.render(moderngl.TRIANGLES)
            target.depth_mask = False
        return target

    def _mesh(self, i: int, mesh: HiddenMesh) -> tuple[moderngl.Program, moderngl.VertexArray]:
        if self._program is None:
            self._program = self._gpu.program("lenses/hidden.vert", "lenses/hidden.frag")
        kept = self._meshes.get(i)
        if kept is None or kept[0] is not mesh:
            self._forget_mesh(i)
            buffer = self._gpu.ctx.buffer(np.ascontiguousarray(mesh.triangles, np.float32))
            drawn = self._gpu.ctx.vertex_array(self._program, [(buffer, "2f", "tangents")])
            self._meshes[i] = mesh, drawn, buffer
        return self._program, self._meshes[i][1]

    def _target(self, i: int, picture: moderngl.Framebuffer) -> moderngl.Framebuffer:
        old, ctx = self._targets.get(i), self._gpu.ctx
        if old is not None and old.color_attachments == picture.color_attachments:
            return old
        self._forget_target(i)
        depth = ctx.depth_renderbuffer(picture.size)
        self._targets[i] = ctx.framebuffer(picture.color_attachments, depth)
        return self._targets[i]

    def _forget_mesh(self, i: int) -> None:
        if (old := self._meshes.pop(i, None)) is not None:
            old[1].release()
            old[2].release()

    def _forget_target(self, i: int) -> None:
        if (old := self._targets.pop(i, None)) is not None:
            old.depth_attachment.release()
            old.release()

    def release(self) -> None:
        for i in [*self._meshes]:
            self._forget_mesh(i)
        for i in [*self._targets]:
            self._forget_target(i)
