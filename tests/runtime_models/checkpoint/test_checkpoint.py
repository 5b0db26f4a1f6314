"""Splats as trainers save them: gsplat's .pt, nerfstudio's .ckpt, arrays in an .npz."""

from pathlib import Path

import numpy as np
import pytest

import tests.support.splats.torch_files as torch_files
from shapeshift.runtime_models.checkpoint.read_checkpoint import read_raw_checkpoint
from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import describe, read_model
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.splats.ply_files import write_rows

TORCH = Path(__file__).parents[2] / "fixtures" / "torch_2_15"
SAVED = np.load(TORCH / "ckpt_splats.npz")
PARTS = {"means": "means", "scales": "scales", "wxyz": "quats", "opacity": "opacities"}


def raw(path: Path):
    return read_raw_checkpoint(path, Reading())


@pytest.mark.parametrize("name", ["ckpt_29999_rank0.pt", "step-000029999.ckpt"])
def test_what_torch_saved_is_what_is_read(name):
    """Made by torch.save (tests/fixtures/make_checkpoints.py): numbers bit by bit."""
    path = TORCH / name
    assert format_of(path).name == "checkpoint"
    splats = raw(path)
    for ours, theirs in PARTS.items():
        np.testing.assert_array_equal(getattr(splats, ours), SAVED[theirs])
    np.testing.assert_array_equal(splats.sh, np.concatenate([SAVED["first"], SAVED["rest"]], 1))
    assert splats.log_scales and splats.logits and splats.up == "+Z"
    facts = describe(read_model(path, Reading(allow_huge=True)), path)
    assert facts["splats"] == 8 and facts["sh_degree"] == 3
    assert facts["format"] == f"checkpoint{path.suffix}"


def test_a_checkpoint_shows_what_its_ply_shows(tmp_path):
    """The same splats as 3DGS PLY, whose up has to be named: the same scene."""
    rows = [
        dict(zip("xyz", SAVED["means"][i].tolist(), strict=True))
        | {f"f_dc_{c}": float(SAVED["first"][i, 0, c]) for c in range(3)}
        | {
            f"f_rest_{15 * c + j}": float(SAVED["rest"][i, j, c])
            for c in range(3)
            for j in range(15)
        }
        | {"opacity": float(SAVED["opacities"][i])}
        | {f"scale_{c}": float(SAVED["scales"][i, c]) for c in range(3)}
        | {f"rot_{c}": float(SAVED["quats"][i, c]) for c in range(4)}
        for i in range(8)
    ]
    path = write_rows(tmp_path / "a.ply", rows)
    one = read_plain(TORCH / "ckpt_29999_rank0.pt", Reading(allow_huge=True))
    other = read_plain(path, Reading(up="+Z", allow_huge=True))
    for name in ("means", "scales", "wxyz", "opacity", "sh"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-6)


ARRAYS = {
    "means": SAVED["means"], "scales": SAVED["scales"], "quats": SAVED["quats"],
    "opacities": SAVED["opacities"], "sh0": SAVED["first"], "shN": SAVED["rest"],
}  # fmt: skip


@pytest.mark.parametrize("kind", ["<f4", "<f8", "<f2"])
def test_an_npz_of_the_same_names(tmp_path, kind):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, **{name: array.astype(kind) for name, array in ARRAYS.items()})
    splats = raw(path)
    np.testing.assert_array_equal(splats.means, ARRAYS["means"].astype(kind).astype("f4"))
    np.testing.assert_array_equal(splats.sh[:, 1:], ARRAYS["shN"].astype(kind).astype("f4"))


def test_points_of_an_npz_are_shown_as_points(data):
    """gsplat's own test scene, which its trainer's normalising stood up along +Z."""
    splats = raw(data / "splats_misc" / "gsplat_test_garden.npz")
    assert (
        len(splats.means) == 138_766 and splats.up == "+Z" and "points" in splats.findings[0].done
    )
    with np.load(data / "splats_misc" / "gsplat_test_garden.npz") as arrays:
        np.testing.assert_allclose(0.5 + C0 * splats.sh[:, 0], arrays["colors"] / 255, atol=1e-6)


def put(path: Path, **arrays: np.ndarray) -> Path:
    return torch_files.write_tensors(path, {n.replace("__", "."): a for n, a in arrays.items()})


def named(prefix: str, arrays: dict) -> dict:
    return {f"{prefix}{name}".replace(".", "__"): array for name, array in arrays.items()}


@pytest.mark.parametrize("prefix", ["", "splats.", "pipeline._model.", "a.b.c."])
def test_splats_are_found_wherever_they_are_nested(tmp_path, prefix):
    splats = raw(put(tmp_path / "a.pt", **named(prefix, ARRAYS)))
    np.testing.assert_array_equal(splats.means, SAVED["means"])


def test_without_harmonics_colours_are_logits(tmp_path):
    """gsplat's appearance option, and nerfstudio's sh_degree 0."""
    first = SAVED["first"][:, 0]
    shape = {name: ARRAYS[name] for name in ("means", "scales", "quats", "opacities")}
    wanted = 1 / (1 + np.exp(-first))
    colored = raw(put(tmp_path / "a.pt", **named("splats.", shape | {"colors": first})))
    np.testing.assert_allclose(0.5 + C0 * colored.sh[:, 0], wanted, atol=1e-6)
    assert "network" in colored.findings[0].what
    none = np.zeros((8, 0, 3), np.float32)
    flat = raw(put(tmp_path / "b.ckpt", **shape, features_dc=first, features_rest=none))
    np.testing.assert_allclose(0.5 + C0 * flat.sh[:, 0], wanted, atol=1e-6)
    plain = raw(put(tmp_path / "c.pt", **shape, sh0=SAVED["first"]))
    np.testing.assert_array_equal(plain.sh, SAVED["first"])


BROKEN = {
    "no splats": ({"a": np.ones(3, "f4")}, "with no splats; wanted are the splats of gsplat"),
    "lacks quats": ({n: a for n, a in ARRAYS.items() if n != "quats"}, "no splats"),
    "two sets": (named("a.", ARRAYS) | named("b.", ARRAYS), "2 sets of splats"),
    "rows that differ": (ARRAYS | {"scales": np.ones((7, 3), "f4")}, "scales is float32 of shape"),
    "wrong width": (ARRAYS | {"quats": np.ones((8, 3), "f4")}, "quats is float32 of shape"),
    "odd harmonics": (ARRAYS | {"shN": np.ones((8, 4, 3), "f4")}, "4 further harmonics"),
    "no colours": ({n: a for n, a in ARRAYS.items() if "sh" not in n}, "without colours"),
    "of one side": (ARRAYS | {"means": np.ones(8, "f4")}, "means is float32 of shape"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_what_is_no_checkpoint_is_one_sentence(tmp_path, how):
    arrays, words = BROKEN[how]
    with pytest.raises(BadFile, match=words) as refusal:
        read_model(put(tmp_path / "a.pt", **arrays))
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 300


def test_only_what_is_shown_is_read(tmp_path):
    """Optimizers are twice as large as the splats, and may hold anything that tensors hold."""
    arrays = named("splats.", ARRAYS) | {"optimizer__exp_avg": np.ones((500, 500))}
    path = put(tmp_path / "a.pt", **arrays)
    splats = raw(path)
    assert splats.memory.taken < path.stat().st_size / 2


def test_a_pickle_that_names_a_function_runs_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body = b"cos\nsystem\n(" + torch_files.text("touch harmed") + b"tR"
    index = torch_files.program(torch_files.dictionary({"splats": body}))
    (tmp_path / "a.ckpt").write_bytes(torch_files.archive(index, {}))
    with pytest.raises(BadFile, match=r"names 'os.system'"):
        read_model(tmp_path / "a.ckpt")
    assert [file.name for file in tmp_path.iterdir()] == ["a.ckpt"]
