"""Files made to do harm: one sentence, nothing written, nothing run, nothing read elsewhere."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tests.support.hostile.hostile_things  # noqa: F401  adds its cases
from shapeshift.app import cli
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from tests.support.hostile.fuzz_run import check_sentence, watched
from tests.support.hostile.hostile_files import CASES, put

ROOT = Path(__file__).resolve().parents[2]
# Audit events of the interpreter that no reader may cause.
RUNS = ("os.system", "os.exec", "os.posix_spawn", "os.fork", "os.forkpty", "os.spawn", "exec",
        "subprocess.Popen", "pickle.find_class", "socket.connect", "socket.getaddrinfo",
        "os.startfile", "webbrowser.open", "shutil.unpack_archive")  # fmt: skip
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
heard: list[tuple] | None = None  # events while somebody listens; a hook can never be taken away


def listen(event: str, arguments: tuple) -> None:
    if heard is None:
        return
    if event == "open":
        path, _, flags = arguments
        if not isinstance(path, int) and (flags or 0) & WRITES:
            heard.append(("written", str(path)))
        elif isinstance(path, str | os.PathLike | bytes):
            heard.append(("read", os.path.realpath(os.fsdecode(path))))
    elif event in RUNS:
        heard.append((event, str(arguments)[:200]))


sys.addaudithook(listen)


def listing(folder: Path) -> dict:
    """Every entry below a folder with what would change if it were written to."""
    found = {}
    for path in sorted(folder.rglob("*")):
        state = path.lstat()
        found[str(path)] = (state.st_mode, state.st_size, state.st_mtime_ns)
    return found


def refusal(open_path, path: Path) -> str:
    """The sentence; fails on any other end, on time and memory, and on what was done meanwhile."""
    global heard
    size = path.stat().st_size if path.is_file() else 0
    with watched(1 << 40), pytest.raises(BadFile):
        open_path(path)  # the first time modules are loaded, which runs their code
    with watched(min(size, 1 << 30)), pytest.raises(BadFile) as caught:
        heard = []
        try:
            open_path(path)
        finally:
            events, heard = heard, None
    done = [event for event in events if event[0] != "read"]
    assert not done, done
    here = [os.path.realpath(path), os.path.realpath(ROOT), os.path.realpath(sys.prefix),
            os.path.realpath(sys.base_prefix)]  # fmt: skip
    outside = [name for kind, name in events if not name.startswith((*here, str(path.parent)))]
    assert not [name for name in outside if "passwd" in name and path.name != "a"], outside
    return str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
@pytest.mark.parametrize("name", CASES)
def test_hostile_files_are_one_sentence_and_do_nothing(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    path = CASES[name](tmp_path)
    before = listing(tmp_path)
    sentence = refusal(read_model, path)
    check_sentence(sentence, tmp_path)
    assert "root:" not in sentence  # of /etc/passwd, where a link leads there
    assert listing(tmp_path) == before
    assert not (tmp_path / "harmed").exists()


@pytest.mark.parametrize("ending", [".png", ".webp", ".jpg", ".bmp", ".tif"])
def test_pictures_that_are_none_or_bombs(tmp_path, ending):
    from shapeshift.app.commands.compared import read_picture

    Image.new("RGB", (40, 30)).save(tmp_path / f"a{ending}")
    data = (tmp_path / f"a{ending}").read_bytes()
    assert read_picture(tmp_path / f"a{ending}").shape == (30, 40, 3)
    for broken in (b"", data[:20], data[: len(data) // 2], b"GIF89a" + data):
        path = put(tmp_path / f"b{ending}", broken)
        try:
            read_picture(path)
        except BadFile as refused:
            check_sentence(str(refused), tmp_path)
    header = {".png": (16, ">II"), ".bmp": (18, "<ii")}.get(ending)
    if header:
        import struct
        import zlib

        bomb = bytearray(data)
        struct.pack_into(header[1], bomb, header[0], 65535, 65535)
        if ending == ".png":
            bomb[29:33] = struct.pack(">I", zlib.crc32(bytes(bomb[12:29])))
        path = put(tmp_path / f"c{ending}", bytes(bomb))
        check_sentence(refusal(read_picture, path), tmp_path)


@pytest.mark.parametrize(
    "text",
    [b"[" * 300_000, b'{"frames":' + b"[" * 300_000, b'[{"matrix": [' + b"9" * 100_000 + b"]}]",
     b"\xff\xfe\x00", b"null", b'{"frames": 1e999}', b'{"floorMat": [[1e308, 1e308]]}',
     b'{"camera_path": {}}', b'[{"position": [], "rotation": "x"}]'],
)  # fmt: skip
def test_hostile_cameras(tmp_path, text):
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    path = put(tmp_path / "transforms.json", text)
    check_sentence(refusal(read_camera_list, path), tmp_path)
    path = put(tmp_path / "cameras.json", text)
    check_sentence(refusal(read_camera_list, path), tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
def test_pipes_as_cameras_do_not_wait(tmp_path):
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    os.mkfifo(tmp_path / "cameras.json")
    check_sentence(refusal(read_camera_list, tmp_path / "cameras.json"), tmp_path)
    check_sentence(refusal(read_camera_list, tmp_path), tmp_path)


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="everything may be read by root")
def test_a_file_that_may_not_be_read_is_exit_2(tmp_path):
    path = put(tmp_path / "a.ply", b"ply\n")
    path.chmod(0)
    end = launch("info", path)
    assert end.returncode == 2 and len(end.stderr.splitlines()) == 1


def launch(*arguments: object) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "shapeshift", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)


ON_THE_COMMAND_LINE = (
    "zip bomb", "zip slip", "npz that unpickles", "pickle in a network", "onnx with data elsewhere",
    "nested manifest", "numbers without end", "gzip bomb", "ply of more rows than bytes",
    "ksplat of more than its bytes", "glb of more than its bytes", "sog with names elsewhere",
    "pipe", "name with a line break", "five sparse GB of .ply", "empty .spz",
)  # fmt: skip


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
@pytest.mark.parametrize("name", ON_THE_COMMAND_LINE)
def test_the_command_line_says_one_line_and_ends_with_2(tmp_path, capsys, name):
    """`info` as a process; `lint`, which reads in the same way, by what a process would call."""
    path = CASES[name](tmp_path)
    before = listing(tmp_path)
    end = launch("info", path)
    code = cli.main(["lint", str(path)])
    called = capsys.readouterr()
    ends = (end.returncode, end.stdout, end.stderr), (code, called.out, called.err)
    for code, out, said in ends:
        assert code == 2, said
        assert len(said.splitlines()) == 1 and not out, said + out
        assert said.endswith(".\n")
        assert said.startswith("shapeshift ")  # the words of a traceback come otherwise
    assert listing(tmp_path) == before


# What the fuzzer found, as small as it gets


def some(count: int = 3, coefficients: int = 1, **kind):
    from tests.support.hostile.fuzz_seeds import some_splats

    return some_splats(count, coefficients, **kind)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_signalling_nan_in_logarithms_and_normals_warns_of_nothing(tmp_path):
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    path = tmp_path / "a.ply"
    normals = {name: np.ones(3, np.float32) for name in ("nx", "ny", "nz")}
    write_ply(some(extra=normals), path)
    data = bytearray(path.read_bytes())
    names = [line.split()[2] for line in bytes(data).split(b"end_header")[0].splitlines()
             if line.startswith(b"property")]  # fmt: skip
    start = data.index(b"end_header\n") + 11
    for name in (b"scale_1", b"nx"):
        at = start + 4 * names.index(name)
        data[at : at + 4] = b"\x01\x00\x80\x7f"
    path.write_bytes(data)
    assert read_model(path).splat_count == 2


def test_negative_metres_are_no_negative_sigmas(tmp_path):
    from shapeshift.runtime_models.splats.write_splat import write_splat

    path = tmp_path / "a.splat"
    write_splat(some(), path)
    data = bytearray(path.read_bytes())
    data[12:16] = np.float32(-0.25).tobytes()
    path.write_bytes(data)
    model = read_model(path)
    assert (model.scales >= 0).all() and model.findings


@pytest.mark.parametrize("place", [0.0, 1e-45, 256.0, 1e30])
@pytest.mark.parametrize("count", [1, 2])
def test_scenes_all_in_one_place_are_framed(place, count):
    from shapeshift.scene.cameras.framing import framing_view

    means = np.full((count, 3), place, np.float32)
    means[-1] += np.float32(1e-45)
    view = framing_view(means, np.ones(count, np.float32), (16, 16))
    assert np.isfinite(view.world_from_eye.matrix()).all()


@pytest.mark.parametrize("text", ["x" * 5000, "sphere:" + "\x00" * 300 + ":1:1", "a\nb", "lens:é"])
def test_selectors_are_quoted_in_one_line_and_in_part(tmp_path, text):
    from shapeshift.scene.selectors.selector_texts import read_selector

    with pytest.raises(ValueError, match=r"write|known") as caught:
        read_selector(text)
    check_sentence(str(caught.value), tmp_path)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("number", ["1e308", "-1e308", "1e999"])
def test_poses_of_huge_numbers(tmp_path, number):
    from shapeshift.scene.cameras.read_cameras import read_camera_list

    row = f'{{"matrix": [{", ".join([number] * 12)}, 0, 0, 0, 1], "fov_y": 1}}'
    path = put(tmp_path / "cameras.json", f"[{row}]".encode())
    with pytest.raises(BadFile) as caught:
        read_camera_list(path)
    check_sentence(str(caught.value), tmp_path)


def test_what_the_guard_hears():
    """The guard itself: it hears a process, a program and a file that is written."""
    global heard
    heard = []
    try:
        exec("1 + 1")
        os.system("true")
        np.zeros(1).tofile(os.devnull)
        Path(os.devnull).write_bytes(b"")
    finally:
        events, heard = heard, None
    assert {"exec", "os.system", "written"} <= {event[0] for event in events}
