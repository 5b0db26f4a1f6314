"""A stop that was put in is drawn alike by everything that draws, and so are the others."""

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.cameras.framing import orbit_path
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.new_stops import framed_model, wild_stop
from tests.support.renderer.frames import draw
from tests.support.renderer.renderers import TILES, quads

RENDERERS = {
    "tiles": TILES,
    "quads, networks in GL": quads(mlps="gl", sort="gl"),
    "quads, networks in onnxruntime": quads(mlps="onnxruntime"),
}
MODEL = framed_model(60)
WILD = wild_stop(MODEL, inside=np.arange(60) < 45)
CONTROLS = {
    "the new stop": StopWeights((("Wild", 1.0),)),
    "an old stop": StopWeights((("RGB", 1.0),)),
    "on the way": StopWeights((("RGB", 0.15), ("Wild", 0.85))),
}


@pytest.mark.parametrize("name", CONTROLS)
def test_everything_that_draws_shows_the_new_stop(renderer, name):
    """Against the float64 reference: splats at a threshold aside, 60 dB, as of any other scene."""
    scene = Scene((SceneObject("wild", WILD, x=CONTROLS[name]),))
    view = orbit_path(5, np.zeros(3), 1.0, (96, 72))[1]
    (picture,) = draw(renderer, scene, [view])
    wanted = reference_image(scene, view, RenderSettings())
    error = float(((picture[..., :3] - wanted[..., :3]) ** 2).mean())
    assert -10 * np.log10(error) > 60


def test_old_stops_are_drawn_as_before(renderer):
    """90 dB is the promise; random networks, whose splats lie over each other by the dozen."""
    views = orbit_path(4, np.zeros(3), 1.0, (96, 72))
    for stop in MODEL.stops:
        blend = StopWeights(((stop.name, 1.0),))
        before, after = (
            draw(renderer, Scene((SceneObject("one", model, x=blend),)), views)
            for model in (MODEL, WILD)
        )
        for one, other in zip(before, after, strict=True):
            error = float(((one - other) ** 2).mean())
            assert -10 * np.log10(max(error, 1e-20)) > 90, stop.name
