"""What edits are called, in other languages: their names stand in a history, in English."""

import re

from shapeshift.app.editor.texts.table import said

# Of a thing or a count; the first that fits a deed is taken.
TEMPLATES = (
    "add {name}", "body of {name}", "copy {name}", "crop {count} anchors",
    "delete {count} anchors", "delete {name}", "edit {name}", "exposure of {name}",
    "gamma of {name}", "hide {count} anchors", "hide {name}", "look of {name}", "make {name}",
    "mass of {name}", "move {name}", "opacity of {name}", "paint {name}", "remove {name}",
    "rename {name}", "show {name}", "style of {name}", "take out {name}", "tint of {name}",
    "x of {name}",
)  # fmt: skip
DEEDS = (
    "add a section", "add a view", "background", "beyond a section", "clear the film",
    "delete a key of a stop", "delete a key of the camera", "edge of a section", "first look",
    "floor", "ground", "horizon", "keep as it stands", "key of a stop", "key of the camera",
    "length of the film", "move a key of the camera", "move a key of the stop", "move a section",
    "move the floor", "open a film", "remove a section", "sky", "switch a section",
    "way around the scene", "way past the cameras", "zenith",
)  # fmt: skip
THE_SCENE = "the scene"  # that has no name
PATTERNS = {
    text: re.compile(
        re.escape(text).replace(r"\{name\}", "(.+)").replace(r"\{count\}", r"([\d,]+)")
    )
    for text in TEMPLATES
}


def said_deed(what: str) -> str:
    """A deed in the language in use; one that nobody knows as it is."""
    if what in DEEDS:
        return said(what)
    for text, pattern in PATTERNS.items():
        if found := pattern.fullmatch(what):
            of = said(THE_SCENE) if found[1] == THE_SCENE else found[1]
            return said(text, **{"count" if "{count}" in text else "name": of})
    return what
