"""What of a session needs no runtime: its life, its pace, what it makes of what it is told."""

import json
import math
import sys
from dataclasses import dataclass
from enum import IntEnum
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.openxr import instance as instance_module
from shapeshift.vr.openxr.events import BEGIN, END, Life
from shapeshift.vr.openxr.instance import Instance, Lost, NoHeadset, load, manifests
from shapeshift.vr.openxr.room import KINDS, choose_kind, moved_by
from shapeshift.vr.openxr.session import choose_blend, eye_size, known_part, tangents_of
from shapeshift.vr.pace import RECOVER, SETTLED, FramePace

PERIOD = 1 / 90


def test_a_life_begins_once_and_ends_once():
    life = Life()
    acts = [life.enter(state) for state in ("IDLE", "READY", "SYNCHRONIZED", "VISIBLE", "FOCUSED")]
    assert acts == ["", BEGIN, "", "", ""] and life.running and life.focused and not life.over
    acts = [life.enter(state) for state in ("VISIBLE", "SYNCHRONIZED", "STOPPING", "IDLE")]
    assert acts == ["", "", END, ""] and not (life.running or life.focused or life.over)
    life.enter("EXITING")
    assert life.over and not life.lost


def test_a_headset_that_is_taken_off_and_put_on_again_begins_anew():
    life = Life()
    acts = [
        life.enter(state) for state in ("IDLE", "READY", "FOCUSED", "STOPPING", "IDLE", "READY")
    ]
    assert acts == ["", BEGIN, "", END, "", BEGIN] and life.running and not life.over


def test_a_session_that_is_taken_away_is_over_and_lost():
    life = Life()
    for state in ("IDLE", "READY", "FOCUSED", "LOSS_PENDING"):
        life.enter(state)
    assert life.over and life.lost and not life.running


def run(pace: FramePace, gaps: list[int], own_s: float = 0.004, told_s: float = PERIOD) -> None:
    """Frames that are seen so many periods after one another."""
    seen = 0.0
    for gap in gaps:
        seen += gap * PERIOD
        pace.start(seen, told_s, 0.001)
        pace.end(own_s)


def test_every_period_without_a_frame_of_ours_is_a_dropped_one():
    pace = FramePace(display_s=PERIOD)
    run(pace, [1, 1, 2, 1, 4, 1])
    assert (pace.frames, pace.dropped, pace.late, pace.over) == (6, 1 + 3, 2, 0)
    shown = pace.report()["shown_ms"]
    assert (shown["p50"], shown["worst"]) == (round(PERIOD * 1e3, 3), round(4 * PERIOD * 1e3, 3))
    assert pace.report()["in_time"] == 1 - 2 / 5  # of five gaps between six frames
    assert pace.report()["own_ms"] == dict.fromkeys(("p50", "p95", "p99", "worst"), 4.0)
    run(pace, [1] * 3, own_s=0.02)
    assert pace.over == 3 and pace.report()["own_ms"]["worst"] == 20.0


def test_a_rest_of_the_session_drops_nothing():
    pace = FramePace(display_s=PERIOD)
    run(pace, [1, 1])
    pace.pause()
    run(pace, [500, 1])
    assert pace.dropped == 0


def test_a_frame_that_measured_does_not_count_nor_do_those_after_it():
    pace = FramePace(display_s=PERIOD)
    run(pace, [1, 1])
    pace.start(3 * PERIOD, PERIOD, 0.0)
    pace.restart()
    pace.end(2.0)
    assert pace.last_ms == 0 and pace.over == 0
    seen = 200 * PERIOD
    for _ in range(RECOVER - 1):
        seen += 3 * PERIOD
        pace.start(seen, PERIOD, 0.0)
        pace.end(0.004)
    assert pace.dropped == 0
    for gap in (1, 2):
        seen += gap * PERIOD
        pace.start(seen, PERIOD, 0.0)
        pace.end(0.004)
    assert pace.dropped == 1 and pace.last_ms == pytest.approx(4)


def test_the_shortest_period_told_lately_is_the_displays_once_guesses_are_over():
    pace = FramePace()
    run(pace, [1] * SETTLED, told_s=PERIOD / 3)  # a guess
    assert not pace.settled and pace.dropped == 0
    run(pace, [2, 2, 2], told_s=2 * PERIOD)  # for one who is slow
    run(pace, [1], told_s=PERIOD)
    assert pace.settled and pace.period_s == pytest.approx(PERIOD)


def test_ten_minutes_at_120_hertz_are_kept_to_the_first_frame():
    pace = FramePace(display_s=1 / 120)
    pace.start(0.0, 1 / 120, 0.0)
    pace.end(0.5)  # the worst of all, at the very start
    for i in range(1, 72_000):
        pace.start(i / 120, 1 / 120, 0.0)
        pace.end(0.004)
    assert pace.report()["own_ms"]["worst"] == 500.0 and len(pace.own_ms) == 72_000


def test_a_pace_without_frames_has_a_report():
    nothing = {name: {} for name in ("own_ms", "drawing_ms", "wait_ms", "shown_ms")}
    counts = {"frames": 0, "dropped": 0, "over_period": 0, "period_ms": 0.0, "in_time": None}
    assert FramePace().report() == counts | nothing


def test_play_space_falls_back_in_order():
    assert choose_kind({"STAGE", "LOCAL", "LOCAL_FLOOR", "VIEW"}) == "LOCAL_FLOOR"
    assert choose_kind({"STAGE", "LOCAL"}) == "STAGE"
    assert choose_kind({"LOCAL"}) == "LOCAL"
    with pytest.raises(ValueError, match="a runtime must offer LOCAL space"):
        choose_kind(set())
    assert all(moved_by(kind, kind) for kind in KINDS)
    assert moved_by("LOCAL", "LOCAL_FLOOR") and not moved_by("LOCAL", "STAGE")
    assert not moved_by("STAGE", "LOCAL_FLOOR")


def test_an_eye_has_what_is_recommended_within_what_is_allowed():
    view = SimpleNamespace(
        recommended_image_rect_width=2000, recommended_image_rect_height=2200,
        max_image_rect_width=4096, max_image_rect_height=2400,
    )  # fmt: skip
    assert eye_size(view, 1.0) == (2000, 2200)
    assert eye_size(view, 0.5) == (1000, 1100)
    assert eye_size(view, 2.0) == (4000, 2400)
    assert eye_size(view, 1e-6) == (1, 1)


def test_glasses_have_their_own_way_to_cover_the_room():
    xr = SimpleNamespace(EnvironmentBlendMode=IntEnum("Blend", {"OPAQUE": 1, "ADDITIVE": 2}))
    opaque, additive = xr.EnvironmentBlendMode
    assert choose_blend(xr, [2, 1]) is opaque and choose_blend(xr, []) is opaque
    assert choose_blend(xr, [2]) is additive


def test_tangents_are_signed_and_in_our_order():
    down, up = math.radians(-50), math.radians(48)
    fov = SimpleNamespace(angle_left=-0.9, angle_right=0.7, angle_up=up, angle_down=down)
    assert tangents_of(fov) == (math.tan(-0.9), math.tan(0.7), math.tan(down), math.tan(up))


def test_what_tracking_does_not_know_stays_as_it_was():
    old = Pose(np.array([1.0, 2, 3]), np.array([0.6, 0.8, 0, 0]))
    new = Pose(np.array([4.0, 5, 6]), np.array([0.0, 0, 3, 4]))  # not of length 1 either
    turn = [0, 0, 0.6, 0.8]
    for placed, turned, where, how in (
        (True, True, new.position, turn), (True, False, new.position, old.wxyz),
        (False, True, old.position, turn), (False, False, old.position, old.wxyz),
    ):  # fmt: skip
        pose = known_part(new, old, placed, turned)
        np.testing.assert_array_equal(pose.position, where)
        np.testing.assert_allclose(pose.wxyz, how)
    assert known_part(new, IDENTITY, False, False) is IDENTITY


# ---- the door


class Answer(Exception):
    """What pyopenxr raises."""


@dataclass
class Errors:
    """pyopenxr's exceptions by name, all of one family."""

    def __getattr__(self, name: str) -> type:
        made = type(name, (self.ErrorResult,) if name != "ErrorResult" else (Answer,), {})
        setattr(self, name, made)
        return made


class FakeXr:
    """As much of pyopenxr as the door needs; `fails` names the call and what it raises."""

    FormFactor = SimpleNamespace(HEAD_MOUNTED_DISPLAY=1)

    def __init__(self, extensions=("XR_KHR_opengl_enable",), fails=("", "")) -> None:
        self.exception, self.fails, self.closed = Errors(), fails, 0
        self.extensions = extensions

    def __getattr__(self, name: str):
        if name == self.fails[0]:

            def fail(*given, **named):
                raise getattr(self.exception, self.fails[1])

            return fail
        if name[0].isupper():
            return lambda *given, **named: SimpleNamespace(**named, major=25, minor=0, patch=1)
        return {
            "enumerate_instance_extension_properties": lambda: [
                SimpleNamespace(extension_name=each.encode()) for each in self.extensions
            ],
            "create_instance": lambda info: "instance",
            "get_instance_properties": lambda handle: SimpleNamespace(
                runtime_name=b"Testing", runtime_version=1
            ),
            "get_system": lambda handle, wanted: 7,
            "get_system_properties": lambda handle, system: SimpleNamespace(system_name=b"Hat"),
            "destroy_instance": self.destroy,
        }[name]

    def destroy(self, handle) -> None:
        self.closed += 1


@pytest.fixture
def fake(monkeypatch):
    def use(**how) -> FakeXr:
        xr = FakeXr(**how)
        monkeypatch.setattr("shapeshift.vr.openxr.instance.load", lambda: xr)
        return xr

    return use


def test_an_instance_names_its_runtime_and_its_headset(fake):
    xr = fake(extensions=("XR_KHR_opengl_enable", "XR_EXT_local_floor", "XR_MND_other"))
    with Instance() as instance:
        assert instance.runtime == "the OpenXR runtime Testing 25.0.1"
        assert (instance.headset, instance.system) == ("Hat", 7)
        assert instance.extensions == ("XR_KHR_opengl_enable", "XR_EXT_local_floor")
    assert xr.closed == 1


@pytest.mark.parametrize(
    ("call", "error", "sentence"),
    [
        ("enumerate_instance_extension_properties", "RuntimeUnavailableError",
         "no OpenXR runtime is active on this machine; start SteamVR"),
        ("get_system", "FormFactorUnavailableError",
         "Testing 25.0.1 finds no headset; connect it, switch it on, and start again."),
        ("get_system", "FormFactorUnsupportedError", "Testing 25.0.1 is not for headsets; start"),
        ("create_instance", "ApiVersionUnsupportedError", "refuses us .ApiVersionUnsupported"),
    ],
)  # fmt: skip
def test_what_is_missing_is_one_sentence(fake, monkeypatch, call, error, sentence):
    monkeypatch.delenv("XR_RUNTIME_JSON", raising=False)
    xr = fake(fails=(call, error))
    with pytest.raises(NoHeadset, match=sentence) as told:
        Instance()
    assert "\n" not in str(told.value)
    assert xr.closed == (call == "get_system")


def test_a_runtime_that_takes_no_opengl_says_which_does(fake):
    fake(extensions=("XR_KHR_D3D11_enable",))
    with pytest.raises(NoHeadset, match="takes no OpenGL pictures; SteamVR's does"):
        Instance()


def test_a_manifest_that_leads_nowhere_is_named(fake, monkeypatch):
    monkeypatch.setenv("XR_RUNTIME_JSON", "/nowhere.json")
    fake(fails=("enumerate_instance_extension_properties", "RuntimeUnavailableError"))
    with pytest.raises(NoHeadset, match=r"that XR_RUNTIME_JSON names, /nowhere\.json, cannot be"):
        Instance()


ANY = "start SteamVR, WiVRn or Monado"
NOT_RUN = {  # a manifest's runtime: its name, its library -> how it is called, what is to be run
    ("Monado", "../lib/libopenxr_monado.so"): ("runtime Monado", "`monado-service`"),
    ("", "libopenxr_wivrn.so"): (r"runtime of .*active_runtime\.json", "`wivrn-server`"),
    ("Oculus", "x.dll"): ("runtime Oculus", "Meta's Link program"),
    ("VD", "virtualdesktop-openxr.dll"): ("runtime VD", "Virtual Desktop's Streamer"),
    ("Another\n" + 300 * "x", ""): ("runtime Another.*x", ANY),
    "no object": ("the active OpenXR runtime", ANY),
    None: ("the active OpenXR runtime", ANY),
}


@pytest.mark.parametrize(("about", "told_of"), NOT_RUN.items(), ids=lambda v: str(v)[:9])
def test_a_runtime_whose_service_does_not_run_is_named(fake, monkeypatch, tmp_path, about, told_of):
    """Its library answers and its service does not, as Monado's: found where the loader looks."""
    monkeypatch.delenv("XR_RUNTIME_JSON", raising=False)
    for name in ("XDG_CONFIG_HOME", "XDG_CONFIG_DIRS"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setattr(instance_module, "SYSTEM", str(tmp_path / "etc"))
    monkeypatch.setattr("sys.platform", "linux")
    manifest = tmp_path / "XDG_CONFIG_DIRS" / "openxr" / "1" / "active_runtime.json"
    manifest.parent.mkdir(parents=True)
    if about is not None:
        named = (
            dict(zip(("name", "library_path"), about, strict=True)) if len(about) == 2 else about
        )
        manifest.write_text(json.dumps({"file_format_version": "1.0.0", "runtime": named}))
    said, to_do = told_of
    fake(fails=("create_instance", "RuntimeFailureError"))
    with pytest.raises(NoHeadset, match=f"{said}.* failed to open .*; .*{to_do}.*, then") as told:
        Instance()
    assert "\n" not in str(told.value) and len(str(told.value)) < 450
    monkeypatch.setenv("XR_RUNTIME_JSON", str(manifest))  # alone counts
    assert manifests() == [manifest]


@pytest.mark.parametrize("error", ["InstanceLostError", "SessionLostError", "RuntimeFailureError"])
def test_a_runtime_that_goes_away_is_lost_and_closing_it_is_no_fault(fake, error):
    xr = fake()
    instance = Instance()
    with pytest.raises(Lost, match=r"Testing 25\.0\.1"), instance.asked("take a frame"):
        raise getattr(xr.exception, error)
    xr.fails = ("destroy_instance", "InstanceLostError")
    instance.close()


def test_a_system_without_openxr_says_so(monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(NoHeadset, match="OpenXR runs on Windows and Linux"):
        load()


def test_a_machine_without_pyopenxr_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setitem(sys.modules, "xr", None)
    with pytest.raises(NoHeadset, match=r"pyopenxr cannot be loaded .*pip install pyopenxr"):
        load()


@pytest.mark.parametrize("extension", [False, True])
@pytest.mark.parametrize("insets", [False, True])
@pytest.mark.parametrize("newer", [False, True])
def test_the_newer_openxr_is_asked_for_where_quad_views_have_no_extension(
    fake, extension, insets, newer
):
    """And the one that every runtime speaks where it is refused."""
    names = ("XR_KHR_opengl_enable", *(["XR_VARJO_quad_views"] if extension else []))
    xr = fake(extensions=names)
    tried: list[tuple[int, int, int]] = []

    def create(version):
        tried.append(version.asked)
        if len(tried) == 1 and not newer and insets and not extension:
            raise xr.exception.ApiVersionUnsupportedError
        return "instance"

    xr.create_instance = create
    xr.InstanceCreateInfo = lambda application_info, enabled_extension_names: application_info
    xr.ApplicationInfo = lambda *given: given[-1]
    xr.Version = lambda *given: SimpleNamespace(asked=given, major=25, minor=0, patch=1)
    asked = [(1, 1, 0)] if insets and not extension else []
    wanted = [*asked, *([] if asked and newer else [(1, 0, 34)])]
    Instance(insets)
    assert tried == wanted
