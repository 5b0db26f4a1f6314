"""Every situation of tests/support/scene/strangers comes out as its row says, and
docs/bench/strange_captures.csv has the rows.
"""

import pytest

from tests.support.scene.strangers.situations import situations
from tools.scene.strange_captures import ROWS, table_of

ALL = list(situations())


@pytest.mark.parametrize("situation", [s for _, s in ALL], ids=[f"{m}: {s.name}" for m, s in ALL])
def test_a_situation_comes_out_as_its_row_says(tmp_path, situation):
    assert situation.look(situation.make(tmp_path / "in")) == situation.expected


def test_no_two_situations_have_one_name():
    names = [situation.name for _, situation in ALL]
    assert len(set(names)) == len(names)


def test_the_docs_have_the_table():
    assert ROWS.read_text("utf-8") == table_of([(s, s.expected) for _, s in ALL]), (
        "run python3 tools/scene/strange_captures.py and commit docs/bench/strange_captures.csv"
    )
