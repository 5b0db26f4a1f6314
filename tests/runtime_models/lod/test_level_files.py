"""lod.json and what it names: read back as written, the package to the bit, every lie refused."""

import io
import json
import os
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.files.memory import Memory
from shapeshift.runtime_models.lod.average_anchors import average_anchors, cell_for
from shapeshift.runtime_models.lod.level_files import (
    LEVELS,
    level_table,
    read_level,
    read_levels,
    write_levels,
)
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.runtime_models.read_scene import describe, files_of, read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.models import random_package


@pytest.fixture
def folder(tmp_path):
    """A package of 60 anchors with levels of about 20 and 6, averaged."""
    package = random_package(tmp_path, 60)
    model = read_package(package)
    tables = [level_table(average_anchors(model, cell_for(model, share))) for share in (0.33, 0.1)]
    levels = [
        replace(
            read_level(table, model, "level"), cell_m=0.1 * n, from_pixels=200.0 / n,
            error_db={"stops": 40.5, "between": 44.0},
        )
        for n, table in enumerate(tables, 1)
    ]  # fmt: skip
    out = tmp_path / "scene.lod"
    write_levels(out, package.read_bytes(), model.with_coarser(tuple(levels)), tables)
    assert (out / "scene.shift").read_bytes() == package.read_bytes()
    return out


def test_it_is_read_as_it_was_written(folder):
    model, alone = read_model(folder), read_package(folder / "scene.shift")
    for name in ("anchors", "features"):
        np.testing.assert_array_equal(getattr(model, name), getattr(alone, name))
    assert read_model(folder / LEVELS).coarser[0].from_pixels == 200.0
    assert [one.from_pixels for one in model.coarser] == [200.0, 100.0]
    assert len(model.levels) == 3 and model.levels[0] is model
    assert all(level.networks is model.networks for level in model.levels)
    assert model.levels[1].coarser == () and model.levels is model.levels
    facts = describe(model, folder)
    assert facts["coarser_levels"][1]["error_db"] == {"stops": 40.5, "between": 44.0}
    assert facts["bytes"] == sum(file.stat().st_size for file in folder.iterdir())
    assert len(files_of(model, folder)) == 4


def test_levels_go_where_the_anchors_change(folder):
    model = read_model(folder)
    assert replace(model, provenance={"name": "other"}).coarser
    assert replace(model, pace=()).levels[1].pace == ()
    assert not model.with_anchors(slice(30)).coarser
    assert not replace(model, features=model.features.copy()).coarser
    assert not replace(model, networks=dict(model.networks)).coarser


def changed(folder, change):
    path = folder / LEVELS
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def put(level, key, value):
    return lambda data: data["levels"][level].__setitem__(key, value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.update(format="shapeshift-lod 2"), "this program reads 'shapeshift-lod 1'"),
        (lambda d: d.update(levels=[]), "a list of the package and its coarser levels"),
        (lambda d: d.update(levels=[{}] * 17), "at most 16 fit"),
        (lambda d: d.update(levels=7), "a list of objects"),
        (put(1, "file", "../scene.shift"), "the name of a file beside it"),
        (put(1, "file", "/etc/passwd"), "the name of a file beside it"),
        (put(1, "file", ".."), "the name of a file beside it"),
        (put(1, "file", "level9.npz"), "which is no file in"),
        (put(1, "file", "level2.npz"), "names one file twice"),
        (put(1, "file", "scene.shift"), "names one file twice"),
        (put(1, "file", 3), "a text is wanted"),
        (put(0, "file", "level1.npz"), "names one file twice"),
        (put(0, "anchors", 61), "says that scene.shift has 61 anchors"),
        (put(1, "anchors", 0), "a whole number from 1"),
        (put(1, "anchors", 2.5), "a whole number from 1"),
        (put(1, "splats", 5), "and 5 splats, but it holds"),
        (put(1, "voxel", 0), "a number above 0"),
        (put(1, "from_pixels", float("nan")), "lod.json"),
        (put(1, "from_pixels", -1), "a number above 0"),
        (put(1, "from_pixels", 100.0), "a number below 100"),
        (put(2, "from_pixels", 200.0), "a number below 200"),
        (put(1, "error_db", {"stops": "good"}), "dB is wanted"),
        (put(1, "error_db", [1]), "an object in braces"),
    ],
)
def test_what_is_wrong_is_one_sentence(folder, change, said):
    changed(folder, change)
    with pytest.raises(BadFile) as refusal:
        read_model(folder)
    assert said in str(refusal.value) and "\n" not in str(refusal.value)


def test_tables_are_checked_as_a_package_is(folder):
    model = read_model(folder)
    level = model.levels[1]
    for broken, said in (
        (replace(level, features=level.features[:, :5]), "features has shape"),
        (replace(level, frames=replace(level.frames, scales=level.frames.scales * 1e30)), "reach"),
    ):
        (folder / "level1.npz").write_bytes(level_table(broken))
        with pytest.raises(BadFile, match=said):
            read_model(folder)
    with np.load(io.BytesIO(level_table(level))) as table:
        arrays = dict(table)
    arrays["positions"][1, 2] = np.nan
    np.savez(folder / "level1.npz", **arrays)
    with pytest.raises(BadFile, match="positions has NaN or Inf in 1 of"):
        read_model(folder)
    (folder / "level1.npz").write_bytes(b"PK no zip")
    with pytest.raises(BadFile, match=r"level1\.npz"):
        read_model(folder)


def test_a_link_out_of_the_folder_is_not_followed(folder, tmp_path):
    table = tmp_path / "elsewhere.npz"
    os.replace(folder / "level1.npz", table)
    (folder / "level1.npz").symlink_to(table)
    with pytest.raises(BadFile, match="which is no file in"):
        read_model(folder)


def test_levels_are_charged(folder):
    memory = Memory()
    read_levels(folder, Reading(memory=memory))
    splats = sum(len(level.anchors) * 5 for level in read_model(folder).levels)
    assert memory.taken >= 60 * splats
