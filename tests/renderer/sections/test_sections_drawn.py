"""Cut scenes on tiles and quads: against scenes whose splats are deleted, moments of samples, one
splat's weight in closed form, and each other.
"""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer import renderer as renderer_module
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.appearance import Appearance
from shapeshift.scene.pose import Pose
from shapeshift.scene.scene import Scene, SceneObject
from shapeshift.scene.sections.section import BoxShape, PlaneShape, SceneSection
from tests.support.renderer.renderers import EITHER_ON_GL
from tests.support.splat_scenes import front_view, one_splat, psnr_db, random_layers, random_model

RENDERERS = EITHER_ON_GL
VIEW = front_view((96, 72))
CLOUD = random_layers(400, layers=2)
NETWORKS = random_model(120)
ACROSS = PlaneShape((0.6, 0.8, 0.0), 0.1)
TURN = Pose(np.array([0.2, -0.1, 0.3]), np.array([0.5, 0.5, -0.5, 0.5]))
AROUND = SceneSection(shape=BoxShape((0.0, 0.0, 0.0), (50.0, 50.0, 50.0)))


def drawn(renderer: Renderer, *things: SceneObject, **settings) -> np.ndarray:
    renderer.settings = RenderSettings(**settings)
    renderer.update(Scene(things))
    drawn.stats = renderer.draw([VIEW])
    return renderer.image().copy()


def cut(shape, edge: str = "hard", **more) -> SceneSection:
    return SceneSection(shape=shape, edge=edge, width_m=0.2 if edge == "soft" else 0.0, **more)


@pytest.mark.parametrize("model", [CLOUD, NETWORKS], ids=["layers", "networks"])
@pytest.mark.parametrize("edge", ["capped", "hard", "soft"])
def test_what_contains_everything_changes_no_bit_and_what_cuts_all_leaves_nothing(
    renderer, model, edge
):
    obj = SceneObject("thing", model, TURN, x=0.3)
    plain = drawn(renderer, obj)
    counts = drawn.stats.culled
    for shape in (AROUND.shape, PlaneShape((0.0, 1.0, 0.0), 50.0)):
        around = drawn(renderer, replace(obj, sections=(cut(shape, edge),)))
        np.testing.assert_array_equal(around, plain)
        assert drawn.stats.culled == counts
    nothing = drawn(renderer, replace(obj, sections=(cut(PlaneShape((0, 1, 0), -50), edge),)))
    assert not nothing.any() and drawn.stats.drawn == 0
    off = cut(PlaneShape((0, 1, 0), -50), edge, enabled=False)
    np.testing.assert_array_equal(drawn(renderer, replace(obj, sections=(off,))), plain)


@pytest.mark.parametrize("space", ["world", "object"])
def test_a_hard_cut_is_the_scene_without_those_splats_to_the_bit(renderer, space):
    matrix = TURN.matrix()
    places = CLOUD.means @ matrix[:3, :3].T + matrix[:3, 3] if space == "world" else CLOUD.means
    box = BoxShape((0.1, 0.0, 0.1), (0.5, 0.9, 0.6), tuple(TURN.wxyz))
    inside = (np.abs((places - box.centre) @ box.axes) <= box.half).all(axis=1)
    below = places @ np.array(ACROSS.normal) <= ACROSS.offset_m
    obj = SceneObject("thing", CLOUD, TURN, x=0.4)
    for sections, kept in (
        ((cut(box, space=space),), inside),
        ((cut(ACROSS, space=space),), below),
        ((cut(box, space=space), cut(ACROSS, space=space)), inside & below),
    ):
        assert 20 < kept.sum() < 380
        few = replace(obj, model=CLOUD.with_rows(kept))
        wanted = drawn(renderer, few)
        got = drawn(renderer, replace(obj, sections=sections))
        np.testing.assert_array_equal(got, wanted)


def test_of_networks_the_splats_are_cut_where_they_are_at_this_x(renderer):
    obj = SceneObject("thing", NETWORKS, x=0.2, sections=(cut(ACROSS),))
    drawn(renderer, replace(obj, sections=()))
    for x in (0.2, 0.7):
        got = drawn(renderer, replace(obj, x=x))
        drawn(renderer, replace(obj, x=x, sections=()))
        own = renderer.drawing.splat_points()[0].copy()
        drawn(renderer, replace(obj, x=x))
        now = renderer.drawing.splat_points()[0]
        outside = own[:, :3] @ np.array(ACROSS.normal, np.float32) > np.float32(ACROSS.offset_m)
        assert 100 < outside.sum() < len(own) - 100
        assert (now[outside, 3] <= 0).all()
        np.testing.assert_array_equal(now[~outside], own[~outside])
        assert got.any()


@pytest.mark.parametrize("inside_m", [-0.01, 0.0, 0.03, 0.1, 0.15, 0.2, 0.3])
def test_a_soft_edge_is_the_smooth_step_on_one_splat(renderer, inside_m):
    """Alpha is opacity times the Gaussian: the picture of one splat scales with the weight."""
    obj = SceneObject("one", one_splat(opacity=[0.6]))
    plain = drawn(renderer, obj, min_alpha=1e-6)
    part = min(max(inside_m / 0.2, 0), 1)
    weight = 3 * part**2 - 2 * part**3
    soft = SceneSection(shape=PlaneShape((0, 0, 1), inside_m), edge="soft", width_m=0.2)
    got = drawn(renderer, replace(obj, sections=(soft,)), min_alpha=1e-6)
    quads = renderer.gpu is not None and not is_software(renderer.gpu.ctx)
    # Hardware interpolates a splat's place less finely: 2.4e-5 on an H100.
    np.testing.assert_allclose(got, plain * weight, atol=3e-5 if quads else 3e-6)


def test_a_capped_splat_has_the_moments_of_its_samples_on_the_kept_side(renderer):
    turned = Pose(np.zeros(3), np.array([0.8, 0.3, -0.4, np.sqrt(0.11)])).wxyz
    layers = one_splat(scales=[[0.3, 0.1, 0.02]], wxyz=[turned], opacity=[0.9])
    (plain_mean,), covariance = layers.means, None
    for offset in (-0.15, 0.0, 0.1, 0.25):
        plane = PlaneShape((0.6, 0.8, 0.0), offset)
        obj = SceneObject("one", layers)
        drawn(renderer, obj)
        _, _, own = (a.copy() for a in renderer.drawing.splat_points())
        drawn(renderer, replace(obj, sections=(cut(plane, "capped"),)))
        mean_opacity, _, now = renderer.drawing.splat_points()
        covariance = full(own[0])
        rng = np.random.default_rng(1)
        samples = rng.multivariate_normal(plain_mean, covariance, 400_000)
        kept = samples[samples @ np.array(plane.normal) <= offset]
        # Of 400,000 samples at least a tenth is kept: a standard error below 0.3 / 200.
        assert mean_opacity[0, 3] == pytest.approx(0.9 * len(kept) / 400_000, abs=4e-3)
        np.testing.assert_allclose(mean_opacity[0, :3], kept.mean(axis=0), atol=4e-3)
        np.testing.assert_allclose(full(now[0]), np.cov(kept.T), atol=2e-3)


def full(row: np.ndarray) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = row[:6]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_how_far_a_splat_sticks_out_of_each_edge():
    """Of every place of the plane, in sigmas of the splat beyond it: where its opacity has fallen
    to a half of what it was, and to 1/255.
    """
    from shapeshift.scene.sections.cut import ObjectCut, cut_splats

    count = 4001
    mean_opacity = np.zeros((count, 4), np.float32)
    mean_opacity[:, 0] = -np.linspace(-4, 4, count)  # sigmas inside of the plane x <= 0
    mean_opacity[:, 3] = 1
    covariance = np.zeros((count, 8), np.float32)
    covariance[:, [0, 3, 5]] = 1
    reach = {}
    for edge in ("capped", "hard"):
        rows, shapes = cut_splats(mean_opacity, covariance, [ObjectCut(((1, 0, 0, 0),), edge, 0)])
        there = rows[:, 3] > 0
        mean, opacity, sigma = rows[there, 0], rows[there, 3], np.sqrt(shapes[there, 0])
        for name, least in (("half", 0.5), ("end", 1 / 255)):
            far = np.maximum(2 * np.log(np.maximum(opacity / least, 1e-9)), 0)
            out = np.where(opacity >= least, mean + np.sqrt(far) * sigma, -np.inf)
            reach[edge, name] = float(out.max())
    assert reach["hard", "half"] == pytest.approx(np.sqrt(2 * np.log(2)), abs=3e-3)
    assert reach["hard", "end"] == pytest.approx(np.sqrt(2 * np.log(255)), abs=3e-3)
    assert reach["capped", "half"] < 0  # docs/scene.md
    assert reach["capped", "end"] == pytest.approx(1.315, abs=2e-3)


@pytest.mark.parametrize("edge", ["capped", "soft", "hard"])
def test_undoing_every_order_of_changes_gives_the_uncut_picture_back(renderer, edge):
    """A capped edge moves splats of layers, whose places are decoded once."""
    look = Appearance(opacity=0.5)
    for model in (CLOUD, NETWORKS):
        obj = SceneObject("thing", model, x=0.1)
        plain, faint = drawn(renderer, obj), drawn(renderer, replace(obj, appearance=look))
        cutting = replace(obj, sections=(cut(ACROSS, edge),))
        first = drawn(renderer, cutting)
        assert not np.array_equal(first, plain)
        drawn(renderer, replace(cutting, x=0.8))
        np.testing.assert_array_equal(drawn(renderer, replace(obj, x=0.1)), plain)
        drawn(renderer, replace(cutting, appearance=look))
        np.testing.assert_array_equal(drawn(renderer, replace(obj, appearance=look)), faint)
        drawn(renderer, replace(cutting, x=0.8, appearance=look))
        np.testing.assert_array_equal(drawn(renderer, cutting), first)
        np.testing.assert_array_equal(drawn(renderer, obj), plain)
        assert (drawn.stats.geometry_runs) == 0


def test_both_drawings_show_the_same_cut(session_gpu):
    images = []
    for drawing in ("quads", "tiles"):
        with session_gpu.ctx as ctx, Renderer(ctx, drawing, target="rgba32f") as renderer:
            obj = SceneObject("thing", CLOUD, x=0.4, sections=(cut(ACROSS, "capped"),))
            images.append(drawn(renderer, obj))
    assert psnr_db(*images) > 60  # as of the uncut cloud against the reference


def test_beyond_a_plane_is_the_picture_of_the_other_stop(renderer):
    sections = (cut(ACROSS, beyond=1.0),)
    obj = SceneObject("thing", NETWORKS, sections=sections)
    got = drawn(renderer, obj)
    assert psnr_db(got, reference_image(Scene((obj,)), VIEW)) > 60
    for offset, x in ((50.0, 0.0), (-50.0, 1.0)):
        far = replace(obj, sections=(cut(PlaneShape((0, 1, 0), offset), beyond=1.0),))
        np.testing.assert_array_equal(
            drawn(renderer, far), drawn(renderer, SceneObject("thing", NETWORKS, x=x))
        )


def test_two_stops_come_from_one_sort_where_both_are_cut_alike(renderer):
    from shapeshift.renderer.colors.decode_colors import same_shape
    from tests.support.models import without_control

    model = without_control(NETWORKS, "offset", "scale", "rotation", "opacity")
    left = Scene((SceneObject("thing", model, sections=(cut(ACROSS),)),))
    right = Scene((replace(left.objects[0], x=1.0),))
    assert same_shape(left, right)
    renderer.update(left)
    renderer.draw_two((VIEW, VIEW), right)
    both = [renderer.image(i).copy() for i in range(2)]
    for scene, picture in zip((left, right), both, strict=True):
        # Quads draw two views at once with another arithmetic than one.
        np.testing.assert_allclose(drawn(renderer, *scene.objects), picture, atol=1e-5)
    assert not same_shape(left, Scene((replace(right.objects[0], sections=()),)))


def test_a_plane_that_moves_is_asked_once_a_frame_what_it_shows(renderer, monkeypatch):
    """Weights of all anchors are a fifteenth of such a frame."""
    asked = []
    of = renderer_module.control_of
    monkeypatch.setattr(renderer_module, "control_of", lambda obj: (asked.append(1), of(obj))[1])
    obj = SceneObject("thing", NETWORKS, TURN, x=0.3)
    for offset_m in (0.0, 0.05, 0.05, 0.1):
        asked.clear()
        plane = cut(PlaneShape((0.6, 0.8, 0.0), offset_m), "soft", beyond=0.8)
        drawn(renderer, replace(obj, sections=(plane,)))
        assert len(asked) <= 1
    asked.clear()
    drawn(renderer, replace(obj, sections=(plane,)), resort_frames=2)
    assert not asked, "nothing has moved"
