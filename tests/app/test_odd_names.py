"""Every command and kind of output on files whose names are no UTF-8, or steer what reads them.

A name is bytes: in a report, a page, a table it has to become text.  In one process, for speed.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.charts.chart_rows import RowsFile
from shapeshift.app.commands.simulate import line
from shapeshift.app.stability_cases.case_context import CaseFinding
from shapeshift.app.stability_cases.table import open_table
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from tests.support.models import make_random_model
from tests.support.splats.ply_files import some_splats

ODD = {"bytes": b"a\xff\xfe b", "signs": b"<b>&'\"]]><!--\x1b[31m\x07\x9b2J\n={0}$(x)\xe2\x80\xae"}
pytestmark = pytest.mark.skipif(os.name == "nt", reason="names of POSIX are bytes")


def run(*words: object) -> int:
    try:
        return cli.main([os.fsdecode(w) if isinstance(w, bytes) else str(w) for w in words])
    except SystemExit as ended:
        return int(ended.code or 0)


@pytest.fixture(params=ODD)
def folder(request, tmp_path):
    """A folder of an odd name with a package, splats and a picture of that name."""
    name = os.fsdecode(ODD[request.param])
    folder = tmp_path / name
    try:
        folder.mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this file system takes no such name")
    write_package(make_random_model(12, 1, 0, features=4, hidden=(4,)), folder / f"{name}.shift")
    write_ply(some_splats(6, 1), folder / f"{name}.ply")
    Image.fromarray(np.zeros((12, 16, 3), np.uint8)).save(folder / f"{name}.png")
    return folder


OUTPUTS = ("ply", "compressed.ply", "spz", "sog", "splat", "ksplat", "glb", "gltf", "usda", "html",
           "shift", "zip")  # fmt: skip


def commands(folder: Path) -> dict[str, list[object]]:
    name = folder.name
    shift, ply, png = (folder / f"{name}.{ending}" for ending in ("shift", "ply", "png"))
    rows: dict[str, list[object]] = {
        "info": ["info", shift], "info json": ["info", ply, "--json"], "lint": ["lint", ply],
        "lint json": ["lint", ply, "--json"], "info picture": ["info", png],
        "info nothing": ["info", folder / f"{name}.none"], "render none": ["render", png],
        "cameras": ["cameras", shift], "compare": ["compare", png, png],
        "compare sheet": ["compare", png, png, "--out", folder / f"{name}1.png"],
        "train": ["train", folder, "--out", folder / f"{name}2.shift"],
        "poses": ["poses", folder, "--out", folder / "room"],
        "simulate": ["simulate", shift], "thermal": ["thermal", shift, folder],
        "change": ["change", shift, ply], "segment": ["segment", shift, folder],
        "colliders": ["colliders", ply], "measure": ["measure", shift, folder],
        "lod": ["lod", ply, "--out", folder / f"{name}.lod"],
        "web folder": ["export", shift, "--web", "--out", folder / f"{name}.web"],
        "film": ["film", shift, "--out", folder / f"{name}.gif", "--size", "16x12", "--seconds",
                 "0.1", "--drawing", "tiles", "--context", "none"],
        "unknown": [name], "option": ["info", shift, f"--{name}"],
    }  # fmt: skip
    for ending in OUTPUTS:
        rows[f"export {ending}"] = ["export", shift, "--out", folder / f"{name}4.{ending}"]
    return rows


def test_no_name_is_a_fault_of_the_program(folder, capfd, monkeypatch):
    """Each is done, or refused in a sentence: 0, 1 or 2, and what is said is text."""
    faults = {}
    for what, words in commands(folder).items():
        code = run(*words)
        said = capfd.readouterr()
        if code not in (0, 1, 2) or "\x1b[31m" in said.out + said.err or "\x07" in said.err:
            faults[what] = code, said.err[-300:]
    assert not faults
    page = (folder / f"{folder.name}4.html").read_bytes().decode("utf-8")
    assert "<b>&" not in page
    assert page.count("<title>") == 1


@dataclass(frozen=True)
class PlainRow:
    name: str
    ms: float


@pytest.mark.parametrize("raw", ODD.values(), ids=ODD)
def test_rows_about_odd_names_are_text_and_found_again(tmp_path, raw):
    """Tables of chart and stability, lines of simulate: a name is on one line, or as JSON has it.

    Functions, not commands: their names come first, and what they measure takes seconds.
    """
    name = os.fsdecode(raw)
    for rows in range(2):
        file = RowsFile(tmp_path / "rows.csv", PlainRow, [f"of {name}"])
        assert len(file.rows) == rows
        file.add(PlainRow("exact", 2.0))
        table = open_table(tmp_path, f"stability {name}", f"{name}, 3 splats", overwrite=False)
        assert len(table.rows) == rows
        table.add("life", [CaseFinding("memory", 1.0, "<= 2", True, "a reason")])
    assert json.loads(line({"scene": name}).encode()) == {"scene": name}
