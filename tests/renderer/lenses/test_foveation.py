"""Sharp where one looks: there nothing differs by a bit; elsewhere pixels are made of samples."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.foveate import COARSE, SEAM, SHARP
from shapeshift.rasterizer.project import TILE
from shapeshift.renderer.foveation import RADIUS_DEGREES, fovea_of, foveas_of
from shapeshift.renderer.gl import target
from shapeshift.renderer.gl.context import is_software
from shapeshift.renderer.resolution import bilinear
from shapeshift.renderer.settings import FOVEATIONS, RenderSettings
from shapeshift.scene.metrics import psnr
from shapeshift.scene.pose import View
from shapeshift.scene.scene import IDENTITY
from tests.support.renderer.eye_scenes import SCENES, eyes
from tests.support.renderer.frames import draw_counted
from tests.support.renderer.renderers import TILES, quads

RENDERERS = {"tiles": TILES, "quads": quads(mlps="onnxruntime", pair=False)}
WIDE = (-1.28, 0.9, -1.19, 1.11)
LEVELS = tuple(RADIUS_DEGREES)


@pytest.fixture(autouse=True)
def _foveates(request):
    """As on a GPU."""
    if "renderer" in request.fixturenames:
        drawing = request.getfixturevalue("renderer").drawing
        if hasattr(drawing, "foveates"):
            drawing.foveates = True
        elif drawing.device.kind == "gpu":
            pytest.skip("tiles on a GPU are drawn in all pixels")


def wide_eyes(size: tuple[int, int], gaze: tuple[float, float] | None = None) -> list[View]:
    return [replace(v, tangents=WIDE, size=size, gaze=gaze) for v in eyes()]


def radii(view: View, level: str) -> tuple[np.ndarray, float, float]:
    """(H, W) how far each pixel's centre is from the gaze, in tangents, and the two circles."""
    left, right, down, up = view.tangents
    width, height = view.size
    x = left + (np.arange(width) + 0.5) / width * (right - left)
    y = up - (np.arange(height) + 0.5) / height * (up - down)
    at = view.gaze or (0.0, 0.0)
    fovea = fovea_of(view, level)
    return np.hypot(x[None] - at[0], y[:, None] - at[1]), fovea.inner, fovea.outer


@pytest.mark.parametrize("name", SCENES)
def test_the_middle_is_the_same_to_the_bit(renderer, name):
    for size, level in (((160, 128), "high"), ((161, 127), "high"), ((160, 128), "medium")):
        views, scene = wide_eyes(size, (0.2, -0.3)), SCENES[name]()
        wanted, _ = draw_counted(renderer, scene, views)
        images, _ = draw_counted(renderer, scene, views, foveation=level)
        for view, image, whole in zip(views, images, wanted, strict=True):
            r, inner, outer = radii(view, level)
            sharp = r < inner * (1 - 1e-6)
            assert 0.01 < sharp.mean() < 0.5 and (r > outer).mean() > 0.3
            np.testing.assert_array_equal(image[sharp], whole[sharp])
            if whole[r > outer].any() and name != "one splat":
                assert (image[r > outer] != whole[r > outer]).any()


def blended(renderer, scene, views, **settings) -> list[np.ndarray]:
    """(H, W, 6) of each view, as they are blended: colours, and heat where there is any."""
    draw_counted(renderer, scene, views, **settings)
    drawing, pictures = renderer.drawing, []
    for i in range(len(views)):
        heat = [drawing.heat(i)] if drawing.draws_heat else []
        pictures.append(np.dstack([drawing.image(i), *heat]).copy())
    return pictures


@pytest.mark.parametrize("name", ["networks", "tinted"])
def test_outside_pixels_lie_between_what_is_exact_at_their_corners(renderer, name):
    """The oracle: the whole picture of a view that is half a pixel aside, every second pixel.

    Its pixels lie where four of ours meet.  Less than a step of 8 bits: splats at the bound of the
    Jacobian differ, which is half a pixel wider there.
    """
    size = (160, 128)
    views, scene = wide_eyes(size), SCENES[name]()
    images = blended(renderer, scene, views, foveation="high")
    shifted = []
    for view in views:
        left, right, down, up = view.tangents
        x, y = (right - left) / size[0] / 2, (up - down) / size[1] / 2
        shifted.append(replace(view, tangents=(left + x, right + x, down - y, up - y)))
    corners = blended(renderer, scene, shifted)
    assert images[0].shape[2] == (6 if name == "tinted" else 4)
    for view, image, exact in zip(views, images, corners, strict=True):
        r, _, outer = radii(view, "high")
        # Samples of the seam's tiles are means of pixels.
        outside = r > outer + (TILE * math.sqrt(2) + 4) * max(fovea_of(view, "high").unit)
        wanted = bilinear(np.ascontiguousarray(exact[::2, ::2]), size)
        assert outside.mean() > 0.5 and exact[outside].any()
        np.testing.assert_allclose(image[outside], wanted[outside], atol=1 / 255)


def test_both_drawings_agree_and_no_seam_is_seen(ctx):
    """43 dB and better in all of the picture: faint splats smaller than a pixel may lie on a corner
    that their tile's list knows and its blocks do not.
    """
    from shapeshift.renderer.renderer import Renderer

    views, scene = wide_eyes((160, 128)), SCENES["networks"]()
    seen = []
    for drawing in ("tiles", "quads"):
        with Renderer(ctx, drawing, target="rgba32f") as renderer:
            renderer.drawing.foveates = True
            seen.append(draw_counted(renderer, scene, views, foveation="high")[0])
    for one, other in zip(*seen, strict=True):
        assert psnr(one, other) > 43


@pytest.mark.parametrize("size", [(1, 1), (TILE - 1, TILE + 1), (2 * TILE, TILE), (95, 70)])
@pytest.mark.parametrize("gaze", [None, (0.7, -0.9), (5.0, 5.0)])
def test_a_tile_is_coarse_where_none_of_its_pixels_is_within(size, gaze):
    view = View(IDENTITY, WIDE, 0.05, 50.0, size, gaze=gaze)
    for level in LEVELS:
        fovea, (r, inner, outer) = fovea_of(view, level), radii(view, level)
        kinds = fovea.kinds_of_tiles(size)
        for row, column in np.ndindex(kinds.shape):
            part = r[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE]
            assert (kinds[row, column] == COARSE) == (part >= outer).all()
            if kinds[row, column] == SHARP:
                assert (part <= inner).all()
            elif (part > inner).any() and (part < outer).any():
                assert kinds[row, column] == SEAM


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("aside", [0.0, 10.0, 40.0, 60.0, 84.0])
def test_no_angle_about_the_gaze_is_less_than_the_levels(level, aside):
    """Up to 85 degrees from straight on, around the whole circle."""
    looks = np.array([math.tan(math.radians(aside)), 0.0])
    fovea = fovea_of(View(IDENTITY, WIDE, 0.05, 50.0, (64, 64), gaze=(looks[0], 0.0)), level)
    gaze = np.append(looks, 1.0) / math.hypot(looks[0], 1.0)
    for turn in np.linspace(0, 2 * np.pi, 48):
        edge = np.append(looks + fovea.inner * np.array([math.cos(turn), math.sin(turn)]), 1.0)
        angle = math.degrees(math.acos(edge @ gaze / np.linalg.norm(edge)))
        rest = 85.0 - aside  # towards the bound
        assert angle > min(RADIUS_DEGREES[level], rest) - 1e-6


def test_a_narrow_view_and_a_debug_picture_are_whole():
    narrow = View(IDENTITY, (-0.2, 0.2, -0.15, 0.15), 0.05, 50.0, (80, 60))
    wide = View(IDENTITY, WIDE, 0.05, 50.0, (80, 60))
    for level in LEVELS:
        assert not foveas_of([narrow], RenderSettings(foveation=level))
        assert not foveas_of([wide], RenderSettings(foveation=level, debug="culls"))
        assert len(foveas_of([narrow, wide], RenderSettings(foveation=level))) == 2
    assert not foveas_of([wide], RenderSettings())
    assert tuple(FOVEATIONS) == ("off", *LEVELS)
    with pytest.raises(ValueError, match="foveation is 'most'; choose one of 'off'"):
        RenderSettings(foveation="most")
    for gaze in ((math.nan, 0.0), (0.0, math.inf)):
        with pytest.raises(ValueError, match="two finite tangents"):
            replace(wide, gaze=gaze)


def test_quads_on_software_gl_stay_whole_and_say_so(ctx, caplog):
    from shapeshift.renderer.renderer import Renderer

    if not is_software(ctx):
        pytest.skip("quads on a GPU are drawn as foveation says")
    target.warn_once.cache_clear()
    views, scene = wide_eyes((96, 80)), SCENES["networks"]()
    with Renderer(ctx, "quads", target="rgba32f") as renderer:
        wanted, _ = draw_counted(renderer, scene, views)
        images, _ = draw_counted(renderer, scene, views, foveation="high")
    np.testing.assert_array_equal(images, wanted)
    assert [r.getMessage() for r in caplog.records if "foveation" in r.getMessage()] == [
        "quads on software GL are drawn in all pixels, whatever foveation says; tiles follow it."
    ]
