"""Sections as text, for commands: plane:0,1,0,0.4:soft:0.05 and the like."""

from collections.abc import Sequence

from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.shapes import three
from shapeshift.runtime_models.stop import Stop
from shapeshift.runtime_models.stop_weights import parse_control
from shapeshift.scene.sections.section import (
    CAPPED,
    EDGES,
    SOFT,
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
