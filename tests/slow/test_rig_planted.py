"""A planted offset of two degrees and three centimetres is found from the photos alone."""

import numpy as np
import pytest

from rasterizer.device import open_device
from training.rig import calibrate, moved_by, noted, offset_capture, told, with_found
from training.settings import TrainSettings
from training.synthetic.balls import make_balls

pytestmark = pytest.mark.slow


def planted(seed: int) -> np.ndarray:
    turn, shift = np.random.default_rng(seed).normal(size=(2, 3))
    turn *= np.deg2rad(2) / np.linalg.norm(turn)
    return moved_by(np.concatenate([turn, 0.03 * shift / np.linalg.norm(shift)]))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_planted_offset_is_found(tmp_path, seed):
    balls = make_balls(tmp_path, size=80, views=20, test_views=1)
    wrong = offset_capture(balls, "Thermal", np.linalg.inv(planted(seed)))
    found = calibrate(open_device("cpu"), wrong, TrainSettings(anchors=3000), "Thermal", 600)
    left = told(np.linalg.inv(planted(seed)) @ found.offset)
    assert left.turn_deg < 0.2  # a tenth
    assert left.shift_m < 0.01  # a third: at 80 pixels a photo, 0.3 pixels
    right = with_found(wrong, noted("Thermal", found))
    for photo, stated in zip(right.photos, balls.photos, strict=True):
        away = photo.view.world_from_eye.position - stated.view.world_from_eye.position
        assert photo.view == stated.view if photo.modality == "RGB" else np.abs(away).max() < 0.01
