"""The words of options are those that `parse` makes the same options of."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapeshift.app.cluster.task import words_for
from shapeshift.app.command_line import parse
from shapeshift.app.film.film import Options as FilmOptions
from shapeshift.app.training.fit import Options as FitOptions
from shapeshift.app.training.table import Options as TableOptions
from shapeshift.app.training.train import Options as TrainOptions
from shapeshift.app.training.train_options import with_settings

FILM = FilmOptions(Path("/a/b c.shift"), Path("/out"))
TABLE = TableOptions(Path("/capture"), Path("/out"))


@pytest.mark.parametrize("options", [
    FILM, TABLE,
    replace(FILM, up="-Z", flip=True, only="50:100", seconds=0.1 + 0.2, size="64x36", every=3,
            streams=("depth", "normal"), style_path="RGB@0 Thermal@3s", stereo=0.063,
            background=(0.0, 1e-7, 1.0), save_path=Path("/p.film.json")),
    replace(TABLE, asked={"max_anchors": 400, "background": "black", "seed": 0}, iterations=20,
            settings=Path("/-a.toml"), methods=("joint", "splats"), vgg=Path("/-v.onnx")),
    FitOptions(Path("/capture"), Path("/o.shift"), only=Path("/a/b c.json"), device="cpu",
               memory=0.1 + 0.2),
    TrainOptions(Path("/capture"), Path("/out.shift"), {"iterations": 9, "points": "-"},
                 separate=True),
])  # fmt: skip
def test_options_come_back_out_of_their_words(options):
    command, *words = words_for("cluster", options)
    assert command == "cluster" and parse(type(options), words, "x") == options


def test_lines_of_a_settings_file_stay_in_it(tmp_path):
    given = replace(TABLE, splats={"sh_degree": 1})
    with pytest.raises(ValueError, match=r"^sh_degree: lines of a settings file"):
        words_for("table", given)
    file = tmp_path / "a.toml"
    file.write_text("sh_degree = 1")
    given = replace(given, settings=file)
    _, *words = words_for("table", given)
    assert with_settings(parse(TableOptions, words, "x")) == given


def test_defaults_are_left_out_and_paths_are_absolute(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    words = words_for("film", FilmOptions(Path("a.shift"), Path("b")))
    assert words == ("film", str(tmp_path / "a.shift"), "--out", str(tmp_path / "b"))
