"""How one sits and which hands one has: settings of the panel that stay, and what they do."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.headset.eyes import quad_of
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.worn_settings import FILE, KeptSettings, WornSettings, read_settings
from shapeshift.app.headset.xr_user import Fitting
from shapeshift.scene.pose import Pose
from shapeshift.vr.controller_cards import hint_lines
from shapeshift.vr.drawn import Drawn, PanelQuad
from shapeshift.vr.frame import LOST, Area
from shapeshift.vr.locomotion import RULES, Rules, Travel, move
from shapeshift.vr.one_hand import alone, shared_stick
from shapeshift.vr.openxr.room import EYE_HEIGHT_M
from shapeshift.vr.panel import OPENS_S, Palm
from shapeshift.vr.play_space import HIGHEST_M, LOWEST_M, PlaySpace, lift_of, lifted
from tests.support.vr.vr_frames import at, frame, hand
from tests.support.vr.vr_panel import Wearer

SITS = at(0.1, 1.1, 0.2)  # of a head
PALM_UP = np.array([math.sqrt(0.5), 0.0, 0.0, -math.sqrt(0.5)])  # of the right hand: its +X down


@pytest.fixture
def wearer(ctx):
    picture = PanelPicture(ctx)
    yield Wearer(picture)
    picture.release()


def test_what_a_hand_sets_stays_and_what_the_command_line_says_does_not(tmp_path):
    kept = KeptSettings(tmp_path / "new", vignette=0.3, turning=None)
    assert kept.now == WornSettings(vignette=0.3)
    kept.choose(posture="seated", text_size=1.25)
    assert kept.now == WornSettings("seated", vignette=0.3, text_size=1.25)
    assert read_settings(tmp_path / "new") == WornSettings("seated", text_size=1.25)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"posture": "lying", "hands": 3, "turning": null, "vignette": NaN, "text_size": 1e400}',
        '{"vignette": 1.001, "text_size": 0.749, "walking_hand": ["left"], "panel_hand": true}',
    ],
)
def test_a_file_of_nonsense_counts_as_empty(tmp_path, text):
    (tmp_path / FILE).write_text(text)
    assert read_settings(tmp_path) == WornSettings()
    (tmp_path / FILE).write_text(json.dumps({"hands": "right", "vignette": 1, "text_size": 0.75}))
    assert read_settings(tmp_path) == WornSettings(hands="right", vignette=1.0, text_size=0.75)


def test_settings_are_pressed_on_the_panel(wearer):
    wearer.unfold("Comfort")
    before = wearer.menu.carried.plane.size_m
    wearer.scroll_to("Smooth")
    for label in ("Seated", "Smooth", "Walk: right", "Panel: right"):
        wearer.press(label)
        wearer.wait(40)  # the panel goes to the other hand, which is lost: beside the head
    assert wearer.state.worn.now == WornSettings("seated", "both", "right", "right", "smooth")
    assert wearer.menu.carried.home == "right" and wearer.menu.carried.open
    wearer.state.worn.choose(text_size=1.5, hands="left")
    wearer.wait()
    assert wearer.menu.carried.home == "right" and wearer.menu.carried.pointer == "left"
    np.testing.assert_allclose(wearer.menu.carried.plane.size_m, 1.5 * np.array(before))


def test_the_sharp_middle_is_pressed_on_the_panel(wearer):
    wearer.unfold("Comfort")
    wearer.scroll_to("Performance")
    for label, level in (("15\u00b0", "high"), ("35\u00b0", "low"), ("All over", "off")):
        wearer.press(label)
        assert wearer.state.worn.now.foveation == level


@pytest.mark.parametrize("has", [False, True])
def test_quad_views_are_pressed_on_the_panel(wearer, has):
    """Until the next session has them, 25 degrees stand for them; in one all is left to them."""
    wearer.state.has_insets = wearer.state.offers_insets = has
    wearer.unfold("Comfort")
    wearer.scroll_to("Performance")
    wearer.press("Quad views")
    worn = wearer.state.worn.now
    assert worn.wants_insets and worn.foveation == "quad"
    assert worn.sharp(wearer.state.has_insets) == ("off" if has else "medium")
    wearer.press("15\u00b0")
    assert wearer.state.worn.now.sharp(has) == "high", "within four views, too"


def test_the_room_is_behind_the_scene_where_it_can_be(wearer):
    wearer.unfold("Comfort")
    wearer.scroll_to("Performance")
    assert "the room behind the scene" not in wearer.labels(), "there is a sentence instead"
    wearer.state.sees_through = True
    wearer.menu.carried = replace(wearer.menu.carried, open=False, pinned=False)
    wearer.wait()
    wearer.menu.carried = replace(wearer.menu.carried, open=True, pinned=True)
    wearer.wait()
    wearer.scroll_to("the room behind the scene")
    wearer.press("the room behind the scene")
    assert wearer.state.through and wearer.state.worn.now.passthrough


def test_the_compositor_has_the_panel_in_its_own_room():
    quad = PanelQuad(None, at(0.1, 1.5, -0.4), (0.3, 0.4), 7, apart=True)
    made = quad_of(Drawn(panel=quad), lift_m=0.5)
    np.testing.assert_allclose(made.play_from_quad.position, (0.1, 1.0, -0.4))
    assert quad_of(Drawn(panel=replace(quad, apart=False)), 0.5) is None


def test_cards_name_what_one_hand_does():
    rules = WornSettings(hands="right").rules(RULES)
    index = "/interaction_profiles/valve/index_controller"
    lines = hint_lines(index, "right", rules, "left")
    assert "Stick: walk, turn sideways" in lines and "Stick, pressed: panel" in lines
    assert lines[-1] == "Palm up: panel"
    simple = hint_lines("/interaction_profiles/khr/simple_controller", "right", rules, "left")
    assert not [line for line in simple if "Stick" in line]


@pytest.mark.parametrize(
    ("posture", "head_m", "lift"),
    [
        ("standing", 1.1, 0.0), ("seated", 1.1, EYE_HEIGHT_M - 1.1), ("seated", math.nan, 0.0),
        ("seated", -3.0, HIGHEST_M), ("seated", 9.0, LOWEST_M), ("seated", EYE_HEIGHT_M, 0.0),
    ],
)  # fmt: skip
def test_who_sits_is_raised_to_where_eyes_are_when_one_stands(posture, head_m, lift):
    assert lift_of(posture, head_m, EYE_HEIGHT_M) == pytest.approx(lift, abs=1e-12)


def test_all_of_a_room_is_raised_as_one():
    joints = np.full((26, 4), 0.5)
    right = replace(hand("right"), joints=joints)
    one = frame(right=right, head=SITS, area=Area(at(0, 0, 0), (2.0, 3.0)))
    high = lifted(one, 0.5)
    up = np.array([0.0, 0.5, 0.0])
    for before, after in (
        (one.head, high.head),
        (one.hands["left"].grip, high.hands["left"].grip),
        (one.hands["right"].aim, high.hands["right"].aim),
        (one.area.play_from_area, high.area.play_from_area),
    ):
        np.testing.assert_allclose(after.position - before.position, up)
        assert (after.wxyz == before.wxyz).all()
    np.testing.assert_allclose(high.hands["right"].joints - joints, [[0, 0.5, 0, 0]] * 26)
    assert lifted(one, 0.0) is one and lifted(replace(one, area=None), 0.5).area is None


def test_the_height_is_measured_at_recentre_and_kept():
    kept = KeptSettings(posture="seated")
    fit = Fitting(kept)
    first, _ = fit.worn(frame(head=SITS), 0.01)
    assert first.head.position[1] == pytest.approx(1.1)
    fit.measure(first.head)
    now, moves = fit.worn(frame(head=SITS), 0.01)
    assert moves and now.recentred and now.head.position[1] == pytest.approx(EYE_HEIGHT_M)
    leans = Pose(SITS.position - (0.0, 0.3, 0.0), SITS.wxyz)
    now, moves = fit.worn(frame(head=leans), 0.01)
    assert not (moves or now.recentred)
    assert now.head.position[1] == pytest.approx(EYE_HEIGHT_M - 0.3), "nobody floats as they lean"
    fit.measure(now.head)
    now, _ = fit.worn(frame(head=leans), 0.01)
    assert now.head.position[1] == pytest.approx(EYE_HEIGHT_M), "until it is asked for again"
    kept.choose(posture="standing")
    fit.worn(frame(head=leans), 0.01)
    now, moves = fit.worn(frame(head=leans), 0.01)
    assert moves and now.head.position[1] == pytest.approx(0.8), "another posture is at once"


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_hand_walks_turns_and_has_a_menu(side):
    rules = WornSettings(hands=side, walking_hand="right").rules(RULES)
    assert (rules.walks, rules.one_hand) == (side, side)

    def ends(stick) -> tuple[np.ndarray, float]:
        one, _ = alone(frame(**{side: hand(side, stick=stick)}), side, Palm(), 0.1)
        play, _, _ = move(PlaySpace(), Travel(), one, 0.1, rules)
        return play.world_from_play.position, 2 * math.acos(
            min(abs(play.world_from_play.wxyz[0]), 1)
        )

    place, turn = ends((0.5, 1.0))
    np.testing.assert_allclose(
        place, [0, 0, -0.1 * RULES.walk_m_s * ((math.hypot(0, 1) - 0.15) / 0.85) ** 2]
    )
    assert turn == 0
    _, turn = ends((1.0, 0.5))
    assert turn == pytest.approx(RULES.snap_rad)
    for pressed, menu in ((True, True), (False, False)):
        one, _ = alone(frame(**{side: hand(side, stick_click=pressed)}), side, Palm(), 0.1)
        assert one.hands[side].menu == menu
        assert [h for s, h in one.hands.items() if s != side] == [LOST]
    with pytest.raises(ValueError, match="the hand that walks"):
        Rules(walks="left", one_hand="right")


def test_the_palm_of_the_only_hand_is_a_menu_button_and_a_lost_one_rests():
    palm, menus = Palm(), []
    for _ in range(4):
        one, palm = alone(frame(right=hand("right", wxyz=PALM_UP)), "right", palm, OPENS_S / 2)
        menus.append(one.hands["right"].menu)
    assert menus == [False, True, True, True]
    one, _ = alone(frame(right=LOST), "right", Palm(), 1.0)
    assert one.hands == {"left": LOST, "right": LOST}
    assert not shared_stick(one, "right").hands["left"].active
