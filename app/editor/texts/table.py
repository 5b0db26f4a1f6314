"""What edits are called, in other languages: their names stand in a history, in English."""

import json
import re
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

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
    "add a section", "add a view", "alarm", "background", "beyond a section", "clear the film",
    "delete a key of a stop", "delete a key of the camera", "edge of a section", "emissivity",
    "first look", "floor", "ground", "horizon", "keep as it stands", "key of a stop",
    "key of the camera", "known length", "length of the film", "move a key of the camera",
    "move a key of the stop", "move a section", "move the floor", "open a film",
    "remove a section", "sky", "switch a section", "way around the scene", "way past the cameras",
    "zenith",
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


# Texts of the overlay in the language that is in use.
#
# The code says them in English; a table has what stands for each in another language. A file
# CODE.json beside this one is all that another language needs: {"name", "own", "texts": {English:
# other}}.

ENGLISH = "en"


@dataclass(frozen=True)
class Language:
    """A table of texts; what it lacks is said in English."""

    code: str  # ISO 639-1
    name: str  # as people who speak it read it with the letters of any font
    texts: dict[str, str] = field(default_factory=dict)
    own: str = ""  # its name in its own letters; "": `name` is that

    @property
    def letters(self) -> list[int]:
        """Code points of all letters in its texts, ascending."""
        texts = (*self.texts.values(), self.own)
        return sorted({ord(letter) for text in texts for letter in text})


@cache
def all_languages() -> dict[str, Language]:
    """By code, English first."""
    found = {ENGLISH: Language(ENGLISH, "English")}
    for path in sorted(Path(__file__).parent.glob("*.json")):
        table = json.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = Language(path.stem, table["name"], table["texts"], table.get("own", ""))
    return found


_in_use: list[Language] = [Language(ENGLISH, "English")]  # of the process: its one overlay's


def use_language(code: str) -> None:
    """What is said from the next frame on; English for a code that there is no table of."""
    languages = all_languages()
    _in_use[0] = languages.get(code, languages[ENGLISH])


def language_in_use() -> Language:
    return _in_use[0]


def said(text: str, **values: object) -> str:
    """A text in the language in use, with its {placeholders} filled where values are given.

    A text that no table has, such as a name out of a file, comes back as it is.
    """
    found = _in_use[0].texts.get(text, text)
    return found.format(**values) if values else found
