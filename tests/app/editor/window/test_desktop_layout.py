"""The overlay in windows of several sizes and scales: what is drawn lies where the layout says."""

import time
from collections.abc import Callable
from pathlib import Path

import glfw
import numpy as np
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor import desktop
from shapeshift.app.editor.state.camera.framed import SETTLED_S
from shapeshift.app.editor.state.user.settings import ProgramSettings
from shapeshift.app.editor.window import monitor
from shapeshift.app.editor.window.two_pictures import splitting
from shapeshift.app.editor.window.window import Drag, Drop
from shapeshift.rasterizer.program import announce
from shapeshift.renderer.renderer import Renderer
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.real_hands import RealHands
from tests.support.desktop.widgets import Widgets, every_section

SIZES = [(800, 600), (1280, 720), (3840, 2160)]


def until(holds: Callable[[], bool], seconds: float = 20.0) -> bool:
    """Takes what the X server has to say until something holds; False where it never does."""
    end = time.monotonic() + seconds
    while not holds() and time.monotonic() < end:
        glfw.wait_events_timeout(0.02)
    return holds()


def resize(viewer, size: tuple[int, int]) -> None:
    """Another size of the window, as somebody drags its corner."""
    glfw.set_window_size(viewer.window.handle, *size)
    assert until(lambda: viewer.window.logical_size == size)
    run_frames(viewer, 4)
    while not np.array_equal(viewer.viewpoint.free, viewer.viewpoint.free_wanted()):
        run_frames(viewer, 5, seconds=0.1)
    run_frames(viewer, 2)


@pytest.fixture
def any_size(viewer):
    """A viewer whose window and text may be resized; the window is shared."""
    size = viewer.window.logical_size
    yield viewer
    viewer.window.text_size = 1.0
    resize(viewer, size)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("text_size", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("wanted", [None, True])
def test_nothing_lies_over_the_scenes_middle(any_size, size, text_size, wanted):
    """At the thermal stop, so that the legend is there; the ball's middle is the scene's."""
    viewer = any_size
    viewer.settings.panel_open = wanted
    viewer.state.set_x(0, 1.0)
    viewer.window.text_size = text_size
    resize(viewer, size)
    layout, view = viewer.layout, viewer.viewpoint.view()
    clip = view.clip_from_eye() @ view.eye_from_world() @ np.append(viewer.state.centre, 1.0)
    middle = (clip[:2] / clip[3] * (1, -1) + 1) / 2 * viewer.window.logical_size
    left, top, right, low = layout.free
    assert middle == pytest.approx([(left + right) / 2, (top + low) / 2], abs=1)
    seen = [box for box in (*viewer.window.covered, layout.legend) if box is not None]
    for box in seen:
        assert not (box[0] <= middle[0] <= box[2] and box[1] <= middle[1] <= box[3])


def ball_px(viewer) -> float:
    """Half of what the ball of a metre's radius is wide in the picture, logical pixels."""
    view = viewer.viewpoint.view()
    away = np.linalg.norm(view.world_from_eye.position - viewer.state.centre)
    per_pixel = (view.tangents[1] - view.tangents[0]) / viewer.window.logical_size[0]
    return float(np.tan(np.arcsin(1.04 / away)) / per_pixel)


def settle(viewer) -> None:
    """Until the scene has been fitted into a free part of another size."""
    time.sleep(1.2 * SETTLED_S)
    run_frames(viewer, 3)
    run_frames(viewer, 40, seconds=0.1)


@pytest.mark.parametrize("framed", ["first", "everything", "by hand"])
def test_what_no_hand_has_moved_is_fitted_into_any_window(any_size, framed):
    viewer = any_size
    if framed == "everything":
        viewer.viewpoint.frame_all()
    elif framed == "by hand":
        viewer.handle_event(Drag("left", 3, 0))
    run_frames(viewer, 40, seconds=0.1)
    distance = viewer.viewpoint.camera.distance
    for size in ((1900, 700), (700, 900), (1280, 720)):
        resize(viewer, size)
        settle(viewer)
        left, top, right, low = viewer.layout.free
        part = 2 * ball_px(viewer) / min(right - left, low - top)
        if framed == "by hand":
            assert viewer.viewpoint.camera.distance == pytest.approx(distance)
        else:
            assert 0.6 < part < 1.0  # whole, and not small


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("text_size", [1.0, 2.0])
def test_what_is_drawn_lies_where_the_layout_says(any_size, size, text_size):
    viewer = any_size
    viewer.window.text_size = text_size
    resize(viewer, size)
    layout, (panel, bar, status) = viewer.layout, viewer.window.covered
    assert panel[:3] == pytest.approx(layout.panel[:3], abs=1) and panel[3] <= layout.panel[3] + 1
    assert bar == pytest.approx(layout.bar, abs=8 * text_size)  # its own height, of its rows
    assert bar[1] >= layout.free[3] - 1 and status == pytest.approx(layout.status, abs=1)


def test_everything_of_the_panel_is_reached_at_800x600(any_size, monkeypatch):
    """Without scrolling, as the program opens."""
    viewer, widgets = any_size, Widgets(monkeypatch)
    resize(viewer, (800, 600))
    for label in ("Open\u2026", "Top", "Keys (F1)", "A+"):
        assert widgets.boxes[label][3] <= viewer.window.covered[0][3]


def test_the_text_grows_by_keys_and_is_kept(any_size, display, tmp_path):
    viewer = any_size
    viewer.settings.folder = tmp_path
    with RealHands(viewer, display) as hands:
        widths = [viewer.window.covered[0][2]]
        for _ in range(2):
            hands.key("equal", "Control_L")
            widths.append(viewer.window.covered[0][2])
        assert viewer.window.text_size == 1.25
        assert np.array(widths) / widths[0] == pytest.approx([1, 1.1, 1.25], abs=0.01)
        assert ProgramSettings.read(tmp_path).text_size == 1.25
        hands.key("minus", "Control_L")
        assert viewer.window.text_size == 1.1 and "110%" in viewer.state.messages.note
        hands.key("0", "Control_L")
        assert viewer.window.text_size == 1.0 and ProgramSettings.read(tmp_path).text_size is None
        assert viewer.window.covered[0][2] == pytest.approx(widths[0])
        assert viewer.state.scene.objects[0].x == 0.0  # no stop was meant


def test_another_size_and_back_leaves_the_same_picture(any_size):
    """Lengths of ImGui's style are made anew each time, not scaled from the last ones."""
    viewer = any_size

    def picture() -> np.ndarray:
        run_frames(viewer, 3)
        viewer.window.begin_frame()
        viewer.draw_splats()
        viewer.draw_overlay()
        viewer.window.end_frame()
        return viewer.window.picture().copy()

    before = picture()
    for text_size in (2.5, 0.75, 1.1, 1.0):
        viewer.window.text_size = text_size
        run_frames(viewer, 3)
    np.testing.assert_array_equal(picture(), before)


def test_the_panel_is_folded_and_opened_by_its_buttons(any_size, display, tmp_path, monkeypatch):
    viewer, widgets = any_size, Widgets(monkeypatch)
    viewer.settings.folder = tmp_path
    run_frames(viewer, 2)
    with RealHands(viewer, display) as hands:
        wide = viewer.layout.free
        hands.click(*widgets.middle("fold"))
        assert viewer.layout.folded and viewer.layout.free[0] == 0 < wide[0]
        assert ProgramSettings.read(tmp_path).panel_open is False
        run_frames(viewer, 3)
        hands.click(*widgets.middle("unfold"))
        assert not viewer.layout.folded and viewer.layout.free == wide
        assert ProgramSettings.read(tmp_path).panel_open is True


def test_settings_that_cannot_be_kept_are_said_once(any_size, display, tmp_path):
    viewer = any_size
    (tmp_path / "file").write_text("")
    viewer.settings.folder = tmp_path / "file"
    with RealHands(viewer, display) as hands:
        hands.key("equal", "Control_L")
        assert "cannot be kept" in viewer.state.problem
        viewer.state.problem = ""
        hands.key("0", "Control_L")
        assert viewer.state.problem == ""


def test_no_slider_of_the_panel_lies_over_its_number(any_size, monkeypatch):
    """The line of text ends above the bar with the knob."""
    from shapeshift.app.editor.panels import panel
    from shapeshift.app.editor.panels.sections import plain_sections, quality_panel
    from shapeshift.app.editor.panels.widgets import panel_rows

    monkeypatch.setattr(panel, "section", lambda *_, **__: True)
    every_section(monkeypatch)
    for module in (plain_sections, quality_panel):
        monkeypatch.setattr(module, "subsection", lambda *_, **__: True)
    lines: list[float] = []
    labels, plain = [], panel_rows.imgui.text_unformatted

    def text(words: str) -> None:
        plain(words)
        labels.append(panel_rows.imgui.get_item_rect_max().y)

    def bar(function):
        def call(label, *values, **named):
            done = function(label, *values, **named)
            lines.append(panel_rows.imgui.get_item_rect_min().y - labels[-1])
            return done

        return call

    monkeypatch.setattr(panel_rows.imgui, "text_unformatted", text)
    for kind in ("slider_float", "slider_int"):
        monkeypatch.setattr(panel_rows.imgui, kind, bar(getattr(panel_rows.imgui, kind)))
    run_frames(any_size, 1)
    assert len(lines) > 8 and min(lines) >= 0


# Two stops at once


@pytest.fixture
def split_viewer(any_size):
    viewer = any_size
    with splitting(
        viewer.window, viewer.state, viewer.hooks, viewer.free,
        lambda: Renderer(viewer.window.ctx, drawing="quads"),
    ):  # fmt: skip
        yield viewer


def test_two_stops_stand_side_by_side_with_a_knob_each(split_viewer, display, monkeypatch):
    viewer, widgets = split_viewer, Widgets(monkeypatch)
    state = viewer.state
    free = viewer.layout.free
    with RealHands(viewer, display) as hands:
        run_frames(viewer, 2)
        _, top, right, _ = viewer.window.covered[1]
        y = top + 12 + 46 * 0.68
        hands.click(right - 14 - 12, y)  # the button at the right end
        assert state.split.on and state.split.x == 1.0  # the thermal stop
        assert viewer.layout.left_legend and viewer.layout.free[0] > free[0]
        run_frames(viewer, 3)
        track = widgets.boxes["track"]
        ends = track[0] + 12, track[2] - 12
        hands.drag((ends[1], y), ((ends[0] + ends[1]) / 2 + 20, y))
        assert 0.4 < state.split.x < 0.65 and state.scene.objects[0].x == 0.0
        hands.drag((ends[0], y), (ends[0] + 40, y))
        assert state.scene.objects[0].x > 0.05 and 0.4 < state.split.x < 0.65
        before = viewer.viewpoint.view().eye_from_world()
        line = 0.5 * (viewer.layout.free[0] + viewer.layout.free[2])
        hands.drag((line, 200), (line - 120, 200))  # the line, not the camera
        np.testing.assert_array_equal(viewer.viewpoint.view().eye_from_world(), before)
        hands.key("c")
        assert not state.split.on


def test_right_of_the_line_is_the_picture_of_the_other_x(split_viewer):
    """Against a renderer that is given that x alone."""
    viewer = split_viewer
    viewer.state.overlay = False
    viewer.state.split.toggle(viewer.state.scene.objects[0])
    run_frames(viewer, 4)
    viewer.window.begin_frame()
    viewer.draw_splats()
    viewer.window.end_frame()
    picture = viewer.window.picture().copy()
    other = viewer.state.split.right(viewer.state.scene)
    window = viewer.window
    with Renderer(window.ctx, drawing="quads") as renderer:
        renderer.settings = viewer.renderer.settings
        renderer.update(other)
        view, (width, height) = viewer.viewpoint.view(), window.size
        renderer.draw([view], window.screen())
        whole = window.picture().astype(int)
        cut = viewer.hooks.beside(viewer.state.scene, width).cut
        renderer.draw([view.part(cut, 0, (width - cut, height))])
        window.screen().viewport = (cut, 0, width - cut, height)
        renderer.present(window.ctx.screen)
        alone = window.picture().copy()
    # The part is the whole's, but for the rounding of floats that begin at another column.
    assert np.abs(alone[:, cut:] - whole[:, cut:]).max() <= 1
    assert (alone[:, cut + 2 :] != alone[0, 0]).any()
    np.testing.assert_array_equal(picture[:, cut + 2 :], alone[:, cut + 2 :])
    assert (picture[:, : cut - 2] == picture[0, 0]).all()  # the stand-in renderer draws nothing


@pytest.mark.parametrize(
    ("times", "wanted"), [(1.0, None), (1.2, (1080, 768)), (9.0, (1280, 720)), (0.5, None)]
)
def test_a_window_grows_with_its_text_as_far_as_the_monitor_goes(any_size, times, wanted):
    """The X server's screen has 1280x720; 900x640 grows in both directions or not at all."""
    viewer = any_size
    before = viewer.window.logical_size
    handle = viewer.window.handle
    monitor.grow_window(handle, times)
    if wanted is None:
        assert not until(lambda: viewer.window.logical_size != before, seconds=0.2)
    else:
        wide, high = (min(a, b) for a, b in zip(wanted, (1280, 720), strict=True))
        assert until(lambda: viewer.window.logical_size == (wide, high))

        def in_the_middle() -> bool:
            left, top = glfw.get_window_pos(handle)
            return abs(2 * left + wide - 1280) <= 1 and abs(2 * top + high - 720) <= 1

        assert until(in_the_middle)
    glfw.set_window_pos(viewer.window.handle, 0, 0)


@pytest.mark.parametrize(
    ("place", "wanted", "smaller"),
    [
        ((10, 20, 900, 640), (10, 20, 900, 640), False),
        ((0, 0, 1280, 720), (0, 0, 1280, 720), False),  # the screen of the X server, exactly
        ((0, 0, 1281, 720), (0, 0, 1280, 720), True),
        ((0, 0, 1278, 721), (0, 0, 1278, 720), True),
        ((700, 300, 1000, 600), (280, 120, 1000, 600), False),  # half outside: moved, not shrunk
        ((100, 50, 3000, 2000), (0, 0, 1280, 720), True),
        # Of a monitor that went away: in the middle of the one that is left.
        ((5000, 300, 700, 500), (290, 110, 700, 500), False),
        ((-4000, -900, 2560, 1440), (0, 0, 1280, 720), True),
    ],
)
def test_a_window_is_no_larger_than_its_monitor(any_size, place, wanted, smaller):
    handle = any_size.window.handle
    assert monitor.put_window(handle, place) == smaller

    def there() -> bool:
        return (*glfw.get_window_pos(handle), *glfw.get_window_size(handle)) == wanted

    assert until(there)
    glfw.set_window_pos(handle, 0, 0)


def test_a_first_start_says_what_it_compiles(viewer, monkeypatch):
    """A card at once, another at a compiler that takes long, none after the first picture; input
    of meanwhile is the scene's.
    """
    window, shown = viewer.window, []
    monkeypatch.setattr(window, "swap", lambda: shown.append(window.picture().copy()))
    said = []
    draw = desktop.draw_opening

    def noted(size, lines, scale) -> None:
        said.append(lines)
        draw(size, lines, scale)

    monkeypatch.setattr(desktop, "draw_opening", noted)
    clock = [0.0]
    monkeypatch.setattr(desktop.time, "perf_counter", lambda: clock[0])
    with desktop.OpeningCard(window, "ball") as first:
        window.on_drop(window.handle, ["early.ply"])
        announce("one.cl")  # at once: a start that is nearly over
        clock[0] = desktop.SAY_AGAIN_S
        announce("two.cl")
        first.end()
        announce("three.cl")
    announce("four.cl")
    assert [lines[0] for lines in said[::2]] == [
        "Opening ball",
        "Preparing this graphics device, once",
    ]
    assert said[-1][1] == "Compiling two.cl (2 so far, 0 s)"
    opening, preparing = (picture.astype(int) for picture in shown)
    assert (opening != opening[0, 0]).any() and (opening != preparing).any()
    lit = np.argwhere((preparing != preparing[0, 0]).any(axis=2))
    assert (
        np.abs(
            (lit.min(axis=0) + lit.max(axis=0) + 1) / 2 - np.array(preparing.shape[:2]) / 2
        ).max()
        <= 1
    )
    assert Drop((Path("early.ply"),)) in window.begin_frame()
    imgui.end_frame()
    with desktop.OpeningCard(window, None):  # pictures for a file: nobody watches
        announce("five.cl")
    assert len(shown) == 2
