"""A part of a picture is what the whole has there: views, the float64 reference and the drawings.

The right answer needs no twin: it is cut out of another picture.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shapeshift.renderer.debug.debug_map import classify
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View, look_at, perspective
from tests.support.renderer.frames import draw
from tests.support.renderer.reference_reasons import reference_reasons
from tests.support.renderer.renderers import TILES, quads
from tests.support.splat_scenes import alone, one_splat, psnr_db, random_layers, random_model

RENDERERS = {"tiles": TILES, "quads": quads()}

SIZE = (256, 128)
HERE = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
# (left, top, width, height), pixels of SIZE; all of them touch the outer edge.
OUTER = {
    "left half": (0, 0, 128, 128),
    "right quarter": (192, 0, 64, 128),
    "right eighth": (224, 0, 32, 128),
    "upper right corner": (192, 0, 64, 32),
    "lower eighth": (0, 112, 256, 16),
}
# Of these the widest lens is seen only by one that knows its whole.
INNER = {
    "second quarter": (64, 0, 64, 128),
    "fifth eighth": (128, 0, 32, 128),
    "one off all tiles": (117, 43, 37, 51),
    "a pixel": (200, 100, 1, 1),
}
PARTS = OUTER | INNER


def around_the_eye(count: int = 1500, seed: int = 4):
    """Splats before and far beside the eye, long enough to reach into the picture from there."""
    rng = np.random.default_rng(seed)
    layers = random_layers(count, seed)
    means = rng.uniform((-6, -4, -2.5), (6, 4, -0.4), (count, 3))
    scales = np.exp(rng.normal(size=(count, 3)) * 0.6 - 2.0)
    return replace(layers, means=means.astype(np.float32), scales=scales.astype(np.float32))


def wide(fov_y: float = 0.75) -> View:
    return View(HERE, perspective(fov_y, SIZE), 0.05, 50.0, SIZE)


def cut(image: np.ndarray, box: tuple[int, int, int, int]) -> np.ndarray:
    left, top, width, height = box
    return image[top : top + height, left : left + width]


def part_of(view: View, name: str) -> View:
    left, top, width, height = PARTS[name]
    return view.part(left, top, (width, height))


def test_a_part_has_the_pixels_of_the_whole():
    view = View(look_at((1, 2, 3), (0, 0, 0)), (-0.6, 0.9, -0.5, 0.3), 0.05, 50, SIZE)
    place = np.array([0.1, -0.2, 0.4])
    for name, (left, top, width, height) in PARTS.items():
        part = part_of(view, name)
        assert part.size == (width, height) and part.whole == view.tangents
        for axis, first in ((0, left), (1, top)):
            whole_at, part_at = (pixel(v, place)[axis] for v in (view, part))
            assert part_at == pytest.approx(whole_at - first, abs=1e-9)
        again = part.part(0, 0, (1, 1))
        assert again.whole == view.tangents, "of a part of a part the whole is the first one"


def pixel(view: View, place: np.ndarray) -> np.ndarray:
    camera_from_world, fx, fy, cx, cy = view.pinhole()
    x, y, z = camera_from_world[:3, :3] @ place + camera_from_world[:3, 3]
    return np.array([fx * x / z + cx, fy * y / z + cy])


@pytest.mark.parametrize(
    ("tangents", "whole", "want"),
    [
        ((-0.5, 0.5, -0.3, 0.3), None, (0.5, 0.3)),  # centred: its own
        ((-0.2, 0.5, -0.3, 0.1), None, (0.5, 0.3)),
        ((0.25, 0.5, -0.3, -0.2), None, (0.5, 0.3)),  # beside the axis
        ((-0.5, -0.25, 0.2, 0.3), None, (0.5, 0.3)),
        ((0.0, 0.25, 0.0, 0.1), (-0.5, 0.5, -0.3, 0.3), (0.5, 0.3)),
        ((-0.9, 0.25, -0.4, 0.1), (-0.5, 0.5, -0.3, 0.3), (0.9, 0.4)),  # out of its whole
    ],
)
def test_the_widest_tangents(tangents, whole, want):
    assert View(HERE, tangents, 0.1, 9, SIZE, whole).widest_tangents() == pytest.approx(want)


def test_a_whole_that_is_none_is_refused():
    with pytest.raises(ValueError, match="left must be less than right"):
        View(HERE, (-1, 1, -1, 1), 0.1, 9, SIZE, (1, -1, -1, 1))
    with pytest.raises(ValueError, match="all finite"):
        View(HERE, (-1, 1, -1, 1), 0.1, 9, SIZE, (-1, np.inf, -1, 1))


@pytest.mark.parametrize("name", PARTS)
def test_the_reference_draws_a_part_as_in_the_whole(name):
    scene, view = alone(around_the_eye(300)), wide()
    got = reference_image(scene, part_of(view, name))
    np.testing.assert_allclose(got, cut(reference_image(scene, view), PARTS[name]), atol=1e-12)


@pytest.mark.parametrize("name", OUTER)
def test_a_part_at_the_edge_needs_not_know_its_whole(name):
    scene, view = alone(around_the_eye(300)), wide()
    got = reference_image(scene, replace(part_of(view, name), whole=None))
    np.testing.assert_allclose(got, cut(reference_image(scene, view), PARTS[name]), atol=1e-12)


def test_without_its_whole_a_part_in_the_middle_is_another_lens():
    """That the scene shows a wrong clamp at all: else the tests here would hold of any rule."""
    scene, view = alone(around_the_eye(300)), wide()
    got = reference_image(scene, replace(part_of(view, "fifth eighth"), whole=None))
    assert psnr_db(got, cut(reference_image(scene, view), PARTS["fifth eighth"])) < 50


@pytest.mark.parametrize("place", [(0.2, 0.1), (1.2, -0.9), (-3.0, 0.4), (0.6, 5.0)])
def test_a_centred_view_projects_as_3dgs_does(place):
    """Its computeCov2D, written out: limx = 1.3 tan(fov_x / 2), t.x = clamp(t.x / t.z) t.z."""
    view, z = wide(), 2.0
    mean = np.array([place[0] * z, place[1] * z, z])  # OpenCV axes
    scale = np.array([0.3, 0.1, 0.5])
    splat = one_splat(means=[mean * (1, -1, -1)], scales=[scale])
    tan_x, tan_y = view.tangents[1], view.tangents[3]
    focal_x, focal_y = SIZE[0] / (2 * tan_x), SIZE[1] / (2 * tan_y)
    x = min(1.3 * tan_x, max(-1.3 * tan_x, mean[0] / z)) * z
    y = min(1.3 * tan_y, max(-1.3 * tan_y, mean[1] / z)) * z
    j = np.array([[focal_x / z, 0, -focal_x * x / z**2], [0, focal_y / z, -focal_y * y / z**2]])
    want = j @ np.diag(np.float64(np.float32(scale)) ** 2) @ j.T + 0.3 * np.eye(2)
    from shapeshift.renderer.reference import gate_object

    found = gate_object(alone(splat).objects[0], view, RenderSettings(), np.zeros(3))
    np.testing.assert_allclose(found.covariance[0], want, rtol=1e-6)


@pytest.mark.parametrize("name", PARTS)
def test_a_part_is_drawn_as_in_the_whole(renderer, name):
    """90 dB: what float32 leaves of a place, and splats of equal depth."""
    scene, view = alone(around_the_eye()), wide()
    (whole,) = draw(renderer, scene, [view])
    (got,) = draw(renderer, scene, [part_of(view, name)])
    assert psnr_db(got, cut(whole, PARTS[name])) > 90
    assert whole.std() > 0.05


@pytest.mark.parametrize("name", OUTER)
def test_a_part_at_the_edge_is_drawn_as_in_the_whole_that_it_does_not_know(renderer, name):
    scene, view = alone(around_the_eye()), wide()
    (whole,) = draw(renderer, scene, [view])
    (got,) = draw(renderer, scene, [replace(part_of(view, name), whole=None)])
    assert psnr_db(got, cut(whole, PARTS[name])) > 90


def test_a_picture_in_tiles_is_the_picture(renderer):
    """As high resolutions are drawn: 15 parts of odd sizes, side by side."""
    scene, view = alone(around_the_eye()), wide()
    columns, rows = (0, 37, 101, 150, 211, 256), (0, 45, 83, 128)
    tiled = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    for left, right in pairwise(columns):
        for top, low in pairwise(rows):
            part = view.part(left, top, (right - left, low - top))
            tiled[top:low, left:right] = draw(renderer, scene, [part])[0]
    assert psnr_db(tiled, draw(renderer, scene, [view])[0]) > 90


def test_lenses_that_lean_are_parts_of_the_lens_that_holds_both(renderer):
    """Two eyes of a headset, their heads askew, beside one centred picture that holds each."""
    scene = alone(random_model(300), x=0.3)
    pose = look_at((0.3, 0.2, 1.1), (0, 0, 0), up=(0.3, 1.0, 0.1))
    eyes = [
        View(pose, (-0.75, 0.5, -0.5, 0.25), 0.05, 50, (160, 96)),
        View(pose, (-0.5, 0.75, -0.5, 0.25), 0.05, 50, (160, 96)),
    ]
    whole = View(pose, (-0.75, 0.75, -0.5, 0.5), 0.05, 50, (192, 128))
    (picture,) = draw(renderer, scene, [whole])
    for image, left in zip(draw(renderer, scene, eyes), (0, 32), strict=True):
        assert psnr_db(image, cut(picture, (left, 32, 160, 96))) > 90


SIZES = RenderSettings(max_pixels=60.0, min_pixels=60.0)  # one sigma; to where a splat ends


@pytest.mark.parametrize("name", [None, *PARTS])
@pytest.mark.parametrize("settings", [RenderSettings(), SIZES], ids=["none", "sizes"])
def test_the_debug_view_s_reasons_are_the_reference_s(renderer, name, settings):
    """Every gate, of the whole and of its parts; a size exactly at a limit rounds either way."""
    scene, view = alone(around_the_eye(3000)), wide()
    view = part_of(view, name) if name else view
    draw(renderer, scene, [view])
    reason, _, _ = classify(renderer.drawing.splat_points(), np.eye(4)[None], view, settings)
    assert np.count_nonzero(reason != reference_reasons(scene, view, settings)) <= 1


@pytest.mark.parametrize("gate", ["max_pixels", "min_pixels"])
def test_a_size_gate_that_is_a_fifth_off_would_show(gate):
    """That the splats above lie on both sides of either limit, and close to it."""
    scene, view = alone(around_the_eye(3000)), wide()
    want = reference_reasons(scene, view, SIZES)
    for off in (1 / 1.2, 1.2):
        other = replace(SIZES, **{gate: off * getattr(SIZES, gate)})
        assert np.count_nonzero(reference_reasons(scene, view, other) != want) > 10
    assert {4, 5} <= set(want), "splats too large and splats too small"
