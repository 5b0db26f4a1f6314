"""Holds a glass before both eyes: draws another stop behind its disc, and what stands at it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import moderngl

from shapeshift.app.editor.texts.table import said
from shapeshift.app.headset.over.glass_state import seen_through
from shapeshift.app.headset.xr_user import XrState
from shapeshift.renderer.colors.decode_colors import same_shape
from shapeshift.renderer.colors.palette import value_blend
from shapeshift.renderer.gl.gpu import release_framebuffer
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.floor import Floor
from shapeshift.vr.frame import SIDES, Frame, Hand
from shapeshift.vr.glass import (
    GlassScale,
    HeldGlass,
    Pane,
    PixelBox,
    boxes_of,
    cards_of,
    frame_of,
    held_glass,
)
from shapeshift.vr.panel import Carried
from shapeshift.vr.scene_depth import EyeDepth
from shapeshift.vr.see_through import SeeThrough
from shapeshift.vr.touching import shows

GRIPS = 0.75  # of a fist: how a hand is drawn that holds it

# Draws what a renderer has as picture i, and what is behind its splats, into a framebuffer that
# shows a view of the room.
ShowPart = Callable[[Renderer, int, moderngl.Framebuffer, View, Floor, SeeThrough], None]


@dataclass(frozen=True)
class Looking:
    """One frame's look through it."""

    glass: HeldGlass
    scene: Scene  # behind it
    boxes: list[PixelBox]  # pixels, one a view
    views: list[View]  # of these, in the world
    together: bool  # nothing but colours differs: from the order of the eyes


class HandGlass:
    """Keeps what it takes; nothing is made before a glass is first held up."""

    def __init__(self, ctx: moderngl.Context, renderer: Renderer) -> None:
        self._ctx, self._renderer = ctx, renderer
        self._other: Renderer | None = None  # for a stop of another shape
        self._side = SIDES[0]  # of the hand that has it
        self._passes: tuple[Pane, Floor, SeeThrough] | None = None
        self._parts: dict[int, moderngl.Framebuffer] = {}
        self._made: tuple = (None, "", None)  # of what the scene behind it was made, and it

    def hold(self, frame: Frame, state: XrState, carried: Carried) -> dict[str, Hand]:
        """Where the glass is in this frame; the hands as they are drawn, one of them around it."""
        glass, worn = state.glass, state.worn.now
        side = worn.one_hand or worn.panel_hand
        away = carried.open or state.user.touched.held.get(side) is not None
        shown = bool(glass.stop) and not away and not state.editor.settings.debug
        was = glass.held is not None
        glass.held = held_glass(frame.hands[side], frame.head, was) if shown else None
        if glass.held is not None and not self._scenes(state)[1].objects:
            glass.held = None  # what has that stop is not seen
        if glass.held is None:
            return frame.hands
        self._side, hand = side, frame.hands[side]
        # It is round its handle, and has no ray but where its trigger acts.
        aim = hand.aim if shows(hand) else None
        held = replace(hand, squeeze=max(hand.squeeze, GRIPS), trigger=max(hand.trigger, GRIPS))
        return frame.hands | {side: replace(held, aim=aim)}

    def added(self, over: Drawn, state: XrState) -> Drawn:
        """With its rim, its handle, and what stands at it."""
        glass = state.glass
        if glass.held is None:
            return over
        _, moved = self._scenes(state)
        palette, _, stop = value_blend(moved)
        scale = GlassScale.of(stop, palette, self._renderer.settings.heat_ends)
        cards = (*over.cards, *cards_of(glass.held, self._side, glass.stop, scale))
        return replace(over, hands=(*over.hands, *frame_of(glass.held)), cards=cards)

    def _scenes(self, state: XrState) -> tuple[Scene, Scene]:
        """Behind the glass, and of that what has the stop; the same until something changes."""
        shown, name = state.shown, state.glass.stop
        made_of, stop, scenes = self._made
        if made_of is not shown or stop != name:
            scenes = seen_through(state.editor, shown, name)
            self._made = (shown, name, scenes)
        return scenes

    def look(
        self, state: XrState, views: Sequence[View], play_views: Sequence[View]
    ) -> Looking | None:
        """Before the eyes are drawn; None where no eye looks through it."""
        held, self._renderer.keeps_beside = state.glass.held, False
        boxes = boxes_of(held, play_views) if held is not None else None
        if held is None or boxes is None:
            return None
        scene, _ = self._scenes(state)
        parts = [part_of(view, box) for view, box in zip(views, boxes, strict=True)]
        together = same_shape(state.shown, scene)
        self._renderer.keeps_beside = together
        return Looking(held, scene, boxes, parts, together)

    def draw(self, looking: Looking | None, state: XrState) -> Looking | None:
        """After the eyes, before `lay`; None where there is nothing to lay.

        Without room for it the glass is put away, and the panel says so.
        """
        if looking is None:
            return None
        if looking.together:
            self._renderer.draw_beside(looking.views, looking.scene, len(looking.views))
            return looking
        try:
            other = self._other_renderer()
            other.settings = replace(self._renderer.settings, depth_scale=0.0, debug="")
            other.update(looking.scene)
            other.draw(looking.views)
        except BadFile as error:
            state.glass.stop, state.glass.held = "", None
            state.editor.messages.fail(said("There is no room for a glass: {error}", error=error))
            return None
        return looking

    def lay(
        self, looking: Looking, i: int, framebuffer: moderngl.Framebuffer, play_view: View,
        depth: EyeDepth | None, show: ShowPart,
    ) -> None:  # fmt: skip
        """Over the picture of eye i, display-encoded, within the glass."""
        if self._passes is None:
            self._passes = Pane(self._ctx), Floor(self._ctx), SeeThrough(self._ctx)
        pane, floor, see_through = self._passes
        box, part = looking.boxes[i], self._part(i, looking.boxes[i][2:])
        renderer = self._renderer if looking.together else self._other_renderer()
        number = len(looking.views) + i if looking.together else i
        show(renderer, number, part, part_of(play_view, box), floor, see_through)
        (picture,) = part.color_attachments
        pane.draw(framebuffer, play_view, looking.glass, picture, box, depth)

    def _other_renderer(self) -> Renderer:
        if self._other is None:
            drawing = self._renderer.backends["drawing"].split(" ")[0]
            self._other = Renderer(self._ctx, drawing)
        return self._other

    def _part(self, i: int, size: tuple[int, int]) -> moderngl.Framebuffer:
        old = self._parts.get(i)
        if old is None or old.size != tuple(size):
            self._release_part(i)
            old = self._parts[i] = self._ctx.framebuffer([self._ctx.texture(size, 4)])
        return old

    def _release_part(self, i: int) -> None:
        part = self._parts.pop(i, None)
        if part is not None:
            release_framebuffer(part)

    def close(self) -> None:
        """Gives all of it back; the context and the eyes' renderer stay."""
        for i in list(self._parts):
            self._release_part(i)
        for each in self._passes or ():
            each.release()
        if self._other is not None:
            self._other.close()


def part_of(view: View, box: PixelBox) -> View:
    """The view of a box of its pixels, whose rows count from below."""
    left, bottom, width, height = box
    return view.part(left, view.size[1] - bottom - height, (width, height))
