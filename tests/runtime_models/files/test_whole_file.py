"""Files are written whole or not at all, with the rights they should have, and through no link."""

import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.files import whole_file
from shapeshift.runtime_models.files.whole_file import (
    PART,
    make_folders,
    open_lines,
    swap,
    temporary_folder,
    whole_folder,
    write_whole,
)
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.training.checkpoint import read_checkpoint, write_checkpoint
from tests.support.models import make_random_model

ROOT = Path(__file__).resolve().parents[3]
posix = pytest.mark.skipif(os.name == "nt", reason="rights and links of POSIX")


@pytest.fixture(autouse=True)
def swept(monkeypatch) -> set:
    """Folders that were tidied: once a process, and empty again as in another start of it."""
    monkeypatch.setattr(whole_file, "_swept", set())
    return whole_file._swept


@pytest.fixture
def umask():
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


def rights(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


def write_some(path: Path) -> None:
    """A file or, of a name without an ending, a folder."""
    if path.suffix:
        write_whole(path, b"new")
        return
    with whole_folder(path) as folder:
        (folder / "inside").write_bytes(b"new")


@posix
@pytest.mark.parametrize("mask", [0o000, 0o002, 0o022, 0o077, 0o177])
def test_new_files_have_the_rights_of_the_umask(tmp_path, umask, mask):
    umask(mask)
    write_some(tmp_path / "a.ply")
    with open_lines(tmp_path / "b.jsonl") as lines:
        lines.write("{}\n")
    umask(0o077 & mask)
    write_some(tmp_path / "folder")
    assert rights(tmp_path / "a.ply") == rights(tmp_path / "b.jsonl") == 0o666 & ~mask
    assert rights(tmp_path / "folder") == 0o777 & ~(0o077 & mask)


@posix
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666, 0o400, 0o755])
@pytest.mark.parametrize("name", ["a.ply", "folder"])
def test_a_file_that_is_replaced_hands_its_rights_on(tmp_path, umask, mode, name):
    path = tmp_path / name
    write_some(path)
    path.chmod(mode | (0o300 if name == "folder" else 0))  # its owner may look in
    before = rights(path)
    umask(0o022)
    write_some(path)
    assert rights(path) == before


@pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root gives files away")
def test_root_leaves_a_file_to_its_owner(tmp_path):
    write_some(tmp_path / "a.ply")
    os.chown(tmp_path / "a.ply", 4321, 4322)
    write_some(tmp_path / "a.ply")
    state = (tmp_path / "a.ply").stat()
    assert (state.st_uid, state.st_gid) == (4321, 4322)


@posix
@pytest.mark.parametrize("there", [True, False])
def test_links_are_replaced_and_never_followed(tmp_path, there):
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    for name in ("a.ply", "run.jsonl"):
        if there:
            (outside / name).write_bytes(b"mine")
        (inside / name).symlink_to(outside / name)
    (outside / "folder").mkdir()
    (outside / "folder" / "mine").touch()
    (inside / "folder").symlink_to(outside / "folder")
    write_some(inside / "a.ply")
    write_some(inside / "folder")
    with open_lines(inside / "run.jsonl") as lines:
        lines.write("new\n")
    assert not any(path.is_symlink() for path in inside.iterdir())
    kept = {path.name: path.read_bytes() for path in outside.glob("*.*")}
    assert kept == ({"a.ply": b"mine", "run.jsonl": b"mine"} if there else {})
    assert [path.name for path in (outside / "folder").iterdir()] == ["mine"]
    assert (inside / "folder" / "inside").read_bytes() == b"new"


@posix
def test_folders_of_ours_are_no_links(tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "named").symlink_to(tmp_path / "outside")
    assert make_folders(tmp_path / "named", "sparse/0").is_dir()  # the user's own link is followed
    (tmp_path / "trap").mkdir()
    (tmp_path / "trap" / "sparse").symlink_to(tmp_path / "outside")
    with pytest.raises(OSError, match="nothing is written") as refused:
        make_folders(tmp_path / "trap", "sparse/0")
    assert refused.value.filename == str(tmp_path / "trap" / "sparse")


@posix
def test_devices_and_pipes_are_written_to_and_stay_what_they_are(tmp_path):
    write_whole(Path(os.devnull), b"away")
    assert stat.S_ISCHR(os.stat(os.devnull).st_mode)
    os.mkfifo(tmp_path / "pipe")
    read = []
    thread = threading.Thread(target=lambda: read.append((tmp_path / "pipe").read_bytes()))
    thread.start()
    write_whole(tmp_path / "pipe", b"through")
    thread.join(10)
    assert read == [b"through"] and stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)
    code = (
        "from shapeshift.runtime_models.files.whole_file import *\n"
        "write_whole(Path('/dev/stdout'), b'said')"
    )
    with (tmp_path / "said").open("wb") as out:
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, stdout=out)
    assert (tmp_path / "said").read_bytes() == b"said" and Path("/dev/stdout").is_symlink()


def test_names_of_full_length(tmp_path):
    write_some(tmp_path / ("n" * 251 + ".ply"))
    assert [len(path.name) for path in tmp_path.iterdir()] == [255]


@pytest.mark.parametrize("name", ["a.ply", "folder"])
def test_a_full_disk_is_named_by_the_file(tmp_path, name):
    with pytest.raises(OSError) as full:
        if name == "folder":
            with whole_folder(tmp_path / name) as folder:
                raise OSError(28, "No space left on device", str(folder / "scene.json"))
        write_whole(tmp_path / name, (b"new" if number == 0 else fill_up() for number in (0, 1)))
    assert full.value.filename == str(tmp_path / name) and full.value.filename2 is None
    assert not any(tmp_path.iterdir())


def fill_up():
    raise OSError(28, "No space left on device")


def test_an_error_that_is_words_alone_gets_the_name(tmp_path):
    def parts():
        raise OSError("66 requested and 12 written")
        yield

    with pytest.raises(OSError, match="66 requested and 12 written") as short:
        write_whole(tmp_path / "a.ply", parts())
    assert short.value.filename == str(tmp_path / "a.ply")


def test_an_error_of_another_file_keeps_its_name(tmp_path):
    with pytest.raises(FileNotFoundError) as missing:
        write_whole(tmp_path / "a.ply", (Path(name).read_bytes() for name in ["/absent/b"]))
    assert missing.value.filename == "/absent/b"
    with pytest.raises(FileNotFoundError) as missing:
        write_whole(tmp_path / "absent" / "a.ply", b"")
    assert missing.value.filename == str(tmp_path / "absent" / "a.ply")


@posix
def test_the_command_line_names_the_file_that_found_no_room(tmp_path):
    """A real limit of the kernel's: no file may grow beyond 512 bytes."""
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply
    from tests.support.splat_scenes import random_layers

    cloud = random_layers(200)
    columns = (cloud.means, cloud.scales, cloud.wxyz, cloud.opacity, cloud.sh)
    write_ply(PlainSplats(*columns), tmp_path / "a.ply")
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))\n"
        "from shapeshift.app.cli import main; raise SystemExit(main())"
    )
    out = tmp_path / "b.ply"
    done = subprocess.run(
        # -B: Python's own byte code would be cut off in silence, too, for all that come after.
        [sys.executable, "-B", "-c", code, "export", str(tmp_path / "a.ply"), "--out", str(out)],
        cwd=ROOT, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == f"shapeshift export: File too large: {out}"
    assert [path.name for path in tmp_path.iterdir()] == ["a.ply"]


# Writers that are killed

SLOW = """
import sys, time
from pathlib import Path
from shapeshift.runtime_models.files.whole_file import write_whole, whole_folder
path = Path(sys.argv[1])
def parts():
    yield b"new"
    print("begun", flush=True)
    time.sleep(60)
if path.suffix:
    write_whole(path, parts())
else:
    with whole_folder(path) as folder:
        (folder / "inside").write_bytes(b"".join(parts()))
"""


def start_slow(path: Path) -> subprocess.Popen:
    """A writer in another process that has begun and never ends."""
    command = [sys.executable, "-c", SLOW, str(path)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begun\n"
    return process


@posix
@pytest.mark.parametrize("name", ["a.ply", "folder"])
def test_litter_of_killed_writers_goes_and_nothing_else(tmp_path, swept, name):
    not_ours = ("a.ply.part", ".shapeshift-notes.part", ".shapeshift-0123456789abcdef.part.txt",
                "x.shapeshift-0123456789abcdef.part", "a.ply.12345678.part")  # fmt: skip
    for other in not_ours:
        (tmp_path / other).touch()
    write_some(tmp_path / name)
    killed, alive = start_slow(tmp_path / name), start_slow(tmp_path / "b.ply")
    killed.kill()
    killed.wait()
    try:
        assert len(parts_in(tmp_path)) == 2
        swept.clear()  # as another start of the program
        write_some(tmp_path / "c.ply")
        assert len(parts_in(tmp_path)) == 1, "the part of the writer that lives stays"
        assert {path.name for path in tmp_path.iterdir()} >= {name, "c.ply", *not_ours}
    finally:
        alive.send_signal(signal.SIGINT)
        alive.wait()
    assert parts_in(tmp_path) == []


@posix
def test_a_temporary_folder_of_a_killed_program_goes_with_the_next(tmp_path, swept, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code = (
        "import time; from shapeshift.runtime_models.files.whole_file import temporary_folder\n"
        "with temporary_folder() as folder: (folder / 'a').touch(); print(1, flush=True); "
        "time.sleep(60)"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    child = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, env=environment
    )
    assert child.stdout.read(1) == b"1" and len(parts_in(tmp_path)) == 1
    with temporary_folder() as folder:
        assert folder.stat().st_mode & 0o777 == 0o700
        assert len(parts_in(tmp_path)) == 2, "that of the living one stays"
    child.kill()
    child.wait()
    swept.clear()
    with temporary_folder() as folder:
        assert parts_in(tmp_path) == [folder.name]
    assert parts_in(tmp_path) == []


def parts_in(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if PART.fullmatch(path.name)]


@posix
def test_a_link_named_like_litter_is_not_followed(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "a").touch()
    (tmp_path / ".shapeshift-0123456789abcdef.part").symlink_to(tmp_path / "mine")
    write_some(tmp_path / "a.ply")
    assert (tmp_path / "mine" / "a").exists()


@posix
def test_a_part_that_is_swept_before_it_is_locked_is_made_again(tmp_path, monkeypatch):
    """The moment between making and locking, when another writer may take it for litter."""
    real, swept = whole_file.lock, []

    def lock(handle, wait=False):
        if wait and not swept:
            swept.extend(path.unlink() or path for path in tmp_path.iterdir())
        return real(handle, wait)

    monkeypatch.setattr(whole_file, "lock", lock)
    write_some(tmp_path / "a.ply")
    assert len(swept) == 1 and (tmp_path / "a.ply").read_bytes() == b"new"


# Folders


def test_folders_change_places_in_one_moment(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"of {name}").touch()
    if not swap(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system cannot swap folders")
    assert (tmp_path / "a" / "of b").exists() and (tmp_path / "b" / "of a").exists()
    assert not swap(tmp_path / "a", tmp_path / "absent")


@posix
def test_a_package_in_a_folder_is_there_at_every_moment(tmp_path):
    if not swap(*(make_folders(tmp_path, name) for name in "ab")):
        pytest.skip("this system cannot swap folders")
    path = tmp_path / "scene"
    models = [make_random_model(count) for count in (3, 4)]
    write_package(models[0], path)
    missing, looks, done = 0, 0, threading.Event()

    def look():
        nonlocal missing, looks
        while not done.is_set():
            missing += not os.path.exists(path / "scene.json")
            looks += 1

    thread = threading.Thread(target=look)
    thread.start()
    for number in range(40):
        write_package(models[number % 2], path)
    done.set()
    thread.join()
    assert looks > 40 and missing == 0
    assert len(read_model(path).anchors) == 4 and parts_in(tmp_path) == []


@posix
@pytest.mark.parametrize("name", ["scene", "scene.shift"])
def test_packages_survive_kill_at_random_instants(tmp_path, swept, name):
    code = (
        "import sys; from tests.support.models import make_random_model\n"
        "from shapeshift.runtime_models.package.write_package import write_package\n"
        "from pathlib import Path\n"
        "models = [make_random_model(count) for count in (3, 4)]; print('begun', flush=True)\n"
        "while True:\n for model in models: write_package(model, Path(sys.argv[1]))\n"
    )
    rng = np.random.default_rng(5)
    write_package(make_random_model(3), tmp_path / name)
    for _ in range(6):
        process = subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path / name)], cwd=ROOT, stdout=subprocess.PIPE
        )
        process.stdout.readline()
        time.sleep(0.05 + rng.uniform(0, 0.1))
        process.kill()
        process.wait()
        process.stdout.close()
        assert len(read_model(tmp_path / name).anchors) in (3, 4)
    swept.clear()  # as in the next start
    write_package(make_random_model(3), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]


# Checkpoints


class Watched:
    """An array that, when it is written, looks at what its file holds at that moment."""

    def __init__(self, look) -> None:
        self._look = look

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        self._look()
        return np.ones(3)


def test_the_old_checkpoint_is_whole_while_the_new_one_is_written(tmp_path):
    path, seen = tmp_path / "a.shift.checkpoint.npz", []
    write_checkpoint(path, {"a": np.zeros(1000), "b": np.zeros(5)}, {"step": 1})
    look = Watched(lambda: seen.append(read_checkpoint(path)[1]["step"]))
    write_checkpoint(path, {"a": np.zeros(1000), "b": look, "c": np.zeros(1000)}, {"step": 2})
    assert set(seen) == {1} and read_checkpoint(path)[1] == {"step": 2}


def test_a_checkpoint_that_fails_halfway_leaves_the_old_one(tmp_path):
    path = tmp_path / "a.shift.checkpoint.npz"
    write_checkpoint(path, {"a": np.zeros(9)}, {"step": 1})
    with pytest.raises(OSError) as full:
        write_checkpoint(path, {"a": np.zeros(9), "b": Watched(fill_up)}, {"step": 2})
    assert full.value.filename == str(path)
    assert read_checkpoint(path)[1] == {"step": 1}
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
