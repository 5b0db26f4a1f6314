"""Words that choose among the styles that this program has without any weights, by name and tag."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from PIL import Image, ImageDraw

from shapeshift.runtime_models.model import BadFile

# Style pictures drawn by this program: what the tests, the rows and the gallery are made with.

GLASS = ((191, 31, 26), (242, 166, 26), (26, 77, 153), (26, 128, 89), (230, 217, 153),
         (89, 26, 102), (13, 31, 77))  # fmt: skip
NIGHT = ((240, 220, 120), (30, 70, 150), (60, 120, 190), (15, 35, 90), (140, 180, 210),
         (235, 170, 60))  # fmt: skip
INK = ((24, 22, 30), (60, 54, 60), (120, 108, 100))
PAPER = (238, 228, 208)


def stained_glass(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: cells of bright colours between dark leads."""
    rng = np.random.default_rng(seed)
    count = 140
    places = rng.random((count, 2)) * size
    color = np.array(GLASS)[rng.integers(len(GLASS), size=count)] / 255
    color = color * rng.uniform(0.8, 1.15, (count, 1))
    down, across = np.mgrid[:size, :size] + 0.5
    distance = np.hypot(across[..., None] - places[:, 0], down[..., None] - places[:, 1])
    nearest = np.argsort(distance, axis=2)[..., :2]
    first, second = np.moveaxis(np.take_along_axis(distance, nearest, 2), 2, 0)
    lead = np.clip((second - first) / (4 * size / 256), 0, 1)[..., None]
    grain = 0.85 + 0.15 * rng.random((size, size, 1))
    return np.clip(color[nearest[..., 0]] * lead * grain, 0, 1).astype(np.float32)


def swirl(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: short strokes of blue and gold that follow a swirl."""
    rng = np.random.default_rng(seed)
    image, unit = Image.new("RGB", (size, size), (20, 40, 90)), size / 256
    draw = ImageDraw.Draw(image)
    for _ in range(2600):
        x, y = rng.random(2) * 256
        turn = np.sin(x / 35) * 1.5 + np.cos(y / 28) * 1.8
        length = rng.uniform(6, 14)
        kind = int((np.sin(x / 50 + y / 60) + 1) / 2 * 3) + (rng.random() < 0.25) * 2
        shade = tuple(int(np.clip(c + rng.normal() * 18, 0, 255)) for c in NIGHT[kind % 6])
        ends = [x, y, x + length * np.cos(turn), y + length * np.sin(turn)]
        draw.line([unit * e for e in ends], fill=shade, width=round(unit * rng.integers(2, 5)))
    return np.asarray(image, np.float32) / 255


def ink_hatching(size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size, 3) float32: dark strokes on paper, dense in some places, crossed in others."""
    rng = np.random.default_rng(seed)
    image, unit = Image.new("RGB", (size, size), PAPER), size / 256
    draw = ImageDraw.Draw(image)
    for _ in range(1900):
        x, y = rng.random(2) * 256
        dark = (np.sin(x / 31 + 1) * np.cos(y / 43) + 1) / 2
        if rng.random() > dark:
            continue
        turn = 0.8 if rng.random() < 0.7 else -0.7
        length = rng.uniform(12, 34)
        ends = [x, y, x + length * np.cos(turn), y + length * np.sin(turn)]
        shade = INK[rng.integers(len(INK))]
        draw.line([unit * e for e in ends], fill=shade, width=max(round(unit * 1.4), 1))
    return np.asarray(image, np.float32) / 255


MADE_STYLES: dict[str, Callable[[int, int], np.ndarray]] = {
    "glass": stained_glass,
    "swirl": swirl,
    "ink": ink_hatching,
}


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
