"""The price of a stale order, with quads: told without a trace in the frames around it."""

import numpy as np
import pytest

from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import View, look_at
from tests.support.splat_scenes import psnr_db, two_objects


def orbit(degrees: float) -> View:
    angle = np.radians(degrees)
    eye = 4 * np.array([np.sin(angle), 0.2, np.cos(angle)])
    return View(look_at(eye, (0, 0, 0)), (-0.3, 0.3, -0.225, 0.225), 0.05, 50, (120, 90))


@pytest.mark.parametrize("sort", ["gl", "numpy"])
def test_the_price_of_a_stale_order_is_told_and_paid_by_no_frame(ctx, sort):
    with Renderer(ctx, "quads", sort=sort, target="rgba32f") as renderer:
        renderer.update(two_objects(2000))
        renderer.draw([orbit(25)])
        exact = renderer.image().copy()
        assert renderer.stale_order_db([orbit(25)]) == np.inf
        renderer.settings = RenderSettings(resort_frames=0)
        for view in (orbit(0), orbit(25)):
            stats = renderer.draw([view])
        kept = renderer.image().copy()
        assert (stats.sorts, stats.order_age) == (0, 1)
        db = renderer.stale_order_db([orbit(25)])
        assert db == pytest.approx(psnr_db(kept[..., :3], exact[..., :3]), abs=0.01)
        assert 15 < db < 45
        np.testing.assert_array_equal(renderer.image(), kept)
        stats = renderer.draw([orbit(25)])
        assert (stats.sorts, stats.order_age) == (0, 2)
        np.testing.assert_array_equal(renderer.image(), kept)
