"""Steps that look between two stops: which they are, and what a viewer then draws there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tests.support.training.fit_scenes as fit_scenes
from shapeshift.app import cli
from shapeshift.renderer.renderer import Renderer
from shapeshift.runtime_models.model import AnchorModel, ControlEncoding, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import View
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.training.schedule import BlendedShapes, ShapeBlending
from shapeshift.training.settings import TrainSettings
from shapeshift.training.train import Trainer
from tests.support.training.training_runs import bits, run, run_keeping

STOPS = (Stop("A", 0.0), Stop("C", 1.0), Stop("B", 0.4))
SETTINGS = TrainSettings(iterations=300, grow=False, max_anchors=500)


@pytest.fixture(scope="module")
def shared(tmp_path_factory) -> Capture:
    """Light and heat of one shape, from the same places."""
    return fit_scenes.make_shapes(tmp_path_factory.mktemp("shared"), "shared", rig=True)


def test_samples_follow_from_seed_and_step():
    samples = [ShapeBlending(0.25, 3, STOPS).sample(i, "A") for i in range(2000)]
    assert samples == [ShapeBlending(0.25, 3, STOPS).sample(i, "A") for i in range(2000)]
    assert samples != [ShapeBlending(0.25, 4, STOPS).sample(i, "A") for i in range(2000)]
    # 2,000 throws of a coin of 0.25 deviate by 0.01
    assert 0.22 < sum(sample is not None for sample in samples) / 2000 < 0.28


def test_shapes_leave_the_photos_own_stop_towards_its_neighbours():
    """As often as its colours have a part in the blend: 1 - share, a third of a way on average."""
    between = ShapeBlending(0.5, 3, STOPS)
    for name, neighbours in (("A", {"B"}), ("B", {"A", "C"}), ("C", {"B"})):
        found = [one for i in range(4000) if (one := between.sample(i, name)) is not None]
        assert {one.photo_stop.name for one in found} == {name}
        assert {one.neighbour.name for one in found} == neighbours
        assert all(0 <= one.share < 1 for one in found)
        # the mean of 2,000 deviates by 0.24 / sqrt(2000) = 0.005
        assert np.mean([one.share for one in found]) == pytest.approx(1 / 3, abs=0.02)


def test_the_shape_is_blended_and_the_colour_that_of_the_photo():
    encoding = ControlEncoding(3, 0.5, 0.25)
    rows = BlendedShapes(STOPS[2], STOPS[1], 0.25).control(encoding)
    wanted = 0.75 * encoding.encode(0.4) + 0.25 * encoding.encode(1.0)
    np.testing.assert_allclose(rows[:4], np.tile(wanted, (4, 1)), atol=1e-7)  # float32's rounding
    assert rows[4].tolist() == encoding.encode(0.4).tolist()


@pytest.mark.parametrize("none", [ShapeBlending(0.0, 0, STOPS), ShapeBlending(1.0, 0, STOPS[:1])])
def test_without_a_share_or_a_second_stop_all_steps_are_at_stops(none):
    assert all(none.sample(i, "A") is None for i in range(50))


def cross_fade_db(model: AnchorModel, views: list[View]) -> float:
    """Mean PSNR of what a viewer draws halfway between two stops against both pictures' mean."""
    with Renderer(None) as renderer:

        def picture(x: float, view: View) -> np.ndarray:
            renderer.update(Scene((SceneObject("it", model, x=x),)))
            renderer.draw([view])
            return renderer.resolved().astype(np.float64)

        found = []
        for view in views:
            fade = (picture(0.0, view) + picture(1.0, view)) / 2
            found.append(-10 * np.log10(np.mean((picture(0.5, view) - fade) ** 2)))
    return float(np.mean(found))


@pytest.mark.slow
def test_the_picture_between_light_and_heat_comes_nearer_to_their_cross_fade(device, shared):
    """Three seeds: 35.7 to 47.3 dB, 44.1 to 48.7, 35.6 to 47.0; stops lose 0.35 dB at most.

    A processor without AVX-512 rounds otherwise, and its runs end nearer without it: 50.6 to 54.1
    dB, 51.0 to 53.8 and 50.1 to 54.2, so there the bounds are other ones, of the first seed.
    """
    views, fades, psnr = None, [], []
    for share in (0.0, 0.5):
        trainer = run(Trainer(device, shared, replace(SETTINGS, blended_shapes=share)))
        views = views or [photo.view for photo in trainer.held_out if photo.modality == "RGB"]
        fades.append(cross_fade_db(trainer.model(), views))
        psnr.append(trainer.held_out_psnr(9))
    flags = Path("/proc/cpuinfo")
    wide = not flags.is_file() or "avx512f" in flags.read_text()
    least, gain = (45, 4) if wide else (53, 3)
    assert fades[1] > least and fades[1] > fades[0] + gain
    for name, with_it in psnr[1].items():
        assert with_it > psnr[0][name] - 0.6, name


def test_the_same_seed_gives_the_same_bits_resumed_or_not(device, shared, tmp_path):
    settings = replace(SETTINGS, iterations=60, blended_shapes=0.5, grow=True, grow_every=20)
    whole, kept = run_keeping(Trainer(device, shared, settings), tmp_path, 17)
    resumed = run(Trainer(device, shared, settings, *kept))
    assert bits(resumed) == bits(whole)
    assert bits(whole) != bits(run(Trainer(device, shared, replace(settings, blended_shapes=0.0))))


def test_the_command_takes_a_share_and_refuses_what_is_none(device, shared, tmp_path, capsys):
    out = tmp_path / "a.shift"
    words = ["train", str(shared.folder), "--out", str(out), "--iterations", "20"]
    words += ["--max-anchors", "300", "--blended-shapes"]
    assert cli.main([*words, "0.5"]) == 0
    model = read_model(out)
    assert model.provenance["settings"]["blended_shapes"] == 0.5
    assert (model.encoding.d, model.encoding.sigma, model.encoding.spacing) == (2, 0.5, 1)
    assert cli.main([*words, "1.5"]) == 2
    assert "--blended-shapes is 1.5; it is a share, 0 to 1." in capsys.readouterr().err
