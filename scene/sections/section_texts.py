"""Sections as text, for commands: plane:0,1,0,0.4:soft:0.05 and the like."""

from collections.abc import Sequence

from shapeshift.runtime_models.files.json_fields import Fields, control_row
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import four, three
from shapeshift.runtime_models.stop import Stop
from shapeshift.runtime_models.stop_weights import parse_control
from shapeshift.scene.sections.section import (
    CAPPED,
    EDGES,
    SOFT,
    SPACES,
    UPRIGHT,
    BoxShape,
    PlaneShape,
    SceneSection,
)

LONGEST = 120  # letters of a section that are quoted
FORMS = {
    "plane": "plane:nx,ny,nz,d[:edge[:width]][:beyond=X]",
    "box": "box:x,y,z:hx,hy,hz[:edge[:width]][:beyond=X]",
}


def read_section(text: str, stops: Sequence[Stop] = ()) -> SceneSection:
    """A section of the world of a text; ValueError, one sentence, for what is none.

    edge: capped, hard or soft, which has a width in metres.  X: what is shown beyond, of `stops`.
    """
    line = one_line(text)
    said = f"'{line}'" if len(line) <= LONGEST else f"'{line[:LONGEST]}\u2026'"
    kind, *parts = text.split(":")
    if kind not in FORMS:
        raise ValueError(f"{said} is no section; {' or '.join(FORMS.values())} is wanted.")
    beyond = None
    joined = ":".join(parts)
    if "beyond=" in joined:
        joined, _, control = joined.partition("beyond=")
        parts = joined.rstrip(":").split(":")
        try:
            beyond = parse_control(control, stops)
        except ValueError as error:
            raise ValueError(f"{said}: beyond: {error}") from None
    form, shapes = FORMS[kind], 1 if kind == "plane" else 2
    numbers, rest = parts[:shapes], parts[shapes:]
    edge = rest[0] if rest else CAPPED
    try:
        if len(numbers) < shapes or len(rest) > 1 + (edge == SOFT):
            raise ValueError(f"there are {len(parts)} parts after '{kind}'")
        rows = [[float(number) for number in part.split(",")] for part in numbers]
        width = float(rest[1]) if len(rest) > 1 else 0.0
    except ValueError as error:
        raise ValueError(f"{said}: {one_line(str(error))[:80]}; write {form}.") from None
    if [len(row) for row in rows] != ([4] if kind == "plane" else [3, 3]):
        raise ValueError(f"{said} has not the numbers of {form}.")
    if edge not in EDGES:
        raise ValueError(f"{said}: edge is '{edge[:LONGEST]}'; {', '.join(EDGES)} are known.")
    try:
        shape: PlaneShape | BoxShape = (
            PlaneShape(three(rows[0][:3]), rows[0][3])
            if kind == "plane"
            else BoxShape(three(rows[0]), three(rows[1]))
        )
        return SceneSection(shape=shape, edge=edge, width_m=width, beyond=beyond)
    except ValueError as error:
        raise ValueError(f"{said}: {error}") from None


def read_box(text: str) -> BoxShape:
    """The box of a text box:x,y,z:hx,hy,hz alone; ValueError, one sentence, for anything else."""
    section = read_section(text)
    if not isinstance(section.shape, BoxShape) or text.count(":") != 2:
        line = one_line(text)[:LONGEST]
        raise ValueError(f"'{line}' is more than a box; box:x,y,z:hx,hy,hz is wanted.")
    return section.shape


# Sections as rows of a scene file, both ways: {"plane": [nx, ny, nz, d], "edge": "hard"}.

MOST_SECTIONS = 16  # of a scene, and of an object


def read_sections(row: Fields, spaces: tuple[str, ...] = SPACES) -> tuple[SceneSection, ...]:
    """What stands under "sections".  spaces: the ones there are, the usual one first.  BadFile."""
    found = row.rows("sections", MOST_SECTIONS, "section")
    return tuple(_read_section(each, spaces) for each in found)


def _read_section(row: Fields, spaces: tuple[str, ...]) -> SceneSection:
    for key in ("plane", "box"):
        row.value(key, None)  # both are keys here, whichever there is
    if row.has("plane") == row.has("box"):
        raise BadFile(f"{row.where}: wants either 'plane' or 'box'.")
    try:
        section = SceneSection(
            shape=_read_plane(row) if row.has("plane") else _read_box(row.object("box")),
            edge=row.line("edge", CAPPED, EDGES),
            width_m=row.number("width_m", 0.0, "metres, 0 or more,", 0),
            beyond=row.control("beyond") if row.has("beyond") else None,
            space=row.line("space", spaces[0], spaces),
            enabled=row.flag("enabled", True),
        )
    except BadFile:
        raise
    except ValueError as error:
        raise BadFile(f"{row.where}: {error}") from None
    row.refuse_unknown_keys()
    return section


def _read_plane(row: Fields) -> PlaneShape:
    *normal, offset = row.numbers("plane", 4)
    return PlaneShape(three(normal), offset)


def _read_box(row: Fields) -> BoxShape:
    box = BoxShape(
        three(row.numbers("centre", 3)),
        three(row.numbers("half", 3)),
        four(row.numbers("wxyz", 4, UPRIGHT)),
    )
    row.refuse_unknown_keys()
    return box


def section_row(section: SceneSection, space: str) -> dict:
    """The inverse of a row that `read_sections` reads, where `space` is usual."""
    row: dict[str, object] = {}
    shape = section.shape
    if isinstance(shape, PlaneShape):
        row["plane"] = [*shape.normal, shape.offset_m]
    else:
        box: dict[str, object] = {"centre": list(shape.centre), "half": list(shape.half)}
        if shape.wxyz != UPRIGHT:
            box["wxyz"] = list(shape.wxyz)
        row["box"] = box
    for name, usual in (("edge", CAPPED), ("width_m", 0.0), ("space", space), ("enabled", True)):
        if getattr(section, name) != usual:
            row[name] = getattr(section, name)
    if section.beyond is not None:
        row["beyond"] = control_row(section.beyond)
    return row
