"""Every outside parser stands behind the gate: by the source, by its table, and by stand-ins.

A stand-in has the name of the outside package and does what damaged files made the real one do: it
runs on, takes memory, ends the process.  No file that does so lies here.
"""

import ast
import os
import re
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.gate import gate
from shapeshift.runtime_models.gate.doors import DOORS, ELSEWHERE
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.rare_photo_run import USUAL
from tests.support.hostile.gate_fuzz import MOST_BYTES, MOST_S, Outcome, fuzz
from tests.support.hostile.gate_seeds import seeds
from tests.support.sources import nodes_of

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("runtime_models", "rasterizer", "scene", "renderer", "training", "decomposition", "vr",
           "app", "shapeshift")  # fmt: skip
# Import names of the packages that read files; each has a door or is another part of one that has.
PARSERS = {name.split(".")[0] for door in DOORS.values() for name in door.imports} - {"PIL"}
PARSERS |= {"onnx"}
BAD = {
    "runs on": "while True: pass",
    "takes memory": "held = []\n    while True: held.append(bytearray(1 << 24))",
    "ends": "import os; os.abort()",
}


def sources() -> list[Path]:
    """Files of the product that name a parser, a session or an opening of Pillow's."""
    words = re.compile(
        rf"\b(import|from)\s+({'|'.join(PARSERS)})\b|import_module|__import__"
        r"|InferenceSession|open_session|open_checked|(?i:image|pillow)\.open"
    )
    paths = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
    return [path for path in paths if words.search(path.read_text("utf-8"))]


def targets() -> set[str]:
    """The files behind the gate."""
    modules = {door.target.partition(":")[0] for door in DOORS.values()}
    return {f"{m.removeprefix('shapeshift.').replace('.', '/')}.py" for m in modules}


def importing() -> dict[str, set[str]]:
    """file: outside parsers that it imports, by whatever spelling."""
    found: dict[str, set[str]] = {}
    for path in sources():
        names = set()
        for node in nodes_of(path):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add((node.module or "").split(".")[0])
            elif isinstance(node, ast.Call) and re.search(
                r"(import_module|__import__)$", ast.unparse(node.func)
            ):
                words = [a.value for a in node.args if isinstance(a, ast.Constant)]
                names |= {str(word).split(".")[0] for word in words}
        if names & PARSERS:
            found[str(path.relative_to(ROOT))] = names & PARSERS
    return found


def test_no_outside_parser_is_imported_outside_the_gate():
    """A new import fails here until it stands behind the gate or says why it need not."""
    assert importing().keys() - targets() == ELSEWHERE.keys()
    assert importing().keys() & targets()


def test_pycolmap_is_in_no_process_of_ours():
    """With Pillow in one process it was seen to spoil memory."""
    inside = {path for path, names in importing().items() if "pycolmap" in names}
    assert {Path(path).stem.endswith("_run") for path in inside} == {True}


def calls(pattern: str) -> dict[str, list[ast.Call]]:
    """file: calls whose function's name matches."""
    found = {
        str(path.relative_to(ROOT)): [
            node
            for node in nodes_of(path)
            if isinstance(node, ast.Call) and re.search(pattern, ast.unparse(node.func))
        ]
        for path in sources()
    }
    return {path: nodes for path, nodes in found.items() if nodes}


def test_pillow_opens_its_usual_formats_alone():
    """Every Image.open names its formats; films read frames that they have just written."""
    for path, nodes in calls(r"(Image|pillow)\.open$").items():
        if path in targets() | {"app/film/write_video.py"}:
            continue
        for node in nodes:
            named = {word.arg: word.value for word in node.keywords}
            assert "formats" in named, f"{path}:{node.lineno} opens whatever Pillow knows"
            said = ast.unparse(named["formats"])
            assert said == "USUAL" or set(ast.literal_eval(said)) <= set(USUAL), path


def test_sessions_of_onnxruntime_are_of_networks_of_our_own():
    """Who opens one by itself: the evaluators of networks that write_onnx made, and the gate."""
    assert set(calls(r"InferenceSession$")) == {
        "runtime_models/session.py", "training/gradients/fold_constants.py"
    }  # fmt: skip
    assert {path for path in calls(r"^open_session$") if not path.startswith("app/headset")} == {
        "runtime_models/gate/network_run.py", "runtime_models/session.py",
        "runtime_models/scaffold/evaluate_scaffold.py",
    }  # fmt: skip
    assert set(calls(r"\bopen_checked$")) == {
        "training/gradients/fold_constants.py", "training/gradients/reverse_mode.py"
    }  # fmt: skip


@pytest.mark.parametrize("name", DOORS)
def test_a_door_has_a_target_and_bounds(name):
    door = DOORS[name]
    module, _, function = door.target.partition(":")
    path = ROOT / f"{module.removeprefix('shapeshift.').replace('.', '/')}.py"
    defined = {node.name for node in nodes_of(path)
               if isinstance(node, ast.FunctionDef | ast.ClassDef)}  # fmt: skip
    assert function in defined
    assert 0 < door.seconds <= 20 and 0 <= door.seconds_a_byte <= 4e-5
    assert 0 < door.memory <= 2 << 30


def test_the_page_has_the_table():
    """docs/formats.md, a row a door, its numbers as they are in doors.py."""
    page = (ROOT / "docs" / "formats.md").read_text("utf-8")
    for door in DOORS.values():
        free = f"{door.memory >> 20:,} MB" if door.memory < 1 << 30 else f"{door.memory >> 30} GB"
        more = f"{door.seconds_a_byte * 1e6:g} s a MB"
        row = f"| {door.reads} | {door.package} | {door.seconds:g} s and {more} | {free} |"
        assert row in page, row


def files_for(folder: Path) -> dict[str, tuple[Path, object]]:
    """door: a file that its reader gives to the outside package, and that reader."""
    from shapeshift.decomposition.masks.sam import Network
    from shapeshift.decomposition.poses.video_frames import take_frames
    from shapeshift.runtime_models.splats.plain_splats import Reading
    from shapeshift.runtime_models.splats.usd.read_usd import read_raw_usd
    from shapeshift.scene.captures.colmap_tables import ColmapCamera
    from shapeshift.scene.captures.photo import open_image
    from shapeshift.scene.captures.point_clouds import read_las
    from shapeshift.scene.captures.radiometric.number_photos import radiometric_celsius
    from shapeshift.scene.captures.undistort import pixels_of
    from shapeshift.scene.colliders.read_mesh import read_mesh
    from tests.support.scene.flir_files import write_flir

    def put(name: str, data: bytes) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    las = bytearray(b"LASF".ljust(400, b"\0"))
    las[96:100] = (227).to_bytes(4, "little")  # where the points begin
    picture = folder / "a.gif"
    Image.fromarray(np.zeros((6, 8), np.uint8)).save(picture)
    lens = ColmapCamera("OPENCV", (8, 6), (5.0, 5.0, 4.0, 3.0, 0.1, 0.0, 0.0, 0.0))
    return {
        "thermal photo": (
            write_flir(folder / "a.jpg", np.full((6, 8), 20.0), (8, 6)),
            lambda path: radiometric_celsius(path, (8, 6)),
        ),
        "points": (put("a.las", bytes(las)), lambda path: read_las(path, 10)),
        "mesh": (put("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), read_mesh),
        "USD": (put("a.usda", b"#usda 1.0\n"), lambda path: read_raw_usd(path, Reading())),
        "rare photo": (picture, open_image),
        "video": (
            put("a.mp4", b"\0" * 64), lambda path: take_frames(path, folder, 3, lambda *_: None)
        ),
        "network": (put("a.onnx", b"\x08\x08"), lambda path: Network(path, 1)),
        "lens": (folder / "OPENCV", lambda path: pixels_of(lens, np.zeros((3, 2)))),
    }  # fmt: skip


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    return files_for(tmp_path_factory.mktemp("doors"))


@pytest.mark.skipif(os.name == "nt", reason="limits of POSIX")
@pytest.mark.parametrize("how", BAD)
@pytest.mark.parametrize("name", DOORS)
def test_what_a_parser_must_not_do_is_one_sentence(name, how, ready, tmp_path, monkeypatch):
    """Of each door: the product's own reader, and a package of that name that does it."""
    stand_in(DOORS[name].imports, BAD[how], tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(
        "importlib.util.find_spec", partial(_found, __import__("importlib.util").util.find_spec)
    )
    from dataclasses import replace

    seconds = 3.0 if how == "takes memory" else 0.3
    quick = replace(DOORS[name], seconds=seconds, seconds_a_byte=0.0, memory=64 << 20)
    monkeypatch.setitem(gate.DOORS, name, quick)
    gate.end_all()
    path, read = ready[name]
    begun = time.monotonic()
    with pytest.raises(BadFile) as refusal:
        read(path)
    gate.end_all()
    assert time.monotonic() - begun < 30
    said = str(refusal.value)
    assert path.name in said and "\n" not in said and len(said) < 400
    words = {"runs on": "processor time", "takes memory": "memory"}
    assert words.get(how, "ends on it") in said


def _found(real, name: str, *more):
    """A spec also of packages that are not installed here: their stand-ins are."""
    return real(name, *more) or object()


def stand_in(imports: tuple[str, ...], bad: str, folder: Path) -> None:
    """Modules of these names: they load well, and each use of them is bad."""
    text = (
        "def __getattr__(name):\n    if name.startswith('__'): raise AttributeError(name)\n"
        f"    {bad}\n"
    )
    top = imports[0].split(".")[0]
    package = folder / top
    package.mkdir()
    names = {name.partition(".")[2] for name in imports if name.startswith(f"{top}.")}
    (package / "__init__.py").write_text("" if names else text)
    for name in names | ({"Sdf"} if top == "pxr" else set()):
        (package / f"{name}.py").write_text(text)
    for other in {name.split(".")[0] for name in imports} - {top}:
        (folder / f"{other}.py").write_text(text)


FUZZED = [name for name in DOORS if name != "lens"]  # that is given numbers, not a file


@pytest.fixture(scope="module")
def sown(tmp_path_factory):
    return list(seeds(tmp_path_factory.mktemp("seeds")))


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="measures as Linux does")
@pytest.mark.parametrize("name", FUZZED)
def test_wrong_files_are_refused_within_their_budget(name, sown, tmp_path):
    """100 a door; tools/runtime_models/gate.py tries as many as one likes."""
    mine = [seed for seed in sown if seed.door == name]
    if not mine:
        pytest.skip(f"{DOORS[name].package} is not installed")
    out = Outcome(name)
    for seed in mine:
        fuzz(seed, tmp_path, -(-100 // len(mine)), 0, out)
    assert not out.faults
    assert out.mutations >= 100 and out.opened + out.refused == out.mutations
    assert out.over_s <= MOST_S and out.over_mb * 1e6 <= MOST_BYTES


@pytest.mark.skipif(os.name == "nt", reason="names of POSIX are bytes")
@pytest.mark.parametrize("where", ["file", "folder"])
@pytest.mark.parametrize("name", FUZZED)
def test_every_door_opens_names_that_are_no_utf8(name, where, sown, tmp_path):
    """Its own or its folder's; OpenUSD and onnxruntime take UTF-8 alone."""
    odd = tmp_path / os.fsdecode(b"a\xff\xfe")
    try:
        odd.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this file system takes no such name")
    for seed in [seed for seed in sown if seed.door == name]:
        path = odd / seed.name if where == "folder" else odd.with_suffix(Path(seed.name).suffix)
        path.write_bytes(seed.data)
        seed.read(path)
