"""A stream over another one that writes out what would steer a terminal: see terminal.py."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOBase
from typing import TextIO, cast

from shapeshift.runtime_models.files.plain_text import several_lines


class CleanStream:
    """A stream that writes out what is unsafe, over one that takes all."""

    def __init__(self, beneath: TextIO | TextIOBase, name: str, trusting: bool = False) -> None:
        self.beneath = beneath
        self._name, self._trusting = name, trusting

    def trusted(self) -> "CleanStream":
        """The same for what is clean already: tables, progress, JSON."""
        return CleanStream(self.beneath, self._name, trusting=True)

    def write(self, text: str) -> int:
        clean = text if self._trusting else several_lines(text)
        with self._naming():
            self.beneath.write(clean)
        return len(text)

    def writelines(self, lines) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        with self._naming():
            self.beneath.flush()

    @contextmanager
    def _naming(self) -> Iterator[None]:
        """A full disk behind a redirection is named."""
        try:
            yield
        except OSError as error:
            error.filename = error.filename or self._name
            raise

    def __getattr__(self, name: str):
        return getattr(self.beneath, name)


def trusted(stream: TextIO) -> TextIO:
    """The stream for what is clean already."""
    if isinstance(stream, CleanStream):
        return cast(TextIO, stream.trusted())  # by __getattr__ it has all that a stream has
    return stream
