"""The chart as a picture: speed against likeness, the Pareto front drawn and named."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from shapeshift.app.charts.chart_measure import ChartRow
from shapeshift.runtime_models.files.plain_text import one_line, several_lines
from shapeshift.runtime_models.files.whole_file import whole_file

WIDTH, HEIGHTS, DPI = 8.3, (4.6, 3.4), 200  # inches: a README shows it 830 pixels wide
SAME_SPEED = 0.02  # of the exact setting's: less than this is no difference
TOP_DB = 100.0  # drawn here: equal, or so near that nothing can tell them apart
FAMILIES = {  # name -> (colour, fields that belong to it)
    "order": ("#0072b2", ("key_bits", "order", "resort_frames", "resort_degrees", "stereo_sort")),
    "culls": ("#d55e00", ("min_alpha", "low_pass", "max_pixels", "max_distance", "min_pixels",
                          "fade")),
    "colour": ("#009e73", ("recolor_degrees", "skip_unseen", "stereo_colors")),
    "pixels": ("#cc79a7", ("target", "render_scale", "min_transmittance")),
    "budget": ("#56b4e9", ("budget", "target")),
    "several of them": ("#56564f", ()),
}  # fmt: skip
INK, PALE, FRONT = "#222222", "#e4e4e0", "#a8a49a"
TITLES = {1: "One eye", 2: "Two eyes, beside exact frames of two eyes{}"}
REACHES = (9, 15, 24, 36, 50, 66, 84)  # points from a dot to its name: the first free place
BEADS = 60  # of each line of the front
LINE_PARTS = np.arange(3, 12)[:, None] / 12  # of a line to a name, beyond its own dot
CROSSING = 100.0  # square pixels that a point of the line under another name counts as
SIDES = ((1, 1), (1, 0), (-1, -1))  # above a falling front there is room; below it dots


def draw_chart(
    rows: Sequence[ChartRow], title: str, folder: Path, on_cpu: bool = False
) -> list[ChartRow]:
    """Writes chart.svg and chart.png; returns the front of one eye, exact to fastest.

    on_cpu: the processor draws, so its time is what a frame costs, and other load does not count;
    `ratio` of the rows returned is that of processor time then.
    """
    from matplotlib.figure import Figure

    if on_cpu:
        rows = [replace(row, ratio=row.cpu_ms / row.exact_cpu_ms) for row in rows]
    clock = "processor time" if on_cpu else "frame time"
    panels = {eyes: [row for row in rows if row.eyes == eyes] for eyes in (1, 2)}
    panels[2], second_eye = _beside_two_eyes(panels[2])
    panels = {eyes: found for eyes, found in panels.items() if found}
    heights = HEIGHTS[: len(panels)]
    figure = Figure((WIDTH, sum(heights) + 0.5), layout="constrained", facecolor="white")
    figure.suptitle(several_lines(title), fontsize=10, color=INK)
    axes = figure.subplots(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    fronts = {}
    for axis, (eyes, found) in zip(axes, panels.items(), strict=True):
        title = TITLES[eyes].format(second_eye) if len(panels) > 1 else ""
        fronts[eyes] = _panel(axis, found, title, clock)
    figure.draw_without_rendering()  # the layout is settled before names look for room
    figure.set_layout_engine("none")
    for axis, (eyes, found) in zip(axes, panels.items(), strict=True):
        name_points(axis, [_place(r) for r in fronts[eyes]], [r.name for r in fronts[eyes]],
                    [_place(r) for r in found])  # fmt: skip
    save_figure(figure, folder / "chart")
    return fronts.get(1, [])


def _beside_two_eyes(rows: list[ChartRow]) -> tuple[list[ChartRow], str]:
    """Rows of two eyes with exact at 1: it was measured against one eye; and its ratio there."""
    second = next((row for row in rows if row.name == "stereo"), None)
    if second is None:
        return rows, ""
    plain = replace(second, name="exact", ratio=1.0, psnr_db=TOP_DB, sweep_psnr_db=TOP_DB)
    note = f" ({second.ratio:.2f} times one eye)"
    return [plain, *(row for row in rows if row is not second)], note


def _place(row: ChartRow) -> tuple[float, float]:
    """Where a row lies: times as fast as exact, dB up to TOP_DB."""
    return 1 / row.ratio, min(row.db, TOP_DB)


def _panel(axis, rows: list[ChartRow], title: str, clock: str) -> list[ChartRow]:
    """Dots, front and axes; returns the rows of the front, most alike first."""
    drawn = [row for row in rows if row.db == row.db and row.ratio > 0]
    # The same speed within what a measurement can tell: then the row that stands first, exact.
    alike = [(round(x / SAME_SPEED), y) for x, y in map(_place, drawn)]
    front = [drawn[i] for i in pareto_front(alike)][::-1]
    axis.plot(*zip(*map(_place, front), strict=True), color=FRONT, lw=1.4, zorder=1)
    for name, (color, _) in FAMILIES.items():
        mine = [row for row in drawn if family_of(row) == name]
        if mine:
            axis.scatter(*zip(*map(_place, mine), strict=True), s=26, color=color, zorder=3,
                         edgecolors="white", linewidths=0.6, label=name)  # fmt: skip
    plain = [_place(row) for row in drawn if not family_of(row)]
    if plain:
        axis.scatter(*zip(*plain, strict=True), s=40, color=INK, marker="D", zorder=4,
                     edgecolors="white", linewidths=0.6, label="exact")  # fmt: skip
    _style(axis, [_place(row) for row in drawn], title, clock)
    return front


def family_of(row: ChartRow) -> str:
    """Its kind, "" for exact; defaults under another name are the 16-bit target of quads."""
    return "" if row.name == "exact" else family(row.changes) or "pixels"


def family(changes: str) -> str:
    """Which kind of shortcut a row is, from the fields that it changes."""
    changed = {word.split("=")[0] for word in changes.split()} - {""}
    if "target=rgba16f" in changes.split() and len(changed) > 1:
        changed.discard("target")
    for name, (_, members) in FAMILIES.items():
        if changed and changed <= set(members):
            return name
    return "several of them" if changed else ""


def _style(axis, places: list[tuple[float, float]], title: str, clock: str) -> None:
    """Axes with room for names on every side, ticks that say what the top means."""
    fastest = max(x for x, _ in places)
    least = min(y for _, y in places)
    slowest = min(x for x, _ in places)
    span = max(fastest - slowest, 0.2)
    axis.set_xlim(slowest - 0.12 * span, fastest + 0.3 * span)
    low = 10 * (least // 10)
    axis.set_ylim(low - 4, TOP_DB + 12)
    ticks = [tick for tick in range(int(low), int(TOP_DB), 10)]
    axis.set_yticks([*ticks, TOP_DB], [*map(str, ticks), "equal"])
    note = f"speed by {clock}, times the exact setting in the same run"
    axis.set_xlabel(note, fontsize=9, color=INK)
    axis.set_ylabel("worst PSNR to the exact picture, dB", fontsize=9, color=INK)
    axis.tick_params(labelsize=8, colors=INK)
    axis.grid(color=PALE, lw=0.6, zorder=0)
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    axis.set_title(one_line(title), fontsize=9, color=INK, loc="left")
    axis.legend(fontsize=7.5, loc="upper right", frameon=True, framealpha=0.9, edgecolor=PALE)


def name_points(axis, places, names, occupied) -> list:
    """Writes each name beside its place, where it covers no other name and no dot.

    places: (x, y) of the names; occupied: (x, y) of all dots.  Returns the annotations; a name
    for which no place is free goes where it overlaps least.
    """
    pixels = axis.figure.dpi / 72  # per point
    dots = [axis.transData.transform(place) for place in occupied]
    line = [axis.transData.transform(place) for place in places]
    parts = np.linspace(0, 1, BEADS)[:, None]
    beads = [start + (end - start) * parts for start, end in pairwise(line)]  # the front itself
    taken = [
        np.array([(*(dot - 3 * pixels), *(dot + 3 * pixels)) for dot in dots]).reshape(-1, 4),
        *(np.hstack([each - pixels, each + pixels]) for each in beads),
    ]
    if axis.get_legend() is not None:
        taken.append(axis.get_legend().get_window_extent().extents.reshape(1, 4))
    boxes = np.concatenate(taken)  # (B, 4) x0, y0, x1, y1 in pixels: what no name may cover
    written = []
    for start, place, name in zip(line, places, names, strict=True):
        note = axis.annotate(name, place, xytext=(0, 0), textcoords="offset points", fontsize=8,
                             color=INK, zorder=5)  # fmt: skip
        _, _, reach, side = min(
            (_overlap(note, start, reach, side, boxes), number, reach, side)
            for number, (reach, side) in enumerate((r, s) for r in REACHES for s in SIDES)
        )
        _move(note, reach, side)
        box = note.get_window_extent().extents
        boxes = np.vstack([boxes, box + np.array([-2, -2, 2, 2])])
        if reach > REACHES[0]:
            _lead(axis, start, box)
        written.append(note)
    return written


def _move(note, reach: float, side: tuple[int, int]) -> None:
    dx, dy = side
    note.xyann = (dx * reach * (0.6 if dy else 1), dy * reach * (0.8 if dx else 1))
    note.set_ha({1: "left", -1: "right"}[dx])
    note.set_va({1: "bottom", 0: "center", -1: "top"}[dy])


def _overlap(note, start, reach: float, side: tuple[int, int], boxes: np.ndarray) -> float:
    """Square pixels of the name over others, beyond the axes, and of others under its line."""
    _move(note, reach, side)
    box, frame = note.get_window_extent().extents, note.axes.get_window_extent().extents
    inside = _shared(box, frame[None])
    cost = _shared(box, boxes) + 4 * ((box[2] - box[0]) * (box[3] - box[1]) - inside)
    if reach > REACHES[0]:
        steps = start + (np.clip(start, box[:2], box[2:]) - start) * LINE_PARTS  # (P, 2)
        under = (steps[:, None] >= boxes[:, :2]) & (steps[:, None] <= boxes[:, 2:])  # (P, B, 2)
        cost += CROSSING * under.all(axis=2).sum()
    return round(float(cost), 1)


def _shared(box: np.ndarray, boxes: np.ndarray) -> float:
    """Square pixels that a box (4,) shares with others (B, 4)."""
    sides = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])  # (B, 2)
    return float(np.clip(sides, 0, None).prod(axis=1).sum())


def _lead(axis, start: np.ndarray, box: np.ndarray) -> None:
    """A thin line from a dot at `start` (pixels) to its name where they are apart."""
    ends = axis.transData.inverted().transform([start, np.clip(start, box[:2], box[2:])])
    axis.plot(*ends.T, color=INK, lw=0.5, alpha=0.5, zorder=2, scalex=False, scaley=False)


def save_figure(figure, path: Path) -> None:
    """path.svg and path.png, each all or nothing; the same rows make the same bytes."""
    import matplotlib

    for ending, metadata in (("svg", {"Date": None}), ("png", {"Software": "Shapeshift"})):
        whole = whole_file(path.with_name(f"{path.name}.{ending}"))
        fixed = matplotlib.rc_context({"svg.hashsalt": "shapeshift", "svg.fonttype": "path"})
        with whole as file, fixed:
            figure.savefig(file, format=ending, dpi=DPI, metadata=metadata)


# The Pareto front: what nothing else beats in both figures at once.


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other one equals or beats in both numbers, larger is better.

    By falling first number.  Of equal points the first counts; a point with NaN never does.
    """
    whole = [i for i, (a, b) in enumerate(points) if a == a and b == b]
    order = sorted(whole, key=lambda i: (-points[i][0], -points[i][1], i))
    front: list[int] = []
    best = float("-inf")
    for i in order:
        if points[i][1] > best or (not front):
            front.append(i)
            best = points[i][1]
    return front
