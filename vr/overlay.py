"""Draws hands, lines, the panel, cards and the vignette over the splats' picture of an eye."""

from dataclasses import dataclass, replace

import moderngl
import numpy as np

from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.gl.shader import compile_program
from shapeshift.scene.pose import View
from shapeshift.vr.cards import Flats
from shapeshift.vr.drawn import Drawn, PanelQuad
from shapeshift.vr.glove import Capsule
from shapeshift.vr.scene_depth import LINE_SLACK, SOLID_SLACK, EyeDepth, bind_depth
from shapeshift.vr.shown import SHADERS


@dataclass(frozen=True)
class Detail:
    """How finely it is drawn."""

    samples: int = 4  # a pixel: edges of hands and thin lines crawl without; 0: one
    taps: int = 4  # of the panel's picture, a pixel: small letters crawl without
    around: int = 12  # facets of a capsule around it
    below: int = 3  # and from its equator to its tip


FINE = Detail()
PLAIN = Detail(0, 1, 8, 2)  # software GL: under half of the time, and no headset hangs on it
INSTANCE = "3f 3f 2f 4f 4f/i"
NAMES = ("a", "b", "radii", "color_a", "color_b")
ROOM = 256  # capsules that the buffer has room for at first
CORNERS = np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])  # of a flat picture, halves of its sides
SPARE = 3  # pixels around what is drawn: lines are widened to nearly one
MOST_SIZES = 2  # of an eye's wide picture, and of its inset
PANEL_CORNER_M = 0.011  # radius
OVER = (moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
CUT = (moderngl.ZERO, moderngl.ONE_MINUS_SRC_ALPHA)


PixelBox = tuple[int, int, int, int]  # left, bottom, width, height


class Overlay:
    """Programs, the capsule's mesh, pictures of cards; use it in a `with`.

    The context may be anybody's: nothing is enabled afterwards, and bound is what was bound.
    """

    def __init__(self, ctx: moderngl.Context, detail: Detail | None = None) -> None:
        self._ctx = ctx
        self.detail = detail or (PLAIN if is_software(ctx) else FINE)
        self._capsule = compile_program(ctx, "capsule.vert", "capsule.frag", SHADERS)
        self._flats = Flats(ctx, self.detail.taps)
        self._over = compile_program(ctx, "full.vert", "over.frag", SHADERS)
        mesh, faces = capsule_mesh(self.detail.around, self.detail.below)
        self._mesh, self._faces = ctx.buffer(mesh), ctx.buffer(faces)
        self._instances = ctx.buffer(reserve=ROOM * 16 * 4)
        self._capsules = self._vertices()
        self._triangle = ctx.vertex_array(self._over, [])
        # Of a size: with several samples a pixel, and with one; the last few are kept.
        self._targets: dict[tuple[int, int], tuple[moderngl.Framebuffer, moderngl.Framebuffer]] = {}

    def draw(
        self, framebuffer: moderngl.Framebuffer, play_view: View, drawn: Drawn,
        depth: EyeDepth | None = None,
    ) -> None:  # fmt: skip
        """Over what the framebuffer, display-encoded, shows of `play_view`, an eye in the room.

        What lies behind the splats of `depth` is not seen.  A panel that is a layer of its own
        leaves a hole, alpha 0.
        """
        box = box_of(drawn, play_view, framebuffer.size)
        dark = drawn.vignette > 0 or drawn.blink > 0
        if box is None and not dark:
            return
        ctx = self._ctx
        before = ctx.fbo or ctx.detect_framebuffer(0)
        hole = drawn.panel if drawn.panel is not None and drawn.panel.apart else None
        try:
            objects = None
            if box:
                objects = self._draw_things(framebuffer.size, play_view, drawn, box, depth)
            if hole is not None and box:
                if dark:
                    self._lay_over(framebuffer, play_view, drawn, None, None)
                    drawn = replace(drawn, vignette=0.0, blink=0.0)
                self._cut_panel(framebuffer, play_view, hole, depth)
            self._lay_over(framebuffer, play_view, drawn, box, objects)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def show_behind(
        self, framebuffer: moderngl.Framebuffer, play_view: View, panel: PanelQuad
    ) -> None:
        """The panel in the hole that `draw` has left for it: what the runtime makes of both."""
        ctx = self._ctx
        before = ctx.fbo or ctx.detect_framebuffer(0)
        framebuffer.use()
        ctx.enable_only(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
        try:
            self._place_panel(panel, framebuffer.size, play_view, None, False, corner_m=0.0)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def write_depth(self, framebuffer: moderngl.Framebuffer, play_view: View, drawn: Drawn) -> None:
        """The hands into a framebuffer that has nothing but the depth of the splats."""
        ctx = self._ctx
        before = ctx.fbo or ctx.detect_framebuffer(0)
        framebuffer.use()
        try:
            framebuffer.depth_mask = True
            ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            clip_from_play = play_view.clip_from_eye() @ play_view.eye_from_world()
            bind_depth(self._capsule, None, SOLID_SLACK)
            self._draw_capsules(drawn.hands, play_view, clip_from_play, True, framebuffer.size)
        finally:
            ctx.enable_only(moderngl.NOTHING)
            before.use()

    def _draw_things(
        self, size: tuple[int, int], view: View, drawn: Drawn, box: PixelBox,
        depth: EyeDepth | None,
    ) -> moderngl.Texture:  # fmt: skip
        """Hands, the panel, then what may be seen through, each behind what is nearer."""
        (target, resolved), ctx = self._targets_of(size), self._ctx
        target.scissor = resolved.scissor = box
        target.use()
        target.depth_mask = True
        target.clear(viewport=box)
        ctx.blend_func = OVER
        clip_from_play = view.clip_from_eye() @ view.eye_from_world()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        bind_depth(self._capsule, depth, SOLID_SLACK)
        self._draw_capsules(drawn.hands, view, clip_from_play, True, size)
        if drawn.panel is not None or drawn.cards:
            ctx.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND)
            self._draw_flats(drawn, view, size, depth)
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
        target.depth_mask = False
        bind_depth(self._capsule, depth, LINE_SLACK)
        self._draw_capsules(drawn.lines, view, clip_from_play, False, size)
        bind_depth(self._capsule, None, LINE_SLACK)
        self._draw_capsules(drawn.edges, view, clip_from_play, False, size)
        target.depth_mask = True
        if resolved is not target:
            resolved.use()  # its scissor bounds the copy
            ctx.copy_framebuffer(resolved, target)
        return resolved.color_attachments[0]

    def _draw_capsules(
        self, capsules: tuple[Capsule, ...], view: View, clip_from_play: np.ndarray, lit: bool,
        size: tuple[int, int],
    ) -> None:  # fmt: skip
        if not capsules:
            return
        rows = capsule_rows(capsules)
        if rows.nbytes > self._instances.size:
            self._instances.orphan(rows.nbytes)
            self._capsules.release()
            self._capsules = self._vertices()
        self._instances.write(rows)
        program = self._capsule
        program["clip_from_play"].write(columns(clip_from_play))
        program["eye"].value = tuple(view.world_from_eye.position)
        program["tangent_px"].value = (view.tangents[1] - view.tangents[0]) / view.size[0]
        program["lit"].value, program["size"].value = lit, size
        self._capsules.render(moderngl.TRIANGLES, instances=len(rows))

    def _draw_flats(
        self, drawn: Drawn, view: View, size: tuple[int, int], depth: EyeDepth | None
    ) -> None:
        """The panel, then the cards, over what lies behind them."""
        panel = drawn.panel
        if panel is not None:
            if panel.apart:
                self._ctx.blend_func = CUT  # hands behind it are gone
            self._place_panel(panel, size, view, depth, panel.apart)
            self._ctx.blend_func = OVER
        clip_from_play = view.clip_from_eye() @ view.eye_from_world()
        self._bind_flats(size, depth)
        for number, card in enumerate(drawn.cards):
            clip = clip_from_play @ card.play_from_card.matrix()
            slot, how = f"card {number}", (clip, card.size_m, card.opacity)
            self._flats.draw(slot, card.key, card.picture, *how)

    def _place_panel(
        self, panel: PanelQuad, size: tuple[int, int], view: View, depth: EyeDepth | None,
        cut: bool, corner_m: float = PANEL_CORNER_M,
    ) -> None:  # fmt: skip
        clip = view.clip_from_eye() @ view.eye_from_world() @ panel.play_from_panel.matrix()
        self._bind_flats(size, depth)
        self._flats.show(panel.texture, clip, panel.size_m, corner_m, cut)

    def _bind_flats(self, size: tuple[int, int], depth: EyeDepth | None) -> None:
        bind_depth(self._flats.program, depth, SOLID_SLACK)
        self._flats.program["size"].value = size

    def _cut_panel(
        self, framebuffer: moderngl.Framebuffer, view: View, panel: PanelQuad,
        depth: EyeDepth | None,
    ) -> None:  # fmt: skip
        """A hole in the eye's picture where the panel is seen."""
        framebuffer.use()
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_func = CUT
        self._place_panel(panel, framebuffer.size, view, depth, cut=True)

    def _lay_over(
        self, framebuffer: moderngl.Framebuffer, view: View, drawn: Drawn, box: PixelBox | None,
        objects: moderngl.Texture | None,
    ) -> None:  # fmt: skip
        dark = drawn.vignette > 0 or drawn.blink > 0
        program = self._over
        if objects is not None:
            objects.use(0)
        program["drawn"].value = 0
        program["box"].value = box or (0, 0, 0, 0)
        program["tangents"].value = view.tangents
        program["vignette"].value = float(drawn.vignette)
        program["blink"].value = float(drawn.blink)
        scissor = framebuffer.scissor
        framebuffer.scissor = scissor if dark else box
        framebuffer.use()
        self._ctx.enable_only(moderngl.BLEND)
        self._ctx.blend_func = OVER
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
        framebuffer.scissor = scissor

    def _targets_of(
        self, size: tuple[int, int]
    ) -> tuple[moderngl.Framebuffer, moderngl.Framebuffer]:
        """With several samples a pixel, and with one; made anew when the views' sizes change."""
        kept = self._targets.get(size)
        if kept is not None:
            return kept
        if len(self._targets) == MOST_SIZES:
            self._release_targets()
        ctx, samples = self._ctx, min(self.detail.samples, self._ctx.max_samples)
        depth = ctx.depth_renderbuffer(size, samples=samples)
        target = resolved = ctx.framebuffer([ctx.texture(size, 4)], None if samples else depth)
        if samples:
            target = ctx.framebuffer([ctx.renderbuffer(size, 4, samples=samples)], depth)
        self._targets[size] = target, resolved
        return target, resolved

    def _vertices(self) -> moderngl.VertexArray:
        parts = [(self._mesh, "3f 1f", "ball", "upper"), (self._instances, INSTANCE, *NAMES)]
        return self._ctx.vertex_array(self._capsule, parts, self._faces)

    def _release_targets(self) -> None:
        for framebuffer in {each for pair in self._targets.values() for each in pair}:
            for part in (*framebuffer.color_attachments, framebuffer.depth_attachment):
                if part is not None:
                    part.release()
            framebuffer.release()
        self._targets.clear()

    def __enter__(self) -> "Overlay":
        return self

    def __exit__(self, *failure) -> None:
        self.release()

    def release(self) -> None:
        """Gives all of it back; the context stays."""
        self._release_targets()
        for part in (
            self._capsules, self._triangle, self._instances, self._mesh, self._faces,
            self._capsule, self._flats, self._over,
        ):  # fmt: skip
            part.release()


def box_of(drawn: Drawn, view: View, size: tuple[int, int]) -> PixelBox | None:
    """The pixels within which all of it lies; None where nothing is in view.

    Software GL takes a third of the time for what lies in a third of the picture.
    """
    capsules = drawn.hands + drawn.lines + drawn.edges
    places = [capsule.a for capsule in capsules] + [capsule.b for capsule in capsules]
    radii = [c.radii[0] for c in capsules] + [c.radii[1] for c in capsules]
    flats = [(card.play_from_card, card.size_m) for card in drawn.cards]
    if drawn.panel is not None:
        flats.append((drawn.panel.play_from_panel, drawn.panel.size_m))
    for pose, (width_m, height_m) in flats:
        axes = pose.matrix()[:3, :2] * (width_m / 2, height_m / 2)
        places += [pose.position + axes @ corner for corner in CORNERS]
        radii += [0.0] * len(CORNERS)
    if not places:
        return None
    eye_from_play = view.eye_from_world()
    x, y, z = eye_from_play[:3, :3] @ np.array(places).T + eye_from_play[:3, 3:]
    depth = -z - np.array(radii)
    if depth.max() <= view.near:
        return None  # all of it is behind the eye
    left, right, down, up = view.tangents
    width, height = size
    if depth.min() <= view.near:
        return 0, 0, width, height
    tangents = np.array([x, y]) / -z
    reach = np.array(radii) / depth * np.hypot(1, np.abs(tangents).max(axis=0))
    low, high = (tangents - reach).min(axis=1), (tangents + reach).max(axis=1)
    per_tangent = np.array([width / (right - left), height / (up - down)])
    first = np.floor((low - (left, down)) * per_tangent).clip(SPARE, size) - SPARE
    last = np.ceil((high - (left, down)) * per_tangent + SPARE).clip(0, size)
    wide, high_px = map(int, last - first)
    return (int(first[0]), int(first[1]), wide, high_px) if wide > 0 and high_px > 0 else None


def columns(matrix: np.ndarray) -> bytes:
    """A (4, 4) matrix as GLSL reads it."""
    return matrix.T.astype(np.float32).tobytes()


def capsule_rows(capsules: tuple[Capsule, ...]) -> np.ndarray:
    """(n, 16) float32: ends, radii, colours with their opacity."""
    rows = np.zeros((len(capsules), 16), np.float32)
    for row, capsule in zip(rows, capsules, strict=True):
        color = (*capsule.color, 1.0)[:4]
        row[0:3], row[3:6], row[6:8] = capsule.a, capsule.b, capsule.radii
        row[8:12], row[12:16] = color, (*(capsule.color_b or color), 1.0)[:4]
    return rows


def capsule_mesh(around: int, below: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4) float32: direction of a unit ball and which end it belongs to; (m, 3) int32 facets,
    anticlockwise from outside.  The equator is there twice, once for either end.
    """
    heights = np.linspace(-np.pi / 2, 0, below + 1)
    heights = np.concatenate([heights, -heights[::-1]])  # radians over the equator
    turns = np.arange(around) * 2 * np.pi / around
    height, turn = np.meshgrid(heights, turns, indexing="ij")
    upper = np.repeat(np.arange(len(heights)) > below, around).reshape(height.shape)
    ball = np.stack(
        [np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height), upper], -1
    )
    ring, step = np.meshgrid(np.arange(len(heights) - 1), np.arange(around), indexing="ij")
    here, beside = ring * around + step, ring * around + (step + 1) % around
    over = around  # one ring up
    faces = np.concatenate(
        [
            np.stack([here, beside, beside + over], -1),
            np.stack([here, beside + over, here + over], -1),
        ]
    )
    return ball.reshape(-1, 4).astype(np.float32), faces.reshape(-1, 3).astype(np.int32)
