"""What a glass puts into an eye's picture: another picture within its disc, where it is seen."""

import moderngl
import numpy as np
import pytest

from shapeshift.vr.glass import RADIUS_M, HeldGlass, Pane, boxes_of, held_glass
from shapeshift.vr.scene_depth import SceneDepth
from tests.support.renderer.frames import texture_target
from tests.support.vr.vr_glass import away_of, upright
from tests.support.vr.vr_hands import HEAD, eyes

SIZE = (320, 290)
EYES = eyes(SIZE)
GROUND = (40, 90, 160, 255)
GLASS_M = 0.5  # about where the glass is, from the eyes


@pytest.fixture
def pane(ctx):
    with Pane(ctx) as made:
        yield made


@pytest.fixture
def target(ctx):
    with texture_target(ctx, SIZE) as made:
        yield made


def numbered(size: tuple[int, int], alpha: int = 255) -> np.ndarray:
    """(H, W, 4) uint8 whose colours say which pixel it is, row 0 below."""
    rows, columns = np.mgrid[: size[1], : size[0]]
    return np.stack([columns, rows, columns ^ rows, np.full_like(rows, alpha)], axis=2).astype("u1")


def drawn(ctx, pane, target, eye: int, glass: HeldGlass, alpha: int = 255, depth=None):
    """(H, W, 4) int, row 0 below, and the box."""
    box = boxes_of(glass, EYES)[eye]
    picture = ctx.texture(box[2:], 4, numbered(box[2:], alpha).tobytes(), alignment=1)
    target.clear(*(c / 255 for c in GROUND))
    pane.draw(target, EYES[eye], glass, picture, box, depth)
    picture.release()
    pixels = np.frombuffer(target.read(components=4, alignment=1), np.uint8)
    return pixels.reshape(*SIZE[::-1], 4).astype(int), box


@pytest.mark.parametrize("alpha", [255, 0, 128])
@pytest.mark.parametrize("turned", [0.0, 0.8, 2.6])
@pytest.mark.parametrize("eye", [0, 1])
def test_within_the_disc_each_pixel_is_its_own_of_the_other_picture(
    ctx, pane, target, eye, turned, alpha
):
    """Whatever its alpha: over the room nothing of what was there may show."""
    glass = held_glass(upright(turned=turned), HEAD)
    image, (left, bottom, width, height) = drawn(ctx, pane, target, eye, glass, alpha)
    away = away_of(glass, EYES[eye])
    # The edge is a pixel wide, by what the distance changes from one to the next: both ways, since
    # a shader takes such differences within blocks of 2 x 2.
    slack = sum(np.abs(np.gradient(away, axis=axis)) for axis in (0, 1)) * 0.55
    wanted = np.empty_like(image)
    wanted[:] = GROUND
    wanted[bottom : bottom + height, left : left + width] = numbered((width, height), alpha)
    inside, outside = away < RADIUS_M - slack, away > RADIUS_M + slack
    assert inside.sum() > 1000
    np.testing.assert_array_equal(image[inside], wanted[inside])
    assert (image[outside] == GROUND).all()


def test_nearer_splats_stand_before_it_and_farther_ones_do_not(ctx, pane, target):
    glass = held_glass(upright(), HEAD)
    away = away_of(glass, EYES[0])
    plain, _ = drawn(ctx, pane, target, 0, glass)
    with SceneDepth(ctx) as scene_depth:
        for metres, hides in ((GLASS_M - 0.1, True), (GLASS_M + 0.1, False)):
            depth = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
            depth[..., 0], depth[..., 3] = metres, 1.0
            image, _ = drawn(ctx, pane, target, 0, glass, depth=scene_depth.of(depth, 1.0))
            assert (image == GROUND).all() if hides else (image == plain).all(), metres
        depth[..., :] *= 0.49  # a veil
        image, _ = drawn(ctx, pane, target, 0, glass, depth=scene_depth.of(depth, 1.0))
    np.testing.assert_array_equal(image, plain)
    assert (away < RADIUS_M).any()


def test_it_leaves_the_context_as_it_was(ctx, pane, target):
    glass = held_glass(upright(), HEAD)
    with texture_target(ctx, SIZE) as other:
        other.use()
        drawn(ctx, pane, target, 0, glass)
        other.use()
        box = boxes_of(glass, EYES)[0]
        picture = ctx.texture(box[2:], 4)
        pane.draw(target, EYES[0], glass, picture, box)
        assert ctx.fbo is other
        picture.release()
    assert ctx.error == "GL_NO_ERROR"
    assert isinstance(target, moderngl.Framebuffer)
