"""The window's own loop: at rest it draws nothing, hidden it sleeps and no time passes."""

import glfw
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.state.camera.camera import EditorCamera
from shapeshift.app.editor.window.viewer import SLEEP_S
from shapeshift.app.editor.window.window import HIDDEN_S, KeyDown
from tests.support.desktop.desktop_stand import run_frames

WAITS = 40  # rounds of the loop that are looked at
NORMAL, ICONIC = 1, 3  # WM_STATE, ICCCM 4.1.3.1


class Rounds:
    """Lets the loop go round so often, with waits cut short, and then closes the window.

    `asked`: how long it wanted to sleep in each round; a round that sleeps is not waited out, so
    that nothing here is a matter of time.
    """

    def __init__(self, viewer, monkeypatch) -> None:
        self.viewer, self.asked, self.rounds = viewer, [], 0
        wait, sleep = viewer.window.wait, glfw.wait_events_timeout
        viewer.hooks.closing.clear()
        for device in (viewer.devices.pads, viewer.devices.mice):
            device.read = lambda: None  # one that is plugged in here is looked at more often

        def short(seconds: float) -> None:
            self.asked.append(seconds)
            sleep(1e-3)

        def counted(seconds: float) -> bool:
            self.rounds += 1
            if self.rounds >= WAITS:
                viewer.window.close()
            return wait(seconds)

        monkeypatch.setattr(glfw, "wait_events_timeout", short)
        monkeypatch.setattr(viewer.window, "wait", counted)

    def go(self) -> tuple[int, int, int]:
        """Frames, splats drawn and splats shown again, of these rounds."""
        viewer, self.asked, self.rounds = self.viewer, [], 0
        before = self._counts()
        viewer.loop()
        viewer.window.keep_open()
        now = self._counts()
        return now[0] - before[0], now[1] - before[1], now[2] - before[2]

    def _counts(self) -> tuple[int, int, int]:
        renderer = self.viewer.renderer
        return self.viewer.frames, renderer.draws, renderer.presents


@pytest.fixture
def rounds(viewer, monkeypatch):
    made = Rounds(viewer, monkeypatch)
    yield made
    glfw.show_window(viewer.window.handle)


def settle(viewer) -> None:
    """Input that other tests have left is handed out, a mouse that has come to rest included."""
    glfw.set_cursor_pos_callback(viewer.window.handle, lambda *_: None)
    while viewer.window.wait(0.4):
        viewer.frame(0.0)
    glfw.set_cursor_pos_callback(viewer.window.handle, viewer.window.on_cursor)


def test_without_events_no_frame_is_drawn_and_each_round_sleeps(viewer, monkeypatch):
    settle(viewer)
    rounds = Rounds(viewer, monkeypatch)
    assert rounds.go() == (0, 0, 0)
    # as long as ever at a time: by glfw's clock the last part of a tooltip's wait may be cut off
    assert len(rounds.asked) == WAITS and set(rounds.asked) == {SLEEP_S}


def test_an_event_draws_the_overlay_and_then_it_rests_again(viewer, monkeypatch):
    settle(viewer)
    rounds = Rounds(viewer, monkeypatch)
    viewer.window.on_key(viewer.window.handle, glfw.KEY_F9, 0, glfw.PRESS, 0)  # a key of nothing
    frames, draws, presents = rounds.go()
    assert 0 < frames < WAITS / 2 and draws == 0
    assert presents == (0 if viewer.window.presented.kept else frames)  # kept: not even resolved


def delete_and_close(viewer) -> None:
    """As the X of the title bar does, with the mouse there: no event follows."""
    viewer.state.add_region("sphere")
    viewer.state.record_regions()

    def ask_once() -> bool:
        viewer.hooks.closing.clear()
        return viewer.objects.may_close()

    viewer.hooks.closing.append(ask_once)
    viewer.window.close()


# What is set, and what is to be read then; each by nobody's hand: from a thread, a poll, a close.
SPOKEN = {
    "note": (lambda v: v.state.say("a note"), "a note"),
    "problem": (lambda v: setattr(v.state, "problem", "a problem"), "a problem"),
    "failure": (lambda v: v.state.messages.fail("a failure"), "a failure"),
    "status": (lambda v: v.hooks.status.append(lambda: "working 3 %"), "working 3 %"),
    "name": (lambda v: v.objects.saving.ask_name(), "Cancel"),
    "closing": (delete_and_close, "Regions: sphere 1"),
    "open": (lambda v: v.files.ask(), "Cancel"),
    "add": (lambda v: v.objects.adding.ask(), "Cancel"),
}


@pytest.mark.parametrize("kind", SPOKEN)
def test_what_is_said_or_asked_is_drawn_at_once_with_the_mouse_at_rest(viewer, kind, monkeypatch):
    settle(viewer)
    texts: list[str] = []
    for name in ("text_unformatted", "text_disabled", "text_wrapped", "button"):
        draw = getattr(imgui, name)
        monkeypatch.setattr(
            imgui, name, lambda text, *more, draw=draw: (texts.append(text), draw(text, *more))[1]
        )
    say, words = SPOKEN[kind]
    rounds = Rounds(viewer, monkeypatch)
    say(viewer)
    frames, *_ = rounds.go()
    assert any(words in text for text in texts), texts
    assert 0 < frames < WAITS / 2, "and then it rests"
    assert rounds.asked.index(SLEEP_S) < WAITS / 2
    viewer.state.problem, viewer.hooks.status[:] = "", viewer.hooks.status[:-1]
    imgui.internal.close_popups_except_modals()


def hide(viewer, display) -> None:
    glfw.hide_window(viewer.window.handle)


def minimise(viewer, display) -> None:
    """As a window manager says so; there is none in this display."""
    set_state(viewer, display, ICONIC)


def set_state(viewer, display: str, state: int) -> None:
    from Xlib.display import Display

    with_server = Display(display)
    window = with_server.create_resource_object("window", glfw.get_x11_window(viewer.window.handle))
    kind = with_server.intern_atom("WM_STATE")
    window.change_property(kind, kind, 32, [state, 0])
    with_server.sync()
    with_server.close()


@pytest.mark.parametrize("gone", [hide, minimise], ids=["not on the screen", "minimised"])
def test_hidden_it_sleeps_even_while_it_plays(viewer, rounds, display, gone):
    pytest.importorskip("Xlib")
    state = viewer.state
    gone(viewer, display)
    try:
        assert viewer.window.hidden
        viewer.handle_event(KeyDown(glfw.KEY_SPACE, False))
        x = state.scene.objects[0].x
        viewer.window.restyle()  # something of it would have to be redrawn
        assert viewer.busy() and rounds.go() == (0, 0, 0)
        assert len(rounds.asked) == WAITS and set(rounds.asked) == {HIDDEN_S}
        assert state.scene.objects[0].x == x, "time has passed"
    finally:
        set_state(viewer, display, NORMAL)
        glfw.show_window(viewer.window.handle)
    assert not viewer.window.hidden
    frames, draws, _ = rounds.go()
    # How many depends on how fast frames are: x may rest at a stop, or come to its end.
    assert frames > 0 and draws > 0, "it plays on"


def test_a_minimised_window_that_may_not_close_comes_back_to_ask(viewer, display, monkeypatch):
    pytest.importorskip("Xlib")
    back = []
    monkeypatch.setattr(glfw, "restore_window", back.append)
    viewer.hooks.closing.append(lambda: False)
    for state in (NORMAL, ICONIC):
        set_state(viewer, display, state)
        viewer.window.close()
        assert not viewer.may_close() and not viewer.window.closing
    set_state(viewer, display, NORMAL)
    assert back == [viewer.window.handle]  # once: an open window stays as it is
    run_frames(viewer, 1)


def test_a_frame_computes_its_view_once(viewer, monkeypatch):
    """It asks for it five times and more: for the picture, regions, the camera's section..."""
    computed = []
    of = EditorCamera.view_of
    monkeypatch.setattr(
        EditorCamera, "view_of", lambda self, *what: (computed.append(what), of(self, *what))[1]
    )
    for _ in range(3):
        viewer.viewpoint.camera.turn(0.1, 0.0)
        computed.clear()
        run_frames(viewer, 1)
        assert len(computed) == 1
    viewer.viewpoint.camera.step(9.0)
    run_frames(viewer, 2)
    computed.clear()
    run_frames(viewer, 3)
    assert not computed, "nothing has moved"
