"""The one checker of JSON: each wrong value is a sentence with file, key, found and wanted."""

import json
import math

import pytest

from shapeshift.runtime_models.files.json_fields import (
    LARGEST,
    LONGEST_SHOWN,
    LONGEST_TEXT,
    Fields,
    control_row,
    is_count,
    is_number,
    parse_json,
    read_json,
    saved_object,
    shown,
)
from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.stop_weights import StopWeights

AFTER = math.nextafter(1.0, 2.0)


def refusal(call, *arguments, **more) -> str:
    with pytest.raises(BadFile) as caught:
        call(*arguments, **more)
    sentence = str(caught.value)
    assert len(sentence) < 400 and "\n" not in sentence and sentence.endswith(".")
    return sentence


def fields(**data) -> Fields:
    return Fields(data, "a.json: row 1", "export it again")


def test_only_finite_numbers_are_numbers():
    for number in (0, -1, 1e300, -1e300, 5e-324, 10**300):
        assert is_number(number)
    for other in (True, False, math.nan, math.inf, -math.inf, 1.1e300, 10**400, "1", None, [1]):
        assert not is_number(other)
    assert is_count(0) and is_count(10**30)
    assert not any(map(is_count, (-1, 1.0, True, None, "1")))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "Expecting value"), ("{", "column 2"), ("{}\n{}", "line 2"), ("[" * 10**5, "deep"),
        (b"\xff\xfe\xfa", "no text"), ("9" * 5000, "is not JSON"), ("NaNs", "is not JSON"),
    ],
)  # fmt: skip
def test_what_is_no_json_says_so_with_its_place(text, words):
    sentence = refusal(parse_json, text, "a.json")
    assert sentence.startswith("a.json is not JSON") and words in sentence


def test_a_key_that_stands_twice_is_refused_where_that_is_asked():
    assert parse_json('{"a": 1, "a": 2}', "a.json") == {"a": 2}
    assert "'a' stands twice" in refusal(parse_json, '{"a": 1, "a": 2}', "a.json", unique=True)
    assert "'a' stands twice" in refusal(parse_json, '[{"b": {"a": 1, "a": 1}}]', "x", unique=True)


def test_files(tmp_path):
    path = tmp_path / "a.json"
    assert "is no file" in refusal(read_json, path)
    path.write_text('{"a": 1}')
    assert read_json(path) == {"a": 1} == saved_object(path, 8)
    assert read_json(path, most_bytes=8) == {"a": 1}
    assert "has 8 bytes; at most 7" in refusal(read_json, path, most_bytes=7)
    assert saved_object(path, 7) == {} == saved_object(tmp_path / "none", 100)
    path.write_text("")
    assert "is empty" in refusal(read_json, path)
    for broken in ("", "[1]", "{", "[" * 10**5):
        path.write_text(broken)
        assert saved_object(path, 1 << 20) == {}


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "null"), (True, "true"), (1.5, "1.5"), (math.nan, "NaN"), (10**400, "beyond"),
        ("a", '"a"'), ("a" * 100, "…"), ([1, "b"], '[1, "b"]'), ([[1]], "a list of 1"),
        ([0] * 17, "a list of 17"), ({}, "{}"), ({"a": 1}, "an object"), ("\u202e", "\u202e"),
    ],
)  # fmt: skip
def test_a_value_is_shown_as_the_file_has_it_and_never_long(value, text):
    assert text in shown(value) and len(shown(value)) <= LONGEST_SHOWN + 1
    assert text.replace("\u202e", r"\u202e") in refusal(fields(a=value).count, "a", 5, 4)


def test_numbers_have_ends_that_count():
    assert fields(a=1).number("a", low=1, high=1) == 1.0 and isinstance(
        fields(a=1).number("a"), float
    )
    assert fields(a=LARGEST).number("a") == LARGEST and fields(a=-LARGEST).number("a") == -LARGEST
    assert fields().number("a", 2.5) == 2.5 and fields().number("a", None) is None
    for wrong in (AFTER, 1 - 1e-16 - 1e-9, None, True, "1", [1], math.nan, math.inf, 10**400):
        sentence = refusal(fields(a=wrong).number, "a", 0.5, "one", 1, 1)
        assert "a.json: row 1: 'a' is " in sentence and "; one is wanted; export" in sentence
    assert "'a' is missing; export it again" in refusal(fields().number, "a")
    assert "'a' is missing; add it" in refusal(Fields({}, "x").number, "a")


def test_counts_lists_and_pairs():
    assert [fields(a=n).count("a", 1, 3) for n in (1, 3)] == [1, 3]
    for wrong in (0, 4, 1.0, True, None, "1"):
        assert "a whole number from 1 to 3 is wanted" in refusal(fields(a=wrong).count, "a", 1, 3)
    assert fields(a=[1, 2]).numbers("a", 2) == (1.0, 2.0) and fields().numbers("a", 2, None) is None
    for wrong in ([1], [1, 2, 3], [1, None], "ab", None, {"a": 1}, [1, math.nan]):
        assert "a list of 2 finite numbers" in refusal(fields(a=wrong).numbers, "a", 2)
    assert "up to 5" in refusal(fields(a=[1, -5.1]).numbers, "a", 2, most=5)
    assert fields(a=[1, AFTER]).pair("a") == (1.0, AFTER)
    assert "[low, high] is wanted" in refusal(fields(a=[1, 1]).pair, "a")


def test_texts_lines_paths_and_flags():
    assert fields(a="b").text("a") == "b" and fields(a=None).text("a", "c") == "c"
    assert fields(a="\n").text("a", "") == "\n" and fields().text("a", "c") == "c"
    for wrong in ("", " ", None, 1, []):
        assert "a text is wanted" in refusal(fields(a=wrong).text, "a")
    assert fields(a=["b"]).texts("a") == ["b"]
    assert "a list of texts" in refusal(fields(a=["b", 1]).texts, "a")
    assert fields(a="b" * LONGEST_TEXT).line("a") and fields().line("a", None) is None
    for wrong in ("", "a\nb", "b" * (LONGEST_TEXT + 1), None, 3):
        assert "one line of text" in refusal(fields(a=wrong).line, "a")
    assert "'x' or 'y' is wanted" in refusal(fields(a="z").line, "a", known=("x", "y"))
    assert fields(a="b/c").path("a") == "b/c"
    assert "forward slashes" in refusal(fields(a="b\\c").path, "a")
    assert fields(a=False).flag("a", True) is False and fields().flag("a", True) is True
    for wrong in (0, 1, None, "true"):
        assert "true or false" in refusal(fields(a=wrong).flag, "a")


def test_objects_rows_and_types():
    inner = fields(a={"b": 1}).object("a")
    assert inner.where == "a.json: row 1: 'a'" and "export" in refusal(inner.text, "b")
    assert fields(a=None).optional_object("a") is None is fields().optional_object("a")
    for wrong in ([], 1, "x"):
        assert "an object in braces" in refusal(fields(a=wrong).object, "a")
        assert "one object in braces" in refusal(Fields, wrong, "a.json")
    rows = fields(a=[{"b": 1}, {}]).rows("a", 2, "state")
    assert [row.where for row in rows] == ["a.json: row 1: state 1", "a.json: row 1: state 2"]
    assert fields().rows("a", 0, "state") == []
    assert "at most 1 fit" in refusal(fields(a=[{}, {}]).rows, "a", 1, "state")
    for wrong in ({}, None, [1], [{}, None]):
        assert "a list of objects" in refusal(fields(a=wrong).rows, "a", 9, "state")
    good = {dict: {}, list: [], str: "", bool: False, int: 2**63 - 1}
    for kind, value in good.items():
        assert fields(a=value).typed("a", kind) == value and fields().typed("a", kind, 7) == 7
        for other in (None, 2**63, -1, 1.0, True if kind is int else 1.5):
            refusal(fields(a=other).typed, "a", kind)


def test_controls_go_both_ways():
    blend = StopWeights((("RGB", 0.25), ("Heat", 0.75)))
    for control in (0.0, 0.5, 1.0, blend):
        text = json.dumps({"x": control_row(control)})
        assert Fields(parse_json(text, "a"), "a").control("x") == control
    for wrong in (1.5, -0.1, None, "0", {"RGB": 0.5}, {"RGB": "1"}, {"a": 2, "b": -1}, {}):
        assert "'x' is " in refusal(fields(x=wrong).control, "x")
    assert control_row(-1e-9, 3) == 0.0 and str(control_row(-1e-9, 3)) == "0.0"


def test_keys_that_nobody_asked_for_are_typing_errors():
    row = fields(friction=1, frictoin=2)
    row.number("friction")
    sentence = refusal(row.refuse_unknown_keys)
    assert "'frictoin' is no key here; did you mean 'friction'?" in sentence
    other = fields(a=1, zzz=2)
    other.number("a")
    assert "known are a." in refusal(other.refuse_unknown_keys)
    other.value("zzz")
    other.refuse_unknown_keys()
