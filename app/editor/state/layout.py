"""Where the overlay's parts lie in a window of any size, and what they leave free for the scene.

Numbers only: the panels ask for boxes.  Lengths of the constants are units of the overlay: of
`scale` logical pixels each.
"""

from dataclasses import dataclass

Box = tuple[float, float, float, float]  # left, top, right, bottom

MARGIN = 16.0
STATUS = 24.0  # height of the line at the lower edge
PANEL = 310.0  # width, with the bar of tools
PANEL_ROOM = PANEL + 1.5 * MARGIN
FOLDED = 40.0  # side of the button that stands for a folded panel
BAR, BAR_FIRST, BAR_ROW = 92.0, 46.0, 71.0  # height with one slider; a row alone, and named
BAR_WIDEST, BAR_LEAST = 760.0, 300.0
BAR_PART = 0.94  # of the width that is there
BAR_BELOW = 18.0  # between the bar and the status line
LEGEND = 100.0  # width of the thermal legend with what lies at its right
LEGEND_TALL = 348.0
STRIP = 112.0  # height of the film's timeline over the whole lower edge
ROOMY = (280.0, 380.0)  # beside the panel, and high: with less it is folded until it is asked for
LEAST_BESIDE_LEGEND = 180.0  # with less the legend is left out
LEAST_FREE = 60.0  # with less of the window left the scene has all of it


@dataclass(frozen=True)
class Layout:
    """Logical pixels from the window's upper left corner; None: that part is not shown."""

    free: Box  # what nothing covers: the scene is framed in it
    panel: Box | None = None  # as far down as it may reach
    folded: bool = False  # `panel` is the button that unfolds it
    bar: Box | None = None
    legend: Box | None = None
    left_legend: Box | None = None
    status: Box | None = None
    strip: Box | None = None  # of the film


def lay_out(
    size: tuple[float, float],
    scale: float,
    rows: int,
    legend: bool,
    panel_open: bool | None = None,
    overlay: bool = True,
    both: bool = False,
    film: bool = False,
) -> Layout:
    """The parts in a window of `size` (W, H) logical pixels.

    `rows` is the number of sliders; `legend`: the scene has a value stop, so that room is kept
    for its legend at every x, and `both`: at the left as well.  `panel_open` None: as there is
    room.  `film`: its timeline lies under all else.
    """
    if not overlay:
        return Layout((0.0, 0.0, float(size[0]), float(size[1])))
    width, height = (side / scale for side in size)
    if panel_open is None:
        room = width - PANEL_ROOM - LEGEND * legend
        panel_open = room >= ROOMY[0] and height >= ROOMY[1]
    left = PANEL_ROOM if panel_open else 0.0
    beside = width - left >= BAR_LEAST  # else the bar has the whole width, and the panel ends above
    status_top = height - STATUS
    floor = status_top - STRIP * film
    bar = _bar(width, floor, left if beside else 0.0, rows)
    low = bar[1] if bar else floor
    legends = LEGEND * (1 + both)
    keep_legend = legend and width - left - legends >= LEAST_BESIDE_LEGEND
    edge = LEGEND * keep_legend
    free = (left + edge * both, 0.0, width - edge, low)
    if not (free[2] - free[0] >= LEAST_FREE and low >= LEAST_FREE):
        free, keep_legend = (0.0, 0.0, width, height), False
    panel_low = (floor if beside else low) - MARGIN
    panel = (MARGIN, MARGIN, MARGIN + PANEL, max(panel_low, MARGIN + 1.0))
    top = 0.0 if panel_open else MARGIN + FOLDED  # below the button
    if not panel_open:
        panel = (MARGIN, MARGIN, MARGIN + FOLDED, MARGIN + FOLDED)
    right_legend = _legend(free[2], free) if keep_legend else None
    left_legend = _legend(free[0] - LEGEND, free, top) if keep_legend and both else None
    return Layout(
        free=_scaled(free, scale),
        panel=_scaled(panel, scale),
        folded=not panel_open,
        bar=bar and _scaled(bar, scale),
        legend=right_legend and _scaled(right_legend, scale),
        left_legend=left_legend and _scaled(left_legend, scale),
        status=_scaled((0.0, status_top, width, height), scale),
        strip=_scaled((0.0, floor, width, status_top), scale) if film else None,
    )


def _scaled(box: Box, scale: float) -> Box:
    left, top, right, bottom = box
    return (left * scale, top * scale, right * scale, bottom * scale)


def bar_height(rows: int) -> float:
    """Height of the slider bar, without what lies below it."""
    return 0.0 if rows < 1 else (BAR if rows < 2 else BAR_ROW * rows + BAR - BAR_FIRST) - BAR_BELOW


def _bar(width: float, floor: float, left: float, rows: int) -> Box | None:
    """In the middle of what is right of `left`, above the `floor`."""
    if rows < 1:
        return None
    half = min(BAR_WIDEST, BAR_PART * (width - left)) / 2
    middle, low = (left + width) / 2, floor - BAR_BELOW
    return (middle - half, low - bar_height(rows), middle + half, low)


def _legend(left: float, free: Box, top: float = 0.0) -> Box:
    """From `left` on, as high as the free part allows below `top`."""
    tall = min(LEGEND_TALL, 0.86 * (free[3] - max(free[1], top)))
    middle, gap = (max(free[1], top) + free[3]) / 2, MARGIN / 2
    return (left + gap, middle - tall / 2, left + LEGEND - gap, middle + tall / 2)
