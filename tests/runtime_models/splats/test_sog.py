"""SOG, versions 1 and 2: against a splat at a time by hand, as zip and folder; real scenes."""

import json
import zipfile

import numpy as np
import pytest

from shapeshift.runtime_models.read_scene import describe, is_package, read_model
from shapeshift.runtime_models.splats.formats import format_of, read_plain
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.sog.read_sog import read_raw_sog
from tests.support.splats.sog_scenes import random_sog, splat_by_hand, write_folder, write_zip

FIELDS = ("means", "scales", "wxyz", "opacity", "sh")


def assert_same(raw, other) -> None:
    for name in FIELDS:
        assert np.array_equal(getattr(raw, name), getattr(other, name)), name


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("bands", [0, 1, 2, 3])
@pytest.mark.parametrize("count", [1, 2, 16, 17, 257])
def test_every_splat_is_what_it_is_by_hand(tmp_path, version, bands, count):
    palette = (1, 64, 65, 100, 257)[count % 5]
    meta, pictures = random_sog(count, version, bands, palette, seed=count + bands)
    raw = read_raw_sog(write_folder(tmp_path / "scene", meta, pictures), Reading())
    assert (len(raw.means), raw.sh.shape[1]) == (count, (bands + 1) ** 2)
    assert raw.logits == (version == 1) and raw.log_scales and raw.up == "-Y"
    assert raw.format == f"SOG v{version}" and raw.findings == ()
    for number in range(count):
        wanted = splat_by_hand(meta, pictures, number)
        for name in FIELDS:
            got = getattr(raw, name)[number]
            assert np.allclose(got, wanted[name], rtol=3e-6, atol=1e-6), (number, name)


@pytest.mark.parametrize("version", [1, 2])
def test_zip_folder_and_its_meta_json_are_the_same_scene(tmp_path, version):
    made = random_sog(300, version, bands=2)
    folder = write_folder(tmp_path / "a folder é", *made)
    plain = read_raw_sog(folder, Reading())
    stored = write_zip(tmp_path / "scene.sog", *made)
    packed = write_zip(tmp_path / "packed.sog", *made, compression=zipfile.ZIP_DEFLATED)
    nested = write_zip(tmp_path / "nested.zip", *made, top="scene/")
    for path in (stored, packed, nested, folder / "meta.json"):
        assert format_of(path).name == "SOG", path
        assert_same(read_raw_sog(path, Reading()), plain)
    assert not is_package(stored)
    models = [read_model(path) for path in (stored, folder, folder / "meta.json")]
    assert [m.stops[0].name for m in models] == ["scene", "a folder é", "a folder é"]
    for model in models[1:]:
        assert np.array_equal(model.means, models[0].means)
    size = sum(file.stat().st_size for file in folder.iterdir())
    assert describe(models[1], folder)["bytes"] == size
    assert describe(models[2], folder / "meta.json")["bytes"] == size
    assert describe(models[0], stored)["bytes"] == stored.stat().st_size


def test_a_package_with_a_meta_json_beside_stays_a_package(tmp_path):
    path = write_zip(tmp_path / "a.shift", *random_sog(4))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("scene.json", "{}")
    assert is_package(path) and format_of(path) is None


def test_a_codebook_that_begins_with_null_is_continued_as_its_writer_meant(tmp_path):
    meta, pictures = random_sog(40, bands=1)
    meta["scales"]["codebook"][0] = None
    raw = read_raw_sog(write_folder(tmp_path / "scene", meta, pictures), Reading())
    codebook = meta["scales"]["codebook"]
    first = codebook[1] + (codebook[1] - codebook[255]) / 255
    assert raw.scales[0] == pytest.approx([first] * 3, abs=1e-6)
    assert raw.scales[1] == pytest.approx([codebook[255]] * 3, abs=1e-6)


def test_the_marks_of_antialiased_scenes(tmp_path):
    meta, pictures = random_sog(4)
    for number, mark in enumerate(({"model": "antialiased"}, {"antialias": True})):
        folder = write_folder(tmp_path / str(number), meta | mark, pictures)
        assert read_raw_sog(folder, Reading()).antialiased
    for number, mark in enumerate(({"model": "2dgs"}, {"antialias": False}, {})):
        folder = write_folder(tmp_path / f"not {number}", meta | mark, pictures)
        assert not read_raw_sog(folder, Reading()).antialiased


def test_odd_codes_are_kept_and_said(tmp_path):
    meta, pictures = random_sog(30, bands=1, palette=3)
    pictures["quats.webp"].reshape(-1, 4)[[3, 7], 3] = (251, 0)
    pictures["shN_labels.webp"].reshape(-1, 4)[5, :2] = (3, 0)  # the palette has 0, 1, 2
    pictures["shN_labels.webp"].reshape(-1, 4)[9, :2] = (255, 255)
    raw = read_raw_sog(write_folder(tmp_path / "scene", meta, pictures), Reading())
    assert np.array_equal(raw.wxyz[[3, 7]], [[1, 0, 0, 0]] * 2)
    assert not raw.sh[[5, 9], 1:].any() and raw.sh[[4, 6, 8], 1:].any(axis=(1, 2)).all()
    assert [(f.count, f.rows) for f in raw.findings] == [(2, (3, 7)), (2, (5, 9))]


def test_a_folder_of_layers_with_another_meta_json_is_no_sog(tmp_path):
    (tmp_path / "meta.json").write_text(json.dumps({"name": "bob", "licence": "CC BY"}))
    assert format_of(tmp_path) is None and format_of(tmp_path / "meta.json") is None


def test_the_real_logo_of_version_1(data):
    folder = data / "splats_playcanvas" / "playcanvas-logo"
    meta = json.loads((folder / "meta.json").read_text())
    raw = read_raw_sog(folder, Reading())
    assert raw.means.shape == (307_128, 3) and raw.sh.shape == (307_128, 1, 3)
    for name, part in (("means", "means"), ("scales", "scales")):
        low, high = (np.array(meta[part][end]) for end in ("mins", "maxs"))
        if name == "means":
            low, high = (np.sign(v) * np.expm1(np.abs(v)) for v in (low, high))
        assert getattr(raw, name).min(0) == pytest.approx(low, abs=2e-3)
        assert getattr(raw, name).max(0) == pytest.approx(high, abs=2e-3)
    plain = read_plain(folder)
    assert len(plain.means) == 307_128 and plain.dropped == 0
    # Upright: the file has y down, the fur stands above the ground plane of the axes.
    assert plain.means[:, 1].mean() == pytest.approx(-raw.means[:, 1].mean(), abs=1e-5)


def test_a_real_level_of_version_2_by_hand(data):
    from PIL import Image

    folder = data / "splats_playcanvas" / "playbot" / "6_0"
    meta = json.loads((folder / "meta.json").read_text())
    pictures = {
        file.name: np.asarray(Image.open(file).convert("RGBA")) for file in folder.glob("*.webp")
    }
    raw = read_raw_sog(folder, Reading())
    assert len(raw.means) == 1873 and raw.sh.shape[1] == 9
    for number in (0, 1, 255, 256, 1000, 1872):
        wanted = splat_by_hand(meta, pictures, number)
        for name in FIELDS:
            got = getattr(raw, name)[number]
            assert np.allclose(got, wanted[name], rtol=3e-6, atol=1e-6), (number, name)
