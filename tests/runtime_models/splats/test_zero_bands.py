"""Harmonics that are zero in a whole file are left out when it is opened, whatever its format."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import SplatLayers
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.gltf.write_gltf import write_gltf
from shapeshift.runtime_models.splats.layers.read_layers import read_layers, used_coefficients
from shapeshift.runtime_models.splats.plain_splats import PlainSplats
from shapeshift.runtime_models.splats.ply.write_compressed_ply import write_compressed_ply
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from tests.support.program import launch
from tests.support.renderer.frames import draw
from tests.support.renderer.renderers import TILES, quads
from tests.support.splat_scenes import alone, front_view, random_layers, stereo_views

RENDERERS = {"tiles": TILES, "quads": quads(target=None)}

WRITERS = {
    "a.ply": write_ply,
    "a.spz": write_spz,
    "a.glb": write_gltf,
}
COEFFICIENTS = (1, 4, 9, 16)


def with_zero_bands(kept: int, count: int = 300, seed: int = 6) -> PlainSplats:
    """Splats of degree 3 of which only the first `kept` coefficients are not zero."""
    layers = random_layers(count, seed, 16)
    sh = layers.sh.copy()
    sh[:, kept:] = 0
    opacity = np.clip(layers.opacity, 0.1, 0.9)
    return PlainSplats(layers.means, layers.scales, layers.wxyz, opacity, sh)


@pytest.mark.parametrize("kept", COEFFICIENTS)
@pytest.mark.parametrize("name", WRITERS)
def test_every_format(tmp_path, name, kept):
    splats, path = with_zero_bands(kept), tmp_path / name
    WRITERS[name](splats, path)
    model = read_model(path)
    assert model.sh.shape == (300, kept, 3) and model.sh.flags.c_contiguous
    assert model.sh.base is None or model.sh.base.nbytes == model.sh.nbytes, "the rest is freed"
    assert model.sh[:, (kept - 1) // 2 :].any()
    told = model.provenance.get("sh_degree")
    assert told == (3 if kept < 16 else None)


def test_compressed_ply_has_no_zero(tmp_path):
    """Its bytes stand for the middles of 256 steps: what was zero is 1/64 in every splat, drawn as
    any reader draws it.
    """
    write_compressed_ply(with_zero_bands(1), tmp_path / "a.compressed.ply")
    sh = read_model(tmp_path / "a.compressed.ply").sh
    assert sh.shape == (300, 16, 3) and (np.abs(sh[:, 1:]) == 1 / 64).all()


def test_bytes_a_splat_go_down(tmp_path):
    """180 of the model; as many on the device, which has a copy."""
    path = tmp_path / "a.ply"
    write_ply(with_zero_bands(1), path)
    assert read_model(path).sh.nbytes == 300 * 12
    write_ply(with_zero_bands(16), path)
    assert read_model(path).sh.nbytes == 300 * 192


@pytest.mark.parametrize("value", [1e-45, -1e-30, 1.0])
@pytest.mark.parametrize("where", [(0, 15, 2), (299, 9, 0), (150, 4, 1), (299, 3, 2)])
def test_one_number_keeps_its_band_and_those_below(where, value):
    sh = np.zeros((300, 16, 3), np.float32)
    assert used_coefficients(sh) == 1
    sh[:, :, :] = -0.0
    assert used_coefficients(sh) == 1
    sh[where] = value
    assert used_coefficients(sh) == next(c for c in COEFFICIENTS if where[1] < c)


def test_none_and_many_splats():
    assert used_coefficients(np.zeros((0, 16, 3), np.float32)) == 1
    many = np.zeros((40_000, 9, 3), np.float32)
    assert used_coefficients(many) == 1
    many[-1, -1, -1] = 0.5
    assert used_coefficients(many) == 9


def test_layers_have_the_bands_that_any_of_them_has(tmp_path):
    paths = [tmp_path / f"layer{i}.ply" for i in range(3)]
    for path, kept in zip(paths, (1, 4, 1), strict=True):
        write_ply(with_zero_bands(kept, seed=kept), path)
    model = read_layers(paths)
    assert model.sh.shape == (900, 4, 3) and model.provenance["sh_degree"] == 3
    assert model.sh[model.layer == 1, 1:].any() and not model.sh[model.layer != 1, 1:].any()
    assert read_layers(paths[::2]).sh.shape == (600, 1, 3)


@pytest.mark.parametrize("kept", COEFFICIENTS[:3])
def test_pictures_are_equal_to_the_last_bit(renderer, kept):
    """Of both drawings (tests/renderer/gl), from one eye and from two: zeros add nothing."""
    splats = with_zero_bands(kept, 2000)
    layers = random_layers(2000, 6, 16)
    whole = replace(layers, sh=splats.sh)
    less = replace(layers, sh=np.ascontiguousarray(splats.sh[:, :kept]))
    assert isinstance(whole, SplatLayers) and whole.sh.shape[1] == 16
    for views in ([front_view((96, 80))], stereo_views((96, 80))):
        one, other = (draw(renderer, alone(m), views, stereo_colors="each") for m in (whole, less))
        for a, b in zip(one, other, strict=True):
            assert a.any()
            np.testing.assert_array_equal(a, b)


def test_nothing_is_coloured_again_where_no_colour_looks_at_the_eye(renderer, tmp_path):
    """A file of degree 3 whose bands are zero costs a moving eye nothing, as one of degree 0."""
    write_ply(with_zero_bands(1), tmp_path / "a.ply")
    scene = alone(read_model(tmp_path / "a.ply"))
    assert isinstance(renderer, Renderer)
    runs = []
    for distance in (4.0, 3.5, 3.0):
        renderer.update(scene)
        runs.append(renderer.draw([front_view((64, 48), distance)]).color_runs)
    assert runs == [1, 0, 0]


def test_what_was_left_out_is_written_no_more_and_read_the_same(tmp_path):
    write_ply(with_zero_bands(4), tmp_path / "a.ply")
    model = read_model(tmp_path / "a.ply")
    done = launch("export", tmp_path / "a.ply", "--out", tmp_path / "b.ply")
    assert done.returncode == 0 and "SH degree 1" in done.stderr, done.stderr
    again = read_model(tmp_path / "b.ply")
    np.testing.assert_array_equal(again.sh, model.sh)
    assert "sh_degree" not in again.provenance
    assert (tmp_path / "b.ply").stat().st_size < (tmp_path / "a.ply").stat().st_size


def test_info_and_lint_say_what_the_file_has(tmp_path):
    write_ply(with_zero_bands(1), tmp_path / "a.ply")
    for command in ("info", "lint"):
        told = json.loads(launch(command, tmp_path / "a.ply", "--json").stdout)
        assert (told["sh_degree"], told["sh_degree_in_file"]) == (0, 3)
    said = launch("lint", tmp_path / "a.ply").stdout
    assert "SH degree 0 (3 in the file, zero in every splat)" in " ".join(said.split())
