"""Words out of files for people: nothing that steers a terminal or the eye, nothing endless.

A name may hold escape sequences that clear a screen, rename a window or write into the clipboard,
signs that turn the order of letters around, halves of UTF-16 pairs that no output takes, or a
million letters.  What is written out stands as in Python: \\x1b, \\u202e.
"""

import json
import math
import re

# Control characters; signs of direction (Unicode's Bidi_Control); separators of lines and
# paragraphs; signs without a glyph that nobody types: byte order marks, annotations, old formatting
# and tags; halves of surrogate pairs.
UNSAFE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\u2028\u2029\ufeff"
    "\ufff9-\ufffb\u206a-\u206f\ud800-\udfff\U000e0000-\U000e007f]"
)
LONGEST_WORD = 260  # letters between blanks: as long as paths of Windows may be
LONGEST_LINE = 1000
LONGEST_NAME = 80
LONG_WORD = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


def one_line(text: str, most: int = LONGEST_LINE) -> str:
    """The text on one line, with whatever is unsafe written out, and shortened in its middle."""
    if text.isascii() and text.isprintable() and len(text) <= min(most, LONGEST_WORD):
        return text
    return shortened_line(UNSAFE.sub(written_out, text), most)


def several_lines(text: str) -> str:
    """The same of each line of a text; tabulators stay."""
    if text.isascii() and text.isprintable() and len(text) <= LONGEST_WORD:
        return text
    lines = text.split("\n")
    return "\n".join("\t".join(map(one_line, line.split("\t"))) for line in lines)


def name_line(text: object) -> str:
    """A name out of a file: one line, LONGEST_NAME letters."""
    return one_line(str(text), LONGEST_NAME)


def json_text(value: object, indent: int | None = 1, ascii_only: bool = False) -> str:
    """JSON that holds nothing unsafe but the line breaks of its indentation.

    What is unsafe in a text is escaped, so that it is read back as it was; NaN and Inf are null.
    """
    try:
        text = json.dumps(value, indent=indent, ensure_ascii=ascii_only, allow_nan=False)
    except ValueError:  # NaN or Inf
        text = json.dumps(finite(value), indent=indent, ensure_ascii=ascii_only, allow_nan=False)
    return UNSAFE.sub(lambda found: found[0] if found[0] == "\n" else escaped(found), text)


def finite(value: object) -> object:
    """The same with None for numbers that JSON has not."""
    if isinstance(value, dict):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def written_out(found: re.Match) -> str:
    return found[0].encode("unicode_escape").decode()


def escaped(found: re.Match) -> str:
    """As JSON writes a character: by its UTF-16 numbers."""
    units = found[0].encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[i : i + 2].hex()}" for i in range(0, len(units), 2))


def shortened_line(text: str, most: int) -> str:
    """With long words and then the whole cut in their middle."""
    if len(text) > LONGEST_WORD:
        text = LONG_WORD.sub(lambda word: shorten_middle(word[0], LONGEST_WORD), text)
    return shorten_middle(text, most)


def shorten_middle(text: str, most: int) -> str:
    """At most so many letters: the beginning, an ellipsis, the end."""
    if len(text) <= most:
        return text
    end = most // 3
    return f"{text[: most - end - 1]}\u2026{text[-end:]}"


def path_end(path: object) -> str:
    """The end of a path for a message: its last LONGEST_NAME letters."""
    text = str(path)
    return text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}"
