"""A faint grid on the floor and a horizon, behind the splats: nobody stands in a black void.

The grid stays with the world, so that one sees that and how fast one moves: it is clearer while
one does.  Drawn over an eye's picture where splats leave it uncovered.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.frame import Area, Frame
from shapeshift.vr.glove import Capsule
from shapeshift.vr.play_space import PlaySpace
from shapeshift.vr.shown import SHADERS

REST = 0.35  # of the clearness while one moves
RISES_S, FALLS_S = 0.08, 0.7  # time constants of its clearness
BRIGHT = 0.5  # mean of a background from which on lines are darker than it
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Grid:
    """The floor in a frame."""

    level_m: float  # its height in the world
    clearness: float = REST  # 0..1; 0: nothing is drawn


def clearness(before: float, was: PlaySpace, now: PlaySpace, seconds: float) -> float:
    """How clear the grid is after `seconds`: it comes as the room is moved, and goes slowly."""
    moves = was.scale != now.scale or not (
        np.array_equal(was.world_from_play.position, now.world_from_play.position)
        and np.array_equal(was.world_from_play.wxyz, now.world_from_play.wxyz)
    )
    goal, lasts = (1.0, RISES_S) if moves else (REST, FALLS_S)
    part = -math.expm1(-max(seconds, 0.0) / lasts)
    return before + (goal - before) * part


class CoverageTexture:
    """How much splats hide of what is behind them, as a texture whose alpha says so."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._uploaded: moderngl.Texture | None = None  # a coverage that came as an array

    def of(self, coverage: moderngl.Texture | np.ndarray) -> tuple[moderngl.Texture, bool]:
        """The texture, and whether row 0 is on top: of an array (H, W) it is."""
        if not isinstance(coverage, np.ndarray):
            return coverage, False
        size = (coverage.shape[1], coverage.shape[0])
        if self._uploaded is None or self._uploaded.size != size:
            self.release()
            self._uploaded = self._ctx.texture(size, 1, dtype="f4")
            self._uploaded.swizzle = "000R"  # where a splatter's texture has it
            self._uploaded.repeat_x = self._uploaded.repeat_y = False
        self._uploaded.write(np.ascontiguousarray(coverage, np.float32))
        return self._uploaded, True

    def release(self) -> None:
        if self._uploaded is not None:
            self._uploaded.release()
            self._uploaded = None


class Floor:
    """The program for it; use it in a `with`."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._program = compile_program(ctx, "full.vert", "floor.frag", SHADERS)
        self._triangle = ctx.vertex_array(self._program, [])
        self._coverage = CoverageTexture(ctx)

    def draw(
        self,
        framebuffer: moderngl.Framebuffer,
        play_view: View,
        play_space: PlaySpace,
        coverage: moderngl.Texture | np.ndarray,
        grid: Grid,
        background: tuple[float, float, float],
    ) -> None:
        """Adds to the framebuffer, which shows the splats over `background`.

        coverage: 0..1 in a texture's alpha, row 0 at the bottom, or (H, W), row 0 on top.
        """
        if not grid.clearness > 0:
            return
        ctx, program = self._ctx, self._program
        spacing, finer = spacing_of(play_space.scale)
        eye = play_space.point(play_view.world_from_eye.position)
        whole = 10 * spacing  # a multiple of all lines: floats stay exact far from the origin
        rotation = (play_space.world_from_play.matrix() @ play_view.world_from_eye.matrix())[:3, :3]
        program["eye"].value = tuple(eye - np.floor(eye / whole) * whole * (1 - UP))
        program["world_from_eye"].write(rotation.T.astype(np.float32).tobytes())
        program["tangents"].value = play_view.tangents
        program["level_m"].value, program["scale"].value = grid.level_m, play_space.scale
        program["spacing_m"].value, program["finer"].value = spacing, finer
        program["clearness"].value = grid.clearness
        texture, from_array = self._coverage.of(coverage)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.use(0)
        program["coverage"].value, program["top_first"].value = 0, from_array
        before = ctx.fbo or ctx.detect_framebuffer(0)
        framebuffer.use()
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE
        darker = np.mean(background) > BRIGHT
        ctx.blend_equation = moderngl.FUNC_REVERSE_SUBTRACT if darker else moderngl.FUNC_ADD
        try:
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        finally:
            ctx.blend_equation = moderngl.FUNC_ADD
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def __enter__(self) -> "Floor":
        return self

    def __exit__(self, *failure) -> None:
        self.release()

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        self._coverage.release()
        self._triangle.release()
        self._program.release()


def spacing_of(scale: float) -> tuple[float, float]:
    """Metres of the world between lines, and how much those of a tenth of it are seen, 0..1.

    A power of ten that is 1 to 10 m in the room; while the world is scaled finer lines fade in and
    out, and lines become those of a tenth, so that none jumps.
    """
    exponent = math.log10(scale)
    whole = math.floor(exponent)
    return 10.0 ** (whole + 1), 1.0 - (exponent - whole)


# The edges of the free room around the person: lines that appear where head or hands come near.
#
# They are drawn over all splats: a captured wall shall not hide a real one.

SEEN_M, CLEAR_M = 0.7, 0.25  # metres from an edge where its lines begin to show, and are clearest
AROUND_M = 0.9  # so far along the wall from who is near
POST_M, HEIGHTS_M = 0.3, (0.02, 0.8, 1.6)  # metres between posts; of the level lines
LINE_M, COLOR = 0.003, (0.42, 0.80, 0.98)  # radius; display sRGB
MOST = 0.85  # opacity


def area_edges(frame: Frame) -> tuple[Capsule, ...]:
    """What is seen of them in a frame; none where the runtime does not know them."""
    if frame.area is None:
        return ()
    grips = [hand.grip.position for hand in frame.hands.values() if hand.grip is not None]
    return tuple(edges(frame.area, [frame.head.position, *grips]))


def edges(area: Area, places: Sequence[np.ndarray]) -> list[Capsule]:
    """Lines on its four walls near any of places (3,), all in metres of the room."""
    to_play = area.play_from_area.matrix()
    half = np.array(area.size_m) / 2
    lines: list[Capsule] = []
    for place in places:
        local = to_play[:3, :3].T @ (place - to_play[:3, 3])
        for axis in (0, 2):  # walls across x, then across z
            for sign in (-1.0, 1.0):
                wall = sign * half[axis // 2]
                away = sign * (wall - local[axis])  # negative beyond it
                near = float(np.clip((SEEN_M - away) / (SEEN_M - CLEAR_M), 0, 1))
                if near > 0:
                    reach = half[1 - axis // 2]
                    lines += _wall(to_play, axis, wall, float(local[2 - axis]), reach, near)
    return lines


def _wall(
    to_play: np.ndarray, axis: int, wall: float, middle: float, reach: float, near: float
) -> list[Capsule]:
    """Level lines and posts of one wall around `middle` along it; it ends at +-reach."""
    first, last = max(middle - AROUND_M, -reach), min(middle + AROUND_M, reach)
    if not first < last:
        first, last = (reach - AROUND_M, reach) if middle > 0 else (-reach, AROUND_M - reach)

    def point(along: float, up: float) -> np.ndarray:
        local = np.array([0.0, up, 0.0])
        local[axis], local[2 - axis] = wall, along
        return to_play[:3, :3] @ local + to_play[:3, 3]

    def ink(along: float) -> tuple[float, ...]:
        faded = max(1 - abs(along - middle) / AROUND_M, 0.0)
        return (*COLOR, MOST * near * faded)

    thick, bottom, top = (LINE_M, LINE_M), HEIGHTS_M[0], HEIGHTS_M[-1]
    posts = np.arange(np.ceil(first / POST_M), np.floor(last / POST_M) + 1) * POST_M
    marks = sorted({first, *posts.tolist(), last})
    lines = [Capsule(point(a, bottom), point(a, top), thick, ink(a)) for a in marks]
    for up in HEIGHTS_M:
        for a, b in pairwise(marks):
            lines.append(Capsule(point(a, up), point(b, up), thick, ink(a), ink(b)))
    return lines
