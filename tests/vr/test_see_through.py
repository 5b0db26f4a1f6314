"""The eyes' pictures over the room: light by coverage, against the formula in numpy."""

import moderngl
import numpy as np
import pytest

from shapeshift.vr.see_through import SeeThrough


def light(display: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, of display values 0..1."""
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("from_array", [False, True])
def test_what_covers_half_lets_half_of_the_light_through(ctx, from_array):
    """A room of light behind it: what the compositor adds is alpha of the colour's own light."""
    rng = np.random.default_rng(3)
    alpha = rng.random((6, 9)).astype(np.float32)
    alpha[0], alpha[1], alpha[2, :4] = 0.0, 1.0, (1 / 512, 1 / 255, 0.02, np.float32(0.5))
    color = rng.random((6, 9, 3)).astype(np.float32)
    over_black = np.round(color * alpha[..., None] * 255).astype(np.uint8)
    framebuffer = ctx.framebuffer([ctx.texture((9, 6), 4)])
    rgba = np.dstack([over_black, np.full((6, 9), 255, np.uint8)])
    framebuffer.color_attachments[0].write(np.ascontiguousarray(rgba))
    given = np.ascontiguousarray(alpha[::-1]) if from_array else ctx.texture((9, 6), 4, dtype="f4")
    if not from_array:
        four = np.dstack([np.zeros((6, 9, 3), np.float32), alpha])
        given.write(np.ascontiguousarray(four))
        given.repeat_x = given.repeat_y = False
    made = SeeThrough(ctx)
    made.draw(framebuffer, given)
    shown = np.frombuffer(framebuffer.read(components=4, alignment=1), np.uint8).reshape(6, 9, 4)
    assert np.abs(shown[..., 3] - 255 * alpha).max() <= 0.51
    straight = np.clip(over_black / 255 / np.maximum(alpha, 1e-9)[..., None], 0, 1)
    straight[alpha <= 1 / 255] = 0.0
    # Half a step of the 8 bits that are written, where the display curve is steepest (12.92).
    wanted = light(straight) * alpha[..., None]
    steps = 255 * (
        np.where(wanted <= 0.0031308, 12.92 * wanted, 1.055 * wanted ** (1 / 2.4) - 0.055)
    )
    assert np.abs(shown[..., :3] - steps).max() <= 0.55
    assert not shown[0].any() and (shown[1, :, :3] == over_black[1]).all()
    made.release()
    assert ctx.error == "GL_NO_ERROR" and isinstance(framebuffer, moderngl.Framebuffer)
