"""Shadows over the room itself: each darkens what the cameras show where its plane lies."""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.shown import SHADERS

# How much an object keeps off the plane that it stands on, of a light that comes from all of the
# sky alike: its shadow on a table.
#
# At a place p of the plane with the normal n, T the light that comes through along a direction w,
#     O(p) = 1/pi  integral over the hemisphere of (1 - T(p, w)) (n.w) dw
# The splats are turned into a grid of extinction: slices of cells over the plane.  Directions are
# drawn by n.w, so that O is the plain mean of 1 - T; along a direction each slice is shifted aside
# and added: exp(-sum) is T.

CELLS = 64  # a side of the picture
SLICES = 20  # closer to each other near the plane
GRADED = 1.5  # exponent of their heights
DIRECTIONS = 96
GOLDEN = np.pi * (3 - np.sqrt(5))  # turns that never meet again: even over the sky
MOST_SPLATS = 8_000  # of more every n-th stands for its neighbours
LEAST_OPACITY = 0.05  # haze casts no shadow
AROUND = 0.75  # of an object's width or height: so far the picture reaches beyond it
FADES = 0.7  # of the half picture: from there on the shadow goes to nothing at its edge
STRAY = 0.005  # of the splats at either end are no measure of an object's size


@dataclass(frozen=True)
class Blocks:
    """What of an object keeps light off: points with a cross-section each."""

    points: np.ndarray  # (n, 3) metres, in the object's frame
    areas: np.ndarray  # (n,) m^2, in the mean over all directions


@dataclass(frozen=True)
class Shadow:
    """A picture of O, level with the plane."""

    corner: tuple[float, float]  # x and z of its lower corner, metres from the object's own place
    side_m: float
    occlusion: np.ndarray  # (CELLS, CELLS) float32, rows along z, 0..1, 0 at the edge


def blocks_of(mean_opacity: np.ndarray, covariance: np.ndarray) -> Blocks:
    """Of splats (n, 4) and (n, 6 or more), as an arena has them.

    A splat is seven points: its mean and a sigma and a fifth each way along its axes.  Its
    cross-section with standard deviations a, b, c: 2 pi opacity (ab + bc + ac) / 3.
    """
    seen = (mean_opacity[:, 3] > LEAST_OPACITY) & np.isfinite(mean_opacity).all(1)
    rows = np.flatnonzero(seen)
    step = max(-(-len(rows) // MOST_SPLATS), 1)
    rows = rows[::step]
    six = covariance[rows, :6].astype(np.float64)
    matrices = six[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    finite = np.isfinite(matrices).all((1, 2))
    rows, matrices = rows[finite], matrices[finite]
    variances, axes = np.linalg.eigh(matrices)
    a, b, c = sigmas = np.sqrt(np.maximum(variances, 0.0)).T
    area = 2 * np.pi * mean_opacity[rows, 3] * (a * b + b * c + a * c) / 3 * step
    means = mean_opacity[rows, :3].astype(np.float64)
    ways = 1.2 * sigmas.T[:, None, :] * axes  # (n, 3 axes' components, 3 axes)
    ends = np.concatenate([ways, -ways], 2).transpose(0, 2, 1)  # (n, 6, 3)
    points = np.concatenate([means[:, None], means[:, None] + ends], 1)
    return Blocks(points.reshape(-1, 3), np.repeat(area / 7, 7))


def shadow_on(blocks: Blocks, world_from_object: np.ndarray, plane_y: float) -> Shadow | None:
    """On the level plane at a height of the world; None where nothing is above it.

    world_from_object: (4, 4).  The picture lies about the object's own place in x and z.
    """
    points = blocks.points @ world_from_object[:3, :3].T
    points[:, 1] += world_from_object[1, 3] - plane_y
    above = points[:, 1] > 0
    points, areas = points[above], blocks.areas[above]
    if not len(points):
        return None
    low, high = np.quantile(points, (STRAY, 1 - STRAY), axis=0)
    wide, top = float(max(high[0] - low[0], high[2] - low[2])), float(high[1])
    side = wide + 2 * AROUND * max(wide, min(top, 2 * wide))
    if not (side > 0 and top > 0):
        return None
    corner = (low[[0, 2]] + high[[0, 2]]) / 2 - side / 2
    depth, heights = _slices(points, areas, corner, side, top)
    at = (np.arange(CELLS) + 0.5) / CELLS * 2 - 1
    fades = np.clip((1 - np.hypot.outer(at, at)) / (1 - FADES), 0.0, 1.0)
    smooth = fades * fades * (3 - 2 * fades)
    occlusion = blurred(_occlusion(depth, heights * CELLS / side)) * smooth
    picture = np.ascontiguousarray(occlusion, np.float32)
    return Shadow((float(corner[0]), float(corner[1])), side, picture)


def blurred(picture: np.ndarray) -> np.ndarray:
    """Twice 1 2 1 along both axes, edges held: edges of single directions are not to be seen."""
    for _ in range(2):
        for axis in (0, 1):
            ends = np.pad(picture, [(1, 1) if a == axis else (0, 0) for a in (0, 1)], "edge")
            low, high = ends[:-2, :], ends[2:, :]
            if axis:
                low, high = ends[:, :-2], ends[:, 2:]
            picture = (low + 2 * picture + high) / 4
    return picture


def _slices(
    points: np.ndarray, areas: np.ndarray, corner: np.ndarray, side: float, top: float
) -> tuple[np.ndarray, np.ndarray]:
    """(SLICES, CELLS, CELLS) optical depth along the normal, and the heights of their middles."""
    edges = top * (np.arange(SLICES + 1) / SLICES) ** GRADED
    cell = side / CELLS
    column, row = ((points[:, [0, 2]] - corner) / cell).astype(int).T
    which = np.clip(np.searchsorted(edges, points[:, 1]) - 1, 0, SLICES - 1)
    inside = (column >= 0) & (column < CELLS) & (row >= 0) & (row < CELLS)
    number = ((which * CELLS + row) * CELLS + column)[inside]
    depth = np.bincount(number, areas[inside], SLICES * CELLS * CELLS) / cell**2
    shape = (SLICES, CELLS, CELLS)
    return depth.reshape(shape).astype(np.float32), (edges[1:] + edges[:-1]) / 2


def _occlusion(depth: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """(CELLS, CELLS) mean of 1 - T; heights in cells."""
    wide = np.zeros((SLICES, 3 * CELLS, 3 * CELLS), np.float32)
    wide[:, CELLS:-CELLS, CELLS:-CELLS] = depth
    total = np.zeros((CELLS, CELLS), np.float32)
    used = [k for k in range(SLICES) if depth[k].any()]
    for i in range(DIRECTIONS):
        share = (i + 0.5) / DIRECTIONS  # sin^2 of the angle to the normal: equal parts of n.w
        slant, along = np.sqrt(share / (1 - share)), 1 / np.sqrt(1 - share)
        x, z = slant * np.cos(GOLDEN * i), slant * np.sin(GOLDEN * i)
        light = np.zeros((CELLS, CELLS), np.float32)
        for k in used:
            column, row = round(heights[k] * x) + CELLS, round(heights[k] * z) + CELLS
            if 0 <= column <= 2 * CELLS and 0 <= row <= 2 * CELLS:
                light += wide[k, row : row + CELLS, column : column + CELLS]
        total += 1 - np.exp(-along * light)
    return total / DIRECTIONS


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
