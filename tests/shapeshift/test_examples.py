"""examples/: each runs as a person starts it, and leaves what it says."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.package.write_package import write_package

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples"
SHORT = {"06_train.py": ["0.2"], "08_film_frames.py": ["4"], "13_film.py": ["1"]}  # seconds, frames
LONG = {"11_objects.py", "12_styles.py", "14_inspect.py", "16_change.py"}  # more than 5 s of a core
FIRST = "01_load_and_render.py"
LEAVES = {
    "01_load_and_render.py": ["01_workshop.png", "01_depth.png"],
    "02_slide.py": ["02_slide.png"],
    "03_regions.py": ["03_regions.png", "03_lens.png"],
    "04_export.py": ["04_rgb.ply", "04_rgb.spz", "04_part.spz", "04_part.png"],
    "05_compare.py": ["05_rgb.spz", "05_diff/0000_sheet.png", "05_diff/0007_difference.png"],
    "06_train.py": ["06_scene.shift", "06_halfway.png"],
    "07_objects_and_physics.py": ["07_dropped.png", "07_thrown.png"],
    "08_film_frames.py": ["08_film/0000.png", "08_film/0003.png"],
    "09_edit_splats.py": ["09_faded.png", "09_wide.png", "09_both.png"],
    "10_full_speed.py": [],
    "12_styles.py": ["12_fur.png", "12_print.png", "12_styles.shift"],
    "11_objects.py": ["11_room.scene.json", "11_without.png", "11_warm.png", "11_fallen.png"],
    "14_inspect.py": [],
    "15_sections.py": ["15_plane.png", "15_beyond.png", "15_box.png"],
    "16_change.py": ["16_change.png", "16_change/places.csv", "16_change/place_001_moved.png"],
    "13_film.py": ["13_film.webp", "13_frames/00000.png", "13_frames/depth/00001.png"],
}


def test_every_example_is_known_and_told_of():
    assert {path.name for path in FOLDER.glob("*.py")} == set(LEAVES)
    told = (FOLDER / "README.md").read_text()
    assert all(f"`{path.name}`" in told for path in FOLDER.iterdir() if path.suffix != ".md")


@pytest.fixture(scope="module")
def thin(tmp_path_factory) -> Path:
    """Every tenth anchor of ss.DEMO: what an example does is the same with fewer splats."""
    path = tmp_path_factory.mktemp("demo") / "demo.shift"
    write_package(read_package(ss.DEMO).with_anchors(slice(None, None, 10)), path)
    return path


def check_what_it_left(name: str, folder: Path) -> None:
    for file in LEAVES[name]:
        path = folder / "out" / file
        assert path.stat().st_size > 0
        if path.suffix == ".png":  # something is in the picture
            assert np.asarray(Image.open(path)).std() > 5


@pytest.mark.parametrize("name", [n for n in LEAVES if n not in LONG])
def test_it_leaves_what_it_says(name, thin, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(ss, "DEMO", thin)
    monkeypatch.setattr(sys, "argv", [name, *SHORT.get(name, [])])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(FOLDER / name), run_name="__main__")
    assert not capfd.readouterr().err, "a library says nothing by itself"
    check_what_it_left(name, tmp_path)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n != FIRST)) for n in LEAVES]
)
def test_it_runs_from_anywhere(name, tmp_path):
    """As a person starts it whose current folder is another one, beside a scene.py of his own."""
    (tmp_path / "scene.py").write_text("raise SystemExit('a stranger was imported')\n")
    done = subprocess.run(
        [sys.executable, str(FOLDER / name), *SHORT.get(name, [])], cwd=tmp_path, timeout=300,
        capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(tmp_path)])},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert not done.stderr, "a library says nothing by itself"
    check_what_it_left(name, tmp_path)


@pytest.fixture(params=[False, pytest.param(True, marks=pytest.mark.slow)], ids=["thin", "whole"])
def demo(request, tmp_path, monkeypatch) -> None:
    """ss.DEMO, or every twentieth anchor of it: the float64 reference takes a splat at a time."""
    if not request.param:
        thin = read_package(ss.DEMO).with_anchors(slice(None, None, 20))
        write_package(thin, tmp_path / "demo.shift")
        monkeypatch.setattr(ss, "DEMO", tmp_path / "demo.shift")


def test_the_notebook_runs_cell_by_cell(demo, tmp_path, monkeypatch):
    """Without Jupyter: what a cell ends with is shown, and pictures show themselves."""
    import ast

    book = json.loads((FOLDER / "tour.ipynb").read_text())
    assert book["nbformat"] == 4
    cells = ["".join(c["source"]) for c in book["cells"] if c["cell_type"] == "code"]
    assert len(cells) >= 5
    assert not any(c.get("outputs") for c in book["cells"])
    monkeypatch.chdir(tmp_path)
    names, shown = {}, []
    for cell in cells:
        tree = ast.parse(cell)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "cell", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
            shown.append(value._repr_png_() if hasattr(value, "_repr_png_") else repr(value))
            if hasattr(value, "_repr_html_"):
                shown.append(value._repr_html_())
    pictures = [each for each in shown if isinstance(each, bytes)]
    assert len(pictures) >= 4 and all(p.startswith(b"\x89PNG") for p in pictures)
    assert any("stops RGB, Thermal, Opened" in each for each in shown if isinstance(each, str))
