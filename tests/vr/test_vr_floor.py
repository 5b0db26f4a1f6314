"""The floor of a headset: known pixels of its grid and horizon, behind splats, at any scale."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.scene.pose import Pose
from shapeshift.vr.floor import REST, Floor, Grid, clearness, spacing_of
from shapeshift.vr.play_space import PlaySpace
from tests.support.renderer.frames import texture_target
from tests.support.vr.vr_hands import HEAD, eyes, pixel_of

SIZE = (500, 450)
EYES = eyes(SIZE)
DARK, WHITE = (0.1, 0.1, 0.12), (1.0, 1.0, 1.0)
CLEAR = Grid(0.0, 1.0)
DOWN = eyes(SIZE, Pose(HEAD.position, np.array([np.cos(0.45), -np.sin(0.45), 0, 0])))  # 52 degrees


@pytest.fixture
def floor(ctx):
    with Floor(ctx) as made:
        yield made


@pytest.fixture
def target(ctx):
    with texture_target(ctx, SIZE) as made:
        yield made


def picture(
    floor, target, view=DOWN[0], play_space=None, coverage=None, grid=CLEAR, background=DARK
) -> np.ndarray:
    """(H, W, 4) uint8, row 0 on top."""
    target.clear(*background, 1.0)
    nothing = np.zeros((4, 4), np.float32)
    hidden = nothing if coverage is None else coverage
    floor.draw(target, view, play_space or PlaySpace(), hidden, grid, background)
    return np.frombuffer(target.read(components=4), np.uint8).reshape(*SIZE[::-1], 4)[::-1]


def light(image: np.ndarray) -> np.ndarray:
    """(H, W) how much brighter than the background."""
    return image[..., 0].astype(int) - round(DARK[0] * 255)


@pytest.mark.parametrize("eye", [0, 1])
def test_lines_are_where_the_floor_has_them(floor, target, eye):
    """At each metre of the world, where numpy projects it, and not between."""
    image = light(picture(floor, target, DOWN[eye]))
    on, off = [], []
    for x in range(-2, 3):
        for z in np.arange(-2.7, -0.3, 0.13):
            for kind, at in ((on, (x, 0.0, z)), (off, (x + 0.47, 0.0, np.floor(z) + 0.53))):
                row, column = pixel_of(DOWN[eye], np.array(at))
                if 1 <= row < SIZE[1] - 1 and 1 <= column < SIZE[0] - 1:
                    near = image[row - 1 : row + 2, column - 1 : column + 2]
                    kind.append(near.max())
    assert len(on) > 40 and len(off) > 40
    assert min(on) > 15 and max(off) < 10


def test_the_horizon_glows_and_the_sky_above_is_as_it_was(floor, target):
    image = light(picture(floor, target, EYES[0]))
    row, _ = pixel_of(EYES[0], HEAD.position + np.array([0.0, 0.0, -500.0]))
    assert image[row].mean() > 8
    assert np.abs(image[:20]).max() <= 1  # straight up no glow is left
    assert image[row - 40].mean() < image[row].mean() / 2


def test_it_is_never_a_void_and_clearer_while_one_moves(floor, target):
    resting = light(picture(floor, target, grid=replace(CLEAR, clearness=REST)))
    moving = light(picture(floor, target))
    assert 5 < resting.max() < moving.max()
    nothing = picture(floor, target, grid=replace(CLEAR, clearness=0.0))[..., 0]
    assert np.isin(nothing, [25, 26]).all()  # 0.1 is 25.5 of 255


def test_splats_hide_it_as_much_as_they_cover(ctx, floor, target):
    """By an array from the tiles, row 0 on top, and by a texture of the splatter, at the bottom."""
    covered = np.zeros((90, 100), np.float32)
    covered[:45, :50], covered[:45, 50:] = 1.0, 0.5  # the upper half
    bare, hidden = light(picture(floor, target)), light(picture(floor, target, coverage=covered))
    top, left = SIZE[1] // 2 - 5, SIZE[0] // 2 - 5
    assert np.abs(hidden[:top, :left]).max() <= 1  # 0.1 is 25.5 of 255, and `light` says 26
    np.testing.assert_array_equal(hidden[top + 10 :], bare[top + 10 :])
    half = hidden[:top, left + 10 :] - bare[:top, left + 10 :] / 2
    assert np.abs(half).max() <= 1.01
    rgba = np.zeros((90, 100, 4), np.float32)
    rgba[..., 3] = covered[::-1]
    texture = ctx.texture((100, 90), 4, rgba.tobytes(), dtype="f4")
    texture.repeat_x = texture.repeat_y = False
    np.testing.assert_array_equal(light(picture(floor, target, coverage=texture)), hidden)
    texture.release()


def test_on_a_bright_background_lines_are_darker(floor, target):
    image = picture(floor, target, EYES[0], background=WHITE)[..., :3].astype(int)
    assert image.max() == 255 and image.min() < 230
    dark = light(picture(floor, target, EYES[0]))
    np.testing.assert_allclose(255 - image[..., 0], dark, atol=1)


def test_alpha_stays(floor, target):
    assert (picture(floor, target)[..., 3] == 255).all()


def test_the_context_is_as_it_was(ctx, floor, target):
    other = ctx.framebuffer([ctx.texture((8, 8), 4)])
    other.use()
    picture(floor, target)
    assert ctx.fbo is other and ctx.error == "GL_NO_ERROR"
    picture(floor, target, background=WHITE)  # takes light away
    assert light(picture(floor, target)).max() > 20, "and gives it again"
    target.use()
    other.color_attachments[0].release()
    other.release()


@pytest.mark.parametrize("away", [(100.0, 0.0, -300.0), (9000.0, 0.0, 4000.0)])
def test_far_from_the_origin_it_is_the_same(floor, target, away):
    """A hundred metres are a multiple of all lines."""
    there = PlaySpace(Pose(np.array(away), np.array([1.0, 0, 0, 0])))
    difference = light(picture(floor, target)) - light(picture(floor, target, play_space=there))
    assert np.abs(difference).max() <= 1


def test_the_grid_stays_with_the_world_as_one_walks(floor, target):
    """Half a metre on its lines lie between those of before; a whole one, where they lay."""
    start = light(picture(floor, target))

    def after(metres: float) -> np.ndarray:
        return light(
            picture(floor, target, play_space=PlaySpace(Pose(np.array([metres, 0, 0]), LEVEL)))
        )

    assert np.abs(after(0.5) - start).max() > 25
    ten = np.abs(after(10.0) - start)
    assert ten.max() <= 1


LEVEL = np.array([1.0, 0, 0, 0])


def test_no_line_jumps_while_the_world_is_scaled(floor, target):
    """Across a power of ten the lines of a tenth take over from those that were fine."""
    for edge in (0.1, 1.0, 10.0):
        low, high = (
            light(picture(floor, target, play_space=PlaySpace(scale=edge * factor)))
            for factor in (1 - 1e-6, 1 + 1e-6)
        )
        assert np.abs(low - high).max() <= 2
    assert spacing_of(1.0) == (10.0, 1.0)
    spacing, finer = spacing_of(0.5)
    assert spacing == pytest.approx(1.0) and 0 < finer < 1


def test_from_below_and_at_the_level_itself_nothing_breaks(floor, target):
    for level in (3.0, 1.6, 1.6 + 1e-7):
        image = picture(floor, target, EYES[0], grid=Grid(level, 1.0))
        assert (image[..., 3] == 255).all() and light(image).max() < 160


def test_clearness_rises_at_once_and_falls_slowly():
    here, there = PlaySpace(), PlaySpace(Pose(np.array([0.1, 0, 0]), LEVEL))
    rising = REST
    for _ in range(18):  # a fifth of a second
        rising = clearness(rising, here, there, 1 / 90)
    assert rising > 0.9
    falling = clearness(rising, there, there, 0.35)
    assert REST < falling < rising and clearness(falling, there, there, 10.0) == pytest.approx(REST)
    for moved in (replace(here, scale=2.0), PlaySpace(Pose(np.zeros(3), np.array([0, 1.0, 0, 0])))):
        assert clearness(REST, here, moved, 0.1) > 0.7
    assert clearness(REST, here, there, 0.0) == clearness(REST, here, there, -1.0) == REST
