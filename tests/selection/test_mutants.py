"""The list of faults that tests are judged by, and how one is put into the program."""

from collections import Counter

import pytest

from tools.tests.mutants import CAUGHT, ROOT, Mutant, Row, read_mutants, read_rows, write_rows

ONE = Mutant("near and far", "scene/a.py", "if near  > far:", "if near < far:", "sign", "")


def test_a_line_is_found_whatever_the_white_space_and_wherever_its_file_went():
    text = "def f():\n    if near >\n        far:\n        pass\n"
    changed = "def f():\n    if near < far:\n        pass\n"
    assert ONE.applied({"scene/a.py": text, "scene/b.py": text}) == ("scene/a.py", changed)
    assert ONE.applied({"scene/b.py": text, "web/a.js": text}) == ("scene/b.py", changed)
    assert ONE.applied({"scene/a.py": "", "scene/b.py": text}) == ("scene/b.py", changed)
    for texts in ({}, {"scene/a.py": ""}, {"scene/b.py": text + text}):
        with pytest.raises(ValueError, match="its line is there"):
            ONE.applied(texts)


def test_the_list_is_spread_and_each_of_it_changes_something():
    mutants = read_mutants()
    assert len(mutants) >= 84 and len({m.name for m in mutants}) == len(mutants)
    assert max(Counter(m.file.partition("/")[0] for m in mutants).values()) <= 10
    for mutant in mutants:
        assert mutant.before.split() != mutant.after.split() and mutant.breaks
        assert mutant.tests.split(), f"{mutant.name}: no test is named"
        assert all((ROOT / test).is_file() for test in mutant.tests.split()), mutant.name


def test_rows_go_into_a_file_and_come_back(tmp_path):
    path = tmp_path / "rows.csv"
    assert read_rows(path) == {}
    row = Row(ONE.name, ONE.file, ONE.breaks, CAUGHT, "tests/a.py, or b", "named", "3")
    gone = Row("gone", "a", "b", CAUGHT, "", "", "")
    write_rows({ONE.name: row, "gone": gone}, [ONE], path)
    command, machine, names, *_ = path.read_text().splitlines()
    assert command == "# python3 tools/tests/mutants.py --all" and names.startswith("name,file,")
    assert machine.endswith(" cores")
    assert read_rows(path) == {ONE.name: row}
