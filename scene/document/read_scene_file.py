"""The JSON scene file of docs/scene.md.  Nothing in it runs, and no key in it is overlooked."""

import math
from pathlib import Path
from typing import Any

from shapeshift.runtime_models.files.json_fields import Fields, is_count, read_json
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.splats.layers.read_layers import MODES
from shapeshift.runtime_models.splats.plain_splats import AXES
from shapeshift.scene.cameras.upright import SOURCES, Up, Upright
from shapeshift.scene.control import EASES
from shapeshift.scene.document.appearance_rows import read_appearance, read_sky
from shapeshift.scene.document.scene_file import (
    BACKGROUND,
    ENDING,
    FAR_M,
    FORMAT,
    FirstView,
    NamedView,
    SceneFile,
    SceneItem,
)
from shapeshift.scene.pose import UNIT_SLACK
from shapeshift.scene.sections.section_texts import read_sections
from shapeshift.scene.selectors.selector import Box, Selector, Sphere
from shapeshift.scene.selectors.selector_texts import build, read_selector_row
from shapeshift.scene.world.reactions import KINDS, Reaction, State, TwoAxes

MOST_OBJECTS = 1000
MOST_ROWS = 100  # of selectors, states and reactions each
LONGEST_NAME = 100  # letters
LARGEST_LABEL = 2**31 - 1  # of plain splats; those of packages end at 254
PART = "a label, which is a whole number from 0 on, or the name of one of the model's objects,"
GRAVITY, MASS, FRICTION, RESTITUTION = 100.0, 1e6, 10.0, 1.0  # at most: m/s2, kg


def read_scene_file(path: str | Path) -> SceneFile:
    """Raises BadFile, one sentence that names the object and the key."""
    path = Path(path)
    file = Fields(read_json(path, path.name, unique=True), path.name)
    asked = file.value("format", FORMAT if path.name.lower().endswith(ENDING) else None)
    if asked != FORMAT:
        raise file.error("format", f"'{FORMAT}', which this program reads,")
    background = file.optional_object(BACKGROUND)
    rows = file.rows("objects", MOST_OBJECTS, "object")
    head = read_head(file)
    file.refuse_unknown_keys()
    items = tuple(read_item(row, path.name) for row in rows)
    names = [item.name for item in items]
    for name in names:
        if names.count(name) > 1 or name == BACKGROUND:
            taken = "twice" if name != BACKGROUND else "for the background alone"
            raise BadFile(f"{path.name}: object '{name}': 'name' is taken {taken}; choose another.")
    return SceneFile(
        folder=path.parent,
        items=items,
        background=read_background(background) if background else None,
        **head,
    )


def read_head(file: Fields) -> dict[str, Any]:
    """What a scene says apart from its objects and its background: fields of SceneFile."""
    floor_y = file.value("floor_y", None)
    if floor_y is not None:
        floor_y = file.number("floor_y", None, "metres, or null for no floor,", -FAR_M, FAR_M)
    return {
        "floor_y": floor_y,
        "gravity_m_s2": file.number("gravity_m_s2", 9.81, "0 to 100 m/s2", 0, GRAVITY),
        "view": read_view(file.optional_object("view")),
        "views": read_views(file),
        "appearance": read_appearance(file),
        "sky": read_sky(file),
        "upright": read_upright(file.optional_object("up")),
        "sections": read_sections(file, ("world",)),
    }


def read_item(row: Fields, file: str) -> SceneItem:
    """One of "objects"."""
    name = row.line("name")
    if len(name) > LONGEST_NAME:
        raise row.error("name", f"a name of at most {LONGEST_NAME} letters")
    row.where = f"{file}: object '{name}'"
    values = read_looks(row) | {
        "static": row.flag("static"),
        "floats": row.flag("floats"),
        "doubt": row.text("doubt", ""),
        "mass_kg": row.number("mass_kg", 1.0, "kilograms above 0", 1e-9, MASS),
        "states": tuple(map(read_state, row.rows("states", MOST_ROWS, "state"))),
        "ring": row.flag("ring"),
        "reactions": tuple(map(read_reaction, row.rows("reactions", MOST_ROWS, "reaction"))),
        "two_axes": read_two_axes(row.optional_object("two_axes")),
    }
    row.refuse_unknown_keys()
    names = [state.name for state in values["states"]]
    if twice := [name for name in names if names.count(name) > 1]:
        raise BadFile(f"{row.where}: 'states': two are called '{twice[0]}'.")
    if values["reactions"] and values["static"] and not values["collider"]:
        kinds = {reaction.on for reaction in values["reactions"]} - {"enter"}
        if kinds:
            raise BadFile(f"{row.where}: 'collider' is missing; nothing can touch it without one.")
    return SceneItem(name=name, **values)


def read_background(row: Fields) -> SceneItem:
    """It is touched and never moved, and answers to nothing."""
    values = read_looks(row)
    row.refuse_unknown_keys()
    return SceneItem(name=BACKGROUND, static=True, **values)


def read_looks(row: Fields) -> dict:
    """What objects and the background have alike."""
    collider = row.path("collider") if row.value("collider", None) is not None else None
    return {
        "model": row.path("model"),
        "mode": row.line("mode", "", MODES),
        "up": row.line("up", "", AXES),
        "flip": row.flag("flip"),
        **read_part(row),
        **read_pose(row.optional_object("pose")),
        "x": row.control("x", 0.0),
        "visible": row.flag("visible", True),
        "appearance": read_appearance(row),
        "selectors": read_selectors(row),
        "sections": read_sections(row),
        "collider": collider,
        "friction": row.number("friction", 0.6, "0 to 10", 0, FRICTION),
        "restitution": row.number("restitution", 0.0, "0 to 1", 0, RESTITUTION),
    }


def read_selectors(row: Fields) -> tuple[Selector, ...]:
    return tuple(map(read_selector_row, row.rows("selectors", MOST_ROWS, "selector")))


def read_part(row: Fields) -> dict:
    """Which part of its model an object is, and whether the file says where it stands."""
    part = row.value("part", None)
    if part is None:
        return {}
    if isinstance(part, str):
        row.line("part", wanted=PART)
    elif not (is_count(part) and part <= LARGEST_LABEL):
        raise row.error("part", PART)
    return {"part": part, "placed": row.has("pose")}


def read_pose(row: Fields | None) -> dict:
    if row is None:
        return {}
    position = row.numbers("position", 3, SceneItem.position, FAR_M)
    wxyz = row.numbers("wxyz", 4, SceneItem.wxyz)
    if not abs(math.hypot(*wxyz) - 1) <= UNIT_SLACK:
        raise row.error("wxyz", "a quaternion of length 1")
    row.refuse_unknown_keys()
    return {"position": position, "wxyz": wxyz}


def read_view(row: Fields | None) -> FirstView | None:
    if row is None:
        return None
    eye, target = row.numbers("eye", 3), row.numbers("target", 3)
    fov_y = row.number("fov_y", 0.8, "radians from 0.01 to 3", 0.01, 3.0)
    parallel = row.flag("orthographic")
    near_m = row.number("near_m", 0.0, "metres, 0 or more,", 0, FAR_M)
    row.refuse_unknown_keys()
    if math.dist(eye, target) < 1e-6 or math.dist(eye[::2], target[::2]) < 1e-6:
        raise row.error("target", "a place that is not straight above, below or in the eye")
    return FirstView(three(eye), three(target), fov_y, parallel, near_m)


def read_views(file: Fields) -> tuple[NamedView, ...]:
    """The list under "views": as "view", each with a name of its own."""
    found: list[NamedView] = []
    for row in file.rows("views", MOST_ROWS, "view"):
        name = row.line("name")
        if len(name) > LONGEST_NAME or name in [view.name for view in found]:
            raise row.error("name", f"a name of its own, of at most {LONGEST_NAME} letters,")
        view = read_view(row)
        assert view is not None, "there is a row"
        found.append(NamedView(name, view))
    return tuple(found)


def read_upright(row: Fields | None) -> Upright | None:
    """How the scene's up was found, which `segment` writes."""
    if row is None:
        return None
    ways, name = [], row.line("used", known=SOURCES)
    for each in row.rows("ways", len(SOURCES), "way"):
        direction = each.numbers("up", 3)
        if not abs(math.hypot(*direction) - 1) <= UNIT_SLACK:
            raise each.error("up", "a direction of length 1")
        things = tuple(each.texts("things")) if each.has("things") else ()
        source, sure = each.line("by", known=SOURCES), each.flag("sure", True)
        ways.append(Up(source, three(direction), sure, things))
        each.refuse_unknown_keys()
    row.refuse_unknown_keys()
    used = next((way for way in ways if way.source == name), None)
    if used is None:
        raise row.error("used", "the 'by' of one of its ways")
    return Upright(tuple(ways), used)


def read_state(row: Fields) -> State:
    values = {"name": row.line("name"), "x": row.control("x")}
    row.refuse_unknown_keys()
    return build(State, values, row.where)


def read_two_axes(row: Fields | None) -> TwoAxes | None:
    if row is None:
        return None
    plain = TwoAxes()
    values = {
        name: row.number(name, getattr(plain, name), "0 to 1", 0, 1)
        for name in ("below", "rest", "above")
    }
    row.refuse_unknown_keys()
    return TwoAxes(**values)


def read_reaction(row: Fields) -> Reaction:
    to, wanted = row.value("to"), "the name of a state, 'next' or a number from 0 to 1"
    to = row.line("to", wanted=wanted) if isinstance(to, str) else row.control("to", wanted=wanted)
    region = row.optional_object("region")
    values = {
        "on": row.line("on", known=KINDS),
        "to": to,
        "after": read_names(row, "from"),
        "least_impulse_n_s": row.number("least_impulse_n_s", 0.0, "N s, 0 or more,", 0),
        "seconds": row.number("seconds", 0.5, "seconds, 0 or more,", 0),
        "ease": row.line("ease", "smooth", tuple(EASES)),
        "cooldown_s": row.number("cooldown_s", 0.25, "seconds, 0 or more,", 0),
        "region": read_region(region) if region else None,
    }
    row.refuse_unknown_keys()
    return build(Reaction, values, row.where)


def read_names(row: Fields, key: str) -> tuple[str, ...]:
    """A name or a list of names."""
    value = row.value(key, [])
    names = [value] if isinstance(value, str) else value
    if not (isinstance(names, list) and all(isinstance(n, str) and n for n in names)):
        raise row.error(key, "the name of a state or a list of such")
    return tuple(names)


def read_region(row: Fields) -> Box | Sphere:
    """A box or a sphere of the world, without a control value."""
    row.data = {"x": 0, "space": "world", **row.data}
    if row.data["x"] != 0 or row.data["space"] != "world" or "border" in row.data:
        raise BadFile(f"{row.where}: a region has no 'x', 'border' or 'space'; leave them out.")
    row.line("kind", known=("box", "sphere"))
    region = read_selector_row(row)
    assert isinstance(region, Box | Sphere), "the kinds that are known here"
    return region
