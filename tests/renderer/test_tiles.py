"""Frames drawn by tiles, without any GL, against the reference; and what is decoded when."""

import json

import numpy as np
import pytest
from PIL import Image

from shapeshift.renderer.colors.color_cache import color_key
from shapeshift.renderer.colors.palette import palette_colors
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import CULL_REASONS, RenderSettings
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.models import without_control
from tests.support.splat_scenes import (
    alone,
    front_view,
    one_splat,
    only,
    poisoned,
    psnr_db,
    random_layers,
    random_model,
    stereo_views,
    two_objects,
)

AWAY = View(look_at((0, 0, 9), (0, 0, 20)), (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (32, 16))


@pytest.fixture
def renderer(renderer):
    """One renderer for all tests, empty and with default settings at the start of each."""
    renderer.settings = RenderSettings()
    renderer.update(Scene(()))
    renderer.draw([AWAY])
    return renderer


def drawn(renderer: Renderer, scene: Scene, view: View) -> np.ndarray:
    renderer.update(scene)
    renderer.draw([view])
    return renderer.image()


def test_a_random_scene_equals_the_reference_mono(renderer):
    scene, view = two_objects(20_000), front_view()
    image = drawn(renderer, scene, view)
    assert image.dtype == np.float32 and image.shape == (256, 256, 4)
    assert psnr_db(image, reference_image(scene, view)) > 80


def test_a_random_scene_equals_the_reference_in_off_centre_stereo(renderer):
    scene, views = two_objects(20_000), stereo_views()
    renderer.update(scene)
    stats = renderer.draw(views)
    for i, view in enumerate(views):
        assert psnr_db(renderer.image(i), reference_image(scene, view)) > 80
    assert (stats.color_runs, stats.color_sets) == (4, 2), "two objects, towards each eye"
    assert not np.array_equal(renderer.image(0), renderer.image(1))


@pytest.mark.parametrize("size", [(1, 1), (16, 16), (17, 15), (255, 3), (33, 200)])
def test_any_image_size(renderer, size):
    scene, view = two_objects(800), front_view(size)
    image = drawn(renderer, scene, view)
    assert image.shape == (size[1], size[0], 4)
    assert np.abs(image - reference_image(scene, view)).max() < 2e-3


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 2047, 2049])
def test_any_number_of_splats(renderer, count):
    scene, view = alone(random_layers(count, seed=count)), front_view((64, 48))
    assert psnr_db(drawn(renderer, scene, view), reference_image(scene, view)) > 80


def test_a_model_of_networks_equals_the_reference_and_runs_only_what_changed(renderer):
    model, view = random_model(300), front_view((96, 96))
    pose = Pose(np.array([0.1, 0.2, 0.3]), np.array([0.8, 0, 0.6, 0]))

    def runs(x: float, view: View) -> tuple[int, int]:
        scene = alone(model, x=x, world_from_object=pose)
        renderer.update(scene)
        stats = renderer.draw([view])
        assert psnr_db(renderer.image(), reference_image(scene, view)) > 80
        return stats.geometry_runs, stats.color_runs

    assert runs(0.25, view) == (1, 1)
    assert renderer.image()[..., 3].mean() > 0.05
    assert runs(0.25, view) == (0, 0)
    assert runs(0.25, front_view((96, 96), distance=3)) == (0, 1)
    assert runs(0.75, front_view((96, 96), distance=3)) == (1, 1)
    model = without_control(model, "offset", "scale", "rotation", "opacity")
    assert runs(0.25, view) == (1, 1)
    assert runs(0.75, view) == (0, 1)  # all stops share their shape: colours alone change


@pytest.mark.parametrize("coefficients", [1, 4, 9, 16])
def test_every_degree_of_harmonics(renderer, coefficients):
    scene = alone(random_layers(2000, coefficients=coefficients))
    view = front_view((64, 64))
    assert psnr_db(drawn(renderer, scene, view), reference_image(scene, view)) > 80


@pytest.mark.parametrize(
    "limits",
    [
        {"min_alpha": 0.05},
        {"max_pixels": 1.0},
        {"max_distance": 4.0},
        {"low_pass": 0.0},
        {"low_pass": 2.0},
    ],
    ids=lambda d: "".join(d),
)
def test_settings_mean_the_same_as_in_the_reference(renderer, limits):
    scene, view = two_objects(4000), front_view((96, 96))
    renderer.settings = RenderSettings(**limits)
    image = drawn(renderer, scene, view)
    reference = reference_image(scene, view, renderer.settings)
    assert psnr_db(image, reference) > 60
    assert psnr_db(reference_image(scene, view), reference) < 55, "the limit must show"


def test_every_splat_is_accounted_for(renderer):
    scene = two_objects(4000)
    renderer.settings = RenderSettings(max_pixels=1.5, max_distance=4.2)
    renderer.update(scene)
    stats = renderer.draw([front_view((96, 96))])
    assert stats.splats == scene.splat_count == stats.drawn + sum(stats.culled.values())
    assert tuple(stats.culled) == CULL_REASONS
    assert min(stats.culled["size"], stats.culled["distance"], stats.culled["opacity"]) > 0
    assert list(stats.ms) == ["decode", "project", "bin", "splat"]


def test_broken_splats_never_reach_the_image(renderer):
    broken, whole = poisoned(random_layers(3000))
    view = front_view((96, 96))
    image = drawn(renderer, alone(broken), view)
    assert np.isfinite(image).all()
    clean = drawn(renderer, alone(only(broken, whole)), view)
    np.testing.assert_array_equal(image, clean)


@pytest.mark.parametrize("scale", [1e-30, 1e-20, 1e10, 1e19, 1e30])
def test_extreme_sizes_stay_finite(renderer, scale):
    image = drawn(renderer, alone(one_splat(scales=[[scale] * 3])), front_view((32, 32)))
    assert np.isfinite(image).all() and image.min() >= 0 and image.max() <= 1


def test_a_quaternion_of_length_zero_is_no_turn(renderer):
    long = {"scales": [[0.2, 0.05, 0.05]]}
    view = front_view((64, 64))
    unturned = drawn(renderer, alone(one_splat(**long)), view).copy()
    model = one_splat(**long, wxyz=[[0, 0, 0, 0]])
    np.testing.assert_array_equal(drawn(renderer, alone(model), view), unturned)
    np.testing.assert_allclose(reference_image(alone(model), view), unturned, atol=1e-4)


@pytest.mark.parametrize("scene", [alone(random_layers(500)), Scene(()), alone(random_layers(0))])
def test_nothing_in_front_is_a_clean_image(renderer, scene):
    image = drawn(renderer, scene, AWAY)
    assert image.shape == (16, 32, 4)
    np.testing.assert_array_equal(image, 0)
    renderer.settings = RenderSettings(background=(0.1, 0.2, 0.3))
    np.testing.assert_array_equal(
        renderer.resolved(), np.broadcast_to(np.array([0.1, 0.2, 0.3], np.float32), (16, 32, 3))
    )


def test_hidden_objects_are_not_drawn_and_come_back(renderer):
    view = front_view((64, 64))
    both = two_objects(1000)
    cloud, other = both.objects
    hidden = Scene(
        (cloud, SceneObject(other.name, other.model, other.world_from_object, visible=False))
    )
    all_of_it = drawn(renderer, both, view).copy()
    np.testing.assert_array_equal(
        drawn(renderer, hidden, view), drawn(renderer, Scene((cloud,)), view)
    )
    drawn(renderer, both, view)
    renderer.update(hidden)
    renderer.draw([view])
    renderer.update(both)
    stats = renderer.draw([view])
    np.testing.assert_array_equal(renderer.image(), all_of_it)
    assert stats.geometry_runs == 0, "showing an object again decodes nothing"


def test_an_unchanged_scene_decodes_nothing_and_a_moved_eye_colours_alone(renderer):
    scene = two_objects(1000)
    near, far = front_view((32, 32)), front_view((32, 32), distance=5)
    turned = View(
        look_at(near.world_from_eye.position, (0.5, 0, 0)), near.tangents, 0.05, 50, (32, 32)
    )

    def runs(scene: Scene, view: View) -> tuple[int, int]:
        renderer.update(scene)
        stats = renderer.draw([view])
        return stats.geometry_runs, stats.color_runs

    assert runs(scene, near) == (2, 2)
    assert runs(scene, near) == (0, 0)
    assert runs(scene, turned) == (0, 0), "a turned head looks from the same place"
    assert runs(scene, far) == (0, 2)
    cloud, other = scene.objects
    moved = SceneObject(other.name, other.model, Pose(np.ones(3), other.world_from_object.wxyz))
    assert runs(Scene((cloud, moved)), far) == (0, 1), "the eye moved for that object alone"
    changed = SceneObject(cloud.name, cloud.model, x=0.5)
    assert runs(Scene((changed, moved)), far) == (1, 0), "harmonics do not know x"
    assert runs(Scene((changed,)), far) == (1, 1), "another set of objects starts anew"


def test_colours_without_direction_ignore_the_eye():
    plain = random_layers(5, coefficients=1)
    assert color_key(plain, 0.1, np.zeros(3)) == color_key(plain, 0.9, np.ones(3))
    bent = random_layers(5, coefficients=4)
    assert color_key(bent, 0.1, np.zeros(3)) != color_key(bent, 0.1, np.ones(3))


def test_a_sweep_of_x_allocates_nothing_and_keeps_the_count(renderer):
    scene, view = alone(random_layers(3000, layers=3)), front_view((48, 48))
    pool = renderer.drawing.device.pool

    def frame(x: float) -> int:
        renderer.update(alone(scene.objects[0].model, x=float(x)))
        return renderer.draw([view]).splats

    sweep = np.linspace(0, 1, 200)
    counts = {frame(x) for x in sweep}
    before = pool.managed_bytes  # the pool has met lists of every length by now
    allocations = renderer.drawing.allocations
    counts |= {frame(x) for x in sweep}
    assert counts == {3000}
    assert pool.managed_bytes == before
    assert renderer.drawing.allocations == allocations


def test_layers_come_with_x(renderer):
    model, view = random_layers(3000, layers=3), front_view((64, 64))
    images = []
    for x in (0.0, 0.25, 0.5, 1.0):
        scene = alone(model, x=x)
        images.append(drawn(renderer, scene, view).copy())
        assert psnr_db(images[-1], reference_image(scene, view)) > 80
    coverage = [image[..., 3].sum() for image in images]
    assert coverage == sorted(coverage) and coverage[0] < 0.8 * coverage[-1]


def test_resolved_shows_the_palette_over_the_background(renderer):
    gray = one_splat(opacity=[1.0], scales=[[0.5] * 3], sh=[[[0.0, 0.0, 0.0]]])  # colour 0.5
    stops = (Stop("rgb", 0.0), Stop("heat", 1.0, "thermal", "ironbow"))
    fields = (gray.means, gray.scales, gray.wxyz, gray.opacity, gray.sh, gray.layer)
    model = SplatLayers(*fields, stops, mode="cumulative")
    renderer.settings = RenderSettings(background=(0.0, 0.0, 1.0))
    for x, color in ((0.0, (0.5, 0.5, 0.5)), (1.0, palette_colors("ironbow")[[127, 128]].mean(0))):
        drawn(renderer, alone(model, x=x), front_view((33, 33)))
        want = 0.99 * np.array(color) + 0.01 * np.array((0, 0, 1))
        np.testing.assert_allclose(renderer.resolved()[16, 16], want, atol=0.005)


@pytest.mark.parametrize(("modality", "x"), [("bone", 0.0), ("muscle", 0.5), ("full", 1.0)])
def test_photos_that_another_splatter_made_are_drawn_again(renderer, data, modality, x):
    """Real splats, cameras and pictures: axes, harmonics, layers, order and blending at once."""
    folder = data / "anatomy_leg_3modal_views"
    told = json.loads((folder / "transforms_multimodal.json").read_text())
    leg = read_model(data / "anatomy_leg_ml3dgs")
    renderer.settings = RenderSettings(background=(1.0, 1.0, 1.0))
    renderer.update(alone(leg, x=x))
    ours_from_file = np.diag([1.0, -1.0, -1.0, 1.0])  # the turn that readers of 3DGS make
    focal, centre = (told["fl_x"], told["fl_y"]), (told["cx"], told["cy"])
    for frame in told["frames"][:4]:
        pose = ours_from_file @ np.array(frame["c2w_opencv"])
        renderer.draw([View.from_pinhole(pose, focal, centre, (told["w"], told["h"]))])
        photo = np.asarray(Image.open(folder / modality / frame["file"]).convert("RGB")) / 255
        assert psnr_db(renderer.resolved().clip(0, 1), photo) > 60


@pytest.mark.parametrize(
    ("ask", "answer"),
    [
        ({"drawing": "quads"}, "quads are drawn with GL; open a context, or draw tiles"),
        ({"mlps": "gl"}, "tiles decode and sort without GL"),
        ({"sort": "gl"}, "tiles decode and sort without GL"),
        ({"target": "rgb565"}, "there is no target 'rgb565'; choose auto, rgba8, rgba16, rgba16f"),
        ({"drawing": "rays"}, "there is no drawing 'rays'; choose auto, quads, tiles"),
    ],
)
def test_what_cannot_work_is_refused_in_a_sentence(ask, answer):
    with pytest.raises(ValueError, match=answer):
        Renderer(None, **ask)


def test_without_gl_there_is_nothing_to_present_with(renderer):
    with pytest.raises(ValueError, match="no GL context to present with"):
        renderer.present(None)


def test_the_names_of_what_is_in_use(renderer):
    assert renderer.backends["drawing"].startswith("tiles (")
    assert renderer.backends["mlps"] == "opencl"
    assert renderer.backends["mlps"] == "opencl"
