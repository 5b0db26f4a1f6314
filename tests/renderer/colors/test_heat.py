"""Between a photo and a thermal stop: which colours are decoded, what is drawn, and what it is."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.bin import bin_tiles
from shapeshift.rasterizer.colors import add_heat, blend_heat
from shapeshift.rasterizer.project import project
from shapeshift.rasterizer.raster import rasterize_rgba, rasterize_with_heat
from shapeshift.renderer.colors.false_colors import (
    BESIDE,
    NO_HEAT,
    PICTURE,
    SPLATS,
    Heat,
    Shade,
    false_colors,
    mixed_colors,
    shade_of,
    split_colors,
)
from shapeshift.renderer.colors.palette import (
    LUMINANCE,
    apply_palette,
    palette_colors,
    palette_values,
)
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.tiles.slot import ModelHeads
from shapeshift.runtime_models.model import Stop
from shapeshift.runtime_models.stop_weights import StopWeights
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.selectors.selector import Painted
from shapeshift.training.drawing import camera_of
from tests.support.renderer.heat_scenes import BEHIND, CASES, STOPS, VIEW, decoded, model, scene_of
from tests.support.renderer.rasterizer_scenes import device
from tests.support.splat_scenes import front_view, psnr_db, random_layers


def shown(renderer: Renderer, scene: Scene, view=VIEW) -> np.ndarray:
    renderer.settings = replace(renderer.settings, background=BEHIND)
    renderer.update(scene)
    renderer.draw([view])
    return renderer.resolved().copy()


# Which colours, and where the palette belongs.


def test_a_pure_stop_needs_its_own_colours_alone():
    for x, way in ((0.0, NO_HEAT), (0.8, NO_HEAT), (0.5, PICTURE), (1.0, PICTURE)):
        found = false_colors(scene_of(model(), x=x), [x])
        assert (found.way, found.shades[0].rest, found.shades[0].heats) == (way, x, ())
    assert found.palette == "turbo"


@pytest.mark.parametrize("x", [0.1, 0.25, 0.49999, 0.6])
def test_between_a_photo_and_a_thermal_stop_both_stops_colours_are_decoded(x):
    found = false_colors(scene_of(model(), x=x), [x])
    shade = found.shades[0]
    assert (found.way, found.palette) == (BESIDE, "ironbow")
    assert shade.rest == StopWeights((("RGB" if x < 0.5 else "Open", 1.0),))
    (heat,) = shade.heats
    assert heat.control == 0.5 and heat.palette == "ironbow"
    assert heat.weights == pytest.approx(x / 0.5 if x < 0.5 else (0.8 - x) / 0.3)


def test_of_several_thermal_stops_each_has_its_own_palette():
    blend = StopWeights((("RGB", 0.125), ("Hot", 0.25), ("Open", 0.375), ("Hotter", 0.25)))
    found = false_colors(scene_of(model(), x=blend), [blend])
    shade = found.shades[0]
    assert found.way == SPLATS and shade.rest == StopWeights((("RGB", 0.25), ("Open", 0.75)))
    assert [(h.control, h.palette, float(h.weights[0])) for h in shade.heats] == [
        (0.5, "ironbow", 0.25), (1.0, "turbo", 0.25),
    ]  # fmt: skip
    heats = StopWeights((("Hot", 0.5), ("Hotter", 0.5)))
    assert shade_of(model(), heats).rest is None


def test_a_part_with_a_control_of_its_own_has_heat_of_its_own():
    part = Painted(np.array([1, 0.5, 0] * 20, np.float32), 0.5)
    obj = scene_of(model(), selectors=(part,))
    x = model().blend.between(0.0, 0.5, part.weight)
    found = false_colors(obj, [x])
    assert found.way == BESIDE
    np.testing.assert_allclose(found.shades[0].heats[0].weights, part.weight)
    np.testing.assert_allclose(found.shades[0].rest, np.tile([1, 0, 0, 0], (60, 1))[:, :4] * (
        part.weight < 1)[:, None] + [[0, 1, 0, 0]] * (part.weight == 1)[:, None])  # fmt: skip


def test_what_shows_decides_where_the_palette_belongs():
    hot, cold = SceneObject("a", model(), x=0.5), SceneObject("b", model(), x=0.0)
    assert false_colors(Scene((hot, hot)), [0.5, 0.5]).way == PICTURE
    assert false_colors(Scene((hot, cold)), [0.5, 0.0]).way == BESIDE
    assert false_colors(Scene((hot, replace(cold, visible=False))), [0.5, 0.0]).way == PICTURE
    hotter = replace(hot, x=1.0)
    assert false_colors(Scene((hot, hotter)), [0.5, 1.0]).way == SPLATS
    assert false_colors(Scene(()), []).way == NO_HEAT
    plain = replace(model(), stops=(Stop("RGB", 0.0), Stop("Hot", 1.0, "thermal")))
    assert false_colors(scene_of(plain, x=0.5), [0.5]).way == NO_HEAT  # its colours are final


def test_layers_are_heat_where_their_stop_is():
    layers = replace(random_layers(30, layers=4), stops=STOPS, mode="exclusive")
    shade = shade_of(layers, 0.25)
    np.testing.assert_array_equal(shade.heats[0].weights, layers.layer == 1)
    added = shade_of(replace(layers, mode="cumulative"), 0.25)
    assert added.heats[0].weights == pytest.approx(0.5)


# The passes.


@pytest.mark.parametrize("at_once", [False, True])
@pytest.mark.parametrize(("anchors", "k"), [(1, 1), (63, 1), (64, 1), (65, 3), (300, 10)])
def test_the_passes_are_their_slow_twins(anchors, k, at_once):
    d, count = device(), anchors * k
    rows = slice(3, 3 + count)
    colors = {i: decoded(count, i) for i in range(3)}
    rng = np.random.default_rng(9)
    weights = rng.dirichlet([1, 1, 1], anchors).astype(np.float32)
    weights[-1] = [1, 0, 0]
    heats = (Heat(1, "ironbow", weights[:, 0]), Heat(2, "turbo", weights[:, 1]))
    shade = Shade(0, heats if count > 1 else heats[:1])
    color, heat = d.zeros((count + 5, 4)), d.zeros((count + 5, 4))
    for number, part in enumerate(shade.heats):
        color[rows] = d.upload(np.pad(colors[part.control], ((0, 0), (0, 1))))
        palette = palette_colors(part.palette) if at_once else None
        add_heat(d, part.weights, rows, color, heat, palette, number == 0)
    color[rows] = d.upload(np.pad(colors[0], ((0, 0), (0, 1))))
    blend_heat(d, rows, color, heat, at_once)
    got, hot = d.download(color), d.download(heat)
    for array in (got, hot):
        assert not array[[0, 1, 2, -2, -1]].any()
    at = colors.__getitem__
    if at_once:
        np.testing.assert_allclose(got[rows, :3], mixed_colors(shade, count, at), atol=3e-6)
        assert not hot.any()
    else:
        rest, value_weight = split_colors(shade, count, at)
        np.testing.assert_allclose(got[rows, :3], rest, atol=2e-6)
        finite = np.isfinite(value_weight[:, 0])
        np.testing.assert_allclose(hot[rows][finite][:, [0, 3]], value_weight[finite], atol=2e-6)


@pytest.mark.parametrize("form", ["cpu", "gpu"])
@pytest.mark.parametrize("views", [1, 2, 3])
def test_heat_is_blended_as_colours_are(form, views):
    """Drawn as if it were a colour, by a pass that knows nothing of heat: bit for bit."""
    d, n = device(), 400
    plain = random_layers(n, seed=3)
    parts = (plain.means, plain.scales, plain.wxyz, plain.opacity)
    rng = np.random.default_rng(0)
    color, value_weight = rng.random((n, 3)), rng.random((n, 2)).astype(np.float32)
    as_color = np.concatenate([value_weight, np.zeros((n, 1))], axis=1)
    heat = np.zeros((n, 4), np.float32)
    heat[:, [0, 3]] = value_weight
    sides, drawn = [], []
    for i in range(views):
        camera = camera_of(front_view((75, 53), distance=2.0 + 0.3 * i))
        geometry = [d.upload(np.float32(a)) for a in parts]
        ellipses = project(d, *geometry, d.upload(np.float32(color)), camera)
        hot = project(d, *geometry, d.upload(np.float32(as_color)), camera)
        tiles = bin_tiles(d, ellipses, (75, 53))
        drawn.append((ellipses, tiles))
        sides.append((rasterize_rgba(d, ellipses, tiles, (75, 53), form).copy(),
                      rasterize_rgba(d, hot, tiles, (75, 53), form)[..., :2].copy()))  # fmt: skip
    images, heats = rasterize_with_heat(d, drawn, [d.upload(heat)] * views, (75, 53), form)
    for image, beside, (wanted, wanted_heat) in zip(images, heats, sides, strict=True):
        np.testing.assert_array_equal(image, wanted)
        np.testing.assert_array_equal(beside, wanted_heat)
        assert beside.max() > 0.2


# The pictures.


@pytest.mark.parametrize("case", CASES)
def test_the_picture_is_the_oracles(renderer, case):
    scene = scene_of(model(), **CASES[case])
    shown(renderer, scene)
    assert psnr_db(renderer.image(), reference_image(scene, VIEW)) > 90


@pytest.mark.parametrize("name", ["Hot", "Hotter"])
@pytest.mark.parametrize("start", ["RGB", "Open"])
def test_where_shapes_stay_it_is_the_cross_fade_of_both_stops_pictures(renderer, start, name):
    """No twin of the passes: the whole, mixed of two pictures of pure stops."""
    still = model(60, "offset", "scale", "rotation", "opacity")
    place = {stop.name: stop.x for stop in STOPS}
    ends = [shown(renderer, scene_of(still, x=place[stop])) for stop in (start, name)]
    for weight in (0.02, 0.3, 0.5, 0.9, 0.999):
        blend = StopWeights(((start, 1 - weight), (name, weight)))
        wanted = (1 - weight) * ends[0] + weight * ends[1]
        assert psnr_db(shown(renderer, scene_of(still, x=blend)), wanted) > 100


@pytest.mark.parametrize("at", [0.5, 1.0])
def test_the_picture_does_not_jump_at_a_thermal_stop(renderer, at):
    """There its palette is laid over the picture: 31 dB from palettes laid over splats."""
    pure = shown(renderer, scene_of(model(), x=at))
    for x in (at - 1e-5, min(at + 1e-5, 1.0)):
        assert psnr_db(shown(renderer, scene_of(model(), x=x)), pure) > 80


def test_a_white_tool_is_not_hot_because_it_is_white(renderer):
    """White at RGB, cold at the thermal stop: on the way no pixel turns to the palette's reds."""
    still = model(60, "offset", "scale", "rotation", "opacity")
    color = still.networks["color"]
    weights = [np.zeros_like(w) for w in color.weights]
    weights[0][:, -still.encoding.d :] = still.encoding.encode(0.0) - still.encoding.encode(0.5)
    weights[-1][:] = 1.0
    painted = replace(color, weights=tuple(weights), biases=tuple(0 * b for b in color.biases))
    tool = replace(still, networks=still.networks | {"color": painted})
    ends = [shown(renderer, scene_of(tool, x=x)) for x in (0.0, 0.5)]
    assert ends[0].max() > 0.9  # white at RGB
    low, high = np.minimum(*ends) - 1e-4, np.maximum(*ends) + 1e-4
    for x in np.linspace(0.05, 0.45, 9):
        picture = shown(renderer, scene_of(tool, x=float(x)))
        assert (picture >= low).all() and (picture <= high).all()


def test_a_pure_thermal_stop_is_the_palette_over_the_picture_of_values(renderer):
    """As it was before there was heat beside colours, to the bit."""
    hot, gray = scene_of(model(), x=0.5), [replace(s, palette="") for s in STOPS]
    picture = shown(renderer, hot)
    values = scene_of(replace(model(), stops=tuple(gray)), x=0.5)
    shown(renderer, values)
    rgba = apply_palette(renderer.image(), "ironbow")
    np.testing.assert_array_equal(
        picture, rgba[..., :3] + (1 - rgba[..., 3:]) * np.array(BEHIND, np.float32)
    )


def test_a_slider_that_moves_before_a_still_eye_decodes_colours_once(renderer, monkeypatch):
    made, decode, controls = model(), ModelHeads.color_into, []

    def counted(self, color, start, x, *more):
        controls.append(x)
        decode(self, color, start, x, *more)

    monkeypatch.setattr(ModelHeads, "color_into", counted)
    shown(renderer, scene_of(made, x=0.1))
    assert len(controls) == 2, "the photo's and those of the heat"
    for x in (0.2, 0.35, 0.49):
        shown(renderer, scene_of(made, x=x))
    assert len(controls) == 2
    picture = shown(renderer, scene_of(made, x=0.35))
    shown(renderer, Scene(()))
    np.testing.assert_array_equal(shown(renderer, scene_of(made, x=0.35)), picture)
    controls.clear()
    shown(renderer, scene_of(made, x=0.8))
    assert len(controls) == 1
    shown(renderer, scene_of(made, x=0.35))
    assert len(controls) == 3, "what one colour alone did not need was forgotten"


def test_colours_that_are_no_numbers_are_culled_and_no_pixel_is(renderer):
    broken = model()
    head = broken.networks["color"]
    nan = replace(head, weights=(*head.weights[:-1], np.full_like(head.weights[-1], np.nan)))
    for x in (0.2, 0.5, 0.9):
        made = replace(broken, networks=broken.networks | {"color": nan})
        assert np.isfinite(shown(renderer, scene_of(made, x=x))).all()
        assert not renderer.image().any()


def test_values_beyond_the_palette_are_held_at_its_ends():
    ends = palette_values(np.array([-5.0, 0, 1, 7]), "ironbow")
    np.testing.assert_array_equal(ends[[0, 3]], ends[[1, 2]])
    assert np.isnan(palette_values(np.array([np.nan]), "ironbow")).all()
    assert LUMINANCE.sum() == pytest.approx(1)
