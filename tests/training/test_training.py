"""Training as a whole on a small ray-traced capture: quality, bits, guard, resume, export."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.app import progress
from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.eyes import eyes_of
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.checkpoint import checkpoint_path, read_checkpoint, write_checkpoint
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.settings import TrainSettings, resumed
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.program import assert_refused, launch
from tests.support.training.training_runs import run, run_keeping

ROOT = Path(__file__).resolve().parents[2]
# An even encoding tells two stops apart within fewer steps than one unit a stop does.
SETTINGS = TrainSettings(iterations=200, grow=False, max_anchors=2000)


@pytest.fixture(scope="module")
def balls(tmp_path_factory) -> Capture:
    return make_balls(tmp_path_factory.mktemp("balls"), size=100, views=20, test_views=4)


@pytest.fixture(scope="module")
def few(tmp_path_factory) -> Capture:
    """Where it is about bits and not about pictures."""
    made = make_balls(tmp_path_factory.mktemp("few"), size=48, views=6, test_views=1)
    made = read_capture(made.folder)  # as another process has it
    return replace(made, points=made.points[::4])


def same_bits(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[n], b[n], equal_nan=True) for n in a)


@pytest.fixture(scope="module")
def trained(device, balls) -> Trainer:
    return run(Trainer(device, balls, SETTINGS))


def test_two_hundred_steps_reach_a_picture(trained):
    psnr = trained.held_out_psnr(most=99)
    assert psnr["RGB"] > 22.5 and psnr["Thermal"] > 29.5, psnr
    assert trained.guard.rollbacks == 0


@pytest.fixture(scope="module")
def forty(device, few) -> dict[str, np.ndarray]:
    """All from which a run goes on after forty steps."""
    return run(Trainer(device, few, SETTINGS), steps=40).checkpoint()[0]


def test_the_same_seed_gives_the_same_bits(device, few, forty):
    assert same_bits(run(Trainer(device, few, SETTINGS), steps=40).checkpoint()[0], forty)
    begun = [Trainer(device, few, replace(SETTINGS, seed=i)).checkpoint()[0] for i in (0, 1)]
    assert not np.array_equal(begun[0]["weights.value"], begun[1]["weights.value"])


ONE_THREAD = """
import sys
from dataclasses import replace
from pathlib import Path
from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from tests.training.test_training import SETTINGS, run
from shapeshift.training.checkpoint import write_checkpoint
from shapeshift.training.train import Trainer
few = read_capture(Path(sys.argv[1]))
few = replace(few, points=few.points[::4])
trainer = run(Trainer(open_device("cpu"), few, SETTINGS), steps=40)
write_checkpoint(Path(sys.argv[2]), *trainer.checkpoint())
"""


def test_one_thread_gives_the_same_bits_as_all(few, forty, tmp_path):
    out = tmp_path / "one.npz"
    environment = {**os.environ, "POCL_MAX_PTHREAD_COUNT": "1", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", ONE_THREAD, str(few.folder), str(out)]
    subprocess.run(command, check=True, cwd=ROOT, env=environment, timeout=120)
    assert same_bits(read_checkpoint(out)[0], forty)


def test_resuming_equals_never_having_stopped(device, few, tmp_path):
    settings = replace(SETTINGS, iterations=100, grow=True, grow_every=20, max_anchors=2500)
    stops = (37, 40)  # before a change of anchors, and on one
    whole, kept = run_keeping(Trainer(device, few, settings), tmp_path, *stops)
    assert whole.anchors_count != len(few.points)  # growing did something between the stops
    for begun, end in zip(kept, [*kept[1:], whole.checkpoint()], strict=True):  # each to the next
        resumed = run(Trainer(device, few, settings, begun), end[1]["iteration"])
        assert same_bits(resumed.checkpoint()[0], end[0]), begun[1]["iteration"]


def test_the_guard_halves_rates_that_are_too_high(device, few):
    trainer = Trainer(device, few, SETTINGS)
    trainer.rate_scale = 400.0
    for _ in trainer.steps():
        if trainer.guard.rollbacks:
            break
    assert trainer.guard.rollbacks > 0 and trainer.rate_scale < 400
    assert all(np.isfinite(a).all() for a in trainer.adam.state().values())


@pytest.mark.slow
@pytest.mark.parametrize("factor", [50.0, 400.0])
def test_the_guard_rescues_rates_that_are_too_high(device, balls, factor):
    """Each time it is turned back the rates are halved, and rise again over 200 steps."""
    trainer = Trainer(device, balls, replace(SETTINGS, iterations=750))
    trainer.rate_scale = factor
    run(trainer)
    assert trainer.guard.rollbacks > 0
    assert trainer.rate_scale < factor
    psnr = trainer.held_out_psnr(most=99)
    assert psnr["RGB"] > 22 and psnr["Thermal"] > 27, psnr


def test_the_guard_rescues_weights_that_are_not_numbers(device, few):
    trainer = Trainer(device, few, SETTINGS)
    for now in trainer.steps():
        if now.iteration == 60:
            state = trainer.adam.state()
            state["weights.value"][::7] = np.nan
            trainer.adam.load(state)
        if now.iteration == 120:
            break
    assert trainer.guard.rollbacks > 0
    assert all(np.isfinite(a).all() for a in trainer.adam.state().values())


def test_the_package_draws_what_was_trained(trained, device, balls, tmp_path):
    """The trainer's own kernels, and the five exported networks run by onnxruntime, agree."""
    path = tmp_path / "balls.shift"
    write_package(trained.model(), path, features="float32")
    model = read_model(path)
    eye = np.array([2.0, 1.5, -0.5])
    for stop in model.stops:
        drawn = trained.step.decode(trained.control(stop.name), eye)
        exported = evaluate(model, stop.x, eye)
        for name in ("means", "scales", "opacity", "color"):
            ours = device.download(getattr(drawn, name))
            np.testing.assert_allclose(getattr(exported, name), ours, atol=2e-5, err_msg=name)
        wxyz = device.download(drawn.wxyz)
        wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
        np.testing.assert_allclose(exported.wxyz, wxyz, atol=2e-5)
    provenance = model.provenance
    assert provenance["settings"]["seed"] == 0 and provenance["iterations"] == 200
    taken = [p.view.world_from_eye.position for p in balls.photos if p.split == "train"]
    away = np.linalg.norm(eyes_of(model)[:, None] - taken, axis=2)  # (E, photos) metres
    assert away.min(axis=1).max() < 1e-3 and away.min(axis=0).max() < 1e-3  # all, and no other
    own = trained.held_out_psnr(most=99)
    for name, score in evaluate_model(device, model, balls).items():
        assert score.psnr_db == pytest.approx(own[name], abs=0.02)
        assert 0 < score.alive <= model.splat_count and 0.5 < score.ssim < 1


@pytest.mark.slow
def test_growing_ends_higher(device, balls):
    settings = replace(SETTINGS, iterations=400)  # after 200 steps the new_anchors still cost
    few = replace(balls, points=balls.points[::40])  # of enough points a run starts at its cap
    plain = run(Trainer(device, few, settings))
    growing = replace(settings, grow=True, grow_every=25, max_anchors=3000)
    grown = run(Trainer(device, few, growing))
    assert plain.anchors_count < grown.anchors_count <= 3000
    before = plain.held_out_psnr(most=99)
    for name, psnr in grown.held_out_psnr(most=99).items():
        assert psnr > before[name] + 0.1, name


def train_command(*arguments) -> list[str]:
    code = "import sys; from shapeshift.app.cli import main; sys.exit(main(sys.argv[1:]))"
    return [sys.executable, "-c", code, "train", *map(str, arguments)]


def test_ctrl_c_leaves_a_readable_package_and_resume_goes_on(few, tmp_path):
    out = tmp_path / "cut.shift"
    command = train_command(few.folder, "--out", out, "--iterations", 100000, "--max-anchors", 1500)
    environment = os.environ | {progress.PERIOD: "0.1"}  # seconds from line to line
    process = subprocess.Popen(
        command, cwd=ROOT, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert any(re.search(r"train: [1-9]\d* steps", line) for line in process.stderr)
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=60)
    assert process.returncode == 130, rest
    assert "--resume" in rest
    model = read_model(out)
    done = model.provenance["iterations"]
    assert done > 0
    assert not list(tmp_path.glob("*.partial*"))
    resume = ("train", few.folder, "--out", out, "--resume")
    assert launch(*resume, "--iterations", done + 5).returncode == 0
    assert read_model(out).provenance["iterations"] == done + 5
    assert_refused(launch(*resume, "--seed", 7), "seed is 0, not 7")


def test_a_checkpoint_that_is_cut_off_is_refused(tmp_path):
    path = checkpoint_path(tmp_path / "a.shift")
    with pytest.raises(BadFile, match="no checkpoint"):
        read_checkpoint(path)
    write_checkpoint(path, {"a": np.zeros(100)}, {"x": 1})
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(BadFile, match="not a readable checkpoint"):
        read_checkpoint(path)


def test_a_checkpoint_of_another_version_is_refused():
    before = SETTINGS.as_dict()
    assert resumed(TrainSettings(), before, {}) == SETTINGS
    older = {name: value for name, value in before.items() if name != "points"} | {"voxel": None}
    for other, word in ((older, "points"), (before | {"tomorrow": 1}, "tomorrow")):
        with pytest.raises(ValueError, match=rf"another version.*\({word}\); train anew"):
            resumed(TrainSettings(), other, {})


def test_a_modality_without_photos_is_refused(device, balls):
    one = tuple(p for p in balls.photos if p.modality == "RGB" or p.split == "test")
    with pytest.raises(BadFile, match="'Thermal' has no training photos"):
        Trainer(device, replace(balls, photos=one), SETTINGS)
