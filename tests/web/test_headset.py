"""The page in an emulated headset: both eyes, sticks, buttons, hands, the panel in the room."""

import numpy as np
import pytest
from support.web import emulated_headset as headset
from support.web.page_pictures import at, expected, write_page
from support.web.page_scenes import several_objects

from shapeshift.scene.metrics import psnr
from shapeshift.scene.scene import Scene

# 8-bit rounding alone leaves 58.9 dB of evenly spread values; 59.5 was measured before black.
LEAST_DB = 54
MOVED_M = 1e-4  # poses come as float32
HEAD = "shapeshift.headset.hands, shapeshift.headset.worldFromFloor"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def worn(browser, tmp_path_factory):
    """A page that is shown in the headset, and its Document; the tests here share both."""
    if not headset.SCRIPT.exists():
        pytest.skip("there is no emulated headset; bash tests/web/iwer.sh fetches it")
    document = several_objects()
    headset.install(browser)
    browser.open(write_page(document, tmp_path_factory.mktemp("page") / "page.html", exact=True))
    assert browser.message() == "" and not browser.complaints()
    # Bodies come from scene files; here one thing may be moved, and nothing falls.
    browser.run("shapeshift.renderer.objects[1].movable = true, shapeshift.grab.gravity = 0, 1")
    return browser, document


@pytest.fixture
def inside(worn):
    """In VR, full sharpness, the panel away, hands where they touch nothing."""
    page, document = worn
    headset.enter(page)
    page.run("shapeshift.headset.sharpness.automatic = false, shapeshift.headset.switchPanel(), 1")
    headset.away(page)
    yield page, document
    page.run("shapeshift.headset.leave(), 1")
    page.until("shapeshift.headset.session === null")
    assert not page.complaints()


def least_db(page, document, scene: Scene) -> float:
    """Of both eyes, each against the reference from its own pose; colours from the middle."""
    pictures, views = headset.eyes(page)
    middle = np.mean([view.world_from_eye.position for view in views], axis=0)
    wanted = [expected(document, scene, view, middle) for view in views]
    assert psnr(*wanted) < 40  # or the two could have been exchanged
    return min(psnr(*pair) for pair in zip(pictures, wanted, strict=True))


def position(page, number: int) -> np.ndarray:
    return np.array(page.run(f"shapeshift.renderer.objects[{number}].pose.position"))


def x_of(page, number: int):
    return page.run(f"shapeshift.renderer.objects[{number}].x")


def head(page) -> tuple[np.ndarray, float]:
    """(3,) world metres, and radians that it looks to the left of -z."""
    _, views = headset.eyes(page)
    forward = -views[0].world_from_eye.matrix()[:3, 2]
    eyes = np.mean([view.world_from_eye.position for view in views], axis=0)
    return eyes, float(np.arctan2(-forward[0], -forward[2]))


def test_both_eyes_see_what_they_should_from_where_they_are(inside):
    page, document = inside
    assert least_db(page, document, document.scene) >= LEAST_DB
    _, (left, right) = headset.eyes(page)
    apart = right.world_from_eye.position - left.world_from_eye.position
    assert np.linalg.norm(apart) == pytest.approx(0.063, abs=1e-4)
    view = document.view((320, 180)).world_from_eye  # nothing to stand on: where the page looked
    eyes, _ = head(page)
    assert np.allclose(eyes[[0, 2]], view.position[[0, 2]], atol=0.5)


def test_a_stick_moves_x_and_a_grip_goes_to_the_next_stop(inside):
    page, document = inside
    headset.push(page, "left", 1.0)
    page.until("shapeshift.renderer.objects[0].x > 0.15")
    headset.push(page, "left", 0.0)
    headset.wait(page)
    x = x_of(page, 0)
    headset.wait(page, 5)
    assert 0.15 < x < 0.6 and x_of(page, 0) == x  # it stays where the stick was let go
    assert least_db(page, document, at(document, x, x, x, x)) >= 40  # the hidden one is nowhere
    headset.press(page, "left", headset.SQUEEZE, 1)
    headset.press(page, "left", headset.SQUEEZE, 0)
    stop = 0.4 if x < 0.4 else 1.0
    page.until(f"shapeshift.renderer.objects[0].x === {stop} && !shapeshift.panel.shift")
