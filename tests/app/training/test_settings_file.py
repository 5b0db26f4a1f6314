"""--settings FILE: a line does what its option did, and is checked as it was."""

import pytest

from shapeshift.app import cli
from shapeshift.app.command_line import arguments_of, lines_of, parse
from shapeshift.app.training import fit, table, train, update
from shapeshift.app.training.train_options import (
    LINES,
    MOST_BYTES,
    OF_SPLATS,
    as_given,
    with_settings,
)
from shapeshift.runtime_models.model import BadFile
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.settings import TrainSettings

COMMANDS = {"train": train.Options, "fit": fit.Options, "table": table.Options,
            "update": update.Options}  # fmt: skip
OTHER = {  # of each line, another value than the usual one
    "splats_per_anchor": "3", "features": "24", "hidden": "48", "fixed": '"offset,scale"',
    "anchor_attributes": '"frame,color,light"', "depth_share": "0.5", "normal_share": "1",
    "min_scale_px": "0.45", "max_splats": "900", "sh_degree": "1",
}  # fmt: skip


@pytest.fixture
def file(tmp_path):
    return tmp_path / "train.toml"


def options_of(file, text: str, *words: str, command: str = "train"):
    file.write_text(text, "utf-8")
    scene = ["a.shift"] if command == "update" else []
    typed = [*scene, "photos", "--out", "b.shift", "--settings", str(file), *words]
    return with_settings(parse(COMMANDS[command], typed, command))


def test_help_of_train_lists_32_options_at_most(capsys):
    assert cli.main(["train", "--help"]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  --")]
    named = {each.name for each in arguments_of(train.Options) if not each.opt.positional}
    assert len(rows) == len(named) <= 32
    assert not named & {f"--{name.replace('_', '-')}" for name in OTHER}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_line_sets_its_setting(file, command):
    kind = COMMANDS[command]
    mine = [name for name in OTHER if name in lines_of(kind)]
    assert mine and {*LINES, *OF_SPLATS} == OTHER.keys()
    found = options_of(file, "".join(f"{name} = {OTHER[name]}\n" for name in mine), command=command)
    given = found.asked | getattr(found, "splats", {})
    assert list(given) == mine
    for name in mine:
        settings = PlainSettings if name in OF_SPLATS else TrainSettings
        assert getattr(settings(**{name: given[name]}), name) == given[name]
        assert given[name] != getattr(settings(), name) and as_given(name) == name
    assert type(given.get("normal_share", 1.0)) is float


def test_what_is_typed_counts_more_and_options_may_stand_there_too(file):
    found = options_of(file, "max_anchors = 900\nseed = 4\nmasks = 'ignore'\n", "--seed", "3")
    assert found.asked == {"max_anchors": 900, "seed": 3, "masks": "ignore"}
    assert options_of(file, "").asked == options_of(file, "\ufeff# nothing\n").asked == {}


@pytest.mark.parametrize(
    ("option", "line"),
    [
        (("--features", "24"), "features = 24"), (("--features=24",), "features = 24"),
        (("--features",), "features = 16"), (("--features", "many"), "features = 16"),
        (("--features", "--resume"), "features = 16"),
        (("--min_scale_px", ".45"), "min_scale_px = 0.45"),
        (("--fixed", "offset,scale"), 'fixed = "offset,scale"'),
        (("--depth-share", "nan"), "depth_share = nan"), (("--max-splats", "9"), "max_splats = 9"),
    ],
)  # fmt: skip
def test_the_old_spelling_says_the_line(file, capsys, option, line):
    out = file.with_name("a.shift")
    assert cli.main(["train", str(file.parent), "--out", str(out), *option]) == cli.BAD_INPUT
    name = option[0].split("=")[0].replace("_", "-")
    assert capsys.readouterr().err == (
        f"shapeshift train: {name} is a line of a settings file: write `{line}` into a file such "
        "as train.toml and add --settings train.toml.\n"
    )
    assert not list(file.parent.iterdir())
    if "nan" not in line:
        options_of(file, line)  # what is to be written is read


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("features = 0", "line 1: features is 0; it has to be at least 1."),
        ("\n\nfeatures = 1.5", "line 3: features is 1.5, expected a whole number."),
        ("features = true", "line 1: features is true, expected a whole number."),
        ("features = '24'", 'line 1: features is "24", expected a whole number.'),
        ("fixed = 1", "line 1: fixed is 1, expected a text."),
        ("fixed = 'shape'", "line 1: fixed: there is no head 'shape'"),
        ("a = 1\nfeatures = 2", "line 1: there is no setting 'a'; there are seconds, "),
        ("hiden = 64", "line 1: there is no setting 'hiden'; did you mean hidden?"),
        ("max-anchors = 9", "setting 'max-anchors'; did you mean max_anchors?"),
        ("depth_share = nan", "line 1: depth_share is nan; it has to be at least 0."),
        ("depth_share = inf", "line 1: depth_share is inf; it has to be at least 0."),
        ("depth_share = 1000.0000000000001", "depth_share is 1000.0000000000001; it is"),
        ("anchor_attributes = 'hat'", "line 1: anchor_attributes: anchors have no attribute"),
        ("sh_degree = 4", "line 1: sh_degree "),
        ("masks = 'objekt'", 'line 1: masks is "objekt", expected auto, object, valid or ignore.'),
        ("[features]\na = 1", "line 1: features is {"),
        ("features = 2\nfeatures = 3", "line 2 sets features again"),
        ("features 24", "at line 1"),
        ("features = " + "[" * 20_000, "it is no TOML"),
        ("features = " + "9" * 5000, "it is no TOML"),
    ],
)  # fmt: skip
def test_a_wrong_line_is_one_sentence_that_names_it(file, text, said):
    with pytest.raises(BadFile) as refused:
        options_of(file, text)
    sentence = str(refused.value)
    assert sentence.startswith(str(file)) and said in sentence
    assert "\n" not in sentence and len(sentence) < 600


def test_a_wrong_file_is_refused_before_anything_is_written(tmp_path, file, capsys):
    words = ["train", str(tmp_path), "--out", str(tmp_path / "a.shift"), "--settings"]
    file.write_bytes(b"#" * (MOST_BYTES + 1))
    (tmp_path / "latin.toml").write_bytes(b"# \xe4\n")
    wrong = {"none.toml": "is no file", "": "is no file", "train.toml": "at most 65,536",
             "latin.toml": "it is no TOML"}  # fmt: skip
    for name, said in wrong.items():
        assert cli.main([*words, str(tmp_path / name)]) == cli.BAD_INPUT
        told = capsys.readouterr().err
        assert said in told and told.count("\n") == 1 and "Traceback" not in told
    assert {path.name for path in tmp_path.iterdir()} == {"train.toml", "latin.toml"}
    file.write_bytes(b"#" * MOST_BYTES)
    assert cli.main([*words, str(file)]) == cli.BAD_INPUT
    assert "neither photos nor poses" in capsys.readouterr().err  # the folder, not the file
