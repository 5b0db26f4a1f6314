"""What is in the room over the splats in a frame: hands, rays, the panel, cards, a glass."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from shapeshift.app.headset.in_hand.tools_drawn import with_tools
from shapeshift.app.headset.notices import Late, late_card
from shapeshift.app.headset.over.hand_glass import HandGlass
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.wearing import Wearing
from shapeshift.app.headset.xr_user import XrState
from shapeshift.vr.area import area_edges
from shapeshift.vr.card import Card
from shapeshift.vr.controllers.labels import labelled
from shapeshift.vr.controllers.model import HeldController, controller
from shapeshift.vr.drawn import Drawn, drawn_of
from shapeshift.vr.frame import LOST, SIDES, Frame, grip_of
from shapeshift.vr.glove import Capsule
from shapeshift.vr.hints import hint_opacity, hint_rows, hints
from shapeshift.vr.openxr.session import Session
from shapeshift.vr.outline import BY_HAND, BY_RAY, Outlines, outline
from shapeshift.vr.panel.carried import Carried


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
