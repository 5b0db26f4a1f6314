"""The report of section Inspect, written in a headset: by the panel's button, of what is ahead."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.panel_picture import PanelPicture
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.inspection.window.probe import REPORT_PX, Probe
from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
from shapeshift.scene.pose import Pose, look_at
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import Wearer, a_state
from tests.support.vr.vr_tools import AWAY

ROOM = PlaySpace(Pose(np.array([0.0, -1.0, 1.2]), np.array([1.0, 0, 0, 0])))
HEAD = look_at(np.array([0.0, 1.6, 0.0]), np.array([0.0, 1.1, -1.2]))
MOTOR = np.array([0.1, 0.2, 0.0])  # of the world
ROW = re.compile(r"<tr>(.*?)</tr>", re.S)


@pytest.fixture
def wearer(ctx, tmp_path):
    """Before the demo, with one spot on the motor."""
    probe, picture = Probe(ctx), PanelPicture(ctx)
    _, editor = open_xr(DEMO, Options())
    made = Wearer(picture, a_state(editor))
    tools = made.state.tools
    tools.open(probe.measure, probe.inspect)
    tools.folder = tmp_path / "exports"
    tools.inspecting.on = True
    made.seconds = 0.0
    aim = MOTOR - ROOM.world_from_play.position
    for trigger in (0.0, 1.0, 0.0):
        act(made, right=hand_at((0.25, 1.3, -0.2), aim, trigger=trigger))
    assert [mark.kind for mark in tools.inspecting.file.marks] == ["spot"]
    yield made
    picture.release()
    probe.close()


def act(wearer: Wearer, **hands) -> None:
    wearer.seconds += 1.0
    frame = a_frame(head=HEAD, seen_s=wearer.seconds, **hands)
    wearer.state.tools.act(frame, ROOM, AWAY, wearer.editor.scene, 1.0)


def press_report(wearer: Wearer) -> None:
    wearer.unfold("Inspect")
    wearer.scroll_to("Report")
    wearer.press("Report")


def mean_of(text: str, name: str) -> float:
    """Of a mark's row in a report: its mean, with its unit after it."""
    (row,) = [row for row in ROW.findall(text) if f">{name}<" in row]
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row)
    assert cells[:2] == [name, "spot"]
    return float(re.match(r"-?[\d.]+", cells[3]).group())


def test_a_report_is_asked_for_on_the_panel_and_written_of_what_is_ahead(wearer):
    """Its figures are those beside the hand, from another picture of the same place: 480 and 1024
    pixels wide, so the spot's pixels differ by less than a degree on the motor.
    """
    tools, tool = wearer.state.tools, wearer.state.tools.inspecting
    act(wearer)
    ((name, reading),) = tool.readings.items()
    press_report(wearer)
    assert tools.wants_report and not tools.folder.exists(), "the next frame writes it"
    act(wearer)
    assert not tools.wants_report
    act(wearer)
    (path,) = tools.folder.glob("*.html")
    assert str(path) in wearer.editor.messages.note
    text = path.read_text()
    assert mean_of(text, name) == pytest.approx(reading.mean, abs=1.0)
    assert text.count("<img") == 2 and "Thermal" in text and "script" not in text
    (view,) = json.loads(path.with_name(f"{path.stem}.camera.json").read_text())
    shown = ROOM.pose(HEAD).matrix()
    shown[:3, 3] += tool.document.origin
    np.testing.assert_allclose(view["matrix"], shown, atol=1e-9)
    assert view["size"] == [REPORT_PX] * 2
    tools.wants_report = True
    act(wearer)
    assert len(list(tools.folder.glob("*.html"))) == 2, "never over another"


def test_values_of_a_report_are_those_of_surfaces_where_the_panel_says_so(wearer):
    """Another formula: at emissivity 0.5 of what mirrors 0 degrees, a surface is hotter."""
    tools, tool = wearer.state.tools, wearer.state.tools.inspecting
    (mark,) = tool.file.marks
    texts = []
    for emission in (None, Emission(SurfaceRadiation(0.5, 0.0))):
        tool.edit(replace(tool.file, emission=emission), what="emissivity")
        tools.wants_report = True
        act(wearer)
        texts.append(max(tools.folder.glob("*.html"), key=lambda p: p.name).read_text())
    plain, of_surface = (mean_of(text, mark.name) for text in texts)
    assert of_surface > plain + 5
    act(wearer)
    assert of_surface == pytest.approx(tool.readings[mark.name].mean, abs=2.0)
    assert "emissivity" in texts[1] and "apparent temperatures" in texts[0]


@pytest.mark.parametrize("error", [BadFile("too many splats"), OSError(28, "no space left")])
def test_what_cannot_be_written_is_a_sentence_and_the_session_goes_on(wearer, error):
    tools = wearer.state.tools

    def refuse(*given):
        raise error

    tools.inspect, tools.wants_report = refuse, True
    act(wearer)
    assert "No report was written" in wearer.editor.problem
    assert not tools.folder.exists() and not tools.wants_report


def test_without_a_drawing_there_is_no_button(wearer):
    wearer.state.tools.inspect = None
    wearer.unfold("Inspect")
    wearer.scroll_to("Save marks")
    assert "Report" not in wearer.labels()
