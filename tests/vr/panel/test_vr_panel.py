"""The panel in the room, without a headset: presses, drags, the thumbstick, words and looks."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import Stop
from shapeshift.vr.panel.panel import DEAD, EXIT_S, Pointer, press, push, taken
from shapeshift.vr.panel.panel_layout import TRACK, WIDTH, item_at, knob_place, lay_out
from shapeshift.vr.panel.panel_picture import (
    ACCENT,
    LEAST,
    SURFACE,
    TEXT,
    WARNING,
    panel_picture,
    picture_key,
)
from shapeshift.vr.panel.panel_state import (
    QUALITIES,
    Exit,
    Facts,
    Panel,
    Pulse,
    PutBack,
    Recentre,
    SetQuality,
    SetScale,
    SetX,
    Slider,
    shown_stop,
    size_text,
)

STOPS = (Stop("normal", 0.0), Stop("ice", 0.25), Stop("fire", 0.5), Stop("charcoal", 1.0))
HEAT = (Stop("visible", 0.0), Stop("thermal", 1.0, "thermal", "ironbow", (18.0, 84.0), "\u00b0C"))


def a_panel(x: float = 0.25, stops: tuple[Stop, ...] = STOPS, **facts) -> Panel:
    sliders = (Slider("cube", stops, x), Slider("ball", STOPS, 0.0))
    return Panel(Facts(**{"sliders": sliders} | facts), side="left")


def middle_of(panel: Panel, name: str) -> tuple[float, float]:
    box = next(item.box for item in lay_out(panel).items if item.name == name)
    return (box[0] + box[2]) / 2, (box[1] + box[3]) / 2


def point(panel: Panel, at, down=False, seconds=0.01, side="right"):
    return press(panel, [Pointer(side, at, down)], seconds)


def click(panel: Panel, name: str):
    """Points at an item, presses it, lets go; returns the panel and what was wished, no buzzes."""
    at, wishes = middle_of(panel, name), []
    for down in (False, True, True, False):
        panel, more = point(panel, at, down)
        wishes += [wish for wish in more if not isinstance(wish, Pulse)]
    return panel, wishes


def along(panel: Panel, x: float) -> tuple[float, float]:
    return TRACK[0] + x * (TRACK[1] - TRACK[0]), knob_place(panel)[1]


@pytest.mark.parametrize("name", QUALITIES)
def test_quality_is_wished_once(name):
    panel, wishes = click(a_panel(), f"quality:{name}")
    assert wishes == [SetQuality(name)] and not panel.held


@pytest.mark.parametrize(
    ("name", "scale", "want"),
    [
        ("larger", 1.0, 1 / 1.5),
        ("smaller", 1.0, 1 / 0.75),
        ("true", 3.7, 1.0),
        ("larger", 1 / 0.6, 1 / 0.75),
        ("larger", 1 / 20, 1 / 20),
        ("smaller", 100.0, 100.0),
        ("smaller", 1e4, 1e4),
    ],
)
def test_size_goes_in_steps(name, scale, want):
    _, wishes = click(a_panel(scale=scale), name)
    (wish,) = wishes
    assert isinstance(wish, SetScale) and wish.scale == pytest.approx(want)


def test_larger_and_smaller_come_back():
    scale = 1.0
    for name in ("larger",) * 4 + ("smaller",) * 4:
        scale = click(a_panel(scale=scale), name)[1][0].scale
    assert scale == pytest.approx(1.0)


def test_recentre_and_put_back():
    assert click(a_panel(), "recentre")[1] == [Recentre()]
    assert click(a_panel(), "put back")[1] == [PutBack()]


def test_exit_asks_once_more():
    panel, wishes = click(a_panel(), "exit")
    assert wishes == [] and panel.exit_s == pytest.approx(EXIT_S, abs=0.1)
    assert click(panel, "exit")[1] == [Exit()]
    late, _ = press(panel, [], EXIT_S)
    assert click(late, "exit")[1] == []
    other, _ = click(panel, "recentre")
    assert other.exit_s == 0


def test_the_knob_is_dragged_and_catches_at_stops():
    panel = a_panel(0.25)
    at = knob_place(panel)
    panel, _ = point(panel, (at[0] + 20, at[1]))
    panel, wishes = point(panel, (at[0] + 20, at[1]), down=True)
    assert not any(isinstance(wish, SetX) for wish in wishes)  # taken beside its middle: no jump
    x = along(panel, 0.37)[0] + 20
    panel, wishes = point(panel, (x, at[1] + 300), down=True)  # the hand may leave the line
    assert wishes == [SetX("cube", pytest.approx(0.37))]
    panel, wishes = point(panel, (along(panel, 0.49)[0] + 20, -500), down=True)
    assert wishes[0] == SetX("cube", 0.5) and isinstance(wishes[1], Pulse)
    panel, wishes = point(panel, (9000, 0), down=True)
    assert wishes[0] == SetX("cube", 1.0)
    panel, wishes = point(panel, None, down=True)  # the ray is off the plane: x stays
    assert wishes == [] and panel.held == {"right": "track"}
    panel, wishes = point(panel, at)
    assert panel.held == {} and not any(isinstance(wish, SetX) for wish in wishes)


def test_a_press_on_the_line_brings_the_knob():
    panel = a_panel(0.0)
    _, wishes = point(panel, along(panel, 0.7), down=True)
    assert SetX("cube", pytest.approx(0.7)) in wishes


def test_a_lost_hand_lets_go_of_the_knob():
    panel = a_panel(0.25)
    panel, _ = point(panel, knob_place(panel), down=True)
    assert panel.held == {"right": "track"}
    panel, wishes = press(panel, [], 0.01)
    assert panel.held == {} and panel.hovers == {} and wishes == []


def test_the_other_hand_takes_the_knob_over():
    panel = a_panel(0.25)
    panel, _ = point(panel, knob_place(panel), down=True)
    panel, _ = press(
        panel, [Pointer("right", knob_place(panel), True), Pointer("left", knob_place(panel), True)]
    )
    assert panel.held == {"left": "track"}


def test_what_was_pressed_elsewhere_presses_nothing_here():
    """A hand that carries something over the panel, or fires while it sweeps across."""
    panel, _ = point(a_panel(), (-200.0, 50.0), down=True)
    panel, wishes = point(panel, middle_of(panel, "recentre"), down=True)
    assert wishes == [] or all(isinstance(w, Pulse) for w in wishes)
    assert taken(panel) == frozenset()
    panel, _ = point(panel, middle_of(panel, "recentre"))
    assert taken(panel) == {"right"}
    _, wishes = point(panel, middle_of(panel, "recentre"), down=True)
    assert Recentre() in wishes


def test_a_press_that_began_on_one_button_does_not_press_the_next():
    panel, wishes = point(a_panel(), middle_of(a_panel(), "recentre"), down=True)
    assert Recentre() in wishes
    panel, wishes = point(panel, middle_of(panel, "put back"), down=True)
    assert wishes == [] and taken(panel) == {"right"}


def test_arrows_go_through_the_objects():
    panel, _ = click(a_panel(), "next")
    assert panel.slider.name == "ball"
    panel, _ = click(panel, "next")
    assert panel.slider.name == "cube"
    panel, _ = click(panel, "previous")
    assert panel.slider.name == "ball"
    gone = replace(panel, facts=replace(panel.facts, sliders=panel.facts.sliders[:1]))
    assert gone.slider.name == "cube"


def test_a_closed_panel_does_nothing():
    panel, wishes = point(replace(a_panel(), side=""), (300.0, 300.0), down=True)
    assert wishes == [] and panel.hovers == panel.held == {} and taken(panel) == frozenset()
    assert push(panel, (1.0, 0.0), 0.1)[1] == []


def test_the_thumbstick_rests_at_every_stop():
    panel, x, rested = a_panel(0.0), 0.0, []
    for _ in range(400):
        panel, wishes = push(panel, (1.0, 0.2), 0.01)
        for wish in wishes:
            if isinstance(wish, SetX):
                x = wish.x
                sliders = (Slider("cube", STOPS, x),)
                panel = replace(panel, facts=replace(panel.facts, sliders=sliders))
        if panel.stick == "rests":
            assert push(panel, (1.0, 0.2), 0.01)[1] == []
            rested.append(x)
            panel, _ = push(panel, (0.0, 0.0), 0.01)
    assert rested == [0.25, 0.5, 1.0]
    assert push(a_panel(0.3), (DEAD, 0.0), 1.0)[1] == []


def test_a_thumbstick_that_began_to_walk_walks_on():
    panel, wishes = push(a_panel(0.1), (0.3, 0.9), 0.1)
    panel, more = push(panel, (0.9, 0.1), 0.1)
    assert wishes + more == [] and panel.stick == "walks"
    panel, _ = push(panel, (0.1, 0.0), 0.1)
    assert push(panel, (0.9, 0.1), 0.1)[1]


def test_the_thumbstick_ends_at_the_end_without_a_stop_there():
    stops = STOPS[:3]
    panel = Panel(Facts((Slider("cube", stops, 0.95),)), side="left")
    assert push(panel, (1.0, 0.0), 1.0)[1] == [SetX("cube", 1.0)]


@pytest.mark.parametrize(
    ("x", "want"),
    [
        (0.0, "normal"), (0.25, "ice"), (0.2505, "ice"), (0.35, "ice \u2192 fire  40 %"),
        (0.252, "ice \u2192 fire  1 %"), (0.99, "fire \u2192 charcoal  98 %"), (1.0, "charcoal"),
    ],
)  # fmt: skip
def test_it_says_which_stop_is_shown(x, want):
    assert shown_stop(Slider("cube", STOPS, x)) == want


def test_beyond_the_last_stop_and_without_any():
    assert shown_stop(Slider("cube", STOPS[:3], 0.9)) == "fire  x 0.90"
    assert shown_stop(Slider("cube", (), 0.9)) == "x 0.90"


def test_sizes_are_told_in_percent():
    assert [size_text(s) for s in (1.0, 2.0, 100.0, 0.05)] == ["100 %", "50 %", "1 %", "2000 %"]


def test_items_do_not_overlap_and_lie_on_the_plate():
    panel = a_panel(stops=HEAT, note="a note")
    layout = lay_out(panel)
    width, height = layout.size
    for i, one in enumerate(layout.items):
        left, top, right, bottom = one.box
        assert 0 <= left < right <= width and 0 <= top < bottom <= height
        for other in layout.items[i + 1 :]:
            a, b = one.box, other.box
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        if one.name != "size":
            assert item_at(panel, middle_of(panel, one.name)) == one.name
    assert item_at(panel, (5.0, height - 5.0)) == "plate"
    assert item_at(panel, (5.0, height + 1.0)) == item_at(panel, (-1.0, 5.0)) == ""


def test_letters_are_legible_at_arms_length():
    """360 pixels of a 1,000 pixel eye show the panel at 0.45 m: no letters under ten of them."""
    assert LEAST * 360 / WIDTH >= 10


def test_the_picture_has_the_knob_where_x_is_and_the_choice_lit():
    panel = a_panel(0.6, note="72 of 72 frames")
    picture = panel_picture(panel)
    assert picture.shape == (*lay_out(panel).size[::-1], 4) and picture.dtype == np.uint8
    assert (picture[..., :3] <= picture[..., 3:]).all()  # premultiplied
    assert (picture[[0, 0, -1, -1], [0, -1, 0, -1]] == 0).all()  # round corners
    x, y = (round(v) for v in knob_place(panel))
    assert tuple(picture[y, x, :3]) == SURFACE and tuple(picture[y, x + 26, :3]) == ACCENT
    left, top, _, _ = next(i.box for i in lay_out(panel).items if i.name == "quality:auto")
    assert tuple(picture[round(top) + 46, round(left) + 6, :3]) == ACCENT
    moved = panel_picture(a_panel(0.61, note="72 of 72 frames"))
    box = slice(round(lay_out(panel).track_y) + 70, None)
    np.testing.assert_array_equal(moved[box], picture[box])


def test_a_held_knob_and_a_sure_exit_look_so():
    panel = replace(a_panel(0.6), held={"right": "track"}, exit_s=1.0)
    picture = panel_picture(panel)
    x, y = (round(v) for v in knob_place(panel))
    assert tuple(picture[y, x + 26, :3]) == TEXT
    left, top, _, _ = next(i.box for i in lay_out(panel).items if i.name == "exit")
    assert tuple(picture[round(top) + 46, round(left) + 6, :3]) == WARNING


def test_the_legend_lights_up_with_its_stop_and_others_have_none():
    layout = lay_out(a_panel(stops=HEAT))
    assert lay_out(a_panel()).legend is None and layout.legend is not None
    left, top, right, _ = (round(edge) for edge in layout.legend)
    sums = [
        panel_picture(a_panel(x, HEAT))[top + 57, left + 10 : right - 10, :3].astype(int).sum()
        for x in (0.0, 0.25, 0.5, 1.0)
    ]
    assert sums[0] < sums[1] < sums[2] == sums[3]  # whole from half of the heat on


def test_equal_looks_have_equal_keys_and_others_not():
    panel = a_panel(0.3)
    assert picture_key(panel) == picture_key(a_panel(0.3 + 1e-5))
    others = (
        a_panel(0.31), a_panel(0.3, quality="best"), a_panel(0.3, scale=2.0),
        a_panel(0.3, note="x"),
        replace(panel, hovers={"right": "track"}), replace(panel, held={"left": "exit"}),
        replace(panel, exit_s=1.0), replace(panel, chosen="ball"), a_panel(0.3, HEAT),
    )  # fmt: skip
    keys = [picture_key(panel), *(picture_key(other) for other in others)]
    assert len({hash(key) for key in keys}) == len(keys)


MANY = tuple(Stop(f"{i}" * 9, i / 11) for i in range(12))


@pytest.mark.parametrize("stops", [(), (Stop("one", 0.4),), MANY])
def test_few_and_many_stops_and_letters_that_the_font_has_not(stops):
    slider = Slider("\u6f22\u5b57 " * 40, stops, 0.3)
    picture = panel_picture(Panel(Facts((slider,), note="long " * 40), side="left"))
    assert picture.shape[1] == WIDTH
    assert panel_picture(Panel(side="left")).shape[1] == WIDTH  # nothing to change
