"""What is in the room over the splats in a frame: hands, rays, the panel, cards, a glass."""

from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from shapeshift.app.headset.in_hand.tools_drawn import with_tools
from shapeshift.app.headset.over.hand_glass import HandGlass
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.worn_settings import Wearing
from shapeshift.app.headset.xr_user import XrState
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.control import control_key
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.vr.cards import Card
from shapeshift.vr.controller_cards import (
    HeldController,
    controller,
    hint_opacity,
    hint_rows,
    hints,
    labelled,
)
from shapeshift.vr.drawn import Drawn, drawn_of
from shapeshift.vr.floor import area_edges
from shapeshift.vr.frame import LOST, SIDES, Frame, grip_of
from shapeshift.vr.glove import Capsule
from shapeshift.vr.openxr.session import Session
from shapeshift.vr.outline import BY_HAND, BY_RAY, Outlines, outline
from shapeshift.vr.panel import Carried, facing
from shapeshift.vr.shadow import STRAY, Blocks, Cast, Shadow, Shadows, blocks_of, shadow_on


class OverSplats:
    """Keeps what it takes from frame to frame."""

    def __init__(self, wearing: Wearing, panel: PanelPicture, glass: HandGlass) -> None:
        self._wearing, self._panel, self._glass = wearing, panel, glass
        self._late, self._outlines = Late(), Outlines()

    def of(
        self, frame: Frame, state: XrState, carried: Carried, session: Session, worn_s: float
    ) -> Drawn:
        """worn_s: seconds since the hands were there for the first time."""
        held = self._controllers(frame, state, session.profiles, worn_s)
        cards, lines = self._hints(frame, state, carried, session.profiles, held, worn_s)
        if self._wearing.hints and self._late.watch(frame.seen_s, session.pace.dropped):
            cards.append(late_card(frame.head, state.pacing.quality))
        hands = self._glass.hold(frame, state, carried)
        person = state.user
        over = drawn_of(
            hands, carried, person.comfort, person.touched, self._outlined(frame, state, carried),
            tuple(cards), self._panel.texture, [side for side in SIDES if side not in held],
        )  # fmt: skip
        solid = [part for each in held.values() for part in each.parts]
        over = replace(over, hands=(*over.hands, *solid), lines=(*over.lines, *lines))
        over = self._glass.added(over, state)
        over = with_tools(over, state.tools, frame, state.play_space, carried)
        if self._wearing.edges:
            over = replace(over, edges=area_edges(frame))
        if over.panel is None or not self._wearing.panel_layer:
            return over
        apart = replace(over.panel, version=self._panel.version, apart=True)
        return replace(over, panel=apart)

    def _controllers(
        self, frame: Frame, state: XrState, profiles: Mapping[str, str], worn_s: float
    ) -> dict[str, HeldController]:
        """Of hands that are drawn as what they hold: while its buttons are named, or always."""
        named = self._wearing.hints and hint_opacity(worn_s) > 0
        if not (named or state.worn.now.hand_model == "controllers"):
            return {}
        found = {}
        for side in SIDES:
            holds = state.user.touched.held.get(side) is not None
            held = controller(side, frame.hands[side], profiles.get(side, ""), holds)
            if held is not None:
                found[side] = held
        return found

    def _hints(
        self, frame: Frame, state: XrState, carried: Carried, profiles: Mapping[str, str],
        held: Mapping[str, HeldController], worn_s: float,
    ) -> tuple[list[Card], list[Capsule]]:  # fmt: skip
        """What buttons and bare hands do, at first, and lines to the buttons."""
        if not self._wearing.hints:
            return [], []
        rules, opacity = state.user.rules, hint_opacity(worn_s)
        bare = {s: LOST if s in held else hand for s, hand in frame.hands.items()}
        known = (profiles, rules, carried.home)
        cards, lines = list(hints(replace(frame, hands=bare), worn_s, *known)), []
        for side, each in held.items() if opacity > 0 else ():
            rows = hint_rows(profiles.get(side, ""), side, rules, carried.home)
            grip = grip_of(frame.hands[side]).position
            more, to_buttons = labelled(side, each, rows, grip, frame.head, opacity)
            cards += more
            lines += to_buttons
        return cards, lines

    def _outlined(self, frame: Frame, state: XrState, carried: Carried) -> Sequence[Capsule]:
        """Around what hands would take, or their rays act on, that do not point at the panel."""
        lines: list[Capsule] = []
        for offer in state.user.touched.offers:
            obj = state.world.objects[offer.object]
            hull = self._outlines.hull(obj.collider)
            points = carried.on_panel and offer.side == carried.pointer
            if hull is None or points:
                continue
            pose, ink = obj.drawn.world_from_object, BY_HAND if offer.by == "hand" else BY_RAY
            lines += outline(hull, pose, state.play_space, frame.head.position, ink)
        return lines


# The shadows of a scene's objects on one's own table or floor, while the room itself is seen.

RESTS_S = 0.3  # an object that has not moved so long stands on something
HEIGHT_STEP_M = 0.004  # of the way up: another one is another shadow
TURN_STEP = 0.04  # of a rotation matrix
MEASURED = 16  # every so many of its points say where an object ends below
LOWER_M = 0.002  # what sinks so far below its plane has none there any more


@dataclass
class Standing:
    """What is known of one object."""

    model: object
    key: object = None  # of its shape
    blocks: Blocks | None = None
    matrix: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)))  # world_from_object
    still_s: float = 0.0
    bottom_y: float = 0.0  # metres of the world
    plane_y: float | None = None
    made_for: tuple | None = None  # of the shadow in use or under way
    shadow: Shadow | None = None
    work: "Future[Shadow | None] | None" = None


class TableShadows:
    """Follows the objects; shadows are worked out beside the session, one after the other.

    An object's plane is level, where it stood when it was last at rest; what falls below takes its
    plane along.  Close at the end.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._shadows: Shadows | None = None
        self.standing: dict[str, Standing] = {}
        self._worker: ThreadPoolExecutor | None = None
        self.casts: list[Cast] = []  # of this frame

    def follow(self, renderer: Renderer, scene: Scene, seconds: float) -> None:
        """After the renderer has taken the scene over; `seconds` since the frame before."""
        names = {obj.name for obj in scene.objects if obj.seen}
        self.standing = {n: each for n, each in self.standing.items() if n in names}
        busy = any(each.work is not None for each in self.standing.values())
        self.casts = []
        for i, obj in enumerate(scene.objects):
            if not obj.seen:
                continue
            standing = self._of(renderer, i, obj)
            self._move(standing, obj.world_from_object.matrix(), seconds)
            self._collect(standing)
            busy |= self._ask(standing, busy)
            if standing.shadow is not None and standing.plane_y is not None:
                x, _, z = standing.matrix[:3, 3]
                place = np.array([x, standing.plane_y, z])
                self.casts.append(Cast(obj.name, standing.shadow, place))

    def draw(self, framebuffer: moderngl.Framebuffer, view: View) -> None:
        """Below an eye's picture over the room; `view` in the world."""
        if not self.casts:
            return
        if self._shadows is None:
            self._shadows = Shadows(self._ctx)
        self._shadows.draw(framebuffer, view, self.casts)

    def _of(self, renderer: Renderer, i: int, obj: SceneObject) -> Standing:
        standing = self.standing.get(obj.name)
        if standing is None or standing.model is not obj.model:
            standing = self.standing[obj.name] = Standing(obj.model)
        key = (control_key(obj), obj.sections, obj.appearance.opacity)
        if standing.blocks is None or standing.key != key:
            standing.key, standing.blocks = key, blocks_of(*renderer.drawing.read_splats(i))
            standing.made_for, standing.matrix = None, np.zeros((4, 4))
        return standing

    def _move(self, standing: Standing, matrix: np.ndarray, seconds: float) -> None:
        """Where it is now, and what it stands on."""
        assert standing.blocks is not None
        moved = not np.allclose(matrix, standing.matrix, atol=1e-4)
        standing.still_s = 0.0 if moved else standing.still_s + seconds
        if moved:
            standing.matrix = matrix
            points = standing.blocks.points[::MEASURED]
            if len(points):
                heights = points @ matrix[1, :3] + matrix[1, 3]
                standing.bottom_y = float(np.quantile(heights, STRAY))
        plane = standing.plane_y
        sinks = plane is None or standing.bottom_y < plane - LOWER_M
        if sinks or standing.still_s >= RESTS_S:
            standing.plane_y = standing.bottom_y

    def _ask(self, standing: Standing, busy: bool) -> bool:
        """Has its shadow worked out where it would be another one; whether it does."""
        plane, blocks = standing.plane_y, standing.blocks
        if plane is None or blocks is None or not len(blocks.points):
            return False
        height = round((standing.matrix[1, 3] - plane) / HEIGHT_STEP_M)
        turn = np.round(standing.matrix[:3, :3] / TURN_STEP).astype(int).tobytes()
        wanted = (standing.key, height, turn)
        if busy or wanted == standing.made_for:
            return False
        standing.made_for = wanted
        self._worker = self._worker or ThreadPoolExecutor(1, "shadows")
        standing.work = self._worker.submit(shadow_on, blocks, standing.matrix.copy(), plane)
        return True

    def _collect(self, standing: Standing) -> None:
        if standing.work is not None and standing.work.done():
            standing.shadow, standing.work = standing.work.result(), None

    def close(self) -> None:
        """Ends what is under way and gives all back; the context stays."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)
        if self._shadows is not None:
            self._shadows.release()


# What is said to who wears the headset: that frames are late, at the lower edge of the view.

WITHIN_S, LATE = 2.0, 3  # so many frames late in that time; fewer are nobody's business
SHOWN_S, QUIET_S = 4.0, 30.0  # so long it is said, and then not for so long
BEGINS_S = 5.0  # of a session, in which programs are compiled and files are read
BELOW = np.array([0.0, -0.22, -0.55])  # metres, of the head: below what one looks at
ADVICE = {"best": ": try Auto", "balanced": ": try Auto or Fast"}  # by the quality that is chosen


class Late:
    """Watches how many periods of the display saw no frame of ours."""

    def __init__(self) -> None:
        self._dropped: deque[tuple[float, int]] = deque()  # when, and how many until then
        self._since_s: float | None = None  # when it was said last
        self._began_s: float | None = None

    def watch(self, now_s: float, dropped: int) -> bool:
        """Whether it is to be said now."""
        if self._began_s is None:
            self._began_s = now_s
        if now_s < self._began_s + BEGINS_S:
            return False
        seen = self._dropped
        seen.append((now_s, dropped))
        while seen[0][0] < now_s - WITHIN_S:
            seen.popleft()
        late = seen[-1][1] - seen[0][1] >= LATE
        if late and (self._since_s is None or now_s - self._since_s > QUIET_S):
            self._since_s = now_s
        return self._since_s is not None and now_s - self._since_s < SHOWN_S


def late_card(head: Pose, quality: str) -> Card:
    """The words for it, where they do not stand over what one looks at."""
    place = head.position + head.matrix()[:3, :3] @ BELOW
    return Card((f"Frames are late{ADVICE.get(quality, '')}",), facing(place, head), 0.9)
