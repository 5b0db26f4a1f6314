"""Tables in a narrow terminal: no word and no number is broken, whatever the width."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

from shapeshift.app.clean_console import CleanConsole

WORDS = ("-0.2345,", "1,234.5", "°C", "größte Abweichung", "温度の平均値", "a", "52.25..63.17")


def printed(table: Table, width: int) -> list[str]:
    stream = io.StringIO()
    CleanConsole(file=stream, width=width, markup=False, highlight=False).print(table)
    return [line.rstrip() for line in stream.getvalue().splitlines()]


@pytest.mark.parametrize("width", [20, 60, 80, 100])
@given(
    cells=st.lists(
        st.lists(st.lists(st.sampled_from(WORDS), max_size=4), min_size=5, max_size=5), max_size=4
    )
)
@settings(max_examples=60, deadline=None)
def test_every_word_stands_whole(width, cells):
    table = Table("mark", "mean °C", "最小値", "pixels", "at m")
    for row in cells:
        table.add_row(*(Text(" ".join(words)) for words in row))
    lines = printed(table, width)
    assert all(cell_len(line) <= width for line in lines)
    said = " ".join(lines).split()
    for word in {part for row in cells for words in row for text in words for part in text.split()}:
        assert word in said


@pytest.mark.parametrize("missing", [-1, 0, 1])
def test_a_table_turns_into_records_where_it_is_one_column_too_wide(missing):
    table = Table("name", "place")
    table.add_row("spot", "0.123,0.456,0.789")
    table.add_row(Text("box", "red"), "")
    least = 4 + 17 + 7  # two columns, three lines, four spaces
    lines = printed(table, least - missing)
    if missing == 1:
        assert lines == ["spot", "  place: 0.123,0.456,0.789", "box"]
    else:
        assert any("spot" in line and "0.123,0.456,0.789" in line for line in lines)
        assert "┏" in lines[0]


def test_records_keep_titles_and_tables_without_a_head():
    table = Table(title="cameras", show_header=False)
    table.add_row("path", "/a/very/long/way/to/it")
    assert printed(table, 24) == ["cameras", "path", "  /a/very/long/way/to/it"]
