"""The float64 oracle itself, against closed forms and a brute-force loop over pixels."""

import math

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View, look_at
from shapeshift.scene.scene import Scene
from tests.support.renderer.reference_reasons import project_object
from tests.support.splat_scenes import (
    FIELDS,
    alone,
    front_view,
    one_splat,
    only,
    poisoned,
    random_layers,
    two_objects,
)

STRAIGHT = View(look_at((0, 0, 2), (0, 0, 0)), (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (65, 65))
EXACT = RenderSettings()


def test_one_splat_is_the_gaussian_of_the_formula():
    image = reference_image(alone(one_splat()), STRAIGHT)
    sigma = math.sqrt((0.05 * 65 / 2) ** 2 + 0.3)  # pixels: f = 65 px, 2 m away
    y, x = np.mgrid[:65, :65] + 0.5
    alpha = 0.8 * np.exp(-((x - 32.5) ** 2 + (y - 32.5) ** 2) / (2 * sigma**2))
    alpha[alpha < 1 / 255] = 0
    np.testing.assert_allclose(image[..., 3], alpha, atol=1e-6)  # float32 scale 0.05
    np.testing.assert_allclose(image[..., :3], np.repeat(alpha[..., None], 3, 2), atol=1e-6)


def test_it_equals_a_loop_over_every_pixel_and_splat():
    scene = alone(random_layers(60, seed=3, coefficients=9))
    view = View(look_at((0.2, 0.5, 3), (0, 0, 0)), (-0.3, 0.5, -0.6, 0.3), 0.05, 50, (24, 18))
    parts = project_object(scene.objects[0], view, EXACT, view.world_from_eye.position)
    want = np.zeros((18, 24, 4))
    for row in range(18):
        for column in range(24):
            through = 1.0
            for _, mean, covariance, opacity, color in sorted(
                zip(*parts, strict=True), key=lambda s: s[0]
            ):
                offset = np.array([column + 0.5, row + 0.5]) - mean
                alpha = min(
                    0.99, opacity * math.exp(-offset @ np.linalg.solve(covariance, offset) / 2)
                )
                if alpha >= 1 / 255:
                    want[row, column, :3] += through * alpha * color
                    through *= 1 - alpha
            want[row, column, 3] = 1 - through
    np.testing.assert_allclose(reference_image(scene, view), want, atol=1e-12)


def test_projection_agrees_with_finite_differences():
    """J of the covariance is the derivative of the pixel by the place, inside the field of view."""
    view = View(look_at((0.2, 0.5, 3), (0, 0, 0)), (-0.3, 0.5, -0.6, 0.3), 0.05, 50, (240, 180))

    def pixel(place: np.ndarray) -> np.ndarray:
        scene = alone(one_splat(), world_from_object=Pose(place, np.array([1.0, 0, 0, 0])))
        return project_object(scene.objects[0], view, EXACT, place)[1][0]

    place = np.array([0.3, -0.2, 0.1])
    step = 1e-5 * np.eye(3)
    jacobian = np.stack([(pixel(place + d) - pixel(place - d)) / 2e-5 for d in step], axis=1)
    scene = alone(one_splat(), world_from_object=Pose(place, np.array([1.0, 0, 0, 0])))
    covariance = project_object(scene.objects[0], view, EXACT, place)[2][0]
    want = np.float64(np.float32(0.05)) ** 2 * jacobian @ jacobian.T + 0.3 * np.eye(2)
    np.testing.assert_allclose(covariance, want, rtol=1e-6)


@pytest.mark.parametrize(
    ("place", "row", "column"),
    [
        ((0, 0.4, 0), "top", "middle"),
        ((0.4, 0, 0), "middle", "right"),
        ((-0.4, -0.4, 0), "low", "left"),
    ],
)
def test_up_is_up_and_right_is_right(place, row, column):
    image = reference_image(alone(one_splat(means=[place])), STRAIGHT)[..., 3]
    y, x = np.unravel_index(np.argmax(image), image.shape)
    assert ("top", "middle", "low")[int(y * 3 / 65)] == row
    assert ("left", "middle", "right")[int(x * 3 / 65)] == column


def test_near_hides_far_whatever_the_order_in_the_file():
    red, blue = [[1.7, -1.7, -1.7]], [[-1.7, -1.7, 1.7]]
    for front, back in ((0, 1), (1, 0)):
        means = np.zeros((2, 3))
        means[front, 2] = 0.5  # towards the eye
        model = one_splat(
            means=means, scales=np.full((2, 3), 0.1), wxyz=[[1, 0, 0, 0]] * 2, opacity=[0.9, 0.9],
            sh=[red, blue],
        )  # fmt: skip
        r, _, b, _ = reference_image(alone(model), STRAIGHT)[32, 32]
        assert (r > 5 * b) if front == 0 else (b > 5 * r)
        assert back != front


@pytest.mark.parametrize(
    ("opacity", "seen"),
    [(1 / 255, True), (np.nextafter(np.float32(1 / 255), 0), False), (0, False), (-0.5, False)],
)
def test_opacity_at_the_threshold(opacity, seen):
    exact = RenderSettings(min_alpha=float(np.float32(1 / 255)))
    image = reference_image(alone(one_splat(opacity=[opacity])), STRAIGHT, exact)
    assert (image.max() > 0) == seen


def test_one_splat_never_hides_everything():
    image = reference_image(alone(one_splat(opacity=[1.0])), STRAIGHT)
    assert image[32, 32, 3] == pytest.approx(0.99, abs=1e-12)


def test_broken_splats_leave_no_trace():
    broken, whole = poisoned(random_layers(600))
    assert not all(np.isfinite(getattr(broken, name)).all() for name in FIELDS)
    # Colours are float32 out of products whose rounding depends on how many there are.
    np.testing.assert_allclose(
        reference_image(alone(broken), front_view((64, 64))),
        reference_image(alone(only(broken, whole)), front_view((64, 64))),
        atol=1e-6,
    )


def test_nothing_in_front_is_a_clean_image():
    away = View(look_at((0, 0, 9), (0, 0, 20)), (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (32, 16))
    for scene in (alone(random_layers(200)), Scene(()), alone(one_splat(), visible=False)):
        image = reference_image(scene, away)
        assert image.shape == (16, 32, 4)
        np.testing.assert_array_equal(image, 0)


def test_moving_the_object_is_moving_the_eye_the_other_way():
    scene = two_objects(400)
    move = Pose(np.array([0.3, -0.1, 0.2]), np.array([0.8, 0.6, 0.0, 0.0])).matrix()
    moved = Scene(
        tuple(
            type(o)(o.name, o.model, Pose.from_matrix(move @ o.world_from_object.matrix()))
            for o in scene.objects
        )
    )
    view = front_view((48, 48))
    eye = Pose.from_matrix(move @ view.world_from_eye.matrix())
    followed = View(eye, view.tangents, view.near, view.far, view.size)
    np.testing.assert_allclose(
        reference_image(moved, followed), reference_image(scene, view), atol=1e-9
    )


def test_an_off_centre_view_is_a_window_of_the_wide_one():
    scene = alone(one_splat(means=[[0.3, 0.2, 0]], scales=[[0.1, 0.02, 0.05]]))
    wide = View(STRAIGHT.world_from_eye, (-0.5, 0.5, -0.5, 0.5), 0.1, 50, (64, 64))
    part = View(STRAIGHT.world_from_eye, (-0.125, 0.5, -0.25, 0.375), 0.1, 50, (40, 40))
    np.testing.assert_allclose(
        reference_image(scene, part), reference_image(scene, wide)[8:48, 24:64], atol=1e-12
    )


def test_limits_of_distance_and_size_leave_out():
    view = front_view((48, 48))
    scene = alone(random_layers(400))
    parts = project_object(scene.objects[0], view, EXACT, view.world_from_eye.position)
    near = project_object(
        scene.objects[0], view, RenderSettings(max_distance=4.0), view.world_from_eye.position
    )
    assert 0 < len(near[0]) < len(parts[0]) and near[0].max() <= 4.0
    small = project_object(
        scene.objects[0], view, RenderSettings(max_pixels=1.0), view.world_from_eye.position
    )
    assert 0 < len(small[0]) < len(parts[0])
    assert np.linalg.eigvalsh(small[2]).max() <= 1.0 + 1e-12
