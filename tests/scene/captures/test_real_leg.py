"""The trained leg against pictures that another splatter made of it: axes, harmonics, layers."""

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.splat_scenes import psnr_db


@pytest.fixture(scope="module")
def renderer():
    with Renderer(None, drawing="tiles") as renderer:
        renderer.settings = RenderSettings(background=(1.0, 1.0, 1.0))
        yield renderer


def test_the_leg_looks_as_its_pictures_in_every_layer(data, renderer):
    """Degree 3, 136,605 splats, turned at the reader; the capture's poses are turned by theirs."""
    leg = read_model(data / "anatomy_leg_ml3dgs")
    capture = read_capture(data / "anatomy_leg_3modal_views")
    for stop, modality in zip(leg.stops, capture.stops, strict=True):
        renderer.update(Scene((SceneObject("leg", leg, x=stop.x),)))
        for photo in capture.of(modality.name, "test")[:3]:
            renderer.draw([photo.view])
            picture = load_photo(photo).rgb / np.float32(255)
            assert psnr_db(renderer.resolved(0), picture) > 60, photo.path.name
