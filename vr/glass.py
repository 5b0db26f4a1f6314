"""Lays the picture of another stop over an eye's, within a glass in the room."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import moderngl
import numpy as np

from shapeshift.renderer.colors.palette import palette_between
from shapeshift.renderer.debug.debug_map import nice_ticks, tick_text
from shapeshift.renderer.debug.letters import drawable, letters
from shapeshift.renderer.gl.shader import compile_program
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.pose import Pose, View
from shapeshift.vr.cards import (
    CORNER_PX,
    EM,
    HALF_CLEAR,
    LINE_PX,
    PAD_PX,
    SURFACE,
    TEXT,
    Card,
)
from shapeshift.vr.frame import SIDES, Hand
from shapeshift.vr.glove import Capsule
from shapeshift.vr.scene_depth import SOLID_SLACK, EyeDepth, bind_depth
from shapeshift.vr.shown import SHADERS

# A round glass in a hand: where it is, its rim and handle, and which pixels of an eye it covers.
#
# Metres of the room.  In the grip's frame a fist holds a tube along Z, the thumb at -Z: the handle
# lies there, and the glass stands on it with its faces ahead and back of the hand.

RADIUS_M = 0.085  # of the glass
HANDLE_M = 0.075  # from the grip to the rim: over the fist and a thumb
BELOW_M = 0.045  # of the handle, below the grip
RIM_M, HANDLE_THICK_M = 0.005, 0.009  # radii
METAL, WOOD = (0.62, 0.64, 0.68), (0.34, 0.35, 0.39)  # display sRGB
PARTS = 40  # of the rim
SIDEWAYS, FACES = 0.20, 0.28  # cosine to the line of sight: below it is hidden, above seen again
STEP_PX = 32  # by which pictures grow: a new texture a frame would cost more than its pixels

PixelBox = tuple[int, int, int, int]  # left, bottom, width, height


@dataclass(frozen=True)
class HeldGlass:
    """Its middle; +Z to the side that is looked at, +Y away from the hand."""

    play_from_glass: Pose
    radius_m: float = RADIUS_M

    def point(self, x: float, y: float, z: float = 0.0) -> np.ndarray:
        """(3,) metres of the room of a place on it."""
        matrix = self.play_from_glass.matrix()
        return matrix[:3, :3] @ np.array([x, y, z]) + matrix[:3, 3]

    def around(self, count: int, wider: float = 1.0) -> np.ndarray:
        """(count, 3) points of its edge, or of a circle so much wider."""
        turns = np.linspace(0, 2 * np.pi, count, endpoint=False)
        flat = np.stack([np.cos(turns), np.sin(turns), np.zeros(count)]) * self.radius_m * wider
        matrix = self.play_from_glass.matrix()
        return (matrix[:3, :3] @ flat).T + matrix[:3, 3]


def held_glass(hand: Hand, head: Pose, was: bool = False) -> HeldGlass | None:
    """The glass in a hand that is there; None where its edge is turned to the head.

    was: it was seen before; so it does not tremble between yes and no.
    """
    if hand.grip is None:
        return None
    grip = hand.grip.matrix()
    up, back = -grip[:3, 2], grip[:3, 1]
    middle = grip[:3, 3] + up * (HANDLE_M + RADIUS_M)
    sight = head.position - middle
    length = float(np.linalg.norm(sight))
    if not length > RADIUS_M:
        return None  # the head is in it
    facing = float(back @ sight) / length
    if not abs(facing) >= (SIDEWAYS if was else FACES):
        return None
    normal = back if facing > 0 else -back
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([np.cross(up, normal), up, normal], axis=1)
    matrix[:3, 3] = middle
    return HeldGlass(Pose.from_matrix(matrix))


def frame_of(glass: HeldGlass) -> list[Capsule]:
    """Its rim and its handle, lit and solid."""
    edge = glass.around(PARTS)
    parts = [
        Capsule(a, b, (RIM_M, RIM_M), METAL) for a, b in pairwise(np.concatenate([edge, edge[:1]]))
    ]
    foot = -glass.radius_m
    ends = glass.point(0.0, foot - HANDLE_M - BELOW_M), glass.point(0.0, foot - 0.03)
    parts.append(Capsule(*ends, (HANDLE_THICK_M, HANDLE_THICK_M), WOOD))
    neck = ends[1], glass.point(0.0, foot)
    return [*parts, Capsule(*neck, (HANDLE_THICK_M * 0.8, RIM_M), METAL)]


def boxes_of(glass: HeldGlass, views: Sequence[View]) -> list[PixelBox] | None:
    """The pixels of each view, in the room, that the glass may cover: equally many in those of one
    size, so that both eyes are drawn at once, few where none of them sees it; None where no view
    does.
    """
    spans = [_span(glass, view) for view in views]
    if all(span is None for span in spans):
        return None
    boxes = []
    for span, view in zip(spans, views, strict=True):
        alike = [s for s, v in zip(spans, views, strict=True) if s and v.size == view.size]
        most = [max((s[axis + 2] for s in alike), default=1) for axis in (0, 1)]
        size = [min(-(-most[i] // STEP_PX) * STEP_PX, view.size[i]) for i in (0, 1)]
        low = [0, 0]
        if span is not None:
            low = [min(span[axis], view.size[axis] - size[axis]) for axis in (0, 1)]
        boxes.append((low[0], low[1], size[0], size[1]))
    return boxes


def _span(glass: HeldGlass, view: View) -> PixelBox | None:
    """The least box around it; all of the picture where it reaches behind the eye."""
    eye_from_play = view.eye_from_world()
    # The polygon around the disc: seen from anywhere in front it holds the disc.
    corners = glass.around(PARTS, 1 / np.cos(np.pi / PARTS))
    x, y, z = eye_from_play[:3, :3] @ corners.T + eye_from_play[:3, 3:]
    width, height = view.size
    if not (-z).max() > view.near:
        return None
    if not (-z).min() > view.near:
        return 0, 0, width, height
    left, right, down, up = view.tangents
    scale = np.array([[width / (right - left)], [height / (up - down)]])
    pixels = (np.stack([x / -z, y / -z]) - np.array([[left], [down]])) * scale
    low = np.floor(pixels.min(axis=1)).astype(int) - 1
    high = np.ceil(pixels.max(axis=1)).astype(int) + 1
    low, high = low.clip(0, view.size), high.clip(0, view.size)
    if not (high > low).all():
        return None
    return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])


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


# What stands at a glass: the name of the stop on its rim, and beside it what its colours mean.

BAR_PX, TALL_PX, TICK_PX = 44, 480, 14  # width of the colours, height of all, length of a tick
COUNT = 5  # ticks, about
GAP_M = 0.010


@dataclass(frozen=True)
class GlassScale:
    """What a palette's colours stand for."""

    palette: str
    low: float
    high: float
    unit: str
    ends: tuple[float, float] = (0.0, 1.0)  # shares of the range at the palette's ends

    @staticmethod
    def of(stop: Stop | None, palette: str, ends: tuple[float, float]) -> "GlassScale | None":
        """That of a value stop; None where there is none, or nobody knows its values."""
        if stop is None or not palette or stop.value_range is None:
            return None
        return GlassScale(palette, *stop.value_range, stop.unit, ends)


@dataclass(frozen=True)
class ScaleCard(Card):
    """A card with colours and values instead of words."""

    scale: GlassScale | None = None

    def picture(self) -> np.ndarray:
        assert self.scale is not None
        return scale_picture(self.scale)

    @property
    def key(self) -> Hashable:
        return self.scale


def cards_of(glass: HeldGlass, side: str, stop: str, scale: GlassScale | None) -> tuple[Card, ...]:
    """The stop's name over the rim, and its scale outwards of the glass."""
    name = Card((stop,), glass.play_from_glass)
    height = name.size_m[1]
    place = glass.point(0.0, glass.radius_m + RIM_M + height / 2)
    cards: list[Card] = [Card((stop,), Pose(place, glass.play_from_glass.wxyz))]
    if scale is not None:
        legend = ScaleCard((scale.unit,), glass.play_from_glass, scale=scale)
        outwards = -1.0 if side == SIDES[0] else 1.0
        aside = outwards * (glass.radius_m + RIM_M + GAP_M + legend.size_m[0] / 2)
        pose = Pose(glass.point(aside, 0.0), glass.play_from_glass.wxyz)
        cards.append(ScaleCard((scale.unit,), pose, scale=scale))
    return tuple(cards)


@lru_cache(maxsize=8)
def scale_picture(scale: GlassScale) -> np.ndarray:
    """(H, W, 4) uint8 display sRGB premultiplied by alpha, row 0 on top."""
    from PIL import Image, ImageDraw

    font, bold = letters(EM), letters(EM, True)
    values = nice_ticks(scale.low, scale.high, COUNT)
    texts = [drawable(text, EM) for text in tick_text(values)]
    unit = drawable(scale.unit, EM)
    right = PAD_PX + BAR_PX + 2 * TICK_PX
    wide = max([right + font.getlength(text) for text in texts] + [PAD_PX + bold.getlength(unit)])
    size = (int(wide) + PAD_PX, TALL_PX)
    image, mask = Image.new("RGB", size, SURFACE), Image.new("L", size, 0)
    box = (0, 0, size[0] - 1, size[1] - 1)
    ImageDraw.Draw(mask).rounded_rectangle(box, CORNER_PX, fill=round(255 * HALF_CLEAR))
    draw, ink = ImageDraw.Draw(image), ImageDraw.Draw(mask)
    first, last = PAD_PX + (LINE_PX if unit else LINE_PX // 2), TALL_PX - PAD_PX - EM // 2
    pieces: list[tuple] = [((PAD_PX, PAD_PX + EM // 2), unit, bold)] if unit else []
    for value, text in zip(values, texts, strict=True):
        y = last - (last - first) * (value - scale.low) / ((scale.high - scale.low) or 1.0)
        for canvas, fill in ((draw, TEXT), (ink, 255)):
            canvas.line((PAD_PX + BAR_PX, y, PAD_PX + BAR_PX + TICK_PX, y), fill=fill, width=3)
        pieces.append(((right, y), text, font))
    for at, text, face in pieces:
        draw.text(at, text, fill=TEXT, font=face, anchor="lm")
        ink.text(at, text, fill=255, font=face, anchor="lm")
    pixels, alpha = np.array(image), np.array(mask)
    colors = palette_between(scale.palette, scale.ends)
    rows = np.rint(np.linspace(len(colors) - 1, 0, last - first)).astype(int)
    bar = (slice(first, last), slice(PAD_PX, PAD_PX + BAR_PX))
    pixels[bar] = np.rint(255 * np.clip(colors[rows], 0, 1)).astype(np.uint8)[:, None]
    alpha[bar] = 255
    rgb = pixels.astype(np.uint16) * alpha[..., None] // 255
    return np.concatenate([rgb.astype(np.uint8), alpha[..., None]], axis=2)
