"""What the page shares with Python and with the renderer's shaders: two files of web/.

conventions.js has constants, from those here, and chunks of GLSL that mean the same in WebGL2, from
renderer/shaders/common.  entries.d.ts has a type for each TypedDict of a scene's table of contents,
from SceneEntry down; JSDoc imports them, and `tsc` checks the page against them.  To send a page
something more, add a field to the TypedDict and where it is written.  `python3
tools/web/write_conventions.py` writes both files; tests compare, and run `tsc`.
"""

import json
import types
from typing import (
    Any,
    Literal,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from shapeshift.app.page.page_scene import RegionEntry, SceneEntry
from shapeshift.rasterizer.reference import MAX_ALPHA
from shapeshift.renderer.colors.palette import LUMINANCE
from shapeshift.renderer.gl.shader import SHADERS
from shapeshift.renderer.gl.target import MOST_UNIT
from shapeshift.renderer.reference import JACOBIAN_MARGIN
from shapeshift.renderer.settings import RenderSettings
from shapeshift.runtime_models.web import web_model
from shapeshift.runtime_models.web.web_model import ControlEntry, ModelEntry, Section, SectionKind
from shapeshift.scene.control import SHIFT_S, SNAP, Sweep

HEAD = """// conventions: shared with Python, written by tools/web/write_conventions.py from
// the constants there; change it there.
"""
LIMITS = ("WIDTH", "BATCH_ROWS", "BLOCK_VEC4S", "MOST_ANCHORS", "MOST_SPLATS", "MOST_BYTES",
          "MOST_WEIGHTS")  # fmt: skip
ENTRIES_HEAD = """// entries: what Python writes into a scene, written by
// tools/web/write_conventions.py from the TypedDicts there; change it there.
"""
# Of those that several fields have.
NAMES: dict[Any, str] = {
    SectionKind: "SectionKind", Section: "Section", ControlEntry: "ControlEntry",
    ModelEntry: "ModelEntry", RegionEntry: "RegionEntry",
}  # fmt: skip
PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null"}
CHUNKS = ("direction", "light")  # of renderer/shaders/common


def shared_constants() -> dict[str, tuple[object, str]]:
    """name -> (value, what it is)."""
    settings, sweep = RenderSettings(), Sweep(())
    return {
        **{name: (getattr(web_model, name), "runtime_models/web/web_model.py") for name in LIMITS},
        "MIN_ALPHA": (settings.min_alpha, "a pixel's alpha below this is not drawn"),
        "MAX_ALPHA": (MAX_ALPHA, "one splat never hides everything behind it"),
        "LOW_PASS": (settings.low_pass, "px^2 added to the screen covariance"),
        "MOST_UNIT": (MOST_UNIT, "brighter colours are blended in half floats"),
        "JACOBIAN_MARGIN": (JACOBIAN_MARGIN, "times the largest tangents of a view"),
        "LUMINANCE": (LUMINANCE.tolist(), "Rec. 709, on display values"),
        "SNAP": (SNAP, "of the slider: nearer than this to a stop is on the stop"),
        "SHIFT_S": (SHIFT_S, "from any stop to any other, when somebody asks for it"),
        "LEG_S": (sweep.leg_s, "playing, from one stop to the next"),
        "REST_S": (sweep.rest_s, "playing, at each stop"),
        "RESORT_DEGREES": (1.0, "a view that turns farther is sorted anew"),
        "RESORT_PART": (0.01, "of the scene's radius: so is one that moves farther"),
    }


def shared_chunk(name: str) -> str:
    """A chunk of GLSL as a JavaScript constant, without the contract at its head."""
    _, code = (SHADERS / "common" / f"{name}.glsl").read_text("utf-8").split("\n\n", 1)
    return f"// renderer/shaders/common/{name}.glsl\nexport const {name.upper()} = `\n{code}`;\n"


def conventions_text() -> str:
    """The whole module."""
    lines = (
        f"export const {name} = {json.dumps(value)};  // {what}"
        for name, (value, what) in shared_constants().items()
    )
    return HEAD + "\n".join(lines) + "\n" + "".join(map(shared_chunk, CHUNKS))


def entries_text() -> str:
    """The whole of web/entries.d.ts.  Raises TypeError for a field that JSON has no type for."""
    wanted: list[type] = [SceneEntry]
    done: set[type] = set()
    text = ENTRIES_HEAD
    for hint, name in NAMES.items():
        text += f"export type {name} = {script_type(hint, wanted, named=False)};\n"
    while wanted:
        entry = wanted.pop(0)
        if entry not in done:
            done.add(entry)
            text += interface(entry, wanted)
    return text


def interface(entry: type, wanted: list[type]) -> str:
    """A TypedDict as TypeScript; those that its fields have go to the end of `wanted`."""
    said = " ".join((entry.__doc__ or "").split())
    lines = [f"/** {said} */", f"export interface {entry.__name__} {{"]
    for field, hint in get_type_hints(entry, include_extras=True).items():
        optional = get_origin(hint) is NotRequired
        try:
            kind = script_type(get_args(hint)[0] if optional else hint, wanted)
        except TypeError as error:
            raise TypeError(f"{entry.__name__}.{field}: {error}") from None
        lines.append(f"    {field}{'?' if optional else ''}: {kind};")
    return "\n".join([*lines, "}", ""])


def script_type(hint: Any, wanted: list[type], named: bool = True) -> str:
    """What TypeScript calls what JSON makes of a Python type."""
    if named and hint in NAMES:
        return NAMES[hint]
    if hint in PLAIN:
        return PLAIN[hint]
    if is_typeddict(hint):
        wanted.append(hint)
        return hint.__name__
    origin, of = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " | ".join(json.dumps(value) for value in of)
    if origin in (Union, types.UnionType):
        return " | ".join(dict.fromkeys(script_type(each, wanted) for each in of))
    if origin is tuple and Ellipsis not in of:
        return f"[{', '.join(script_type(each, wanted) for each in of)}]"
    if origin is list and of:
        item = script_type(of[0], wanted)
        return f"({item})[]" if " | " in item else f"{item}[]"
    if origin is dict and of[0] is str:
        return f"Record<string, {script_type(of[1], wanted)}>"
    raise TypeError(f"{hint} is nothing that JSON has")
