"""The keys "appearance" and "sky" of a scene file: read and written."""

from dataclasses import fields

from shapeshift.runtime_models.files.json_fields import Fields
from shapeshift.runtime_models.shapes import three
from shapeshift.scene.appearance import LIMITS, NEUTRAL, Appearance, Background, Color, Sky

COLORS = ("zenith", "horizon", "ground")


def read_appearance(row: Fields) -> Appearance:
    """What stands under "appearance"; neutral where nothing does.  Raises BadFile."""
    found = row.optional_object("appearance")
    if found is None:
        return NEUTRAL
    values: dict = {}
    for name in ("exposure", "gamma", "opacity"):
        least, most = LIMITS[name]
        usual = getattr(NEUTRAL, name)
        values[name] = found.number(name, usual, f"{least:g} to {most:g}", least, most)
    values["tint"] = read_color(found, "tint", NEUTRAL.tint, LIMITS["tint"][1])
    found.refuse_unknown_keys()
    return Appearance(**values)


def read_sky(row: Fields) -> Sky | None:
    """What stands under "sky": one colour, or one at the zenith, the horizon and the ground."""
    value = row.value("sky", None)
    if value is None:
        return None
    if isinstance(value, list):
        color = read_color(row, "sky")
        return Sky(color, color, color)
    found = row.object("sky")
    sky = Sky(*(read_color(found, name) for name in COLORS))
    found.refuse_unknown_keys()
    return sky


def read_color(row: Fields, key: str, usual: Color | None = None, most: float = 1.0) -> Color:
    """Three numbers from 0 to `most`; `usual` where the key is absent."""
    if usual is not None and row.value(key, None) is None:
        return usual
    color = row.numbers(key, 3)
    if not all(0 <= part <= most for part in color):
        raise row.error(key, f"a list of 3 numbers from 0 to {most:g}")
    return three(color)


def appearance_row(appearance: Appearance) -> dict:
    """The key of an appearance that is not neutral; what is usual is left out."""
    row = {
        field.name: getattr(appearance, field.name)
        for field in fields(Appearance)
        if getattr(appearance, field.name) != getattr(NEUTRAL, field.name)
    }
    return row | ({"tint": list(appearance.tint)} if "tint" in row else {})


def background_row(background: Background) -> list | dict:
    return sky_row(background) if isinstance(background, Sky) else list(background)


def sky_row(sky: Sky) -> list | dict:
    if sky.zenith == sky.horizon == sky.ground:
        return list(sky.horizon)
    return {name: list(getattr(sky, name)) for name in COLORS}
