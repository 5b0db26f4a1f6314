"""Every case of `launch.py stability` on a small scene with tiles; and that each can fail."""

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app.drawing import open_renderer
from shapeshift.app.stability_cases.case_context import (
    CaseContext,
    at_least,
    at_most,
    broken_pixels,
    not_here,
)
from shapeshift.app.stability_cases.scenes import small_model
from shapeshift.app.stability_cases.table import CASES, COLUMNS, open_table
from shapeshift.rasterizer.device import NoDevice
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.stop_weights import Pace
from shapeshift.scene.scene import Scene
from tests.support.program import assert_refused, launch
from tests.support.renderer.case_context import SIZE, failures, make_case
from tests.support.splat_scenes import random_layers

ROOT = Path(__file__).resolve().parents[3]


def reopen():
    return open_renderer("none", "tiles")


@pytest.fixture(scope="module")
def case():
    try:
        with reopen() as (renderer, ctx):
            yield make_case(renderer, ctx, reopen)
    except NoDevice as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize("name", CASES)
def test_the_case_holds(case, name):
    result = CASES[name](case)
    assert not failures(result)
    assert result.findings and result.panels
    assert all(f.reason and f.figure for f in result.findings)
    assert all(np.isfinite(panel.image).all() for panel in result.panels)


class Spoiled:
    """A renderer with a fault: `spoil(image, i, stats)` changes what image(i) gives."""

    def __init__(self, renderer, spoil) -> None:
        self._renderer, self._spoil, self._frames = renderer, spoil, 0
        self.settings = renderer.settings
        self.scene = Scene(())

    def update(self, scene):
        self.scene = scene
        self._renderer.update(scene)

    def draw(self, views):
        self._renderer.settings = self.settings
        self._frames += 1
        self._views = views
        return self._renderer.draw(views)

    def image(self, i: int = 0) -> np.ndarray:
        return self._spoil(self, np.array(self._renderer.image(i)), i)

    def resolved(self, i: int = 0) -> np.ndarray:
        image = self.image(i)
        return image[..., :3]

    def __getattr__(self, name):
        return getattr(self._renderer, name)


def with_nan(renderer, image, i):
    image[0, 0, 0] = np.nan
    return image


def too_opaque(renderer, image, i):
    image[..., 3] *= 1.5
    return image + np.float32(1e-3)


def eyes_swapped(renderer, image, i):
    count = len(renderer._views)
    return np.array(renderer._renderer.image(count - 1 - i)) if count == 2 else image


def flashing(renderer, image, i):
    return 1 - image if renderer._frames % 7 == 5 else image


def darker_in_between(renderer, image, i):
    x = renderer.scene.objects[0].x
    return image * np.float32(0.4) if 0.3 < x < 0.7 else image


def shivering(renderer, image, i):
    return np.roll(image, renderer._frames % 2, axis=1)


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        *((name, with_nan) for name in ("sweep", "random-eyes", "needles", "counts", "life")),
        ("counts", too_opaque),
        ("limits", too_opaque),
        ("disparity", eyes_swapped),
        ("sweep", flashing),
        ("sweep", darker_in_between),
        ("crowd", shivering),
        ("far-origin", shivering),
        ("depth-range", shivering),
        ("canted", shivering),
        ("stereo", eyes_swapped),
        ("stereo", shivering),
    ],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_the_case_fails_where_the_renderer_does(case, name, spoil):
    if name == "life":
        result = CASES[name](
            CaseContext(case.renderer, None, case.subject, SIZE, spoiled_reopen, rounds=2)
        )
    else:
        spoiled = Spoiled(case.renderer, spoil)
        result = CASES[name](make_case(spoiled, None, reopen))
    assert failures(result)


def test_colours_of_the_middle_between_the_eyes_fail(case, monkeypatch):
    """What every stereo frame had before each eye got colours of its own."""
    monkeypatch.setattr("shapeshift.renderer.colors.color_cache.SHARED_DB", -1e9)
    assert any("glossy ball" in text for text in failures(CASES["stereo"](case)))


def test_a_clamp_about_the_tangents_fails(case, monkeypatch):
    """1.3 times each tangent, as the Jacobian was held before: within a picture off its axis."""

    def limits(camera):
        (width, height), k = camera.size, 1.3
        return (
            -k * camera.cx / camera.fx, k * (width - camera.cx) / camera.fx,
            -k * camera.cy / camera.fy, k * (height - camera.cy) / camera.fy,
        )  # fmt: skip

    monkeypatch.setattr("shapeshift.rasterizer.project.Camera.limits", limits)
    found = failures(CASES["lenses"](case))
    assert sum("parts" in text for text in found) >= 3, found


def spoiled_reopen():
    from contextlib import contextmanager

    @contextmanager
    def opened():
        with reopen() as (renderer, ctx):
            yield Spoiled(renderer, with_nan), ctx

    return opened()


def test_networks_that_nobody_trained_flash_between_the_stops(case):
    """Where x is encoded as it is; a blend of the stops asks for nothing that was not trained."""
    wild = make_case(case.renderer, None, reopen, direct(small_model()))
    assert any("step" in text or "way round" in text for text in failures(CASES["sweep"](wild)))
    blended = make_case(case.renderer, None, reopen, small_model())
    assert not failures(CASES["sweep"](blended))


def test_a_switch_that_flashes_nowhere_fails_too(case):
    """The same blends, almost all of them within a fifth of the way: 4.8 even steps in one."""
    model = small_model()
    ends = [stop.name for stop in model.stops[:2]]
    switch = replace(model, pace=(Pace(*ends, (0, 0.01, 0.02, 0.98, 0.99, 1)),))
    told = failures(CASES["sweep"](make_case(case.renderer, None, reopen, switch)))
    assert len(told) == 1 and "largest step over an even one" in told[0]


def test_a_scene_with_one_stop_has_no_sweep(case):
    single = make_case(case.renderer, None, reopen, random_layers(10, layers=1))
    (row,) = CASES["sweep"](single).findings
    assert row.verdict == "does not apply" and "single stop" in row.reason


def test_help_names_every_case():
    told = " ".join(launch("stability", "--help").stdout.replace("│", " ").split())
    assert ", ".join(CASES) in told
    assert "1: one fails" in told


def test_the_guide_and_the_committed_rows_name_every_case():
    guide = (ROOT / "docs" / "stability.md").read_text()
    assert [line.split("`")[1] for line in guide.splitlines() if line.startswith("| `")] == [*CASES]
    lines = (ROOT / "docs" / "bench" / "stability.csv").read_text().splitlines()
    found = list(csv.reader(lines[3:]))
    assert lines[0].startswith("# python3 launch.py stability workshop.shift")
    assert list(dict.fromkeys(row[0] for row in found)) == [*CASES]
    assert {row[4] for row in found} <= {"holds", "does not apply"}


def test_nan_holds_no_bound():
    assert at_least("f", np.nan, 1, "r").verdict == "FAILS"
    assert at_most("f", np.nan, 1, "r").verdict == "FAILS"
    assert at_most("f", 1, 1, "r").verdict == at_least("f", 1, 1, "r").verdict == "holds"
    assert not_here("f", "r").verdict == "does not apply"


def test_broken_pixels_are_counted_once_each():
    image = np.zeros((2, 3, 4), np.float32)
    assert broken_pixels(image) == 0
    image[0, 0] = np.nan
    image[0, 1, 3] = 1.01
    image[1, 2, 3] = -1e-6
    image[1, 1, 2] = np.inf
    assert broken_pixels(image, image) == 8


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    path = tmp_path_factory.mktemp("stability") / "small.shift"
    write_package(direct(small_model(20)), path)
    return path


def direct(model):
    """x goes into the encoding as it is, where nobody has trained what lies between the stops."""
    return replace(model, between_stops="encoding")


def stability(package, out, *more):
    return launch(
        "stability", package, "--out", out, "--size", "48x32", "--steps", "6", "--rounds", "2",
        "--context", "none", *more,
    )  # fmt: skip


def rows(out: Path) -> list[list[str]]:
    lines = (out / "stability.csv").read_text().splitlines()
    assert lines[0].startswith("# python3 launch.py stability small.shift --out ")
    assert lines[1].startswith("# small.shift, 100 splats")
    assert lines[2] == ",".join(COLUMNS)
    return list(csv.reader(lines[3:]))


def test_the_command_writes_its_table_and_pictures_and_goes_on(package, tmp_path):
    done = stability(package, tmp_path, "--cases", "counts", "needles")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "" and "all hold" in done.stderr
    first = rows(tmp_path)
    assert {row[0] for row in first} == {"counts", "needles"}
    assert all(row[4] == "holds" and row[5] for row in first)
    for name in ("counts", "needles"):
        with Image.open(tmp_path / f"{name}.png") as picture:
            assert picture.width > 2 * 320
    kept = (tmp_path / "counts.png").stat().st_mtime_ns
    more = stability(package, tmp_path, "--cases", "counts", "crowd")
    assert more.returncode == 0, more.stderr
    assert (tmp_path / "counts.png").stat().st_mtime_ns == kept, "not drawn again"
    again = rows(tmp_path)
    assert {row[0] for row in again} == {"counts", "needles", "crowd"}
    assert [r for r in again if r[0] != "crowd"] == sorted(
        first, key=lambda r: list(CASES).index(r[0])
    )
    assert not list(tmp_path.glob("*.part"))
    how = {"size": (48, 32), "steps": 6, "rounds": 2, "context": "none"}
    found = ss.stability(package, tmp_path, cases=["needles", "counts"], **how)
    assert [list(row.values()) for row in found] == [r for r in again if r[0] != "crowd"]
    assert (tmp_path / "counts.png").stat().st_mtime_ns == kept, "the same rows go on"


def test_a_case_that_fails_gives_exit_code_1_and_is_measured_again(package, tmp_path):
    done = stability(package, tmp_path, "--cases", "sweep")
    assert done.returncode == 1, done.stderr
    assert "FAILED: sweep" in done.stderr
    assert any(row[4] == "FAILS" for row in rows(tmp_path))
    table = open_table(tmp_path, "command", subject_of(tmp_path), False)
    assert "sweep" not in table.rows


def subject_of(out: Path) -> str:
    return (out / "stability.csv").read_text().splitlines()[1].removeprefix("# ")


def test_a_table_of_another_run_is_kept(package, tmp_path):
    stability(package, tmp_path, "--cases", "crowd")
    before = (tmp_path / "stability.csv").read_bytes()
    other = launch("stability", package, "--out", tmp_path, "--size", "32x32", "--cases", "crowd",
                   "--context", "none")  # fmt: skip
    assert_refused(other, "is of another run", "--overwrite")
    assert (tmp_path / "stability.csv").read_bytes() == before
    (tmp_path / "stability.csv").write_text("mine\n")
    assert_refused(stability(package, tmp_path, "--cases", "crowd"), "is of another run")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--cases", "sweeps"), ("there is no case 'sweeps'", "stale-orbit")),
        (("--steps", "5"), ("--steps is 5, expected 6 to 1000",)),
        (("--rounds", "1"), ("--rounds is 1, expected 2 to 1000",)),
        (("--size", "0x3"), ("--size",)),
    ],
)
def test_what_cannot_be_asked_for_is_refused(package, tmp_path, options, words):
    out = tmp_path / "out"
    assert_refused(launch("stability", package, "--out", out, *options), *words)
    assert not out.exists()


def test_interrupted_it_keeps_the_cases_that_are_done(package, tmp_path):
    code = (
        "import sys; from shapeshift.app import cli\n"
        "from shapeshift.app.stability_cases import table\n"
        "def stop(stage): raise KeyboardInterrupt\n"
        "table.CASES['crowd'] = stop\n"
        f"sys.exit(cli.main(['stability', {str(package)!r}, '--out', {str(tmp_path)!r},"
        "'--size', '48x32', '--steps', '6', '--rounds', '2', '--context', 'none',"
        "'--cases', 'counts', 'crowd']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, timeout=120
    )
    assert done.returncode == 130 and "Interrupted." in done.stderr
    lines = (tmp_path / "stability.csv").read_text().splitlines()
    assert {row[0] for row in csv.reader(lines[3:])} == {"counts"}
