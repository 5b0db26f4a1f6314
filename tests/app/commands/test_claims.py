"""One command at a time writes an --out."""

import subprocess
import sys
from pathlib import Path

import pytest

from shapeshift.app import cli
from shapeshift.app.commands.claims import claimed, lock_of
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.files.user_cache import cache_folder

ROOT = Path(__file__).resolve().parents[3]
HOLD = """
import sys
from pathlib import Path
from shapeshift.app.commands.claims import claimed
with claimed(Path(sys.argv[1]), "train"):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def caches(tmp_path, monkeypatch):
    """Locks of others who run now are not these."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))
    (tmp_path / "cache").mkdir(0o700)


@pytest.fixture
def owner(tmp_path):
    """Another process that writes tmp_path/a.shift until its input ends."""
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "a.shift")], cwd=ROOT,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    assert child.stdout.readline() == b"held\n"
    yield child
    child.kill()
    child.communicate()


def locks() -> list[Path]:
    return list(cache_folder("running").iterdir())


def test_the_second_is_refused_until_the_first_has_ended(owner, tmp_path, capsys):
    out = tmp_path / "a.shift"
    (tmp_path / "link").symlink_to(tmp_path)
    for same in (out, tmp_path / "link" / "a.shift", tmp_path / "." / "a.shift"):
        with pytest.raises(UsageError, match=rf"\(train, process {owner.pid}\); wait until"):
            with claimed(same, "film"):
                pass
    with claimed(tmp_path / "b.shift", "film"):
        pass
    assert cli.main(["train", str(tmp_path), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"shapeshift train: {out} is being written by another start")
    owner.kill()  # no lock is stale
    owner.wait()
    with claimed(out, "train"):
        assert len(locks()) == 1
        with pytest.raises(UsageError):
            lock_of(out)
    assert not locks()


def test_parts_and_tasks_share_what_their_command_has(owner, tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPESHIFT_TASK", "1")
    with claimed(tmp_path / "a.shift", "train"):
        pass


def test_a_lock_whose_name_was_taken_away_is_none(tmp_path, monkeypatch):
    """Between opening and locking, its owner ended and removed it."""
    from shapeshift.app.commands import claims

    real, seen = claims.try_lock, []

    def lock(descriptor):
        if not seen:
            locks()[0].unlink()
        seen.append(descriptor)
        return real(descriptor)

    monkeypatch.setattr(claims, "try_lock", lock)
    with claimed(tmp_path / "a", "train"):
        assert len(seen) == 2 and len(locks()) == 1


def test_no_cache_at_all_is_no_reason_to_refuse(tmp_path, monkeypatch):
    def refuse(name):
        raise OSError(28, "No space left on device", name)

    monkeypatch.setattr("shapeshift.app.commands.claims.cache_folder", refuse)
    with claimed(tmp_path / "a", "train"), claimed(tmp_path / "a", "train"):
        assert not list(tmp_path.glob("a*")), "nor is a lock put beside what is written"
