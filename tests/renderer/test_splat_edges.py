"""Splats as ellipses, points and rings: tiles and quads against pixels tried one by one."""

import numpy as np
import pytest

from shapeshift.rasterizer.debug_passes import BAND_PX, EDGE_POWER, POINT_PX
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import EDGES, RenderSettings
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.heat_scenes import VIEW
from tests.support.renderer.reference_reasons import project_object
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import random_layers

RENDERERS = EITHER_ON_GL
CLOUD = SceneObject("cloud", random_layers(60, coefficients=1))


def by_pixels(kind: str, shift: float = 0.0) -> np.ndarray:
    """(H, W, 3): the nearest splat of each pixel; shift: of all edges, pixels outwards."""
    settings = RenderSettings(debug=kind)
    eye = VIEW.world_from_eye.position
    depth, mean, covariance, opacity, color = project_object(CLOUD, VIEW, settings, eye)
    order = np.argsort(depth, kind="stable")[::-1]
    y, x = np.mgrid[: VIEW.size[1], : VIEW.size[0]] + 0.5
    out = np.zeros((*VIEW.size[::-1], 3))
    for i in order:
        d = np.stack([x - mean[i, 0], y - mean[i, 1]], axis=-1)
        conic = np.linalg.inv(covariance[i])
        gradient = d @ conic  # of half the power
        power = (d * gradient).sum(axis=-1)
        end = min(EDGE_POWER, 2 * np.log(opacity[i] / settings.min_alpha))
        root, rise = np.sqrt(power), np.linalg.norm(gradient, axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(rise > 0, (np.sqrt(end) - root) * root / rise, np.inf)  # pixels
        part = left >= -shift
        if kind == "points":
            part &= np.hypot(*np.moveaxis(d, -1, 0)) <= POINT_PX + shift
        if kind == "rings":
            part &= left <= BAND_PX + shift
        shade = 1 - 0.5 * np.clip(power / end, 0, 1) if kind == "ellipses" else np.ones_like(power)
        out[part] = color[i] * shade[part, None]
    return out


@pytest.mark.parametrize("kind", EDGES)
def test_each_pixel_shows_the_nearest_splat_that_it_is_part_of(renderer: Renderer, kind):
    renderer.settings = RenderSettings(debug=kind)
    renderer.update(Scene((CLOUD,)))
    renderer.draw([VIEW])
    found, wanted = renderer.resolved(), by_pixels(kind)
    shown = (wanted > 0).any(axis=2)
    assert 0.02 < shown.mean() < 0.98
    # Half floats of the quads' records move an edge by a hundredth of a pixel or so.
    wrong = np.abs(found - wanted).max(axis=2) > 0.01
    either = np.abs(by_pixels(kind, 0.05) - by_pixels(kind, -0.05)).max(axis=2) > 0.01
    assert not (wrong & ~either).sum() > 0.002 * wrong.size
    assert wrong.mean() < 0.02


def test_the_frame_afterwards_is_as_ever_and_an_empty_scene_is_black(renderer: Renderer):
    renderer.settings = RenderSettings()
    renderer.update(Scene((CLOUD,)))
    renderer.draw([VIEW])
    plain = renderer.resolved().copy()
    for kind in EDGES:
        renderer.settings = RenderSettings(debug=kind)
        renderer.draw([VIEW])
    renderer.settings = RenderSettings()
    renderer.draw([VIEW])
    np.testing.assert_array_equal(renderer.resolved(), plain)
    renderer.update(Scene(()))
    renderer.settings = RenderSettings(debug="rings")
    renderer.draw([VIEW])
    assert not renderer.resolved().any()


@pytest.mark.parametrize("kind", EDGES)
def test_two_objects_and_two_views(renderer: Renderer, kind):
    """As parts of one picture: what hides what does not depend on the objects' order."""
    layers = random_layers(60, coefficients=1)
    rows = np.arange(60) % 2 == 0
    halves = [SceneObject(f"half {n}", layers.with_rows(r)) for n, r in enumerate((rows, ~rows))]
    renderer.settings = RenderSettings(debug=kind)
    pictures = []
    for objects in ((SceneObject("all", layers),), tuple(halves), tuple(halves[::-1])):
        renderer.update(Scene(objects))
        renderer.draw([VIEW, VIEW])
        pictures += [renderer.resolved(0), renderer.resolved(1)]
    for picture in pictures[1:]:
        np.testing.assert_allclose(picture, pictures[0], atol=1e-6)
