"""Networks that ask for more than a machine has: refused before onnxruntime opens them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.evaluation.vgg_distance import VggDistance
from shapeshift.training.gradients import read_network
from shapeshift.training.gradients.read_network import check_network
from shapeshift.training.styles.image_network import ImageNetwork
from tests.support.training.onnx_files import tiny_vgg, vision_transformer, write_model
from tests.support.training.operator_cases import row

PICTURE = {"x": (1, 3, 8, 8)}


def added(rows: list, path: Path, **constants) -> Path:
    """A network that adds to its picture what the rows leave in "r"."""
    return write_model(path, [*rows, row("Add", "x", "r")], PICTURE, ["y"], constants)


def bombs(folder: Path) -> dict[str, Path]:
    many = np.array([1 << 15, 1 << 15, 1 << 10])
    summed = row("ReduceSum", "c", out="r")
    counted = [row("Range", "n", "m", "one", out="i"), row("Cast", "i", out="c", to=1), summed]
    return {
        "a shape": added([row("ConstantOfShape", "s", out="c"), summed], folder / "a.onnx", s=many),
        "a root": added(
            [row("Sqrt", "s", out="f"), row("Cast", "f", out="i", to=7),
             row("ConstantOfShape", "i", out="c"), summed],
            folder / "b.onnx", s=np.array([1e10, 1e10, 1e10]),
        ),
        "a range": added(
            counted, folder / "c.onnx", n=np.array(0), m=np.array(1 << 40), one=np.array(1)
        ),
    }  # fmt: skip


@pytest.mark.parametrize("name", ["a shape", "a root", "a range"])
@pytest.mark.parametrize("reader", [VggDistance, lambda path: ImageNetwork(path, {})])
def test_few_bytes_that_ask_for_all_memory_are_a_sentence(tmp_path, name, reader):
    path = bombs(tmp_path)[name]
    assert path.stat().st_size < 1000
    with pytest.raises(BadFile) as failure:
        reader(path)
    said = str(failure.value)
    assert "of memory" in said and "\n" not in said and said.endswith(".")


def test_the_command_says_it_and_ends_with_2(tmp_path):
    root = Path(__file__).resolve().parents[3]
    path = bombs(tmp_path)["a root"]
    command = [sys.executable, str(root / "launch.py"), "style", root / "assets/workshop.shift",
               "--network", path, "--out", tmp_path / "out.shift"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "of memory" in done.stderr, done.stderr
    assert len(done.stderr.splitlines()) == 1 and not (tmp_path / "out.shift").exists()


def test_the_largest_value_is_the_bound_itself(tmp_path, monkeypatch):
    path = added([row("Exp", "x", out="r")], tmp_path / "n.onnx")
    most = read_network.NUMBER_BYTES * 3 * 8 * 8
    monkeypatch.setattr(read_network, "LARGEST_VALUE", most)
    check_network(path.read_bytes(), path)
    monkeypatch.setattr(read_network, "LARGEST_VALUE", most - 1)
    with pytest.raises(BadFile, match="for a picture of 256x256 pixels"):
        check_network(path.read_bytes(), path)


@pytest.mark.parametrize("make", [tiny_vgg, vision_transformer])
def test_usual_networks_pass(tmp_path, make):
    path = make(tmp_path / "n.onnx")
    check_network(path.read_bytes(), path)


def test_real_networks_pass(data):
    found = [*data.glob("models_*/*.onnx")]
    assert len(found) >= 4
    for path in found:
        check_network(path.read_bytes(), path)
