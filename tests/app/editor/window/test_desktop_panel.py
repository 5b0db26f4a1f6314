"""The panel in the real window: its order, tips, the sheet of keys, the empty window, views."""

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.panels.sections import camera_panel, plain_sections, quality_panel
from shapeshift.app.editor.panels.widgets.boxes import can_browse
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.texts.table import language_in_use
from shapeshift.app.editor.window import shell
from shapeshift.app.editor.window.shell import GROUPS, spread
from shapeshift.app.paths import TOUCH
from tests.support.desktop.desktop_stand import run_frames, until_opened
from tests.support.desktop.objects_stand import names
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets, every_section


@pytest.fixture
def unfolded(monkeypatch):
    """Every section and subsection open; their names in the order in which they were drawn."""
    seen: list[str] = []

    def opened(name: str, *_, **__) -> bool:
        seen.append(name)
        return True

    monkeypatch.setattr(panel, "section", opened)
    every_section(monkeypatch)
    for module in (plain_sections, camera_panel, plain_sections, quality_panel):
        monkeypatch.setattr(module, "subsection", opened)
    return seen


def test_everything_in_the_panel_explains_itself(touch_viewer, unfolded, monkeypatch):
    viewer, widgets = touch_viewer, Widgets(monkeypatch)
    viewer.state.chosen = "ring"
    for kind in ("sphere", "box", "half-space", "lens", "painted"):
        viewer.state.add_region(kind)
        viewer.state.regions.placing = False
        run_frames(viewer, 2)
    viewer.state.split.possible = True
    run_frames(viewer, 2)
    assert len(widgets.explained) > 60
    silent = [name for name, explained in widgets.explained.items() if not explained]
    assert not silent, "\n".join(silent)


def test_every_section_has_its_tool(viewer, unfolded):
    """All that the parts of the program bring is reached, and at most nine symbols lead there."""
    brought = {section.name for section in viewer.hooks.sections}
    tools = (*panel.TOOLS, panel.SETUP)
    assert brought == {name for tool in tools for name in tool.sections}
    assert len(panel.TOOLS) <= 9 and len({tool.symbol for tool in tools}) == len(tools)
    run_frames(viewer, 1)
    inside = unfolded[unfolded.index("Performance") + 1 :]
    assert [n for n in inside if n in ("Budget", "Quality", "Passes", "Counts", "Machine")] == [
        "Budget", "Quality", "Passes", "Counts", "Machine",
    ]  # fmt: skip


def drawn(viewer, monkeypatch) -> list[str]:
    """The headings of the next frame."""
    seen: list[str] = []
    plain = panel.section
    monkeypatch.setattr(
        panel, "section", lambda name, *more: seen.append(name) or plain(name, *more)
    )
    run_frames(viewer, 1)
    monkeypatch.setattr(panel, "section", plain)
    return seen


def test_a_symbol_shows_its_own_sections_and_stays_chosen(viewer, hands, tmp_path, monkeypatch):
    viewer.settings.folder = tmp_path
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 2)
    for tool in (*panel.TOOLS[::-1], panel.SETUP):
        label = "setup" if tool is panel.SETUP else tool.name
        hands.click(*widgets.middle(label))
        assert ProgramSettings.read(tmp_path).tool == tool.name == viewer.settings.tool
        shown = [s.name for s in viewer.hooks.sections if s.shown is None or s.shown()]
        assert drawn(viewer, monkeypatch) == [name for name in tool.sections if name in shown]
    hands.click(*widgets.middle("setup"))  # once more: back to the scene
    assert viewer.settings.tool == panel.TOOLS[0].name
    viewer.settings.tool = "a tool of another version"
    assert drawn(viewer, monkeypatch) == list(panel.TOOLS[0].sections)


@pytest.mark.parametrize(
    ("key", "held", "tool"),
    [
        ("y", (), "Inspect"), ("y", ("Shift_L",), "Measure"), ("o", ("Shift_L",), "Cut"),
        ("o", (), "Parts"),
    ],
)  # fmt: skip
def test_a_key_opens_its_tool(viewer, hands, key, held, tool, monkeypatch):
    widgets = Widgets(monkeypatch)
    viewer.settings.sections[panel.chosen_tool(tool).sections[0]] = False  # folded by a hand once
    hands.key(key, *held)
    run_frames(viewer, 2)
    assert viewer.settings.tool == tool
    opened = {"Inspect": "above", "Measure": "Way", "Cut": "+ cut box", "Parts": "Floaters"}
    assert opened[tool] in widgets.boxes


def test_things_open_the_tool_that_touches_them(touch_viewer, monkeypatch):
    assert touch_viewer.settings.tool == "Touch"
    assert drawn(touch_viewer, monkeypatch) == ["Touch", "Objects"]


def test_a_body_that_comes_later_takes_no_tool_out_of_the_hand(viewer, monkeypatch):
    called = {"Touch": True}
    wanted = next(s for s in viewer.hooks.sections if s.name == "Touch")
    touch = replace(wanted, opens=lambda: called.pop("Touch", False))
    viewer.hooks.sections[viewer.hooks.sections.index(wanted)] = touch
    viewer.parts.toggle()
    run_frames(viewer, 2)
    assert viewer.settings.tool == "Parts" and not called
    called["Touch"] = True
    viewer.parts.toggle()
    run_frames(viewer, 2)
    assert viewer.settings.tool == "Touch"


@pytest.mark.parametrize("letters", [True, False])
def test_languages_are_under_the_globe(viewer, hands, letters, monkeypatch):
    """Each in its own letters where a font has them, else the sentence that says why not."""
    widgets, said = Widgets(monkeypatch), []
    monkeypatch.setattr(shell, "is_offered", lambda code: code != "ja" or letters)
    plain = imgui.text_disabled
    monkeypatch.setattr(imgui, "text_disabled", lambda text: said.append(text) or plain(text))
    run_frames(viewer, 2)
    hands.click(*widgets.middle("globe"))
    assert {"English", "Deutsch"} <= widgets.boxes.keys() and viewer.window.every_letter
    assert ("\u65e5\u672c\u8a9e" in widgets.boxes) == letters
    assert any("Nihongo (Japanese) is not offered" in text for text in said) != letters
    hands.click(*widgets.middle("Deutsch"))
    assert viewer.settings.language == "de" == language_in_use().code
    viewer.shell.speak("en")
    run_frames(viewer, 2)


def test_what_is_for_developers_is_folded_at_first(viewer, monkeypatch):
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 2)
    for label in ("Front", "photo", "thermal", "Open\u2026", "Keys (F1)"):
        assert label in widgets.boxes
    for label in ("Measure and choose", "Back to exact", "Measure now"):
        assert label not in widgets.boxes


def test_a_problem_stays_until_its_cross_is_clicked(viewer, hands):
    viewer.state.problem = "one.ply is empty."
    viewer.state.problem = "two.ply is empty."
    run_frames(viewer, 3)
    boxes = viewer.window.covered[-2:]
    assert boxes[0][3] <= boxes[1][1]  # the newer one above
    before = viewer.viewpoint.view().eye_from_world()
    left, top, right, _ = boxes[0]
    hands.drag((left + 40, top + 16), (left + 140, top + 16))  # on the sentence: no drag
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
    hands.click(right - 22, top + 22)
    assert viewer.state.messages.problems == ["one.ply is empty."]
    hands.key("Escape")
    assert viewer.state.messages.problems == []


def test_f1_opens_and_closes_the_sheet_of_all_keys(viewer, hands, monkeypatch):
    widgets = Widgets(monkeypatch)
    covered = len(viewer.window.covered)
    hands.key("F1")
    assert viewer.shell.keys_open and len(viewer.window.covered) == covered + 1
    left, top, right, low = viewer.window.covered[-1]
    width, height = viewer.window.logical_size
    assert left >= 0 and top >= 0 and right <= width and low <= height
    hands.key("F1")
    assert not viewer.shell.keys_open
    hands.click(*widgets.middle("Keys (F1)"))
    hands.key("Escape")
    assert not viewer.shell.keys_open
    hands.key("F1")
    hands.click(*widgets.middle("Close"))
    assert not viewer.shell.keys_open


def test_the_sheet_is_searched_and_begins_with_the_tool_in_hand(viewer, hands, monkeypatch):
    drawn: list[list[str]] = []
    plain = shell.spread
    monkeypatch.setattr(
        shell, "spread", lambda groups, n: drawn.append([*groups]) or plain(groups, n)
    )
    viewer.shell.choose_tool("Measure")
    hands.key("F1")
    assert drawn[-1][0] == "Measure" and set(drawn[-1]) == {*GROUPS, *viewer.hooks.keys}
    x, view = viewer.state.scene.objects[0].x, viewer.viewpoint.view().eye_from_world()
    hands.type("undo")
    assert drawn[-1] == ["Program"]
    hands.type(" 2 w")
    assert viewer.shell.keys_open and drawn[-1] == []
    run_frames(viewer, 5)  # typed, not obeyed
    assert viewer.state.scene.objects[0].x == x
    np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), view)
    hands.key("Escape")
    assert not viewer.shell.keys_open
    hands.key("F1")
    assert len(drawn[-1]) == len({*GROUPS, *viewer.hooks.keys})  # a new search
    hands.type("undo")
    hands.key("F1")
    assert not viewer.shell.keys_open


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("", ["b", "a"]), ("ALL", ["b"]), ("f12", ["a"]), ("hide  all", ["b"]), ("nothing", []),
        ("b", ["b"]),
    ],
)  # fmt: skip
def test_rows_are_found_by_words_of_key_deed_or_heading(words, found):
    groups = {"a": [("F12", "save")], "b": [("H", "hide all this")]}
    assert list(shell.found_groups(groups, ("b", "not there"), words)) == found


def test_every_key_that_does_something_stands_on_the_sheet(viewer):
    """The letters that the program's own handlers match, read from their source."""
    import inspect
    import re

    from shapeshift.app.editor.window import hands, objects, touch, two_pictures
    from shapeshift.app.editor.window import window as window_module

    told = " ".join(key for rows in GROUPS.values() for key, _ in rows)
    more = (touch.KEYS, objects.KEYS, two_pictures.KEYS)
    told += " " + " ".join(key for rows in more for key, _ in rows)
    names = {
        "SPACE": "Space", "TAB": "Tab", "ESCAPE": "Esc", "DELETE": "Delete", "COMMA": ",",
        "PERIOD": ".", "LEFT": "left", "RIGHT": "right", "KP_1": "numpad 1", "KP_3": "3",
        "KP_7": "7", "KP_5": "numpad 5", "1": "1", "9": "9",
    }  # fmt: skip
    parts = (hands, objects, shell, two_pictures, touch, two_pictures)
    source = "".join(inspect.getsource(part) for part in parts)
    found = set(re.findall(r"glfw\.KEY_(\w+)", source))
    found -= {"LEFT_SHIFT", "RIGHT_SHIFT", "LEFT_CONTROL", "RIGHT_CONTROL"}
    assert len(found) > 25
    words = re.split(r"[ ,+]+", told)
    missing = {key for key in found if names.get(key, key) not in (*words, *told.split(", "))}
    missing -= {key for key in missing if names.get(key, key) in told and len(key) > 1}
    assert not missing
    for letter in window_module.SHORTCUTS:
        assert f"Ctrl+{letter.upper()}" in told or letter in "+=-0"


def test_groups_are_spread_over_columns_in_order():
    groups = {name: [("k", "w")] * count for name, count in zip("abcd", (9, 2, 3, 1), strict=True)}
    assert spread(groups, 1) == [["a", "b", "c", "d"]]
    assert spread(groups, 3) == [["a"], ["b", "d"], ["c"]]
    assert [len(column) for column in spread(groups, 4)] == [1, 1, 1, 1]


def test_nothing_open_says_what_to_drop(splats_viewer, display, monkeypatch):
    viewer, widgets = splats_viewer, Widgets(monkeypatch)
    viewer.files.read = lambda path, told: viewer.state.read_model(path)
    viewer.state.chosen = "ball"
    viewer.objects.edits.delete()
    run_frames(viewer, 3)
    assert names(viewer) == [] and "The demo" in widgets.boxes
    left, top, right, low = viewer.window.covered[3]
    free = viewer.layout.free
    assert (left + right) / 2 == pytest.approx((free[0] + free[2]) / 2, abs=1)
    assert (top + low) / 2 == pytest.approx((free[1] + free[3]) / 2, abs=1)
    with RealHands(viewer, display) as hands:
        hands.click(*widgets.middle("The demo"))
    assert viewer.files.busy or viewer.objects.saving.asking
    until_opened(viewer)
    viewer.objects.saving.answer("Do not save")
    run_frames(viewer, 2)
    assert viewer.state.edited.path == TOUCH and len(viewer.window.covered) == 3


def test_ctrl_o_asks_for_a_path_and_opens_it(viewer, hands, tmp_path):
    (tmp_path / "one.shift").write_bytes(b"scene")
    hands.key("o", "Control_L")
    hands.type(str(tmp_path / "one.shift"))
    hands.key("Return")
    until_opened(viewer)
    assert names(viewer) == ["one"] and not viewer.state.problem
    hands.key("o", "Control_L")
    hands.key("Escape")
    assert not viewer.files._box.asking  # ImGui keeps which box is open to itself
    assert names(viewer) == ["one"]


def test_browsing_is_offered_where_the_desktop_has_a_dialog(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    assert can_browse(lambda name: name == "zenity") and not can_browse(lambda name: None)
    monkeypatch.setattr("sys.platform", "win32")
    assert can_browse(lambda name: None)


@pytest.mark.parametrize(
    ("key", "held", "side"),
    [
        ("KP_1", (), (0, 0, 1)), ("KP_3", (), (1, 0, 0)), ("KP_7", (), (0, 1, 0)),
        ("KP_1", ("Control_L",), (0, 0, -1)), ("KP_3", ("Control_L",), (-1, 0, 0)),
        ("KP_7", ("Control_L",), (0, -1, 0)),
    ],
)  # fmt: skip
def test_the_numeric_keypad_looks_from_the_sides_as_in_blender(viewer, hands, key, held, side):
    target, distance = viewer.viewpoint.camera.target.copy(), viewer.viewpoint.camera.distance
    hands.key(key, *held)
    run_frames(viewer, 80)
    eye = viewer.viewpoint.view().world_from_eye.position
    np.testing.assert_allclose(eye, target + distance * np.array(side, float), atol=1e-3)
    up = viewer.viewpoint.view().world_from_eye.matrix()[:3, 1]
    assert up[1] > 0.99 or abs(side[1]) == 1  # level, or straight above with -Z up
    hands.drag((600, 200), (640, 200))
    run_frames(viewer, 60)
    moved = viewer.viewpoint.view().world_from_eye.matrix()[:3, 2]
    assert abs(moved[1]) == pytest.approx(abs(side[1]), abs=1e-3)  # turned, not tipped over


def test_the_buttons_of_the_camera_do_the_same(viewer, hands, monkeypatch):
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Top"))
    run_frames(viewer, 80)
    assert viewer.viewpoint.view().world_from_eye.matrix()[1, 2] == pytest.approx(1, abs=1e-6)
    hands.click(*widgets.middle("Fly"))
    assert viewer.viewpoint.camera.flying
    hands.click(*widgets.middle("Orbit"))
    hands.click(*widgets.middle("First view"))
    run_frames(viewer, 80)
    assert not viewer.viewpoint.camera.flying
    first = viewer.state.first_view(viewer.viewpoint.free_size()).world_from_eye.position
    np.testing.assert_allclose(viewer.viewpoint.view().world_from_eye.position, first, atol=1e-3)


def test_a_stop_is_gone_to_by_its_button(viewer, hands, monkeypatch):
    widgets = Widgets(monkeypatch)
    run_frames(viewer, 2)
    hands.click(*widgets.middle("thermal"))
    run_frames(viewer, 2, seconds=0.5)  # it is there after SHIFT_S
    assert viewer.state.scene.objects[0].x == 1.0
    hands.click(*widgets.middle("photo"))
    run_frames(viewer, 2, seconds=0.5)
    assert viewer.state.scene.objects[0].x == 0.0


def test_painting_is_undone_by_the_keyboard_and_the_slider_stays(viewer, hands):
    left, top, right, bottom = viewer.layout.free
    middle = ((left + right) / 2, (top + bottom) / 2)
    hands.move(*middle)
    hands.hold_key("b", True)
    hands.drag(middle, (middle[0] + 30, middle[1]))
    hands.hold_key("b", False)
    regions = viewer.state.regions
    assert regions.items[0].painted.sum() > 0
    hands.key("Right")
    hands.key("z", "Control_L")
    assert regions.items == () and viewer.state.scene.objects[0].x == 0.01
    assert "paint" in viewer.state.messages.note
    hands.key("y", "Control_L")
    assert regions.items[0].painted.sum() > 0


def test_each_stroke_is_a_step_of_its_own(viewer, hands):
    left, top, right, bottom = viewer.layout.free
    x, y = (left + right) / 2, (top + bottom) / 2
    counts = []
    hands.move(x, y)
    for step in range(2):
        hands.hold_key("b", True)
        hands.drag((x + 60 * step, y), (x + 60 * step + 20, y))
        hands.hold_key("b", False)
        counts.append(int(viewer.state.regions.items[0].painted.sum()))
    assert counts[0] < counts[1]
    hands.key("z", "Control_L")
    assert int(viewer.state.regions.items[0].painted.sum()) == counts[0]


def test_escape_leaves_what_is_nearest(viewer, hands):
    viewer.state.add_region("sphere")
    viewer.state.problem = "something."
    hands.key("F1")
    hands.key("Escape")
    assert not viewer.shell.keys_open and viewer.state.problem
    hands.key("Escape")
    assert not viewer.state.problem and viewer.state.regions.placing
    hands.key("Escape")
    assert not viewer.state.regions.placing
