"""Pictures of an inspection: heat in a palette between two ends, alarms over the photo, marks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapeshift.renderer.colors.palette import palette_values
from shapeshift.scene.inspection.marks import FACES, OUTSIDE, Isotherm, MarkReading
from shapeshift.scene.inspection.value_picture import ValuePicture

NOTHING = 0.16  # grey of pixels without a value
ALARMS = {"above": (1.0, 0.15, 0.1), "below": (0.1, 0.45, 1.0), "between": (0.2, 0.85, 0.3)}
ALARM_SHARE = 0.7  # of an alarm's colour over the photo
DIMMED = 0.45  # of the photo beside it, where there is an alarm
LINE, BEHIND, ASIDE = (255, 255, 255), (16, 16, 16), (170, 170, 170)
# Where a label is tried, in its own widths and heights: the nearest first, below before above.
LABEL_STEPS = np.array(
    sorted(
        ((x, y) for x in (0, -1, 1) for y in range(-12, 13)),
        key=lambda at: (abs(at[0]) * 3 + abs(at[1]), -at[1]),
    ),
    np.float64,
)
AUTO = (1.0, 99.0)  # percentiles between which --auto shows
BAR_PART, BAR_LEAST = 28, 14  # the scale bar is a part of the width, or so many pixels


@dataclass(frozen=True)
class ColorScale:
    """Which values a palette's ends stand for: level is the middle between them, span how far they
    are apart.
    """

    low: float
    high: float
    palette: str

    @property
    def level(self) -> float:
        return (self.low + self.high) / 2

    @property
    def span(self) -> float:
        return self.high - self.low


def auto_ends(values: np.ndarray, digits: int = 1) -> tuple[float, float]:
    """The ends that show nearly all values that are known, apart by the last of their digits at
    least; ValueError: there are none.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        raise ValueError("nothing is covered by a half in this view; choose another --camera.")
    low, high = np.percentile(known, AUTO)
    middle, half = (low + high) / 2, max(high - low, 10.0**-digits) / 2
    return float(middle - half), float(middle + half)


def heat_picture(picture: ValuePicture, scale: ColorScale) -> np.ndarray:
    """(H, W, 3) display sRGB of the values; grey where nothing is known."""
    share = (picture.values - scale.low) / (scale.high - scale.low)
    colors = palette_values(np.nan_to_num(share), scale.palette)
    return np.where(picture.known[..., None], colors, NOTHING).astype(np.float32)


def alarm_picture(
    below: np.ndarray, picture: ValuePicture, isotherms: Sequence[Isotherm]
) -> np.ndarray:
    """(H, W, 3) a picture with every isotherm's area in its colour; a later one lies above."""
    alarms = [(each, each.holds(picture.values) & picture.known) for each in isotherms]
    out = np.clip(np.asarray(below, np.float32), 0, 1)
    if alarms:
        out = out * DIMMED + out.mean(axis=2, keepdims=True) * (1 - DIMMED)
    for each, inside in alarms:
        color = np.array(ALARMS[each.kind], np.float32)
        mixed = ALARM_SHARE * color + (1 - ALARM_SHARE) * out
        out = np.where(inside[..., None], mixed, out)
    return out


def with_marks(
    image: np.ndarray, picture: ValuePicture, readings: Sequence[MarkReading]
) -> np.ndarray:
    """The picture with each mark that is seen, its name and its value."""
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    drawn = Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8))
    draw = ImageDraw.Draw(drawn)
    height = max(10, drawn.height // 36)  # pixels of a letter
    font = letters(height)
    labels: list[tuple[str, str, float]] = []  # of a mark, beside it in grey, pixels of the first
    corners, sizes = [], []
    for reading in readings:
        if reading.hidden == OUTSIDE or not (reading.samples or np.isfinite(reading.value)):
            continue
        outline = outline_of(reading, picture, height)
        if not np.all(np.isfinite(np.concatenate(outline))):
            continue  # behind the eye, in whole or in part
        for color, width in ((BEHIND, 3), (LINE if reading.samples else ASIDE, 1)):
            for line in outline:
                draw.line([tuple(p) for p in line], fill=color, width=width)
        digits, now = picture.digits, reading.value_now
        text = drawable(f"{reading.mark.name} {reading.value:.{digits}f}", height)
        aside = reading.hidden or f"{now:.{digits}f}"
        aside = "" if text.endswith(f" {aside}") else drawable(f" {aside}", height)
        wide = draw.textlength(text, font)
        labels.append((text, aside, wide))
        corners.append(np.concatenate(outline).max(axis=0) + 2)
        sizes.append((wide + draw.textlength(aside, font) + 4, height + 4))
    for label, place, size in zip(
        labels, label_places(corners, sizes, drawn.size), sizes, strict=True
    ):
        if place is None:
            continue
        (left, top), (text, aside, wide) = place, label
        draw.rectangle((left, top, left + size[0], top + size[1]), fill=BEHIND)
        draw.text((left + 2, top + 1), text, fill=LINE, font=font)
        draw.text((left + 2 + wide, top + 1), aside, fill=ASIDE, font=font)
    return np.asarray(drawn, np.float32) / 255


def label_places(
    corners: Sequence[np.ndarray], sizes: Sequence[tuple[float, float]], room: tuple[int, int]
) -> list[tuple[float, float] | None]:
    """Left upper corners of labels that do not overlap and lie in the room (w, h): each as near as
    may be to where it is wanted, the first ones nearest; None: there is no room for it.
    """
    taken = np.zeros((0, 4))  # left, top, right, bottom
    places: list[tuple[float, float] | None] = []
    for corner, (wide, high) in zip(corners, sizes, strict=True):
        most = np.array([room[0] - wide - 1, room[1] - high - 1])
        if not (most >= 0).all():
            places.append(None)
            continue
        first = np.clip(corner, 0, most)
        tried = first + LABEL_STEPS * (wide + 2, high + 2)
        tried = tried[np.logical_and.reduce((tried >= 0) & (tried <= most), axis=1)]
        low, end = tried[:, None], tried[:, None] + (wide + 1, high + 1)  # (c, 1, 2)
        apart = (end <= taken[:, :2]) | (low >= taken[:, 2:])  # (c, taken, 2)
        free = np.array([bool(each.any(axis=1).all()) for each in apart])
        if not free.any():
            places.append(None)
            continue
        left, top = tried[int(np.argmax(free))]
        taken = np.append(taken, [[left, top, left + wide + 1, top + high + 1]], axis=0)
        places.append((float(left), float(top)))
    return places


def outline_of(reading: MarkReading, picture: ValuePicture, size: int) -> list[np.ndarray]:
    """Lines (n, 2) of pixels of the picture's view that show where a mark is."""
    mark = reading.mark
    pixels, depth = picture.pixel_of(mark.points)
    if mark.kind == "spot":
        (x, y), r, gap = pixels[0], 0.8 * size, 0.25 * size
        ends = [(-r, 0, -gap, 0), (gap, 0, r, 0), (0, -r, 0, -gap), (0, gap, 0, r)]
        return [np.array([(x + a, y + b), (x + c, y + d)]) for a, b, c, d in ends]
    if mark.kind == "circle":
        _, fx, fy, _, _ = picture.view.pinhole()
        turn = np.linspace(0, 2 * np.pi, 49)
        around = np.stack([np.cos(turn) * fx, np.sin(turn) * fy], axis=1)
        return [pixels[0] + around * mark.radius_m / depth[0]]
    if mark.kind == "line":
        return [pixels[np.isfinite(pixels).all(axis=1)]]
    if not np.isfinite(pixels).all():
        return [np.array([reading.hottest or (np.nan, np.nan)] * 2)]
    edge_on = _rectangle(pixels)
    return [edge_on] if edge_on is not None else [pixels[[*face, face[0]]] for face in FACES]


def _rectangle(pixels: np.ndarray) -> np.ndarray | None:
    """(5, 2) of a box seen from where it was laid: its far face lies behind the near one."""
    size = float(np.ptp(pixels, axis=0).max())
    if np.abs(pixels[:4] - pixels[4:]).max() > 0.05 * size:
        return None
    return pixels[[0, 1, 2, 3, 0]]


def with_scale_bar(image: np.ndarray, scale: ColorScale, unit: str) -> np.ndarray:
    """(H, W + bar, 3) the picture with the palette and its values at its right."""
    from PIL import Image, ImageDraw

    from shapeshift.renderer.debug.letters import drawable, letters

    rows, columns = image.shape[:2]
    height = max(10, rows // 36)
    width = max(BAR_LEAST, columns // BAR_PART)
    ticks = scale_ticks(scale.low, scale.high, max(2, rows // (4 * height)))
    font = letters(height)
    texts = [drawable(f"{tick:g} {unit}".rstrip(), height) for tick in ticks]
    room = width + 3 * (height // 2) + int(max(font.getlength(text) for text in texts))
    side = Image.new("RGB", (room, rows), BEHIND)
    top, low = height, rows - height  # of the bar
    share = 1 - (np.arange(top, low) + 0.5 - top) / (low - top)
    colors = palette_values(share, scale.palette)[:, None].repeat(width, axis=1)
    side.paste(Image.fromarray((colors * 255 + 0.5).astype(np.uint8)), (height // 2, top))
    draw = ImageDraw.Draw(side)
    for tick, text in zip(ticks, texts, strict=True):
        y = low - (tick - scale.low) / scale.span * (low - top)
        draw.text((width + height, y - 0.6 * height), text, fill=LINE, font=font)
    return np.concatenate([image, np.asarray(side, np.float32) / 255], axis=1)


def scale_ticks(low: float, high: float, most: int) -> list[float]:
    """Round values from low to high, at most so many but for one."""
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(i * step, 10) + 0.0 for i in range(first, last + 1)] or [low]
