"""render --output: files that third parties read, with the numbers that the legend promises."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.commands.outputs import as_steps, choose_unit, summary, write_png16
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.pose import stereo_pair
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import random_package
from tests.support.renderer.surface_reference import reference_surface

NO_GL = ["--context", "none", "--size", "60x44"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 60, k=4)


def render(*arguments):
    return cli.main(["render", *map(str, arguments)])


def read16(path):
    """Of a grey or a colour PNG; Pillow gives colours of 16 bits as 8."""
    image = Image.open(path)
    image.load()
    return np.asarray(image), image.text


@pytest.mark.parametrize("output", ["depth", "normal", "coverage"])
def test_numbers_are_those_of_the_reference(scene, tmp_path, output):
    assert render(scene, "--output", output, "--out", tmp_path, *NO_GL) == 0
    model = read_model(scene)
    view = default_view(model, (60, 44))
    want = reference_surface(Scene((SceneObject("a", model),)), view, RenderSettings())
    got = np.load(tmp_path / "0000_x0.000.npy")
    assert got.dtype == np.float32 and got.shape[:2] == (44, 60)
    pixels, text = read16(tmp_path / "0000_x0.000.png")
    legend = json.loads((tmp_path / "legend.json").read_text())
    assert legend["output"] == output == text["output"]
    assert legend["pictures"]["0000_x0.000.png"] == summary(got)
    sure = np.abs(want.coverage - 0.5) > 0.02  # beside the border rounding decides nothing
    known = sure & (want.coverage > 0.5)
    assert known.mean() > 0.05 and (sure & ~known).any()
    if output == "coverage":
        np.testing.assert_allclose(got, want.coverage, atol=1e-3)
        np.testing.assert_allclose(pixels, got * 65535, atol=0.51)
        return
    expected = want.depth() if output == "depth" else want.normals()
    np.testing.assert_allclose(got[known], expected[known], rtol=2e-3, atol=2e-3)
    assert np.isnan(got[sure & ~known]).all()
    if output == "depth":
        step = legend["metres_per_step"]
        np.testing.assert_allclose(pixels[known] * step, got[known], atol=0.51 * step)
        assert not pixels[sure & ~known].any() and pixels.max() > 6553  # a unit finer is too fine
    else:
        np.testing.assert_allclose(pixels[known] / 127.5 - 1, got[known], atol=0.01)


def test_two_eyes_stand_side_by_side(scene, tmp_path):
    out = ["--out", tmp_path, "--output", "depth", "--stereo", "0.1", *NO_GL]
    assert render(scene, *out) == 0
    model = read_model(scene)
    left, _ = stereo_pair(default_view(model, (60, 44)), 0.1)
    want = reference_surface(Scene((SceneObject("a", model),)), left, RenderSettings())
    got = np.load(tmp_path / "0000_x0.000.npy")
    assert got.shape == (44, 120)
    solid = want.coverage > 0.6
    np.testing.assert_allclose(got[:, :60][solid], want.depth()[solid], rtol=2e-3)


def test_the_unit_can_be_given(scene, tmp_path):
    out = ["--out", tmp_path, "--output", "depth", "--depth-unit", "0.05", *NO_GL]
    assert render(scene, *out) == 0
    pixels, text = read16(tmp_path / "0000_x0.000.png")
    metres = np.load(tmp_path / "0000_x0.000.npy")
    known = np.isfinite(metres)
    np.testing.assert_array_equal(pixels[known], np.rint(metres[known] / 0.05))
    assert text["metres_per_step"] == "0.05"


@pytest.mark.parametrize(
    "extra, told",
    [
        (["--debug", "depth"], "--debug"),
        (["--target-ms", "20"], "--target-ms"),
        (["--depth-unit", "0"], "--depth-unit"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(scene, tmp_path, capsys, extra, told):
    assert render(scene, "--output", "normal", "--out", tmp_path, *extra, *NO_GL) == 2
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["0000_x0.000.npy", "0000_x0.000.png", "legend.json"])
def test_nothing_is_overwritten_without_a_word(scene, tmp_path, capsys, name):
    (tmp_path / name).write_text("mine")
    assert render(scene, "--output", "coverage", "--out", tmp_path, *NO_GL) == 2
    assert name in capsys.readouterr().err and (tmp_path / name).read_text() == "mine"
    assert render(scene, "--output", "coverage", "--out", tmp_path, "--overwrite", *NO_GL) == 0


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (200, 257)])
def test_sixteen_bits_come_back(tmp_path, shape):
    pixels = np.random.default_rng(0).integers(0, 65536, shape).astype(np.uint16)
    write_png16(pixels, tmp_path / "grey.png", {"a": "b"})
    got, text = read16(tmp_path / "grey.png")
    np.testing.assert_array_equal(got, pixels)
    assert text["a"] == "b" and text["Software"] == "Shapeshift"
    color = np.stack([pixels, pixels ^ 1, ~pixels], axis=-1)
    write_png16(color, tmp_path / "color.png")
    got = np.asarray(Image.open(tmp_path / "color.png"))
    np.testing.assert_array_equal(got, color >> 8)  # all that Pillow keeps


def test_steps_at_their_ends():
    values = np.array([np.nan, 0.00001, 0.004, 65.534, 70, np.inf], np.float32)
    got = as_steps(values, "depth", 0.001)
    np.testing.assert_array_equal(got, [0, 1, 4, 65534, 65535, 0])
    np.testing.assert_array_equal(
        as_steps(np.array([0, 1, 1.5], np.float32), "coverage", 1), [0, 65535, 65535]
    )
    np.testing.assert_array_equal(
        as_steps(np.array([-1, 1, np.nan], np.float32), "normal", 1), [0, 65535, 0]
    )


def test_the_unit_is_the_finest_that_reaches():
    from tests.support.splat_scenes import front_view

    view = front_view(distance=4.0)
    for radius in (0.001, 1.0, 60.0, 1e4):
        unit = choose_unit(np.zeros(3), radius, [view])
        farthest = np.linalg.norm(view.world_from_eye.position) + radius
        assert farthest <= 65535 * unit < 10.001 * farthest + unit
    assert summary(np.full((2, 2), np.nan)) == {"least": None, "largest": None, "known": 0}
