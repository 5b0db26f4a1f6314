"""How the headset's panel looks: letters and targets in degrees, and its pixels.

python -m pytest tests/app/headset/test_panel_look.py --regenerate     writes it anew; look at it
"""

import math
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image, ImageFont

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.headset.panel_picture import PANEL, UI_SCALE, UNITS, PanelPicture
from tests.support.vr.vr_panel import Wearer, a_state, some_things

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "panel.png"
ONE_STEP = 1.01 / 255  # half of it is the rounding to 8 bits
ARM_M = 0.6  # from the eyes to a panel that the hand holds away from the body
CAPITAL_DEG, TARGET_DEG = 1.0, 2.0  # at least


def degrees(height_m: float, away_m: float = ARM_M) -> float:
    """The angle under which a height is seen, straight ahead."""
    return math.degrees(2 * math.atan(height_m / 2 / away_m))


def pixels(texture: moderngl.Texture) -> np.ndarray:
    """(H, W, 4) uint8, row 0 on top."""
    picture = np.frombuffer(texture.read(), np.uint8)
    return picture.reshape(texture.height, texture.width, 4)[::-1]


@pytest.fixture
def picture(ctx):
    made = PanelPicture(ctx)
    yield made
    made.release()


def capital_m() -> float:
    """Metres of an upright capital, from the font's own outlines by another reader of fonts."""
    large = ImageFont.truetype(str(theme.FONT), 1000)
    _, top, _, low = large.getbbox("H")
    ascent, descent = large.getmetrics()
    # ImGui's size of a font is from its ascent to its descent.
    em_m = theme.FONT_SIZE * UI_SCALE * PANEL.metres_per_pixel * 1000 / (ascent + descent)
    return em_m * (low - top) / 1000


def test_capitals_are_a_degree_high_at_arms_length(picture):
    """Against rendered pixels too: the button "Exit" begins with a capital."""
    assert degrees(capital_m()) >= CAPITAL_DEG
    Wearer(picture)
    per_pixel = picture.texture.width / PANEL.size[0]
    assert picture.texture.width == 2 * UNITS[0], "software GL draws two pixels a unit"
    left, top, right, low = (round(v * per_pixel) for v in picture.boxes["Exit"])
    button = pixels(picture.texture)[top + 4 : low - 4, left + 10 : right - 10, :3].astype(int)
    rows = np.nonzero((button.max(axis=2) > 130).any(axis=1))[0]
    tall_m = (rows[-1] - rows[0] + 1) / per_pixel * PANEL.metres_per_pixel
    pixel_m = PANEL.metres_per_pixel / per_pixel
    assert tall_m == pytest.approx(capital_m(), abs=2 * pixel_m)  # its i has a dot, its edges blur


def test_all_that_can_be_hit_is_two_degrees_high_at_arms_length(picture):
    """As far as it reaches for a ray: items answer `BEYOND` beyond their edges."""
    wearer = Wearer(picture)
    beyond = theme.BEYOND[1] * UI_SCALE
    seen = set()
    for section in ("Room", "Touch", "Stops", "Look", "Objects"):
        for label, (_, top, _, low) in picture.boxes.items():
            height_m = (low - top + 2 * beyond) * PANEL.metres_per_pixel
            assert degrees(height_m) >= TARGET_DEG, label
            seen.add(label)
        if section in ("Room", "Touch"):
            wearer.press(section)  # folded: the next ones come into sight
        elif section in wearer.labels():
            wearer.press(section)
            wearer.scroll()
    assert len(seen) > 25, sorted(seen)


@pytest.mark.parametrize("label", ["Exit", "Room", "grid on the floor", "+", "track"])
def test_items_answer_a_little_beyond_their_edges_and_not_farther(picture, label):
    wearer = Wearer(picture)
    left, top, right, low = picture.boxes[label]
    reach = theme.BEYOND[1] * UI_SCALE
    x = (left + right) / 2
    wearer.point((x, (top + low) / 2))
    item = picture.hovered
    assert item != 0
    wearer.point((x, low + reach - 1.5))
    assert picture.hovered == item
    wearer.point((x, low + reach + 1.5))
    assert picture.hovered != item


def test_the_panel_is_opaque_to_its_last_letter(picture):
    """Letters have soft edges; what lies behind the panel must not shine through them."""
    Wearer(picture)
    assert pixels(picture.texture)[..., 3].min() == 255


def test_the_scale_of_a_thermal_stop_comes_with_it(picture):
    editor = some_things()
    editor.chosen = "leg"
    wearer = Wearer(picture, a_state(editor))
    assert "Scale" not in wearer.labels()
    before = colourful(pixels(picture.texture))
    editor.set_x(2, 1.0)
    wearer.wait()
    assert "Scale" in wearer.labels()
    assert (
        colourful(pixels(picture.texture)) > before + 1000
    )  # 16 x 80 units of the palette, half of it bluish


def colourful(picture: np.ndarray) -> int:
    """Pixels that are neither grey nor the accent's."""
    red, _, blue, _ = picture.astype(int).transpose(2, 0, 1)
    return int((blue > red + 30).sum())


def test_the_picture_is_the_golden_one(ctx, picture, request):
    if "llvmpipe" not in ctx.info["GL_RENDERER"]:
        pytest.skip(f"golden images need llvmpipe, this is {ctx.info['GL_RENDERER']}")
    editor = some_things()
    editor.chosen = "leg"
    wearer = Wearer(picture, a_state(editor))
    editor.set_x(2, 0.4)
    wearer.state.touch.reactions.append("leg: struck, now warm")
    wearer.wait()
    wearer.point(wearer.middle("Put back"))
    wearer.point(wearer.middle("Put back"))
    now = pixels(picture.texture)[..., :3]
    if request.config.getoption("--regenerate"):
        Image.fromarray(now).save(GOLDEN, optimize=True)
    golden = np.asarray(Image.open(GOLDEN))
    assert now.shape == golden.shape
    worst = np.abs(now.astype(float) - golden).max() / 255
    assert worst < ONE_STEP, f"{GOLDEN.name} differs by {worst * 255:.1f} of 255; look at both"
