"""What quads blend into: which format for which colours, and every way to read it."""

import logging
from dataclasses import replace

import moderngl
import numpy as np
import pytest

import shapeshift.renderer.gl.target as target_module
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.target import MOST_UNIT, choose_target
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.colors.spherical_harmonics import C0
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.frames import draw
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    psnr_db,
    random_layers,
    random_model,
    stereo_views,
)

RENDERERS = EITHER_ON_GL

VIEW = front_view((96, 72))


def bright(most: float, coefficients: int = 9) -> SplatLayers:
    """A cloud whose colours go up to about `most`."""
    layers = random_layers(1500, seed=2, coefficients=coefficients)
    sh = layers.sh.copy()
    sh[:, 0] += np.float32(0.6 * (most - 1) / C0)
    return replace(layers, sh=sh)


def with_head(head: str, **kind):
    model = random_model(60)
    mlp = replace(model.networks["color"], head=head, **kind)
    return replace(model, networks=model.networks | {"color": mlp})


MODELS = {  # name: (model, target, unit is 1)
    "networks": (lambda: random_model(60), "rgba16", True),
    "harmonics": (lambda: random_layers(300), "rgba16", False),
    "bright": (lambda: bright(6.0), "rgba16", False),
    "too bright": (lambda: bright(3 * MOST_UNIT), "rgba16f", True),
    "a gain": (lambda: with_head("sigmoid", gain=3.0), "rgba16", False),
    "below zero": (lambda: with_head("tanh"), "rgba16f", True),
    "no bound": (lambda: with_head("none"), "rgba16f", True),
    "no bound above": (lambda: with_head("softplus"), "rgba16f", True),
    "clipped": (lambda: with_head("softplus", clip=(-9.0, 2.0)), "rgba16", False),
    "nothing": (lambda: random_layers(0), "rgba16", True),
}


@pytest.mark.parametrize("name", MODELS)
def test_the_format_is_that_which_holds_the_colours(ctx, name):
    """And whatever it is, the picture is that of float32 but for its rounding."""
    make, target, plain = MODELS[name]
    scene = alone(make())
    with Renderer(ctx, "quads") as renderer:
        (image,) = draw(renderer, scene, [VIEW])
        assert renderer.backends["drawing"] == f"quads ({target})"
        assert (renderer.drawing.unit_of(0) == 1) == plain
        (fine,) = draw(renderer, scene, [VIEW], target="rgba32f")
    scale = max(1.0, float(np.abs(fine).max()))
    assert psnr_db(image / scale, fine / scale) > (76 if target == "rgba16" else 45)
    if name != "nothing":
        assert image.any()


def test_another_object_changes_the_unit(ctx):
    dim = SceneObject("dim", random_model(60))
    with Renderer(ctx, "quads") as renderer:
        units = []
        for more in ((), (SceneObject("lamp", bright(9.0)),), ()):
            draw(renderer, Scene((dim, *more)), [VIEW])
            units.append(renderer.drawing.unit_of(0))
    assert units[0] == units[2] == 1 < 4 < units[1]


@pytest.mark.parametrize("color", [1.0, 2.5, 40.0])
def test_colours_above_1_are_added_up_as_floats_add_them(ctx, color):
    """Bright behind faint: a picture that cuts each layer at 1 would be darker here."""
    rgb = [[(color - 0.5) / C0, (0.4 - 0.5) / C0, (color - 0.5) / C0]]
    dark = [[-0.5 / C0] * 3]
    model = one_splat(
        means=[[0, 0, 0], [0, 0, 0.5]], scales=np.full((2, 3), 0.3), wxyz=[[1, 0, 0, 0]] * 2,
        opacity=[0.95, 0.5], sh=[rgb, dark],
    )  # fmt: skip
    with Renderer(ctx, "quads") as renderer:
        (image,) = draw(renderer, alone(model), [VIEW])
        (fine,) = draw(renderer, alone(model), [VIEW], target="rgba32f")
    assert fine[..., 0].max() > 0.47 * color
    # Half a step a layer, two layers, and as much again on the way through the record's halves.
    np.testing.assert_allclose(image, fine, atol=4 / 131070 * color)


def test_every_way_to_read_the_picture_counts_in_its_unit(ctx):
    """image, resolved and present; a palette; half the size; both eyes in one draw or two."""
    heat = (Stop("rgb", 0.0), Stop("heat", 1.0, "thermal", "ironbow"))
    scene = alone(replace(bright(4.0), stops=heat), x=0.6)
    views = stereo_views((96, 72))
    for changes in ({}, {"render_scale": 0.5}, {"background": (0.3, 0.1, 0.2)}):
        shown = {}
        for name in ("auto", "rgba32f"):
            with Renderer(ctx, "quads") as renderer:
                renderer.settings = RenderSettings(target=name, **changes)
                renderer.update(scene)
                renderer.draw(views)
                window = ctx.framebuffer([ctx.texture((96, 72), 4, dtype="f4")])
                renderer.present(window, 1)
                pixels = np.frombuffer(window.read(components=3, dtype="f4"), np.float32)
                shown[name] = [
                    *(renderer.image(i) for i in range(2)),
                    *(renderer.resolved(i) for i in range(2)),
                    pixels.reshape(72, 96, 3)[::-1],
                ]
                units = [renderer.drawing.unit_of(i) for i in range(2)]
                assert (min(units) > 2) == (name == "auto")
                for part in (window.color_attachments[0], window):
                    part.release()
        for one, other in zip(shown["auto"], shown["rgba32f"], strict=True):
            assert psnr_db(one, other) > 70
        assert psnr_db(shown["auto"][3], shown["auto"][4]) > 55  # numpy's and GL's way


def test_views_of_one_renderer_may_count_in_other_units(ctx):
    """An image that was drawn before keeps the unit that it was drawn in."""
    with Renderer(ctx, "quads") as renderer:
        draw(renderer, alone(bright(6.0)), stereo_views((64, 48)))
        kept = renderer.image(1).copy()
        draw(renderer, alone(random_model(60)), [VIEW])
        np.testing.assert_array_equal(renderer.image(1), kept)


def test_debug_pictures_hold_floats(ctx):
    with Renderer(ctx, "quads") as renderer:
        draw(renderer, alone(bright(6.0)), [VIEW], debug="depth")
        assert renderer.backends["drawing"] == "quads (rgba32f)"


def test_a_driver_that_refuses_gets_half_floats_and_is_named(ctx, monkeypatch, caplog):
    real = Gpu.target

    def refusing(self, size, dtype, *images):
        if dtype == "nu2":
            raise moderngl.Error("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)")
        return real(self, size, dtype, *images)

    monkeypatch.setattr(Gpu, "target", refusing)
    target_module.warn_once.cache_clear()
    with caplog.at_level(logging.WARNING, "renderer"), Renderer(ctx, "quads") as renderer:
        for wish in ("auto", "rgba16", "auto"):
            (image,) = draw(renderer, alone(random_layers(300)), [VIEW], target=wish)
            assert renderer.backends["drawing"] == "quads (rgba16f)" and image.any()
    told = [r.message for r in caplog.records]
    assert len(told) == 1 and "GL_RGBA16" in told[0] and ctx.info["GL_RENDERER"] in told[0]
    target_module.warn_once.cache_clear()


def test_what_is_asked_for_is_taken(gpu):
    for wish in ("rgba8", "rgba16f", "rgba32f"):
        assert choose_target(gpu, wish, 5.0) == (wish, 1.0)
    assert choose_target(gpu, "rgba16", 5.0) == ("rgba16", 5.0)
    assert choose_target(gpu, "rgba16", np.inf) == ("rgba16", 1.0)  # what does not fit is cut off
    assert choose_target(gpu, "auto", np.inf) == ("rgba16f", 1.0)
    assert choose_target(gpu, "auto", MOST_UNIT) == ("rgba16", MOST_UNIT)
    assert choose_target(gpu, "auto", np.nextafter(MOST_UNIT, 99)) == ("rgba16f", 1.0)
    assert choose_target(gpu, "auto", 0.0) == ("rgba16", 1.0)
