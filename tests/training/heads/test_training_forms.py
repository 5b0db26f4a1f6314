"""The GPU forms of a whole training step, run on a CPU, beside the CPU forms."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.package.package_files import MANIFEST
from shapeshift.runtime_models.package.read_package import read_files
from shapeshift.runtime_models.package.write_package import package_files
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.baselines.plain_step import GROUPS, PlainStep
from shapeshift.training.heads.networks import (
    HeadLayout,
    Heads,
    blocks_of_weights,
    initial_weights,
    padded,
)
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.settings import TrainSettings
from shapeshift.training.step import TrainingStep
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.training.plain_situations import situation as plain_situation
from tests.support.training.situations import (
    BACKGROUND,
    LAYOUT,
    MIN_OPACITY_SHARE,
    OTHERS,
    SIZE,
    VOXEL,
    compare_gradients,
    situation,
)

SETTINGS = TrainSettings(iterations=40, max_anchors=300, grow=False)


@pytest.fixture(scope="module")
def as_gpu(device):
    """The same device, taken for a GPU: everything that is chosen by kind takes the other form."""
    return replace(device, kind="gpu")


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("forms"), size=48, views=6, test_views=2)


@pytest.mark.parametrize("layout", [LAYOUT, OTHERS["all at once"]], ids=["plain", "all at once"])
def test_every_gradient_of_the_gpu_forms(as_gpu, layout):
    assert Heads(as_gpu, layout).form == "gpu"
    compare_gradients(as_gpu, layout, seed=1)


@pytest.mark.parametrize("seed", range(3))
def test_a_step_of_both_forms(device, as_gpu, seed):
    parameters, control, view, rgba = situation(seed)
    found = []
    for where in (device, as_gpu):
        adam = Adam(where, parameters, {name: np.ones(1) for name in parameters})
        step = TrainingStep(where, LAYOUT, VOXEL, adam)
        loss = ImageLoss(where, SIZE)
        target = loss.target(where.upload(rgba), BACKGROUND)
        drawing = step.draw(view, control, BACKGROUND)
        grads = step.gradients(drawing, loss, target, min_opacity_share=MIN_OPACITY_SHARE)
        found.append({name: where.download(grad) for name, grad in grads.items()})
        found[-1] |= {"loss": np.array(loss.value()), "image": where.download(drawing.frame.image)}
    for name, one in found[0].items():
        difference = np.abs(found[1][name] - one).max() / np.abs(one).max()
        assert difference < 1e-5, (name, difference)


@pytest.mark.parametrize("degree", [0, 3])
def test_a_step_of_plain_splats_of_both_forms(device, as_gpu, degree):
    parameters, view, rgba = plain_situation(1, degree)
    found = []
    for where in (device, as_gpu):
        adam = Adam(where, parameters, dict.fromkeys(GROUPS, np.ones(1)))
        step, loss = PlainStep(where, adam, degree), ImageLoss(where, SIZE)
        target = loss.target(where.upload(rgba), BACKGROUND)
        grads = step.gradients(step.draw(view, BACKGROUND), loss, target)
        found.append({name: where.download(grad) for name, grad in grads.items()})
    for name, one in found[0].items():
        if one.size:
            assert np.abs(found[1][name] - one).max() < 1e-5 * np.abs(one).max(), name


@pytest.mark.parametrize("count", [63, 64, 65, 1023, 1025, 3000])
def test_shares_of_any_number_of_anchors(device, count):
    """Fewer anchors than shares, as many, whole blocks of them and not."""
    layout = HeadLayout(splats=3, features=7, hidden=9, control=5)
    rng = np.random.default_rng(count)
    arrays = [
        initial_weights(layout, rng),
        rng.normal(size=(count, 3)).astype(np.float32),
        rng.normal(size=(count, padded(layout.features))).astype(np.float32),
    ]
    control, eye = rng.random(5), np.array([2.0, 1.0, 1.5])
    grad_raw = rng.normal(size=(count, layout.raw_at[-1])).astype(np.float32)
    found = []
    for form in ("cpu", "gpu", "gpu"):
        heads, on_device = Heads(device, layout, form), [device.upload(a) for a in arrays]
        heads.grad_chunks.fill(np.nan)  # whatever is not written would show
        raw = heads.forward(*on_device, control, eye)
        moved = device.zeros((count, 3))
        grads = heads.backward(*on_device, device.upload(grad_raw), moved)
        found.append([device.download(a) for a in (raw, *grads, moved)])
    for one, other, again in zip(*found, strict=True):
        np.testing.assert_array_equal(other, again)
        assert np.abs(one - other).max() <= 1e-5 * np.abs(one).max()


def test_blocks_cover_every_weight_once():
    layout = HeadLayout(splats=10, features=7, hidden=20)
    seen = np.zeros(layout.weights_at[-1], int)
    number = np.arange(seen.size)
    for head, layer, i, j in blocks_of_weights(layout):
        weight, bias = layout.parts(number, head)[2 * layer : 2 * layer + 2]
        block = np.vstack([weight, bias[None]])[i : i + 16, j : j + 16]
        assert block.size
        seen[block] += 1
    np.testing.assert_array_equal(seen, 1)


def test_runs_of_both_forms_learn_alike_and_each_keeps_its_bits(device, as_gpu, balls):
    losses, states = [], []
    for where in (device, as_gpu, as_gpu):
        trainer = Trainer(where, balls, SETTINGS)
        losses.append([now.loss for now in trainer.steps() if now.loss is not None])
        states.append(trainer.adam.state())
    assert all(np.array_equal(states[1][n], states[2][n]) for n in states[1])
    cpu, gpu, _ = (np.array(found) for found in losses)
    assert len(cpu) >= 2 and cpu[-1] < 0.8 * cpu[0]
    # Rounding grows from step to step: Adam's first steps are the sign of the gradient.
    np.testing.assert_allclose(gpu, cpu, rtol=0.02)


@pytest.mark.slow
def test_growing_works_in_the_gpu_forms(as_gpu, balls):
    changes = {"grow": True, "grow_every": 20, "iterations": 120}
    few = replace(balls, points=balls.points[::100])  # which leaves room
    trainer = Trainer(as_gpu, few, replace(SETTINGS, **changes, max_anchors=400))
    first = trainer.anchors_count
    losses = [now.loss for now in trainer.steps() if now.loss is not None]
    assert np.isfinite(losses).all() and losses[-1] < losses[0]
    assert trainer.anchors_count != first


@pytest.mark.parametrize(
    ("name", "width", "version"), [("gray_light", 8, "shapeshift 3"), ("light", 24, "shapeshift 4")]
)
def test_light_of_one_or_three_channels_is_learned_kept_and_gone_on_with(
    device, balls, name, width, version
):
    """The format of one channel is that of older packages."""
    settings = replace(SETTINGS, anchor_attributes=f"frame,color,{name}", iterations=12)
    whole = Trainer(device, balls, settings)
    whole.exposures.one_exposure = True  # so few steps do not tell, and light would rest
    for _ in whole.steps():
        pass
    model = whole.model()
    assert model.light.shape == (whole.anchors_count, width) and model.light.any()
    files = package_files(model, "float16")
    assert json.loads(files[MANIFEST])["format"] == version
    back = read_files(files.__getitem__, "here")
    # A byte a number, on steps of a power of two: at most a 127th of the largest away.
    np.testing.assert_allclose(back.light, model.light, atol=np.abs(model.light).max() / 127)
    half = Trainer(device, balls, replace(settings, iterations=6))
    for _ in half.steps():
        pass
    state, notes = half.checkpoint()
    again = Trainer(device, balls, settings, (state, notes))
    for _ in again.steps():
        pass
    assert again.model().light.shape == model.light.shape and again.iteration == 12
