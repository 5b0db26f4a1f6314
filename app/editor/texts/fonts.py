"""Fonts of this machine for languages whose letters our own font lacks."""

import os
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from shapeshift.app.editor.texts.table import Language, all_languages, language_in_use

OWN_LETTERS = 0x500  # code points below: Latin, Greek and Cyrillic, which our own font has
PUNCTUATION = (0x2000, 0x2200)  # as are dashes, dots and arrows
# Beginnings of file names, small letters, the best first: what desktops bring for Japanese.
JAPANESE_FONTS = (
    "notosanscjk", "notosansjp", "yugothr", "yugothm", "meiryo.", "hiragino", "\u30d2\u30e9\u30ae",
    "ipaexg", "ipag", "takaogothic", "takaopgothic", "vl-gothic", "vl-pgothic", "sawarabi-gothic",
    "fonts-japanese-gothic", "droidsansfallback", "wqy-", "msgothic",
)  # fmt: skip
BOLD = ("bold", "black", "light", "thin", "mono")  # not for running text
ENDINGS = (".ttf", ".ttc", ".otf")
MOST_FILES = 20_000  # that are looked through


def missing_letters(language: Language) -> list[int]:
    """Code points of a language that our own font lacks."""
    first, last = PUNCTUATION
    return [n for n in language.letters if n >= OWN_LETTERS and not first <= n < last]


def font_folders() -> list[Path]:
    """Where this kind of machine keeps its fonts."""
    home = Path.home()
    if sys.platform == "win32":
        local = Path(os.environ.get("LOCALAPPDATA", home))
        return [
            Path(os.environ.get("WINDIR", "C:/Windows")) / "Fonts",
            local / "Microsoft/Windows/Fonts",
        ]
    if sys.platform == "darwin":
        return [Path("/System/Library/Fonts"), Path("/Library/Fonts"), home / "Library/Fonts"]
    shared = [Path("/usr/share/fonts"), Path("/usr/local/share/fonts")]
    return [home / ".local/share/fonts", home / ".fonts", *shared]


def font_files(folders: Sequence[Path]) -> Iterator[Path]:
    """Candidates for Japanese, the best first."""
    found, seen = [], 0
    for folder in folders:
        for place, _, names in os.walk(folder):
            seen += len(names)
            if seen > MOST_FILES:
                break
            found += [Path(place) / name for name in names if name.lower().endswith(ENDINGS)]

    def rank(path: Path) -> int:
        name = path.name.lower()
        known = (i for i, start in enumerate(JAPANESE_FONTS) if name.startswith(start))
        return next(known, len(JAPANESE_FONTS)) + 100 * any(word in name for word in BOLD)

    yield from sorted((p for p in found if rank(p) % 100 < len(JAPANESE_FONTS)), key=rank)


def has_letters(path: Path, letters: Sequence[int]) -> bool:
    """Whether a font file has a glyph for each of these code points; not where it is broken."""
    from matplotlib.ft2font import FT2Font  # 0.2 s, for those who ask alone

    try:
        font = FT2Font(str(path))
        return all(font.get_char_index(letter) for letter in letters)
    except (OSError, RuntimeError, ValueError):
        return False


@cache
def font_for(code: str) -> Path | None:
    """A font of this machine with all letters of a language that our own lacks; None: none has."""
    letters = missing_letters(all_languages()[code])
    return next((p for p in font_files(font_folders()) if has_letters(p, letters)), None)


def more_letters(every: bool = False) -> list[Path]:
    """Fonts besides our own that the language in use needs, or `every` language that is offered."""
    languages = all_languages().values() if every else (language_in_use(),)
    found = [font_for(each.code) for each in languages if missing_letters(each)]
    return [path for path in dict.fromkeys(found) if path is not None]


def is_offered(code: str) -> bool:
    """Whether a language can be shown here."""
    return not missing_letters(all_languages()[code]) or font_for(code) is not None


def why_not(language: Language) -> str:
    """One sentence for a language that is not offered."""
    return (
        f"{language.name} is not offered: no font here has its letters; install one, "
        "for example Noto Sans CJK."
    )
