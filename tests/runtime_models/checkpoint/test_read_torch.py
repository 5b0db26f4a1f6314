"""Tensors out of torch's archives: equal to torch's own, and nothing in a file ever runs."""

import os
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.checkpoint.read_torch import (
    read_script,
    read_tensors,
)
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.scaffold.scaffold_files import ACTIVATIONS, STEMS, mlp_of
from tests.support.models import run_in_numpy
from tests.support.splats import torch_files as made

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "torch_2_15"
OLDER = FIXTURES.with_name("torch_1_12")  # what Scaffold-GS asks for


@pytest.fixture(scope="module", params=[FIXTURES, OLDER], ids=lambda folder: folder.name)
def folder(request) -> Path:
    """Files by one version of torch."""
    return request.param


@pytest.fixture(scope="module")
def known(folder) -> dict[str, np.ndarray]:
    """What torch itself makes of them."""
    with np.load(folder / "scaffold_torch.npz") as arrays:
        return dict(arrays)


@pytest.mark.parametrize("role", STEMS)
@pytest.mark.parametrize("how", ["script", "state dict"])
def test_networks_give_what_torch_gives(folder, known, role, how):
    stem = STEMS[role]
    if how == "script":
        tensors = read_tensors(folder / f"scaffold_{stem}.pt")
    else:
        every = read_tensors(folder / "scaffold_checkpoints.pth")
        tensors = {name: t for name, t in every.items() if name.startswith(f"{stem}.")}
        assert len(tensors) == 4
    found = run_in_numpy(mlp_of(tensors, stem, ACTIVATIONS[role]), known[f"{stem}.input"])
    if role == "bank":
        found = np.exp(found) / np.exp(found).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(found, known[f"{stem}.output"], rtol=0, atol=1e-6)


def test_names_and_shapes_of_a_script(folder):
    found = read_tensors(folder / "scaffold_opacity_mlp.pt")
    shapes = {"0.weight": (8, 12), "0.bias": (8,), "2.weight": (2, 8), "2.bias": (2,)}
    assert {name: t.shape for name, t in found.items()} == shapes
    _, modules = read_script(folder / "scaffold_opacity_mlp.pt")
    assert modules == {"": "Sequential", "0": "Linear", "1": "ReLU", "2": "Linear", "3": "Tanh"}
    assert all(t.dtype == np.float32 and not t.flags.writeable for t in found.values())


def test_the_table_of_appearances(folder, known):
    for file, name in (
        ("scaffold_embedding_appearance.pt", "embedding.weight"),
        ("scaffold_checkpoints.pth", "appearance.embedding.weight"),
    ):
        table = read_tensors(folder / file)[name]
        assert np.array_equal(table, known["embedding_appearance.output"])


def test_every_kind_of_tensor_is_torchs_own(folder, known):
    """Types, transposed and cut views, a scalar, an empty one, a parameter; the rest is left."""
    found = read_tensors(folder / "torch_kinds.pth")
    wanted = {name.removeprefix("kinds."): a for name, a in known.items() if "kinds." in name}
    assert found.keys() == wanted.keys()
    for name, array in wanted.items():
        assert found[name].dtype == array.dtype, name
        assert np.array_equal(found[name], array), name


def test_what_we_write_by_hand_is_read_back(tmp_path):
    rng = np.random.default_rng(0)
    arrays = {
        "0.weight": rng.normal(size=(4, 3)).astype(np.float32),
        "half": rng.normal(size=5).astype(np.float16),
        "long": np.arange(3),
    }
    found = read_tensors(made.write_tensors(tmp_path / "a.pth", arrays))
    for name, array in arrays.items():
        assert np.array_equal(found[name], array)


def test_old_files_and_other_files_are_refused_by_name(tmp_path):
    with pytest.raises(BadFile, match=r"before version 1\.6.*save it again"):
        read_tensors(FIXTURES / "torch_old.pth")
    for data in (b"", b"PK", b"\x00" * 50, b"PK\x03\x04" + b"\x00" * 60):
        path = tmp_path / "bad.pt"
        path.write_bytes(data)
        with pytest.raises(BadFile, match="no archive of torch"):
            read_tensors(path)


def refused(tmp_path: Path, index: bytes, match: str, storages: dict | None = None) -> None:
    """An archive with that index gives one sentence and touches nothing."""
    path = tmp_path / "bad.pth"
    path.write_bytes(made.archive(index, storages or {}))
    before, cwd = sorted(tmp_path.rglob("*")), os.getcwd()
    with pytest.raises(BadFile, match=match) as error:
        read_tensors(path)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 300
    assert sorted(tmp_path.rglob("*")) == before
    assert os.getcwd() == cwd


class Runs:
    """What a hostile file would have Python's own unpickler call."""

    def __init__(self, function, *given) -> None:
        self.call = (function, given)

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize("function", [os.system, eval, exec, __import__, open, getattr, os.remove])
def test_nothing_is_called(tmp_path, function, protocol):
    mark = tmp_path / "mark"
    hostile = {"weight": Runs(function, f"open({str(mark)!r}, 'w')")}
    refused(tmp_path, pickle.dumps(hostile, protocol), "names|uses|damaged")
    assert not mark.exists()


@pytest.mark.parametrize(
    ("module", "word"),
    [
        ("os", "system"), ("posix", "system"), ("builtins", "eval"), ("__builtin__", "eval"),
        ("torch", "load"), ("torch.hub", "load"), ("torch._utils", "_import_dotted_name"),
        ("torch.jit._pickle", "build_tensor_from_id"), ("numpy", "load"),
        ("collections", "Counter"),
        ("__torch__x", "Linear"), ("__torch__.a", "b.c"), ("torch", "FloatStorage.from_file"),
    ],
)  # fmt: skip
def test_every_other_name_is_refused_by_name(tmp_path, module, word):
    for make in (b"(t", b")"):
        index = made.program(made.name(module, word) + make + b"R")
        refused(tmp_path, index, rf"names '{module}\.{word}'")


@pytest.mark.parametrize(
    "body",
    [
        b"(i__torch__.a\nB\n",  # INST
        b"(c__torch__\nA\no",  # OBJ
        b"\x82\x01",  # EXT1
        b"c__torch__\nA\n)}\x92",  # NEWOBJ_EX
        b"c__torch__\nA\n\x81" * 2,
        b"c__torch__\nA\n)R",  # a module is made by NEWOBJ, never called
        b"ctorch\nFloatStorage\n)R",
        b"ctorch\nFloatStorage\n)\x81",
        b"]}b",  # a list has no state
        b"c__torch__\nA\n)\x81]b",  # a state is a dictionary
        b"c__torch__\nA\n)\x81}(X\x01\x00\x00\x00aNub}(X\x01\x00\x00\x00bNub",  # state twice
        b"ccollections\nOrderedDict\n(](NNete)R",
        b"P1\n",  # PERSID
        b"NQ", b"(tQ", b"}(NNu", b"}(]Nu", b"}((tNu",
        b"}(\x8a\x09" + b"\x00" * 8 + b"\x01Nu",
        b"h\x07", b"0", b"t", b"u", b"(", b"\x8b\xff\xff\xff\x7f", b"X\xff\xff\xff\xff", b"", b"NN",
        b"ctorch._utils\n_rebuild_tensor_v2\n(NK\x00)(tR", b"ctorch._utils\n_rebuild_tensor_v2\n)R",
        b"\x96\x00\x00\x00\x00\x00\x00\x00\x00", b"\x8a\xff" + b"\x7f" * 255,
        b"I" + b"9" * 9000 + b"\n",
    ],
)  # fmt: skip
def test_what_no_tensor_needs_is_one_sentence(tmp_path, body):
    refused(tmp_path, made.program(body), "damaged|uses|holds no tensor|save it again")


def test_setstate_is_never_looked_for(tmp_path):
    """A state goes into a bare dictionary, whatever its names are."""
    weight = made.tensor("0", 2, [2], [1])
    state = b"}(" + made.text("__setstate__") + made.text("os.system") + made.text("w") + weight
    body = b"c__torch__.A\nB\n)\x81" + state + b"ub"
    path = tmp_path / "a.pt"
    path.write_bytes(
        made.archive(made.program(body), {"0": np.array([1, 2], np.float32).tobytes()})
    )
    found = read_tensors(path)
    assert list(found) == ["w"]
    assert found["w"].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("size", "stride", "offset", "fits"),
    [
        ([2, 3], [3, 1], 0, True), ([3, 2], [1, 3], 0, True), ([2], [5], 0, True),
        ([], [], 5, True), ([0, 7], [7, 1], 0, True), ([0, 3], [3, 1], 900, True),
        ([2, 3], [3, 1], 1, False), ([7], [1], 0, False), ([2], [6], 0, False), ([], [], 6, False),
        ([1], [1], 1 << 62, False), ([2], [1 << 62], 0, False), ([1 << 62], [0], 0, False),
        ([7], [0], 0, False), ([1] * 9, [1] * 9, 0, False), ([0, 1 << 62], [1, 1], 0, False),
        ([-1], [1], 0, False), ([2], [-1], 3, False), ([2], [1, 1], 0, False),
    ],
)  # fmt: skip
def test_a_tensor_lies_within_its_storage(tmp_path, size, stride, offset, fits):
    index = made.program(made.dictionary({"w": made.tensor("0", 6, size, stride, offset)}))
    storage = {"0": np.arange(6, dtype=np.float32).tobytes()}
    if not fits:
        refused(tmp_path, index, "reaches beyond its storage|damaged", storage)
        return
    path = tmp_path / "a.pth"
    path.write_bytes(made.archive(index, storage))
    assert read_tensors(path)["w"].shape == tuple(size)


@pytest.mark.parametrize("count", [0, 5, 7, 1 << 40, 1 << 62, -1])
def test_a_storage_has_what_it_promises(tmp_path, count):
    index = made.program(made.dictionary({"w": made.tensor("0", count, [1], [1])}))
    storage = {"0": np.arange(6, dtype=np.float32).tobytes()}
    refused(tmp_path, index, "stored|bytes|save it again", storage)


@pytest.mark.parametrize("key", ["../../etc/passwd", "/etc/passwd", "..\\x", "", "1" * 5000, "\0"])
def test_a_storages_name_is_never_a_path(tmp_path, key):
    index = made.program(made.dictionary({"w": made.tensor(key, 1, [1], [1])}))
    refused(tmp_path, index, "lacks")


def test_one_storage_is_of_one_type(tmp_path):
    two = {
        "a": made.tensor("0", 4, [4], [1]),
        "b": made.tensor("0", 2, [2], [1], kind="DoubleStorage"),
    }
    storage = {"0": np.zeros(4, np.float32).tobytes()}
    refused(tmp_path, made.program(made.dictionary(two)), "as two types|stored", storage)


def test_shared_parts_do_not_unfold_without_end(tmp_path):
    """Forty lists, each holding the one before twice: 2^40 names out of 300 bytes."""
    lists = b"".join(
        b"](h" + bytes([i]) + b"h" + bytes([i]) + b"eq" + bytes([i + 1]) + b"0" for i in range(40)
    )
    refused(tmp_path, made.program(b"]q\x000" + lists + b"h\x28"), "beyond reason")
    refused(tmp_path, made.program(b"]q\x00h\x00a"), "beyond reason")  # a list in itself
    deep = b"]" * 1000 + b"a" * 999
    refused(tmp_path, made.program(deep), "beyond reason")
    refused(tmp_path, made.program(b"N0" * 200_000 + b"N"), "steps")
    long = {"w" * 2000: made.tensor("0", 0, [0], [1])}
    refused(tmp_path, made.program(made.dictionary(long)), "beyond reason", {"0": b""})


def test_members_are_stored_once_and_as_large_as_they_say(tmp_path):
    index = made.program(made.dictionary({"w": made.tensor("0", 1, [1], [1])}))
    path = tmp_path / "bad.pth"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a/data.pkl", index)
    with pytest.raises(BadFile, match="compressed"):
        read_tensors(path)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a/data.pkl", index)
        file.writestr("b/data.pkl", index)
    with pytest.raises(BadFile, match="2 indexes"):
        read_tensors(path)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a/data.pkl", index)
        file.writestr("a/byteorder", b"big")
        file.writestr("a/data/0", b"\0\0\0\0")
    with pytest.raises(BadFile, match="order"):
        read_tensors(path)
    data = bytearray(made.archive(index, {"0": b"\0\0\0\0"}))
    at = data.rfind(b"archive/data/0") - 46  # its entry in the directory: sizes at 20 and 24
    data[at + 20 : at + 28] = b"\xf0\xff\xff\x7f" * 2
    path.write_bytes(data)
    with pytest.raises(BadFile, match="is said to have 2,147,483,632 bytes"):
        read_tensors(path)


def test_any_cut_and_any_flipped_byte_is_a_sentence_or_tensors(tmp_path):
    """A small fuzz over a genuine file: nothing but tensors or BadFile comes out."""
    rng = np.random.default_rng(0)
    whole = (FIXTURES / "scaffold_opacity_mlp.pt").read_bytes()
    path, sentences = tmp_path / "bad.pt", 0
    for round_ in range(400):
        data = bytearray(whole)
        if round_ % 4 == 0:
            del data[rng.integers(len(data)) :]
        else:
            for at in rng.integers(len(data), size=rng.integers(1, 8)):
                data[at] = rng.integers(256)
        path.write_bytes(data)
        try:
            assert read_tensors(path)
        except BadFile as error:
            assert "\n" not in str(error)
            sentences += 1
    assert sentences > 100
