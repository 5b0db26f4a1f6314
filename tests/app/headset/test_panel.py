"""The headset's panel: ImGui in a texture, pointed at with a ray.  What each item does."""

import time
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.film.window.style_work import put_in_place
from shapeshift.app.headset.pacing import QUALITIES
from shapeshift.app.headset.panel_picture import PANEL, UI_SCALE, PanelPicture
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.headset.sections.room_section import HOW, SURE_S
from shapeshift.app.headset.wrist_menu import CLICK, SETTLE_FRAMES, TICK
from shapeshift.app.opening import ReadingOptions
from shapeshift.renderer.settings import DEBUG_VIEWS
from shapeshift.runtime_models.model import Stop
from shapeshift.vr.frame import LOST
from shapeshift.vr.touching import Touched
from tests.support.three_stops import four_stop_package, three_stop_package
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import FROM, LEFT, SETTLED, Wearer, a_state, an_editor, item

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 0.5), Stop("charcoal", 1.0))


@pytest.fixture
def picture(ctx):
    made = PanelPicture(ctx)
    yield made
    made.release()


@pytest.fixture
def wearer(picture):
    return Wearer(picture)


@pytest.fixture
def cube(picture):
    """Somebody with one object of four stops, at ice."""
    return Wearer(picture, a_state(an_editor(item("cube", x=0.25), cube=STOPS)))


def test_it_is_closed_at_first_and_tells_how_to_open_it(picture):
    wearer = Wearer(picture)
    wearer.menu.carried = replace(wearer.menu.carried, open=False, pinned=False)
    wearer.act()
    assert not wearer.menu.carried.open and wearer.menu.row() == {
        "open": False, "hand": "", "shown": "layer 0",
    }  # fmt: skip
    assert "palm turned up" in HOW


def test_what_the_old_panel_had_is_in_sight_at_once(wearer):
    """Without a scroll: the slider, sizes, qualities, the grid, put back, recentre, exit."""
    wanted = {"previous", "next", "track", "+", "\u2013", "1 : 1", "grid on the floor"}
    wanted |= {name.capitalize() for name in QUALITIES} | {"Put back", "Recentre", "Exit"}
    assert wanted <= set(wearer.labels())


@pytest.mark.parametrize("name", QUALITIES)
def test_quality_is_chosen(wearer, name):
    wearer.press(name.capitalize())
    assert wearer.state.pacing.quality == name and not wearer.menu.carried.pointing.pressing


def test_size_leaves_the_feet_on_the_spot(wearer):
    head = a_frame(LEFT).head.position
    under = wearer.state.play_space.point(head * (1, 0, 1))
    for label, scale in (("+", 1 / 1.5), ("+", 0.5), ("\u2013", 1 / 1.5), ("1 : 1", 1.0)):
        wearer.press(label)
        assert wearer.state.play_space.scale == pytest.approx(scale)
        np.testing.assert_allclose(wearer.state.play_space.point(head * (1, 0, 1)), under)


def test_recentre_put_back_and_the_floor(wearer):
    wearer.press("Recentre")
    assert wearer.done == ["recentre"]
    wearer.editor.set_x(wearer.editor.movable[0], 0.7)
    assert wearer.x("lamp") == 0.7
    wearer.press("Put back")
    assert wearer.x("lamp") == 0.0
    wearer.press("grid on the floor")
    assert not wearer.state.floor_shown
    wearer.press("grid on the floor")
    assert wearer.state.floor_shown and wearer.done == ["recentre"]


def test_exit_asks_once_more(wearer):
    wearer.press("Exit")
    assert wearer.done == [] and "Really exit?" in wearer.labels()
    wearer.wait(2, SURE_S)
    wearer.wait()
    wearer.press("Exit")
    assert wearer.done == [], "it was too late"
    wearer.press("Recentre")
    wearer.press("Exit")
    assert wearer.done == ["recentre"], "another button takes it back"
    wearer.press("Really exit?")
    assert wearer.done == ["recentre", "from the panel"]


def test_the_knob_is_dragged_and_catches_at_stops(cube):
    x, y = cube.along(0.25)
    cube.point((x + 18, y))
    cube.point((x + 18, y), 1.0)
    assert cube.x("cube") == 0.25, "taken beside its middle: no jump"
    at = cube.along(0.37)[0] + 18
    frame = cube.point((at, y + 300), 1.0)  # the hand may leave the line
    assert cube.x("cube") == pytest.approx(0.37, abs=0.002)
    assert frame.hands["right"].trigger == 0 and frame.hands["left"] == LEFT
    cube.pulses.clear()
    cube.point((cube.along(0.49)[0] + 18, -150), 1.0)
    assert cube.x("cube") == 0.5 and ("right", *CLICK) in cube.pulses
    cube.point((2000, 0), 1.0)
    assert cube.x("cube") == 1.0
    away = hand_at(FROM, np.add(FROM, (0.0, 0.0, 1.0)), trigger=1.0)
    cube.act(away)
    assert cube.menu.carried.pointing.at is None and cube.menu.carried.pointing.pressing
    assert cube.x("cube") == 1.0, "the ray is off the plane: x stays"
    cube.point(cube.along(0.8), 1.0)
    width = cube.along(1.0)[0] - cube.along(0.0)[0]
    assert cube.x("cube") == pytest.approx(0.8 - 18 / width, abs=0.002)  # a pixel is 0.0014
    before = cube.x("cube")
    cube.act(LOST)  # a lost hand lets go where it was
    assert cube.x("cube") == before and not cube.menu.carried.pointing.pressing
    cube.point(cube.along(0.1), 0.0)
    assert cube.x("cube") == before


def test_a_press_on_the_line_brings_the_knob(cube):
    cube.point(cube.along(0.7))
    cube.point(cube.along(0.7), 1.0)
    assert cube.x("cube") == pytest.approx(0.7, abs=0.002)


def test_a_press_that_began_on_one_button_does_not_press_the_next(wearer):
    wearer.point(wearer.middle("Recentre"))
    wearer.point(wearer.middle("Recentre"), 1.0)
    wearer.point(wearer.middle("Put back"), 1.0)
    wearer.point(wearer.middle("Put back"))
    assert wearer.done == []


@pytest.mark.parametrize("ends", ["lost", "away"])
def test_a_hand_that_is_gone_has_not_clicked_what_it_held(wearer, ends):
    wearer.point(wearer.middle("Recentre"))
    wearer.point(wearer.middle("Recentre"), 1.0)
    wearer.act(LOST if ends == "lost" else hand_at(FROM, np.add(FROM, (0.0, 0.0, 1.0))))
    wearer.wait(3)
    assert wearer.done == [] and wearer.menu.picture.active == 0
    wearer.press("Recentre")
    assert wearer.done == ["recentre"], "and it works as before"


def test_arrows_go_through_the_objects_that_are_seen(wearer):
    assert wearer.shown == "lamp"
    for label, name in (("next", "leg"), ("next", "lamp"), ("previous", "leg")):
        wearer.press(label)
        assert wearer.shown == name


def test_what_is_taken_in_a_hand_is_what_the_slider_is_of(wearer):
    touched = wearer.state.user
    touched.touched = Touched(held={"left": None, "right": "leg"})
    wearer.act()
    assert wearer.shown == "leg"
    wearer.editor.chosen = "lamp"
    wearer.act()
    assert wearer.shown == "lamp", "chosen since, while it is still held"
    touched.touched = Touched(held={"left": "table", "right": None})
    wearer.act()
    assert wearer.shown == "lamp", "a table has none"


def test_the_carrying_hands_stick_slides_and_does_not_walk(cube):
    frame = cube.act(LOST, replace(LEFT, stick=(0.9, 0.1)))
    assert cube.x("cube") == pytest.approx(0.25 + 0.525 / 72)
    assert frame.hands["left"].stick == (0.0, 0.0)
    cube.act()
    frame = cube.act(LOST, replace(LEFT, stick=(0.1, 0.9)))
    assert frame.hands["left"].stick == (0.1, 0.9)
    cube.act()
    for _ in range(72):
        cube.act(LOST, replace(LEFT, stick=(1.0, 0.0)))
    assert cube.x("cube") == 0.5 and cube.pulses == [("left", *CLICK)]


def test_the_pointing_hands_stick_scrolls_and_does_not_turn(wearer):
    assert "Objects" not in wearer.labels()
    place = wearer.middle("Put back")
    for frame in wearer.scroll():
        assert frame.hands["right"].stick == (0.0, 0.0)
    assert "Help" in wearer.labels() and "Room" not in wearer.labels()
    wearer.point(place)
    frame = wearer.point(place, stick=(1.0, 0.0))
    assert frame.hands["right"].stick == (1.0, 0.0), "pushed sideways it turns"


def test_a_hand_feels_what_it_points_at_and_presses(wearer):
    wearer.pulses.clear()
    wearer.point(wearer.middle("Recentre"))
    assert wearer.pulses == [("right", *TICK)]
    wearer.point(wearer.middle("Recentre"))
    assert wearer.pulses == [("right", *TICK)], "once"
    wearer.point(wearer.middle("Recentre"), 1.0)
    assert wearer.pulses[1:] == [("right", *CLICK)]
    wearer.point((9.0, 9.0))
    wearer.pulses.clear()
    wearer.point((9.0, 9.0), 1.0)
    assert wearer.pulses == [], "nothing is there"


def test_sections_of_the_desktop_do_here_what_they_do_there(wearer):
    """Stops goes there, Look changes what is drawn, Objects hides; none needs a key."""
    wearer.unfold("Stops")
    wearer.press("layer 2")
    wearer.wait(60)
    assert wearer.x("lamp") == 1.0
    wearer.press("Stops")
    wearer.unfold("Objects")
    wearer.scroll_to("seen")
    before = {obj.name for obj in wearer.editor.scene.objects if obj.visible}
    wearer.press("seen")  # of the first object in sight
    (hidden,) = before - {obj.name for obj in wearer.editor.scene.objects if obj.visible}
    assert not wearer.state.world.objects[hidden].drawn.visible, "the world has heard of it"
    wearer.scroll_to("leg")
    wearer.press("leg")
    assert wearer.shown == "leg"
    wearer.scroll(1.0)
    wearer.scroll_to("Objects")
    wearer.press("Objects")
    wearer.scroll(1.0)
    wearer.unfold("Look")
    wearer.scroll_to("debug")
    wearer.press("debug")
    left, top, right, _ = wearer.menu.picture.boxes["debug"]
    # Its list has opened above it, where there is room: rows of 23 mm, the last 19 mm above it.
    row = len(DEBUG_VIEWS) - 1 - DEBUG_VIEWS.index("depth")
    place = ((left + right) / 2, top - (19.5 + 23 * row) * UI_SCALE)
    for trigger in (0.0, 1.0, 0.0):
        wearer.point(place, trigger)
    assert wearer.editor.settings.debug == "depth"


def test_pause_holds_the_world_and_play_lets_it_go(wearer):
    wearer.press("Pause")
    assert wearer.state.world.paused and "Play" in wearer.labels()
    wearer.press("Play")
    assert not wearer.state.world.paused


def test_what_could_not_be_done_is_said_and_taken_away(wearer):
    wearer.editor.problem = "cube: making a collider took more memory than there is."
    wearer.wait()
    wearer.press("OK")
    assert wearer.editor.messages.problems == []


def test_it_is_drawn_only_while_something_changes_or_a_hand_is_on_it(wearer, monkeypatch):
    drawn = []
    draw = wearer.menu.picture.draw
    monkeypatch.setattr(wearer.menu.picture, "draw", lambda *given: drawn.append(1) or draw(*given))
    wearer.wait(2 * SETTLED)
    assert not drawn
    wearer.act(hand_at(FROM, np.add(FROM, (0.0, 0.0, -1.0))))  # a ray that meets nothing
    assert not drawn
    wearer.editor.set_x(wearer.editor.movable[0], 0.3)
    wearer.wait(2 * SETTLED)
    assert len(drawn) == SETTLE_FRAMES
    drawn.clear()
    for _ in range(10):
        wearer.point((480.0, 540.0))
    assert len(drawn) == 10
    wearer.wait(2 * SETTLED)
    assert 10 < len(drawn) <= 10 + SETTLE_FRAMES
    drawn.clear()
    for change in (
        lambda: setattr(wearer.state.pacing, "quality", "best"),
        lambda: setattr(wearer.state, "floor_shown", False),
        lambda: setattr(wearer.editor, "chosen", "leg"),
        lambda: wearer.state.touch.reactions.append("cube: struck"),
    ):
        change()
        wearer.wait()
        assert len(drawn) == SETTLE_FRAMES
        drawn.clear()


MANY = tuple(Stop(f"{i}" * 9, i / 11) for i in range(12))


@pytest.mark.parametrize("stops", [STOPS[:1], MANY, (Stop("\u6f22\u5b57" * 40, 0.0), STOPS[3])])
def test_few_and_many_stops_and_letters_that_the_font_has_not(picture, stops):
    wearer = Wearer(picture, a_state(an_editor(item("n" * 60), **{"n" * 60: stops})))
    assert "Exit" in wearer.labels()
    assert ("track" in wearer.labels()) == (len(stops) > 1)
    for label, box in picture.boxes.items():
        left, top, right, low = box
        assert 0 <= left < right <= PANEL.size[0] and 0 <= top < low <= PANEL.size[1], label


def test_the_gallery_is_the_desktop_s(cube):
    """Two stops are picked with the ray, slid between and left to slide; pictures come by a thread
    of their own.
    """
    gallery = cube.menu.gallery
    cube.unfold("Gallery")
    end = time.monotonic() + 30
    while len(gallery.thumbnails.pictures) < 4 and time.monotonic() < end:
        cube.act()
        time.sleep(0.01)
    assert len(gallery.thumbnails.pictures) == 4
    cube.wait()
    cube.scroll_to("ice")
    cube.press("ice")
    cube.scroll_to("fire")
    cube.press("fire")
    assert gallery.picked == ("ice", "fire") and cube.x("cube") == 0.5
    place = (PANEL.size[0] / 2, PANEL.size[1] * 0.7)
    for _ in range(200):  # until the slider and its buttons are in sight
        if {"way", "Slide", "Add style"} <= set(cube.labels()):
            break
        cube.point(place, stick=(0.0, -1.0))
    cube.wait()
    left, top, right, low = cube.menu.picture.boxes["way"]
    middle = ((left + right) / 2, (top + low) / 2)
    for trigger in (0.0, 1.0, 1.0, 0.0):
        cube.point(middle, trigger)
    assert gallery.part == pytest.approx(0.5, abs=0.03)
    weights = cube.editor.scene.objects[0].model.blend.weights(cube.editor.scene.objects[0].x)
    np.testing.assert_allclose(weights, [0, 0.5, 0.5, 0], atol=0.03)
    cube.press("Slide")
    assert gallery.sliding
    before = cube.editor.scene.objects[0].x
    cube.wait(40)
    assert cube.editor.scene.objects[0].x != before
    cube.press("Stop")
    assert not gallery.sliding
    gallery.thumbnails.close()


def test_a_style_is_shown_while_the_session_goes_on(picture, tmp_path):
    """The new package takes the object's place in the panel and in the world; its stops slide."""
    _, editor = open_xr(three_stop_package(tmp_path / "three.shift"), ReadingOptions())
    worn = Wearer(picture, a_state(editor))
    made = four_stop_package(tmp_path / "four.shift")
    put_in_place(editor, "three", made, "Melt")
    worn.wait(3)
    assert worn.x("three") == 0.3 and worn.menu.row()["shown"] == "Melt"
    worn.menu.gallery.pick("Melt")
    worn.menu.gallery.pick("Opened")
    worn.menu.gallery.slide(0.5)
    worn.wait(3)
    shown = worn.state.world.drawn().objects[0]
    np.testing.assert_allclose(shown.model.blend.weights(shown.x), [0, 0.5, 0, 0.5])
