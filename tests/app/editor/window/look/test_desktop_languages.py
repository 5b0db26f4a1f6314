"""What the panel really says, with all of it unfolded: every text has its other languages."""

import re
from collections.abc import Mapping

import glfw
import pytest
from imgui_bundle import imgui

from shapeshift.app.editor.texts.table import ENGLISH, Language, all_languages, use_language
from shapeshift.app.editor.window.window import KeyDown
from tests.support.desktop.desktop_stand import run_frames
from tests.support.desktop.overlay_texts import is_text
from tests.support.desktop.widgets import every_section

# The same everywhere: formats of files, things numbered under their own names, drivers' words; and
# edits, which "Undo" names as the program knows them.
NAMES = re.compile(r"\.[\w.]+  .*|\d+  .*|mlps|gl renderer|gl version|add .*")
OTHERS = [code for code in all_languages() if code != ENGLISH]


SAID = "\u00a4"  # stands before what a table has given


class Asked(Mapping):
    """A table that gives back what it is asked for, marked, and remembers it.  What is marked has
    been through it, and is asked for again as a label.
    """

    def __init__(self) -> None:
        self.texts: set[str] = set()

    def get(self, text, default=None):
        if SAID in text:
            return text
        self.texts.add(text)
        return SAID + text

    def __getitem__(self, text):
        raise KeyError(text)

    def __iter__(self):
        return iter(())

    def __len__(self) -> int:
        return 0


@pytest.fixture
def asked(monkeypatch):
    """With every heading open and every tip shown, whatever the mouse is at."""
    found = Asked()
    tree = imgui.tree_node_ex
    every_section(monkeypatch)
    monkeypatch.setattr(imgui, "tree_node_ex", lambda *given: bool(tree(*given)) or True)
    monkeypatch.setattr(imgui, "is_item_hovered", lambda *given: True)
    monkeypatch.setitem(all_languages(), "xx", Language("xx", "Noted", found))
    use_language("xx")
    yield found.texts
    use_language(ENGLISH)


def names_of(viewer) -> set[str]:
    """What comes out of files, and is the same in every language."""
    state = viewer.state
    names = {stop.name for obj in state.scene.objects for stop in obj.model.stops}
    return names | {obj.name for obj in state.scene.objects} | {state.title}


@pytest.mark.parametrize("which", ["viewer", "touch_viewer"])
def test_every_text_of_the_panel_is_in_every_table(which, request, asked):
    viewer = request.getfixturevalue(which)
    state = viewer.state
    for kind in ("sphere", "box", "half-space", "lens"):
        state.add_region(kind)
        run_frames(viewer, 1)
    for key, shift in ((glfw.KEY_2, False), (glfw.KEY_Y, False), (glfw.KEY_Y, True),
                       (glfw.KEY_O, False), (glfw.KEY_O, True), (glfw.KEY_C, False),
                       (glfw.KEY_F1, False)):  # fmt: skip
        viewer.handle_event(KeyDown(key, shift))
        viewer.shell.handle_event(KeyDown(key, shift))
        run_frames(viewer, 2)
    said = {text for text in asked if is_text(text) and not NAMES.fullmatch(text)}
    said -= names_of(viewer)
    assert len(said) > 250, "the panel was folded"
    for code in OTHERS:
        missing = sorted(said - all_languages()[code].texts.keys())
        assert not missing, f"{code}: {missing}"
