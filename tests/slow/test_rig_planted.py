"""A planted offset of two degrees and three centimetres is found to a tenth, on the demo."""

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.calibration.calibrate import PYRAMID, STEPS, search, shape_for
from shapeshift.training.calibration.extrinsics import (
    moved_by,
    offset_capture,
    offset_of_matrix,
    rig_json,
    with_extrinsics,
)
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.workshop import make_workshop

pytestmark = pytest.mark.slow

SETTINGS = TrainSettings()
TURN, SHIFT = (0, 2, 0), (0.03, 0, 0)  # degrees and metres: what parallax alone tells apart


def planted() -> np.ndarray:
    return moved_by(np.concatenate([np.deg2rad(TURN), SHIFT]))


@pytest.fixture(scope="module")
def held(tmp_path_factory) -> tuple:
    """The demo's capture, and the shape that its photos of visible light give."""
    demo, device = make_workshop(tmp_path_factory.mktemp("demo")), open_device("cpu")
    return device, demo, shape_for(device, demo, SETTINGS, "Thermal", STEPS, lambda *_: None)


def test_a_planted_offset_is_found_to_a_tenth(held):
    device, demo, shape = held
    true = planted()
    wrong = offset_capture(demo, "Thermal", np.linalg.inv(true))
    found = search(device, wrong, SETTINGS, "Thermal", shape, PYRAMID, lambda *_: None)
    left = offset_of_matrix(np.linalg.inv(true) @ found.offset)
    assert left.turn_deg < 0.2
    assert left.shift_m < 0.003
    assert found.gain_db > 2
    check_views(with_extrinsics(wrong, rig_json("Thermal", found)), demo)


def check_views(right: Capture, stated: Capture) -> None:
    """All cameras of the capture with the offset stand where they stood."""
    for photo, before in zip(right.photos, stated.photos, strict=True):
        away = photo.view.world_from_eye.position - before.view.world_from_eye.position
        assert (
            photo.view == before.view
            if photo.modality != "Thermal"
            else np.linalg.norm(away) < 0.003
        )
