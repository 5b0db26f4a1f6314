"""Sections as rows of a scene file, both ways: {"plane": [nx, ny, nz, d], "edge": "hard"}."""

from shapeshift.runtime_models.files.json_fields import Fields, control_row
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.shapes import four, three
from shapeshift.scene.sections.section import (
    CAPPED,
    EDGES,
    SPACES,
    UPRIGHT,
    BoxShape,
    PlaneShape,
    SceneSection,
)

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
