"""rows.csv of a chart: what was measured so far, kept through Ctrl-C and taken up again."""

import csv
import io
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar, get_type_hints

from shapeshift.app.errors import UsageError
from shapeshift.app.terminal import print_text
from shapeshift.runtime_models.files.plain_text import one_line
from shapeshift.runtime_models.files.whole_file import write_whole

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST_HEAD = 10_000  # letters of a line that says what was run
Row = TypeVar("Row", bound="DataclassInstance")


class RowsFile(Generic[Row]):
    """A table of dataclass rows behind "# " lines that say what was run, where and on what.

    Opened again with the same lines it holds the rows that are there; anything else is refused.
    """

    def __init__(self, path: Path, kind: type[Row], head: Sequence[str]) -> None:
        self.path, self._kind = path, kind
        self._head = [f"# {one_line(line, LONGEST_HEAD)}" for line in head]  # names are bytes
        self.rows: list[Row] = []
        if path.exists():
            self.rows = self._read()

    def add(self, row: Row) -> None:
        """Writes the file anew with one row more, all or nothing."""
        self.rows.append(row)
        text = io.StringIO()
        text.writelines(f"{line}\n" for line in self._head)
        table = csv.writer(text, lineterminator="\n")
        table.writerow(field.name for field in fields(self._kind))
        table.writerows(astuple(each) for each in self.rows)
        write_text(self.path, text.getvalue())

    def _read(self) -> list[Row]:
        try:
            lines = self.path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):
            lines = []
        count = len(self._head)
        for wanted, found in zip(self._head, [*lines, *[""] * count], strict=False):
            if found != wanted:
                raise UsageError(
                    f"{self.path} is of another run ({found[:120] or 'an empty line'}, where this "
                    f"one writes {wanted[:120]}); choose another --out, or delete it."
                )
        return self._parse(lines[count:])

    def _parse(self, lines: list[str]) -> list[Row]:
        names = [field.name for field in fields(self._kind)]
        table = list(csv.reader(lines))
        try:
            if table[0] != names:
                raise ValueError("other columns")
            kinds = [get_type_hints(self._kind)[name] for name in names]
            return [
                self._kind(*(kind(word) for kind, word in zip(kinds, row, strict=True)))
                for row in table[1:]
            ]
        except (ValueError, IndexError):
            raise UsageError(
                f"{self.path} holds rows of another form; choose another --out, or delete it."
            ) from None


def write_lines(out: Path | None, lines: list[str]) -> None:
    """Into a file, or onto the terminal where none is named."""
    if out is None:
        print_text("\n".join(lines))
    else:
        write_text(out, "".join(f"{line}\n" for line in lines))


def write_text(path: Path, text: str) -> None:
    """The whole file or none of it."""
    write_whole(path, text.encode("utf-8", "backslashreplace"))  # names that are no UTF-8
