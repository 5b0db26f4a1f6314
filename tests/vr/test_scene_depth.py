"""What nearer splats hide of hands and panel, the panel as a layer of its own, and the depth that
the compositor gets.
"""

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.drawn import Drawn, PanelQuad
from shapeshift.vr.frame import FAR_M, NEAR_M
from shapeshift.vr.glove import Capsule
from shapeshift.vr.openxr.graphics import DepthFramebuffers, NoDepth, read_depth
from shapeshift.vr.overlay import FINE, PLAIN, Overlay
from shapeshift.vr.scene_depth import SceneDepth
from tests.support.renderer.frames import texture_target
from tests.support.vr.vr_hands import HEAD, eyes, pixel_of

SIZE = (240, 200)
EYE = eyes(SIZE)[0]
GROUND, INK = (40, 90, 160), (0.9, 0.2, 0.1)
WALL_M = 2.0  # of the room, before the left half of the eye's picture


@pytest.fixture(params=[FINE, PLAIN], ids=["fine", "plain"])
def overlay(ctx, request):
    with Overlay(ctx, request.param) as made:
        yield made


@pytest.fixture
def scene_depth(ctx):
    with SceneDepth(ctx) as made:
        yield made


@pytest.fixture
def target(ctx):
    with texture_target(ctx, SIZE) as made:
        yield made


def half_a_wall(coverage: float = 1.0, metres: float = WALL_M) -> np.ndarray:
    """(H, W, 4) as a drawing gives depth: the wall left of the middle, row 0 on top."""
    depth = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    depth[:, : SIZE[0] // 2, 0], depth[:, : SIZE[0] // 2, 3] = metres * coverage, coverage
    return depth


def picture(target: moderngl.Framebuffer) -> np.ndarray:
    """(H, W, 4) int, row 0 on top."""
    pixels = np.frombuffer(target.read(components=4), np.uint8)
    return pixels.reshape(*SIZE[::-1], 4)[::-1].astype(int)


def seen_of_ball(overlay, target, depth, metres: float, aside: float, lines: bool = False) -> bool:
    """Whether a ball before the eye, `metres` away, is there in the picture."""
    at = EYE.world_from_eye.position + metres * np.array([aside, 0.0, -1.0])
    ball = (Capsule(at, at, (0.06, 0.06), INK),)
    target.clear(*(c / 255 for c in GROUND), 1.0)
    overlay.draw(target, EYE, Drawn(lines=ball) if lines else Drawn(hands=ball), depth)
    color = picture(target)[pixel_of(EYE, at)]
    return bool(np.abs(color[:3] - GROUND).max() > 30)


@pytest.mark.parametrize("scale", [1.0, 0.25, 8.0])
def test_what_lies_behind_the_splats_is_not_seen_at_any_size_of_the_world(
    overlay, target, scene_depth, scale
):
    depth = scene_depth.of(half_a_wall(metres=WALL_M * scale), scale)
    for lines in (False, True):
        assert seen_of_ball(overlay, target, depth, 1.5, -0.5, lines)  # before the wall
        assert not seen_of_ball(overlay, target, depth, 2.5, -0.5, lines)  # behind it
        assert seen_of_ball(overlay, target, depth, 2.5, 0.4, lines)  # beside it
        assert seen_of_ball(overlay, target, None, 2.5, -0.5, lines)
        assert seen_of_ball(overlay, target, depth, 2.03, -0.5, lines)  # on it: within the slack


def test_a_veil_of_less_than_half_hides_nothing(overlay, target, scene_depth):
    for coverage, seen in ((0.49, True), (0.51, False)):
        depth = scene_depth.of(half_a_wall(coverage), 1.0)
        assert seen_of_ball(overlay, target, depth, 2.5, -0.5) == seen


def test_a_picture_from_a_texture_is_that_from_an_array(ctx, overlay, target, scene_depth):
    """Its first row is the lower one."""
    upper = np.zeros((SIZE[1], SIZE[0], 4), np.float32)
    upper[: SIZE[1] // 2] = (WALL_M, 0, 0, 1)
    texture = ctx.texture(SIZE, 4, np.ascontiguousarray(upper[::-1]).tobytes(), dtype="f4")
    pictures = []
    for source in (upper, texture):
        at = np.add(EYE.world_from_eye.position, (0.0, 0.0, -3.0))
        line = Capsule(np.subtract(at, (0, 4, 0)), np.add(at, (0, 4, 0)), (0.1, 0.1), INK)
        target.clear(0, 0, 0, 1)
        overlay.draw(target, EYE, Drawn(hands=(line,)), scene_depth.of(source, 1.0))
        pictures.append(picture(target))
    np.testing.assert_array_equal(*pictures)
    rows = (pictures[0][..., 0] > 50).any(axis=1)
    assert not rows[: SIZE[1] // 2 - 2].any() and rows[SIZE[1] // 2 + 2 : SIZE[1] - 30].all()
    texture.release()


@pytest.fixture
def panel(ctx):
    texture = ctx.texture((64, 48), 4, np.tile([200, 60, 30, 255], 64 * 48).astype("u1").tobytes())
    texture.build_mipmaps()
    at = Pose(np.add(HEAD.position, (0.1, 0.0, -1.0)), HEAD.wxyz)
    yield PanelQuad(texture, at, (0.8, 0.6))
    texture.release()


@pytest.mark.parametrize("dark", [0.0, 0.7])
def test_a_panel_apart_and_the_eyes_make_the_picture_that_they_made_together(
    overlay, target, scene_depth, panel, dark
):
    """A hand before it, one behind it, and a wall before its left part; `show_behind` does what the
    compositor does with the layers.  What is half seen at edges blends in another order.
    """
    depth = scene_depth.of(half_a_wall(metres=0.9), 1.0)
    middle = panel.play_from_panel.position
    hands = tuple(
        Capsule(np.add(middle, (0.2, y, z)), np.add(middle, (0.2, y, z)), (0.05, 0.05), INK)
        for y, z in ((0.15, 0.3), (-0.15, -0.3))
    )
    pictures = []
    for apart in (False, True):
        target.clear(*(c / 255 for c in GROUND), 1.0)
        shown = replace(panel, apart=apart)
        overlay.draw(target, EYE, Drawn(hands, panel=shown, vignette=dark), depth)
        if apart:
            hole = picture(target)
            overlay.show_behind(target, EYE, shown)
        pictures.append(picture(target))
    together, apart = pictures
    off = np.abs(together - apart).max(axis=2)
    assert (off > 2).mean() < 0.01 and np.quantile(off, 0.98) <= 2, off.max()
    assert (apart[..., 3] > 250).all()
    # The hole is where the panel is seen, black and open, and nowhere else.
    free = pixel_of(EYE, np.add(middle, (0.35, 0.0, 0.0)))
    np.testing.assert_array_equal(hole[free], 0)
    for place in (
        np.add(middle, (-0.3, 0, 0)),
        np.add(middle, (0.2, 0.15, 0.3)),
        np.add(middle, (0.5, 0.0, 0.0)),
    ):
        assert hole[pixel_of(EYE, place)][3] == 255
    np.testing.assert_array_equal(hole[pixel_of(EYE, np.add(middle, (0.2, -0.15, -0.3)))], 0)


def test_the_compositor_gets_metres_as_a_depth_buffer_has_them(ctx, overlay, scene_depth, target):
    near, far = NEAR_M, FAR_M
    target.use()
    eye = replace(EYE, near=near, far=far)
    texture = ctx.depth_texture(SIZE)
    made = DepthFramebuffers(ctx)
    framebuffer = made.around(texture.glo)
    framebuffer.viewport = (0, 0, *SIZE)
    scene_depth.write(framebuffer, eye, scene_depth.of(half_a_wall(metres=3 * WALL_M), 3.0))
    assert ctx.fbo is target  # what was bound is bound again: the runtime may take its own away
    ball = np.add(EYE.world_from_eye.position, (0.3, 0.0, -1.0))
    overlay.write_depth(framebuffer, eye, Drawn((Capsule(ball, ball, (0.1, 0.1), INK),)))
    assert ctx.fbo is target
    stored = read_depth(framebuffer, SIZE)
    metres = far * near / (far - stored * (far - near))
    np.testing.assert_allclose(metres[:, : SIZE[0] // 2 - 1], WALL_M, rtol=1e-3)  # 24 bits
    row, column = pixel_of(EYE, ball)
    assert metres[row, column] == pytest.approx(0.9, rel=0.02)  # facets lie within the ball
    free = metres[:, SIZE[0] // 2 + 1 :].copy()
    free[row - 20 : row + 20] = far
    assert (stored[:, -5:] == 1).all() and free.min() > 0.9 * far
    made.release()
    texture.release()


def test_a_texture_that_is_no_depth_is_refused(ctx):
    texture, made = ctx.texture((4, 4), 4), DepthFramebuffers(ctx)
    with pytest.raises(NoDepth, match="does not draw into the runtime's depth"):
        made.around(texture.glo)
    made.release()
    texture.release()
