"""Heat in GL: the passes against their slow twins, pictures against the oracle, both eyes."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.colors.false_colors import Heat, Shade, mixed_colors, split_colors
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.gl import shader
from shapeshift.renderer.gl.buffers import Arena
from shapeshift.renderer.gl.decode import Heater
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.scene.pose import stereo_pair
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.frames import step_error
from tests.support.renderer.gl_models import read
from tests.support.renderer.heat_scenes import BEHIND, CASES, STOPS, VIEW, decoded, model, scene_of
from tests.support.splat_scenes import psnr_db, random_layers


@pytest.mark.parametrize("at_once", [False, True])
@pytest.mark.parametrize(("anchors", "k"), [(1, 1), (255, 1), (256, 1), (257, 1), (64, 10)])
def test_the_passes_are_their_slow_twins(gpu, anchors, k, at_once):
    count = anchors * k
    colors = {i: decoded(count, i) for i in range(3)}
    weights = np.random.default_rng(9).dirichlet([1, 1, 1], anchors).astype(np.float32)
    weights[-1] = [1, 0, 0]
    heats = (Heat(1, "ironbow", weights[:, 0]), Heat(2, "turbo", weights[:, 1]))
    shade = Shade(0, heats)
    heater = Heater(gpu)
    with Arena(gpu, [3, count, 2]) as arena:
        for number, part in enumerate(heats):
            arena.write_color(1, colors[part.control])
            palette = palette_colors(part.palette) if at_once else None
            heater.add(arena, 1, part.weights, palette, number == 0)
        arena.write_color(1, colors[0])
        heater.blend(arena, 1, at_once)
        got, hot = read(arena.color, np.float32, 4), read(arena.heat, np.float32, 4)
        if arena.heated(1):
            heater.clear(arena, 1)
        assert not read(arena.heat, np.float32, 4).any()
        assert not arena.heated(1), "what is clear is not cleared again"
    heater.release()
    rows = slice(3, 3 + count)
    for array in (got, hot):
        assert not array[[0, 1, 2, -2, -1]].any()
    if at_once:
        wanted = mixed_colors(shade, count, colors.__getitem__)
        np.testing.assert_allclose(got[rows, :3], wanted, atol=3e-6)
    else:
        rest, value_weight = split_colors(shade, count, colors.__getitem__)
        np.testing.assert_allclose(got[rows, :3], rest, atol=2e-6)
        finite = np.isfinite(value_weight[:, 0])
        np.testing.assert_allclose(hot[rows][finite][:, [0, 3]], value_weight[finite], atol=2e-6)


def assert_as_the_reference(renderer: Renderer, scene: Scene) -> None:
    """60 dB: what float32 and another order of sums may cost."""
    with renderer:
        renderer.update(scene)
        renderer.draw([VIEW])
        assert psnr_db(renderer.image(), reference_image(scene, VIEW)) > 60


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
@pytest.mark.parametrize("case", CASES)
def test_quads_draw_the_oracles_picture(ctx, mlps, case):
    scene = scene_of(model(), **CASES[case])
    assert_as_the_reference(Renderer(ctx, "quads", mlps, target="rgba32f"), scene)


@pytest.mark.parametrize("drawing", ["quads", "tiles"])
@pytest.mark.parametrize("colors", ["each", "shared"])
def test_each_eye_has_its_heat(ctx, drawing, colors):
    scene = scene_of(model(), x=0.3)
    eyes = stereo_pair(VIEW, 0.3)
    with Renderer(ctx, drawing, target=None if drawing == "tiles" else "rgba32f") as renderer:
        renderer.settings = replace(renderer.settings, stereo_colors=colors)
        renderer.update(scene)
        renderer.draw(eyes)
        middle = np.mean([eye.world_from_eye.position for eye in eyes], axis=0)
        for i, eye in enumerate(eyes):
            wanted = reference_image(scene, eye, eye=middle if colors == "shared" else None)
            assert psnr_db(renderer.image(i), wanted) > 60
        before = renderer.image(1)
        renderer.update(scene_of(model(), x=0.0))
        renderer.draw(eyes)  # no heat any more
        renderer.update(scene)
        renderer.draw(eyes)
        assert psnr_db(renderer.image(1), before) > 120


@pytest.mark.parametrize("drawing", ["quads", "tiles"])
@pytest.mark.parametrize("mode", ["exclusive", "cumulative"])
def test_layers_between_a_photo_and_a_thermal_stop(ctx, drawing, mode):
    layers = replace(random_layers(200, layers=4), stops=STOPS, mode=mode)
    for x in (0.2, 0.5, 0.6, 0.9):
        scene = Scene((SceneObject("layers", layers, x=x), SceneObject("networks", model(), x=0.1)))
        exact = None if drawing == "tiles" else "rgba32f"
        assert_as_the_reference(Renderer(ctx, drawing, target=exact), scene)


@pytest.mark.parametrize("drawing", ["quads", "tiles"])
@pytest.mark.parametrize("dtype", ["f1", "f4"])
def test_a_window_shows_what_is_resolved(ctx, drawing, dtype):
    with Renderer(ctx, drawing) as renderer:
        renderer.settings = replace(renderer.settings, background=BEHIND)
        for x in (0.3, 0.5, 0.0, 0.9):
            renderer.update(scene_of(model(), x=x))
            target = ctx.framebuffer([ctx.texture(VIEW.size, 4, dtype=dtype)])
            renderer.draw([VIEW], target)
            read = np.uint8 if dtype == "f1" else np.float32
            pixels = np.frombuffer(target.read(components=4, dtype=dtype), read)
            shown = pixels.reshape(*VIEW.size[::-1], 4)[::-1, :, :3] / (255 if dtype == "f1" else 1)
            away = np.abs(shown - np.clip(renderer.resolved(), 0, 1)).max()
            assert away < (step_error(ctx) / 255 if dtype == "f1" else 1e-4)


@pytest.mark.parametrize("mlps", ["gl", "onnxruntime"])
def test_the_first_frame_with_heat_compiles_nothing(ctx, monkeypatch, mlps):
    compiled = []
    for name in ("compile_program", "compile_compute"):
        make = getattr(shader, name)
        monkeypatch.setattr(
            shader, name, lambda *a, make=make, **more: compiled.append(a[1:]) or make(*a, **more)
        )
    opened = model(60)
    with Renderer(ctx, "quads", mlps) as renderer:
        renderer.update(scene_of(opened))
        renderer.draw([VIEW])
        before = len(compiled)
        assert before > 0
        renderer.update(scene_of(opened, x=0.2))
        renderer.draw([VIEW])
        assert renderer.drawing.draws_heat, "no heat was drawn: the test sees nothing"
        assert not compiled[before:]
