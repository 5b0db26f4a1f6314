"""Shadows below an eye's picture over the room: how much of the room's light is left, and where."""

import moderngl
import numpy as np
import pytest

from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.vr.shadow import CELLS, Cast, Shadow, Shadows

SIZE = (120, 90)
EVEN = Shadow((-0.5, -0.25), 1.0, np.full((CELLS, CELLS), 0.5, np.float32))


def a_view(eye=(0.0, 1.0, 1.0), target=(0.0, 0.0, 0.0)) -> View:
    return View(look_at(np.array(eye), np.array(target)), perspective(1.0, SIZE), 0.05, 50.0, SIZE)


def picture(ctx: moderngl.Context, alpha: float = 0.0) -> moderngl.Framebuffer:
    framebuffer = ctx.framebuffer([ctx.texture(SIZE, 4)])
    framebuffer.clear(0.2 * alpha, 0.4 * alpha, 0.0, alpha)
    return framebuffer


def read(framebuffer: moderngl.Framebuffer) -> np.ndarray:
    """(H, W, 4) bytes, row 0 on top."""
    data = np.frombuffer(framebuffer.read(components=4, alignment=1), np.uint8)
    return data.reshape(SIZE[1], SIZE[0], 4)[::-1]


def covered(view: View, cast: Cast) -> np.ndarray:
    """(H, W) bool by rays: pixels whose ray meets the rectangle."""
    left, right, down, up = view.tangents
    x = left + (np.arange(SIZE[0]) + 0.5) / SIZE[0] * (right - left)
    y = up - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * (up - down)
    ways = np.stack([*np.meshgrid(x, y), -np.ones(SIZE[::-1])], -1)
    ways = ways @ view.world_from_eye.matrix()[:3, :3].T
    eye = view.world_from_eye.position
    far = (cast.place[1] - eye[1]) / ways[..., 1]
    at = eye + far[..., None] * ways - cast.place
    low, side = np.array(cast.shadow.corner), cast.shadow.side_m
    inside = (at[..., [0, 2]] >= low) & (at[..., [0, 2]] < low + side)
    return (far > 0) & inside.all(-1)


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("away", [0.0, 4000.0])
def test_it_lies_below_what_is_drawn_and_colours_stay(ctx, alpha, away):
    """Half of the light that is left; also 4 km from the origin."""
    framebuffer, shadows = picture(ctx, alpha), Shadows(ctx)
    before = read(framebuffer).copy()
    place = np.array([away, 0.1, -away])
    view = a_view(eye=(away, 1.0, 1.0 - away), target=place)
    cast = Cast("cube", EVEN, place)
    shadows.draw(framebuffer, view, [cast])
    after = read(framebuffer)
    np.testing.assert_array_equal(after[..., :3], before[..., :3])
    inside = covered(view, cast)
    wanted = 255 * (alpha + (1 - alpha) * 0.5 * inside)
    off = np.abs(after[..., 3] - wanted) > 1.01
    assert 0.1 < inside.mean() < 0.9
    assert off.mean() < 0.005, "but for pixels that its edge cuts"
    shadows.release()
    assert ctx.error == "GL_NO_ERROR"


def test_two_take_their_shares_one_after_the_other_and_none_is_seen_from_below(ctx):
    framebuffer, shadows = picture(ctx), Shadows(ctx)
    view = a_view()
    casts = [Cast("cube", EVEN, np.zeros(3)), Cast("ball", EVEN, np.zeros(3))]
    shadows.draw(framebuffer, view, casts)
    shown = read(framebuffer)[..., 3][covered(view, casts[0])]
    assert abs(float(np.median(shown)) - 255 * 0.75) <= 1
    below = picture(ctx)
    shadows.draw(below, a_view(eye=(0.0, -1.0, 1.0)), casts)
    assert not read(below).any()
    shadows.draw(below, view, [])
    assert not read(below).any()
    shadows.release()


def test_a_shadow_that_changes_is_the_new_one_in_the_next_frame(ctx):
    framebuffer, shadows = picture(ctx), Shadows(ctx)
    view = a_view()
    dark = Shadow(EVEN.corner, EVEN.side_m, np.ones((CELLS, CELLS), np.float32))
    for shadow, alpha in ((EVEN, 0.5), (dark, 1.0), (EVEN, 0.5)):
        framebuffer.clear()
        cast = Cast("cube", shadow, np.zeros(3))
        shadows.draw(framebuffer, view, [cast])
        assert (
            abs(float(np.median(read(framebuffer)[covered(view, cast)][:, 3])) - 255 * alpha) <= 1
        )
    shadows.release()


def test_columns_go_along_x_and_rows_along_z(ctx):
    """Seen from above with -z ahead: x to the right, z down."""
    view = View(
        look_at(np.array([0.0, 2.0, 0.0]), np.zeros(3), up=(0.0, 0.0, -1.0)),
        perspective(1.0, SIZE), 0.05, 50.0, SIZE,
    )  # fmt: skip
    occlusion = np.zeros((CELLS, CELLS), np.float32)
    occlusion[CELLS // 2 :, : CELLS // 2] = 1.0  # greater z, lesser x
    framebuffer, shadows = picture(ctx), Shadows(ctx)
    shadows.draw(
        framebuffer, view, [Cast("cube", Shadow((-0.5, -0.5), 1.0, occlusion), np.zeros(3))]
    )
    rows, columns = np.nonzero(read(framebuffer)[..., 3] > 128)
    assert rows.min() >= SIZE[1] // 2 - 1 and columns.max() <= SIZE[0] // 2
    assert len(rows) > 100
    shadows.release()
