"""CLIP's byte pairs: against what the package `tokenizers` made of the same file and texts."""

import json
from pathlib import Path

import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.style_features.clip_model import (
    END,
    MOST_TOKENS,
    START,
    ClipTokenizer,
    byte_letters,
    words_of,
)
from tests.support.training.clip_files import tokenizer

FIXTURE = json.loads((Path(__file__).parents[2] / "fixtures" / "clip_tokens.json").read_text())


def written(path, value) -> Path:
    path.write_text(json.dumps(value))
    return path


@pytest.mark.parametrize("form", ["pairs", "lines"])
def test_the_same_numbers_as_another_program(tmp_path, form):
    file = json.loads(json.dumps(FIXTURE["tokenizer"]))
    if form == "lines":  # how older files write a merge
        file["model"]["merges"] = [" ".join(pair) for pair in file["model"]["merges"]]
    encode = ClipTokenizer(written(tmp_path / "tokenizer.json", file))
    assert len(FIXTURE["texts"]) > 10
    for text, ids in FIXTURE["texts"].items():
        assert encode(text) == ids, text


def test_bytes_have_a_letter_each():
    letters = byte_letters()
    assert len(set(letters)) == 256 and letters[ord("a")] == "a" and letters[ord(" ")] == "Ġ"
    assert all(letter.isprintable() and not letter.isspace() for letter in letters)


def test_words():
    assert words_of("It's 25%, isn't  it?") == [
        "it", "'s", "2", "5", "%,", "isn", "'t", "it", "?",
    ]  # fmt: skip
    assert words_of("  ") == []


def test_merges_go_in_the_order_of_the_file(tmp_path):
    encode = ClipTokenizer(written(tmp_path / "t.json", tokenizer(("red",))))
    ids = tokenizer(("red",))["model"]["vocab"]
    assert encode("RED") == [ids[START], ids["red</w>"], ids[END]]
    assert encode("reds") == [ids[START], ids["re"], ids["d"], ids["s</w>"], ids[END]]


def changed(**model):
    file = tokenizer()
    file["model"] |= model
    return file


REFUSED = {
    "another kind": (changed(type="WordPiece"), "another kind .WordPiece"),
    "words that end otherwise": (changed(end_of_word_suffix=None), "words end in ''"),
    "no model": ({"version": "1.0"}, "'model' is missing"),
    "a list": ([1], "one object in braces is wanted"),
    "texts for numbers": (changed(vocab={"a": "1"}), "whole numbers from 0 on"),
    "no start": (changed(vocab={END: 1}), "has no token"),
    "merges of three": (changed(merges=[["a", "b", "c"]]), "a list of pairs of texts"),
    "merges of numbers": (changed(merges=[[1, 2]]), "a list of pairs of texts"),
}


@pytest.mark.parametrize("how", REFUSED)
def test_other_files_are_refused(tmp_path, how):
    value, words = REFUSED[how]
    with pytest.raises(BadFile, match=words):
        ClipTokenizer(written(tmp_path / "t.json", value))
    with pytest.raises(BadFile, match="is no file"):
        ClipTokenizer(tmp_path / "absent.json")


def test_long_texts_and_bytes_that_are_not_known(tmp_path):
    encode = ClipTokenizer(written(tmp_path / "t.json", tokenizer()))
    most = MOST_TOKENS - 2
    assert len(encode("1" * most)) == MOST_TOKENS
    with pytest.raises(BadFile, match="is 78 tokens for CLIP, which reads 77"):
        encode("1" * (most + 1))
    file = tokenizer()
    del file["model"]["vocab"]["z</w>"]
    with pytest.raises(BadFile, match="knows no token for 'z'"):
        ClipTokenizer(written(tmp_path / "u.json", file))("z")
