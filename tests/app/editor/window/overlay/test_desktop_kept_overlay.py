"""The overlay on software GL: drawn in parts it is the overlay drawn whole, and at rest nothing."""

import glfw
import numpy as np
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.overlay_renderer import OverlayRenderer
from shapeshift.app.editor.window.window import KeyDown
from shapeshift.rasterizer.resolve import WindowOverlay
from shapeshift.rasterizer.resolve import resolve as resolve_bytes
from shapeshift.renderer.gl.gpu import Gpu
from shapeshift.renderer.gl.resolve import Resolve
from tests.support.desktop.desktop_stand import run_frames
from tests.support.renderer.rasterizer_scenes import device

STRIPES = [(0.1, 0.9, 0.4), (0.95, 0.2, 0.1), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, 0.4, 0.8)]


@pytest.fixture
def kept(viewer):
    presented = viewer.window.presented
    if presented.kept is None:
        pytest.skip("GL runs on a GPU here, which keeps no picture")
    return presented.kept


@pytest.fixture
def swaps(monkeypatch):
    """How often something came to the screen."""
    count = []
    swap = glfw.swap_buffers
    monkeypatch.setattr(glfw, "swap_buffers", lambda handle: (count.append(1), swap(handle)))
    return count


def stripes(viewer, monkeypatch) -> None:
    """The picture under the overlay is of several colours."""

    def present(framebuffer, i: int = 0) -> None:
        width, height = viewer.window.size
        for row in range(0, height, 23):
            framebuffer.clear(*STRIPES[row // 23 % 5], viewport=(0, row, width, 23))

    monkeypatch.setattr(viewer.renderer, "present", present)
    viewer.shown.forget()
    run_frames(viewer, 2)


def overlay_drawn_at_once(viewer) -> np.ndarray:
    """What a GPU would show of this frame: the picture, then the overlay over it."""
    window = viewer.window
    screen = window.screen()
    viewer.renderer.present(screen)
    kept, plain = window.presented.kept, object.__new__(OverlayRenderer)
    plain.__dict__.update(kept.__dict__)  # its program, buffers, and textures
    screen.use()
    plain.render(imgui.get_draw_data())
    picture = window.presented.read().astype(int)
    viewer.shown.forget()
    return picture


def test_it_looks_as_if_it_were_drawn_over_the_picture(viewer, kept, monkeypatch):
    stripes(viewer, monkeypatch)
    picture = viewer.window.picture().astype(int)
    at_once = overlay_drawn_at_once(viewer)
    bare = np.abs(at_once - stripes_alone(viewer)).max(axis=2) == 0
    assert 0.3 < bare.mean() < 0.9, "both must be there, picture and overlay"
    np.testing.assert_array_equal(picture[bare], at_once[bare])
    # A layer of 8 bits is rounded once more for each of what lies over another.
    assert np.abs(picture - at_once).max() <= 2


def stripes_alone(viewer) -> np.ndarray:
    viewer.renderer.present(viewer.window.screen())
    return viewer.window.presented.read().astype(int)


def test_drawn_in_parts_it_is_the_same_to_the_bit(viewer, kept, monkeypatch):
    """Against the whole: each frame again with nothing taken over from the one before."""
    stripes(viewer, monkeypatch)
    window, rng = viewer.window, np.random.default_rng(3)
    handle, drawn, partly, wholes = window.handle, [], 0, 0
    draw = kept.draw_boxes
    monkeypatch.setattr(
        kept, "draw_boxes", lambda lists, boxes: (drawn.append(boxes), draw(lists, boxes))
    )
    whole = [(0, 0, *window.size)]
    for step in range(30):
        window.on_cursor(handle, *(rng.uniform((10, 20), (300, 620)).tolist()))
        if step % 7 == 3:
            window.on_scroll(handle, 0.0, float(rng.choice([-3.0, 3.0])))
        if step % 5 == 4:
            viewer.state.say(f"step {step}")
        if step % 6 == 5:
            viewer.handle_event(KeyDown(glfw.KEY_RIGHT, False))
        if step == 20:
            viewer.shell.keys_open = True
        if step == 25:
            viewer.shell.keys_open = False
        drawn.clear()
        run_frames(viewer, 1)
        parts = window.picture().copy()
        partly, wholes = partly + (len(drawn) > 0), wholes + (whole in drawn)
        kept.forget()
        viewer.renderer.present(window.screen())
        window.presented.keep_picture()
        window.presented.lay_over(imgui.get_draw_data())
        np.testing.assert_array_equal(window.picture(), parts, f"step {step}")
        assert drawn[-1] == whole
    assert wholes == 0 and partly > 15, "nothing was drawn in parts"


def test_what_stays_as_it_is_does_not_come_to_the_screen_again(viewer, kept, swaps):
    viewer.window.on_cursor(viewer.window.handle, 600, 300)
    run_frames(viewer, 4)
    swaps.clear()
    before = viewer.renderer.presents
    picture = viewer.window.picture().copy()
    run_frames(viewer, 3)
    assert not swaps and viewer.renderer.presents == before
    np.testing.assert_array_equal(viewer.window.picture(), picture)
    viewer.window.expose()
    run_frames(viewer, 1)
    assert len(swaps) == 1, "another window was over it"
    viewer.state.say("something new")
    run_frames(viewer, 1)
    assert len(swaps) == 2 and viewer.renderer.presents == before


def test_another_background_needs_no_splats_but_another_picture(viewer, kept):
    from dataclasses import replace

    run_frames(viewer, 2)
    draws, presents = viewer.renderer.draws, viewer.renderer.presents
    viewer.state.settings = replace(viewer.state.settings, background=(0.0, 0.5, 1.0))
    run_frames(viewer, 2)
    assert (viewer.renderer.draws, viewer.renderer.presents) == (draws, presents + 1)
    height, width = viewer.window.picture().shape[:2]
    assert viewer.window.picture()[height // 3, width * 2 // 3].tolist() == [0, 128, 255]


def test_what_is_drawn_over_the_picture_goes_when_it_is_drawn_no_more(viewer, kept):
    run_frames(viewer, 2)
    before, presents = viewer.window.picture().copy(), viewer.renderer.presents
    box = (500, 300, 80, 40)  # of GL: from below

    def over(request) -> None:
        viewer.window.screen().clear(1.0, 0.0, 1.0, viewport=box)

    viewer.hooks.over.append(over)
    run_frames(viewer, 1)
    seen = viewer.window.picture().copy()
    run_frames(viewer, 1)
    np.testing.assert_array_equal(viewer.window.picture(), seen)
    viewer.hooks.over.remove(over)
    run_frames(viewer, 1)
    changed = (seen != before).any(axis=2)
    rows, columns = np.nonzero(changed)
    low = viewer.window.size[1] - box[1]
    assert (columns.min(), columns.max()) == (500, 579)
    assert (rows.min(), rows.max()) == (low - 40, low - 1) and changed.sum() == 80 * 40
    np.testing.assert_array_equal(viewer.window.picture(), before)
    assert viewer.renderer.presents == presents


def takes_bytes(viewer, monkeypatch, taken: list) -> np.ndarray:
    """The picture under the overlay comes as bytes, as tiles make them; whoever takes it is noted.

    Returns it, (H, W, 4) premultiplied.
    """
    window = viewer.window
    width, height = window.size
    rng = np.random.default_rng(7)
    image = rng.uniform(0, 1, (height, width, 4)).astype(np.float32)
    image[..., 3] = 1
    resolve = Resolve(Gpu(window.ctx))

    def present(framebuffer, i: int = 0) -> None:
        def taker(make, target) -> bool:
            waits = viewer.renderer.taker is not None and viewer.renderer.taker(make, target)
            taken.append(waits)
            return waits

        def make(as_window: bool = False, overlay: WindowOverlay | None = None) -> np.ndarray:
            return resolve_bytes(device(), image, (0, 0, 0), as_window=as_window, overlay=overlay)

        resolve.copy(make, framebuffer, taker)

    monkeypatch.setattr(viewer.renderer, "present", present)
    viewer.shown.forget()
    return image


def test_a_picture_of_bytes_has_the_overlay_before_gl_has_either(viewer, kept, monkeypatch):
    """Drawn anew in every frame, it is what the kept layer makes of the same picture, to the bit,
    while the overlay changes in parts.
    """
    taken: list[bool] = []
    image = takes_bytes(viewer, monkeypatch, taken)
    window, rng = viewer.window, np.random.default_rng(5)
    by_gl = viewer.renderer.taker
    for step in range(16):
        window.on_cursor(window.handle, *(rng.uniform((10, 20), (300, 620)).tolist()))
        if step % 7 == 3:
            window.on_scroll(window.handle, 0.0, float(rng.choice([-3.0, 3.0])))
        if step % 5 == 4:
            viewer.state.say(f"step {step}")
        if step == 9:
            viewer.shell.keys_open = True
        if step % 3:  # between them frames in which only the overlay changes
            viewer.shown.forget()
            taken.clear()
        run_frames(viewer, 1)
        assert taken[-1]
        at_once = window.picture().copy()
        viewer.renderer.taker = None  # GL has the picture first, then lays the layer over it
        viewer.renderer.present(window.screen())
        window.presented.lay_over(imgui.get_draw_data())
        viewer.renderer.taker = by_gl
        np.testing.assert_array_equal(window.picture(), at_once, f"step {step}")
    viewer.shell.keys_open = False
    run_frames(viewer, 2)
    bare = (window.picture() == (255 * image[..., :3] + 0.5).astype(np.uint8)).all(axis=2)
    assert 0.3 < bare.mean() < 0.9, "both must be there, picture and overlay"


def test_who_draws_over_a_picture_of_bytes_finds_it_in_the_window(viewer, kept, monkeypatch):
    taken: list[bool] = []
    takes_bytes(viewer, monkeypatch, taken)
    run_frames(viewer, 1)
    before = viewer.window.picture().copy()
    box = (500, 300, 80, 40)  # of GL: from below
    seen = []

    def over(request) -> None:
        seen.append(viewer.window.picture().copy())
        viewer.window.screen().clear(1.0, 0.0, 1.0, viewport=box)

    viewer.hooks.over.append(over)
    viewer.shown.forget()
    run_frames(viewer, 1)
    picture = viewer.window.picture().copy()
    run_frames(viewer, 2)  # not drawn anew, and then not even presented
    np.testing.assert_array_equal(viewer.window.picture(), picture)
    viewer.hooks.over.remove(over)
    assert taken[:2] == [True, True]
    low = viewer.window.size[1] - box[1]
    hidden = viewer.window.picture()[low - 40 : low, 500:580]
    assert (hidden == (255, 0, 255)).all()
    outside = (viewer.window.picture() == before).all(axis=2)
    outside[low - 40 : low, 500:580] = True
    assert outside.all()
    np.testing.assert_array_equal(seen[0][low - 40 : low, 500:580], before[low - 40 : low, 500:580])
    viewer.shown.forget()
    run_frames(viewer, 1)
    np.testing.assert_array_equal(viewer.window.picture(), before)


def test_half_of_a_window_is_copied_at_once(viewer, kept):
    """A part of it is not all that the overlay lies over."""
    screen, (width, height) = viewer.window.screen(), viewer.window.size
    black = np.zeros((height, width, 4), np.uint8)
    screen.viewport = (0, 0, width // 2, height)
    assert not viewer.window.presented.take_picture(lambda **_: black[:, : width // 2], screen)
    screen.viewport = (0, 0, width, height)
    assert viewer.window.presented.take_picture(lambda **_: black, screen)
    assert (viewer.window.picture() == 0).all()
