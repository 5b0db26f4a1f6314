"""Started in a folder of poison, no command and no child process loads anything out of it."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tests.support.hostile.poisoned_folder as poisoned_folder
from shapeshift.app import first_start
from shapeshift.app.cli import COMMANDS
from tests.support.sources import nodes_of
from tests.support.splat_scenes import random_layers

ROOT = Path(__file__).resolve().parents[2]
CLI = [sys.executable, "-P", str(ROOT / "shapeshift" / "__main__.py")]  # as launch.py starts it
INSTALLED = "from shapeshift.app.cli import main\nraise SystemExit(main())\n"
SHIPPED = ("app", "decomposition", "rasterizer", "renderer", "runtime_models", "scene", "training",
           "vr")  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Poison, and between it the files that somebody wants to look at."""
    from shapeshift.runtime_models.splats.plain_splats import PlainSplats
    from shapeshift.runtime_models.splats.ply.write_ply import write_ply

    folder = tmp_path_factory.mktemp("downloads")
    poisoned_folder.fill(folder)
    cloud = random_layers(60)
    for name in ("a", "b"):
        columns = (cloud.means, cloud.scales, cloud.wxyz, cloud.opacity, cloud.sh)
        write_ply(PlainSplats(*columns), folder / f"{name}.ply")
    (folder / "touch.scene.json").write_text(
        '{"floor_y": -3, "objects": [{"name": "a", "model": "a.ply", "collider": "a.obj"}]}'
    )
    (folder / "hulls.scene.json").write_text(
        '{"objects": [{"name": "a", "model": "a.ply", "collider": "hulls"}]}'
    )
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    faces = ("1 2 4", "1 4 3", "5 7 8", "5 8 6", "1 5 6", "1 6 2", "3 4 8", "3 8 7", "1 3 7",
             "1 7 5", "2 6 8", "2 8 4")  # fmt: skip
    (folder / "a.obj").write_text(corners + "".join(f"f {face}\n" for face in faces))
    return folder


@pytest.fixture(scope="module")
def capture(folder) -> Path:
    from shapeshift.training.synthetic.balls import make_balls
    from tests.support.training.point_files import write_las

    make_balls(folder / "capture", views=6, test_views=1, size=32)
    write_las(folder / "points.laz", np.random.default_rng(0).uniform(-1, 1, (500, 3)))
    return folder / "capture"


def run(folder: Path, tmp_path: Path, words: list, program=CLI, **more) -> None:
    """Runs it in the folder; fails where it fails, and where poison was taken."""
    mark = tmp_path / "mark"
    done = subprocess.run(
        [*program, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=300,
        env=poisoned_folder.environment(mark, **more),
    )  # fmt: skip
    assert not mark.exists(), mark.read_text()
    assert done.returncode == 0, done.stderr + done.stdout
    assert "poisoned" not in done.stderr


def test_the_poison_works(folder, tmp_path):
    """What the other tests rest on: without -P, each of these names is taken from the folder."""
    mark = tmp_path / "mark"
    env = poisoned_folder.environment(mark)
    for name in ("numpy", "rich", "shapeshift.app.cli", "multiprocessing"):
        subprocess.run([sys.executable, "-c", f"import {name}"], cwd=folder, env=env, check=False)
    taken = [Path(line).relative_to(folder).parts[0] for line in mark.read_text().splitlines()]
    assert taken == ["numpy.py", "rich.py", "shapeshift", "multiprocessing.py"]


SIZE = ("--size", "32x24")
LIGHT = [
    ("info", "a.ply"), ("lint", "a.ply"), ("cameras", "capture/transforms.json"),
    ("export", "a.ply", "--out", "light/a.spz"), ("lod", "a.ply", "--out", "light/levels"),
    ("compare", "a.ply", "b.ply", *SIZE),
    ("render", "a.ply", "--out", "light/pictures", *SIZE),
    ("film", "a.ply", "--seconds", "0.1", "--out", "light/film.gif", *SIZE),
    ("change", "a.ply", "a.ply"),
    ("measure", "a.ply", "--distance", "0,0,0", "1,0,0", *SIZE),
    ("thermal", "a.ply", "--stop", "a", "--colors", "gray", "--range", "0", "1",
     "--out", "light/heat.png", *SIZE),
    ("simulate", "touch.scene.json", "--seconds", "0.1", "--out", "light/run"),
]  # fmt: skip


@pytest.mark.parametrize("words", LIGHT, ids=lambda words: words[0])
def test_commands_take_nothing_from_the_current_folder(folder, capture, tmp_path, words):
    run(folder, tmp_path, words)


def test_linkers_of_opencl_drivers_take_nothing_and_settings_that_are_paths_begin_there(
    folder, tmp_path
):
    """Kernels that no cache has: PoCL calls ld, which looks for libgcc_s.so.1 where it runs."""
    (folder / "linked").mkdir()
    pictures = ("render", "a.ply", "--out", "light/linked", *SIZE)
    run(folder, tmp_path, pictures, POCL_CACHE_DIR="linked/kernels", TMPDIR="linked")
    assert any((folder / "linked" / "kernels").iterdir())


HEAVY = [
    ("train", "capture", "--points", "points.laz", "--out", "light/a.shift", "--iterations", "2"),
    ("bench", "a.ply", "--frames", "2", "--sweep", "2", *SIZE, "--quality-size", "32x24"),
    ("chart", "a.ply", "--out", "heavy/chart", *SIZE, "--frames", "2"),
    ("stability", "a.ply", "--out", "heavy/stability", "--cases", "counts", *SIZE),
    ("colliders", "hulls.scene.json", "--out", "heavy/made.scene.json"),  # CoACD, on its own
    ("eval", "light/a.shift", "capture"),
    ("update", "light/a.shift", "capture", "--where", "box:0,0,0:50,50,50", "--out",
     "heavy/update.shift", "--iterations", "2"),
    ("style", "light/a.shift", "--shape", "fur", "--out", "heavy/style.shift"),
    ("fit", "capture", "--out", "heavy/fit.shift", "--iterations", "2",
     "--final-iterations", "2", "--seeds", "2"),
    ("table", "capture", "--out", "heavy/table", "--iterations", "2",
     "--methods", "joint", "splats", "spz"),
    ("demo", "--out", "heavy/demo", "--views", "2", "--test-views", "1", "--size", "16x16",
     "--processes", "2", "--iterations", "2"),
    ("headless", "--scene", "a.ply", "--out", "heavy/demo2", *SIZE, "--frames", "2",
     "--sweep", "2"),
    ("view", "a.ply", "--screenshot", "heavy/window.png", "--frames", "1"),
    ("vr", "--help"),  # without a runtime it only says so; tests/xr has one
    ("serve", "--help"),  # it ends by Ctrl-C alone; tests/web starts it
    ("cluster", "--help"),  # tests/app/cluster starts its schedulers and workers
    ("extras",),  # tests/app/commands installs some
    ("poses", "--help"),  # tests/decomposition/poses finds some
    ("segment", "--help"),  # tests/app/decomposition cuts some
    (),
]  # fmt: skip


def test_every_command_is_tried():
    assert {words[0] for words in LIGHT + HEAVY if words} == COMMANDS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("words", HEAVY, ids=lambda words: words[0] if words else "none")
def test_heavy_commands_do_neither(folder, capture, tmp_path, words, request):
    more = {}
    if words[:1] == ("view",):
        more = {"DISPLAY": request.getfixturevalue("display")}
    if words[:1] in (("eval",), ("style",), ("update",)):
        run(folder, tmp_path, ("train", "capture", "--out", "light/a.shift", "--iterations", "2"))
    run(folder, tmp_path, words, **more)


def test_an_installed_program_takes_nothing_either(folder, tmp_path):
    """As pip's script starts it: without -P, all folders in a package called shapeshift."""
    package = tmp_path / "site" / "shapeshift"
    package.mkdir(parents=True)
    for name in (*SHIPPED, "assets"):
        (package / name).symlink_to(ROOT / name)
    script = tmp_path / "site" / "start.py"
    script.write_text(INSTALLED)
    program = [sys.executable, str(script)]
    run(folder, tmp_path, ("info", "a.ply"), program)
    run(folder, tmp_path, ("render", "a.ply", "--out", "light/again", *SIZE), program)


@pytest.mark.parametrize("named", ["", ":", ".", "..:x", "{folder}"])
def test_a_pythonpath_that_leads_there_is_not_followed(folder, tmp_path, named):
    """Python itself follows it before launch.py can; the program and its children do not."""
    launch = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import launch\n"
        "launch.hand_over(sys.executable, sys.argv[1:])"
    )
    named = named.format(folder=folder)
    mark = tmp_path / "mark"
    env = poisoned_folder.environment(mark)
    env["AFTER"] = named
    code = f"import os; os.environ['PYTHONPATH'] = os.environ['AFTER']; {launch}"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, CLI[-1], "info", "a.ply"],
        cwd=folder, env=env, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert not mark.exists() and done.returncode == 0, done.stderr


def test_relative_paths_begin_where_the_program_was_started(folder, capture, tmp_path):
    (tmp_path / "here").mkdir()
    for name in ("a.ply", "b.ply"):
        (tmp_path / "here" / name).symlink_to(folder / name)

    def paths(*words):
        run(tmp_path / "here", tmp_path, words)

    paths("render", "a.ply", "--camera", os.path.relpath(capture, tmp_path / "here"),
          "--out", "sub/../pictures", *SIZE)  # fmt: skip
    assert list((tmp_path / "here" / "pictures").glob("*.png"))
    paths("compare", "./a.ply@0", "../here/b.ply@1", *SIZE, "--out", "sheets")
    assert (tmp_path / "here" / "sheets").is_dir()


@pytest.mark.skipif(not first_start.is_ready(True), reason="not started through launch.py test")
def test_the_tests_take_nothing_from_there(folder, tmp_path):
    launch = [sys.executable, str(ROOT / "launch.py")]
    run(folder, tmp_path, ("test", "-q", "tests/runtime_models/files/test_plain_text.py"), launch)


def test_every_python_that_is_started_leaves_the_current_folder_out():
    """Each list that begins with an interpreter goes on with -P or -I."""
    checked = 0
    for path in [ROOT / "launch.py", *(p for name in SHIPPED for p in (ROOT / name).rglob("*.py"))]:
        for node in nodes_of(path):
            if isinstance(node, ast.List) and node.elts:
                first = ast.unparse(node.elts[0])
                if first in ("sys.executable", "python", "str(python)", "PYTHON", "str(PYTHON)"):
                    assert ast.unparse(node.elts[1]) in ("'-P'", "'-I'"), (path, node.lineno)
                    checked += 1
            if isinstance(node, ast.Attribute) and ast.unparse(node) in ("os.system", "os.popen"):
                pytest.fail(f"{path}:{node.lineno} starts a shell")
    # launch.py, first_start.py, CoACD, COLMAP, the gate for outside parsers, the work beside the
    # window, a cluster's, the look at optional parts
    assert checked == 8
