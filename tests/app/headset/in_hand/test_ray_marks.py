"""Marks by a hand's ray over the demo: what it meets, spots and lengths, found again and removed,
level and span, isotherms as lines; no runtime.
"""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app.editor.state.files.saving import unsaved
from shapeshift.app.headset.headset import Options
from shapeshift.app.headset.in_hand.tools_drawn import with_tools, words
from shapeshift.app.headset.save_start import save_scene
from shapeshift.app.headset.scene_shelf import open_xr
from shapeshift.app.inspection.window.inspecting import Inspecting
from shapeshift.app.inspection.window.probe import Probe
from shapeshift.app.inspection.window.ray_marks import LENGTHS, POINTS_EVERY_S
from shapeshift.app.paths import DEMO
from shapeshift.renderer.colors.palette import ALL_VALUES
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.contours import MOST_LINES, contour_lines
from shapeshift.scene.inspection.marks import Isotherm
from shapeshift.scene.inspection.marks_file import marks_path, read_marks_file
from shapeshift.scene.inspection.value_picture import ValuePicture
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.vr.drawn import Drawn
from shapeshift.vr.frame import LOST
from shapeshift.vr.panel import Carried
from shapeshift.vr.play_space import PlaySpace
from tests.support.vr.vr_hands import a_frame, hand_at
from tests.support.vr.vr_panel import a_state
from tests.support.vr.vr_tools import AWAY

# The person stands before the demo, whose middle is 15 cm over the zero of the world.
ROOM = PlaySpace(Pose(np.array([0.0, -1.0, 1.2]), np.array([1.0, 0, 0, 0])))
HEAD = look_at(np.array([0.0, 1.6, 0.0]), np.array([0.0, 1.1, -1.2]))
FROM = (0.25, 1.3, -0.2)  # of the room: the hand
MOTOR, TABLE, NOTHING = (0.1, 0.2, 0.0), (0.1, 0.0, 0.2), (0.0, 2.0, 0.0)  # of the world


class Inspector:
    """Somebody whose right hand has the tool; each `act` is a frame of a quarter of a second."""

    def __init__(self, ctx, path: Path = DEMO) -> None:
        _, editor = open_xr(path, Options())
        self.state, self.editor, self.seconds = a_state(editor), editor, 0.0
        self.probe = Probe(ctx)
        self.tools, self.tool, self.marks = (
            self.state.tools, self.state.tools.inspecting, self.state.tools.marks,
        )  # fmt: skip
        self.tools.open(self.probe.measure)
        self.tool.on = True

    def act(self, world=NOTHING, carried: Carried = AWAY, hand=None, **how):
        """The ray through a place (3,) of the world."""
        self.seconds += 0.25
        hand = hand or hand_at(FROM, self.room(world), **how)
        self.frame = a_frame(right=hand, head=HEAD, seen_s=self.seconds)
        return self.tools.act(self.frame, ROOM, carried, self.editor.scene, 0.25)

    def room(self, world) -> np.ndarray:
        return np.asarray(world) - ROOM.world_from_play.position

    def pull(self, world=NOTHING, **how) -> None:
        self.act(world, **how)
        self.act(world, trigger=1.0, **how)
        self.act(world, **how)

    def names(self) -> list[str]:
        return [mark.name for mark in self.tool.file.marks]

    def cards(self) -> list[tuple[str, ...]]:
        over = with_tools(Drawn(), self.tools, self.frame, ROOM, AWAY)
        return [card.lines for card in over.cards]


@pytest.fixture
def inspector(ctx):
    made = Inspector(ctx)
    yield made
    made.probe.close()


def test_the_ray_tells_degrees_and_metres_and_nothing_where_nothing_is(inspector):
    """Against the tracer in tests/xr; here against the ray's own geometry."""
    inspector.act(TABLE)
    pointed = inspector.marks.pointed
    start = ROOM.point(np.array(FROM))
    ray = np.array(TABLE) - start
    assert pointed.metres == pytest.approx(np.linalg.norm(ray), abs=0.02), "the table's top"
    np.testing.assert_allclose(pointed.place, TABLE, atol=0.02)
    assert 15 < pointed.value < 95
    assert inspector.cards() == [(f"{pointed.value:.1f} \u00b0C", f"{pointed.metres:.2f} m")]
    inspector.act(NOTHING)
    assert np.isnan(inspector.marks.pointed.value)
    assert inspector.cards() == [("--", "--")]
    inspector.pull(NOTHING)
    assert not inspector.names(), "nothing is there"
    inspector.tool.on = False
    inspector.act(TABLE)
    assert inspector.marks.pointed is None and inspector.cards() == []


def test_a_spot_is_laid_found_again_chosen_and_removed(inspector):
    inspector.pull(TABLE)
    assert inspector.names() == ["Sp1"] and inspector.tool.chosen == "Sp1"
    inspector.act(TABLE, trigger=1.0)
    inspector.act(TABLE, trigger=1.0)
    assert inspector.names() == ["Sp1"], "a pull at a mark lays none, and holding it does nothing"
    reading = inspector.tool.readings["Sp1"]
    assert reading.mean == pytest.approx(inspector.marks.pointed.value, abs=1.0), "as the head sees"
    inspector.pull(MOTOR)
    assert inspector.names() == ["Sp1", "Sp2"] and inspector.tool.chosen == "Sp2"
    place = inspector.tool.file.marks[0].place
    near = place + 0.6 * np.tan(np.radians(1.5)) * np.array([1.0, 0.0, 0.0])
    inspector.act(near)
    assert inspector.marks.under == "Sp1", "within a degree and a half of the ray"
    inspector.act(np.add(place, (0.1, 0.0, 0.0)))
    assert inspector.marks.under == ""
    shown = inspector.cards()
    unit = "\u00b0C"
    assert (f"Sp1: {reading.mean:.1f} {unit}",) in shown and len(shown) == 3
    inspector.pull(place)
    assert inspector.tool.chosen == "Sp1"
    inspector.pull(place, secondary=True)
    assert inspector.names() == ["Sp2"]
    assert inspector.tools.undo() and inspector.names() == ["Sp1", "Sp2"]


def test_labels_face_the_head_and_are_as_large_to_it_wherever_they_hang(inspector):
    inspector.pull(TABLE)
    over = with_tools(Drawn(), inspector.tools, inspector.frame, ROOM, AWAY)
    label = over.cards[0]
    away = HEAD.position - label.play_from_card.position
    metres = float(np.linalg.norm(away))
    assert label.play_from_card.matrix()[:3, 2] @ away == pytest.approx(metres)
    high = label.size_m[1] / metres  # a tangent
    spot = inspector.room(inspector.tool.file.marks[0].place)
    plain = replace(label, larger=1.0).size_m[1] / 0.45
    assert high == pytest.approx(plain, rel=0.06)
    assert np.degrees(np.arctan(np.linalg.norm(label.play_from_card.position - spot) / metres)) < 6
    (ball,) = [line for line in over.lines if np.array_equal(line.a, line.b)]
    np.testing.assert_allclose(ball.a, spot, atol=1e-9)


def test_two_pulls_are_a_length_with_its_uncertainty_and_marks_are_ends(inspector):
    inspector.pull(TABLE)
    inspector.marks.pulls = LENGTHS
    inspector.pull(TABLE)
    assert inspector.marks.first is not None and inspector.names() == ["Sp1"]
    inspector.pull(NOTHING)
    assert inspector.marks.first is not None, "nothing is there to be its end"
    inspector.pull((-0.2, 0.0, 0.3))
    assert inspector.marks.first is None and inspector.names() == ["Sp1", "Li1"]
    spot, line = inspector.tool.file.marks
    np.testing.assert_array_equal(line.points[0], spot.points[0])
    found = inspector.marks.lengths["Li1"]
    # On one flat top: as far apart as the rays' places on it, to two depths' errors.
    assert found.value == pytest.approx(np.hypot(0.3, 0.1), abs=0.02)
    assert 0 < found.uncertainty < 0.02
    assert words(inspector.tools, line) == f"{found.value:.3f} \u00b1 {found.uncertainty:.3f} m"
    inspector.marks.lengths.clear()  # read from a file
    inspector.tool.edit(replace(inspector.tool.file, metres_per_unit=2.0), what="known length")
    assert words(inspector.tools, line) == f"{2 * found.value:.3f} m"


def test_over_the_panel_or_lost_the_trigger_is_not_the_tools(inspector):
    inspector.act(TABLE)
    over = replace(AWAY, open=True, pointing=replace(AWAY.pointing, at=(5.0, 5.0)))
    left = inspector.act(TABLE, over, trigger=1.0)
    assert left.hands["right"].trigger == 1.0
    left = inspector.act(TABLE, trigger=1.0)
    assert left.hands["right"].trigger == 0.0 and not inspector.names(), "it has to be let go first"
    inspector.act(hand=LOST)
    assert inspector.marks.pointed is None
    bare = replace(hand_at(FROM, inspector.room(TABLE)), joints=np.zeros((26, 4)))
    inspector.act(hand=bare)
    left = inspector.act(hand=replace(bare, trigger=1.0, squeeze=1.0)).hands["right"]
    assert (left.trigger, left.squeeze) == (0.0, 0.0) and inspector.names() == ["Sp1"]


def test_it_measures_seldom_and_auto_and_isotherms_are_of_what_the_head_sees(inspector):
    asked: list[tuple[int, int]] = []
    measure = inspector.probe.measure

    def counted(thermal, scene, view: View) -> ValuePicture:
        asked.append(view.size)
        return measure(thermal, scene, view)

    inspector.marks.measure = counted
    for number in range(20):
        inspector.seconds = 10 + number * POINTS_EVERY_S / 10 - 0.25
        inspector.act(TABLE)
    assert len(asked) == 2, "nothing is marked: the ray alone, twice in two of its times"
    inspector.marks.wants_auto = True
    inspector.act(TABLE)
    first, last = inspector.tool.ends
    assert inspector.editor.settings.heat_ends != ALL_VALUES and 15 < first < last < 95
    inspector.tool.bound("above", 60.0)
    inspector.act(TABLE)
    ((kind, lines),) = inspector.marks.contours
    assert kind == "above" and 10 < len(lines) <= MOST_LINES
    picture = inspector.tool.picture
    values = picture.values_at(lines.reshape(-1, 3))
    # Between samples three pixels apart the value is not straight: most ends lie near the level.
    assert np.nanmedian(np.abs(values - 60)) < 2.0
    over = with_tools(Drawn(), inspector.tools, inspector.frame, ROOM, AWAY)
    assert len([c for c in over.lines if c.color[0] > c.color[2]]) >= len(lines)
    inspector.tool.bound("above", None)
    inspector.act(TABLE)
    assert inspector.marks.contours == ()


def test_without_room_it_is_put_away_and_says_so(inspector):
    def refuse(thermal, scene, view) -> ValuePicture:
        raise BadFile("too many splats")

    inspector.marks.measure = refuse
    inspector.act(TABLE)
    assert not inspector.tool.on
    (told,) = inspector.editor.messages.problems
    assert "no room to measure: too many splats" in told


def test_without_heat_lengths_are_measured_all_the_same(inspector, monkeypatch):
    monkeypatch.setattr(Inspecting, "measured", property(lambda self: None))
    inspector.pull(TABLE)
    assert not inspector.names(), "there is no spot without a value"
    inspector.marks.pulls = LENGTHS
    inspector.pull(TABLE)
    inspector.pull((-0.2, 0.0, 0.3))
    assert inspector.names() == ["Li1"]
    assert inspector.marks.lengths["Li1"].value == pytest.approx(np.hypot(0.3, 0.1), abs=0.02)
    inspector.act(TABLE)
    assert inspector.cards()[-1] == (f"{inspector.marks.pointed.metres:.2f} m",)


def a_plane(values: np.ndarray, depth: np.ndarray | None = None) -> ValuePicture:
    height, width = values.shape
    view = View(
        Pose(np.zeros(3), np.array([1.0, 0, 0, 0])), (-1, 1, -1, 1), 0.1, 10, (width, height)
    )
    return ValuePicture(view, values, np.full(values.shape, 2.0) if depth is None else depth)


def test_contours_are_straight_where_the_value_is():
    """On a plane two metres away whose value is x + 2 y in metres, the line x + 2 y = 0.3."""
    rows, columns = np.mgrid[:96, :96] + 0.5
    x, y = (columns / 48 - 1) * 2, (1 - rows / 48) * 2
    picture = a_plane(x + 2 * y)
    lines = contour_lines(picture, Isotherm("above", low=0.3))
    assert len(lines) > 10
    np.testing.assert_allclose(lines[..., 0] + 2 * lines[..., 1], 0.3, atol=1e-9)
    np.testing.assert_allclose(lines[..., 2], -2.0, atol=1e-12)
    ends = np.sort(lines[..., 1].ravel())
    assert ends[0] < -0.75 and ends[-1] > 1.05, "through all of the picture"
    both = contour_lines(picture, Isotherm("between", low=0.3, high=1.0))
    assert len(both) > len(lines)


def test_contours_leave_out_what_is_not_known_torn_or_never_crossed():
    rows, columns = np.mgrid[:32, :32] + 0.5
    plain = a_plane(columns)
    assert len(contour_lines(plain, Isotherm("above", low=40.0))) == 0
    assert len(contour_lines(plain, Isotherm("above", low=16.2), 4)) == 7
    holes = np.where(rows < 16, columns, np.nan)
    assert len(contour_lines(a_plane(holes), Isotherm("above", low=16.2), 4)) == 3
    torn = np.where(columns < 15, 2.0, 2.2)
    assert len(contour_lines(a_plane(columns, torn), Isotherm("above", low=15.0), 4)) == 0
    noise = np.random.default_rng(0).uniform(size=(480, 480))
    assert 0 < len(contour_lines(a_plane(noise), Isotherm("above", low=0.5))) <= MOST_LINES
    assert contour_lines(a_plane(np.ones((3, 3))), Isotherm("above", low=0.5)).shape == (0, 2, 3)


def test_marks_are_kept_beside_the_scene_as_on_the_desktop(inspector, ctx, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DOCUMENTS_DIR", str(tmp_path / "documents"))
    inspector.pull(TABLE)
    assert save_scene(inspector.editor), "what came with the program is left alone"
    beside = marks_path(inspector.editor.edited.path)
    assert beside.is_relative_to(tmp_path) and len(read_marks_file(beside).marks) == 1
    mine = Inspector(ctx, Path(shutil.copy(DEMO, tmp_path / "mine.shift")))
    mine.pull(TABLE)
    assert unsaved(mine.editor)
    assert save_scene(mine.editor)
    assert not mine.editor.problem and not unsaved(mine.editor) and mine.editor.edited.path is None
    (mark,) = read_marks_file(tmp_path / "mine.marks.json").marks
    wanted = mine.tool.file.marks[0].place + mine.tool.document.origin
    np.testing.assert_allclose(mark.place, wanted, atol=1e-5)
    again = Inspector(ctx, tmp_path / "mine.shift")
    assert again.names() == ["Sp1"]
    again.act(mine.tool.file.marks[0].place)
    assert again.marks.under == "Sp1", "found again in another session"
    for each in (mine, again):
        each.probe.close()
