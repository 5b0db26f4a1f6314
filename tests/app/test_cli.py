"""The command table: what is chosen, what is refused, and that nobody sees a traceback."""

import importlib
from pathlib import Path

import pytest

from shapeshift.app import cli
from shapeshift.app.command_line import arguments_of
from shapeshift.runtime_models.model import BadFile
from tests.support.program import ROOT, assert_refused, launch


def test_no_command_without_a_display_is_headless(monkeypatch):
    monkeypatch.setattr(cli, "has_display", lambda: False)
    assert cli.choose([]) == ("headless", [])
    monkeypatch.setattr(cli, "has_display", lambda: True)
    assert cli.choose([]) == ("view", [])


def test_a_file_alone_is_opened_in_the_viewer():
    assert cli.choose(["scene.shift", "--x", "1"]) == ("view", ["scene.shift", "--x", "1"])
    assert cli.choose(["bench", "scene.shift"]) == ("bench", ["scene.shift"])


def test_every_command_is_there_and_has_help():
    for name, (module, _) in cli.COMMANDS.items():
        assert (ROOT / "app" / f"{module.replace('.', '/')}.py").exists(), name
        done = launch(name, "--help")
        assert done.returncode == 0, done.stderr
        assert "usage" in done.stdout.lower()


def test_json_is_a_switch_of_every_command_that_has_it(capsys):
    """A file after it is refused with the spelling that writes one, before anything is opened."""
    kinds = {name: importlib.import_module(f"shapeshift.app.{m}").Options
             for name, (m, _) in cli.COMMANDS.items()}  # fmt: skip
    found = {name: {a.name: a for a in arguments_of(kind)} for name, kind in kinds.items()}
    having = {name: known for name, known in found.items() if "--json" in known}
    assert {"bench", "eval", "fit", "info", "lint", "measure", "poses"} <= having.keys()
    for name, known in having.items():
        assert known["--json"].kind is bool, name
        alone = [a for a in known.values() if a.opt.positional]
        words = [name, *("a.shift" for _ in alone)]
        assert cli.main([*words, "--json=b.json"]) == 2
        told = capsys.readouterr()
        assert f"{name} ... --json > b.json` for a file" in told.err and told.out == ""
        if not any(a.many for a in alone):
            assert cli.main([*words, "--json", "b.json"]) == 2
            assert capsys.readouterr() == told


def test_help_names_every_command():
    text = launch("--help").stdout
    assert all(name in text for name in cli.COMMANDS)


def test_unknown_command_is_one_sentence():
    assert_refused(launch("rendre"), "'rendre' is neither a command nor a file")


@pytest.mark.parametrize("command", ["info", "render", "bench"])
def test_missing_scene_is_one_sentence(command, tmp_path):
    extra = {"render": ["--out", tmp_path / "out"], "bench": []}.get(command, [])
    assert_refused(launch(command, tmp_path / "nothing.shift", *extra), "nothing.shift")


def test_missing_capture_is_one_sentence(tmp_path):
    assert_refused(launch("train", tmp_path / "nothing", "--out", tmp_path / "a.shift"), "nothing")
    assert not (tmp_path / "a.shift").exists()


def fail_with(monkeypatch, error):
    def run_command(command, arguments):
        raise error

    monkeypatch.setattr(cli, "run_command", run_command)


def test_bad_file_is_exit_2_and_its_sentence(monkeypatch, capsys):
    fail_with(monkeypatch, BadFile("found this, wanted that"))
    assert cli.main(["info", "x"]) == 2
    assert capsys.readouterr().err == "shapeshift info: found this, wanted that.\n"


def test_interrupt_is_exit_130(monkeypatch, capsys):
    fail_with(monkeypatch, KeyboardInterrupt())
    assert cli.main(["info", "x"]) == 130
    assert capsys.readouterr().err == "Interrupted.\n"


def test_a_fault_of_ours_is_one_sentence_and_a_log(monkeypatch, capsys):
    fail_with(monkeypatch, ZeroDivisionError("division by zero"))
    assert cli.main(["info", "x"]) == 3
    text = capsys.readouterr().err
    assert "division by zero" in text and "Traceback" not in text
    log = Path(text.rsplit(" in ", 1)[1].strip().rstrip("."))
    assert "ZeroDivisionError" in log.read_text()
    log.unlink()


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 3.00 GiB"),
        MemoryError(),
        ImportError("libscipy.so: failed to map segment from shared object"),
        RuntimeError("can't start new thread"),
    ],
)
def test_no_room_is_no_fault_of_ours(monkeypatch, capsys, error):
    fail_with(monkeypatch, error)
    assert cli.main(["info", "x"]) == 2
    text = capsys.readouterr().err
    assert text.startswith("shapeshift info: this process got no more memory")
    assert str(error) in text and "ulimit -v" in text and text.count("\n") == 1


def test_a_display_that_gives_no_window_means_headless(monkeypatch, capsys):
    from shapeshift.renderer.gl.context import NoContext

    asked = []

    def run_command(command, arguments):
        asked.append(command)
        if command == "view":
            raise NoContext("the display :9 does not answer.")
        return 0

    monkeypatch.setattr(cli, "run_command", run_command)
    monkeypatch.setattr(cli, "has_display", lambda: True)
    assert cli.main([]) == 0
    assert asked == ["view", "headless"]
    assert "does not answer" in capsys.readouterr().err
    assert cli.main(["view"]) == 2  # a window that was asked for is not replaced by pictures


def test_a_folder_that_is_gone_under_ones_feet_is_said(tmp_path, monkeypatch, capsys):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()

    def run_command(command: str, arguments: list[str]) -> int:
        return len(str(Path("scene.shift").resolve()))

    monkeypatch.setattr(cli, "run_command", run_command)
    assert cli.main(["info", "--json"]) == 2
    assert "info: the folder that this was started in is gone" in capsys.readouterr().err
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "run_command", lambda *_: open("not there"))
    assert cli.main(["info", "--json"]) == 2
    assert capsys.readouterr().err.rstrip().endswith("No such file or directory: not there")
