"""How far training comes: iterations, not seconds, so that a busy machine does not fail it."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
pytestmark = pytest.mark.slow


def psnr_after(capture, **changes) -> dict[str, float]:
    trainer = Trainer(open_device("cpu"), capture, replace(TrainSettings(), **changes))
    for _ in trainer.steps():
        pass
    return trainer.held_out_psnr(most=99)


def test_balls_in_the_steps_of_twenty_seconds(tmp_path):
    psnr = psnr_after(make_balls(tmp_path), iterations=1000)
    assert psnr["RGB"] > 28.5 and psnr["Thermal"] > 35.5, psnr


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("anatomy_leg_3modal_views", {"bone": 28.8, "muscle": 28.5, "full": 28.7}),
        ("plush_snowmiku", {"RGB": 23.5}),
    ],
)
def test_real_captures(name, least):
    if not (DATA / name).is_dir():
        pytest.skip(f"the capture {name} is not here")
    psnr = psnr_after(read_capture(DATA / name), iterations=1000)
    assert all(psnr[modality] > low for modality, low in least.items()), psnr
