"""CONTRIBUTING.md: what it says is so.  Its steps are walked with a small thing of each kind."""

import ast
import re
import struct
import sys
import types
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.command_line import POSITIONAL, arguments_of
from shapeshift.runtime_models.splats import formats as formats_module
from shapeshift.runtime_models.splats.formats import Format
from shapeshift.runtime_models.splats.plain_splats import RawSplats, empty_splats
from shapeshift.training.settings import TrainSettings

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
STEPS = 6


def test_every_path_that_it_names_is_there():
    words = re.findall(r"`([^`]+)`", TEXT)
    paths = [w for w in words if re.fullmatch(r"[\w./-]+/[\w.-]*|[\w-]+\.(py|md)", w)]
    paths = [w for w in paths if "NAME" not in w and "_X" not in w]
    assert len(set(paths)) > 30
    missing = [w for w in paths if not (ROOT / w).exists()]
    assert not missing


def test_each_way_has_six_steps():
    sections = re.split(r"^## ", TEXT, flags=re.M)[2:-1]
    assert [section.split("\n")[0] for section in sections] == [
        "A reader of another file format", "A pass of the renderer", "A command",
        "A training option",
    ]  # fmt: skip
    for section in sections:
        numbers = re.findall(r"^(\d)\. ", section, re.M)
        assert numbers == [str(n) for n in range(1, STEPS + 1)], section[:40]


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("formats", "runtime_models/splats/formats.py"),
        ("RawSplats", "runtime_models/splats/plain_splats.py"),
        ("empty_splats", "runtime_models/splats/plain_splats.py"),
        ("COMMANDS", "app/cli.py"),
        ("ReadingOptions", "app/opening.py"),
        ("TrainSettings", "training/settings.py"),
        ("print_json", "app/terminal.py"),
        ("say", "app/terminal.py"),
    ],
)
def test_every_name_that_it_uses_stands_where_it_says(name, file):
    assert f"`{name}" in TEXT
    tree = ast.parse((ROOT / file).read_text())
    names = {getattr(node, "name", "") for node in tree.body}
    names |= {t.id for node in tree.body if isinstance(node, ast.Assign) for t in node.targets}
    assert name in names


def test_a_reader_is_one_function_and_one_row(tmp_path, monkeypatch):
    """A format of our own: a mark, a count, means as floats.  Everything else comes by itself."""

    def is_dots(head: bytes, path: Path) -> bool:
        return head[:4] == b"DOTS"

    def read_raw_dots(path: Path, reading) -> RawSplats:
        data = path.read_bytes()
        (count,) = struct.unpack_from("<I", data, 4)
        arrays = empty_splats(count, 1, reading.memory)
        arrays["means"][:] = np.frombuffer(data, np.float32, 3 * count, 8).reshape(-1, 3)
        arrays["scales"][:], arrays["opacity"][:], arrays["sh"][:] = np.log(0.05), 4.0, 0.5
        arrays["wxyz"][:] = 1, 0, 0, 0
        return RawSplats(**arrays, file=path.name, format="dots")

    kept = formats_module.formats
    row = Format("dots", (".dots",), is_dots, read_raw_dots)
    monkeypatch.setattr(formats_module, "formats", lambda: (*kept(), row))
    means = np.array([[0, 0, 0], [0, 1, 0], [np.nan, 0, 0]], np.float32)
    path = tmp_path / "three.dots"
    path.write_bytes(b"DOTS" + struct.pack("<I", 3) + means.tobytes())
    scene = ss.load(path)
    assert scene.splat_count == 2, "the one that is nowhere was dropped"
    assert scene.findings[0].done == "dropped" and scene.info()["format"] == "dots"
    np.testing.assert_allclose(scene.model.means, [[0, 0, 0], [0, -1, 0]], atol=1e-6)  # COLMAP's up
    assert cli.main(["info", str(path)]) == 0


def test_a_command_is_a_dataclass_and_a_function(monkeypatch, capsys):
    @dataclass(frozen=True)
    class Options:
        """Greet somebody."""

        name: Annotated[str, POSITIONAL]
        times: int = 1

    def run(options: Options) -> int:
        from shapeshift.app.terminal import print_text

        print_text(" ".join([f"hello {options.name}"] * options.times))
        return 0

    module = types.ModuleType("shapeshift.app.commands.greet")
    module.Options, module.run = Options, run
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(cli.COMMANDS, "greet", ("commands.greet", "greet somebody"))
    assert cli.main(["greet", "Ada", "--times", "2"]) == 0
    assert capsys.readouterr().out == "hello Ada hello Ada\n"
    assert cli.main(["greet", "Ada", "--tims", "2"]) == 2
    assert "did you mean --times" in capsys.readouterr().err
    assert cli.main(["greet"]) == 2 and "NAME" in capsys.readouterr().err


def test_every_training_setting_says_what_it_is_and_python_takes_it():
    texts = {each.field.name: each.help for each in arguments_of(TrainSettings)}
    assert texts.keys() == {field.name for field in fields(TrainSettings)}
    assert all(len(text) > 15 and text.endswith((".", ")")) for text in texts.values()), texts
    with pytest.raises(ss.BadFile):  # every field is taken; the capture is what is missing
        ss.train("no capture", **TrainSettings().as_dict())


def test_every_kernel_is_named_by_the_module_that_launches_it_or_a_kernel_that_includes_it():
    kinds = ("*.py", "*.cl")
    folders = [ROOT / name for name in ("rasterizer", "training")]
    texts = {p: p.read_text() for f in folders for kind in kinds for p in f.rglob(kind)}
    kernels = [p for f in folders for p in (f / "kernels").glob("*.cl")]
    assert len(kernels) > 20
    for kernel in kernels:
        others = "".join(text for path, text in texts.items() if path != kernel)
        assert re.search(rf"\b{kernel.stem}\b", others), kernel.name
