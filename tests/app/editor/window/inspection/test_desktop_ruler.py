"""The tool "Measure" in the real window: clicks on a wall whose metres are known.

The wall stands in the plane z = 0; a pixel of the window is 3 mm there.
"""

from pathlib import Path

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.inspection.marks_file import marks_path, read_marks_file
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.objects_stand import place_of
from tests.support.desktop.scene_stand import hands_on, viewer_on_wall
from tests.support.desktop.widgets import Widgets
from tests.support.scene.warm_wall import STOPS, write_wall

NEAR_M = 0.006  # two pixels


@pytest.fixture(scope="module")
def renderer(window):
    with Renderer(window.ctx, drawing="quads") as renderer:
        yield renderer


@pytest.fixture
def wall(tmp_path) -> Path:
    return write_wall(tmp_path / "wall", STOPS[:1])  # photos alone: no heat is needed


@pytest.fixture
def viewer(window, renderer, wall):
    viewer = viewer_on_wall(window, renderer, wall)
    yield viewer
    viewer.parts.finder.close()


@pytest.fixture
def hands(viewer, display):
    with hands_on(viewer, display) as hands:
        yield hands


def test_lengths_are_clicked_scaled_noted_kept_and_reported(
    window, renderer, wall, viewer, hands, monkeypatch
):
    ruler, state, widgets = viewer.ruler, viewer.state, Widgets(monkeypatch)

    def on_wall(x: float, y: float = 0.0) -> tuple[float, float]:
        return place_of(viewer, (x, y, 0.0))

    hands.key("y", "Shift_L")
    assert ruler.on and not viewer.inspecting.on
    run_frames(viewer, 2)

    # A distance is two clicks; a drag between them turns the camera and lays nothing.
    camera = viewer.viewpoint.view().eye_from_world().copy()
    hands.click(*on_wall(-0.2))
    hands.drag((600, 500), (620, 505))
    assert not np.array_equal(viewer.viewpoint.view().eye_from_world(), camera)
    assert len(ruler.points) == 1 and not ruler.lengths
    hands.click(*on_wall(0.2))
    (first,) = ruler.lengths
    found = ruler.measured(first)
    assert first.name == "L1" and found.unit == "m"
    assert found.value == pytest.approx(0.4, abs=NEAR_M)
    assert abs(found.value - 0.4) < 3 * found.uncertainty < 0.1

    # An angle of three clicks, an area that its first corner closes, a way that Enter ends.
    hands.click(*widgets.middle("Angle"))
    for place in ((0.2, 0.0), (0.0, 0.0), (0.0, 0.2)):
        hands.click(*on_wall(*place))
    hands.click(*widgets.middle("Area"))
    for place in ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1)):
        hands.click(*on_wall(*place))
    hands.click(*widgets.middle("Way"))
    for place in ((-0.2, 0.2), (0.1, 0.2), (0.1, 0.1)):
        hands.click(*on_wall(*place))
    hands.key("BackSpace")  # the last point again
    hands.click(*on_wall(0.1, 0.0))
    hands.key("Return")
    assert [each.kind for each in ruler.lengths] == ["distance", "angle", "area", "polyline"]
    values = [ruler.measured(each).value for each in ruler.lengths]
    assert values[1] == pytest.approx(90, abs=3)
    assert values[2] == pytest.approx(0.04, abs=0.2 * 4 * NEAR_M)
    assert values[3] == pytest.approx(0.5, abs=2 * NEAR_M)

    # In the void nothing is laid, and it is said.
    hands.click(600, 30)
    assert not ruler.points and len(ruler.lengths) == 4

    # A known length: 0.4 is 80 cm, so all is twice as large; one step takes it back.
    hands.click(*widgets.middle("L1"))
    run_frames(viewer, 2)
    hands.click(*widgets.middle("##known L1"))
    hands.type("80cm")
    hands.key("Return")
    assert ruler.measured(first).value == pytest.approx(0.8)
    assert ruler.measured(ruler.lengths[2]).value == pytest.approx(
        4 * values[2] * (0.4 / values[0]) ** 2, rel=1e-6
    )
    assert ruler.measured(ruler.lengths[1]).value == pytest.approx(values[1])
    hands.move(600, 30)
    hands.key("z", "Control_L")
    assert ruler.scale.factor == 1 and len(ruler.lengths) == 4

    # A name and a note, typed.
    hands.click(*widgets.middle("##name of length L1"))
    hands.key("a", "Control_L")
    hands.type("Q")
    hands.key("Return")
    run_frames(viewer, 2)
    hands.click(*widgets.middle("##note of length Q"))
    hands.type("bent")
    hands.key("Return")
    assert (ruler.lengths[0].name, ruler.lengths[0].note) == ("Q", "bent")

    # Kept beside the scene, reported, found again.
    beside = marks_path(wall)
    hands.move(600, 30)
    hands.key("Escape")
    hands.key("Escape")
    assert not ruler.on
    run_frames(viewer, 2)
    hands.click(*widgets.middle("Save lengths"))
    assert [each.name for each in read_marks_file(beside).lengths] == [
        "Q", "Angle1", "Area1", "Way1",
    ]  # fmt: skip
    hands.click(*widgets.middle("Report"))
    (report,) = (wall.parent / "work" / "exports").glob("*.html")
    text = report.read_text()
    assert ">Q<" in text and "bent" in text and text.count("data:image/png") == 1
    assert f"{ruler.measured(ruler.lengths[0]).words('m')}" in text and not state.problem
    again = viewer_on_wall(window, renderer, wall)
    assert again.ruler.measured(again.ruler.lengths[0]).value == pytest.approx(values[0], abs=1e-4)
    assert not again.objects.unsaved and again.may_close()
    again.parts.finder.close()
