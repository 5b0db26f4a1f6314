"""launch.py chart: rows whose figures agree, Ctrl-C and resume, the front, the picture's names."""

import csv
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapeshift.app import cli
from shapeshift.app.charts import chart, decode_chart
from shapeshift.app.charts.chart_measure import ChartRow, Pricing
from shapeshift.app.charts.chart_picture import (
    draw_chart,
    family,
    family_of,
    name_points,
    pareto_front,
)
from shapeshift.app.charts.chart_rows import RowsFile
from shapeshift.app.charts.chart_scene import (
    QUICK,
    WARM_UP,
    Walk,
    digest,
    distances_of,
    make_chart_scene,
    side_by_side,
)
from shapeshift.app.charts.chart_settings import EXACT, SETTINGS, settings_of
from shapeshift.app.charts.comparison import MOST_DB
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.cameras.framing import frame_points, model_points
from tests.support.models import make_random_model, random_package
from tests.support.program import assert_refused, launch

NUMBER = st.one_of(st.integers(0, 4).map(float), st.floats())


@pytest.fixture
def package(tmp_path):
    return random_package(tmp_path, 40)


def brute_front(points):
    """The definition: nobody else is at least as good in both; of equals the first."""
    whole = [i for i, point in enumerate(points) if not np.isnan(point).any()]

    def beaten(i):
        return any(
            points[j][0] >= points[i][0]
            and points[j][1] >= points[i][1]
            and (tuple(points[j]) != tuple(points[i]) or j < i)
            for j in whole
            if j != i
        )

    return {i for i in whole if not beaten(i)}


@given(st.lists(st.tuples(NUMBER, NUMBER), max_size=12))
def test_the_front_is_what_nothing_beats(points):
    front = pareto_front(points)
    assert set(front) == brute_front(points) and len(set(front)) == len(front)
    assert [points[i][0] for i in front] == sorted((points[i][0] for i in front), reverse=True)


def read_table(path):
    lines = path.read_text().splitlines()
    return lines[:3], list(csv.DictReader(lines[3:]))


def quick(package, out, *extra):
    return cli.main(["chart", str(package), "--out", str(out), "--size", "40x30", "--quick",
                     "--drawing", "tiles", "--context", "none", *extra])  # fmt: skip


def test_quick_chart_of_a_tiny_scene(package, tmp_path, capsys):
    """The whole way: every row there, figures that agree with each other, pictures written."""
    out = tmp_path / "out"
    assert quick(package, out) == 0
    told = capsys.readouterr()
    assert told.out == "" and "nothing is both faster" in " ".join(told.err.split())
    head, rows = read_table(out / "rows.csv")
    assert head[0].startswith("# python3 launch.py chart random.shift --size 40x30")
    assert str(tmp_path) not in (out / "rows.csv").read_text()
    assert [row["name"] for row in rows] == [n.name for n in settings_of("tiles", quick=True)]
    for row in rows:
        assert float(row["ratio"]) == pytest.approx(
            float(row["ms"]) / float(row["exact_ms"]), rel=2e-3
        )
        assert float(row["p95_ms"]) >= float(row["ms"]) > 0 and float(row["cpu_ms"]) > 0
        assert float(row["psnr_db"]) <= float(row["psnr_mean_db"]) <= MOST_DB
        assert float(row["sweep_psnr_db"]) <= float(row["sweep_psnr_mean_db"]) <= MOST_DB
        assert int(row["splats"]) == 200 and 0 < int(row["drawn"]) <= 200
    exact = rows[0]
    assert exact["name"] == EXACT and exact["changes"] == ""
    assert float(exact["psnr_db"]) == float(exact["sweep_psnr_db"]) == MOST_DB
    assert (out / "chart.png").read_bytes()[:4] == b"\x89PNG"
    assert (out / "chart.svg").read_text().rstrip().endswith("</svg>")
    assert not list(out.glob("*.part"))


FEW = ("--frames", "2")  # where figures are not looked at


def test_rows_that_are_there_are_kept(package, tmp_path, monkeypatch):
    """Ctrl-C in the third row loses none of two; the same command goes on behind them."""
    out, row, asked = tmp_path / "out", Pricing.row, []

    def interrupted(self, named, pictures=True):
        asked.append(named.name)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return row(self, named, pictures)

    monkeypatch.setattr(Pricing, "row", interrupted)
    assert quick(package, out, *FEW) == cli.INTERRUPTED
    _, before = read_table(out / "rows.csv")
    assert len(before) == 2
    assert quick(package, out, *FEW) == 0
    _, after = read_table(out / "rows.csv")
    names = [n.name for n in settings_of("tiles", quick=True)]
    assert after[:2] == before and [r["name"] for r in after] == names
    assert asked == names[:3] + names[2:]
    asked.clear()
    assert quick(package, out, *FEW) == 0 and asked == []  # complete: drawn again, not measured


def test_rows_of_something_else_are_refused(package, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    for text in ("", "a,b\n1,2\n", "# python3 launch.py chart other.shift --out DIR\n", "\x00\xff"):
        (out / "rows.csv").write_text(text, encoding="latin-1")
        assert quick(package, out, *FEW) == cli.BAD_INPUT
        told = capsys.readouterr().err
        assert "rows.csv is of another run" in told and told.count("\n") == 1
        assert (out / "rows.csv").read_text(encoding="latin-1") == text


def test_a_scene_that_has_changed_is_another_run(package, tmp_path, capsys):
    assert quick(package, tmp_path / "out", *FEW) == 0
    write_package(make_random_model(40, seed=1), package)
    assert quick(package, tmp_path / "out", *FEW) == cli.BAD_INPUT
    assert "of another run" in capsys.readouterr().err


def test_a_table_with_other_rows_is_refused(tmp_path):
    path = tmp_path / "rows.csv"
    file = RowsFile(path, ChartRow, ("a", "b"))
    file.add(make_row())
    assert RowsFile(path, ChartRow, ("a", "b")).rows == file.rows == [make_row()]
    whole = path.read_text()
    for broken in (whole.replace("ratio", "speed"), whole + "1,2\n", whole + "," * 17 + "\n",
                   "# a\n# b\n"):  # fmt: skip
        path.write_text(broken)
        with pytest.raises(UsageError, match="rows of another form"):
            RowsFile(path, ChartRow, ("a", "b"))


REFUSED = {
    (): "name a scene to chart",
    ("x.shift", "--decode"): "--decode takes no scene",
    ("x.shift", "--size", "0x0"): "--size is 0x0",
    ("x.shift", "--frames", "1"): "--frames is 1, expected 2 to 1000",
    ("x.shift", "--frames", "-3"): "--frames is -3",
    ("x.shift",): "x.shift does not exist",
}


@pytest.mark.parametrize("words", REFUSED, ids=" ".join)
def test_bad_options_are_one_sentence(tmp_path, capsys, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["chart", *words]) == cli.BAD_INPUT
    told = capsys.readouterr()
    assert REFUSED[words] in told.err and told.out == "" and told.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_bad_input_on_the_command_line(package, tmp_path):
    cameras = tmp_path / "cameras.json"
    cameras.write_text("[]")
    assert_refused(launch("chart", package, "--cameras", cameras), "holds no camera")
    assert_refused(launch("chart", package, "--cameras", cameras, "--frames", 4), "leave --frames")
    taken = tmp_path / "file"
    taken.write_text("")
    assert_refused(launch("chart", package, "--out", taken), "file is a file; name a folder")


def make_row(name=EXACT, eyes=1, ratio=1.0, db=MOST_DB, changes=""):
    return ChartRow(name, eyes, 10 * ratio, 12 * ratio, 10.0, ratio, 20 * ratio, 20.0, db, db, db,
                    db, 1.0, 1.0, 5, 7, 1.0, changes)  # fmt: skip


def test_every_member_of_the_front_is_named_and_no_names_overlap(tmp_path):
    """Also where they crowd: 12 members within a few percent, as measured charts have them."""
    rng = np.random.default_rng(3)
    speed, db = np.linspace(1.03, 1.27, 12), np.sort(rng.uniform(30, 90, 12))[::-1]
    rows = [make_row()] + [
        make_row(f"sort 1°, colours 2°, {i} px", ratio=1 / s, db=d, changes="key_bits=16")
        for i, (s, d) in enumerate(zip(speed, db, strict=True))
    ]
    rows += [make_row(f"behind {i}", ratio=1.1, db=20 + i, changes="fade=1") for i in range(9)]
    front = draw_chart(rows, "a title", tmp_path)
    assert [row.name for row in front] == [row.name for row in rows[:13]]
    assert {path.name for path in tmp_path.iterdir()} == {"chart.png", "chart.svg"}

    from matplotlib.figure import Figure

    axis = Figure((8.3, 4.6)).subplots()
    places = [(s, d) for s, d in zip(speed, db, strict=True)]
    axis.set(xlim=(0.95, 1.4), ylim=(10, 110))
    notes = name_points(axis, places, [row.name for row in front[1:]], places)
    for a, b in combinations([note.get_window_extent() for note in notes], 2):
        assert not a.overlaps(b)
    frame = axis.get_window_extent()
    for box in (note.get_window_extent() for note in notes):
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1 and frame.y0 <= box.y0 <= frame.y1


def test_a_speed_that_no_measurement_can_tell_is_no_gain(tmp_path):
    """1 % faster and equal: the exact setting stays on the front, named; 3 % faster beats it."""
    near, faster = make_row("a", ratio=1 / 1.009), make_row("b", ratio=1 / 1.03)
    assert [row.name for row in draw_chart([make_row(), near], "a title", tmp_path)] == [EXACT]
    told = [row.name for row in draw_chart([make_row(), near, faster], "a title", tmp_path)]
    assert told == ["b"]


def test_rows_with_nan_are_not_drawn_as_good(tmp_path):
    rows = [make_row(), make_row("broken", ratio=0.1, db=float("nan"), changes="fade=1")]
    assert [row.name for row in draw_chart(rows, "a title", tmp_path)] == [EXACT]


def test_families_of_the_whole_table():
    seen = {family(" ".join(f"{name}=1" for name in named.changes)) for named in SETTINGS}
    assert seen >= {"", "order", "culls", "colour", "pixels", "several of them"}
    assert family("target=rgba16f min_pixels=2") == "culls"
    assert family("target=rgba16f") == "pixels"


@pytest.mark.slow
def test_a_whole_chart_is_what_a_budget_finds(package, tmp_path, monkeypatch):
    """Every row of one eye is kept for --target-ms, which then measures nothing."""
    from shapeshift.app.charts import budget_chart

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    words = ["chart", str(package), "--out", str(tmp_path / "out"), "--size", "40x30",
             "--drawing", "tiles", "--context", "none", "--frames", "2"]  # fmt: skip
    assert cli.main(words) == 0
    _, rows = read_table(tmp_path / "out" / "rows.csv")
    assert [row["name"] for row in rows] == [named.name for named in settings_of("tiles")]
    (stored,) = (tmp_path / "cache" / "shapeshift" / "charts").iterdir()
    names = [row.name for row in budget_chart.read_rows(stored)]
    assert names == [named.name for named in settings_of("tiles", eyes=1)]
    monkeypatch.setattr(budget_chart, "measure", None)  # calling it would fail
    words = ["render", str(package), "--out", str(tmp_path / "pictures"), "--size", "40x30",
             "--drawing", "tiles", "--context", "none", "--target-ms", "1e6"]  # fmt: skip
    assert cli.main(words) == 0


def test_scenes_stand_side_by_side():
    """Framed radii touch but do not overlap; the first stays; a shared model is one model."""
    small, large = make_random_model(60, seed=1), make_random_model(60, seed=2)
    large = replace(large, anchors=large.anchors * 3 + np.array([50, 2, 1], np.float32))
    scene = side_by_side([Document.of(m) for m in (small, large, small)], 0.5)
    centres, radii = [], []
    for obj in scene.objects:
        centre, radius = frame_points(*model_points(obj.model))
        centres.append(centre[0] + obj.world_from_object.position[0])
        radii.append(radius)
    assert np.array_equal(scene.objects[0].world_from_object.position, np.zeros(3))
    for i, gap in enumerate(np.diff(centres)):
        assert radii[i] + radii[i + 1] < gap < 1.2 * (radii[i] + radii[i + 1])
    assert scene.objects[0].model is scene.objects[2].model
    assert [obj.x for obj in scene.objects] == [0.5] * 3


def test_near_and_far_are_in_the_scale_of_the_scene():
    """A scene ten times as large has them ten times as far; within them lie 60 and 90 %."""
    model = make_random_model(500)
    chart_scene = make_chart_scene([Document.of(model)], 0.0, (40, 30), Walk(8, 3))
    near, far = chart_scene.distances.near, chart_scene.distances.far
    points = model_points(model)
    eye = chart_scene.middle.world_from_eye.position
    inside = np.linalg.norm(points[0] - eye, axis=1)
    assert (inside < near).mean() == pytest.approx(0.6, abs=0.05)
    assert (inside < far).mean() == pytest.approx(0.9, abs=0.05)
    ten = Document.of(replace(model, anchors=model.anchors * 10))
    large = make_chart_scene([ten], 0.0, (40, 30), Walk(8, 3))
    assert large.distances.near == pytest.approx(10 * near, rel=1e-3)
    assert large.distances.far == pytest.approx(10 * far, rel=1e-3)
    nothing = (np.full((3, 3), np.nan), np.ones(3))
    assert (
        distances_of(nothing, chart_scene.path).near < distances_of(nothing, chart_scene.path).far
    )


def test_the_path_turns_evenly_about_the_scene():
    chart_scene = make_chart_scene(
        [Document.of(make_random_model(50))], 0.0, (40, 30), Walk(9, 5, step=1.5)
    )
    assert len(chart_scene.path) == WARM_UP + 9 and chart_scene.xs == (0, 0.25, 0.5, 0.75, 1)
    forward = np.array([v.world_from_eye.matrix()[[0, 2], 2] for v in chart_scene.path])
    turn = np.degrees(np.unwrap(np.arctan2(*forward.T)))
    assert np.allclose(np.abs(np.diff(turn)), 1.5, atol=1e-9)


def test_a_quick_path_is_wide_enough_to_show_what_is_kept():
    """Colours kept for so many degrees, or orders, would else be priced as if they never aged."""
    kept = [named.changes.get(field, 0.0) for named in SETTINGS if named.quick
            for field in ("recolor_degrees", "resort_degrees")]  # fmt: skip
    assert (QUICK.frames + WARM_UP - 1) * QUICK.step > 1.5 * max(kept) > 0
    kept = [named.changes.get(field, 0.0) for named in SETTINGS
            for field in ("recolor_degrees", "resort_degrees")]  # fmt: skip
    assert Walk().frames * Walk().step > 2 * max(kept)
    assert Walk().step < min(degrees for degrees in kept if degrees > 0)  # each keeps something


def test_a_digest_is_of_the_contents():
    model = make_random_model(30)
    assert digest(model) == digest(make_random_model(30))
    assert digest(model) == digest(replace(model, provenance={"other": 1}))
    moved = model.anchors.copy()
    moved[3, 1] += np.float32(1e-6)
    assert digest(model) != digest(replace(model, anchors=moved))
    assert digest([1], [2]) != digest([1, 2], []) and digest("ab") != digest("a", "b")


def test_the_command_line_holds_file_names_alone(tmp_path):
    scenes, cameras = (tmp_path / "a.shift",) * 2, tmp_path / "c.json"
    told = chart.command_line(chart.Options(scenes=scenes, cameras=cameras, x="Bare bone"))
    words = "chart a.shift a.shift --cameras c.json --x 'Bare bone' --out DIR"
    assert told == f"python3 launch.py {words}"


def test_where_the_processor_draws_its_time_decides(tmp_path):
    """Other load makes a frame late, not dear: wall ms of these two say the opposite."""
    lucky, cheap = make_row("lucky", ratio=0.5, db=50), make_row("cheap", ratio=0.8, db=50)
    rows = [make_row(), replace(lucky, cpu_ms=19.0), replace(cheap, cpu_ms=10.0)]
    front = draw_chart(rows, "a title", tmp_path, on_cpu=True)
    assert [(row.name, row.ratio) for row in front] == [(EXACT, 1.0), ("cheap", 0.5)]
    assert [row.name for row in draw_chart(rows, "a title", tmp_path)] == [EXACT, "lucky"]
    assert "processor time" not in (tmp_path / "chart.svg").read_text()


def test_only_the_exact_row_is_drawn_as_exact():
    """Of quads exact blends into float32: the default target is a shortcut with a price."""
    assert family_of(make_row(EXACT, changes="target=rgba32f")) == ""
    assert family_of(make_row("rgba16f", db=56)) == "pixels"
    assert family_of(make_row("from 2 px", changes="min_pixels=2")) == "culls"


@pytest.mark.parametrize("on_cpu", [True, False])
def test_decoding_is_timed_with_every_back_end(ctx, monkeypatch, on_cpu):
    monkeypatch.setattr(decode_chart, "RUN_S", 0.0)
    for name in decode_chart.BACK_ENDS:
        row = decode_chart.decode_row(name, ctx, make_random_model(70), on_cpu)
        assert (row.back_end, row.anchors, row.splats, row.runs) == (name, 70, 350, 3)
        assert row.all_ms > 0 < row.color_ms


@pytest.mark.parametrize("run_ms, runs", [(1, 9), (300, 7), (2000, 3)])
def test_a_figure_takes_two_seconds_or_three_runs(monkeypatch, run_ms, runs):
    now = [0.0]
    monkeypatch.setattr(decode_chart.time, "process_time", lambda: now[0])

    def job() -> None:
        now[0] += run_ms / 1e3

    times = decode_chart.timed(job, on_cpu=True)
    assert len(times) == runs and times == pytest.approx([run_ms] * runs)
