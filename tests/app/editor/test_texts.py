"""The tables of texts: nothing is missing, placeholders agree, letters have a font."""

import importlib
import re
import string
from collections import Counter

import pytest
from PIL import ImageFont

from shapeshift.app.editor.panels.widgets import theme
from shapeshift.app.editor.texts import fonts, table
from shapeshift.app.editor.texts.fonts import (
    font_files,
    has_letters,
    is_offered,
    missing_letters,
    why_not,
)
from shapeshift.app.editor.texts.table import all_languages, said, use_language
from shapeshift.app.editor.window import shell
from tests.support.desktop.overlay_texts import (
    KEY_TABLES,
    deeds_in_source,
    overlay_texts,
    unsaid_texts,
)

OTHERS = [code for code in all_languages() if code != table.ENGLISH]
PERCENT = re.compile(r"%[-+.\d]*[a-z%]")
# Buttons that stand three to a row: (268 - 28 - 16) / 3 - 2 * 8 units of the overlay.
NARROW, FONT_PX = 58.0, 15
THREE_TO_A_ROW = (
    "Object", "Hide", "Delete", "None", "Invert", "Crop\u2026", "Undo", "Redo", "Save",
    "Save\u2026", "Add", "Copy", "Open\u2026", "New", "Recent", "Frame all", "First view", "Fly",
    "Orbit", "Preview", "Key view", "Key stop", "Delete key", "Clear", "Pause", "Step",
)  # fmt: skip


@pytest.fixture(autouse=True)
def _english():
    yield
    use_language(table.ENGLISH)


def placeholders(text: str) -> tuple[Counter, Counter]:
    """{names} with their formats, and %-formats."""
    named = [(name, form) for _, name, form, _ in string.Formatter().parse(text) if name]
    return Counter(named), Counter(PERCENT.findall(text))


@pytest.mark.parametrize("code", OTHERS)
def test_no_text_is_missing_and_none_is_left_over(code):
    texts, wanted = all_languages()[code].texts, overlay_texts()
    assert len(wanted) > 400
    assert not sorted(wanted - texts.keys()), "these are not in the table"
    assert not sorted(texts.keys() - wanted), "nobody says these any more"


def test_no_item_of_the_panel_goes_past_the_tables():
    assert unsaid_texts() == []


def test_what_edits_are_called_is_in_the_tables():
    """Of those that are named in the call itself; {word} {name} stands for two of them."""
    known = {text.replace("{name}", "{}").replace("{count}", "{}") for text in table.TEMPLATES}
    found = deeds_in_source()
    assert {"delete {}", "add a section", "key of a stop", "hide {} anchors"} <= found
    assert found - known - {*table.DEEDS} == {"{} {}", "{} {} anchors"}


def test_an_edit_is_called_by_the_language_in_use():
    use_language("de")
    assert table.said_deed("delete my cube") == "my cube l\u00f6schen"
    assert table.said_deed("hide 1,204 anchors") == "1,204 Anker verbergen"
    assert table.said_deed("hide 12 monkeys") == "12 monkeys verbergen"
    assert table.said_deed("exposure of the scene") == "Belichtung von der Szene"
    assert table.said_deed("move the floor") == said("move the floor") != "move the floor"
    assert table.said_deed("add {odd}") == "{odd} hinzuf\u00fcgen"
    assert table.said_deed("what nobody knows") == "what nobody knows"
    use_language(table.ENGLISH)
    for text in ("delete my cube", "exposure of the scene", "move the floor", "crop 3 anchors"):
        assert table.said_deed(text) == text


@pytest.mark.parametrize("code", OTHERS)
def test_placeholders_agree(code):
    wrong = [
        (english, other)
        for english, other in all_languages()[code].texts.items()
        if placeholders(english) != placeholders(other) or not other.strip()
    ]
    assert not wrong


@pytest.mark.parametrize("code", OTHERS)
def test_nothing_of_a_text_changes_what_item_it_is(code):
    """## parts a label from its identity, and a line break would leave its button."""
    texts = all_languages()[code].texts.values()
    assert not [text for text in texts if "##" in text or "\n" in text]


def test_the_letters_of_german_are_in_our_own_font():
    german = all_languages()["de"]
    assert not missing_letters(german) and is_offered("de")
    assert has_letters(theme.FONT, german.letters)  # by FreeType: a second reader of the file


def width_px(text: str) -> float:
    """Of a line in our own font; what that lacks is a square, as Japanese letters are."""
    font = ImageFont.truetype(str(theme.FONT), FONT_PX)
    wide = [letter for letter in text if ord(letter) >= 0x2E80]
    plain = "".join(letter for letter in text if ord(letter) < 0x2E80)
    return font.getlength(plain) + FONT_PX * len(wide)


@pytest.mark.parametrize("code", OTHERS)
def test_labels_fit_their_buttons(code):
    """Three to a row of the panel; a long one may take the space at its sides, and no more."""
    texts = all_languages()[code].texts
    said_so = {texts.get(name, name): name for name in THREE_TO_A_ROW}
    wide = {text: round(width_px(text)) for text in said_so if width_px(text) > NARROW + FONT_PX}
    assert not wide


@pytest.mark.parametrize("code", list(all_languages()))
def test_every_word_of_the_sheets_keys_fits_beside_what_it_does(code):
    """What has several words goes on in the next line; one that is too long alone is cut, as it
    should be in Japanese only.
    """
    use_language(code)
    groups = [*shell.GROUPS.values()]
    for name in KEY_TABLES:
        rows = importlib.import_module(f"shapeshift.app.{name}").KEYS
        groups += rows.values() if isinstance(rows, dict) else [rows]
    keys = {shell.key_text(key) for rows in groups for key, _ in rows}
    assert len(keys) > 60
    room = shell.KEY_PART * 0.94 * shell.COLUMN - 4
    words = {word: width_px(word) for key in keys for word in key.split() if word.isascii()}
    assert not {word: round(px) for word, px in words.items() if px > room}


def test_keys_are_named_as_a_keyboard_of_the_language_has_them():
    use_language("de")
    names = ("Ctrl+O", "Delete", "Space", "Shift+left, right", "W A S D Q E", "F1")
    assert [shell.key_text(name) for name in names] == [
        "Strg+O", "Entf", "Leertaste", "Umschalt+links, rechts", "W A S D Q E", "F1",
    ]  # fmt: skip
    use_language(table.ENGLISH)
    assert [shell.key_text(name) for name in names] == list(names)


def test_what_no_table_has_is_said_as_it_is():
    use_language("de")
    assert said("Delete") == "L\u00f6schen"
    assert said("my {odd} file.ply") == "my {odd} file.ply"
    assert said("{count} splats", count=3) == "3 Splats"
    use_language("xx")
    assert said("Delete") == "Delete"


def test_japanese_is_offered_where_a_font_has_its_letters(tmp_path, monkeypatch):
    """An empty folder of fonts, and one whose file of the right name has no such letters."""
    fonts.font_for.cache_clear()
    monkeypatch.setattr(fonts, "font_folders", lambda: [tmp_path])
    (tmp_path / "NotoSansCJK-Regular.ttc").write_bytes(b"no font")
    (tmp_path / "ipag.ttf").write_bytes(theme.FONT.read_bytes())
    assert [path.name for path in font_files([tmp_path])] == ["NotoSansCJK-Regular.ttc", "ipag.ttf"]
    assert not is_offered("ja")
    assert "no font here has its letters; install one" in why_not(all_languages()["ja"])
    fonts.font_for.cache_clear()
    monkeypatch.setattr(fonts, "has_letters", lambda path, letters: path.name == "ipag.ttf")
    assert is_offered("ja") and fonts.font_for("ja") == tmp_path / "ipag.ttf"
    use_language("ja")
    assert fonts.more_letters() == [tmp_path / "ipag.ttf"]
    use_language("en")
    assert fonts.more_letters() == [] and fonts.more_letters(every=True) == [tmp_path / "ipag.ttf"]
    fonts.font_for.cache_clear()
