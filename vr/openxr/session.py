"""A session in a headset: its life, its frames, its pictures.

    with Instance() as instance, Session(instance, ctx) as session:
        for frame in session.frames():
            session.submit(textures)  # one a view, display-encoded, of session.sizes

The order of a frame is the runtime's: wait, begin, locate, draw, hand over, end.
"""

import ctypes
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import moderngl
import numpy as np

from shapeshift.renderer.foveation import hidden_pixels
from shapeshift.renderer.gl.context import is_software
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.frame import FAR_M, NEAR_M, Frame, Hand
from shapeshift.vr.openxr.events import (
    BEGIN,
    END,
    LOST,
    ControllersChanged,
    GoingAway,
    Life,
    MaskChanged,
    PassthroughChanged,
    Recentred,
    StateChanged,
    poll_events,
)
from shapeshift.vr.openxr.graphics import bind_current, check_requirements, choose_format
from shapeshift.vr.openxr.hands import Hands, pose_of
from shapeshift.vr.openxr.instance import DISPLAY_RATE, Instance, Lost, NoHeadset
from shapeshift.vr.openxr.layers import FrameLayers, QuadPicture, WriteDepth
from shapeshift.vr.openxr.room import (
    Bounds,
    Passthrough,
    locate,
    moved_by,
    open_head_space,
    open_play_space,
    valid,
)
from shapeshift.vr.openxr.tracked import Gaze, HandTrackers, tangents_along
from shapeshift.vr.openxr.view_configuration import VisibilityMasks, choose_views, with_insets
from shapeshift.vr.pace import FramePace

REST_S = 0.01  # between two looks at what the runtime says while there is nothing to draw
MOST_ERRORS = 16  # of GL that a runtime may have left behind


class Session:
    """One session on the GL context that is current; use it in a `with`.

    `sizes`: (width, height) of each view's picture; `shown`: which views there are; `play`,
    `hands`, `life`, `pace` as named.
    """

    def __init__(
        self,
        instance: Instance,
        ctx: moderngl.Context,
        part: float = 1.0,  # of the runtime's width and height of an eye
        pixels: str = "",  # name of a Format; "": the best
        controllers: bool = True,  # False: hands are seen without, even where there are any
        insets: bool = False,  # for each eye a sharp inset too, where the runtime has that
    ) -> None:
        self._instance, self._ctx, self._xr = instance, ctx, instance.xr
        self.life, self.pace = Life(), FramePace()
        self.recentrings = 0
        self.profiles: dict[str, str] = {}  # side -> what its controller is taken for
        self._pending: list[Recentred] = []
        self._open: Any | None = None  # the runtime's state of the frame under way
        self._views: tuple = ()  # the runtime's, of the open frame
        self._located: tuple[View, ...] = ()  # the same, ours
        self._start_ns: int | None = None
        self._before_s = self._seen_s = 0.0  # at the first frame; of the last one
        self.shown = choose_views(instance, insets)
        self._head, self._eyes = IDENTITY, [IDENTITY] * len(self.shown.views)
        self._began = 0.0
        self._finish = ctx.finish if is_software(ctx) else lambda: None
        self.hands, self.gaze = Hands(instance.handle), Gaze(instance)
        self._handle = self._create()
        self.play = open_play_space(instance, self._handle)
        self._view_space = open_head_space(instance, self._handle)
        self._bounds = Bounds(instance, self._handle)
        self.hands.attach(self._handle, self.gaze.sets)
        self.gaze.open_space(self._handle)
        self._controllers, self.bare_hands = controllers, HandTrackers(instance, self._handle)
        self.pace.display_s = display_period(instance, self._handle)
        self.layers = self._make_layers(part, pixels)
        self.masks = VisibilityMasks(instance, self._handle, self.shown)

    def _create(self) -> Any:
        xr, instance = self._xr, self._instance
        check_requirements(instance)
        binding = bind_current(instance)
        pointer = ctypes.cast(ctypes.pointer(binding), ctypes.c_void_p)
        info = xr.SessionCreateInfo(system_id=instance.system, next=pointer)
        try:
            with instance.asked("begin a session"):
                return xr.create_session(instance.handle, info)
        except (xr.exception.GraphicsDeviceInvalidError, xr.exception.ApiVersionUnsupportedError):
            raise NoHeadset(
                f"{instance.runtime} does not take pictures of {self._ctx.info['GL_RENDERER']}; "
                "the headset hangs on another graphics card, or another runtime should be active."
            ) from None

    def _make_layers(self, part: float, pixels: str) -> FrameLayers:
        xr, instance = self._xr, self._instance
        system = (instance.handle, instance.system, self.shown.kind)
        blends = xr.enumerate_environment_blend_modes(*system)
        self._blend, self._alpha = choose_blend(xr, blends), xr.EnvironmentBlendMode.ALPHA_BLEND
        self._blends_alpha = int(self._alpha) in map(int, blends)
        self._passthrough = Passthrough(instance, self._handle, not self._blends_alpha)
        offered = [int(each) for each in xr.enumerate_swapchain_formats(self._handle)]
        try:
            self.pixels = choose_format(offered, pixels)
        except ValueError as none:
            raise NoHeadset(f"{instance.runtime}: {none}") from None
        sizes = [eye_size(view, part) for view in self.shown.views]
        return FrameLayers(instance, self._handle, self._ctx, sizes, self.pixels)

    @property
    def sees_through(self) -> bool:
        """Whether the room itself can be shown, where pictures let."""
        return self._blends_alpha or self._passthrough.there

    @property
    def sizes(self) -> list[tuple[int, int]]:
        return self.layers.sizes

    def frames(self, resting: Callable[[], None] = lambda: None) -> Iterator[Frame]:
        """One frame after the other until the session is over; Lost where it went away.

        A frame that nobody submits a picture for shows nothing.  `resting` is called while the
        runtime wants no frames.
        """
        while True:
            self._poll_events()
            if self.life.over:
                break
            if not self.life.running:
                resting()
                time.sleep(REST_S)
                continue
            yield self._begin()
            if self._open is not None:
                self._end([])
        if self.life.lost:
            raise Lost(f"{self._instance.runtime} ended the session.")

    def submit(
        self,
        textures: Sequence[moderngl.Texture],
        write_depth: WriteDepth | None = None,
        quad: QuadPicture | None = None,
        see_through: bool = False,
    ) -> None:
        """Shows one display-encoded RGBA8 picture a view, of `sizes`, row 0 at the bottom.

        write_depth: draws how deep a view's picture is.  quad: lies behind the eyes' pictures,
        where their alpha is below 1.  see_through: there the room itself is seen.
        """
        through = see_through and self.sees_through
        made = self.layers.hand_over(
            textures, self._views, self.play.handle, write_depth, quad, through
        )
        below = self._passthrough.layer(through)
        every = [*([] if below is None else [below]), *made]
        self._end([ctypes.byref(layer) for layer in every], through)

    def hidden_parts(self) -> list[float]:
        """Of each view's picture the share that its lens does not show, as the runtime tells it."""
        return [round(float(hidden_pixels(view).mean()), 4) for view in self._located]

    def leave(self) -> None:
        """Asks the runtime to end the session; frames() goes on until it has."""
        if self.life.running:
            with self._instance.asked("end the session"):
                self._xr.request_exit_session(self._handle)
        else:
            self.life.states.append("EXITING")  # never begun: there is nothing to wait for

    def follow(self, lost: "Session") -> None:
        """Goes on with the counts, states and clock of one that was lost."""
        display_s, self.pace = self.pace.display_s, lost.pace
        self.pace.display_s = display_s
        self.pace.pause()
        self.pace.restart()
        self.recentrings, self._before_s = lost.recentrings, lost._seen_s
        self.life.states = [*lost.life.states, LOST]

    def _poll_events(self) -> None:
        xr = self._xr
        with self._instance.asked("say what is new"):
            for event in poll_events(xr, self._instance.handle):
                match event:
                    case StateChanged(state):
                        self._enter_state(state)
                    case Recentred():
                        self._pending.append(event)
                        self._bounds.ask()
                    case ControllersChanged():
                        self.profiles = self.hands.profiles()
                    case MaskChanged():
                        self.masks.ask()
                    case PassthroughChanged(flags):
                        self._passthrough.changed(flags)
                    case GoingAway():
                        self.life.lost = True

    def _enter_state(self, state: str) -> None:
        xr, act = self._xr, self.life.enter(state)
        if act == BEGIN:
            xr.begin_session(self._handle, xr.SessionBeginInfo(self.shown.kind))
        elif act == END:
            xr.end_session(self._handle)
            self.pace.pause()

    def _begin(self) -> Frame:
        """Waits for the runtime's go, then says where all will be when this frame is seen."""
        xr, asked = self._xr, time.perf_counter()
        with self._instance.asked("give a frame"):
            state = xr.wait_frame(self._handle)
            self._began = time.perf_counter()
            xr.begin_frame(self._handle)
            self._open = state
            now = state.predicted_display_time
            if self._start_ns is None:
                self._start_ns = now
            self._seen_s = seen_s = self._before_s + (now - self._start_ns) * 1e-9
            period_s = state.predicted_display_period * 1e-9
            self.pace.start(seen_s, period_s, self._began - asked)
            self._locate_head(now)
            views, known = self._locate_eyes(now)
            focused = self.life.focused
            hands = self._read_hands(now, focused)
            area = self._bounds.area(self.play, now)
        drawn = bool(state.should_render) and known
        recentred = self._recentred(now)
        return Frame(views, self._head, hands, seen_s, period_s, drawn, focused, recentred, area)

    def _read_hands(self, now: int, focused: bool) -> dict[str, Hand]:
        """Controllers, and in the place of one that is not there the bare hand."""
        more = self.gaze.sets if self.gaze.wanted else ()
        hands, bare = self.hands.read(self.play.handle, now, focused, more), self.bare_hands
        if focused and bare.there:
            for side, hand in hands.items():
                if not (self._controllers and hand.active):
                    hands[side] = bare.hand(side, self.play.handle, now, self._head)
        return hands

    def _locate_head(self, now: int) -> None:
        found = locate(self._xr, self._view_space, self.play, now)
        if found is not None:
            pose, placed, turned = found
            self._head = known_part(pose, self._head, placed, turned)

    def _locate_eyes(self, now: int) -> tuple[tuple[View, ...], bool]:
        """play_from_eye of all views, and whether the runtime knows how they are turned."""
        xr = self._xr
        asked = xr.ViewLocateInfo(self.shown.kind, now, self.play.handle)
        state, self._views = xr.locate_views(self._handle, asked)
        placed, turned = valid(xr.ViewStateFlags, state.view_state_flags)
        self._eyes = [
            known_part(pose_of(view.pose), old, placed, turned)
            for view, old in zip(self._views, self._eyes, strict=True)
        ]
        ahead = self.gaze.direction(self.play.handle, now) if self.life.focused else None
        views = [
            View(
                pose,
                tangents_of(view.fov),
                NEAR_M,
                FAR_M,
                size,
                hidden=self.masks.of(i),
                gaze=tangents_along(ahead, pose),
            )
            for i, (pose, view, size) in enumerate(
                zip(self._eyes, self._views, self.sizes, strict=True)
            )
        ]
        self._located = with_insets(views)
        return self._located, turned

    def _recentred(self, now: int) -> bool:
        """Whether play space has had another origin since the last frame."""
        due = [event for event in self._pending if event.time_ns <= now]
        self._pending = [event for event in self._pending if event.time_ns > now]
        moved = any(moved_by(event.space, self.play.kind) for event in due)
        self.recentrings += moved
        return moved

    def _end(self, layers: list, see_through: bool = False) -> None:
        xr, state = self._xr, self._open
        assert state is not None  # a frame is under way
        self._open = None
        self._finish()
        self._drain()
        blend = self._alpha if see_through and self._blends_alpha else self._blend
        info = xr.FrameEndInfo(state.predicted_display_time, blend, layers=layers)
        self.pace.end(time.perf_counter() - self._began)
        with self._instance.asked("take a frame"):
            xr.end_frame(self._handle, info)
        self._drain()

    def pulse(self, side: str, strength: float, seconds: float) -> None:
        """Buzzes a hand, 0 to 1.  Raises Lost."""
        with self._instance.asked("buzz a hand"):
            self.hands.pulse(side, strength, seconds)

    def _drain(self) -> None:
        """Forgets GL errors: SteamVR leaves some, and runtimes fail over older ones."""
        for _ in range(MOST_ERRORS):
            if self._ctx.error == "GL_NO_ERROR":
                return

    def close(self) -> None:
        """Gives all back, also what was lost with the runtime."""
        self.layers.close()
        self._passthrough.close()
        self.bare_hands.close()
        ended = (self.gaze.close, self.hands.detach, self.hands.close)
        for end in (*ended, lambda: self._xr.destroy_session(self._handle)):
            try:
                end()
            except self._xr.exception.ErrorResult:
                pass  # lost with the runtime

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *failure) -> None:
        self.close()


def eye_size(view, part: float) -> tuple[int, int]:
    """Pixels of an eye: `part` of what the runtime recommends, at most what it allows."""
    recommended = (view.recommended_image_rect_width, view.recommended_image_rect_height)
    most = (view.max_image_rect_width, view.max_image_rect_height)
    wanted = [max(1, round(part * side)) for side in recommended]
    return min(wanted[0], most[0]), min(wanted[1], most[1])


def choose_blend(xr, offered: Sequence) -> Any:
    """How the picture covers the room: wholly, or as glasses that are seen through like it best."""
    modes = [xr.EnvironmentBlendMode(int(each)) for each in offered]
    opaque = xr.EnvironmentBlendMode.OPAQUE
    return opaque if opaque in modes or not modes else modes[0]


def tangents_of(fov) -> tuple[float, float, float, float]:
    """Left, right, down, up of an XrFovf, whose angles are signed."""
    left, right = math.tan(fov.angle_left), math.tan(fov.angle_right)
    return left, right, math.tan(fov.angle_down), math.tan(fov.angle_up)


def known_part(pose: Pose, old: Pose, placed: bool, turned: bool) -> Pose:
    """The pose with what is not known of it as it was before."""
    if not turned:
        return Pose(pose.position, old.wxyz) if placed else old
    wxyz = pose.wxyz / np.linalg.norm(pose.wxyz)  # float32 of the runtime
    return Pose(pose.position if placed else old.position, wxyz)


# How often the headset's display shows a picture, where the runtime tells it.


def display_period(instance: Instance, session: Any) -> float:
    """Seconds between two pictures of the display; 0 where the runtime does not tell."""
    if DISPLAY_RATE not in instance.extensions:
        return 0.0
    xr = instance.xr
    address = xr.get_instance_proc_addr(instance.handle, "xrGetDisplayRefreshRateFB")
    ask = ctypes.CFUNCTYPE(ctypes.c_int, xr.Session, ctypes.POINTER(ctypes.c_float))(
        ctypes.cast(address, ctypes.c_void_p).value or 0
    )
    hz = ctypes.c_float(0.0)
    if ask(session, ctypes.byref(hz)) != 0:  # XR_SUCCESS
        return 0.0
    return 1 / hz.value if hz.value > 0 else 0.0
