"""render --select: parts at a control value of their own, and what is refused."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.stop_weights import StopBlend
from shapeshift.scene.cameras.framing import default_view
from shapeshift.scene.control import Sweep, control_of, snap
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector_texts import read_selector
from tests.support.models import STOPS, random_package

TINY = ["--size", "40x30", "--context", "none", "--camera", "front"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return random_package(tmp_path_factory.mktemp("scene"), 50, k=4)


def render(*arguments) -> int:
    return cli.main(["render", *map(str, arguments), *TINY])


def picture(folder) -> np.ndarray:
    (path,) = folder.glob("*.png")
    return np.asarray(Image.open(path), np.float64) / 255


def test_the_picture_is_the_scenes_with_these_selectors(scene, tmp_path):
    texts = ["sphere:0.2,0,0:0.5:thermal:0.2", "lens:4:0.5"]
    assert render(scene, "--out", tmp_path / "a", "--select", *texts) == 0
    assert render(scene, "--out", tmp_path / "plain") == 0
    model = read_model(scene)
    view = default_view(model, (40, 30))
    selectors = tuple(read_selector(text, STOPS, view.world_from_eye) for text in texts)
    obj = SceneObject("scene", model, selectors=selectors)
    assert len(np.unique(control_of(obj))) > 3
    from shapeshift.renderer.renderer import Renderer

    with Renderer(None) as renderer:
        renderer.update(Scene((obj,)))
        renderer.draw([view])
        wanted = renderer.resolved()
    np.testing.assert_allclose(picture(tmp_path / "a"), wanted.clip(0, 1), atol=0.51 / 255)
    assert np.abs(picture(tmp_path / "plain") - picture(tmp_path / "a")).max() > 0.05


def test_everything_selected_is_that_value(scene, tmp_path):
    assert render(scene, "--out", tmp_path / "a", "--select", "sphere:0,0,0:99:Thermal") == 0
    assert render(scene, "--out", tmp_path / "b", "--x", "1") == 0
    np.testing.assert_array_equal(picture(tmp_path / "a"), picture(tmp_path / "b"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("ball:0,0,0:1:1", "--select 'ball:0,0,0:1:1' begins with 'ball'"),
        ("sphere:0,0,0:1:1.5", "x = 1.5; from 0 to 1 is wanted"),
        ("lens:200:1", "half_angle"),
    ],
)
def test_what_is_refused_is_one_sentence(scene, tmp_path, capsys, text, told):
    assert render(scene, "--out", tmp_path / "a", "--select", text) == 2
    said = capsys.readouterr()
    assert told in said.err and said.err.count("\n") == 1 and said.out == ""
    assert not (tmp_path / "a").exists()


def test_hands_and_clocks_are_clamped_and_numbers_refused(scene, tmp_path, capsys):
    assert snap(-3.0, STOPS) == 0 and snap(7.0, STOPS) == 1
    sweep = Sweep.over(StopBlend(STOPS))
    sweep.resume_at(-3.0)
    assert all(0 <= sweep.advance(0.37) <= 1 for _ in range(50))
    for x in ("-0.1", "1.1", "nan"):
        assert render(scene, "--out", tmp_path / "a", f"--x={x}") == 2
        assert x in capsys.readouterr().err
