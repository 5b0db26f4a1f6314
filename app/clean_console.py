"""rich's console over words out of files: see terminal.py, which opens it."""

import sys
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.file_proxy import FileProxy
from rich.progress import Progress
from rich.segment import Segment
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
        for segment in super().render(renderable, options):
            if segment.control:
                yield segment
            else:
                style = segment.style
                if style is not None and style.link:  # OSC 8, with whatever address
                    style = style.update_link(None)
                yield Segment(several_lines(segment.text), style)


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
