"""The overlay on software GL: drawn in parts it is the overlay drawn whole, and at rest nothing."""

import glfw
import numpy as np
import pytest
from imgui_bundle import imgui
from moderngl_window.integrations.imgui_bundle import ModernGLRenderer

from shapeshift.app.editor.window.window import KeyDown
from tests.support.desktop.desktop_stand import run_frames

STRIPES = [(0.1, 0.9, 0.4), (0.95, 0.2, 0.1), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, 0.4, 0.8)]


@pytest.fixture
def kept(viewer):
    presented = viewer.window.presented
    if not presented.keeps:
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
    """What a GPU would show of this frame: the picture, then moderngl-window's renderer over it."""
    window = viewer.window
    screen = window.screen()
    viewer.renderer.present(screen)
    kept, plain = window.presented.kept, object.__new__(ModernGLRenderer)
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
