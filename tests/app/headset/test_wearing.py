"""The order of a headset's frame with everything around it played: no runtime, no GL."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app.document import DARK
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.headset_report import Report
from shapeshift.app.headset.pacing import Pacing
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.headset.worn_settings import KeptSettings
from shapeshift.app.headset.xr_app import LONGEST_STEP_S, XrApp
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.floor import REST
from shapeshift.vr.frame import LOST, SIDES, Frame
from shapeshift.vr.openxr.events import Life
from shapeshift.vr.pace import FramePace
from tests.support.touch_scene import TOUCH

PERIOD = 1 / 90
HEAD = Pose(np.array([0.3, 1.6, -0.2]), np.array([np.cos(0.4), 0.0, np.sin(0.4), 0.0]))


def frame_at(seen_s: float, head: Pose = HEAD, **changes) -> Frame:
    views = tuple(View(head, (-1.0, 1.0, -1.0, 1.0), 0.05, 1000.0, (8, 8)) for _ in SIDES)
    frame = Frame(views, head, dict.fromkeys(SIDES, LOST), seen_s, PERIOD, True, True)
    return replace(frame, **changes)


class Played:
    """A session, mirror, renderer and eyes in one, that note what is asked of them in order."""

    def __init__(self, frames: list[Frame]) -> None:
        self.life, self.pace, self.play = Life(), FramePace(display_s=PERIOD), None
        self.asked: list[str] = []
        self.queue, self.closing, self.left = frames, False, 0
        self.settings, self.sees_through = RenderSettings(), False
        self.see_through = SimpleNamespace(draw=lambda *given: self.asked.append("see through"))
        self.overlay = SimpleNamespace(draw=lambda *given: self.asked.append("overlay"))
        self.floor = SimpleNamespace(draw=self.draw_floor)
        self.panel = SimpleNamespace(texture=None, boxes={})
        self.grids, self.profiles = [], {}
        self.framebuffers, self.textures = ["left", "right"], ["left", "right"]
        self.ctx, self.scenes, self.views = None, [], []
        self.layers, self.scales, self.written = SimpleNamespace(last=[]), [], []
        self.gaze = SimpleNamespace(wanted=False)
        self.shown = SimpleNamespace(has_insets=False, offers_insets=False)
        nothing = np.zeros((0, 4), np.float32), np.zeros((0, 8), np.float32)
        self.drawing = SimpleNamespace(read_splats=lambda i: nothing)

    def frames(self, resting):
        for frame in self.queue:
            if self.left > 2:
                return
            self.pace.start(frame.seen_s, PERIOD, 0.0)
            yield frame
            self.left += self.left > 0

    def depths(self, renderer, scale) -> list[str]:
        self.scales.append(scale)
        return ["left depth", "right depth"]

    def write_depth(self, *given) -> None:
        self.written.append(given)

    def fill_panel(self, views, drawn) -> None:
        self.asked.append("panel")

    def submit(self, textures, write_depth, quad, see_through) -> None:
        assert see_through == self.sees_through
        assert textures == ["left", "right"] and quad is None
        if write_depth is not None:
            write_depth(1, "framebuffer")
        self.asked.append("submit")
        self.pace.end(0.004)

    def leave(self) -> None:
        self.left = 1

    def pulse(self, side, strength, seconds) -> None:
        self.asked.append(f"pulse {side}")

    def inset(self, play_views) -> None:
        return None

    def show(self, texture, inset=None) -> None:
        self.asked.append("mirror")

    def rest(self) -> None:
        self.asked.append("rest")

    def update(self, scene) -> None:
        self.scenes.append(scene)

    def draw(self, views) -> FrameStats:
        self.asked.append("draw")
        self.views.append(views)
        return FrameStats()

    def present(self, framebuffer, i) -> None:
        self.asked.append(f"present {framebuffer}")

    def coverage(self, i) -> str:
        return f"coverage {i}"

    def draw_floor(self, framebuffer, view, play_space, coverage, grid, background) -> None:
        self.asked.append(f"floor by {coverage}")
        self.grids.append(grid)


@pytest.fixture(scope="module")
def scene():
    return open_xr(TOUCH, Options())


@pytest.fixture
def wear(scene):
    def worn(frames: list[Frame], quality: str = "best") -> tuple[XrApp, Played]:
        played = Played(frames)
        document, _ = scene
        pacing, report = Pacing(document.background_or(DARK), quality), Report()
        return XrApp(played, played, played, played, *scene, pacing, report), played

    return worn


def head_in_world(xr_app: XrApp, frame: Frame) -> np.ndarray:
    return xr_app.state.play_space.pose(frame.head).matrix()


def test_a_frame_goes_in_order_and_draws_both_eyes_at_once(wear):
    xr_app, played = wear([frame_at(0.0), frame_at(PERIOD)])
    xr_app.loop()
    eyes = ["present left", "floor by coverage 0", "overlay",
            "present right", "floor by coverage 1", "overlay"]  # fmt: skip
    assert played.asked == ["draw", *eyes, "submit", "panel", "mirror"] * 2
    assert played.settings.depth_scale > 0 and played.scales == [1.0] * 2
    assert [(eye, into, depth) for eye, into, _, depth, _ in played.written] == [
        (1, "framebuffer", "right depth")
    ] * 2
    assert [len(views) for views in played.views] == [2, 2]
    assert played.settings.background == xr_app.background
    left = played.views[0][0].world_from_eye
    np.testing.assert_allclose(left.matrix(), head_in_world(xr_app, frame_at(0.0)), atol=1e-9)


def test_the_floor_is_that_of_the_scene_and_clearer_while_one_moves(wear):
    xr_app, played = wear([frame_at(i * PERIOD) for i in range(3)])
    xr_app.loop()
    assert {grid.level_m for grid in played.grids} == {xr_app.state.user.floor_y}
    resting = played.grids[-1].clearness
    stick = replace(LOST, active=True, grip=HEAD, aim=HEAD, stick=(0.0, 1.0))
    hands = {"left": stick, "right": LOST}
    for i in range(3, 40):
        xr_app.frame(frame_at(i * PERIOD, hands=hands))
    assert played.grids[-1].clearness > 0.95 > 2 * resting
    for i in range(40, 400):
        xr_app.frame(frame_at(i * PERIOD))
    assert played.grids[-1].clearness == pytest.approx(REST, abs=0.02)
    xr_app.state.floor_shown, count = False, len(played.grids)
    xr_app.frame(frame_at(400 * PERIOD))
    assert len(played.grids) == count


def test_a_scene_without_a_floor_has_it_where_one_stood_first(wear):
    xr_app, played = wear([frame_at(0.0)])
    xr_app.state.user.floor_y = None
    xr_app.loop()
    feet = xr_app.state.play_space.point(HEAD.position * (1, 0, 1))[1]
    assert played.grids[-1].level_m == pytest.approx(feet)
    up = replace(LOST, active=True, grip=HEAD, aim=HEAD, stick=(0.0, 1.0))
    for i in range(1, 60):  # flies
        xr_app.frame(frame_at(i * PERIOD, hands={"left": LOST, "right": up}))
    assert xr_app.state.play_space.point(HEAD.position * (1, 0, 1))[1] > feet + 0.3
    assert played.grids[-1].level_m == pytest.approx(feet)


def test_what_is_not_shown_is_not_drawn_and_the_world_goes_on(wear):
    xr_app, played = wear([frame_at(i * PERIOD, drawn=False) for i in range(5)])
    before = xr_app.state.world.time_s
    xr_app.loop()
    assert played.asked == ["rest"] * 5
    assert xr_app.state.world.time_s - before == pytest.approx(4 * PERIOD)


def test_the_person_is_put_before_the_scene_once_the_head_is_known(wear):
    unknown = frame_at(0.0, IDENTITY, drawn=False)
    xr_app, _ = wear([unknown, frame_at(PERIOD)])
    xr_app.loop()
    found = head_in_world(xr_app, frame_at(PERIOD))
    eye = xr_app.state.user.eye.matrix()
    np.testing.assert_allclose(found[[0, 2], 3], eye[[0, 2], 3], atol=1e-9)
    assert found[1, 3] == pytest.approx(1.6 + xr_app.state.user.floor_y)
    ahead = -found[:3, 2]
    level = -eye[:3, 2] * (1, 0, 1)
    np.testing.assert_allclose(ahead, level / np.linalg.norm(level), atol=1e-9)


def test_who_walks_on_stays_there_and_recentring_brings_them_back(wear):
    walked = Pose(HEAD.position + np.array([1.0, 0.0, 0.5]), HEAD.wxyz)
    frames = [frame_at(0.0), frame_at(PERIOD, walked)]
    xr_app, _ = wear(frames)
    xr_app.loop()
    start = head_in_world(xr_app, frame_at(0.0))
    away = head_in_world(xr_app, frames[1])
    assert np.linalg.norm(away[:3, 3] - start[:3, 3]) == pytest.approx(np.hypot(1.0, 0.5))
    again = frame_at(2 * PERIOD, walked, recentred=True)
    xr_app.frame(again)
    np.testing.assert_allclose(head_in_world(xr_app, again), start, atol=1e-9)


def test_a_long_rest_is_no_long_step(wear):
    xr_app, _ = wear([frame_at(0.0), frame_at(600.0)])
    passed = []
    act = xr_app.state.user.act
    xr_app.state.user.act = lambda frame, play_space, seconds: (
        passed.append(seconds) or act(frame, play_space, seconds)
    )
    xr_app.loop()
    assert passed == [0.0, LONGEST_STEP_S]


@pytest.mark.parametrize("why", ["frames", "closed at the desk", "interrupted"])
def test_the_end_is_asked_for_once_and_frames_go_on_until_it_comes(wear, why):
    xr_app, played = wear([frame_at(i * PERIOD) for i in range(20)])
    played.closing, xr_app.interrupted = why == "closed at the desk", why == "interrupted"
    xr_app.loop(3 if why == "frames" else 0)
    assert xr_app.report.ended == why
    assert played.asked.count("submit") == (4 if why == "frames" else 2)  # one more comes


def test_the_window_can_be_closed_while_the_headset_rests(wear):
    xr_app, played = wear([])
    played.closing = True
    xr_app._rest()  # what the session calls while no frame is wanted: the double has no such wait
    assert played.left and xr_app.report.ended == "closed at the desk"


def test_over_the_room_there_is_no_floor_and_no_background(scene):
    played = Played([frame_at(0.0), frame_at(PERIOD)])
    played.sees_through = True
    document, _ = scene
    parts = (played, played, played, played, *scene, Pacing(DARK, "best"), Report())
    xr_app = XrApp(*parts, worn=KeptSettings(passthrough=True))
    xr_app.loop()
    eyes = [name for side in SIDES for name in (f"present {side}", "see through", "overlay")]
    assert played.asked == ["draw", *eyes, "submit", "panel", "mirror"] * 2
    assert played.settings.background == (0.0, 0.0, 0.0)
    played.sees_through, xr_app.state.sees_through = False, False
    xr_app.frame(frame_at(2 * PERIOD))
    assert played.settings.background == document.background_or(DARK)


def test_the_gaze_is_asked_for_while_only_its_surroundings_are_sharp(scene):
    played = Played([])
    parts = (played, played, played, played, *scene, Pacing(DARK, "best"), Report())
    xr_app = XrApp(*parts, worn=KeptSettings(foveation="high"))
    xr_app.frame(frame_at(0.0))
    assert played.settings.foveation == "high" and played.gaze.wanted
    xr_app.state.worn.choose(foveation="off")
    xr_app.frame(frame_at(PERIOD))
    assert played.settings.foveation == "off" and not played.gaze.wanted
