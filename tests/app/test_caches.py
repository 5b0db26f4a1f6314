"""Caches: in the user's folder for them, elsewhere where that cannot be written, said once."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from shapeshift.app import caches
from shapeshift.runtime_models.files.user_cache import cache_base, cache_folder

ROOT = Path(__file__).resolve().parents[2]
posix = pytest.mark.skipif(os.name == "nt", reason="rights and links of POSIX")
LIBRARIES = ("POCL_CACHE_DIR", "MPLCONFIGDIR")


@pytest.fixture(autouse=True)
def environment(tmp_path, monkeypatch):
    """A home and a folder for temporary files of this test's own."""
    for name in LIBRARIES:
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr("tempfile.tempdir", None)
    yield
    monkeypatch.setattr("tempfile.tempdir", None)


@posix
@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_each_platform_has_its_place(tmp_path, monkeypatch, platform):
    monkeypatch.setattr("shapeshift.runtime_models.files.user_cache.sys.platform", platform)
    usual = {"linux": ".cache", "darwin": "Library/Caches"}[platform]
    for named in ("", "relative/path"):  # the XDG rule: a relative one counts as unset
        monkeypatch.setenv("XDG_CACHE_HOME", named)
        assert cache_base() == tmp_path / "home" / usual
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    assert cache_base() == tmp_path / "own"


def test_windows_has_its_place(tmp_path, monkeypatch):
    monkeypatch.setattr("shapeshift.runtime_models.files.user_cache.sys.platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert cache_base() == tmp_path / "local"


@posix
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702, 0o755, 0o700])
@pytest.mark.parametrize("name", ["", "pocl"])
def test_folders_that_others_may_write_are_not_used(tmp_path, capsys, mode, name):
    """Kernels in it are run: who could have put them there matters, who may read them does not."""
    ours = tmp_path / "home" / ".cache" / "shapeshift"
    (ours / "pocl").mkdir(parents=True)
    (ours / name).chmod(mode)
    caches.settle_caches()
    said, usable = capsys.readouterr().err, not mode & 0o022
    assert usable == Path(os.environ["POCL_CACHE_DIR"]).is_relative_to(ours)
    assert ("others may write in it" in said) != usable
    assert len(said.splitlines()) <= 1 or not usable


@posix
def test_folders_of_another_user_are_not_used(tmp_path, capsys, monkeypatch):
    (tmp_path / "home" / ".cache" / "shapeshift" / "pocl").mkdir(parents=True)
    user = os.getuid()
    monkeypatch.setattr("shapeshift.runtime_models.files.user_cache.os.getuid", lambda: user + 1)
    with pytest.raises(OSError, match="another user's"):
        cache_folder("pocl")


@posix
def test_libraries_are_told_and_nothing_is_said(tmp_path, capsys):
    caches.settle_caches()
    ours = tmp_path / "home" / ".cache" / "shapeshift"
    assert os.environ["POCL_CACHE_DIR"] == str(ours / "pocl")
    assert os.environ["MPLCONFIGDIR"] == str(ours / "matplotlib")
    assert {path.name for path in ours.iterdir()} == {"pocl", "matplotlib"}
    assert capsys.readouterr().err == ""


@posix
def test_a_place_that_was_chosen_stays(tmp_path, monkeypatch):
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path / "mine"))
    caches.settle_caches()
    assert os.environ["POCL_CACHE_DIR"] == str(tmp_path / "mine")


@posix
@pytest.mark.parametrize("why", ["a file", "a link"])
def test_another_place_is_taken_and_said_once(tmp_path, capsys, why):
    home = tmp_path / "home"
    if why == "a file":
        home.write_text("")
    else:
        (home / ".cache").mkdir(parents=True)
        (tmp_path / "victim").mkdir()
        (home / ".cache" / "shapeshift").symlink_to(tmp_path / "victim")
    caches.settle_caches()
    (line,) = capsys.readouterr().err.splitlines()
    assert str(home / ".cache") in line and str(tmp_path / "temporary") in line
    stand_in = tmp_path / "temporary" / f"shapeshift-{os.getuid()}"
    assert cache_folder("colliders") == stand_in / "shapeshift" / "colliders"
    assert stand_in.stat().st_mode & 0o777 == 0o700
    if why == "a link":
        assert not any((tmp_path / "victim").iterdir())


@posix
@pytest.mark.parametrize("trap", ["open to all", "a link", "a file", "of somebody else"])
def test_a_place_that_others_can_fill_is_not_taken(tmp_path, trap):
    """Kernels are run from it: in a folder for everybody's temporary files anyone may be first."""
    path = tmp_path / "temporary" / f"shapeshift-{os.getuid()}"
    if trap == "a link":
        (tmp_path / "victim").mkdir(0o700)
        path.symlink_to(tmp_path / "victim")
    elif trap == "a file":
        path.touch()
    else:
        path.mkdir(0o777 if trap == "open to all" else 0o700)
        path.chmod(0o777 if trap == "open to all" else 0o700)
    if trap == "of somebody else":
        if os.geteuid() != 0:
            pytest.skip("only root gives folders away")
        os.chown(path, 4321, 4321)
    found = caches.stand_in()
    assert found != path and found.parent == path.parent and caches.is_own(found)


@posix
def test_our_own_stand_in_is_taken_again():
    assert caches.stand_in() == caches.stand_in()


@posix
@pytest.mark.skipif(not Path("/proc/self/mountinfo").exists(), reason="needs Linux's namespaces")
@pytest.mark.parametrize("kind", ["read-only", pytest.param("full", marks=pytest.mark.slow)])
def test_pictures_are_drawn_whatever_the_home_is(tmp_path, kind):
    """A real file system that takes nothing, in a name space of its own."""
    home, out = tmp_path / "small", tmp_path / "out"
    home.mkdir()
    size = "64k" if kind == "full" else "1m"
    then = f"dd if=/dev/zero of={home}/fill 2>/dev/null;" if kind == "full" else \
        f"mount -o remount,ro {home};"  # fmt: skip
    draw = f"{sys.executable} -P {ROOT}/shapeshift/__main__.py render {ROOT}/assets/workshop.shift"
    script = (
        f"mount -t tmpfs -o size={size} tmpfs {home} && {{ {then} "
        f"HOME={home} exec {draw} --size 32x24 --out {out}; }}"
    )
    done = subprocess.run(
        ["unshare", "--mount", "--map-root-user", "sh", "-c", script],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    if "unshare:" in done.stderr or "mount:" in done.stderr:
        pytest.skip("no name spaces here")
    assert done.returncode == 0, done.stderr
    first, *rest = done.stderr.splitlines()
    reason = "Read-only file system" if kind == "read-only" else "No space left on device"
    assert f"{home}/.cache, cannot be used ({reason})" in first
    assert rest == [f"1 picture in {out}"]
    assert len(list(out.glob("*.png"))) == 1


def test_networks_are_run_without_a_word_to_their_makers(tmp_path):
    """onnxruntime 1.31 writes an identifier into the home and reports sessions unless told."""
    code = (
        "import sys; from tests.support.models import make_random_model\n"
        "from shapeshift.runtime_models.package.package_files import write_onnx\n"
        "from shapeshift.runtime_models.session import open_session\n"
        "open_session(write_onnx(make_random_model(3).networks['color'], 'color'), 1)\n"
    )
    home = {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    env = {k: v for k, v in os.environ.items() if k != "ORT_DISABLE_TELEMETRY"} | home
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    assert not any(tmp_path.rglob("*onnxruntime*"))


# A cache that somebody has damaged

START = """
import os, signal, sys
from shapeshift.app import caches
caches.settle_caches()
caches.note_start()
if "abort" in {end!r}:  # the compiler in a device's driver takes signals over
    from shapeshift.rasterizer.device import open_device
    open_device()
print("ready", flush=True)
{end}
"""


def start(end: str) -> subprocess.Popen:
    """Another start of the program, which ends so."""
    child = subprocess.Popen(
        [sys.executable, "-c", START.format(end=end)], cwd=ROOT, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert child.stdout.readline() == "ready\n", child.communicate()[1]
    return child


@posix
@pytest.mark.parametrize(
    ("end", "anew"),
    [("os.abort()", True), ("os.kill(os.getpid(), signal.SIGSEGV)", True),
     ("os.kill(os.getpid(), signal.SIGKILL)", False), ("sys.exit(3)", False), ("", False)],
)  # fmt: skip
def test_after_a_start_that_a_library_ended_kernels_are_compiled_anew(capsys, end, anew):
    start(end).communicate(timeout=60)
    kernel = cache_folder("pocl") / "kernel.so"
    kernel.write_bytes(b"damaged")
    (cache_folder("starts") / "0-dead").touch()  # one that was killed
    caches.mend_caches()
    assert not list(cache_folder("starts").iterdir())
    said = capsys.readouterr().err
    assert kernel.exists() is not anew and ("kernels are compiled anew" in said) is anew
    caches.mend_caches()  # once
    assert capsys.readouterr().err == ""


@posix
def test_a_start_that_goes_on_is_left_alone():
    alive = start("sys.stdin.read()")
    (mark,) = cache_folder("starts").iterdir()
    mark.write_text("as if it had been ended")
    assert not caches.tidy_starts() and mark.exists()
    alive.communicate(timeout=60)
    assert not mark.exists()


@posix
@pytest.mark.parametrize("data", [b"x" * 4096, b"SQLite format 3\0" + b"y" * 4096, None])
def test_a_damaged_database_of_callers_is_made_anew(tmp_path, capsys, data):
    import sqlite3

    path = tmp_path / "home/.cache/pytools/pdict-v5-pyopencl-invoker-cache-v42.sqlite"
    path.parent.mkdir(parents=True)
    if data is None:
        with sqlite3.connect(path) as base:
            base.execute("create table a (b)")
    else:
        path.write_bytes(data)
    caches.mend_caches()
    assert path.exists() is (data is None)
    assert ("was damaged; it is made anew" in capsys.readouterr().err) is (data is not None)


@posix
def test_what_the_driver_leaves_at_each_start_goes(monkeypatch):
    folder = cache_folder("pocl")
    old, new, full = (folder / f"tempfile_{name}" for name in ("old", "new", "full"))
    for path in (old, new):
        path.touch()
    full.write_bytes(b"1")
    for path in (old, full):
        os.utime(path, (0, 0))
    caches.mend_caches()
    assert not old.exists() and new.exists() and full.exists()


@posix
@pytest.mark.parametrize(("free", "used"), [(caches.FREE - 1, False), (caches.FREE, True)])
def test_a_disk_with_little_room_is_no_place_for_kernels(monkeypatch, capsys, free, used):
    here = cache_base()
    real = caches.shutil.disk_usage

    def usage(path):
        return SimpleNamespace(free=free) if str(path).startswith(str(here)) else real(path)

    monkeypatch.setattr(caches.shutil, "disk_usage", usage)
    caches.settle_caches()
    assert (cache_base() == here) is used
    assert ("cannot be used (No space left on device)" in capsys.readouterr().err) is not used
