"""launch.py simulate: the example in motion, the same bytes again, nothing half told."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app.commands.simulate import HZ, Options, make_simulation, run
from shapeshift.app.errors import UsageError
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.appearance import Sky
from shapeshift.scene.document.read_scene_file import read_scene_file

absent = [name for name in ("rapier3d", "coacd") if find_spec(name) is None]
# coacd is only looked for: in a process that has loaded it OpenCL's compiler finds no headers.
pytestmark = pytest.mark.skipif(bool(absent), reason=f"not installed: {', '.join(absent)}")

ROOT = Path(__file__).resolve().parents[3]
SCENE, SCRIPT = ROOT / "examples" / "touch.scene.json", ROOT / "examples" / "touch.jsonl"


def rows_of(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "run.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def example(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("touch")
    assert run(Options(SCENE, out / "run", SCRIPT)) == 0
    return out / "run"


def test_what_nobody_touches_comes_to_rest():
    """A ring of seven hulls, whose contacts were foreseen too far, rocked for ever."""
    world = make_simulation(read_scene_file(SCENE), ()).world
    steps = next((k for k in range(6 * HZ) if world.step() and world.resting), None)
    assert steps is not None and steps < 4 * HZ, steps  # 2.4 s measured


def test_the_example_does_all_that_it_declares(example):
    rows = rows_of(example)
    assert rows[0]["objects"] == ["background", "cube", "ball", "ring", "plate"]
    events = [(e["object"], e["on"], e["to"]) for row in rows for e in row.get("events", ())]
    assert [e for e in events if e[0] == "ring"] == [
        ("ring", "grab", "hot"), ("ring", "enter", "cold")
    ]  # fmt: skip
    assert [e for e in events if e[0] == "ball"] == [
        ("ball", "ray", "confetti"), ("ball", "ray", "ball")
    ]  # fmt: skip
    assert [e for e in events if e[0] == "cube"] == [
        ("cube", "collision", "ice"), ("cube", "collision", "fire")
    ]  # fmt: skip
    deeds = [(d["hand"], d["did"], d["object"]) for row in rows for d in row.get("hands", ())]
    assert deeds == [
        ("right", "grab", "ring"), ("right", "release", "ring"), ("left", "grab", "cube"),
        ("left", "release", "cube"),
    ]  # fmt: skip
    touched = {tuple(c["between"]) for row in rows for c in row.get("contacts", ())}
    assert {("cube", "ball"), ("ring", "plate")} <= touched
    assert rows[-1]["end"] == rows[0]["steps"] == 630


def test_everything_stays_on_the_table_and_nothing_sinks_into_it(example):
    last: dict[str, list] = {}
    for row in rows_of(example):
        last |= row.get("poses", {})
        assert all(pose[1] > 0.015 for n, pose in row.get("poses", {}).items() if n in ("cube",
                   "ball", "ring"))  # fmt: skip
    for name, height in (("cube", 0.05), ("ball", 0.06), ("ring", 0.032)):
        assert last[name][1] == pytest.approx(height, abs=0.004)  # it lies, the ring on the plate


def test_the_same_run_gives_the_same_bytes(example, tmp_path):
    script = "import sys; from shapeshift.app.cli import main; sys.exit(main())"
    command = ["simulate", str(SCENE), "--script", str(SCRIPT), "--out", str(tmp_path / "again")]
    done = subprocess.run(
        [sys.executable, "-c", script, *command], cwd=ROOT, capture_output=True, timeout=120
    )
    assert done.returncode == 0 and done.stdout == b""
    assert (tmp_path / "again" / "run.jsonl").read_bytes() == (example / "run.jsonl").read_bytes()


def test_pictures_show_what_moves(tmp_path, monkeypatch):
    """Before the sky of the scene file, here one of one colour."""
    file = replace(read_scene_file(SCENE), sky=Sky(*3 * [(0.0, 1.0, 0.0)]))
    where = "shapeshift.scene.document.read_scene_file.read_scene_file"
    monkeypatch.setattr(where, lambda path: file)
    options = Options(
        SCENE, tmp_path, SCRIPT, seconds=1.2, pictures=54, size="160x90", drawing="tiles",
        context="none",
    )  # fmt: skip
    assert run(options) == 0
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["00000.png", "00054.png", "00108.png", "run.jsonl"]
    first, second, third = (np.asarray(Image.open(tmp_path / n)).astype(int) for n in names[:3])
    assert first.shape == (90, 160, 3) and (first[0, 0] == [0, 255, 0]).all()
    settled, lifted = ((np.abs(a - second).max(axis=2) > 60).sum() for a in (first, third))
    assert settled < 60 < 100 < lifted  # pixels: things fall a millimetre, then the ring is lifted


def test_nothing_is_replaced_unasked_and_an_input_never(example, tmp_path):
    with pytest.raises(UsageError, match=r"run.jsonl exists.*--overwrite"):
        run(Options(SCENE, example, SCRIPT))
    own = tmp_path / "run.jsonl"
    own.write_bytes(SCRIPT.read_bytes())
    with pytest.raises(UsageError, match="is read in this run"):
        run(Options(SCENE, tmp_path, own, overwrite=True))
    assert own.read_bytes() == SCRIPT.read_bytes()


@pytest.mark.parametrize(
    "changes,said",
    [({"seconds": 0.0}, "--seconds is 0"), ({"seconds": float("nan")}, "--seconds is nan"),
     ({"pictures": -1}, "--pictures is -1"), ({"size": "big"}, "--size is 'big'")],
)  # fmt: skip
def test_wrong_options_are_one_sentence(tmp_path, changes, said):
    with pytest.raises(UsageError, match=said):
        run(replace(Options(SCENE, tmp_path / "out"), **changes))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["workshop.shift", "a.ply", "folder"])
def test_what_is_no_scene_file_is_told_what_is(tmp_path, name):
    path = tmp_path / name
    path.mkdir() if name == "folder" else path.write_bytes(b"PK")
    with pytest.raises(UsageError, match=rf"{name} is no scene file: .* NAME\.scene\.json"):
        run(Options(path, tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_wrong_line_ends_it_before_anything_is_written(tmp_path):
    (tmp_path / "s.jsonl").write_text('# hm\n{"t": 0, "do": "garb"}\n')
    with pytest.raises(BadFile, match=r"s.jsonl, line 2: 'do' is"):
        run(Options(SCENE, tmp_path / "out", tmp_path / "s.jsonl"))
    assert not (tmp_path / "out").exists()


def test_a_collider_that_is_none_names_its_object(tmp_path):
    scene = json.loads(SCENE.read_text())
    for item in (scene["background"], *scene["objects"]):
        item["model"] = str(SCENE.parent / item["model"])
        item.pop("collider", None)
    scene["objects"][0]["collider"] = "absent.obj"
    (tmp_path / "a.scene.json").write_text(json.dumps(scene))
    with pytest.raises(BadFile, match=r"object 'cube': 'collider': .*absent.obj"):
        run(Options(tmp_path / "a.scene.json", tmp_path / "out", seconds=0.1))


def test_ctrl_c_leaves_whole_lines(tmp_path):
    """After some steps the user has had enough."""
    from shapeshift.app.commands import simulate
    from shapeshift.scene.world.simulation import Simulation

    step, count = Simulation.step, 0

    def until_tired(self):
        nonlocal count
        count += 1
        if count == 100:
            raise KeyboardInterrupt
        return step(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Simulation, "step", until_tired)
        with pytest.raises(KeyboardInterrupt):
            simulate.run(Options(SCENE, tmp_path, SCRIPT))
    rows = rows_of(tmp_path)
    assert rows[0]["steps"] == 630 and 60 < rows[-1]["step"] < 100
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_example_is_what_its_program_writes(tmp_path):
    from tools.synthetic.tabletop import write_example

    write_example(tmp_path)
    for path in sorted(p for p in tmp_path.rglob("*") if p.is_file()):
        kept = SCENE.parent / path.relative_to(tmp_path)
        if path.suffix != ".spz":
            assert kept.read_bytes() == path.read_bytes(), path.name
            continue
        made, known = read_model(path), read_model(kept)  # rounding and gzip differ elsewhere
        for name, slack in (("means", 1e-4), ("opacity", 0.01), ("sh", 0.06), ("scales", 1e-3)):
            np.testing.assert_allclose(getattr(made, name), getattr(known, name), atol=slack)
    files = {p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file()}
    there = [SCENE, SCRIPT, *(p for p in (SCENE.parent / "touch").rglob("*") if p.is_file())]
    colliders = {p.relative_to(SCENE.parent) for p in there if p.suffix == ".glb"}
    assert files | colliders == {p.relative_to(SCENE.parent) for p in there}
    assert sum(p.stat().st_size for p in there) < 1_000_000
