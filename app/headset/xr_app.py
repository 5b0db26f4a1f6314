"""The loop of a headset: what happens in a frame, in order."""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import moderngl

from shapeshift.app.document import BLACK, DARK, Document
from shapeshift.app.editor.state.arrange import poll_bodies
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.state.parts.parts_tool import PartsTool
from shapeshift.app.editor.state.touch_state import TouchState
from shapeshift.app.headset.eyes import DEPTH_SCALE, Eyes, quad_of
from shapeshift.app.headset.headset_report import DoneFrame, Report
from shapeshift.app.headset.in_hand.finger_brush import PartsHand
from shapeshift.app.headset.mirror import Mirror, NoMirror
from shapeshift.app.headset.over.glass_state import GlassState, stop_now
from shapeshift.app.headset.over.hand_glass import HandGlass
from shapeshift.app.headset.over.over_splats import OverSplats, TableShadows
from shapeshift.app.headset.pacing import Pacing, choose_quality
from shapeshift.app.headset.save_start import save_start
from shapeshift.app.headset.scene_shelf import SceneShelf
from shapeshift.app.headset.sections.performance_section import Figures
from shapeshift.app.headset.session.headset_link import Comeback
from shapeshift.app.headset.session.recorder import Shutter
from shapeshift.app.headset.worn_journal import WornJournal
from shapeshift.app.headset.worn_settings import WEARING, KeptSettings, Wearing
from shapeshift.app.headset.wrist_menu import MenuActions, WristMenu
from shapeshift.app.headset.xr_user import XrState, XrUser
from shapeshift.app.inspection.window.probe import Probe
from shapeshift.app.paths import WorkFolders
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import FrameStats
from shapeshift.scene.appearance import plain_color
from shapeshift.scene.pose import View
from shapeshift.scene.scene import IDENTITY
from shapeshift.scene.world.record import Record
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.floor import REST, Floor, Grid, clearness
from shapeshift.vr.frame import Frame
from shapeshift.vr.locomotion import RULES, Rules, Travel
from shapeshift.vr.openxr.session import Session
from shapeshift.vr.play_space import underfoot
from shapeshift.vr.scene_depth import EyeDepth
from shapeshift.vr.see_through import SeeThrough
from shapeshift.vr.touching import strongest

ANY_SIZE = (640, 360)  # of a view that only says where to stand
FIGURES_EVERY_S = 1.0  # of the section Performance
ROOMS_OWN = "STAGE"  # play space whose origin is a place of the room's
LONGEST_STEP_S = 0.25  # of time that passes at once: a headset may have lain on the table


class XrApp:
    """One session with one scene, from the first frame to the last."""

    def __init__(
        self,
        session: Session,
        renderer: Renderer,
        eyes: Eyes,
        mirror: Mirror | NoMirror,
        document: Document,
        editor: EditorState,
        pacing: Pacing,
        report: Report,
        rules: Rules = RULES,
        wearing: Wearing = WEARING,
        worn: KeptSettings | None = None,
        shelf: SceneShelf | None = None,
        shutter: Shutter | None = None,
        journals: Path | None = None,
    ) -> None:
        self.session, self.renderer, self.eyes, self.mirror = session, renderer, eyes, mirror
        self.report, self._wearing = report, wearing
        self._worn, self.shelf = worn or KeptSettings(), shelf or SceneShelf()
        self.shutter = shutter or Shutter(WorkFolders.of().pictures)
        self._obstacles = rules.obstacles  # the picture darkens in them
        self._journals = journals  # folder; None: what is done is not kept
        self._closing = ExitStack()
        self._closing.callback(self.shutter.close)
        self._hand_glass = HandGlass(mirror.ctx, renderer)
        self._closing.callback(self._hand_glass.close)
        self._probe = Probe(mirror.ctx, renderer)
        self._closing.callback(self._probe.close)
        self._shadows = TableShadows(mirror.ctx)
        self._closing.callback(self._shadows.close)
        self._scene = ExitStack()  # what ends with the scene that is open
        self._level_m = 0.0  # of the floor in the world
        self._clearness = REST
        self._worn_s = 0.0  # since the hands were there for the first time
        self.pulses: list[tuple[str, float, float]] = []  # of this frame: side, strength, seconds
        self.stats = FrameStats()
        self._seen_s: float | None = None  # when the frame before was to be seen
        self._seconds = 0.0  # since that
        self._figured_s = 0.0  # when the panel's figures were made
        self._drawing_ms = 0.0  # of the splats of both eyes, last
        self.interrupted = False  # by Ctrl-C: no frame is left half done
        self.leaving = False
        self._head = IDENTITY  # of the last frame, room
        self._comeback: Comeback | None = None
        self._enter(document, editor, pacing, rules, wearing.floor)

    def _enter(
        self, document: Document, editor: EditorState, pacing: Pacing, rules: Rules, floor: bool
    ) -> None:
        """A scene that was opened, with a panel of its own."""
        self._scene.close()
        self._scene.enter_context(editor.bodies)
        self.background = document.background_or(DARK)
        eye = document.view(ANY_SIZE).world_from_eye
        editor.settings = replace(editor.settings, background=self.background)
        user = XrUser(editor.bodies.living, eye, document.floor_y, rules)
        touch = TouchState(editor, True, keys=False)
        parts = PartsTool(editor, lambda: None)
        self._scene.enter_context(parts.finder)
        self.state = XrState(
            editor,
            touch,
            pacing,
            user,
            parts,
            floor_shown=floor,
            worn=self._worn,
            sees_through=self.session.sees_through,
            glass=GlassState(stop_now(editor, self._wearing.glass)),
        )
        self._journal = self._scene.enter_context(WornJournal(editor, self._journals))
        self._parts_hand = PartsHand(parts)
        self.state.tools.open(self._probe.measure, self._probe.inspect)
        actions = MenuActions(
            self.recentre, self.leave, self.pulse, self.shelf, self.shutter.press, self._keep_start,
            self.shutter.recorder, self._journal,
        )  # fmt: skip
        self.menu = WristMenu(self.state, actions, self.eyes.panel)
        self._over = OverSplats(self._wearing, self.eyes.panel, self._hand_glass)
        self._stood = False  # whether the person has been put before the scene

    def _change_scene(self) -> None:
        """Once another one is read, the session goes on in it."""
        messages = self.state.editor.messages
        opened = self.shelf.poll(messages.fail)
        if opened is None:
            return
        document, editor = opened
        before, carried = self.state, self.menu.carried
        pacing = before.pacing.for_scene(document.background_or(DARK))
        rules = before.user.rules
        self._enter(document, editor, pacing, rules, before.floor_shown)
        self.state.fit = before.fit
        self.state.user.travel = Travel(blink=1.0)  # it comes out of the dark
        self.menu.carried = carried
        self.session.pace.restart()

    def _keep_start(self, frame: Frame) -> None:
        """The scene begins here from now on: it is saved, as on a desk, and Recentre comes here."""
        state = self.state
        eye = state.play_space.pose(frame.head)
        if save_start(state.editor, eye):
            state.user.eye = eye
            self.shelf.remember(state.editor.edited.path)

    def close(self) -> None:
        """Ends what is being made for the scene, and waits for pictures."""
        self._scene.close()
        self._closing.close()

    def loop(self, frames: int = 0) -> None:
        """Until the runtime, the person at the desk or `frames` (0: none) end it."""
        for frame in self.session.frames(self._rest):
            self.frame(frame)
            self._change_scene()
            done = 0 < frames <= self.session.pace.frames
            if done or self.ends:
                self.leave("frames" if done else self.ends)

    def go_on(self, session: Session) -> None:
        """In another session, where the one before was lost."""
        same_room = self.session.play.kind == session.play.kind == ROOMS_OWN
        if self._comeback is None or self._comeback.placed:
            self._comeback = Comeback(self.state, self._head, same_room)
        self.session = session
        self.eyes.fit(session.sizes)

    def rest_at_desk(self) -> None:
        """While there is no session; nothing of it stays bound."""
        self.eyes.framebuffers[0].use()
        self.mirror.rest()

    def _rest(self) -> None:
        """While the headset lies on the table: the window can be closed all the same."""
        self.mirror.rest()
        if self.ends:
            self.leave(self.ends)

    @property
    def ends(self) -> str:
        """Why the person at the desk wants it to end; "" for not at all."""
        if self.interrupted:
            return "interrupted"
        return "closed at the desk" if self.mirror.closing else ""

    def leave(self, why: str) -> None:
        """Asks the runtime for the end; a few frames later it comes."""
        if not self.leaving:
            self.leaving, self.report.ended = True, why
            self.session.leave()

    def frame(self, frame: Frame) -> None:
        """One frame: the person, the world, the pictures of both eyes."""
        self._seconds = seconds = self._time_passed(frame)
        self.pulses.clear()
        state = self.state
        state.follow(self.session)
        frame, moves = state.fit.worn(frame, seconds)
        stops = self._obstacles and not state.through  # the room's own are seen
        state.user.rules = replace(state.worn.now.rules(state.user.rules), obstacles=stops)
        if moves:
            self._stand(frame)
        elif not self._stood or (frame.recentred and self._comeback is None):
            self.recentre(frame)
        self._stood |= frame.drawn  # before, nobody knows where the head is
        self._seen_s = frame.seen_s
        records = [] if self._rests(frame, seconds) else self._live(frame, seconds)
        if frame.drawn:
            self._head = frame.head
            views = [state.play_space.view(view) for view in frame.views]
            if self.shutter.wants(frame.seen_s) or not self._wearing.visibility:
                views = [replace(view, hidden=None) for view in views]
            state.shown = state.editor.shown(views[0])
            self._choose_quality(views)
            over = self._over.of(frame, state, self.menu.carried, self.session, self._worn_s)
            if self.shutter.due:
                over = replace(over, panel=None, lines=(), cards=())
            self._hand_over(frame.views, over, self.draw(views, frame.views, over))
            self.state.pacing.seen(self._drawing_ms, self.session.pace.last_ms)
            self.mirror.show(self.eyes.textures[0], self.eyes.inset(frame.views))
            left, messages = self.eyes.framebuffers[0], state.editor.messages
            self.shutter.keep(self.shelf, left, messages, frame.seen_s)
            if frame.seen_s - self._figured_s >= FIGURES_EVERY_S:
                self._figured_s = frame.seen_s
                self.state.figures = Figures.of(self.session.pace, self.stats)
        else:
            self.mirror.rest()
        session = self.session
        done = DoneFrame(
            frame,
            self.state,
            self.menu.row,
            self.pulses,
            records,
            session.life,
            session.pace,
            session.layers.last if frame.drawn else (),
        )
        self.report.note(done, self.eyes.framebuffers)

    def _rests(self, frame: Frame, seconds: float) -> bool:
        """Whether the world stands still, until a session that was lost is what it was."""
        if self._comeback is None:
            return False
        if (placed := self._comeback.place(frame)) is not None:
            self.state.play_space = placed
            self.state.user.jumped()  # what is held comes along
        rests = self._comeback.rests(frame, seconds)
        if self._comeback.over:
            self._comeback = None
        return rests

    def _live(self, frame: Frame, seconds: float) -> list[Record]:
        """What the person and their hands do, and the world after it."""
        before = self.state.play_space
        left_over = self.menu.act(frame, seconds)
        room, carried = self.state.play_space, self.menu.carried
        left_over = self._parts_hand.act(left_over, room, carried)
        left_over = self.state.tools.act(left_over, room, carried, self.state.shown, seconds)
        self.state.play_space = self.state.user.act(left_over, room, seconds)
        self._clearness = clearness(self._clearness, before, self.state.play_space, seconds)
        if self._worn_s > 0 or any(hand.active for hand in frame.hands.values()):
            self._worn_s += seconds
        records = self._pass(seconds)
        for pulse in strongest(self.state.user.felt(records)):
            self.pulse(pulse.side, pulse.strength, pulse.seconds)
        return records

    def _pass(self, seconds: float) -> list[Record]:
        """Lets time pass: what plays, edits that the world has to follow, then the world."""
        editor, touch = self.state.editor, self.state.touch
        editor.advance(seconds)
        editor.messages.ended(time.perf_counter())
        poll_bodies(editor)
        self._journal.each_frame()
        return touch.advance(seconds)

    def draw(
        self, views: list[View], play_views: Sequence[View], over: Drawn
    ) -> list[EyeDepth] | None:
        """Splats with one sort for both eyes, the floor behind them, the room over them.

        Returns how deep the splats are, where that was asked for.
        """
        look, deep = self.state.editor.settings, self._wearing.depth
        through = self.state.through
        self.background = BLACK if through else look.background
        settings = replace(self.state.pacing.settings(), debug=look.debug)
        fovea = self.state.worn.now.sharp(self.state.has_insets)
        self.session.gaze.wanted = fovea != "off"
        settings = replace(settings, depth_scale=DEPTH_SCALE if deep else 0.0, foveation=fovea)
        settings = replace(settings, heat_ends=look.heat_ends)
        self.renderer.settings = replace(settings, background=self.background)
        start = time.perf_counter()
        glass = self._hand_glass
        looking = glass.look(self.state, views, play_views)
        self.renderer.update(self.state.shown)
        if through:
            self._shadows.follow(self.renderer, self.state.shown, self._seconds)
        self.state.shadows = tuple(c.name for c in self._shadows.casts) if through else ()
        self.stats = self.renderer.draw(views)
        looking = glass.draw(looking, self.state)
        taken_ms = (time.perf_counter() - start) * 1e3
        # Depth is no part of what the chart of shortcuts has prices for.
        depth_ms = self.stats.ms.get("depth", 0.0)
        taken_ms = max(taken_ms - depth_ms, 0.0)
        # Nobody waits for a GPU: it may take longer than it took to tell it what to draw.
        self._drawing_ms = max(taken_ms, sum(self.stats.ms.values()) - depth_ms)
        self.session.pace.drew(self._drawing_ms, self._drawing_ms - taken_ms)
        depths = self.eyes.depths(self.renderer, self.state.play_space.scale) if deep else None
        eyes = self.eyes
        for i, framebuffer in enumerate(eyes.framebuffers):
            view, depth = play_views[i], depths[i] if depths else None
            self._show(self.renderer, i, framebuffer, view, eyes.floor, eyes.see_through)
            if looking is not None:
                glass.lay(looking, i, framebuffer, view, depth, self._show)
            eyes.overlay.draw(framebuffer, view, over, depth)
        return depths

    def _show(
        self, renderer: Renderer, i: int, framebuffer: moderngl.Framebuffer, play_view: View,
        floor: Floor, see_through: SeeThrough,
    ) -> None:  # fmt: skip
        """Picture i of a renderer, and behind its splats the room itself or the floor."""
        renderer.present(framebuffer, i)
        if self.state.through:
            see_through.draw(framebuffer, renderer.coverage(i))
            self._shadows.draw(framebuffer, self.state.play_space.view(play_view))
        elif self.state.floor_shown:
            grid, behind = Grid(self._level_m, self._clearness), plain_color(self.background)
            where = (play_view, self.state.play_space, renderer.coverage(i))
            floor.draw(framebuffer, *where, grid, behind)

    def _hand_over(
        self, play_views: Sequence[View], over: Drawn, depths: list[EyeDepth] | None
    ) -> None:
        """Both pictures, how deep they are and the panel, to the compositor."""
        eyes = self.eyes

        def write(i: int, framebuffer: moderngl.Framebuffer) -> None:
            if depths is not None:
                eyes.write_depth(i, framebuffer, play_views[i], depths[i], over)

        quad = quad_of(over, self.state.fit.lift_m)
        self.session.submit(eyes.textures, write if depths else None, quad, self.state.through)
        eyes.fill_panel(play_views, over)

    def _choose_quality(self, views: list[View]) -> None:
        scene, pacing = self.state.editor.scene, self.state.pacing

        def finish() -> None:
            self.mirror.ctx.finish()

        choose_quality(pacing, self.session.pace, self.renderer, scene, views, finish)

    def recentre(self, frame: Frame) -> None:
        """Back to where the scene is looked at first, at the size it has now; who sits is raised
        anew.
        """
        self.state.fit.measure(frame.head)
        self._stand(frame)

    def _stand(self, frame: Frame) -> None:
        self.state.play_space = self.state.user.before_scene(frame, self.state.play_space.scale)
        self.state.user.jumped()
        floor_y, under = self.state.user.floor_y, self.state.play_space.point(underfoot(frame.head))
        self._level_m = float(under[1]) if floor_y is None else floor_y

    def pulse(self, side: str, strength: float, seconds: float) -> None:
        """Buzzes a hand."""
        self.pulses.append((side, strength, seconds))
        self.session.pulse(side, strength, seconds)

    def _time_passed(self, frame: Frame) -> float:
        """Seconds since the frame before, by the runtime's clock; not those of a long rest."""
        if self._seen_s is None:
            return 0.0
        return min(max(frame.seen_s - self._seen_s, 0.0), LONGEST_STEP_S)
