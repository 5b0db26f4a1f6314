"""Names out of files in the window: no name breaks a line of the panel, and none ends a frame."""

from dataclasses import replace

import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.panels.widgets.clean_texts import clean_texts, cleaning, maker
from shapeshift.runtime_models.files.plain_text import UNSAFE
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.scene import Scene
from tests.support.desktop.desktop_stand import ball, run_frames

NAMES = ("\x1b[2J\u202egnp.exe", "a\ud800\x00b\nnew line", "%s%n%s%n", "n" * 50_000, "##x###y")


@pytest.mark.parametrize("name", NAMES)
def test_every_kind_of_text_takes_any_name(window, name):
    window.begin_frame()
    imgui.begin(name)
    imgui.text(name)
    imgui.text_wrapped(name)
    imgui.button(f"{name}##a")
    imgui.checkbox(f"{name}##b", True)
    imgui.combo(f"{name}##c", 0, [name, "other"])
    imgui.slider_float("##d", 0.5, 0.0, 1.0, f"{name.replace('%', '%%')[:90]}: %.2f")
    imgui.input_text("##e", name)
    imgui.set_tooltip(name)
    imgui.get_window_draw_list().add_text(imgui.ImVec2(0, 0), 0xFFFFFFFF, name)
    assert imgui.calc_text_size(name).x > 0
    imgui.end()
    imgui.end_frame()


@pytest.mark.parametrize("function", ["button", "text_wrapped", "add_text", "input_text"])
def test_what_reaches_imgui_is_clean(window, function):
    owner = imgui.ImDrawList if function == "add_text" else imgui
    assert hasattr(getattr(owner, function), "__wrapped__")
    given = []
    inner = cleaning(lambda *texts, **named: given.extend([*texts, *named.values()]),
                     maker(function))  # fmt: skip
    inner(NAMES[1], label=NAMES[1])
    for text in given:
        text.encode("utf-8")
        assert "\0" not in text and (function == "input_text" or not UNSAFE.search(
            text.replace("\n", "") if function == "text_wrapped" else text))  # fmt: skip
    inner(list(NAMES), 3, None)
    assert given[-2:] == [3, None]


def test_it_is_done_once(window):
    before = imgui.button
    clean_texts()
    assert imgui.button is before


def test_a_scene_of_such_names_is_shown(viewer):
    stops = tuple(Stop(name, i / 4, "thermal", "ironbow", (0.0, 1.0), name)
                  for i, name in enumerate(NAMES))  # fmt: skip
    model = replace(ball(100), stops=stops)
    obj = viewer.state.scene.objects[0]
    viewer.state.scene = Scene((replace(obj, name=NAMES[0], model=model, x=0.5),))
    viewer.state.say(NAMES[1])
    viewer.state.problem = NAMES[3]
    run_frames(viewer, 4)
    viewer.window.set_title(NAMES[1])
