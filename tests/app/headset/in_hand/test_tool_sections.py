"""The panel's sections of tools: pressed with the ray, told in German, nothing that needs keys."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.texts.table import ENGLISH, said, use_language
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.in_hand.finger_brush import FIRST_M
from shapeshift.app.headset.panel_picture import PANEL, UI_SCALE, PanelPicture
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.headset.xr_user import XrState
from shapeshift.app.inspection.window.ray_marks import LENGTHS
from shapeshift.app.paths import DEMO
from shapeshift.renderer.colors.palette import ALL_VALUES
from shapeshift.scene.document.read_scene_file import read_scene_file
from shapeshift.scene.inspection.marks import Mark
from shapeshift.scene.inspection.marks_file import marks_path, read_marks_file
from shapeshift.scene.sections.section import BoxShape, PlaneShape
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import Wearer, a_state
from tests.support.vr.vr_tools import AWAY

LINE_GAP = 8.0  # units of the overlay between two rows of a list


@pytest.fixture
def picture(ctx):
    made = PanelPicture(ctx)
    yield made
    made.release()


def demo() -> XrState:
    _, editor = open_xr(DEMO, Options())
    state = a_state(editor)
    state.tools.inspecting.opened()
    return state


def reach(wearer: Wearer, label: str) -> None:
    """Scrolls on, then back, until an item is in sight."""
    middle = (PANEL.size[0] / 2, PANEL.size[1] * 0.7)
    for push in (-1.0, 1.0):
        before = None
        while label not in wearer.labels() and before != wearer.menu.picture.boxes:
            before = dict(wearer.menu.picture.boxes)
            for _ in range(6):
                wearer.point(middle, stick=(0.0, push))
        if label in wearer.labels():
            break
    wearer.wait(3)


def press(wearer: Wearer, *labels: str) -> None:
    for label in labels:
        reach(wearer, label)
        wearer.press(label)


def choose(wearer: Wearer, combo: str, row: int, rows: int) -> None:
    """Opens a list that hangs over its item, and pulls the trigger at one of its rows."""
    press(wearer, combo)
    left, top, right, _ = wearer.menu.picture.boxes[combo]
    high = (theme.FONT_SIZE + LINE_GAP) * UI_SCALE
    at = ((left + right) / 2, top - (rows - row - 0.5) * high - LINE_GAP * UI_SCALE)
    for trigger in (0.0, 1.0, 1.0, 0.0):
        wearer.point(at, trigger)
    wearer.wait(3)


def test_a_section_is_added_changed_brought_taken_back_and_removed(picture):
    wearer = Wearer(picture)
    tool = wearer.state.tools.sections
    press(wearer, "Room", "Touch", "Sections")
    assert "Bring it here" not in wearer.labels()
    press(wearer, "+ cut plane")
    assert isinstance(tool.current.shape, PlaneShape) and tool.on and tool.current.beyond is None
    wearer.state.tools.act(a_frame(), PlaySpace(), AWAY, wearer.editor.scene, 1 / 72)
    before = tool.current
    press(wearer, "Bring it here")
    assert tool.current.shape != before.shape
    press(wearer, "Undo")
    assert tool.current.shape == before.shape
    press(wearer, "in reach of hands")
    assert not tool.on and tool.current is not None, "it cuts, and no hand takes it"
    press(wearer, "Remove")
    assert tool.sections == ()
    press(wearer, "Undo")
    assert tool.sections != ()
    press(wearer, "Undo", "Undo")
    assert wearer.editor.messages.note.startswith("There is nothing to undo")
    press(wearer, "+ cut box")
    assert isinstance(tool.current.shape, BoxShape)


def test_what_lies_beyond_is_a_stop_by_the_ray(picture):
    wearer = Wearer(picture, demo())
    tool = wearer.state.tools.sections
    press(wearer, "Room", "Touch", "Sections", "+ cut plane")
    stops = [stop.x for stop in wearer.editor.stops(0)]
    choose(wearer, "beyond", 2, 1 + len(stops))
    assert tool.current.beyond == stops[1]
    assert wearer.editor.scene.objects[0].sections == tool.sections
    choose(wearer, "edge", 1, 3)
    assert tool.current.edge == "hard"


def test_paint_has_a_size_and_takes_the_trigger_from_marks(picture):
    wearer = Wearer(picture, demo())
    tools = wearer.state.tools
    press(wearer, "Room", "Touch", "Regions", "paint with a finger")
    assert tools.brush.on and not tools.brush.erases
    press(wearer, "erase")
    assert tools.brush.erases
    reach(wearer, "fingertip")
    _, top, right, low = wearer.menu.picture.boxes["fingertip"]
    for trigger in (0.0, 1.0, 1.0, 0.0):
        wearer.point((right - 30, (top + low) / 2), trigger)
    assert tools.brush.radius_m > 4 * FIRST_M
    wearer.editor.regions.add("painted", 0, wearer.editor.scene.objects[0], np.zeros(3))
    wearer.wait()
    reach(wearer, "Remove")
    assert not {"name", "brush", "Place"} & set(wearer.labels()), "nothing here needs keys"


def test_heat_is_measured_from_the_panel_without_keys(picture, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path))
    wearer = Wearer(picture, demo())
    tools, tool = wearer.state.tools, wearer.state.tools.inspecting
    press(wearer, "Room", "Touch", "Inspect", "lay marks")
    assert tool.on
    spot = Mark("Sp1", "spot", np.zeros((1, 3)))
    tool.edit(replace(tool.file, marks=(spot,)), what="add Sp1")
    tool.chosen = "Sp1"
    wearer.wait()
    reach(wearer, "Delete")
    assert not {"Report", "name of Sp1"} & set(wearer.labels())
    press(wearer, "Delete")
    assert tool.file.marks == ()
    press(wearer, "Auto")
    assert tools.marks.wants_auto
    reach(wearer, "coldest")
    left, top, right, low = wearer.menu.picture.boxes["coldest"]
    for trigger in (0.0, 1.0, 1.0, 0.0):
        wearer.point(((left + right) / 2, (top + low) / 2), trigger)
    first, last = tool.ends
    assert first == pytest.approx(sum(tool.value_range) / 2, rel=0.05)
    assert last == tool.value_range[1]
    press(wearer, "All values")
    assert wearer.editor.settings.heat_ends == ALL_VALUES
    press(wearer, "above")
    assert [each.kind for each in tool.file.isotherms] == ["above"]
    press(wearer, "lengths")
    assert tools.marks.pulls == LENGTHS
    press(wearer, "Undo")
    assert tool.file.isotherms == ()
    press(wearer, "above", "Save marks")
    assert wearer.editor.edited.path is not None
    beside = marks_path(wearer.editor.edited.path)
    assert beside.is_relative_to(tmp_path) and len(read_marks_file(beside).isotherms) == 1


@pytest.mark.parametrize("code", ["de", "ja"])
def test_in_other_languages_all_of_it_fits_the_panel(picture, code):
    """No item reaches beyond the panel's right edge, and each has the height of a target."""
    use_language(code)
    try:
        wearer = Wearer(picture, demo())
        wearer.state.tools.brush.on = True
        wearer.state.tools.sections.add(plane=True)
        press(wearer, *map(said, ("Room", "Touch", "Inspect", "Sections", "Regions")))
        middle = (PANEL.size[0] / 2, PANEL.size[1] * 0.7)
        seen: set[str] = set()
        for number in range(60):
            for label, (left, _, right, _) in wearer.menu.picture.boxes.items():
                assert 0 <= left < right <= PANEL.size[0], label
                seen.add(label)
            wearer.point(middle, stick=(0.0, -1.0 if number < 25 else 1.0))
        assert {said("Undo"), said("Save"), said("paint with a finger")} <= seen
    finally:
        use_language(ENGLISH)


def test_what_was_cut_and_painted_is_saved_as_on_a_desk(picture, tmp_path, monkeypatch):
    """Read again from the file: the section beyond which a stop is shown, and the paint."""
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    wearer = Wearer(picture, demo())
    tools, editor = wearer.state.tools, wearer.editor
    tools.sections.add(plane=True)
    tools.sections.change(0, "beyond a section", beyond=0.5)
    tools.brush.on = True
    hand = hand_at((0.0, 0.1, 0.3), (0.0, 0.1, -1.0))
    tools.brush.radius_m = 0.3
    for trigger in (0.0, 1.0, 0.0):
        frame = a_frame(right=replace(hand, trigger=trigger))
        tools.act(frame, PlaySpace(), AWAY, editor.scene, 1 / 72)
    painted = editor.regions.current.painted
    assert painted.any() and not painted.all()
    press(wearer, "Room", "Touch", "Sections", "Save")
    assert not editor.messages.problems
    read = read_scene_file(editor.edited.path)
    sections = [*read.sections, *(one for item in read.all_items for one in item.sections)]
    assert [one.beyond for one in sections] == [0.5]
    (selector,) = read.all_items[0].selectors
    np.testing.assert_array_equal(np.asarray(selector.weight) > 0.5, painted)
