"""Tasks on this machine: done once, resumed, refused, interrupted, and alone."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from shapeshift.app.cluster import run_task as running
from shapeshift.app.cluster import task as task_module
from shapeshift.app.cluster.open_cluster import open_cluster
from shapeshift.app.cluster.run_task import TaskFailed, TaskStopped, progress_words, run_task
from shapeshift.app.cluster.task import Task
from shapeshift.app.errors import UsageError
from tests.support.cluster.counting import COUNT, STAND_IN, counting_task, lives, pids

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def counting(tmp_path, monkeypatch):
    """A task that writes N letters, with a checkpoint after each."""
    monkeypatch.setattr(running, "START", STAND_IN)

    def task(name: str = "count", letters: int = 3) -> Task:
        return counting_task(tmp_path, name, letters)

    return task


def run_heard(task: Task, **more) -> list[str]:
    heard: list[str] = []
    run_task(task, task.key(), heard.append, **more)
    return heard


def test_what_is_done_is_not_done_again(counting):
    task = counting()
    assert run_heard(task) == ["from 0"] and Path(task.writes[0]).read_text() == "xxx"
    assert json.loads(task.done_note.read_text()) == {"task": "count", "key": task.key()}
    assert not task.begun_note.exists()
    assert run_heard(task) == []  # nothing was started
    # Other words, other input, a result that is gone: each is done anew, from the start.
    assert run_heard(counting(letters=4)) == ["from 0"]
    Path(task.reads[0]).write_text(COUNT + "\n")
    assert run_heard(counting(letters=4)) == ["from 0"]
    Path(task.writes[0]).unlink()
    assert run_heard(counting(letters=4)) == ["from 0"]
    task.done_note.write_text("{")
    assert run_heard(counting(letters=4)) == ["from 0"]


def test_a_key_is_of_words_and_bytes_and_of_no_place(tmp_path):
    def task(folder: str, byte: bytes = b"a", word: str = "8") -> Task:
        place = tmp_path / folder
        (place / "in").mkdir(parents=True, exist_ok=True)
        (place / "in" / "photo").write_bytes(byte)
        read, write = str(place / "in"), str(place / "out")
        return Task(
            folder, ("train", read, "--out", write, "--iterations", word), (read,), (write,)
        )

    key = task("one").key()
    assert re.fullmatch("[0-9a-f]{64}", key) and task("two").key() == key
    assert len({key, task("two", word="9").key(), task("two", b"bc").key()}) == 3
    (tmp_path / "one" / "in" / "more").write_bytes(b"")
    assert Task("one", task("one").argv, task("one").reads, task("one").writes).key() != key


@pytest.fixture
def other_code(tmp_path, monkeypatch):
    """A program of two files, instead of this one."""
    root = tmp_path / "code"
    (root / "app").mkdir(parents=True)
    (root / "app" / "__init__.py").write_text("")
    (root / "app" / "draw.cl").write_text("1")
    monkeypatch.setattr(task_module, "ROOT", root)
    task_module.own_code.cache_clear()
    yield root
    task_module.own_code.cache_clear()


def test_a_digest_of_code_is_of_all_its_files_and_of_nothing_else(other_code):
    first = task_module.code_digest()
    (other_code / "app" / "draw.pyc").write_text("1")
    (other_code / "notes").mkdir()
    (other_code / "notes" / "mine.py").write_text("1")  # in no package
    assert task_module.code_digest() == first
    seen = {first}
    (other_code / "app" / "draw.cl").write_text("2")
    seen.add(task_module.code_digest())
    (other_code / "app" / "draw.cl").rename(other_code / "app" / "drawn.cl")
    seen.add(task_module.code_digest())
    (other_code / "app" / "more").mkdir()
    (other_code / "app" / "more" / "new.py").write_text("")
    seen.add(task_module.code_digest())
    assert len(seen) == 4


def test_what_other_code_has_done_is_done_anew(counting, other_code):
    task, code = counting(letters=30), other_code / "app" / "draw.cl"
    assert run_heard(task) == ["from 0"] and run_heard(task) == []
    code.write_text("another")
    task_module.own_code.cache_clear()  # a later start of the program
    assert run_heard(task) == ["from 0"] and run_heard(task) == []
    # Changed since the command began, or on a worker's machine: refused before it starts.
    key = task.key()
    Path(task.writes[0]).unlink()
    code.write_text("a third")
    with pytest.raises(TaskFailed, match=r"count: the program's code on .* is another than"):
        run_task(task, key, print)
    assert not Path(task.writes[0]).exists()
    # Changed while it runs: what it wrote is there, yet no later start takes it for done.
    task_module.own_code.cache_clear()
    heard: list[str] = []

    def hear(line: str) -> None:
        heard.append(line)
        code.write_text("a fourth")

    run_task(task, task.key(), hear)
    assert heard[0] == "from 0" and "does it anew" in heard[1] and Path(task.writes[0]).exists()
    task_module.own_code.cache_clear()
    assert run_heard(task) == ["from 0"]  # nor is the checkpoint of the old code gone on from


@pytest.mark.parametrize("wrong", [{"argv": ()}, {"writes": ()}, {"writes": ("a",)}, {"name": ""},
                                   {"reads": ("a",)}, {"checkpoint": "a"}])  # fmt: skip
def test_tasks_without_a_place_of_their_own_are_refused(wrong):
    whole = {"name": "a", "argv": ("info",), "reads": (), "writes": ("/a",)}
    Task(**whole)
    with pytest.raises(ValueError):
        Task(**(whole | wrong))


def test_tasks_that_share_a_name_or_a_file_are_refused(counting):
    with open_cluster() as cluster, pytest.raises(ValueError, match="two tasks have one name"):
        cluster.run([counting(), counting(letters=4)])
    one = counting()
    other = Task("other", one.argv, one.reads, one.writes)
    with open_cluster() as cluster, pytest.raises(ValueError, match="one file to write"):
        cluster.run([one, other])


def test_one_that_fails_says_its_sentence_and_the_others_are_done(tmp_path, counting):
    missing = Task("sad", ("x.py",), (), (str(tmp_path / "sad"),))
    never = counting("never")
    Path(never.reads[0]).write_text(COUNT.replace('open(out, "w")', 'open(out + "y", "w")'))
    with open_cluster() as cluster, pytest.raises(TaskFailed) as caught:
        cluster.run([missing, never])
    assert re.match(r"sad: ended with code 1; its last words: .*x\.py", str(caught.value))
    assert "(2 of 2 tasks failed.)" in str(caught.value)
    with pytest.raises(TaskFailed, match=r"ended well, yet .*never.txt is not there"):
        run_heard(never)
    assert isinstance(caught.value, UsageError)  # what the command line prints as one line


def test_a_real_command_that_refuses_is_quoted(tmp_path):
    out = str(tmp_path / "x.ply")
    task = Task("export", ("export", str(tmp_path / "no.ply"), "--out", out), (), (out,))
    with pytest.raises(TaskFailed) as caught:
        run_heard(task)
    assert str(caught.value).startswith("export: ") and "no.ply" in str(caught.value)
    assert "shapeshift" not in str(caught.value).replace(str(tmp_path), "")


def test_one_that_is_not_wanted_any_more_ends_and_goes_on_later(counting):
    task, began = counting(letters=100), threading.Event()
    heard: list[str] = []

    def hear(line: str) -> None:
        heard.append(line)
        while not Path(task.checkpoint).exists():
            time.sleep(0.01)
        began.set()

    with pytest.raises(TaskStopped):
        run_task(task, task.key(), hear, lambda: not began.is_set())
    assert heard == ["from 0", "kept"] and not Path(task.writes[0]).exists()
    assert not lives(pids(task)[0])
    there = int(Path(task.checkpoint).read_text())
    assert run_heard(task) == [f"from {there}"] and there > 0
    assert Path(task.writes[0]).read_text() == "x" * 100
    # A checkpoint of other words is none of this task's.
    with pytest.raises(TaskStopped):
        began.clear()
        other = counting(letters=101)
        run_task(other, other.key(), hear, lambda: not began.is_set())
    assert run_heard(counting(letters=102)) == ["from 0"]


PARENT = """
import sys
sys.path.insert(0, {root!r})
from shapeshift.app.cluster import run_task as running
from shapeshift.app.cluster.open_cluster import open_cluster
from shapeshift.app.cluster.task import Task
running.START = {start!r}
with open_cluster() as cluster:
    cluster.run([Task(**{task!r})])
"""


def parent_of(task: Task) -> subprocess.Popen:
    """Another process that runs the task, once the task counts."""
    text = PARENT.format(root=str(ROOT), start=STAND_IN, task=vars(task))
    child = subprocess.Popen([sys.executable, "-c", text], stderr=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while not Path(task.checkpoint).exists() and time.monotonic() < until:
        time.sleep(0.02)
    return child


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize(
    "how", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGKILL]
)
def test_nothing_lives_on_when_who_started_it_is_ended(counting, how):
    """Ctrl-C to the program, and kill -9: the task hears of either, keeps its work and ends."""
    task = counting(letters=400)
    parent = parent_of(task)
    parent.send_signal(how)
    assert parent.wait(60) in (-how, 130)
    # While the old attempt saves, the next one waits for it.
    heard = run_heard(task)
    assert not lives(pids(task)[0])
    (again,) = [line for line in heard if line.startswith("from ")]
    assert 0 < int(again.removeprefix("from ")) < 400
    assert Path(task.writes[0]).read_text() == "x" * 400


def test_progress_is_told_from_sentences():
    assert progress_words("train: 300 steps, 40 % (2 min)", "train") == "300 steps, 40 %"
    assert progress_words("train: a (b) (12 min)", "train") == "a (b)"
    for line in ("train: done", "lod: at work (0 min)", "", " (1 min)"):
        assert progress_words(line, "train") is None


def test_what_is_there_is_none():
    with pytest.raises(UsageError, match="--cluster is 'moon', expected none"):
        with open_cluster("moon"):
            pass
