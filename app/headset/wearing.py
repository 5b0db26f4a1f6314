"""The loop of a headset: what happens in a frame, in order."""

import time
from collections.abc import Sequence

import moderngl

from app.headset.headset_report import Report
from app.headset.mirror import Mirror, NoMirror
from app.headset.pacing import Pacing, StereoChart
from app.headset.person import Person
from app.headset.worn_panel import WornPanel
from app.headset.worn_scene import WornScene
from renderer.renderer import Renderer
from renderer.settings import FrameStats
from scene.pose import View
from vr.drawn import Drawn, drawn_of
from vr.frame import Frame
from vr.locomotion import RULES, Rules
from vr.overlay import Overlay
from vr.session import Session
from vr.standing import Standing
from vr.touching import strongest

LONGEST_STEP_S = 0.25  # of time that passes at once: a headset may have lain on the table


class Eyes:
    """Our own picture of each eye: RGBA8, display-encoded; use it in a `with`.

    And what is drawn over it.
    """

    def __init__(self, ctx: moderngl.Context, sizes: Sequence[tuple[int, int]]) -> None:
        self.overlay = Overlay(ctx)
        self.framebuffers = [ctx.framebuffer([ctx.texture(size, 4)]) for size in sizes]

    @property
    def textures(self) -> list[moderngl.Texture]:
        return [framebuffer.color_attachments[0] for framebuffer in self.framebuffers]

    def __enter__(self) -> "Eyes":
        return self

    def __exit__(self, *failure) -> None:
        self.overlay.release()
        for framebuffer, texture in zip(self.framebuffers, self.textures, strict=True):
            framebuffer.release()
            texture.release()


class Wearing:
    """One session with one scene, from the first frame to the last."""

    def __init__(
        self,
        session: Session,
        renderer: Renderer,
        eyes: Eyes,
        mirror: Mirror | NoMirror,
        scene: WornScene,
        pacing: Pacing,
        report: Report,
        rules: Rules = RULES,
        panel_hand: str = "left",
    ) -> None:
        self.session, self.renderer, self.eyes, self.mirror = session, renderer, eyes, mirror
        self.scene, self.world = scene, scene.world
        self.pacing, self.report = pacing, report
        self.person = Person(scene.world, scene.eye, scene.floor_y, rules)
        self.panel = WornPanel(panel_hand)
        self.standing = Standing()
        self.pulses: list[tuple[str, float, float]] = []  # of this frame: side, strength, seconds
        self.stats = FrameStats()
        self._seen_s: float | None = None  # when the frame before was to be seen
        self._drawing_ms = 0.0  # of the splats of both eyes, last
        self._stood = False  # whether the person has been put before the scene
        self.interrupted = False  # by Ctrl-C: no frame is left half done
        self._leaving = False

    def loop(self, frames: int = 0) -> None:
        """Until the runtime, the person at the desk or `frames` (0: none) end it."""
        for frame in self.session.frames(self._rest):
            self.frame(frame)
            done = 0 < frames <= self.session.pace.frames
            if done or self._ends:
                self.leave("frames" if done else self._ends)

    def _rest(self) -> None:
        """While the headset lies on the table: the window can be closed all the same."""
        self.mirror.rest()
        if self._ends:
            self.leave(self._ends)

    @property
    def _ends(self) -> str:
        """Why the person at the desk wants it to end; "" for not at all."""
        if self.interrupted:
            return "interrupted"
        return "closed at the desk" if self.mirror.closing else ""

    def leave(self, why: str) -> None:
        """Asks the runtime for the end; a few frames later it comes."""
        if not self._leaving:
            self._leaving, self.report.ended = True, why
            self.session.leave()

    def frame(self, frame: Frame) -> None:
        """One frame: the person, the world, the pictures of both eyes."""
        seconds = self._time_passed(frame)
        self.pulses.clear()
        if not self._stood or frame.recentred:
            self.recentre(frame)
        self._stood |= frame.drawn  # before, nobody knows where the head is
        self._seen_s = frame.seen_s
        left_over = self.panel.act(self, frame, seconds)
        self.standing = self.person.act(left_over, self.standing, seconds)
        records = self.world.advance(seconds)
        for pulse in strongest(self.person.felt(records)):
            self.pulse(pulse.side, pulse.strength, pulse.seconds)
        if frame.drawn:
            views = [self.standing.view(view) for view in frame.views]
            self._choose_quality(views)
            person = self.person
            over = drawn_of(frame.hands, self.panel.carried, person.comfort, person.touched)
            self.draw(views, frame.views, over)
            self.session.submit(self.eyes.textures)
            self.pacing.seen(self._drawing_ms, self.session.pace.last_ms)
            self.mirror.show(self.eyes.textures[0])
        else:
            self.mirror.rest()
        self.report.note(self, frame, records)

    def draw(self, views: list[View], play_views: Sequence[View], over: Drawn) -> None:
        """Splats with one sort for both eyes, and what is in the room over them."""
        self.renderer.settings = self.pacing.settings()
        start = time.perf_counter()
        self.renderer.update(self.world.drawn())
        self.stats = self.renderer.draw(views)  # waits for what it timed, on a GPU too
        self._drawing_ms = (time.perf_counter() - start) * 1e3
        self.session.pace.drew(self._drawing_ms)
        for i, framebuffer in enumerate(self.eyes.framebuffers):
            self.renderer.present(framebuffer, i)
            self.eyes.overlay.draw(framebuffer, play_views[i], over)

    def _choose_quality(self, views: list[View]) -> None:
        """What of the picture can be had within the display's period: once that is known, and
        when it is another one.
        """
        pace = self.session.pace
        if not (pace.settled and self.pacing.wants_measure(pace.period_s)):
            return
        scene, finish = self.world.drawn(), self.mirror.ctx.finish
        chart = StereoChart(self.renderer, scene, views, self.scene.centre, finish)
        self.pacing.measure(chart, pace.period_s)
        pace.restart()

    def recentre(self, frame: Frame) -> None:
        """Back to where the scene is looked at first, at the size it has now."""
        self.standing = self.person.before_scene(frame, self.standing.scale)
        self.person.jumped()

    def pulse(self, side: str, strength: float, seconds: float) -> None:
        """Buzzes a hand."""
        self.pulses.append((side, strength, seconds))
        self.session.pulse(side, strength, seconds)

    def _time_passed(self, frame: Frame) -> float:
        """Seconds since the frame before, by the runtime's clock; not those of a long rest."""
        if self._seen_s is None:
            return 0.0
        return min(max(frame.seen_s - self._seen_s, 0.0), LONGEST_STEP_S)
