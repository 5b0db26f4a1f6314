"""The letters that are written into pictures: DejaVu Sans, which lies with matplotlib.

Pillow's own font has English ones only: all others would be boxes.
"""

from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from shapeshift.runtime_models.files.plain_text import one_line

if TYPE_CHECKING:
    from PIL import ImageFont

MISSING = "\uffff"  # no letter: its shape is that of all letters which the font has not


@cache
def letters(height: int, bold: bool = False) -> "ImageFont.FreeTypeFont":
    """The font, `height` pixels high."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name
    return ImageFont.truetype(str(path), height)


@lru_cache(maxsize=1024)
def drawable(text: str, height: int) -> str:
    """The text, on one line, with a question mark for every letter that the font has not."""
    text = one_line(text)
    font = letters(height)
    missing = bytes(font.getmask(MISSING))  # pyright: ignore[reportArgumentType]  # has a buffer
    return "".join(c if c == " " or bytes(font.getmask(c)) != missing else "?" for c in text)  # pyright: ignore[reportArgumentType]
