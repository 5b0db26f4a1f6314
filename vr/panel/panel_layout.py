"""Where everything on the panel lies: rows from top to bottom, as pixels of its picture."""

from collections.abc import Sequence
from dataclasses import dataclass

from shapeshift.runtime_models.model import Stop
from shapeshift.vr.panel.panel_state import QUALITIES, Panel, Place

WIDTH = 1000  # pixels
WIDTH_M = 0.25  # metres, as a tablet on the wrist: at 0.35 m 310 pixels of an eye with 1,000
METRES_PER_PIXEL = WIDTH_M / WIDTH
MARGIN = 52
TRACK = (92, WIDTH - 92)  # left and right end of the slider's line
KNOB = 34  # radius
REACH = 1.7  # of the knob's radius: a hand is not that exact
CORNER = 44  # radius
HEAD, SLIDER, LEGEND, ROW, GAP, FOOT = 150, 184, 136, 92, 20, 62  # heights
LABEL = 214  # width of what stands left of a row's buttons

Box = tuple[float, float, float, float]  # left, top, right, bottom


@dataclass(frozen=True)
class Item:
    """Something that can be pressed."""

    name: str
    box: Box
    text: str = ""


@dataclass(frozen=True)
class Layout:
    """Boxes of the rows and items of one panel; None where it has no such row."""

    size: tuple[int, int]  # pixels
    head: Box
    track_y: float | None
    legend: Box | None
    labels: tuple[tuple[str, Place], ...]  # text and the middle of its left edge
    items: tuple[Item, ...]
    foot: float | None  # middle of the note's line

    @property
    def size_m(self) -> tuple[float, float]:
        return self.size[0] * METRES_PER_PIXEL, self.size[1] * METRES_PER_PIXEL


def lay_out(panel: Panel) -> Layout:
    """Rows that have nothing to say are left out, and the panel is the shorter."""
    right, y = WIDTH - MARGIN, MARGIN - 8
    items: list[Item] = []
    slider = panel.slider
    head = (MARGIN, y, right, y + HEAD)
    if len(panel.facts.sliders) > 1:
        items.append(Item("previous", (right - 196, y, right - 106, y + 84), "\u2039"))
        items.append(Item("next", (right - 90, y, right, y + 84), "\u203a"))
    track_y = legend = foot = None
    if slider is None:
        y += HEAD - 30
    else:
        y += HEAD
        track_y = y + 98
        items.append(Item("track", (TRACK[0], track_y - KNOB, TRACK[1], track_y + KNOB)))
        y += SLIDER
        if thermal_stop(panel) is not None:
            legend = (MARGIN, y, right, y + LEGEND - GAP)
            y += LEGEND
    labels = [("Quality", (MARGIN, y + ROW / 2)), ("Size", (MARGIN, y + ROW + GAP + ROW / 2))]
    names = [f"quality:{name}" for name in QUALITIES]
    items += _row(y, names, [name.capitalize() for name in QUALITIES], (1, 1, 1.4, 1))
    y += ROW + GAP
    items += _row(y, ["smaller", "size", "larger", "true"], ["\u2212", "", "+", "1 : 1"],
                  (0.8, 1.5, 0.8, 1.2))  # fmt: skip
    y += ROW + GAP
    texts = ["Recentre", "Put back", "Floor", "Exit"]
    items += _row(y, [text.lower() for text in texts], texts, (1.25, 1.25, 0.9, 0.9), MARGIN)
    y += ROW
    if panel.facts.note:
        foot = y + FOOT / 2 + 4
        y += FOOT - 20
    return Layout((WIDTH, round(y + MARGIN - 8)), head, track_y, legend, tuple(labels),
                  tuple(items), foot)  # fmt: skip


def item_at(panel: Panel, at: Place) -> str:
    """Name of what lies at a place; "plate" where nothing does, "" beside the panel."""
    layout, (x, y) = lay_out(panel), at
    if not (0 <= x < layout.size[0] and 0 <= y < layout.size[1]):
        return ""
    if layout.track_y is not None and abs(y - layout.track_y) <= KNOB * REACH:
        reach = KNOB * REACH
        if TRACK[0] - reach <= x <= TRACK[1] + reach:
            return "track"
    for item in layout.items:
        left, top, right, bottom = item.box
        if item.name not in ("track", "size") and left <= x < right and top <= y < bottom:
            return item.name
    return "plate"


def knob_place(panel: Panel) -> Place | None:
    """Where the knob's middle is; None without a slider."""
    layout, slider = lay_out(panel), panel.slider
    if slider is None or layout.track_y is None:
        return None
    return TRACK[0] + slider.x * (TRACK[1] - TRACK[0]), layout.track_y


def thermal_stop(panel: Panel) -> Stop | None:
    """The stop that the legend is of: the thermal one with values that is nearest to x."""
    slider = panel.slider
    stops = [s for s in slider.stops if s.kind == "thermal" and s.palette] if slider else []
    return min(stops, key=lambda stop: abs(stop.x - slider.x), default=None)


def _row(
    y: float,
    names: Sequence[str],
    texts: Sequence[str],
    shares: Sequence[float],
    left: float = LABEL,
) -> list[Item]:
    """Items side by side up to the right margin, as wide as their shares say."""
    gap = 12
    room = WIDTH - MARGIN - left - gap * (len(names) - 1)
    items = []
    for name, text, share in zip(names, texts, shares, strict=True):
        width = room * share / sum(shares)
        items.append(Item(name, (left, y, left + width, y + ROW), text))
        left += width + gap
    return items
