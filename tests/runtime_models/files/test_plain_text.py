"""Words out of files: what is unsafe is written out, what is endless is cut, JSON stays."""

import json
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapeshift.runtime_models.files.plain_text import (
    LONGEST_LINE,
    LONGEST_NAME,
    LONGEST_WORD,
    UNSAFE,
    json_text,
    name_line,
    one_line,
    several_lines,
)
from shapeshift.runtime_models.model import BadFile

ANY = st.text(st.characters(exclude_categories=()))  # halves of surrogate pairs, too


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b]0;owned\x07", "\\x1b]0;owned\\x07"),
        ("\x9b31m", "\\x9b31m"),  # the same as ESC [ in eight bits
        ("a\nb\r\tc\x00", "a\\nb\\r\\tc\\x00"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
        ("\ud800 \udcff", "\\ud800 \\udcff"),
        ("\u2028\u2029\ufeff", "\\u2028\\u2029\\ufeff"),
        ("\U000e0041", "\\U000e0041"),
        ("Wärme 漢字 ½ \xa0 \u3000 👩\u200d🔬 می\u200cخواهم", None),  # all of it is in use
        ("", None),
    ],
)
def test_what_is_unsafe_is_written_out_and_nothing_else(text, shown):
    assert one_line(text) == (text if shown is None else shown)


def test_every_control_character_and_sign_of_direction_is_unsafe():
    for number in range(0x110000):
        letter = chr(number)
        direction = unicodedata.bidirectional(letter)
        turning = direction in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
        control = unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp")
        if control or turning:
            assert UNSAFE.match(letter), hex(number)
        elif unicodedata.category(letter)[0] in "LMNPS":
            assert not UNSAFE.match(letter), hex(number)


@given(ANY)
def test_nothing_unsafe_is_left_and_all_can_be_written(text):
    for clean in (one_line(text), name_line(text)):
        assert not UNSAFE.search(clean)
        clean.encode("utf-8")
    lines = several_lines(text)
    assert not UNSAFE.search(lines.replace("\n", "").replace("\t", ""))
    assert lines.count("\n") == text.count("\n")
    assert several_lines(lines) == lines


@pytest.mark.parametrize("count", [LONGEST_WORD - 1, LONGEST_WORD, LONGEST_WORD + 1, 10**6])
def test_long_words_are_cut_in_their_middle(count):
    clean = one_line("before " + "a" * (count - 1) + "z after")
    word = clean.split()[1]
    assert len(word) == min(count, LONGEST_WORD) and word.endswith("z")
    assert ("\u2026" in word) == (count > LONGEST_WORD)


@pytest.mark.parametrize("count", [LONGEST_LINE, LONGEST_LINE + 1, 10**6])
def test_long_lines_are_cut_in_their_middle(count):
    text = ("word " * count)[: count - 3] + "end"
    clean = one_line(text)
    assert len(clean) == LONGEST_LINE and clean.startswith("word word") and clean.endswith("end")
    assert (clean == text) == (count <= LONGEST_LINE)


def test_names_are_short():
    assert name_line("n" * LONGEST_NAME) == "n" * LONGEST_NAME
    assert len(name_line("n" * (LONGEST_NAME + 1))) == LONGEST_NAME


@given(st.recursive(st.none() | st.booleans() | st.integers() | ANY | st.floats(allow_nan=False,
                    allow_infinity=False), lambda part: st.lists(part) | st.dictionaries(ANY, part),
                    max_leaves=8), st.booleans(), st.sampled_from([None, 1]))  # fmt: skip
def test_json_is_read_back_as_it_was(value, ascii_only, indent):
    text = json_text(value, indent, ascii_only)
    assert json.loads(text) == value
    assert not UNSAFE.search(text.replace("\n", ""))
    text.encode("ascii" if ascii_only else "utf-8")


def test_numbers_that_json_has_not_are_null():
    told = json_text({"a": [float("nan"), (float("inf"), 1.5)]})
    assert json.loads(told) == {"a": [None, [None, 1.5]]}


def test_refusals_are_one_short_line():
    told = str(BadFile("a\x1b[2J\n" + "b" * 10**5))
    assert told.startswith("a\\x1b[2J\\nbbb") and told.endswith("b.") and len(told) < 300
