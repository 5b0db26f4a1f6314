"""The tool "Inspect" in the real window: real mouse and keys on a wall whose degrees are known.

The wall has 50 + 50 x degrees at x metres (tests/support/scene/warm_wall.py).
"""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.editor.panels.scale_bar import height_of
from shapeshift.app.editor.state.files.saving import what_is_lost
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.inspection.air import Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.inspection.marks_file import marks_path, read_marks_file
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.objects_stand import place_of
from tests.support.desktop.scene_stand import hands_on, viewer_on_wall
from tests.support.desktop.widgets import Widgets
from tests.support.scene.warm_wall import STOPS, celsius_at, write_wall

NEAR_C = 1.0  # a pixel of the window is 3 mm there, a splat's spacing half a degree
PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def renderer(window):
    with Renderer(window.ctx, drawing="quads") as renderer:
        yield renderer


@pytest.fixture
def wall(tmp_path) -> Path:
    return write_wall(tmp_path / "wall")


@pytest.fixture
def viewer(window, renderer, wall):
    viewer = viewer_on_wall(window, renderer, wall, "Thermal")
    yield viewer
    viewer.parts.finder.close()


@pytest.fixture
def hands(viewer, display):
    with hands_on(viewer, display) as hands:
        yield hands


def settle(viewer) -> None:
    """Frames until the view that is still has been measured."""
    end = time.monotonic() + PATIENCE_S
    run_frames(viewer, 1)
    while not viewer.inspecting.is_current and time.monotonic() < end:
        time.sleep(0.05)
        run_frames(viewer, 1)
    run_frames(viewer, 2)
    assert viewer.inspecting.is_current


def rest(viewer) -> None:
    """Frames until the picture at rest has been compared with the exact one, once."""
    end = time.monotonic() + PATIENCE_S
    while viewer.readings.error_is_old and time.monotonic() < end:
        time.sleep(0.05)
        run_frames(viewer, 1)
    run_frames(viewer, 2)  # what was drawn for that is replaced
    assert not viewer.readings.error_is_old


def on_wall(viewer, x: float, y: float = 0.0) -> tuple[float, float]:
    """Logical pixels of a place of the wall, metres."""
    return place_of(viewer, (x, y, 0.0))


def test_marks_are_laid_read_found_again_kept_and_reported(
    window, renderer, wall, viewer, hands, monkeypatch
):
    tool, state, widgets = viewer.inspecting, viewer.state, Widgets(monkeypatch)
    # Degrees and metres under the mouse, beside the scale, without the tool.
    hands.move(*on_wall(viewer, 0.2))
    settle(viewer)
    value, depth = tool.pointed
    assert value == pytest.approx(celsius_at(0.2), abs=NEAR_C)
    in_eye = viewer.viewpoint.view().eye_from_world() @ (0.2, 0, 0, 1)
    assert depth == pytest.approx(-in_eye[2], rel=0.01)

    # The tool: a click, a drag, Shift and a drag.
    hands.key("y")
    assert tool.on
    camera = viewer.viewpoint.view().eye_from_world().copy()
    hands.click(*on_wall(viewer, 0.1))
    hands.drag(on_wall(viewer, -0.1, -0.1), on_wall(viewer, 0.0, 0.1))
    hands.hold_key("Shift_L", True)
    hands.drag(on_wall(viewer, -0.15, 0.15), on_wall(viewer, 0.15, 0.15))
    hands.hold_key("Shift_L", False)
    assert [(m.name, m.kind) for m in tool.file.marks] == [
        ("Sp1", "spot"), ("Ar1", "box"), ("Li1", "line"),
    ]  # fmt: skip
    assert np.array_equal(viewer.viewpoint.view().eye_from_world(), camera)  # no drag turned it
    read = tool.readings
    assert read["Sp1"].mean == pytest.approx(celsius_at(0.1), abs=NEAR_C)
    for name, low, high in (("Ar1", -0.1, 0.0), ("Li1", -0.15, 0.15)):
        assert read[name].least == pytest.approx(celsius_at(low), abs=NEAR_C)
        assert read[name].most == pytest.approx(celsius_at(high), abs=NEAR_C)
        assert read[name].mean == pytest.approx(celsius_at((low + high) / 2), abs=NEAR_C)
    np.testing.assert_allclose(tool.file.marks[0].points, [[0.1, 0, 0]], atol=0.005)

    # From another view they are found again: values come when it is still.
    hands.drag(on_wall(viewer, 0.0), on_wall(viewer, 0.08, 0.05), 2)  # a box, taken back
    hands.key("z", "Control_L")
    assert len(tool.file.marks) == 3
    x, y = on_wall(viewer, 0.0)
    hands.move(x, y)
    hands.button(True, "right")
    hands.move(x + 40, y + 20)
    hands.button(False, "right")
    assert not np.array_equal(viewer.viewpoint.view().eye_from_world(), camera)
    settle(viewer)
    assert tool.readings["Sp1"].mean == pytest.approx(celsius_at(0.1), abs=NEAR_C)
    before = read["Li1"].mean
    assert tool.readings["Li1"].mean == pytest.approx(before, abs=NEAR_C)

    # A still window measures nothing and draws no splats.
    rest(viewer)
    frames = renderer.update
    calls: list[object] = []
    monkeypatch.setattr(renderer, "update", lambda scene: calls.append(scene) or frames(scene))
    run_frames(viewer, 5)
    assert not calls and not viewer.polling
    monkeypatch.undo()
    widgets = Widgets(monkeypatch)

    # Isotherms, over the photo stop, too.
    tool.bound("above", 55.0)
    state.set_x(0, 0.0)
    run_frames(viewer, 3)
    picture = viewer.window.picture().astype(int)
    places = (on_wall(viewer, x, 0.25) for x in (-0.4, 0.4))
    left, right = (picture[round(y), round(x)] for x, y in places)
    assert right[0] > left[0] + 60 and right[0] > right[2] + 60  # red lies there alone
    tool.bound("above", None)

    # A circle; the mean of one mark less that of another; a note and a photo of the chosen mark.
    tool.chosen = "Sp1"
    run_frames(viewer, 2)
    hands.move(600, 20)
    hands.hold_key("Control_L", True)
    hands.drag(on_wall(viewer, -0.25, -0.1), on_wall(viewer, -0.2, -0.1), 2)
    hands.hold_key("Control_L", False)
    circle = tool.file.marks[-1]
    assert (circle.kind, tool.chosen) == ("circle", circle.name)
    assert circle.radius_m == pytest.approx(0.05, abs=0.01)
    assert tool.readings[circle.name].mean == pytest.approx(celsius_at(-0.25), abs=NEAR_C)
    photo = wall.parent / "plate.jpg"
    Image.new("RGB", (900, 600), (10, 200, 30)).save(photo)
    viewer.window.on_drop(None, [str(photo)])  # as GLFW calls it; X has no device for it
    run_frames(viewer, 2)
    assert tool.mark(circle.name).photo and not state.problem
    tool.take_off(circle.name, "Sp1")
    assert tool.difference(circle.name, "Sp1") == pytest.approx(
        celsius_at(-0.25) - celsius_at(0.1), abs=2 * NEAR_C
    )
    run_frames(viewer, 2)
    hands.click(*widgets.middle(f"##note of {circle.name}"))
    hands.type("rim")
    hands.key("Return")
    assert tool.mark(circle.name).note == "rim"
    hands.move(*on_wall(viewer, 0.0, 0.25))
    hands.key("Delete")
    assert len(tool.file.marks) == 3 and not tool.file.differences

    # The table chooses; Delete deletes; a name that is typed stays.
    hands.click(*widgets.middle("Li1"))
    assert tool.chosen == "Li1"
    hands.move(*on_wall(viewer, 0.0, 0.25))
    hands.key("Delete")
    assert [m.name for m in tool.file.marks] == ["Sp1", "Ar1"]
    hands.click(*widgets.middle("Sp1"))
    hands.click(*widgets.middle("##name of Sp1"))
    hands.key("a", "Control_L")
    hands.type("Motor")
    hands.key("Return")
    assert [m.name for m in tool.file.marks] == ["Motor", "Ar1"] and tool.on
    assert not tool.name_mark("Ar1", "Motor") and not tool.name_mark("Ar1", " ")

    # Saved beside the scene by the button alone, then read when it is opened.
    beside = marks_path(wall)
    assert viewer.objects.unsaved and not beside.exists()
    tool.chosen = ""  # what is said of a chosen mark pushes the button out of this small window
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Save marks"))
    assert [m.name for m in read_marks_file(beside).marks] == ["Motor", "Ar1"]
    assert not viewer.objects.unsaved and str(beside) in state.messages.note
    hands.click(*widgets.middle("Report"))
    (report,) = (wall.parent / "work" / "exports").glob("*.html")
    text = report.read_text()
    assert "Motor" in text and text.count("data:image/png") == 2 and "Ar1" in text
    again = viewer_on_wall(window, renderer, wall, "Thermal")
    assert [m.name for m in again.inspecting.file.marks] == ["Motor", "Ar1"]
    assert not again.objects.unsaved and again.may_close()
    again.parts.finder.close()

    # Somebody else's file is not written over.
    beside.write_text(json.dumps({"shapeshift_marks": 1, "marks": []}))
    tool.delete("Motor")
    assert not viewer.objects.saving.save()
    assert "somebody else" in state.problem and viewer.objects.unsaved
    assert what_is_lost(state) == ["Marks and lengths: Motor"]
    assert not viewer.may_close() and not viewer.may_close()  # as often as it is asked
    viewer.objects.saving.answer("Cancel")


def test_emissivity_by_hand(viewer, hands, monkeypatch):
    """A box is ticked, a number typed; readings are those of the formula; undone step by step."""
    tool, widgets = viewer.inspecting, Widgets(monkeypatch)
    hands.key("y")
    settle(viewer)
    hands.click(*on_wall(viewer, 0.2))
    seen = tool.readings["Sp1"].mean
    hands.click(*widgets.middle("emissivity"))
    run_frames(viewer, 2)
    surface = SurfaceRadiation(0.95, 20.0)
    assert tool.file.emission == Emission(surface)
    want = float(Emission(surface).corrected(np.array(seen), "°C"))
    assert tool.readings["Sp1"].mean == pytest.approx(want, abs=0.01) and want > seen + 1
    hands.hold_key("Control_L", True)
    hands.click(*widgets.middle("##emissivity"))
    hands.hold_key("Control_L", False)
    hands.type("0.5")
    hands.key("Return")
    assert tool.file.emission == Emission(SurfaceRadiation(0.5, 20.0))
    want = float(Emission(SurfaceRadiation(0.5, 20.0)).corrected(np.array(seen), "°C"))
    assert tool.readings["Sp1"].mean == pytest.approx(want, abs=0.02)
    settle(viewer)
    hands.move(*on_wall(viewer, 0.2))
    run_frames(viewer, 2)
    assert tool.pointed[0] == pytest.approx(want, abs=3 * NEAR_C)  # twice the slope of what is seen
    hands.move(*on_wall(viewer, 0.0, 0.25))
    for wanted in (Emission(surface), None):
        hands.key("z", "Control_L")
        assert tool.file.emission == wanted
    assert tool.readings["Sp1"].mean == pytest.approx(seen, abs=0.01)


def test_air_by_hand(viewer, hands, monkeypatch):
    """Typed metres of air: readings are those of the formula; each number is a step to go back."""
    tool, widgets = viewer.inspecting, Widgets(monkeypatch)
    hands.key("y")
    settle(viewer)
    hands.click(*on_wall(viewer, 0.2))
    seen = tool.readings["Sp1"].mean
    hands.click(*widgets.middle("emissivity"))
    run_frames(viewer, 2)
    for name, typed in (("##air metres", "40"), ("##humidity", "80"), ("##air temperature", "5")):
        hands.hold_key("Control_L", True)
        hands.click(*widgets.middle(name))
        hands.hold_key("Control_L", False)
        hands.type(typed)
        hands.key("Return")
    wanted = Emission(SurfaceRadiation(0.95, 20.0), air=Air(40.0, 80.0, 5.0))
    assert tool.file.emission == wanted
    want = float(wanted.corrected(np.array(seen), "°C"))
    bare = float(Emission(SurfaceRadiation(0.95, 20.0)).corrected(np.array(seen), "°C"))
    assert want > bare + 0.5  # the wall is warmer than the air: what the air adds is less
    assert tool.readings["Sp1"].mean == pytest.approx(want, abs=0.02)
    hands.move(*on_wall(viewer, 0.0, 0.25))
    for _ in range(4):
        assert tool.file.emission is not None
        hands.key("z", "Control_L")
    assert tool.file.emission is None and tool.readings["Sp1"].mean == pytest.approx(seen, abs=0.01)


def test_the_handles_of_the_scale_are_level_and_span(viewer, hands, monkeypatch):
    tool, state, widgets = viewer.inspecting, viewer.state, Widgets(monkeypatch)
    box, scale = viewer.layout.legend, viewer.window.ui_scale
    column, row = (int(v) for v in on_wall(viewer, -0.2))
    assert tool.ends == (0.0, 100.0)
    before = viewer.window.picture()[row, column].astype(int)
    x = box[0] + 20
    top, middle = (height_of(share, box, scale) for share in (1.0, 0.5))
    hands.drag((x, top), (x, middle))
    low, high = tool.ends
    assert low == 0.0 and high == pytest.approx(50.0, abs=1.0)
    settle_picture = viewer.window.picture()[row, column].astype(int)
    assert settle_picture.sum() > before.sum() + 60  # 40 degrees of 50 are brighter than of 100
    hands.key("y")
    settle(viewer)
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Auto"))
    low, high = tool.ends  # the wall is 1.2 m wide
    assert 20 <= low < 30 and 70 < high <= 80
    hands.click(*widgets.middle("All values"))
    assert tool.ends == (0.0, 100.0) and state.settings.heat_ends == (0.0, 1.0)


def test_a_scene_without_heat_has_no_such_section(window, renderer, tmp_path):
    wall = write_wall(tmp_path / "plain", STOPS[:1])
    viewer = viewer_on_wall(window, renderer, wall, "RGB")
    section = next(s for s in viewer.hooks.sections if s.name == "Inspect")
    assert not section.shown() and viewer.inspecting.measured is None
    viewer.parts.finder.close()
