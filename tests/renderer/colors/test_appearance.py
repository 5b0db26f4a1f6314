"""Exposure, gamma, tint and opacity of objects: the same on tiles and quads, free where neutral."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import LIMITS, NEUTRAL, Appearance
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.heat_scenes import BEHIND, CASES, VIEW, model
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import psnr_db, random_layers

RENDERERS = EITHER_ON_GL
EDGE = 1 / 255 + 1e-3  # where alpha falls to min_alpha, one side may draw it and the other not
HALF = 2.0**-10  # quads hold colours up to 2 as half floats, whose steps there are 2^-10
LOOKS = {
    "exposure": Appearance(exposure=0.7), "darker": Appearance(exposure=-2.0),
    "tint": Appearance(tint=(1.0, 0.5, 0.0)), "both": Appearance(-0.5, 1.0, (0.2, 1.2, 0.7)),
}  # fmt: skip


def drawn(renderer: Renderer, *things: SceneObject, **settings) -> np.ndarray:
    """(H, W, 4) premultiplied, a copy."""
    renderer.settings = RenderSettings(background=BEHIND, **settings)
    renderer.update(Scene(things))
    drawn.stats = renderer.draw([VIEW])
    return renderer.image().copy()


def thing(appearance: Appearance = NEUTRAL, **changes) -> SceneObject:
    return SceneObject("thing", model(40), **changes, appearance=appearance)


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_exposure_and_tint_multiply_the_picture(renderer, look):
    obj = thing()
    plain = drawn(renderer, obj)
    graded = drawn(renderer, replace(obj, appearance=look))
    # Another formula than the splats': blending is linear in their colours.
    gain = np.array(look.tint) * 2 ** (look.exposure / 2.2)
    np.testing.assert_allclose(graded[..., :3], plain[..., :3] * gain, atol=2 * HALF)
    np.testing.assert_array_equal(graded[..., 3], plain[..., 3])
    assert not np.array_equal(graded, plain)


def test_gamma_of_one_splat_is_that_of_its_pixels(renderer):
    layers = replace(
        random_layers(1, coefficients=1), means=np.zeros((1, 3), np.float32),
        scales=np.full((1, 3), 0.3, np.float32), opacity=np.ones(1, np.float32),
    )  # fmt: skip
    obj = SceneObject("one", layers)
    looks = (NEUTRAL, Appearance(gamma=2.5))
    plain, graded = (drawn(renderer, replace(obj, appearance=look)) for look in looks)
    solid = plain[..., 3] > 0.5
    assert solid.sum() > 50
    color, after = (image[solid][:, :3] / image[solid][:, 3:] for image in (plain, graded))
    np.testing.assert_allclose(after, color ** (1 / 2.5), atol=4 * HALF)


@pytest.mark.parametrize("changes", [{"x": 0.0}, {"x": 0.5}, *CASES.values()])
def test_any_look_at_any_stop_equals_the_reference(renderer, changes):
    obj = thing(Appearance(0.6, 1.7, (1.0, 0.8, 0.5), 0.6), **changes)
    image = drawn(renderer, obj)
    least_db = 60 if renderer.backends["drawing"].startswith("quads") else 75
    assert psnr_db(image, reference_image(Scene((obj,)), VIEW)) > least_db


def test_what_was_measured_keeps_its_colours(renderer):
    for changes in ({"x": 0.5}, {"x": 1.0}):  # pure thermal stops
        obj = thing(**changes)
        plain = drawn(renderer, obj)
        look = Appearance(exposure=2.0, gamma=3.0, tint=(0.0, 1.0, 0.0))
        np.testing.assert_array_equal(drawn(renderer, replace(obj, appearance=look)), plain)
    # Beside another stop only the other one's share changes: heat is what is left at tint 0.
    drawn(renderer, thing(Appearance(tint=(0.0, 0.0, 0.0)), x=0.3))
    np.testing.assert_array_equal(renderer.drawing.image(0)[..., :3], 0)
    assert renderer.drawing.heat(0)[..., 1].max() > 0.1


def test_neutral_is_the_frame_without_to_the_bit_and_runs_nothing(renderer, monkeypatch):
    obj = thing(x=0.2)
    plain = drawn(renderer, obj)
    drawn(renderer, replace(obj, appearance=Appearance(1.0, 2.0, (0.1, 0.2, 0.3), 0.4)))
    np.testing.assert_array_equal(drawn(renderer, obj), plain)
    scaled, graded, decode = [], [], renderer.drawing.decode_color
    monkeypatch.setattr(renderer.drawing, "write_splats", lambda *values: scaled.append(values))
    monkeypatch.setattr(
        renderer.drawing, "decode_color", lambda *a: (graded.append(a[5]), decode(*a))
    )
    drawn(renderer, replace(obj, x=0.3))
    assert not scaled and graded == [None]


def test_opacity_0_is_hidden_to_the_bit(renderer):
    other = SceneObject("other", random_layers(200))
    for changes in ({"x": 0.0}, {"x": 0.5}):
        hidden = drawn(renderer, other, thing(visible=False, **changes))
        counts = (drawn.stats.drawn, drawn.stats.culled)
        gone = drawn(renderer, other, thing(Appearance(opacity=0.0), **changes))
        np.testing.assert_array_equal(gone, hidden)
        assert (drawn.stats.drawn, drawn.stats.culled) == counts


def test_opacity_scales_that_of_each_splat_and_comes_back(renderer):
    obj = SceneObject("cloud", random_layers(300, layers=2), x=0.4)
    plain = drawn(renderer, obj)
    for opacity in (0.002, 1e-9, 1e-44, 0.5):
        shown = replace(obj, appearance=Appearance(opacity=opacity))
        image = drawn(renderer, shown)
        assert (drawn.stats.geometry_runs, drawn.stats.color_runs) == (0, 0)
        assert np.abs(image - reference_image(Scene((shown,)), VIEW)).max() < EDGE
    assert image[..., 3].max() < plain[..., 3].max()
    np.testing.assert_array_equal(drawn(renderer, obj), plain)
    # At another x the factor stays, of the opacities there.
    shown = replace(obj, x=0.9, appearance=Appearance(opacity=0.5))
    assert np.abs(drawn(renderer, shown) - reference_image(Scene((shown,)), VIEW)).max() < EDGE


def test_depth_and_coverage_are_of_what_is_seen(renderer):
    obj = SceneObject("cloud", random_layers(300))
    drawn(renderer, obj)
    whole = renderer.surface(VIEW).coverage.max()
    drawn(renderer, replace(obj, appearance=Appearance(opacity=0.1)))
    assert 0 < renderer.surface(VIEW).coverage.max() < whole
    drawn(renderer, replace(obj, appearance=Appearance(opacity=0.0)))
    assert not renderer.surface(VIEW).coverage.any()


def test_a_bright_exposure_fits_the_target_of_quads(renderer):
    """16 bits from 0 to the brightest colour: what is brighter than the model has room, too."""
    obj = SceneObject("one", random_layers(60, coefficients=1))
    shown = replace(obj, appearance=Appearance(exposure=4.0))
    image = drawn(renderer, shown, target="rgba16")
    wanted = reference_image(Scene((shown,)), VIEW)
    assert wanted.max() > 1.5 and np.abs(image - wanted).max() < 0.01


@pytest.mark.parametrize("name", LIMITS)
def test_limits(name):
    least, most = LIMITS[name]
    for value in (least, most):
        Appearance(**{name: (value,) * 3 if name == "tint" else value})
    below, above = np.nextafter(least, -np.inf), np.nextafter(most, np.inf)
    for value in (below, above, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"^{name} is "):
            Appearance(**{name: (1.0, value, 1.0) if name == "tint" else value})


def test_two_looks_as_one():
    one, other = Appearance(0.5, 1.6, (0.9, 0.5, 1.0), 0.5), Appearance(-1, 0.7, (1, 0.3, 0.8), 0.3)
    color = np.random.default_rng(1).uniform(0, 2, (50, 3))
    both = one.under(other)
    np.testing.assert_allclose(both.graded(color), other.graded(one.graded(color)), rtol=1e-12)
    assert both.opacity == pytest.approx(0.15)
    assert one.under(NEUTRAL) == one and NEUTRAL.under(one) == one
