"""Texts of the overlay in the language that is in use.

The code says them in English; a table has what stands for each in another language.  A file
CODE.json beside this one is all that another language needs: {"name", "texts": {English: other}}.
"""

import json
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ENGLISH = "en"


@dataclass(frozen=True)
class Language:
    """A table of texts; what it lacks is said in English."""

    code: str  # ISO 639-1
    name: str  # as people who speak it read it with the letters of any font
    texts: dict[str, str] = field(default_factory=dict)

    @property
    def letters(self) -> list[int]:
        """Code points of all letters in its texts, ascending."""
        return sorted({ord(letter) for text in self.texts.values() for letter in text})


@cache
def all_languages() -> dict[str, Language]:
    """By code, English first."""
    found = {ENGLISH: Language(ENGLISH, "English")}
    for path in sorted(Path(__file__).parent.glob("*.json")):
        table = json.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = Language(path.stem, table["name"], table["texts"])
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
