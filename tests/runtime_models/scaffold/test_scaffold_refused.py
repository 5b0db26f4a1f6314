"""Scaffold-GS folders that something is wrong with: one sentence, or a model all the same."""

import itertools
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.scaffold.read_scaffold import is_scaffold
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.splats.scaffold_scenes import random_raw, write_cloud, write_run
from tests.support.splats.torch_files import write_tensors

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"


def test_a_network_that_ends_otherwise_is_refused(tmp_path):
    """A fork's networks: the tensors alone would fit."""
    for fixture in (FIXTURES / "torch_1_12").glob("scaffold_*.pt"):
        shutil.copy(fixture, tmp_path / fixture.name.removeprefix("scaffold_"))
    shutil.copy(tmp_path / "color_mlp.pt", tmp_path / "opacity_mlp.pt")
    write_cloud(random_raw(k=2, features=8), tmp_path / "point_cloud.ply")
    with pytest.raises(BadFile, match=r"opacity_mlp\.pt is Linear, ReLU, Linear, Sigmoid; .*Tanh"):
        read_model(tmp_path)


def test_a_plain_cloud_is_none_of_it(tmp_path):
    assert not is_scaffold(tmp_path)
    (tmp_path / "point_cloud.ply").write_bytes(b"ply\nend_header\nf_anchor_feat_0")
    assert not is_scaffold(tmp_path)


@pytest.mark.parametrize("gone", ["opacity_mlp", "cov_mlp", "color_mlp", "embedding_appearance"])
def test_what_is_missing_is_named(tmp_path, gone):
    folder = write_run(random_raw(appearance=3), tmp_path / "run", "split")
    (folder / f"{gone}.pt").unlink()
    with pytest.raises(BadFile, match=rf"{gone}.*copy"):
        read_model(folder)


def test_networks_of_another_cloud_are_refused(tmp_path):
    folder = write_run(random_raw(k=3), tmp_path / "run")
    write_cloud(random_raw(k=4), folder / "point_cloud.ply")
    with pytest.raises(BadFile, match="gives 3 numbers an anchor, 4 splats take 4"):
        read_model(folder)
    write_cloud(random_raw(k=3, features=12), folder / "point_cloud.ply")
    with pytest.raises(BadFile, match="takes 11 numbers, but 12 features"):
        read_model(folder)


@pytest.mark.parametrize(
    ("label", "array", "match"),
    [
        ("0.weight", np.full((8, 11), np.nan), "NaN or Inf"),
        ("0.weight", np.full((8, 11), 1e39), "NaN or Inf"),
        ("0.bias", np.zeros(7), "does not fit"), ("2.weight", np.zeros((3, 9)), "does not fit"),
        ("2.weight", np.zeros(3), "does not fit"), ("norm.weight", np.zeros(3), "no plain network"),
    ],
)  # fmt: skip
def test_networks_that_are_none_are_refused(tmp_path, label, array, match):
    folder = write_run(random_raw(), tmp_path / "run", "split")
    names = ("0.weight", "0.bias", "2.weight", "2.bias")
    arrays = itertools.chain(*random_raw().networks["opacity_mlp"])
    layers = dict(zip(names, arrays, strict=True))
    write_tensors(folder / "opacity_mlp.pt", layers | {label: array})
    with pytest.raises(BadFile, match=match):
        read_model(folder)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"standard": 0.0}, "which level"), ({"standard": np.nan}, "which level"),
        ({"voxel": -1.0}, "which level"), ({"level": np.full(40, np.nan)}, "no levels"),
        ({"level": np.arange(40) * 9.0}, "no levels"),
    ],
)  # fmt: skip
def test_levels_that_are_none_are_refused(tmp_path, change, match):
    raw = random_raw(levels=3)
    folder = write_run(replace(raw, levels=raw.levels | change), tmp_path / "run")
    with pytest.raises(BadFile, match=match):
        read_model(folder)


def test_settings_that_are_none_are_refused(tmp_path):
    folder = write_run(random_raw(levels=3), tmp_path / "run")
    for text, match in (("fork=1", "which level"), ("dist2level='near'", "round, floor, ceil")):
        (folder / "cfg_args").write_text(f"Namespace({text})")
        with pytest.raises(BadFile, match=match):
            read_model(folder)


def test_columns_of_other_types_and_text(tmp_path):
    raw = random_raw(levels=3)
    folder = write_run(raw, tmp_path / "run")
    plain = read_model(folder)
    write_cloud(raw, folder / "point_cloud.ply", "double")
    same = read_model(folder)
    for name in ("anchors", "features", "offsets", "scales"):
        assert np.array_equal(getattr(same, name), getattr(plain, name))
    cloud = (folder / "point_cloud.ply").read_bytes()
    (folder / "point_cloud.ply").write_bytes(cloud.replace(b"binary_little_endian", b"ascii"))
    with pytest.raises(BadFile, match=r"ASCII|promises"):
        read_model(folder)
    for change, match in (
        ((b"float f_offset_1\n", b"float f_offset_x\n"), "not numbered"),
        ((b"float f_anchor_feat_3\n", b"float f_anchor_feat_03\n"), "not numbered"),
        ((b"float scale_5\n", b"float other\n"), "has no scale_5"),
    ):
        (folder / "point_cloud.ply").write_bytes(cloud.replace(*change))
        with pytest.raises(BadFile, match=match):
            read_model(folder)
    (folder / "point_cloud.ply").write_bytes(cloud[:-100])
    with pytest.raises(BadFile, match="cut off"):
        read_model(folder)


def test_any_flipped_byte_is_a_model_or_a_sentence(tmp_path):
    """A small fuzz over cloud and settings; the networks' own is in test_read_torch."""
    rng = np.random.default_rng(1)
    folder = write_run(random_raw(levels=3, bank=True, anchors=5), tmp_path / "run", "split")
    names = ["point_cloud.ply", "cfg_args", "cov_mlp.pt"]
    (folder / "cfg_args").write_text("Namespace(fork=2, dist2level='progressive', add_level=False)")
    whole = {name: (folder / name).read_bytes() for name in names}
    outcomes = []
    for round_ in range(300):
        name = names[round_ % 3]
        data = bytearray(whole[name])
        for at in rng.integers(len(data), size=rng.integers(1, 6)):
            data[at] = rng.integers(256)
        (folder / name).write_bytes(data[: rng.integers(len(data))] if round_ % 5 == 0 else data)
        try:
            model = read_model(folder)
            outcomes.append(np.isfinite(model.anchors).all())
        except BadFile as error:
            assert "\n" not in str(error)
            outcomes.append(False)
        (folder / name).write_bytes(whole[name])
    assert 30 < sum(outcomes) < 270


def test_what_would_halt_a_machine_is_refused(tmp_path):
    """Scales of metres where centimetres are meant: every splat would cover the scene."""
    raw = random_raw(anchors=4000, k=5)
    folder = write_run(raw, tmp_path / "run")
    read_model(folder)
    raw.log_scales[:, 3:] = 2.0
    write_cloud(raw, folder / "point_cloud.ply")
    with pytest.raises(BadFile, match=r"splats would lie over every pixel.*--allow-huge"):
        read_model(folder)
    assert read_model(folder, Reading(allow_huge=True)).splat_count == 20_000
