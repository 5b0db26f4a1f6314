"""pytest --changed: which tests a change reaches, in what order, and what a minute leaves out."""

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from tests.support.selection import changed, facts, reaching

TREE = {
    ".gitignore": ".pytest_cache/",
    "shapeshift/__init__.py": "_NAMES_OF = {'api.take': ('load',), 'api.give': ('export',)}",
    "shapeshift/__main__.py": "from shapeshift.app.words import main",
    "shapeshift/api/take.py": "from shapeshift.scene.stand import Pose",
    "shapeshift/api/give.py": "",
    "app/words.py": "COMMANDS = {'tell': ('commands.tell', 'what is in it')}",
    "app/commands/tell.py": "def run():\n    from shapeshift.scene.stand import Pose",
    "app/sheet.py": "WEB = ROOT / 'web'\nMODULES = ('turns', 'renderer/rows')\nPAGE = 'first.html'",
    "scene/__init__.py": "",
    "scene/stand.py": "",
    "scene/typed.py": "if TYPE_CHECKING:\n    from shapeshift.scene.stand import Pose",
    "scene/door.py": "DOOR = f'{PLACE}.runs.arrays_run:arrays'",
    "scene/runs/arrays_run.py": "",
    "rasterizer/draw_it.py": "KERNEL = KERNELS / 'draw_it.cl'",
    "rasterizer/sums.py": "for name in ('sum_up',):\n    KERNELS / f'{name}.cl'",
    "rasterizer/kernels/draw_it.cl": '#include "common/shared.cl"\n',
    "rasterizer/kernels/sum_up.cl": "",
    "rasterizer/kernels/common/shared.cl": "",
    "training/go.py": "KERNEL = KERNELS / 'draw_it.cl'",
    "training/kernels/draw_it.cl": "",
    "web/first.html": '<script src="all.js"></script>',
    "web/all.js": 'import { a } from "./renderer/rows.js";\n',
    "web/turns.js": "",
    "web/renderer/rows.js": 'import { b } from "../turns.js";\n',
    "tests/conftest.py": (
        "@pytest.fixture\ndef draw_it():\n    import shapeshift.rasterizer.draw_it\n"
        "@pytest.fixture\ndef drawn(draw_it):\n    pass\n"
        "@pytest.fixture(autouse=True)\ndef door():\n    import shapeshift.scene.door\n"
    ),
    "tests/app/test_tell.py": "from shapeshift.app.commands.tell import run",
    "tests/app/test_program.py": "run([sys.executable, '-m', 'shapeshift', 'tell'])",
    "tests/app/test_sheet.py": "from shapeshift.app import sheet",
    "tests/scene/test_stand.py": "from shapeshift.scene import stand, typed",
    "tests/scene/test_typed.py": "import shapeshift.scene.typed",
    "tests/test_library.py": "import shapeshift as ss\nss.load('a')",
    "tests/test_export.py": "from shapeshift import export",
    "tests/test_drawn.py": "def test_one(drawn):\n    pass",
    "tests/test_asked.py": "def test_one(request):\n    request.getfixturevalue('draw_it')",
    "tests/test_step.py": "def test_one():\n    from shapeshift.training.go import go",
    "tests/test_sums.py": "import shapeshift.rasterizer.sums",
    "tests/test_broken.py": "def (",
    "docs/none.md": "",
    "tests/test_docs.py": "PAGE = ROOT / 'docs/none.md'",
}


@pytest.fixture(scope="module")
def used() -> reaching.UsedFiles:
    return reaching.UsedFiles({path: facts.read_facts(path, text) for path, text in TREE.items()})


@pytest.mark.parametrize(
    ("path", "wanted"),
    [
        # Also by an import in a function, by a name of the library, by -m; not for types alone.
        ("scene/stand.py", {"scene/test_stand": 1, "app/test_tell": 2, "test_library": 2,
                           "app/test_program": 4}),
        ("app/commands/tell.py", {"app/test_tell": 1, "app/test_program": 3}),
        ("scene/typed.py", {"scene/test_stand": 1, "scene/test_typed": 1}),
        ("shapeshift/api/give.py", {"test_export": 1}),
        # By includes; of two kernels of a name that of the folder's own; by a name in two parts.
        ("rasterizer/kernels/common/shared.cl", {"test_asked": 3, "test_drawn": 3}),
        ("rasterizer/kernels/draw_it.cl", {"test_asked": 2, "test_drawn": 2}),
        ("training/kernels/draw_it.cl", {"test_step": 2}),
        ("rasterizer/kernels/sum_up.cl", {"test_sums": 2}),
        ("web/renderer/rows.js", {"app/test_sheet": 4}),
        ("web/turns.js", {"app/test_sheet": 5}),
        ("tests/scene/test_typed.py", {"scene/test_typed": 0}),
        ("docs/none.md", {"test_docs": 1}),
        ("no/such.py", {}),
    ],
)  # fmt: skip
def test_what_a_change_reaches_and_how_far_off_it_is(used, path, wanted):
    found = reaching.reached_tests(used, [path])
    assert {each.test: each.distance for each in found} == {
        f"tests/{name}.py": distance for name, distance in wanted.items()
    }
    assert [each.distance for each in found] == sorted(wanted.values())
    assert all(each.way[0] == each.test and each.way[-1] == path for each in found)


def test_what_all_tests_use_reaches_all(used):
    tests = {path for path in TREE if reaching.is_test(path)}
    for path, distance in (("tests/conftest.py", 1), ("scene/runs/arrays_run.py", 2)):
        found = reaching.reached_tests(used, [path])
        assert {each.test for each in found} == tests
        assert {each.distance for each in found} == {distance}


def test_of_equally_near_ones_that_of_the_same_name_comes_first(used):
    found = reaching.reached_tests(used, ["scene/typed.py"])
    assert [each.test for each in found] == [
        "tests/scene/test_typed.py",
        "tests/scene/test_stand.py",
    ]


def test_what_was_read_is_kept_until_the_file_is_another(tmp_path):
    file, kept = tmp_path / "a.py", {}
    file.write_text("import one.two")
    assert facts.facts_of(tmp_path, "a.py", kept)["imports"] == ["one.two"]
    kept["a.py"][2]["imports"] = ["kept"]
    assert facts.facts_of(tmp_path, "a.py", kept)["imports"] == ["kept"]
    file.write_text("import one.two.three")
    assert facts.facts_of(tmp_path, "a.py", kept)["imports"] == ["one.two.three"]
    file.unlink()
    assert facts.facts_of(tmp_path, "a.py", kept) == {}
    for text in ("", "{", "[]", '{"form": 0, "files": {}}'):
        file.write_text(text)
        assert facts.load_kept(file) == {}


@pytest.fixture
def checkout(tmp_path) -> Path:
    """With git, and all of TREE committed."""
    for path, text in TREE.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    who = ["-c", "user.name=A", "-c", "user.email=a@b"]
    for words in (["init", "-q"], ["add", "."], [*who, "commit", "-q", "-m", "all"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True)
    return tmp_path


def config_of(root: Path, **options) -> Any:
    wanted = {"--changed": "HEAD", "--minutes": 1.0} | options
    return SimpleNamespace(
        getoption=wanted.get, args=["tests"], args_source=pytest.Config.ArgsSource.TESTPATHS,
        invocation_params=SimpleNamespace(dir=root),
    )  # fmt: skip


def test_edited_new_and_deleted_files_choose_the_tests(checkout):
    config = config_of(checkout)
    run = changed.Changed(config, checkout, 0.0)
    assert config.args == [] and run.sentence() == "nothing differs from HEAD."
    (checkout / "scene/runs/arrays_run.py").unlink()
    (checkout / "scene/typed.py").write_text("import os")
    (checkout / "tests/test_new one.py").write_text("")
    run = changed.Changed(config, checkout, 0.0)
    assert run.changed == ["scene/runs/arrays_run.py", "scene/typed.py", "tests/test_new one.py"]
    assert config.args[:2] == [
        str(checkout / "tests/test_new one.py"), str(checkout / "tests/scene/test_typed.py"),
    ]  # fmt: skip
    assert "the nearest first: tests/test_new one.py" in run.sentence()
    config.args[:], config.args_source = ["tests/scene"], pytest.Config.ArgsSource.ARGS
    changed.Changed(config, checkout, 0.0)
    assert config.args == [
        str(checkout / f"tests/scene/test_{name}.py") for name in ("typed", "stand")
    ]


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"--minutes": 0.0}, "--minutes is 0"),
        ({"--minutes": float("nan")}, "--minutes is nan"),
        ({"--changed": "tests/scene"}, "A revision is wanted"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(checkout, options, word):
    with pytest.raises(pytest.UsageError, match=word):
        changed.Changed(config_of(checkout, **options), checkout, 0.0)


def test_after_its_time_no_test_begins_and_what_is_left_is_said(checkout, monkeypatch):
    (checkout / "scene/stand.py").write_text("import os")
    run = changed.Changed(config_of(checkout), checkout, 100.0)
    item: Any = SimpleNamespace(path=checkout / "tests/scene/test_stand.py")
    module = Mock(spec=pytest.Module, nodeid="tests/scene/test_typed.py")
    assert run.pytest_make_collect_report(module) is None  # of one file at least
    run.loaded = 1
    for seconds, loads, begins in ((100.0, True, True), (124.0, True, True), (124.1, False, True),
                                   (142.0, False, True), (142.1, False, False)):  # fmt: skip
        monkeypatch.setattr(changed.time, "monotonic", lambda seconds=seconds: seconds)
        assert (run.pytest_runtest_protocol(item) is None) == begins
        if seconds < 142:
            assert (run.pytest_make_collect_report(module) is None) == loads
    monkeypatch.setattr(changed.time, "monotonic", lambda: 100.0)
    run.loaded = changed.LOADED - 1
    assert run.pytest_make_collect_report(module) is None
    run.pytest_itemcollected()
    report = run.pytest_make_collect_report(module)
    assert report is not None and report.result == [] and run.unread == 2
    assert run.left == [item]
    assert run.left_out().startswith("--changed: 3 of 4 files, the farthest ones, were left out")
    assert "--changed=HEAD --minutes=10" in run.left_out()


def test_on_a_slow_machine_the_nearest_run_for_a_while_all_the_same(checkout, monkeypatch):
    run = changed.Changed(config_of(checkout), checkout, 0.0)
    timers: list[float] = []
    monkeypatch.setattr(changed.signal, "signal", lambda *_: None)
    monkeypatch.setattr(changed.signal, "setitimer", lambda _, seconds: timers.append(seconds))
    assert run.until == 42
    for seconds, until, end in ((10.0, 42.0, 55.2), (30.0, 42.0, 55.2), (30.5, 42.5, 55.2),
                                (100.0, 112.0, 112.0)):  # fmt: skip
        monkeypatch.setattr(changed.time, "monotonic", lambda seconds=seconds: seconds)
        run.pytest_collection_finish()
        assert (run.until, run.end) == pytest.approx((until, end))
        assert timers[-1] == pytest.approx(end - seconds) or not hasattr(changed.signal, "SIGALRM")


def test_what_runs_when_its_time_is_over_is_skipped_and_nothing_else_is(checkout):
    run = changed.Changed(config_of(checkout), checkout, 0.0)
    run.break_off()  # while nothing runs
    test = run.pytest_runtest_call()
    next(test)
    with pytest.raises(pytest.skip.Exception, match="its time was over"):
        run.break_off()
    with pytest.raises(StopIteration):
        test.send(None)
    run.break_off()


def test_windows_come_before_all_others_or_not_at_all():
    """Mesa's GLX ends the process where EGL was up before."""

    def at(name: str, distance: int) -> reaching.Reached:
        return reaching.Reached(f"tests/{name}.py", ("",) * (distance + 1))

    near, far, window = at("test_a", 1), at("test_b", 3), at("test_desktop_a", 0)
    assert changed.apart([near, window, far]) == ([window, near, far], [])
    window = at("test_desktop_a", 1)
    assert changed.apart([near, window, far]) == ([near, far], [window])
    assert changed.apart([window]) == ([window], [])
    assert changed.apart([]) == ([], [])
