"""Whole frames decoded by our kernel against onnxruntime's, and what runs where is said."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.app.paths import DEMO
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models import session
from shapeshift.runtime_models.model import AnchorModel
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.sections.section import PlaneShape, SceneSection
from tests.support.models import make_random_model, with_frames, without_control
from tests.support.renderer.gl_models import make_layers, make_model
from tests.support.renderer.selected_scenes import VIEW, selected_scene
from tests.support.splat_scenes import alone, front_view, psnr_db, random_model, stereo_views

LEAST_DB = 100  # of a frame by one decoder against the other's: 1e-5 of full scale


@pytest.fixture(scope="module")
def both():
    """(ours, onnxruntime's)."""
    pytest.importorskip("pyopencl")
    with Renderer(None, "tiles") as ours, Renderer(None, "tiles", "onnxruntime") as twin:
        yield ours, twin


def assert_alike(both, scene: Scene, views: list[View]) -> None:
    for renderer in both:
        renderer.update(scene)
        renderer.draw(views)
    for i in range(len(views)):
        wanted = both[1].image(i)
        assert wanted.any() and np.isfinite(wanted).all()
        assert psnr_db(both[0].image(i), wanted) >= LEAST_DB


@pytest.mark.parametrize("x", [0.0, 0.3, 0.5, 0.75, 1.0])
def test_the_bundled_scene_at_stops_and_between_them(both, x):
    model = read_model(DEMO)
    assert isinstance(model, AnchorModel)
    centre = model.anchors.mean(axis=0)
    pose = look_at(centre + np.array([0.6, 0.5, 1.6]), centre)
    view = View(pose, (-0.5, 0.5, -0.3, 0.3), 0.05, 50, (256, 144))
    assert_alike(both, alone(model, x=x), [view])


def test_a_slider_that_moves_two_eyes_and_an_eye_that_walks(both):
    model = with_frames(make_random_model(300, k=3))
    for x in (0.1, 0.4, 0.4, 0.9):
        assert_alike(both, alone(model, x=x), stereo_views((96, 80)))
    for distance in (3.0, 2.0):
        assert_alike(both, alone(model, x=0.9), [front_view((96, 80), distance)])


def test_several_objects_that_share_a_model_beside_layers(both):
    model, one = make_random_model(130, k=2), without_control(make_random_model(70), "offset")
    aside = Pose(np.array([0.4, 0.1, 0]), np.array([0.8, 0, 0.6, 0]))
    objects = (
        SceneObject("a", model, x=0.2), SceneObject("b", make_layers(50), x=0.3),
        SceneObject("c", model, aside, x=0.8), SceneObject("d", one, aside, x=0.6),
    )  # fmt: skip
    assert_alike(both, Scene(objects), [VIEW])
    moved = (replace(objects[0], x=0.9), *objects[1:3], replace(objects[3], x=0.1))
    assert_alike(both, Scene(moved), [VIEW])


def test_a_control_an_anchor_is_onnxruntimes_and_one_for_all_is_ours_again(both):
    scene = selected_scene()
    assert_alike(both, scene, [VIEW])
    plain = tuple(replace(obj, selectors=()) for obj in scene.objects)
    assert_alike(both, Scene(plain), [VIEW])
    assert_alike(both, scene, [VIEW])


@pytest.mark.parametrize("unseen", [True, False])
def test_anchors_out_of_view(both, unseen):
    model = random_model(400)
    for renderer in both:
        renderer.settings = replace(renderer.settings, skip_unseen=unseen)
    for eye in ((0.0, 0.0, 0.5), (0.2, 0.0, 0.4), (0.0, 0.0, 4.0)):
        view = View(look_at(np.array(eye), np.array([0.9, 0.2, 0.0])), (-0.4, 0.4, -0.3, 0.3),
                    0.05, 50, (96, 72))  # fmt: skip
        assert_alike(both, alone(model, x=0.4), [view])
    for renderer in both:
        renderer.settings = RenderSettings()


@pytest.mark.parametrize("fixed", [(), ("offset", "scale", "rotation")])
def test_a_section_that_comes_and_goes_while_x_moves(both, fixed):
    model = without_control(random_model(200), *fixed)
    cut = SceneSection(shape=PlaneShape((1.0, 0.3, 0.0), 0.1))
    further = replace(cut, beyond=1.0)
    steps = [(0.2, ()), (0.2, (cut,)), (0.7, (cut,)), (0.7, (further,)), (0.7, ()), (0.3, ())]
    for x, sections in steps:
        assert_alike(both, alone(model, x=x, sections=sections), [VIEW])


def test_no_session_opens_where_the_kernel_runs(both, monkeypatch):
    opened = []
    monkeypatch.setattr(session, "open_session", lambda *made: opened.append(made))
    both[0].update(alone(random_model(20), x=0.3))
    both[0].draw([VIEW])
    assert both[0].image().any() and not opened


def test_who_runs_the_networks_is_said(both):
    known, deep = make_model(9), make_model(9, hidden=(8, 8))
    why = "onnxruntime for a model: its offset network has 3 layers instead of 2"
    for models, said in (
        ([known], "opencl"), ([known, deep], f"opencl, {why}"), ([deep, deep], f"opencl, {why}"),
        ([make_layers(5)], "opencl"),
    ):  # fmt: skip
        objects = tuple(SceneObject(str(i), model, x=0.3) for i, model in enumerate(models))
        both[0].update(Scene(objects))
        assert both[0].backends["mlps"] == said
    assert both[1].backends["mlps"] == "onnxruntime"


def test_what_the_kernel_does_not_know_is_drawn_to_the_bit(both):
    scene = alone(make_model(40, k=2, hidden=(8, 8)), x=0.3)
    for renderer in both:
        renderer.update(scene)
        renderer.draw([VIEW])
    np.testing.assert_array_equal(both[0].image(), both[1].image())


def test_quads_have_no_such_networks():
    with pytest.raises(ValueError, match="tiles"):
        Renderer(None, "tiles", "gl")
