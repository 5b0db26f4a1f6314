"""Imports go down only: one table, one test.  And each folder stays within what it may know."""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from tests.support.sources import nodes_of, parsed
from tools.program import architecture, counts

ROOT = Path(__file__).resolve().parents[2]

# folder: folders of ours that it may import (itself is always allowed)
MAY_IMPORT = {
    "runtime_models": set(),
    "rasterizer": set(),
    "scene": {"runtime_models"},
    "renderer": {"rasterizer", "scene", "runtime_models"},
    "training": {"rasterizer", "scene", "runtime_models"},
    "decomposition": {"rasterizer", "scene", "runtime_models"},
    "vr": {"renderer", "scene", "runtime_models"},
    "app": {
        "vr",
        "renderer",
        "decomposition",
        "training",
        "rasterizer",
        "scene",
        "runtime_models",
    },
    "shapeshift": {
        "app",
        "renderer",
        "decomposition",
        "training",
        "rasterizer",
        "scene",
        "runtime_models",
    },
}
# folder: outside packages it must never see
NEVER = {
    "runtime_models": {"xr", "rapier3d", "moderngl", "torch", "pyopencl", "glfw", "imgui_bundle"},
    "rasterizer": {"xr", "rapier3d", "moderngl", "torch", "PIL", "onnx", "onnxruntime", "glfw"},
    "scene": {"xr", "moderngl", "torch", "pyopencl", "glfw"},
    "renderer": {"xr", "rapier3d", "torch", "glfw", "imgui_bundle", "moderngl_window"},
    "decomposition": {"xr", "moderngl", "glfw", "imgui_bundle", "torch"},
    "training": {"xr", "rapier3d", "moderngl", "glfw", "imgui_bundle", "torch"},
    "vr": {"rapier3d", "torch", "imgui_bundle", "moderngl_window", "pyopencl"},
    "app": {"rapier3d", "torch", "xr"},
}


@cache
def imported(path: Path, everywhere: bool = True) -> set[str]:
    """First names of the modules a file imports; of shapeshift.scene.pose `scene`.

    At its top level alone when not everywhere.
    """
    names = set()
    for node in nodes_of(path) if everywhere else parsed(path).body:
        if isinstance(node, ast.Import):
            names |= {folder_of(a.name) for a in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            names.add(folder_of(node.module))
    return names


def folder_of(module: str) -> str:
    """The folder of ours that a module lies in, or the first name of another package."""
    names = module.split(".")
    ours = MAY_IMPORT.keys() - {"shapeshift"}
    assert names[0] not in ours, f"{module}: our modules are called shapeshift.{module}"
    return names[1] if names[0] == "shapeshift" and len(names) > 1 else names[0]


def files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def test_every_folder_is_in_the_table():
    folders = {p.parent.name for p in ROOT.glob("*/__init__.py")} - {"tests"}
    assert folders - {"assets", "web"} == set(MAY_IMPORT)  # they hold no Python


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_imports_go_down(folder):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files(folder)
        for name in sorted(imported(path) & MAY_IMPORT.keys() - MAY_IMPORT[folder] - {folder})
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("folder", [f for f in MAY_IMPORT if f != "shapeshift"])
def test_nothing_of_the_program_needs_what_a_library_shows(folder):
    assert not [path for path in files(folder) if "api" in imported(path)]


@pytest.mark.parametrize("folder", NEVER)
def test_folders_do_not_know_what_is_not_theirs(folder):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files(folder)
        for name in sorted(imported(path) & NEVER[folder])
    ]
    assert not wrong, "\n".join(wrong)


def test_modes_load_training_only_inside_the_subcommand():
    wrong = [
        str(path.relative_to(ROOT))
        for path in files("app")
        if path.parent.name != "training"  # the commands that train, each loaded when it is asked
        and "training" in imported(path, everywhere=False)
    ]
    assert not wrong, "\n".join(wrong)


def test_the_physics_engine_is_loaded_only_when_a_world_is_made():
    loading = [
        str(path.relative_to(ROOT))
        for path in files("scene")
        if "rapier3d" in imported(path, everywhere=False)
    ]
    assert not loading


def test_launch_uses_the_standard_library_alone():
    import sys

    own = {"app"}  # app/first_start.py
    assert imported(ROOT / "launch.py") <= set(sys.stdlib_module_names) | own
    assert imported(ROOT / "app" / "first_start.py") <= set(sys.stdlib_module_names)
    assert not (ROOT / "app" / "__init__.py").read_text()


def module_of(path: Path) -> str:
    """The name under which a file is imported, in a checkout and installed alike."""
    names = path.relative_to(ROOT).with_suffix("").parts
    names = names[:-1] if names[-1] == "__init__" else names
    return ".".join(names if names[0] == "shapeshift" else ("shapeshift", *names))


def modules() -> dict[str, Path]:
    """Every module of ours by its name."""
    return {module_of(p): p for folder in ("shapeshift", *MAY_IMPORT) for p in files(folder)}


@cache
def import_graph() -> dict[str, set[str]]:
    """What each module imports of ours, also inside functions and for types alone."""
    known = modules()
    graph = {name: set() for name in known}
    for name, path in known.items():
        for node in nodes_of(path):
            if isinstance(node, ast.Import):
                graph[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                below = {f"{node.module}.{alias.name}" for alias in node.names}
                graph[name] |= below & known.keys() or {node.module}
    return {name: (imported & known.keys()) - {name} for name, imported in graph.items()}


def circle_in(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a ring, in order; [] where there is none."""
    done, on_the_way = set(), []

    def visit(name: str) -> list[str]:
        if name in on_the_way:
            return [*on_the_way[on_the_way.index(name) :], name]
        if name not in done:
            on_the_way.append(name)
            for other in sorted(graph[name]):
                if found := visit(other):
                    return found
            done.add(on_the_way.pop())
        return []

    return next((found for name in graph if (found := visit(name))), [])


def test_a_circle_is_found():
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c", "b"]
    assert circle_in({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_no_modules_import_each_other_in_a_circle():
    graph = import_graph()
    assert sum(map(len, graph.values())) > 1000  # 2,300 now: it sees what there is
    assert not circle_in(graph)


def test_the_table_allows_no_more_than_there_is():
    rooms = architecture.rooms_of(import_graph(), modules())
    assert {room.name: set(room.imports) for room in rooms} == MAY_IMPORT


def test_the_map_of_the_program_is_true():
    page = architecture.PAGE.read_text("utf-8")
    made = architecture.made(import_graph(), modules(), page)
    found = (page, architecture.PICTURE.read_text("utf-8"))
    assert found == made, "run python3 tools/program/architecture.py and commit docs/architecture.*"
    assert len(re.findall(r"[^\W\d][\w./-]*", page)) < 700


def test_a_number_of_the_map_is_made_anew_where_it_is_a_tenth_off():
    assert [architecture.settled(n, 100) for n in (89, 91, 110, 112, 20, 0)] == [
        89, 100, 100, 110, 20, 0,
    ]  # fmt: skip
    assert architecture.settled(21_349, None) == 21_000
    assert architecture.floors_of({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == dict(a=2, b=1, c=0)


def function_at(name: str, known: dict[str, Path]) -> ast.AST | None:
    """Of module.function or module.Class.function without our first name; None: there is none."""
    parts = name.split(".")
    for end in range(len(parts) - 1, 0, -1):
        if (path := known.get(".".join(["shapeshift", *parts[:end]]))) is not None:
            node: ast.AST | None = parsed(path)
            for part in parts[end:]:
                body = getattr(node, "body", [])
                node = next((n for n in body if getattr(n, "name", "") == part), None)
            return node if isinstance(node, ast.FunctionDef) else None
    return None


def test_four_ways_lead_through_the_program_as_the_map_says():
    """Each stay is there, and is called by one before it, in its way or one above."""
    ways = architecture.ways_in(architecture.PAGE.read_text("utf-8"))
    assert len(ways) == 4 and all(5 < len(way) <= 8 for way in ways.values())
    called: set[str] = set()
    wrong, known = [], modules()
    for way in ways.values():
        for number, (name, called_as) in enumerate(way):
            function = function_at(name, known)
            if function is None or (number and called_as not in called):
                wrong.append(name)
            calls = (n.func for n in ast.walk(function or ast.Pass()) if isinstance(n, ast.Call))
            called |= {getattr(f, "attr", None) or getattr(f, "id", "") for f in calls}
    assert not wrong
    assert not [n for n in ("scene.control.none", "none.control_of") if function_at(n, known)]


def test_a_front_door_leads_to_every_module():
    """By imports or by a name in a table; what tests and tools alone use lies with them."""
    graph, known = import_graph(), modules()
    assert not counts.unreached(graph, known)
    beside = {"shapeshift.scene.lonely": ROOT / "scene" / "pose.py"}
    assert counts.unreached(graph | {name: set() for name in beside}, known | beside) == [*beside]


# shelf of app/editor: shelves of it that it may import (itself is always allowed)
EDITOR_MAY_IMPORT = {"state": set(), "panels": {"state"}, "window": {"state", "panels"}}
OVERLAYS = {"imgui_bundle", "glfw", "moderngl_window"}  # what draws and listens


@pytest.mark.parametrize("shelf", EDITOR_MAY_IMPORT)
def test_the_editors_state_lies_under_its_panels_and_both_under_its_window(shelf):
    others = EDITOR_MAY_IMPORT.keys() - EDITOR_MAY_IMPORT[shelf] - {shelf}
    graph = import_graph()
    wrong = [
        f"{name} imports {imported}"
        for name in sorted(graph)
        if name.startswith(f"shapeshift.app.editor.{shelf}.")
        for imported in sorted(graph[name])
        if imported.startswith(tuple(f"shapeshift.app.editor.{other}." for other in others))
    ]
    assert not wrong, "\n".join(wrong)


def test_the_editors_state_knows_no_window_and_no_overlay():
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files("app/editor/state")
        for name in sorted(imported(path) & OVERLAYS)
    ]
    assert not wrong, "\n".join(wrong)
    assert not [p for p in files("app/editor/panels") if "glfw" in imported(p)]


def test_no_part_of_the_editor_is_handed_the_whole_viewer():
    """It is made in desktop.py, where the program begins, and named nowhere else."""
    naming = []
    for path in files("app/editor"):
        if path.name in ("viewer.py", "desktop.py"):
            continue
        for node in nodes_of(path):
            name = getattr(node, "id", None) or getattr(node, "arg", None)
            named = (name, getattr(node, "attr", None), getattr(node, "value", None))
            if "viewer" in named or "Viewer" in named:
                naming.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not naming
    tree = ast.parse((ROOT / "app" / "editor" / "window" / "viewer.py").read_text())
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    handed = [arg for call in calls for arg in [*call.args, *(k.value for k in call.keywords)]]
    assert not [arg for arg in handed if isinstance(arg, ast.Name) and arg.id == "self"]


SOURCES = (".py", ".cl", ".glsl", ".comp", ".vert", ".frag")
MOST_FILES = 20  # of a folder: more want shelves


def test_no_folder_holds_more_than_20_files():
    tops = [p for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith(".")]
    counts = Counter(p.parent for top in tops for p in top.rglob("*") if p.suffix in SOURCES)
    named = {folder.relative_to(ROOT).as_posix(): n for folder, n in counts.items()}
    assert len(named) > 50  # it sees what there is
    assert not {f: n for f, n in named.items() if n > MOST_FILES}


GUIDE, MOST_LINES = 400, 420  # of a file: what reads on may be a little longer, few are
MOST_LONG = 6


def test_few_files_are_over_400_lines():
    paths = [p for p in ROOT.rglob("*.py") if ".venv" not in p.parts]
    long = {
        str(p.relative_to(ROOT)): n for p in paths if (n := len(p.read_text().splitlines())) > GUIDE
    }
    assert len(long) <= MOST_LONG and max(long.values(), default=0) <= MOST_LINES, long


def test_no_function_is_over_60_lines():
    long = []
    for folder in MAY_IMPORT:
        for path in files(folder):
            for node in nodes_of(path):
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                    lines = node.end_lineno - node.lineno + 1
                    if lines > 60:
                        long.append(f"{path.relative_to(ROOT)}:{node.name} has {lines} lines")
    assert not long, "\n".join(long)


def test_what_tests_share_lies_in_support():
    """A test file that imports from another one breaks when that is renamed or split."""
    wrong, asks = [], re.compile(r"from [\w.]*\b(test_|conftest)\w* import")
    for path in files("tests"):
        for node in nodes_of(path) if asks.search(path.read_text("utf-8")) else ():
            module = node.module if isinstance(node, ast.ImportFrom) else ""
            if module.split(".")[-1].startswith(("test_", "conftest")):
                wrong.append(f"{path.relative_to(ROOT)}: from {module}")
    assert not wrong, "\n".join(wrong)
