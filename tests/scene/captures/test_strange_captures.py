"""Every situation of tests/support/scene/strangers comes out as its row says, and docs/capture.md
has the table of them.
"""

from pathlib import Path

import pytest

from tests.support.scene.strangers.situations import situations
from tools.scene.strange_captures import table_in, table_of

DOCS = Path(__file__).resolve().parents[3] / "docs/capture.md"
ALL = list(situations())


@pytest.mark.parametrize("situation", [s for _, s in ALL], ids=[f"{m}: {s.name}" for m, s in ALL])
def test_a_situation_comes_out_as_its_row_says(tmp_path, situation):
    assert situation.look(situation.make(tmp_path / "in")) == situation.expected


def test_no_two_situations_have_one_name():
    names = [situation.name for _, situation in ALL]
    assert len(set(names)) == len(names)


def test_the_docs_have_the_table():
    text = DOCS.read_text()
    assert table_in(text) == table_of([(s, s.expected) for _, s in ALL]), (
        "run python3 tools/scene/strange_captures.py and commit docs/capture.md"
    )
