"""The measure against a renderer of known speed and error, and what bench refuses and writes."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from shapeshift.app import cli, measure
from shapeshift.app.commands import bench
from shapeshift.app.document import Document
from shapeshift.app.errors import UsageError
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.settings import FrameStats, RenderSettings
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.scene.metrics import psnr
from tests.support.models import make_random_model
from tests.support.program import assert_refused, launch


class Clock:
    """time.perf_counter that only moves when something says that it took time."""

    def __init__(self):
        self.now = 100.0

    def perf_counter(self):
        return self.now


class StandIn:
    """A renderer that takes a known time and draws the reference with a known error."""

    def __init__(self, clock, off=0.0):
        self.clock, self.off = clock, off
        self.settings = RenderSettings()
        self.backends = {"drawing": "stand-in"}
        self.calls = []  # (x, eyes) of each draw
        self.slow_x = None  # a value of x whose update takes a second
        self.ms = {"project": 1.0, "bin": 2.0, "splat": 6.0}

    def update(self, scene):
        self.scene = scene
        self.clock.now += 1.0 if scene.objects[0].x == self.slow_x else 0.002

    def draw(self, views):
        self.calls.append((self.scene.objects[0].x, len(views)))
        first = len(self.calls) <= 2  # a driver compiles in its first frames
        self.clock.now += 5.0 if first else 0.010 + 0.006 * (len(views) - 1)
        self.view = views[0]
        self.stats = FrameStats(self.ms, splats=7, drawn=5)
        return self.stats

    def exact_stats(self):
        return self.stats

    def image(self, i):
        want = reference_image(self.scene, self.view, self.settings)
        wrong = self.off * (10 if self.scene.objects[0].x == 0.5 else 1)
        return (want + wrong).astype(np.float64)


@pytest.fixture
def model():
    return make_random_model(20, k=2)


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(measure, "time", clock)
    return clock


def measured(model, renderer, frames=4, sweep=5, x=0.0):
    work = measure.Measure(renderer, None, Document.of(model), x, (16, 12))
    return work.all(frames, sweep, (8, 6))


def test_times_are_those_of_the_frames_that_count(model, clock):
    result = measured(model, StandIn(clock))
    assert result["frame_ms"] == pytest.approx({"p50": 10, "p95": 10, "p99": 10})
    assert result["stereo_ms"]["p99"] == pytest.approx(16)
    assert result["stereo_over_mono"] == pytest.approx(1.6)
    assert result["sweep_worst_ms"] == pytest.approx(12)  # update and draw
    assert result["passes"]["splat"]["p95"] == 6
    assert result["draw_passes"] == ["bin", "splat"]
    assert result["draw_pass_ratio"] == pytest.approx(10 / 8)


def test_the_worst_frame_of_the_sweep_is_found(model, clock):
    renderer = StandIn(clock)
    renderer.slow_x = 0.75
    assert measured(model, renderer)["sweep_worst_ms"] == pytest.approx(1010)


def test_what_is_drawn_and_how_often(model, clock):
    renderer = StandIn(clock)
    result = measured(model, renderer, frames=4, sweep=5)
    orbit, sweep, quality = renderer.calls[:14], renderer.calls[14:22], renderer.calls[22:]
    assert orbit == [(0.0, 2), (0.0, 1)] * 7  # three warm up, stereo and mono in turns
    assert [x for x, _ in sweep] == [0, 0, 0, 0, 0.25, 0.5, 0.75, 1]
    assert [x for x, _ in quality] == [0, 0, 0, 0.5, 1]  # sides, then stops and between
    assert (result["frames"], result["sweep"], result["warm_up"]) == (4, 5, 3)
    assert result["quality_images"] == 5


def test_the_error_is_the_worst_of_all_pictures(model, clock):
    exact = measured(model, StandIn(clock))
    assert exact["psnr_db"] == measure.MOST_DB  # equal: a number that JSON can hold
    result = measured(model, StandIn(clock, off=1e-3))
    assert result["psnr_db"] == pytest.approx(40)  # 1e-2 at x = 0.5, 1e-3 elsewhere
    assert psnr(np.zeros(3), np.full(3, 1e-2)) == pytest.approx(40)


def test_nan_in_one_picture_does_not_hide(model, clock, capsys):
    renderer = StandIn(clock)
    image = renderer.image
    renderer.image = lambda i: image(i) * (np.nan if renderer.scene.objects[0].x == 1 else 1)
    result = measured(model, renderer)
    assert result["psnr_db"] is None
    bench.print_table(result | {"scene": "random.shift"})
    assert "NaN in a picture" in capsys.readouterr().err.replace("\n", " ")


def test_a_single_stop_is_compared_from_the_sides_alone(model, clock):
    from dataclasses import replace

    lone = replace(model, stops=(Stop("RGB", 0.5),))
    renderer = StandIn(clock)
    assert measured(lone, renderer, x=0.5)["quality_images"] == measure.QUALITY_VIEWS
    assert [x for x, _ in renderer.calls[22:]] == [0.5] * 3


def test_no_draw_pass_is_no_ratio(model, clock):
    renderer = StandIn(clock)
    renderer.ms = {"project": 1.0}
    assert measured(model, renderer)["draw_pass_ratio"] is None


def test_the_result_is_json_as_the_standard_has_it(model, clock):
    result = measured(model, StandIn(clock))
    told = json.loads(json.dumps(result, allow_nan=False))
    assert told["settings"]["max_pixels"] is None  # no limit
    assert told["settings"]["min_alpha"] == pytest.approx(1 / 255)
    machine = {"processor", "cores", "system", "opencl", "gl_version", "numpy", "moderngl",
               "onnxruntime", "pyopencl", "python"}  # fmt: skip
    assert machine <= told["machine"].keys()
    assert told["gl_renderer"] == "none (OpenCL tiles)"


def test_percentiles():
    assert measure.percentiles([1.0]) == {"p50": 1, "p95": 1, "p99": 1}
    assert measure.percentiles(list(range(101))) == {"p50": 50, "p95": 95, "p99": 99}


def test_a_result_replaces_only_a_result(tmp_path):
    path = tmp_path / "out.json"
    bench.check_result_path(path)
    bench.write_json(path, {"frame_ms": {}})
    bench.check_result_path(path)
    assert [p.name for p in tmp_path.iterdir()] == ["out.json"]
    for text in ("{}", "[1]", "ply\n", "", "[" * 100_000):
        path.write_text(text)
        with pytest.raises(UsageError, match="is no bench result"):
            bench.check_result_path(path)
    with pytest.raises(UsageError, match="is a folder"):
        bench.check_result_path(tmp_path)
    with pytest.raises(UsageError, match="cannot write into the folder"):
        bench.check_result_path(tmp_path / "none" / "out.json")


def test_a_result_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "out.json"
    path.write_text("before")
    with pytest.raises(ValueError):
        bench.write_json(path, {"psnr_db": float("nan")})
    assert path.read_text() == "before" and len(list(tmp_path.iterdir())) == 1


def test_a_name_with_brackets_is_no_markup(capsys, model, clock):
    result = measured(model, StandIn(clock)) | {"scene": "a[/b] [red].shift"}
    bench.print_table(result)
    told = capsys.readouterr()
    assert "a[/b] [red].shift" in told.err and told.out == ""
    for words in ("x sweep", "stereo/mono 1.60", "200.0 dB", "(bin + splat) 1.25", "do not count"):
        assert words in told.err.replace("\n", " ")


REFUSED = {
    ("--frames", "1"): "--frames is 1, expected 2 to",
    ("--sweep", "0"): "--sweep is 0, expected 2 to",
    ("--size", "16384x16384"): "134,217,728 pixels",
    ("--quality-size", "0x3"): "--quality-size is 0x3",
    ("--json", "."): "bench ... --json > .` for a file",
    ("--json=b.json",): "bench ... --json > b.json` for a file",
    ("--json", "-"): "bench ... --json > FILE.json` for a file",
}


def counts(**given):
    return SimpleNamespace(**{"frames": 2, "sweep": 2} | given)


def test_counts():
    bench.check_counts(counts())
    for given in ({"frames": 1}, {"sweep": 0}, {"frames": 10**9}):
        with pytest.raises(UsageError, match="expected 2 to 100000"):
            bench.check_counts(counts(**given))


@pytest.mark.parametrize("extra", REFUSED, ids=" ".join)
def test_bad_options_are_one_sentence(tmp_path, capsys, extra):
    """Before the scene is opened: it is not there."""
    assert cli.main(["bench", str(tmp_path / "none.shift"), *extra]) == 2
    told = capsys.readouterr()
    assert REFUSED[extra] in told.err and told.out == "" and told.err.count("\n") == 1


def test_a_missing_scene_is_one_sentence(tmp_path):
    assert_refused(launch("bench", tmp_path / "none.shift"), "none.shift does not exist")


def test_gl_quads_beside_their_error(tmp_path):
    """The whole way with GL: rows of a driver, a picture as good as half floats are."""
    from shapeshift.renderer.gl.context import NoContext, open_context

    try:
        open_context().release()
    except NoContext as reason:
        pytest.skip(str(reason))
    write_package(make_random_model(40), tmp_path / "random.shift")
    done = launch("bench", tmp_path / "random.shift", "--frames", 2, "--sweep", 2, "--size",
                  "40x30", "--quality-size", "40x30", "--drawing", "quads",
                  "--json")  # fmt: skip
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["gl_renderer"] and result["machine"]["gl_version"].startswith("4.")
    assert result["backends"]["drawing"].startswith("quads")
    assert result["draw_passes"] == ["splat"] and result["draw_pass_ratio"] > 1
    assert result["psnr_db"] > 50
    assert result["command"].startswith("python3 launch.py bench random.shift --frames 2")
