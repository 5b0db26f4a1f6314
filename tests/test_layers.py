"""Imports go down only: one table, one test.  And each folder stays within what it may know."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# folder: folders of ours that it may import (itself is always allowed)
MAY_IMPORT = {
    "runtime_models": set(),
    "rasterizer": set(),
    "scene": {"runtime_models"},
    "renderer": {"rasterizer", "scene", "runtime_models"},
    "training": {"rasterizer", "scene", "runtime_models"},
    "vr": {"renderer", "scene", "runtime_models"},
    "app": {"vr", "renderer", "training", "rasterizer", "scene", "runtime_models"},
    "shapeshift": {"app", "renderer", "training", "rasterizer", "scene", "runtime_models"},
}
# folder: outside packages it must never see
NEVER = {
    "runtime_models": {"xr", "rapier3d", "moderngl", "torch", "pyopencl", "glfw", "imgui_bundle"},
    "rasterizer": {"xr", "rapier3d", "moderngl", "torch", "PIL", "onnx", "onnxruntime", "glfw"},
    "scene": {"xr", "moderngl", "torch", "pyopencl", "glfw"},
    "renderer": {"xr", "rapier3d", "torch", "glfw", "imgui_bundle", "moderngl_window"},
    "training": {"xr", "rapier3d", "moderngl", "glfw", "imgui_bundle", "torch"},
    "vr": {"rapier3d", "torch", "imgui_bundle", "moderngl_window", "pyopencl"},
    "app": {"rapier3d", "torch", "xr"},
}


def imported(path: Path, everywhere: bool = True) -> set[str]:
    """First names of the modules a file imports; of shapeshift.scene.pose `scene`.

    At its top level alone when not everywhere.
    """
    tree = ast.parse(path.read_text())
    names = set()
    for node in ast.walk(tree) if everywhere else tree.body:
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
    assert folders - {"assets"} == set(MAY_IMPORT)


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
        if path.name not in ("train.py", "evaluate.py", "demo.py")
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


def test_no_file_is_over_400_lines():
    paths = [p for p in ROOT.rglob("*.py") if ".venv" not in p.parts]
    long = {
        str(p.relative_to(ROOT)): n for p in paths if (n := len(p.read_text().splitlines())) > 400
    }
    assert not long


def test_no_function_is_over_60_lines():
    long = []
    for folder in MAY_IMPORT:
        for path in files(folder):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                    lines = node.end_lineno - node.lineno + 1
                    if lines > 60:
                        long.append(f"{path.relative_to(ROOT)}:{node.name} has {lines} lines")
    assert not long, "\n".join(long)
