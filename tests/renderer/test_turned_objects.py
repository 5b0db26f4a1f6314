"""A turned object looks as it does to an eye turned the other way: harmonics, networks, parts."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import IDENTITY, Scene, SceneObject
from shapeshift.scene.selectors.selector import Box, HalfSpace, Lens, Sphere
from tests.support.renderer.frames import draw
from tests.support.renderer.renderers import TILES, quads
from tests.support.scene.object_scenes import ODD, put, turned_view
from tests.support.splat_scenes import (
    alone,
    front_view,
    psnr_db,
    random_layers,
    random_model,
    shell,
    stereo_views,
)

RENDERERS = {
    "tiles": TILES,
    "gl": quads(mlps="gl", sort="numpy"),
    "onnxruntime": quads(mlps="onnxruntime", sort="numpy"),
}

VIEW = front_view((120, 90))
HERE = Pose(np.array([0.2, -0.1, 0.3]), ODD)
SAME = 85  # dB at least: one picture by two ways through float32 (quads round their records)
APART = 45  # dB at most, where a step was left out


def cloud(degree: int):
    return shell(1500, (degree + 1) ** 2) if degree == 0 else colourful(degree)


def colourful(degree: int):
    """A shell whose colours are mostly of the highest degree, so that a wrong turn is seen."""
    made = shell(1500, (degree + 1) ** 2)
    sh = np.array(made.sh)
    rng = np.random.default_rng(degree)
    sh[:, degree**2 :] = rng.normal(size=sh[:, degree**2 :].shape) * 0.6 / (degree + 1)
    sh[:, degree**2 :] += rng.normal(size=(1, *sh[0, degree**2 :].shape)) * 0.3
    return replace(made, sh=sh)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_turned_object_is_the_object_from_a_turned_eye(renderer, degree):
    model = cloud(degree)
    (turned,) = draw(renderer, alone(model, world_from_object=HERE), [VIEW])
    (seen,) = draw(renderer, alone(model), [turned_view(VIEW, HERE)])
    assert psnr_db(turned, seen) > SAME
    (still,) = draw(renderer, alone(model), [VIEW])
    assert psnr_db(still, turned) < APART


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_harmonics_turned_in_the_file_are_those_of_the_turned_object(renderer, degree):
    model = cloud(degree)
    (turned,) = draw(renderer, alone(model, world_from_object=HERE), [VIEW])
    baked = put(model, HERE)
    assert psnr_db(draw(renderer, alone(baked), [VIEW])[0], turned) > SAME
    if degree:
        unturned = replace(baked, sh=model.sh)
        assert psnr_db(draw(renderer, alone(unturned), [VIEW])[0], turned) < APART


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_in_the_reference_too(degree):
    model, view = cloud(degree), VIEW.resized((60, 45))
    turned = reference_image(alone(model, world_from_object=HERE), view)
    seen = reference_image(alone(model), turned_view(view, HERE))
    assert psnr_db(turned, seen) > 130  # harmonics are looked up in float32
    assert psnr_db(turned, reference_image(alone(put(model, HERE)), view)) > 100


def test_an_object_that_turns_is_coloured_anew_in_every_frame(renderer):
    """Nothing but the pose changes: neither x nor the eye."""
    model = colourful(3)
    for step in range(5):
        half = step * pi / 11
        pose = Pose(np.array([0.1, 0.0, -0.2]), np.array([cos(half), 0, sin(half), 0]))
        (turned,) = draw(renderer, alone(model, world_from_object=pose), [VIEW])
        assert psnr_db(turned, reference_image(alone(model, world_from_object=pose), VIEW)) > 70


def test_one_object_turns_beside_one_that_does_not(renderer):
    model = colourful(2)
    for half in (0.0, 0.4, 0.8):
        pose = Pose(np.array([1.5, 0.0, 0.0]), np.array([cos(half), sin(half), 0, 0]))
        scene = Scene((SceneObject("still", model), SceneObject("turns", model, pose)))
        renderer.settings = RenderSettings()
        renderer.update(scene)
        stats = renderer.draw([VIEW])
        assert stats.color_runs == (2 if half == 0 else 1)
        assert psnr_db(renderer.image(), reference_image(scene, VIEW)) > 70


def test_both_eyes_of_a_turned_object(renderer):
    model, eyes = colourful(3), stereo_views((90, 90))
    turned = draw(renderer, alone(model, world_from_object=HERE), eyes)
    seen = draw(renderer, alone(model), [turned_view(eye, HERE) for eye in eyes])
    for one, other in zip(turned, seen, strict=True):
        assert psnr_db(one, other) > SAME


def test_networks_that_look_along_a_direction_turn_with_the_object(renderer):
    model = random_model(150)
    (turned,) = draw(renderer, alone(model, world_from_object=HERE, x=0.3), [VIEW])
    (seen,) = draw(renderer, alone(model, x=0.3), [turned_view(VIEW, HERE)])
    assert psnr_db(turned, seen) > SAME
    assert psnr_db(draw(renderer, alone(model, x=0.3), [VIEW])[0], turned) < APART


def test_what_swings_about_the_eye_into_the_view_has_its_colours(renderer):
    """As the object sees it the eye rests, yet anchors that were out of view want colours now."""
    model, eye = random_model(150), VIEW.world_from_eye.position
    renderer.settings = RenderSettings(skip_unseen=True)
    runs = []
    for degrees in (60, 25, 12, 0):
        half = np.radians(degrees) / 2
        turn = Pose(np.zeros(3), np.array([cos(half), 0, sin(half), 0])).matrix()
        turn[:3, 3] = eye - turn[:3, :3] @ eye
        scene = alone(model, world_from_object=Pose.from_matrix(turn), x=0.3)
        renderer.update(scene)
        runs.append(renderer.draw([VIEW]).color_runs)
        picture = reference_image(scene, VIEW)
        assert psnr_db(renderer.image(), picture) > 60
    assert runs[0] <= 1 and sum(runs) >= 2 and picture[..., 3].max() > 0.5


SHAPES = [
    Sphere(centre=(0.3, 0.2, -0.4), radius=0.6, x=1, border=0.3),
    Box(centre=(-0.2, 0.1, 0.2), half=(0.7, 0.3, 0.5), wxyz=(0.8, 0, 0.6, 0), x=1, border=0.1),
    HalfSpace(point=(0.1, 0, 0.2), normal=(1, 2, -1), x=1, border=0.2),
    Lens(position=(0, 0.2, 2), wxyz=(1, 0, 0, 0), half_angle=0.2, x=1, border=0.1, space="object"),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_selectors_in_the_objects_space_turn_with_it(renderer, shape):
    model = random_layers(1500, coefficients=9, layers=2)
    obj = SceneObject("thing", model, HERE, selectors=(shape,))
    (turned,) = draw(renderer, Scene((obj,)), [VIEW])
    still = replace(obj, world_from_object=IDENTITY)
    (seen,) = draw(renderer, Scene((still,)), [turned_view(VIEW, HERE)])
    assert psnr_db(turned, seen) > SAME
    (bare,) = draw(renderer, Scene((replace(obj, selectors=()),)), [VIEW])
    assert psnr_db(bare, turned) < APART, "the selector shows something"


@pytest.mark.parametrize("shape", SHAPES[:3], ids=lambda shape: type(shape).__name__)
def test_selectors_in_the_world_stay_while_an_object_turns_through_them(renderer, shape):
    model, shape = random_layers(1500, coefficients=4, layers=2), replace(shape, space="world")
    obj = SceneObject("thing", model, HERE, selectors=(shape,))
    (turned,) = draw(renderer, Scene((obj,)), [VIEW])
    baked = replace(obj, model=put(model, HERE), world_from_object=IDENTITY)
    assert psnr_db(draw(renderer, Scene((baked,)), [VIEW])[0], turned) > SAME
    fixed = replace(obj, selectors=(replace(shape, space="object"),))
    assert psnr_db(draw(renderer, Scene((fixed,)), [VIEW])[0], turned) < APART
