"""One sort over all objects: clouds that lie in each other are drawn as the one they make up."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View
from shapeshift.scene.scene import Scene, SceneObject
from tests.support.renderer.frames import draw_counted
from tests.support.renderer.renderers import TILES, quads
from tests.support.scene.object_scenes import (
    CYCLE,
    UPRIGHT,
    dealt,
    exact_cloud,
    in_objects,
    joined,
    put,
    straight_view,
)
from tests.support.splat_scenes import alone, front_view, psnr_db, random_layers, stereo_views

RENDERERS = {"tiles": TILES, "gl": quads(sort="gl"), "numpy": quads(sort="numpy")}

VIEW = front_view((128, 96))
SIZES = (8, 127, 128, 129, 255, 256, 257)  # of the first object: where blocks of kernels end


def draw(renderer: Renderer, scene: Scene, views: list[View], **settings) -> list[np.ndarray]:
    pictures, stats = draw_counted(renderer, scene, views, **settings)
    assert stats.sorts == (1 if settings.get("stereo_sort") != "each" else len(views))
    return pictures


def interleaved(count: int = 3000, parts: int = 2, coefficients: int = 16) -> list:
    return dealt(random_layers(count, coefficients=coefficients), parts)


def test_the_reference_sorts_over_objects():
    clouds = interleaved(1500)
    one = reference_image(alone(joined(clouds)), VIEW)
    np.testing.assert_array_equal(reference_image(in_objects(clouds), VIEW), one)
    wrong = sum_over(*(reference_image(alone(cloud), VIEW) for cloud in clouds))
    assert psnr_db(wrong, one) < 40, "one object before the other would be seen"


def sum_over(front: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Premultiplied pictures laid over each other."""
    return front + (1 - front[..., 3:]) * back


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"order": "distance"},
        {"key_bits": 16},
        {"max_pixels": 6.0, "min_pixels": 1.0, "max_distance": 4.5, "fade": 0.3},
    ],
    ids=["exact", "distance", "16 bits", "culls"],
)
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_two_interleaved_objects_are_the_merged_cloud_to_the_bit(renderer, degree, settings):
    clouds = interleaved(coefficients=(degree + 1) ** 2)
    merged = draw(renderer, alone(joined(clouds)), [VIEW], **settings)
    np.testing.assert_array_equal(draw(renderer, in_objects(clouds), [VIEW], **settings), merged)


@pytest.mark.parametrize("first", SIZES)
def test_wherever_the_second_object_begins(renderer, first):
    cloud = random_layers(600, coefficients=4)
    parts = [cut(cloud, 0, first), cut(cloud, first, 600)]
    merged = draw(renderer, alone(cloud), [VIEW])
    np.testing.assert_array_equal(draw(renderer, in_objects(parts), [VIEW]), merged)


def cut(cloud, first: int, last: int):
    fields = ("means", "scales", "wxyz", "opacity", "sh", "layer")
    return replace(cloud, **{name: getattr(cloud, name)[first:last] for name in fields})


def test_twenty_objects_and_empty_ones_between(renderer):
    clouds = interleaved(4000, 20, 4)
    merged = draw(renderer, alone(joined(clouds)), [VIEW])
    np.testing.assert_array_equal(draw(renderer, in_objects(clouds), [VIEW]), merged)
    nothing = random_layers(0)
    gaps = [part for cloud in clouds for part in (nothing, cloud)] + [nothing]
    np.testing.assert_array_equal(draw(renderer, in_objects(gaps), [VIEW]), merged)


def test_objects_of_one_splat_each(renderer):
    clouds = interleaved(100, 100, 4)
    merged = draw(renderer, alone(joined(clouds)), [VIEW])
    np.testing.assert_array_equal(draw(renderer, in_objects(clouds), [VIEW]), merged)


def test_both_eyes_share_it(renderer):
    clouds, eyes = interleaved(coefficients=4), stereo_views((96, 96))
    merged = draw(renderer, alone(joined(clouds)), eyes)
    np.testing.assert_array_equal(draw(renderer, in_objects(clouds), eyes), merged)


def test_splats_of_one_depth_keep_the_order_of_the_objects(renderer):
    """A tie goes to the earlier object, as to the earlier splat of one cloud, in all back ends."""
    cloud = random_layers(400, coefficients=1)
    flat = replace(cloud, means=cloud.means * np.array([1, 1, 0], np.float32))
    view = straight_view()
    one, other = cut(flat, 0, 200), cut(flat, 200, 400)
    for parts in ([one, other], [other, one]):
        scene = in_objects(parts)
        (image,) = draw(renderer, scene, [view])
        np.testing.assert_array_equal(image, draw(renderer, alone(joined(parts)), [view])[0])
        assert psnr_db(image, reference_image(scene, view)) > 70


def posed(wxyz: np.ndarray) -> tuple[Scene, Scene]:
    """Clouds that posing puts into each other, and the cloud that they make up; no pose rounds."""
    clouds = [exact_cloud(500, 1), exact_cloud(700, 2)]
    poses = [Pose(np.array([0.0, 1.0, -1.0]), wxyz), Pose(np.array([0.0, 1.0, 0.0]), UPRIGHT)]
    baked = joined([put(cloud, pose) for cloud, pose in zip(clouds, poses, strict=True)])
    return in_objects(clouds, poses), alone(baked)


def test_moved_objects_are_the_cloud_baked_in_place_to_the_bit(renderer):
    objects, baked = posed(UPRIGHT)
    (merged,) = draw(renderer, baked, [straight_view()])
    np.testing.assert_array_equal(draw(renderer, objects, [straight_view()])[0], merged)
    (unposed,) = draw(renderer, in_objects([o.model for o in objects.objects]), [straight_view()])
    assert psnr_db(unposed, merged) < 40, "the poses matter"


def test_turned_objects_are_the_cloud_baked_in_place(renderer):
    """Sums of three products in another order: their last bit, while the order stays the same."""
    objects, baked = posed(CYCLE)
    (merged,) = draw(renderer, baked, [straight_view()])
    assert psnr_db(draw(renderer, objects, [straight_view()])[0], merged) > 140


@pytest.mark.parametrize("wxyz", [UPRIGHT, CYCLE], ids=["moved", "turned"])
def test_posed_objects_are_the_cloud_baked_in_place_in_the_reference(wxyz):
    objects, baked = posed(wxyz)
    view = straight_view((48, 40))
    want = reference_image(baked, view)
    np.testing.assert_allclose(reference_image(objects, view), want, rtol=0, atol=1e-12)


@pytest.mark.parametrize("hidden", [0, 1])
def test_a_hidden_object_takes_no_part(renderer, hidden):
    clouds = interleaved(coefficients=4)
    scene = in_objects(clouds)
    objects = [replace(o, visible=i != hidden) for i, o in enumerate(scene.objects)]
    (image,) = draw(renderer, Scene(tuple(objects)), [VIEW])
    np.testing.assert_array_equal(image, draw(renderer, alone(clouds[1 - hidden]), [VIEW])[0])


def test_an_object_that_moves_through_another_is_sorted_anew_in_every_frame(renderer):
    clouds = [random_layers(800, seed, 4) for seed in (1, 2)]
    renderer.settings = RenderSettings(resort_frames=0)
    for z in (-2.0, -0.5, 0.4, 2.0):
        pose = Pose(np.array([0.0, 0.0, z]), UPRIGHT)
        scene = in_objects(clouds, [pose, Pose(np.zeros(3), UPRIGHT)])
        renderer.update(scene)
        assert renderer.draw([VIEW]).sorts == 1
        assert psnr_db(renderer.image(), reference_image(scene, VIEW)) > 70


def test_one_model_as_several_objects_at_several_x(renderer):
    """What objects of one model share must not leak from one to the other."""
    model = random_layers(500, coefficients=16, layers=3)
    places = [np.array([-0.3, 0.0, 0.1]), np.array([0.2, 0.1, -0.2]), np.array([0.0, -0.2, 0.0])]
    turns = [UPRIGHT, CYCLE, np.array([0.6, 0.0, 0.8, 0.0])]
    objects = [
        SceneObject(f"{i}", model, Pose(place, turn), x)
        for i, (place, turn, x) in enumerate(zip(places, turns, (0.0, 0.5, 1.0), strict=True))
    ]
    copies = [replace(obj, model=replace(model)) for obj in objects]
    (image,) = draw(renderer, Scene(tuple(objects)), [VIEW])
    np.testing.assert_array_equal(image, draw(renderer, Scene(tuple(copies)), [VIEW])[0])
    assert psnr_db(image, reference_image(Scene(tuple(objects)), VIEW)) > 70  # quads round records
