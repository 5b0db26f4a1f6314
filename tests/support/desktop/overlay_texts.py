"""Every text of the overlay that is to be in the tables, read from the program's own source."""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

from shapeshift.app.editor.panels import panel
from shapeshift.app.editor.texts import table as texts_table
from shapeshift.renderer.debug.debug import REASON_TEXTS
from tests.support.sources import nodes_of

ROOT = Path(__file__).resolve().parents[3]
EDITOR, HEADSET = ROOT / "app" / "editor", ROOT / "app" / "headset"
BESIDE = (ROOT / "app" / "inspection" / "window", ROOT / "app" / "film" / "window")
PANELS = "shapeshift.app.editor.panels"
# function: which of its positional arguments are texts (None: all)
SAYING: dict[str, tuple[int, ...] | None] = {
    "said": (0,), "tip": (0,), "item_label": (0,), "subsection": (0,), "Section": (0,),
    "rows": None, "answer_row": None, "question_box": (0,), "choice": (3,), "slider": (4, 5),
    "labelled_slider": (4,), "_picked": (0, 2), "open_slider": (4, 5), "pace_button": (3,),
    "PathBox": None,
}  # fmt: skip
# Tables of texts that functions are handed: what of a dictionary is a text, by module.
KEYS, VALUES, ALL = "keys", "values", "all"
TABLES = {
    "cuts_panel": {"ADD": ALL, "EDGES": VALUES},
    "empty_panel": {"CHOICES": ALL, "WHAT": ALL},
    "open_row": {"NEW": ALL},
    "outlines": {"NAMES": VALUES},
    "panel": {"LARGER": ALL, "SMALLER": ALL, "ORDER": ALL},
    "sections.camera_panel": {
        "STEPS": ALL, "KEEP": ALL, "SIDES": ALL, "WAYS": ALL, "FORM_NAMES": VALUES,
    },
    "sections.export_panel": {"DEGREES": ALL, "FORMAT_TIPS": VALUES},
    "sections.objects_panel": {"MODES": VALUES, "FOUR_VIEW_NAMES": VALUES, "DEEDS": ALL},
    "sections.parts_panel": {
        "AXES": ALL, "DEEDS": ALL, "EXPLAINED": ALL, "SIZES": ALL, "CHOICES": ALL, "FLOATERS": ALL,
        "DRAG_WORDS": VALUES,
    },
    "sections.quality_panel": {"GROUPS": KEYS, "ORDER_NAMES": VALUES},
    "sections.regions_panel": {"DIRECTIONS": KEYS, "HALVES": ALL, "PAINTED": ALL, "KIND_TIPS": ALL},
    "sections.plain_sections": {
        "SLIDERS": VALUES, "PARTS": ALL, "TWO_STOPS": ALL, "PALETTE_TIP": ALL,
        "DEBUG_NAMES": VALUES,
    },
    "sections.stops_panel": {"MODE_NAMES": VALUES},
}  # fmt: skip
TABLES_BESIDE = {
    "editor.window.answers": {
        "TABLE": ALL, "EMPTY": ALL, "WAITS": ALL, "NOTHING": ALL, "NO_CHANGE": ALL,
        "ONE_THING": ALL, "NOT_THERE": ALL,
    },
    "editor.window.gizmo": {"HANDLE_WORDS": VALUES},
    "editor.window.hands": {"FLIES": ALL, "ORBITS": ALL},
    "editor.window.objects": {"OVER": ALL, "SAVE": ALL, "UNSAVED": ALL},
    "editor.window.recovering": {"ANSWERS": ALL},
    "editor.window.shell": {"GROUPS": ALL, "KEY_WORDS": VALUES},
    "film.window.film_panel": {"AROUND": ALL, "PAST": ALL, "TRACK_NAMES": ALL, "PAGE_TIP": ALL},
    "inspection.window.inspect_panel": {
        "COLUMNS": ALL, "BOUND_TIPS": ALL, "VALUE_TIPS": ALL, "AUTO_TIPS": ALL, "MEASURES": ALL,
        "EMISSIVITY": ALL,
    },
    "inspection.window.marks_over": {"WHY_HIDDEN": ALL},
    "inspection.window.ruler_panel": {"KIND_LABELS": VALUES, "KIND_TIPS": ALL, "ACTIONS": ALL},
}  # fmt: skip
HEADSET_TABLES = {
    "sections.comfort_section": {
        "POSTURE_NAMES": VALUES, "HAND_NAMES": VALUES, "PANEL_NAMES": VALUES, "WALK_NAMES": VALUES,
        "TURN_NAMES": VALUES, "MODEL_NAMES": VALUES, "EDGE": ALL, "TEXT": ALL, "ROOM": ALL,
        "NO_ROOM": ALL, "SHARP": ALL, "SHARP_NAMES": VALUES, "LATER": ALL, "NO_INSETS": ALL,
    },
    "sections.room_section": {"HOW_TOOLS": VALUES, "QUALITY_NAMES": VALUES, "HOW": ALL},
    "wrist_menu": {"NONE": ALL, "HELP": ALL, "SURE": ALL},
}  # fmt: skip
ROWS = ("tips", "moves", "sides")  # what such dictionaries are called
# below app: KEYS of the sheet
KEY_TABLES = (
    "editor.desktop", "editor.window.devices.input_devices", "editor.window.devices.space_mice",
    "editor.window.objects", "editor.window.parts", "editor.window.section_handles",
    "editor.window.touch", "editor.window.two_pictures", "inspection.window.attach_inspection",
    "inspection.window.attach_ruler",
)  # fmt: skip
STATES = {
    "files.saving": ("LOSE",), "parts.parts_tool": ("HOW",),
    "touch_state": ("HOW", "STILL", "MOVING", "KEPT", "NO_BODIES"),
}  # fmt: skip
# Texts on their way through variables, as tests/.../look/test_desktop_languages.py has found them.
BY_VARIABLES = {
    "Budget", "Quality", "Passes", "Counts", "Machine", "drawing", "sort", "vendor", "in the scene",
    "Redo", "plane", "fur", "blocks", "bubbles", "points", "melt", "explode", "strokes",
    "a frame in at most %.1f ms", "as the exact picture to %.0f dB", "field of view: %.0f\u00b0",
    "speed: %.2g x", "sort every frame",
}  # fmt: skip
LETTERS = re.compile(r"[A-Za-z]{2}")
KEY = r"(Ctrl|Shift|Alt|Esc|Enter|Space|Tab|[A-Z]|F\d+|\d|[+\u2013])"
NAMES = re.compile(rf"[.\w]*\.\w+|{KEY}([ ,+]+{KEY})*|%\.\d+f .?m")  # the same in all tables


def is_text(text: object) -> bool:
    """Whether it has words; a number with a unit or the name of a key has none."""
    return isinstance(text, str) and bool(LETTERS.search(text)) and not NAMES.fullmatch(text)


def literals(node: ast.AST) -> Iterator[str]:
    """Strings of an expression, without the pieces of f-strings and without what calls are given:
    calls have arguments of their own.
    """
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif not isinstance(node, ast.JoinedStr | ast.Call | ast.Compare | ast.Subscript):
        children = list(ast.iter_child_nodes(node))
        if isinstance(node, ast.IfExp):
            children = [node.body, node.orelse]
        for child in children:
            yield from literals(child)


def said_in(path: Path) -> set[str]:
    """Texts that a file hands to one of SAYING."""
    found: set[str] = set()
    for node in nodes_of(path):
        if isinstance(node, ast.FunctionDef):
            found |= rows_in(node)
        found |= set(key_groups(node))
        name = getattr(getattr(node, "func", None), "id", "")
        if not isinstance(node, ast.Call) or name not in SAYING:
            continue
        which = SAYING[name]
        for place, argument in enumerate(node.args):
            if which is None or place in which:
                found |= set(literals(argument))
    return found


def key_groups(node: ast.AST) -> Iterator[str]:
    """Headings that are given to the sheet of keys: hooks.keys["..."] = rows."""
    for target in node.targets if isinstance(node, ast.Assign) else ():
        if isinstance(target, ast.Subscript) and getattr(target.value, "attr", "") == "keys":
            yield from literals(target.slice)


def rows_in(function: ast.FunctionDef) -> set[str]:
    """Of the dictionaries that a function makes for a row of buttons: names and what they do."""
    found: set[str] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            if any(isinstance(target, ast.Name) and target.id in ROWS for target in node.targets):
                for each in (*node.value.keys, *node.value.values):
                    found |= set(literals(each)) if each is not None else set()
    return found


def texts_of(value: object, what: str = ALL) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        if what != VALUES:
            yield from value
        if what != KEYS:
            for each in value.values():
                yield from texts_of(each)
    elif isinstance(value, list | tuple):
        for each in value:
            yield from texts_of(each)


def sources() -> list[Path]:
    """Every file that says something over the picture."""
    tops = (EDITOR / "panels", EDITOR / "state", EDITOR / "window", HEADSET, *BESIDE)
    alone = (EDITOR / "desktop.py", ROOT / "app" / "streaming" / "refine.py")
    return [*(path for top in tops for path in top.rglob("*.py")), *alone]


def overlay_texts() -> set[str]:
    """All of them, in English."""
    found: set[str] = set()
    for path in sources():
        found |= said_in(path)
    for name, tables in TABLES.items():
        module = importlib.import_module(f"{PANELS}.{name}")
        for table, what in tables.items():
            found |= set(texts_of(getattr(module, table), what))
    for tool in (*panel.TOOLS, panel.SETUP):
        found |= {tool.name, tool.what, tool.missing}
    for name, tables in TABLES_BESIDE.items():
        module = importlib.import_module(f"shapeshift.app.{name}")
        for table, what in tables.items():
            found |= set(texts_of(getattr(module, table), what))
    for name, tables in HEADSET_TABLES.items():
        module = importlib.import_module(f"shapeshift.app.headset.{name}")
        for table, what in tables.items():
            found |= set(texts_of(getattr(module, table), what))
    for name, texts in STATES.items():
        module = importlib.import_module(f"shapeshift.app.editor.state.{name}")
        for text in texts:
            found |= set(texts_of(getattr(module, text)))
    found |= BY_VARIABLES | {*texts_table.TEMPLATES, *texts_table.DEEDS, texts_table.THE_SCENE}
    found |= set(texts_of(REASON_TEXTS, VALUES))  # in the legend of a debug view
    for name in KEY_TABLES:
        module = importlib.import_module(f"shapeshift.app.{name}")
        found |= set(texts_of(module.KEYS))
    return {text.split("##")[0] for text in found if is_text(text.split("##")[0])}


# Where a function is told what an edit is called: at which place among its arguments, from 0.
DEED_PLACES = {
    "edit": (2,), "_edit": (0, 2), "_changed": (0,), "record": (1,), "_record": (1,),
    "change": (1,), "cut": (4,),
}  # fmt: skip


def deeds_in_source() -> set[str]:
    """What edits are called, where that stands in the call; {} for what is filled in."""
    found: set[str] = set()
    for path in sources():
        for node in nodes_of(path):
            name = getattr(getattr(node, "func", None), "attr", None)
            name = name or getattr(getattr(node, "func", None), "id", None)
            if not isinstance(node, ast.Call) or name not in DEED_PLACES:
                continue
            places = DEED_PLACES[name]
            parts = [part for place, part in enumerate(node.args) if place in places]
            parts += [each.value for each in node.keywords if each.arg == "what"]
            found |= {text for part in parts for text in filled_texts(part)}
    return found - {""}


def filled_texts(node: ast.expr) -> Iterator[str]:
    """Strings and f-strings of an expression, these with {} for their values."""
    if isinstance(node, ast.IfExp):
        yield from filled_texts(node.body)
        yield from filled_texts(node.orelse)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        pieces = [each.value if isinstance(each, ast.Constant) else "{}" for each in node.values]
        yield "".join(map(str, pieces))


UNSAID = ("button", "checkbox", "color_edit3", "menu_item", "radio_button", "text",
          "text_disabled", "text_unformatted", "text_wrapped")  # fmt: skip


def unsaid_texts() -> list[str]:
    """Texts that go to ImGui as they stand in the code, and so in English alone."""
    found = []
    for path in (p for top in (EDITOR / "panels", HEADSET, *BESIDE) for p in top.rglob("*.py")):
        for node in nodes_of(path):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            owner = node.func.value
            if isinstance(owner, ast.Name) and owner.id == "imgui" and node.func.attr in UNSAID:
                texts = {text for part in node.args[:1] for text in literals(part)}
                found += [text for text in texts if is_text(text.split("##")[0])]
    return sorted(found)
