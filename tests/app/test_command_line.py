"""Command lines of dataclasses: what is read, what is refused in one sentence, what help says."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from shapeshift.app import cli
from shapeshift.app.cli import help_text
from shapeshift.app.command_line import (
    EXPERT,
    POSITIONAL,
    Opt,
    arguments_of,
    nearest,
    parse,
    wants_help,
)
from shapeshift.app.errors import UsageError
from shapeshift.app.training import fit, table, train
from shapeshift.training.settings import LEFT, left_setting

ROOT = Path(__file__).resolve().parents[2]
PROG = "python3 launch.py draw"


@dataclass(frozen=True, kw_only=True)
class Shared:
    """What comes last in help."""

    flip: bool = False
    """Turn it."""
    up: Literal["", "+X", "-X"] = ""
    """The axis that points up.  Default: the file's."""


@dataclass(frozen=True)
class Options(Shared):
    """Draw it.

    A second paragraph, which is so long that it cannot stand in one line of any terminal, so that
    it is broken.
    """

    scene: Annotated[Path, POSITIONAL]
    """What to draw."""
    out: Path
    """Where to."""
    x: tuple[str, ...] = ()
    """Where the slider
    stands.  Default: 0."""
    size: Annotated[str, Opt(metavar="SIZE")] = "64x48"
    """Pixels."""
    color: tuple[float, float, float] | None = None
    """Behind it.  Default: black."""
    count: int = 3
    """How many."""
    panel: bool = True
    """Show it."""
    drawing: Literal["auto", "quads", "tiles"] = "auto"
    """What draws."""
    grow: Annotated[bool | None, EXPERT] = None
    """Add some."""
    rate: Annotated[float | None, EXPERT] = None
    """How fast."""
    low: Annotated[float, EXPERT] = 1e-9
    """How low."""


def read(text: str, kind: type = Options):
    return parse(kind, shlex.split(text), PROG)


def test_every_kind_of_value_is_read():
    found = read("a.ply --out o --x 0 Thermal sweep:3 --size 8x8 --color 0 .5 1 --count -2 --flip "
                 "--no-panel --drawing tiles --grow --rate 2e-3 --up +X")  # fmt: skip
    assert found == Options(
        Path("a.ply"), Path("o"), ("0", "Thermal", "sweep:3"), "8x8", (0.0, 0.5, 1.0), -2,
        panel=False, drawing="tiles", grow=True, rate=0.002, flip=True, up="+X",
    )  # fmt: skip
    assert read("--out o a.ply") == Options(Path("a.ply"), Path("o"))


@pytest.mark.parametrize(
    ("words", "field", "value"),
    [
        ("--up -X", "up", "-X"), ("--up=-X", "up", "-X"),
        ("--color -1 -.5 0", "color", (-1, -0.5, 0.0)),
        ("--size=-1x3", "size", "-1x3"), ("--size -1,2,3", "size", "-1,2,3"),
        ("--x a --flip --x b", "x", ("a", "b")), ("--no-grow", "grow", False),
        ("--grow False", "grow", False), ("--grow=True", "grow", True),
        ("--no-flip", "flip", False),
        ("--no_flip", "flip", False), ("--flip False", "flip", False), ("--x=a=b", "x", ("a=b",)),
        ("--size ''", "size", ""), ("--drawing auto --drawing quads", "drawing", "quads"),
    ],
)  # fmt: skip
def test_values_that_look_like_options_and_options_that_are_given_twice(words, field, value):
    assert getattr(read(f"a.ply --out o {words}"), field) == value


def test_what_follows_two_dashes_is_no_option():
    assert read("--out o -- --odd.ply").scene == Path("--odd.ply")
    assert wants_help(["a", "--help"]) and not wants_help(["--", "--help"])


REFUSED = {
    "a.ply --out o --siz 3": "there is no option '--siz'; did you mean --size?",
    "a.ply --out o -x 3": "there is no option '-x'; did you mean --x?",
    "a.ply --out o --zzz": f"there is no option '--zzz'; `{PROG} --help` lists them.",
    "--out o --zzz": "there is no option '--zzz'",  # before what is missing
    "": f"SCENE and --out are missing: `{PROG} SCENE --out PATH`; --help says more.",
    "a.ply": f"--out is missing: `{PROG} a.ply --out PATH`; --help says more.",
    "--out o --x 0 a.ply": "SCENE is missing: `python3 launch.py draw SCENE`; write it first",
    "a.ply b.ply --out o": "'b.ply' is one word too many: `python3 launch.py draw` takes SCENE.",
    "a.ply --out": "--out has no value, expected a path.",
    "a.ply --out --flip": "--out has no value, expected a path.",
    "a.ply --out o --x": "--x has 0 values, expected some.",
    "a.ply --out o --color 0 1": "--color has 2 values, expected 3.",
    "a.ply --out o --color 0 1 red": "--color is 'red', expected a number.",
    "a.ply --out o --count 2.5": "--count is '2.5', expected a whole number.",
    "a.ply --out o --drawing quad": "expected auto, quads or tiles; did you mean quads?",
    "a.ply --out o --drawing x": "--drawing is 'x', expected auto, quads or tiles.",
    "a.ply --out o --up": "--up has no value, expected +X or -X.",
    "a.ply --out o --flip=maybe": "--flip is a switch and takes no value; leave '=maybe' out.",
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_is_one_sentence(words):
    with pytest.raises(UsageError) as refusal:
        read(words)
    told = str(refusal.value)
    assert REFUSED[words] in told and told[-1] in ".?" and "\n" not in told


def test_help_has_two_groups_defaults_and_whole_paragraphs(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = help_text(Options, PROG, {"rate": "5; paper: 7"}).splitlines()
    assert lines[0] == f"usage: {PROG} SCENE --out PATH [options]"
    usual, expert = lines.index("usual options:"), lines.index("expert options:")
    names = [line.split()[0].rstrip(",") for line in lines if re.match(r"  \S", line)]
    assert names == ["SCENE", "--out", "--x", "--size", "--color", "--count", "--panel",
                     "--drawing", "--flip", "--up", "--grow", "--rate", "--low"]  # fmt: skip
    assert usual < lines.index("  --flip                  Turn it.") < expert
    text = " ".join(" ".join(lines).split())
    for said in ("Where to. (required)", "stands. Default: 0. --size", "Pixels. (default: 64x48)",
                 "--panel, --no-panel", "Show it. (default: on)", "fast. (default: 5; paper: 7)",
                 "low. (default: 1e-09)", "--color NUMBER NUMBER NUMBER", "--x TEXT [TEXT ...]",
                 "--drawing {auto,quads,tiles}", "--up {+X,-X}"):  # fmt: skip
        assert said in text, said
    assert max(map(len, lines)) <= 80 and "None" not in text
    assert "A second paragraph, which is so long that it cannot stand in one line of any" in lines


@pytest.mark.parametrize("width", ["30", "100", "1000"])
def test_help_fits_any_terminal(monkeypatch, width):
    monkeypatch.setenv("COLUMNS", width)
    assert "--drawing" in help_text(Options, PROG)


def options_of(command: str) -> type:
    from importlib import import_module

    return import_module(f"shapeshift.app.{cli.COMMANDS[command][0]}").Options


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_option_of_every_command_says_what_it_does_and_what_holds_without_it(command, capsys):
    """Sentences, and a default: stated, required, or off for a switch."""
    assert cli.main([command, "--help"]) == 0
    told = capsys.readouterr().out
    assert "None" not in told and "inf)" not in told and str(ROOT) not in told
    blocks = re.split(r"\n  (?=--|\[?[A-Z])", told)[1:]
    arguments = {each.name: each for each in arguments_of(options_of(command))}
    named = [block.split()[0].strip("[],") for block in blocks]
    assert sorted(named) == sorted(arguments)
    for name, block in zip(named, blocks, strict=True):
        text = " ".join(block.split())
        assert len(arguments[name].help) >= 15 and arguments[name].help[0].isalnum(), name
        assert arguments[name].help.endswith((".", "]")), name
        assert not arguments[name].help.startswith("Default"), f"{name}: what is it?"
        stated = re.search(r"[dD]efault: |\(required\)", text)
        is_switch = arguments[name].kind is bool
        assert stated or is_switch or arguments[name].opt.positional, f"{command} {name}: {text}"


def test_the_settings_of_a_training_are_its_options(capsys):
    """Their defaults are those of the dataclass, their texts the fields' own."""
    from shapeshift.training.settings import TrainSettings

    assert cli.main(["train", "--help"]) == 0
    told, usual = " ".join(capsys.readouterr().out.split()), TrainSettings()
    assert f"gives the same bits. (default: {usual.iterations})" in told
    assert f"and max_mb is given. (default: {usual.max_anchors})" in told
    assert "splats_per_anchor, features" not in told
    options = parse(options_of("train"), ["photos", "--out", "a", "--seed", "3"], PROG)
    assert options.asked == {"seed": 3} and options.splats == {}


@pytest.mark.parametrize("option", ["--preset", "--rise", "--sigma", "--balance", "--layers"])
def test_options_that_left_the_training_are_refused_in_a_sentence(option, capsys, tmp_path):
    assert cli.main(["train", str(tmp_path), "--out", str(tmp_path / "a.shift"), option, "1"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"shapeshift train: {option} left the program: ")
    assert told.count("\n") == 1 and "Traceback" not in told


def test_a_slip_of_the_hand_is_known():
    assert nearest("rendre", ["render", "view"]) == "render"
    assert nearest("THERMAL", ["RGB", "Thermal"]) == "Thermal"
    assert nearest("sim", ["simulate", "view"]) == "simulate"
    assert nearest("zzz", ["render", "view"]) == "" == nearest("x", [])


SLIPS = ("siez", "sze", "size1", "sizes", "szie", "sixe")  # swapped, left out, added, changed


@pytest.mark.parametrize("slip", SLIPS)
def test_one_wrong_letter_of_four_is_a_slip(slip):
    assert nearest(f"--{slip}", ["--seed", "--size", "--resume", "--x"]) == "--size"


@pytest.mark.parametrize(
    ("word", "known"),
    [("--rise", "--seed"), ("--preset", "--resume"), ("--layers", "--labels"), ("--own", "--out"),
     ("--voxel", "--model"), ("--control", "--color"), ("--sigma", "--size")],
)  # fmt: skip
def test_another_word_is_none(word, known):
    """Two dashes, which all options have, make no word like another."""
    assert nearest(word, [known]) == ""


@pytest.mark.parametrize("kind", [train.Options, fit.Options, table.Options])
def test_options_that_left_are_answered_by_what_does_their_work(kind):
    assert len(LEFT) > 30 and not LEFT.keys() & {each.name[2:] for each in arguments_of(kind)}
    known = {each.name for each in arguments_of(train.Options)}
    for name, now in LEFT.items():
        for option in (f"--{name}", f"--no-{name}", f"--{name}=3"):
            with pytest.raises(UsageError) as refusal:
                parse(kind, ["capture", "--out", "o", option], PROG)
            assert str(refusal.value) == f"{option.split('=')[0]} left the program: {now}."
        assert set(re.findall(r"--[a-z-]+", now)) <= known, "what the sentence names is there"


@pytest.mark.parametrize("name", LEFT)
def test_settings_that_left_are_named_as_python_writes_them(name):
    now = left_setting(name.replace("-", "_"))
    assert now and "--" not in now and left_setting("seconds") == ""
