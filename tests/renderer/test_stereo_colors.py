"""Colours of two eyes: each eye of a frame is the eye drawn alone, or as near as is said."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.colors.color_cache import SHARED_DB, EyeColors
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.colors.color_bounds import color_slope
from shapeshift.runtime_models.evaluate import Evaluator
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.cameras.framing import frame_points, scene_points
from shapeshift.scene.pose import View, look_at, perspective, stereo_pair
from shapeshift.scene.scene import Scene
from tests.support.models import without_direction
from tests.support.renderer.eye_scenes import APART, SCENES, TURNED, eyes
from tests.support.renderer.frames import draw_counted
from tests.support.renderer.renderers import TILES, quads
from tests.support.splat_scenes import alone, psnr_db, random_layers, random_model

RENDERERS = {
    "tiles": TILES,
    "gl": quads(mlps="gl", pair=False),
    "onnxruntime": quads(mlps="onnxruntime", pair=False),
    "pair": quads(mlps="onnxruntime", pair=True),
}


def by_itself(renderer: Renderer, scene: Scene, view: View) -> np.ndarray:
    """The eye alone, from a renderer that has forgotten what it drew before."""
    draw_counted(renderer, Scene(()), [view])
    return draw_counted(renderer, scene, [view])[0][0]


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("wish", ["auto", "each"])
def test_each_eye_is_the_eye_drawn_alone(renderer, name, wish):
    """To the last bit: nothing is shared but the order, and that is the same for parallel eyes."""
    scene, pair = SCENES[name](), eyes()
    images, stats = draw_counted(renderer, scene, pair, stereo_colors=wish)
    assert stats.color_sets == (1 if name == "nothing" and wish == "auto" else 2)
    for view, image in zip(pair, images, strict=True):
        same_picture(renderer, image, by_itself(renderer, scene, view))


def same_picture(renderer: Renderer, image: np.ndarray, wanted: np.ndarray) -> None:
    if (
        getattr(renderer.drawing, "stereo_pair", None) is not None
    ):  # rounded otherwise: test_one_draw
        assert psnr_db(image, wanted) > 80
    else:
        np.testing.assert_array_equal(image, wanted)


def test_lenses_off_centre_and_of_other_sizes_and_more_than_two_views(renderer):
    left, right = eyes()
    lens = (-0.6, 0.3, -0.5, 0.4)
    leaning = [replace(left, tangents=lens), replace(right, tangents=(-0.3, 0.6, -0.5, 0.4))]
    smaller = replace(right, size=(64, 48))
    third = View(look_at((1.5, 0.2, -1), (0, 0, 0)), lens, 0.05, 50, (50, 40))
    scene = SCENES["both"]()
    for group in (leaning, [left, smaller], [left, right, third], [third, left, right, smaller]):
        images, stats = draw_counted(renderer, scene, group)
        places = {tuple(view.world_from_eye.position) for view in group}
        assert stats.color_sets == len(places), "views from one place share their colours"
        for view, image in zip(group, images, strict=True):
            # The first of two pairs may be sorted with the others: equal depths, other rounding.
            assert psnr_db(image, by_itself(renderer, scene, view)) > 80


@pytest.mark.parametrize("name", ["harmonics", "networks", "tinted"])
def test_shared_colours_are_those_of_the_middle(renderer, name):
    """And they differ from an eye's own by what the setting costs: else nothing here is tested."""
    scene, pair = SCENES[name](), eyes()
    images, stats = draw_counted(renderer, scene, pair, stereo_colors="shared")
    assert stats.color_sets == 1
    middle = replace(pair[0], world_from_eye=eyes(0.0)[0].world_from_eye)
    assert psnr_db(images[0], by_itself(renderer, scene, pair[0])) < 75
    near, _ = draw_counted(renderer, scene, eyes(1e-7), stereo_colors="shared")
    assert psnr_db(near[0], by_itself(renderer, scene, middle)) > 80


def test_settings_may_change_from_frame_to_frame(renderer):
    """What one way of colouring leaves behind is not taken for the other's."""
    scene, pair = SCENES["both"](), eyes()
    wanted = {}
    for wish in ("each", "shared"):
        draw_counted(renderer, Scene(()), pair)
        wanted[wish] = draw_counted(renderer, scene, pair, stereo_colors=wish)[0]
    single = by_itself(renderer, scene, pair[1])
    for wish in ("each", "shared", "each", "each", "shared"):
        got, _ = draw_counted(renderer, scene, pair, stereo_colors=wish)
        for one, other in zip(got, wanted[wish], strict=True):
            np.testing.assert_array_equal(one, other)
        alone_now = draw_counted(renderer, scene, pair[1:], stereo_colors=wish)[0][0]
        np.testing.assert_array_equal(alone_now, single)


def test_at_rest_nothing_is_computed_again(renderer):
    scene, pair = SCENES["both"](), eyes()
    draw_counted(renderer, Scene(()), pair)
    assert draw_counted(renderer, scene, pair)[1].color_runs == 4  # two objects that are seen
    assert draw_counted(renderer, scene, pair)[1].color_runs == 0
    moved = [*pair[:1], eyes(0.07)[1]]
    assert draw_counted(renderer, scene, moved)[1].color_runs == 2, "the right eye's alone"


@pytest.mark.parametrize("changes", [{"recolor_degrees": 3.0}, {"skip_unseen": True}])
def test_shortcuts_of_colour_work_for_each_eye(renderer, changes):
    scene, pair = SCENES["both"](), eyes()
    draw_counted(renderer, Scene(()), pair)
    first, _ = draw_counted(renderer, scene, pair, **changes)
    nearly = eyes(away=1.81)
    images, stats = draw_counted(renderer, scene, nearly, **changes)
    kept = "recolor_degrees" in changes
    assert (stats.color_runs == 0) == kept
    for view, image, before in zip(nearly, images, first, strict=True):
        assert psnr_db(image, by_itself(renderer, scene, view)) > (40 if kept else 80)
        assert not np.array_equal(image, before)


def test_debug_pictures_of_two_eyes_have_their_numbers_in_both(renderer):
    scene, pair = SCENES["both"](), eyes()
    plain, _ = draw_counted(renderer, scene, pair)
    for name in ("depth", "object", "culls", "overdraw"):
        draw_counted(renderer, scene, pair, debug=name)
        pictures = [renderer.resolved(i) for i in range(2)]
        assert psnr_db(*pictures) > 12, "the same numbers in the same colours"
    after, _ = draw_counted(renderer, scene, pair)
    for one, other in zip(plain, after, strict=True):
        np.testing.assert_array_equal(one, other)


# What auto does


def test_the_slope_of_harmonics_is_that_of_differences():
    """The closed form against the colours themselves, turned by a little, in the mean of all."""
    rng = np.random.default_rng(2)
    for coefficients in (1, 4, 9, 16):
        layers = random_layers(500, seed=coefficients, coefficients=coefficients)
        layers = replace(layers, sh=layers.sh * np.float32(0.1))  # far from the clamp at 0
        evaluator, step, total, weight = Evaluator(layers), 0.01, 0.0, layers.opacity.sum()
        for _ in range(60):
            direction, aside = (unit(rng.normal(size=(500, 3))) for _ in range(2))
            aside = unit(np.cross(direction, aside))
            ends = [direction * np.cos(step) + s * aside * np.sin(step) for s in (-1, 1)]
            colors = [evaluator.color_along(0.0, e.astype(np.float32)) for e in ends]
            square = ((colors[1] - colors[0]).astype(np.float64) / (2 * step)) ** 2
            total += (square.mean(axis=1) * layers.opacity).sum() / weight / 60
        assert color_slope(layers) == pytest.approx(np.sqrt(total), rel=0.03)
    assert color_slope(random_layers(10, coefficients=1)) == 0


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_the_slope_of_networks():
    model = random_model(50)
    assert color_slope(model) > 0.01
    assert color_slope(without_direction(model)) == 0
    assert color_slope(replace(model, stops=model.stops[:1])) <= color_slope(model)
    broken = replace(model, features=np.full_like(model.features, 3e38))
    with np.errstate(all="ignore"):
        assert color_slope(broken) >= 0  # infinite or a number: never NaN


def test_nothing_that_is_absent_counts():
    layers = random_layers(50, coefficients=4)
    assert color_slope(replace(layers, opacity=np.zeros(50, np.float32))) == 0
    assert EyeColors.of(replace(layers, opacity=np.zeros(50, np.float32))).shared_db(
        np.array([[-1.0, 0, 0], [1, 0, 0]])
    ) == np.inf  # fmt: skip


def test_the_reckoning_is_the_formula():
    """A hundred splats 2 m off, eyes 64 mm apart: 20 log10(d / (slope apart / 2))."""
    look = EyeColors(np.tile([0.0, 0, -2], (100, 1)), 0.1)
    pair = np.array([[-APART / 2, 0, 0], [APART / 2, 0, 0]])
    assert look.shared_db(pair) == pytest.approx(20 * np.log10(2 / (0.1 * APART / 2)))
    assert look.shared_db(pair * 10) == pytest.approx(look.shared_db(pair) - 20)
    assert look.shared_db(pair * 0) == np.inf
    assert EyeColors(look.places, np.inf).shared_db(pair) < -100
    assert EyeColors(look.places, 0.0).shared_db(pair) == np.inf
    assert EyeColors(np.zeros((1, 3)), 0.1).shared_db(pair) < 0, "an eye in a splat"


@pytest.mark.parametrize("name", ["harmonics", "networks"])
def test_auto_shares_just_where_it_says(renderer, name):
    """On either side of the bound; where colours are shared the picture is better than that."""
    scene = SCENES[name]()
    look = EyeColors.of(scene.objects[0].model)
    nearest = eyes(away=3.0)[0].world_from_eye.position - TURNED.position
    # So far apart that the reckoning says SHARED_DB: it goes by 1 / apart.
    object_eyes = np.array([[-0.5, 0, 0], [0.5, 0, 0]]) + TURNED.matrix()[:3, :3].T @ nearest
    apart = 10 ** ((look.shared_db(object_eyes) - SHARED_DB) / 20)
    for part, sets in ((0.98, 1), (1.02, 2)):
        pair = eyes(apart * part, away=3.0)
        images, stats = draw_counted(renderer, scene, pair)
        assert stats.color_sets == sets
        if sets == 1:
            for view, image in zip(pair, images, strict=True):
                assert psnr_db(image, by_itself(renderer, scene, view)) > SHARED_DB


def test_colours_that_look_at_no_eye_are_shared(renderer):
    for model in (random_layers(200, coefficients=1), without_direction(random_model(20))):
        _, stats = draw_counted(renderer, alone(model), eyes(0.3))
        assert (stats.color_sets, stats.color_runs) == (1, 1)


def test_a_trained_leg_in_both_eyes(renderer, data):
    """SH 3 at 1.8 m and 64 mm in the scene's scale: what shared colours left at 57 dB."""
    scene = alone(read_model(data / "anatomy_leg_ml3dgs"), x=1.0)
    centre, radius = frame_points(*scene_points(scene))
    eye = centre + radius * np.array([0.3, 0.25, 1.0])
    away = np.linalg.norm(eye - centre)
    view = View(look_at(eye, centre), perspective(0.8, (160, 120)), 0.01, 100, (160, 120))
    pair = stereo_pair(view, APART / 1.8 * away)
    shared, _ = draw_counted(renderer, scene, pair, stereo_colors="shared")
    images, stats = draw_counted(renderer, scene, pair)
    assert stats.color_sets == 2
    for view, image, before in zip(pair, images, shared, strict=True):
        wanted = by_itself(renderer, scene, view)
        same_picture(renderer, image, wanted)
        assert psnr_db(before, wanted) < 66


def test_a_wish_that_is_none_is_refused():
    with pytest.raises(ValueError, match="choose one of 'auto', 'each', 'shared'"):
        RenderSettings(stereo_colors="never")
