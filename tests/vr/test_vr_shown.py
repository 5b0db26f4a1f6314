"""An eye's picture on its way into the runtime's image: known colours, encoded and linear."""

import moderngl
import numpy as np
import pytest

from shapeshift.scene.pose import View
from shapeshift.scene.scene import IDENTITY
from shapeshift.vr.openxr.graphics import FORMATS, choose_format, read_color
from shapeshift.vr.shown import (
    WHOLE,
    Blit,
    Inset,
    draw_eye,
    middle,
    part_of_whole,
    pixels_of,
)

SIZE = (64, 48)
GL_SRGB8_ALPHA8, GL_FRAMEBUFFER_SRGB = 0x8C43, 0x8DB9
COVER = """#version 430
const vec2 CORNERS[3] = vec2[](vec2(-1, -1), vec2(3, -1), vec2(-1, 3));
void main() { gl_Position = vec4(CORNERS[gl_VertexID], 0, 1); }
"""
SAMPLE = """#version 430
uniform sampler2D image; out vec4 seen;
void main() { seen = texelFetch(image, ivec2(gl_FragCoord.xy), 0); }
"""
SAMPLES = np.array(
    [[0, 0, 0], [1, 2, 3], [10, 11, 12], [127, 128, 129], [200, 100, 50], [254, 255, 255]],
    np.uint8,
)


def light(display: np.ndarray) -> np.ndarray:
    """The slow twin: IEC 61966-2-1, value by value, of 0..1."""
    flat = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in display.ravel()]
    return np.array(flat).reshape(display.shape)


@pytest.fixture
def shown(ctx):
    made = Blit(ctx)
    yield made
    made.release()


def picture(ctx) -> tuple[moderngl.Texture, np.ndarray]:
    """A texture of all samples, row 0 at the bottom, and the same as (H, W, 3) display 0..1."""
    rng = np.random.default_rng(0)
    pixels = SAMPLES[rng.integers(0, len(SAMPLES), SIZE[::-1])]
    rgba = np.dstack([pixels, np.full(SIZE[::-1], 255, np.uint8)])
    return ctx.texture(SIZE, 4, rgba.tobytes()), pixels[::-1] / 255


def sampled(ctx, texture: moderngl.Texture) -> np.ndarray:
    """What the GPU takes the texture's values for, as a compositor does: (H, W, 3), row 0 on top.

    moderngl says nothing of an internal format when it reads: this shader samples.
    """
    program = ctx.program(vertex_shader=COVER, fragment_shader=SAMPLE)
    target = ctx.framebuffer([ctx.texture(SIZE, 4, dtype="f4")])
    target.use()
    texture.use(0)
    ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    return read_color(target)


@pytest.mark.parametrize("left_on", [False, True])
def test_an_srgb_image_holds_the_bytes_and_means_their_light(ctx, shown, left_on):
    texture, display = picture(ctx)
    image = ctx.texture(SIZE, 4, internal_format=GL_SRGB8_ALPHA8)
    if left_on:  # a runtime may leave the conversion switched on
        ctx.enable_direct(GL_FRAMEBUFFER_SRGB)
    target = ctx.framebuffer([image])
    shown.draw(texture, target)
    ctx.disable_direct(GL_FRAMEBUFFER_SRGB)
    data = target.read(components=3, alignment=1)
    found = np.frombuffer(data, np.uint8).reshape(SIZE[1], SIZE[0], 3)[::-1]
    np.testing.assert_array_equal(found, np.round(display * 255))
    np.testing.assert_allclose(sampled(ctx, image), light(display), atol=2e-3)


def test_a_linear_image_holds_light(ctx, shown):
    texture, display = picture(ctx)
    image = ctx.texture(SIZE, 4, dtype="f4")
    target = ctx.framebuffer([image])
    shown.draw(texture, target, linear=True)
    np.testing.assert_allclose(read_color(target), light(display), atol=1e-5)
    np.testing.assert_allclose(sampled(ctx, image), light(display), atol=1e-5)


def test_a_part_is_what_the_mirror_shows(ctx, shown):
    texture, display = picture(ctx)
    into = (20, 48)
    part = middle(SIZE, into)
    target = ctx.framebuffer([ctx.texture(into, 4)])
    shown.draw(texture, target, part)
    np.testing.assert_allclose(read_color(target), display[:, 22:42], atol=1 / 255)


def test_a_part_of_the_same_pixels_is_interpolated(ctx, shown):
    """The middle at twice its size, into as many pixels as the whole has."""
    texture, display = picture(ctx)
    target = ctx.framebuffer([ctx.texture(SIZE, 4, dtype="f4")])
    shown.draw(texture, target, (0.25, 0.25, 0.5, 0.5))
    wanted = display
    for axis, count in enumerate(display.shape[:2]):
        place = (np.arange(count) + 0.5) / 2 + count / 4 - 0.5  # pixels of the texture, from 0
        below = np.floor(place).astype(int)
        part = (place - below).reshape([-1 if i == axis else 1 for i in range(3)])
        wanted = (1 - part) * wanted.take(below, axis) + part * wanted.take(below + 1, axis)
    np.testing.assert_allclose(read_color(target), wanted, atol=2 / 255)  # 8 bits of a weight


def test_the_middle_has_the_shape_of_the_window():
    assert middle((64, 48), (64, 48)) == WHOLE
    for into in ((100, 10), (10, 100), (7, 7), (64, 47)):
        left, bottom, width, height = middle((64, 48), into)
        assert left + width / 2 == pytest.approx(0.5) and bottom + height / 2 == pytest.approx(0.5)
        assert max(width, height) == 1 and min(width, height) > 0
        assert 64 * width / (48 * height) == pytest.approx(into[0] / into[1])


def test_display_values_are_wanted_first_and_light_only_with_enough_bits():
    every = [each.gl for each in FORMATS]
    assert choose_format(every).name == "SRGB8_ALPHA8"
    assert choose_format([0x8058, 0x881A]).name == "RGBA16F"
    assert choose_format([0x8058, 0x1234]).name == "RGBA8"
    assert choose_format(every, "RGBA8").linear
    assert not choose_format(every).linear
    with pytest.raises(ValueError, match=r"no format of ours among the runtime's \(0x1234\)"):
        choose_format([0x1234])
    with pytest.raises(ValueError, match="no format of RGBA16 among"):
        choose_format([0x8C43], "RGBA16")


def test_an_inset_lies_in_its_place_over_an_eye_s_picture(ctx, shown):
    """Blocks of one colour each: where one ends and the other begins is counted in pixels."""
    wide = ctx.texture((32, 24), 4, bytes([0, 0, 255, 255]) * (32 * 24))
    fine = ctx.texture((40, 40), 4, bytes([255, 0, 0, 255]) * (40 * 40))
    target = ctx.framebuffer([ctx.texture((64, 48), 4)])
    draw_eye(shown, target, (64, 48), wide, Inset(fine, (0.25, 0.5, 0.5, 0.25)))
    seen = read_color(target)
    red = (seen == (1, 0, 0)).all(-1)
    wanted = np.zeros((48, 64), bool)
    wanted[48 - 36 : 48 - 24, 16:48] = True  # from below 0.5 to 0.75, rows on top first
    np.testing.assert_array_equal(red, wanted)
    assert (seen[~red] == (0, 0, 1)).all()
    draw_eye(shown, target, (64, 48), wide)
    assert (read_color(target) == (0, 0, 1)).all()


def test_an_inset_is_cut_where_the_window_is():
    """A window half as wide shows the middle half: what is left of it has negative pixels."""
    seen = middle((200, 100), (100, 100))
    assert seen == (0.25, 0.0, 0.5, 1.0)
    assert pixels_of((0.25, 0.5, 0.5, 0.25), seen, (100, 100)) == (0, 50, 100, 25)
    assert pixels_of((0.0, 0.0, 0.5, 0.5), seen, (100, 100)) == (-50, 0, 100, 50)
    assert pixels_of((0.5, 0.5, 1e-9, 1e-9), seen, (100, 100)) == (50, 50, 1, 1)


def test_a_part_lies_where_its_tangents_say():
    whole = View(IDENTITY, (-0.9, 0.6, -0.7, 0.8), 0.05, 50.0, (150, 150))
    assert part_of_whole(whole) is None
    part = whole.part(30, 45, (60, 15))
    assert part_of_whole(part) == pytest.approx((0.2, 0.6, 0.4, 0.1))
    assert part_of_whole(whole.part(0, 0, (150, 150))) == pytest.approx(WHOLE)
