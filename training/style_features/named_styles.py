"""Words that choose among the styles that this program has without any weights, by name and tag."""

import re
from dataclasses import dataclass
from difflib import get_close_matches

from shapeshift.runtime_models.model import BadFile

ALIKE = 0.8  # of difflib's ratio: as alike a word is taken for a tag


@dataclass(frozen=True)
class NamedStyle:
    """A shape by rule, or a picture of our own."""

    name: str
    kind: str  # "shape" or "picture"
    tags: tuple[str, ...]


def named(name: str, kind: str, tags: str) -> NamedStyle:
    return NamedStyle(name, kind, tuple(tags.split()))


NAMED_STYLES = (
    named("fur", "shape", "hair hairy furry grass grassy lawn meadow moss fluffy plush wool"),
    named("blocks", "shape", "cubes bricks brick voxels pixels felt clay toy dice"),
    named("bubbles", "shape", "soap foam froth balls balloons spheres bath"),
    named("points", "shape", "dots stars scan scanner laser dust sand particles pointillism"),
    named("melt", "shape", "melting molten wax candle honey lava drip dripping liquid chocolate"),
    named("explode", "shape", "explosion exploding burst blast shatter shattered debris"),
    named("strokes", "shape", "paint painted painting brush oil impressionism canvas"),
    named("glass", "picture", "stained window church mosaic cathedral leaded gothic"),
    named("swirl", "picture", "night starry swirls whirl blue gold wind waves"),
    named("ink", "picture", "drawing sketch pen hatching hatched engraving paper etching comic"),
)  # fmt: skip


def find_style(text: str) -> NamedStyle:
    """The style that most words of a text name.  Raises BadFile where none does."""
    words = [singular(word) for word in re.findall(r"[^\W\d_]+", text.lower())]
    scores = [score(style, words) for style in NAMED_STYLES]
    best = max(range(len(scores)), key=scores.__getitem__)
    if not scores[best] > 0:
        names = ", ".join(style.name for style in NAMED_STYLES)
        raise BadFile(
            f"no style of this program is called '{text[:60]}'; there are {names}: use such words, "
            "or give --clip-model, for which any words do."
        )
    return NAMED_STYLES[best]


def score(style: NamedStyle, words: list[str]) -> float:
    """How many of the words are its name (2 each) or a tag (1), alike ones a little less."""
    names = [singular(word) for word in (style.name, *style.tags)]
    total = 0.0
    for word in words:
        worth = 2.0 if word == names[0] else 1.0
        if word in names:
            total += worth
        elif len(word) > 3 and get_close_matches(word, names, 1, ALIKE):
            total += 0.5
    return total


def singular(word: str) -> str:
    """Without the s of most plurals."""
    return word[:-1] if len(word) > 3 and word.endswith("s") and not word.endswith("ss") else word
