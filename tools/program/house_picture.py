"""The rooms of the program as a house, a text of SVG: who imports whom, floor below floor.

A line goes from a room to each that it imports and that none of the others between them imports
for it; the rest stands in the room as words.  The same rooms give the same bytes.
"""

from textwrap import wrap
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

if TYPE_CHECKING:
    from tools.program.architecture import Room

WIDE, GUTTER, MARGIN = 960, 46, 20  # pixels
PLACES = {  # room: from where to where it goes, of the width; a new one needs a line here
    "shapeshift": (0.0, 1.0),
    "app": (0.0, 1.0),
    "vr": (0.0, 0.31),
    "renderer": (0.0, 0.31),
    "training": (0.345, 0.655),
    "decomposition": (0.69, 1.0),
    "scene": (0.345, 1.0),
    "rasterizer": (0.0, 0.31),
    "runtime_models": (0.345, 1.0),
}
INKS = {  # of a room and of what it imports: readable on white and on black
    "shapeshift": "#8b5cf6",
    "app": "#d6456f",
    "vr": "#0e9aa7",
    "renderer": "#3b82f6",
    "training": "#d97706",
    "decomposition": "#2f9e51",
    "scene": "#7c8798",
    "rasterizer": "#7c8798",
    "runtime_models": "#7c8798",
}
TEXT, SMALL = 13, 11.5  # letters' height; a letter is about half as wide
LETTER = 0.53
LINE, SMALL_LINE, PAD = 18, 15.5, 14
GAP, LANE = 50, 14  # between floors; a line that turns takes so much more
STYLE = """
svg { font-family: system-ui, "Segoe UI", Helvetica, Arial, sans-serif; }
.paper { fill: #ffffff; } .room { fill: #f6f8fa; stroke: #d0d7de; }
.name { fill: #1f2328; font-weight: 600; font-size: 17px; }
.what { fill: #1f2328; font-size: 13px; } .small { fill: #59636e; font-size: 11.5px; }
.floor { fill: #59636e; font-size: 22px; font-weight: 300; }
.line { fill: none; stroke-linejoin: round; } .count { font-size: 11.5px; font-weight: 600; }
.halo { stroke: #ffffff; } .beside { fill: none; stroke: #d0d7de; stroke-dasharray: 4 4; }
@media (prefers-color-scheme: dark) {
.paper { fill: #0d1117; } .room { fill: #161b22; stroke: #3d444d; }
.name, .what { fill: #f0f6fc; } .small, .floor { fill: #9da7b1; }
.halo { stroke: #0d1117; } .beside { stroke: #3d444d; }
}
"""


def across(part: float) -> float:
    return GUTTER + part * (WIDE - GUTTER - MARGIN)


def direct(room: "Room", rooms: dict[str, "Room"]) -> list[str]:
    """What it imports, without what one of these imports, too."""
    below = {name for other in room.imports for name in reached(rooms[other], rooms)}
    return [name for name in room.imports if name not in below]


def reached(room: "Room", rooms: dict[str, "Room"]) -> set[str]:
    """What it imports, and what these do."""
    return set(room.imports).union(*(reached(rooms[name], rooms) for name in room.imports))


def texts_of(room: "Room", rooms: dict[str, "Room"]) -> list[tuple[str, str]]:
    """(class, line): what stands in a room below its name."""
    left, right = map(across, PLACES[room.name])
    wide = right - left - 2 * PAD
    drawn = direct(room, rooms)
    more = [f"{name} {count:,}" for name, count in room.imports.items() if name not in drawn]
    letters = int(wide / SMALL / LETTER)
    rows = [("small", f"{room.files:,} files, {room.lines:,} lines")]
    rows += [("what", line) for line in wrap(room.purpose, int(wide / TEXT / LETTER))]
    for head, words in (("Shelves: ", room.shelves), ("Imports as well: ", more)):
        if words:  # a name and its number stay together
            joined = head + ", ".join(word.replace(" ", "\u00a0") for word in words) + "."
            rows += [("small", line) for line in wrap(joined, letters)]
    return rows


def height_of(rows: list[tuple[str, str]]) -> float:
    return 2 * PAD + LINE + sum(LINE if kind == "what" else SMALL_LINE for kind, _ in rows)


def box(room: "Room", rows: list[tuple[str, str]], top: float, high: float) -> list[str]:
    left, right = map(across, PLACES[room.name])
    ink, y = INKS[room.name], top + PAD + 11
    out = [
        f'<rect class="room" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
        f'height="{high:.1f}" rx="6"/>',
        f'<rect x="{left:.1f}" y="{top + 6:.1f}" width="4" height="{high - 12:.1f}" rx="2" '
        f'fill="{ink}"/>',
        text("name", left + PAD, y, room.name),
    ]
    for kind, line in rows:
        y += LINE if kind == "what" else SMALL_LINE
        out.append(text(kind, left + PAD, y + 2, line))
    return out


def text(kind: str, x: float, y: float, words: str, anchor: str = "start", more: str = "") -> str:
    return (
        f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>'
        f"{escape(words)}</text>"
    )


def ports(upper: "Room", lower: "Room", turned: int) -> tuple[float, float]:
    """Where a line leaves a room and where it enters another; alike where one is over the other.

    turned: how many lines of the same floor have turned before.
    """
    (a, b), (c, d) = PLACES[upper.name], PLACES[lower.name]
    low, high = max(a, c), min(b, d)
    if low < high:
        return across((low + high) / 2), across((low + high) / 2)
    if c > a:  # to the right
        return across(b) - 28, across(c) + 72
    return across(a) + 34, across((c + d) / 2) + 40 + 30 * turned


def arrow(ink: str, count: int, ends: tuple[float, float], y: tuple[float, float, float]) -> str:
    """From (x, top) to (other x, bottom), turned at a lane; its number where it begins."""
    (x, to), (top, lane, bottom) = ends, y
    wide = min(7.0, max(1.6, count**0.5 / 3))
    tip = bottom - 3
    way = f"M{x:.1f} {top:.1f}"
    if x != to:
        side = 8 if to > x else -8
        way += f"V{lane - 8:.1f}Q{x:.1f} {lane:.1f} {x + side:.1f} {lane:.1f}"
        way += f"H{to - side:.1f}Q{to:.1f} {lane:.1f} {to:.1f} {lane + 8:.1f}"
    half = 4 + wide / 2
    way += f"V{tip - 7:.1f}"
    drawn = f'd="{way}"'
    head = f"M{to - half:.1f} {tip - 9:.1f}L{to + half:.1f} {tip - 9:.1f}L{to:.1f} {tip:.1f}Z"
    return (
        f'<path class="line halo" {drawn} stroke-width="{wide + 4:.1f}"/>'
        f'<path class="line" {drawn} stroke="{ink}" stroke-width="{wide:.1f}"/>'
        f'<path d="{head}" fill="{ink}"/>'
        + text("count", x + wide / 2 + 5, top + 16, f"{count:,}", more=f' fill="{ink}"')
    )


def picture_of(rooms: "list[Room]", beside: list[tuple[str, str]]) -> str:
    """The house; beside: folders that hold no Python, with what they are for."""
    named = {room.name: room for room in rooms}
    words = {room.name: texts_of(room, named) for room in rooms}
    floors = sorted({room.floor for room in rooms}, reverse=True)
    tops: dict[str, float] = {}
    highs: dict[str, float] = {}
    out: list[str] = []
    y = float(MARGIN)
    gaps: dict[int, float] = {}  # of a floor, where the space below it begins
    for floor in floors:
        here = [room for room in rooms if room.floor == floor]
        high = max(height_of(words[room.name]) for room in here)
        for room in here:
            tops[room.name], highs[room.name] = y, high
            out += box(room, words[room.name], y, high)
        out.append(text("floor", GUTTER - 18, y + 27, str(floor), "end"))
        gaps[floor] = y + high
        turns = sum(ports(r, named[n], 0)[0] != ports(r, named[n], 0)[1]
                    for r in here for n in direct(r, named))  # fmt: skip
        y += high + GAP + LANE * turns
    lines = []
    turned: dict[int, int] = {}
    for room in sorted(rooms, key=lambda room: PLACES[room.name][0]):
        for name in direct(room, named):
            number = turned.get(room.floor, 0)
            ends = ports(room, named[name], number)
            if ends[0] != ends[1]:
                turned[room.floor] = number + 1
            top = gaps[room.floor]
            where = (top, top + 28 + LANE * number, tops[name])
            lines.append(arrow(INKS[room.name], room.imports[name], ends, where))
    y -= GAP - 18
    left, wide = across(0), across(1) - across(0)
    rows = [line for name, what in beside
            for line in wrap(f"{name}: {what}", int(wide / TEXT / LETTER))]  # fmt: skip
    high = 2 * PAD + LINE * len(rows) - 4
    out.append(
        f'<rect class="beside" x="{left:.1f}" y="{y:.1f}" width="{wide:.1f}" '
        f'height="{high:.1f}" rx="6"/>'
    )
    for number, line in enumerate(rows):
        out.append(text("what", left + PAD, y + PAD + 10 + LINE * number, line))
    tall = y + high + MARGIN
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {tall:.0f}" '
        f'width="{WIDE}" height="{tall:.0f}" role="img">\n'
        "<title>The rooms of the program, floor by floor, and who imports whom</title>\n"
        f"<style>{STYLE}</style>\n"
        f'<rect class="paper" width="{WIDE}" height="{tall:.0f}" rx="8"/>\n'
        + "\n".join([*out, *lines])
        + "\n</svg>\n"
    )
