"""No press without an answer: every key and every button, in every state of the window.

Judged from outside: by what ImGui wants drawn, and by the picture that the renderer is asked for.
What there is to press is found, not listed: all keys of a keyboard, all items that are drawn.
"""

import re
import subprocess
import threading
from collections.abc import Iterable
from pathlib import Path
from pickle import dumps

import glfw
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.desktop import Options, Viewer
from shapeshift.app.editor.state.editor_state import EditorState
from shapeshift.app.editor.texts.table import use_language
from shapeshift.app.editor.window import window as window_module
from shapeshift.app.editor.window.answers import QUIET
from shapeshift.app.editor.window.overlay.triangles import read_lists
from shapeshift.app.editor.window.shell import GROUPS
from tests.support.desktop.desktop_stand import PlainRenderer, ball, read_stub, run_frames
from tests.support.desktop.objects_stand import click, obj, viewer_of
from tests.support.desktop.widgets import KINDS

ONE_PIXEL = imgui.ImVec2(1.0, 1.0)
SHIFT, CTRL = glfw.MOD_SHIFT, glfw.MOD_CONTROL
CODES = {
    name[4:]: code
    for name, code in vars(glfw).items()
    if name.startswith("KEY_") and code not in QUIET
}  # F13 and more are on no keyboard
KEYS = sorted({code for code in CODES.values() if not glfw.KEY_F12 < code < glfw.KEY_KP_0})
PRINTED = {",": "COMMA", ".": "PERIOD", "+": "EQUAL", "\u2013": "MINUS", "Esc": "ESCAPE"}


def chords_of(words: str) -> list[tuple[int, int]]:
    """Keys of a row of the sheet that F1 shows: "Ctrl+Z, Ctrl+Y"; [] for what mice do."""
    found, mods = [], 0
    for word in re.split(r"[, ]+", words.replace("numpad ", "KP_")):
        *held, key = word.split("+") if word != "+" else ["+"]
        for name in held:
            mods |= {"Shift": SHIFT, "Ctrl": CTRL}.get(name, 0)
        name = PRINTED.get(key, key.upper())
        if key == "Ctrl":
            mods = CTRL
        elif name in CODES:
            found.append((CODES[name], mods if held or mods == CTRL else 0))
    return found


def nothing_open(begin) -> Viewer:
    viewer = begin()
    viewer.files.new()
    return viewer


def stop_shown(begin) -> Viewer:
    return begin()


def tool_in_hand(begin) -> Viewer:
    viewer = begin()
    viewer.parts.toggle()
    return viewer


def job_at_work(begin) -> Viewer:
    """A file is being read all the time."""
    viewer = begin()
    viewer.files.read = lambda path, told: viewer.ends.wait(60) and ball()
    viewer.open_soon((Path("large.ply"),))
    return viewer


def playing(begin) -> Viewer:
    viewer = begin()
    viewer.state.toggle_play()
    return viewer


def objects_cut(begin) -> Viewer:
    """Of several objects one is chosen, bodies are there, nothing moves."""
    viewer = begin(touch=True)
    click(viewer, obj(viewer, "cube").world_from_object.position)
    return viewer


def physics_on(begin) -> Viewer:
    viewer = begin(touch=True)
    viewer.touch.toggle()
    return viewer


STATES = (nothing_open, stop_shown, tool_in_hand, job_at_work, playing, objects_cut, physics_on)


@pytest.fixture
def begin(window, touch_found, tmp_path, monkeypatch):
    """Makes viewers; the panel is folded, so that less answers by itself."""
    ends = threading.Event()

    def no_process(*_, **__):
        raise OSError("no processes here")

    monkeypatch.setattr(subprocess, "Popen", no_process)
    # What is to be drawn is looked at, nobody looks at its pixels.
    textures = window.presented.renderer.update_textures
    monkeypatch.setattr(window.presented, "lay_over", lambda data: textures())
    monkeypatch.setattr(window.presented, "swap", lambda handle: None)
    monkeypatch.setattr(PlainRenderer, "present", lambda *_: None)
    monkeypatch.setattr(window_module, "DOUBLE_CLICK_S", -1.0)  # two clicks are two

    def make(touch: bool = False) -> Viewer:
        if touch:
            viewer = viewer_of(window, touch_found, tmp_path)
            viewer.touch.world.paused = True
        else:
            state = EditorState(read_stub)
            state.open([Path("ball.shift")])
            options = Options(pictures=tmp_path / "pictures")
            viewer = Viewer(window, PlainRenderer(window.ctx), state, options)
        viewer.ends = ends
        viewer.settings.panel_open = False
        imgui.get_style().hover_stationary_delay = 1e6  # no explanation comes up by itself
        window.on_cursor(None, 450.0, 300.0)
        run_frames(viewer, 4)
        return viewer

    yield make
    ends.set()
    use_language("")
    window.restyle()


def seen(viewer) -> tuple:
    """All that there is to be seen, to the eye's exactness."""
    request = viewer._request()
    looks = [
        (obj.world_from_object.matrix().round(5).tolist(), obj.x, obj.visible, obj.selectors,
         obj.sections, obj.appearance, obj.tint)
        for obj in request.scene.objects
    ]  # fmt: skip
    eye = request.view.eye_from_world().round(5).tolist()
    split = request.beside and request.beside.cut
    models = [id(obj.model) for obj in request.scene.objects]
    lists = {each.vertices for each in read_lists(imgui.get_draw_data(), ())}  # in any order
    return lists, eye, request.settings, split, models, dumps(looks)


def press(viewer, key: int, mods: int = 0) -> None:
    for action in (glfw.PRESS, glfw.RELEASE):
        viewer.window.on_key(None, key, 0, action, mods)
    run_frames(viewer, 3)


def silent_keys(viewer, chords: Iterable[tuple[int, int]]) -> list[tuple]:
    silent = []
    for key, mods in chords:
        before, messages = seen(viewer), viewer.state.messages
        count = messages.count
        press(viewer, key, mods)
        spoke = messages.count > count and (messages.note or messages.problems)
        if before == seen(viewer) and not spoke:
            silent.append((glfw.get_key_name(key, 0) or key, mods))
        if imgui.get_io().want_text_input:  # what is typed now is for a box
            press(viewer, glfw.KEY_ESCAPE)
    return silent


@pytest.mark.parametrize("state_of", STATES, ids=lambda state: state.__name__)
def test_every_key_of_the_sheet_does_or_says(begin, state_of):
    """All that F1 shows; a new key is on it, or tests/app/editor/test_texts.py says so."""
    viewer = state_of(begin)
    rows = [row for group in (*GROUPS.values(), *viewer.hooks.keys.values()) for row in group]
    known = dict.fromkeys(chord for words, _ in rows for chord in chords_of(words))
    assert len(known) > 40  # the sheet is read
    assert not silent_keys(viewer, known)


@pytest.mark.slow
@pytest.mark.parametrize("state_of", STATES, ids=lambda state: state.__name__)
def test_every_key_of_a_keyboard_does_or_says(begin, state_of):
    assert not silent_keys(state_of(begin), [(key, mods) for key in KEYS for mods in (0, SHIFT)])


class Items:
    """What is drawn that a mouse can press, wherever it lies: (kind, label, where) of a frame."""

    def __init__(self, monkeypatch) -> None:
        self.found: dict[tuple, tuple[float, float]] = {}  # -> its middle, logical pixels
        for kind in (*KINDS, "arrow_button", "small_button", "tree_node_ex", "radio_button"):
            monkeypatch.setattr(imgui, kind, self._watched(kind, getattr(imgui, kind)))

    def _watched(self, kind: str, function):
        def call(label: str, *values, **named):
            done = function(label, *values, **named)
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            middle = ((low.x + high.x) / 2, (low.y + high.y) / 2)
            if imgui.is_rect_visible(imgui.ImVec2(*middle), imgui.ImVec2(*middle) + ONE_PIXEL):
                self.found[kind, label, imgui.get_item_id()] = middle
            return done

        return call

    def now(self, viewer) -> dict[tuple, tuple[float, float]]:
        self.found.clear()
        run_frames(viewer, 2)
        return dict(self.found)


def press_at(viewer, place: tuple[float, float]) -> bool:
    """Rests there and clicks; whether that was answered."""
    viewer.window.on_cursor(None, *place)
    run_frames(viewer, 3)
    while viewer.viewpoint.sliding:  # the picture moves over, by itself
        run_frames(viewer, 1, 0.2)
    before, messages = seen(viewer), viewer.state.messages
    count = messages.count
    for action in (glfw.PRESS, glfw.RELEASE):
        viewer.window.on_button(None, 0, action, 0)
        run_frames(viewer, 2)
    run_frames(viewer, 3)
    spoke = messages.count > count and bool(messages.note or messages.problems)
    return spoke or before != seen(viewer)


def silent_items(viewer, items: Items, least: int) -> list[tuple]:
    """Of one section after the other all is pressed that is in sight."""
    window, tried, silent = viewer.window, set(), []
    viewer.settings.panel_open = True
    names = [section.name for section in viewer.hooks.sections]
    for name in names:
        viewer.settings.sections.update({each: each == name for each in names})
        run_frames(viewer, 3)
        for _ in range(60):
            left = {key: at for key, at in items.now(viewer).items() if key not in tried}
            if not left:
                break
            key, place = next(iter(left.items()))
            tried.add(key)
            if key[0] == "tree_node_ex" and key[1].partition("###")[0] in names:
                continue  # a heading would fold what is looked at
            if not press_at(viewer, place):
                silent.append(key[:2])
            press(viewer, glfw.KEY_ESCAPE)  # the box or the list that it has opened
            viewer.settings.sections.update({each: each == name for each in names})
    window.on_cursor(None, 450.0, 300.0)
    assert len(tried) >= least, sorted(key[1] for key in tried)
    return silent


@pytest.mark.slow
@pytest.mark.parametrize("state_of", STATES, ids=lambda state: state.__name__)
def test_every_button_does_or_says(begin, monkeypatch, state_of):
    items = Items(monkeypatch)
    assert not silent_items(state_of(begin), items, 20)


def test_a_click_into_the_picture_does_or_says(begin):
    for state_of in (nothing_open, stop_shown, objects_cut):
        viewer = state_of(begin)
        for place in ((200.0, 500.0),):
            assert press_at(viewer, place), (state_of, place)
            assert press_at(viewer, place), (state_of, place, "and once more")
