"""foveated: a view drawn twice by quads, its middle in all pixels, the rest in a quarter of them.

Records and order are the same; the depth test keeps each drawing to its part.
"""

from functools import lru_cache

import moderngl
import numpy as np

from shapeshift.rasterizer.foveate import Fovea
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.splat import Splatter
from shapeshift.scene.pose import HiddenMesh, View

SIDES = 48  # of the polygons in place of circles: 0.2 % of a radius
MARGIN = 6  # pixels inside the inner circle that the outer drawing has, too: samples beside these


class FoveatedSplatter:
    """Draws views through a Splatter of its own for either part, into the pictures of another."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._parts = Splatter(gpu), Splatter(gpu)  # the middle, the rest
        self._triangles: dict[int, moderngl.VertexArray] = {}

    def draw(
        self, splatter: Splatter, arena: Arena, i: int, view: View, fovea: Fovea,
        min_alpha: float, row: int, heat: moderngl.Buffer | None,
    ) -> None:  # fmt: skip
        """Into image i of the splatter; the arena as Splatter.draw takes it."""
        width, height = view.size
        half = (width + 1) // 2, (height + 1) // 2
        # A pixel of the half is two of the whole, also where it reaches over the edge.
        outer = wider(view, half)
        far, near = parts_of(fovea, view.tangents, view.size, view.hidden)
        for part, seen, mesh in zip(self._parts, (view, outer), (far, near), strict=True):
            part.target, part.unit = splatter.target, splatter.unit
            covered = (2 * half[0], 2 * half[1]) if seen is outer else view.size
            eye = View(
                seen.world_from_eye, seen.tangents, seen.near, seen.far, seen.size, hidden=mesh
            )
            part.draw(arena, i, seen.size, min_alpha, row, heat, eye, covered)
        self._compose(splatter.target_of(i, view.size, heat is not None), i, fovea)

    def _compose(self, target: moderngl.Framebuffer, i: int, fovea: Fovea) -> None:
        gpu, images = self._gpu, len(target.color_attachments)
        program, triangle = self._program_for(images)
        middle, rest = self._parts
        textures = {
            name + of: part.texture(i, number)
            for name, part in (("sharp", middle), ("halved", rest))
            for number, of in zip(range(images), ("", "_heat"), strict=False)
        }
        for unit, (name, texture) in enumerate(textures.items()):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
            texture.use(unit)
            program[name].value = unit
        program["centre"].value = fovea.centre[0], target.height - fovea.centre[1]
        program["unit"].value, program["circles"].value = fovea.unit, (fovea.inner, fovea.outer)
        with gpu.drawing_into(target):
            gpu.ctx.enable_only(moderngl.NOTHING)
            triangle.render(moderngl.TRIANGLES, vertices=3)

    def _program_for(self, images: int) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """What composes pictures, with or without a second one of heat."""
        program = self._gpu.program("full.vert", "lenses/foveate.frag", HEAT=images - 1)
        if images not in self._triangles:
            self._triangles[images] = self._gpu.ctx.vertex_array(program, [])
        return program, self._triangles[images]

    def release(self) -> None:
        for part in self._parts:
            part.release()
        for triangles in self._triangles.values():
            triangles.release()
        self._triangles.clear()


def wider(view: View, half: tuple[int, int]) -> View:
    """The view in `half` pixels of two of its own each: an odd number of its own has one more at
    the right, and at the top, where row 0 of GL is not.
    """
    left, right, down, up = view.tangents
    width, height = view.size
    right = left + (right - left) * 2 * half[0] / width
    up = down + (up - down) * 2 * half[1] / height
    return View(view.world_from_eye, (left, right, down, up), view.near, view.far, half)


@lru_cache(maxsize=16)
def parts_of(
    fovea: Fovea, tangents: tuple[float, float, float, float], size: tuple[int, int],
    hidden: HiddenMesh | None,
) -> tuple[HiddenMesh, HiddenMesh]:  # fmt: skip
    """What the drawing of the middle leaves out, and that of the rest; and what the lens hides."""
    left, _, _, up = tangents
    centre = np.array(
        [left + fovea.centre[0] * fovea.unit[0], up - fovea.centre[1] * fovea.unit[1]]
    )
    angles = np.linspace(0, 2 * np.pi, SIDES + 1)
    circle = np.stack([np.cos(angles), np.sin(angles)], 1)  # (SIDES + 1, 2)
    a, b = circle[:-1], circle[1:]
    # Polygons that hold their circle, and that lie in it.
    around = fovea.outer / np.cos(np.pi / SIDES)
    end = 2 * (abs(centre).sum() + abs(np.array(tangents)).max() + around) * np.sqrt(2)
    ring = np.concatenate(
        [
            np.stack([around * a, end * a, end * b], 1),
            np.stack([around * a, end * b, around * b], 1),
        ]
    )
    within = max(fovea.inner - MARGIN * max(fovea.unit), 0.0)
    disc = np.stack([np.zeros_like(a), within * a, within * b], 1)
    lens = [] if hidden is None else [hidden.triangles]
    return (
        HiddenMesh(np.concatenate([centre + ring, *lens])),
        HiddenMesh(np.concatenate([centre + disc, *lens])),
    )
