"""What quads blend into, and frames drawn at another size than they are shown."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import NoDevice
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.limits import TooLarge
from shapeshift.renderer.reference import reference_image
from shapeshift.renderer.renderer import Renderer
from shapeshift.renderer.resolution import bilinear
from shapeshift.renderer.settings import DEBUG_VIEWS, RenderSettings
from tests.support.splat_scenes import front_view, psnr_db, stereo_views, two_objects


@pytest.fixture(params=["quads", "tiles"])
def renderer(request, ctx):
    try:
        with Renderer(ctx, request.param) as made:
            made.update(two_objects(2000))
            yield made
    except NoDevice as reason:
        pytest.skip(str(reason))


def draw(renderer: Renderer, view, **settings) -> np.ndarray:
    renderer.settings = RenderSettings(**settings)
    renderer.draw([view])
    return renderer.image().copy()


def test_targets_differ_in_what_rounding_costs(ctx):
    scene, view = two_objects(2000), front_view((96, 80))
    truth = reference_image(scene, view)
    with Renderer(ctx, "quads") as renderer:
        renderer.update(scene)
        names = ("rgba8", "rgba16f", "rgba16", "rgba32f", "auto", "rgba8")
        images, told = [], []
        for name in names:
            images.append(draw(renderer, view, target=name))
            told.append(renderer.backends["drawing"])
        used = [*names[:4], "rgba16", "rgba8"]
        assert told == [f"quads ({name})" for name in used]
    coarse, halves, middle, fine = (psnr_db(image, truth) for image in images[:4])
    assert 38 < coarse < halves - 6 and middle > fine - 6 and fine > 65
    # Hardware may blend halves with more digits than they have: 4.5 dB below on an H100.
    assert halves < middle - (12 if is_software(ctx) else 3)
    np.testing.assert_array_equal(images[4], images[2])
    np.testing.assert_array_equal(images[0], images[5])  # made anew, the same again
    np.testing.assert_array_equal(np.rint(images[0] * 255) / np.float32(255), images[0])
    assert images[0].dtype == np.float32 and images[0].max() <= 1


def test_a_target_asked_for_at_the_start_wins(ctx):
    scene, view = two_objects(500), front_view((48, 40))
    with Renderer(ctx, "quads", target="rgba32f") as fine, Renderer(ctx, "quads") as settable:
        fine.update(scene)
        settable.update(scene)
        np.testing.assert_array_equal(
            draw(fine, view, target="rgba8"), draw(settable, view, target="rgba32f")
        )


@pytest.mark.parametrize(("scale", "size"), [(0.5, (40, 32)), (0.3, (24, 19)), (2.0, (160, 128))])
def test_a_scaled_frame_is_drawn_small_and_shown_full(renderer, ctx, scale, size):
    view = front_view((80, 64))
    image = draw(renderer, view, render_scale=scale, background=(0.2, 0.4, 0.6), target="rgba32f")
    assert image.shape == (size[1], size[0], 4)
    np.testing.assert_array_equal(image, draw(renderer, view.resized(size), target="rgba32f"))
    draw(renderer, view, render_scale=scale, background=(0.2, 0.4, 0.6), target="rgba32f")
    shown = renderer.resolved()
    assert shown.shape == (64, 80, 3)
    framebuffer = ctx.simple_framebuffer((80, 64), 4)
    renderer.present(framebuffer)
    got = np.frombuffer(framebuffer.read(components=3), np.uint8).reshape(64, 80, 3)[::-1]
    framebuffer.release()
    assert np.abs(got / 255 - np.clip(shown, 0, 1)).max() < 2.01 / 255


def test_scale_one_changes_nothing(renderer):
    view = front_view((81, 63))
    draw(renderer, view)
    exact = renderer.resolved()
    draw(renderer, view, render_scale=0.5)
    half = renderer.resolved()
    draw(renderer, view, render_scale=1.0)
    np.testing.assert_array_equal(renderer.resolved(), exact)
    assert 18 < psnr_db(half, exact) < 45


def test_one_pixel_is_left_of_the_smallest(renderer):
    image = draw(renderer, front_view((3, 2)), render_scale=1 / 16)
    assert image.shape == (1, 1, 4) and renderer.resolved().shape == (2, 3, 3)


@pytest.mark.parametrize("debug", [name for name in DEBUG_VIEWS if name])
def test_debug_pictures_are_shown_full_too(renderer, debug):
    renderer.settings = RenderSettings(render_scale=0.5, debug=debug, target="rgba8")
    views = [replace(view, size=(80, 64)) for view in stereo_views()]
    renderer.draw(views)
    assert all(renderer.resolved(i).shape == (64, 80, 3) for i in range(2))
    assert renderer.image(1).shape == (32, 40, 4)


def test_a_view_too_large_for_the_driver_is_refused_and_the_next_drawn(ctx):
    with Renderer(ctx, "quads") as renderer:
        renderer.update(two_objects(100))
        before = draw(renderer, front_view((32, 32)))
        most = renderer.gpu.max_side
        with pytest.raises(TooLarge, match=f"{most + 1} x 8 pixels was asked for.* smaller one"):
            draw(renderer, front_view((most + 1, 8)))
        np.testing.assert_array_equal(draw(renderer, front_view((32, 32))), before)


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (14, 10), (3, 9), (31, 2)])
def test_bilinear_is_a_loop_over_pixels(size):
    image = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
    got = bilinear(image, size)
    want = np.empty((size[1], size[0], 3))
    for row in range(size[1]):
        for column in range(size[0]):
            y = min(max((row + 0.5) * 5 / size[1] - 0.5, 0), 4)
            x = min(max((column + 0.5) * 7 / size[0] - 0.5, 0), 6)
            y0, x0 = min(int(y), 3), min(int(x), 5)
            square = image[y0 : y0 + 2, x0 : x0 + 2].astype(np.float64)
            across = square[:, 0] + (x - x0) * (square[:, 1] - square[:, 0])
            want[row, column] = across[0] + (y - y0) * (across[1] - across[0])
    assert got.shape == want.shape and got.dtype == np.float32
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_bilinear_of_one_pixel_and_of_the_same_size():
    image = np.full((1, 1, 3), 0.25, np.float32)
    np.testing.assert_array_equal(bilinear(image, (4, 3)), np.full((3, 4, 3), 0.25))
    assert bilinear(image, (1, 1)) is image
