"""rich's console over words out of files: see terminal.py, which opens it."""

import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, Group, RenderableType
from rich.file_proxy import FileProxy
from rich.measure import Measurement
from rich.padding import Padding
from rich.progress import Progress
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from shapeshift.app.clean_stream import CleanStream
from shapeshift.runtime_models.files.plain_text import one_line, several_lines


class CleanConsole(Console):
    """Cleans every text before it is laid out, and whatever is left of it in the result."""

    def print(self, *objects, **more) -> None:
        """Each text is one line: a line break can only come out of a name."""
        super().print(*(one_line(o) if isinstance(o, str) else o for o in objects), **more)

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # as print does

    def render_str(self, text: str, **more) -> Text:
        return super().render_str(several_lines(text), **more)

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        if isinstance(renderable, Text):
            renderable = clean_text(renderable)
        if isinstance(renderable, Table) and not fit(renderable, self, options or self.options):
            renderable = as_records(renderable)
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                style = segment.style
                if style is not None and style.link:  # OSC 8, with whatever address
                    style = style.update_link(None)
                yield Segment(several_lines(segment.text), style)


def fit(table: Table, console: Console, options: ConsoleOptions) -> bool:
    """Gives the columns widths that break no word and no number; False where there are none.

    rich narrows the widest column, whatever stands in it.  Here each has its longest word at least
    and its longest line at most, and what is narrower than a common width keeps its lines whole.
    """
    unlimited = options.update(max_width=1 << 20)
    least, most = [], []
    for column in table.columns:
        cells = [*([column.header] if table.show_header else []), *column.cells]
        sizes = [Measurement.get(console, unlimited, cell) for cell in cells if cell]
        most.append(max((size.maximum for size in sizes), default=0))
        least.append(max((size.minimum for size in sizes), default=0))
    room = options.max_width - (table.__rich_measure__(console, unlimited).maximum - sum(most))
    if sum(most) <= room:
        return True
    if sum(least) > room:
        return False

    def widths(common: int) -> list[int]:
        return [min(max(low, common), high) for low, high in zip(least, most, strict=True)]

    common = max(c for c in range(max(most) + 1) if sum(widths(c)) <= room)
    for column, width in zip(table.columns, widths(common), strict=True):
        # After letters that are two columns wide rich counts the space at a line's end: it goes.
        column.width, column.overflow = width, "crop"
    return True


def as_records(table: Table) -> Group:
    """A table that is too wide: row below row, the first cell above the named others."""
    lines: list[RenderableType] = [] if table.title is None else [table.title]
    columns = [list(column.cells) for column in table.columns]
    names = [str(column.header) if table.show_header else "" for column in table.columns]
    for row, cells in zip(table.rows, zip(*columns, strict=True), strict=True):
        for number, (name, cell) in enumerate(zip(names, cells, strict=True)):
            text = cell.copy() if isinstance(cell, Text) else Text(str(cell))
            if not text.plain:
                continue
            label = f"{name}: " if name and number else ""
            styled = Text.assemble(label, text, style=row.style or "")
            lines.append(Padding(styled, (0, 0, 0, 2 if number else 0)))
    return Group(*lines)


def clean_text(text: Text) -> Text:
    """The same, or, where something in it is unsafe or endless, a copy without inner styles."""
    clean = several_lines(text.plain)
    if clean == text.plain:
        return text
    return Text(clean, style=text.style, justify=text.justify, overflow=text.overflow,
                no_wrap=text.no_wrap, end=text.end)  # fmt: skip


class CleanProgress(Progress):
    """Bars; what is printed while they stand is clean before rich looks for colours in it."""

    def start(self) -> None:
        super().start()
        for name in ("stdout", "stderr"):
            stream = getattr(sys, name)
            if isinstance(stream, FileProxy):
                setattr(sys, name, CleanStream(stream, name))
