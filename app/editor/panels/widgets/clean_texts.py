"""What the panel hands to ImGui passes here: words out of files cannot break a line or end a frame.

ImGui shows control characters as boxes and lets signs of direction turn a line around; halves of
surrogate pairs, which any name in JSON may hold, raise an error in the middle of a frame.
"""

import functools
from collections.abc import Iterator
from contextlib import contextmanager

from imgui_bundle import imgui

from shapeshift.runtime_models.files.plain_text import one_line, several_lines

EDITED = ("input_text", "input_text_multiline", "input_text_with_hint")  # what somebody types
WITH_LINES = ("text", "calc_text_size", "set_tooltip", "set_item_tooltip")  # may have several
ITEMS = (  # what can be hit
    "button", "checkbox", "selectable", "combo", "slider_float", "slider_int", "drag_float",
    "drag_float3", "input_text", "color_edit3", "invisible_button", "tree_node_ex", "arrow_button",
)  # fmt: skip

Box = tuple[float, float, float, float]  # left, top, right, bottom, logical pixels
_listed: list[dict[str, Box]] = []  # of `listing_items`, the innermost last


def clean_texts() -> None:
    """Makes ImGui's functions that take texts clean them; once a process is enough."""
    for name, function in vars(imgui).copy().items():
        if type(function).__name__ == "nb_func" and "str" in (function.__doc__ or ""):
            clean = cleaning(function, maker(name))
            setattr(imgui, name, listed(clean) if name in ITEMS else clean)
    lists = imgui.ImDrawList
    if not hasattr(lists.add_text, "__wrapped__"):
        lists.add_text = cleaning(lists.add_text, clean_line)


def maker(name: str):
    """What cleans the texts of one of ImGui's functions."""
    if name in EDITED:
        return takeable
    return clean_lines if name.startswith(WITH_LINES) else clean_line


def cleaning(function, make):
    """The function over texts that `make` has cleaned."""

    @functools.wraps(function, assigned=("__doc__", "__name__"))
    def call(*arguments, **named):
        return function(*map(make, arguments), **{key: make(named[key]) for key in named})

    return call


def listed(function):
    """The function; afterwards the panel knows where its item lies."""

    @functools.wraps(function, assigned=("__doc__", "__name__"))
    def call(label, *arguments, **named):
        done = function(label, *arguments, **named)
        if _listed and imgui.is_item_visible():
            low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            middle = imgui.ImVec2((low.x + high.x) / 2, (low.y + high.y) / 2)
            if imgui.is_rect_visible(middle, middle):
                name = label.split("##")[0] or label.strip("#")
                _listed[-1].setdefault(name, (low.x, low.y, high.x, high.y))
        return done

    return call


@contextmanager
def listing_items() -> Iterator[dict[str, Box]]:
    """Within it: what can be hit and whose middle is in sight, by its label; of one the first."""
    _listed.append({})
    try:
        yield _listed[-1]
    finally:
        _listed.pop()


def clean_line(value):
    """A text, or each text of a list, on one line."""
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, list | tuple) and value and isinstance(value[0], str):
        return [one_line(text) for text in value]
    return value


def clean_lines(value):
    return several_lines(value) if isinstance(value, str) else value


def takeable(value):
    """As it was typed, but for what no text of ImGui's can hold."""
    if not isinstance(value, str):
        return value
    return value.encode("utf-8", "replace").decode().replace("\0", "?")
