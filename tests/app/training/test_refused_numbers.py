"""Numbers that no training can have: one sentence that names the option as it was typed."""

import numpy as np
import pytest

from shapeshift.app import cli
from shapeshift.app.errors import as_typed
from shapeshift.app.training.train_options import EXPERTS, LINES, USUAL
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.settings import TrainSettings

# Options of train that hold a number -> one below the least that it can be.
BELOW = {
    "seconds": "-1", "iterations": "0", "max_anchors": "0", "max_mb": "0", "downscale": "0",
    "seed": "-1", "splats_per_anchor": "0", "features": "0", "hidden": "0", "depth_share": "-1",
    "normal_share": "-1", "blended_shapes": "-1", "min_scale_px": "-1",
}  # fmt: skip
TEXTS = {"points", "masks", "background", "poses", "fixed", "anchor_attributes"}


def refused(capsys, *words: object) -> str:
    """What is said of a command that is refused before anything is read or written."""
    assert cli.main([str(word) for word in words]) == cli.BAD_INPUT
    return capsys.readouterr().err.strip()


def test_every_option_of_the_settings_is_tried():
    assert {*BELOW} | TEXTS == {*USUAL, *EXPERTS, *LINES}


@pytest.mark.parametrize("name", BELOW)
def test_train_names_the_option(tmp_path, capsys, name):
    option = "--" + name.replace("_", "-")
    words = ("train", tmp_path, "--out", tmp_path / "a.shift")
    if name in LINES:
        file = tmp_path / "train.toml"
        file.write_text(f"# a\n{name} = {BELOW[name]}\n")
        said = refused(capsys, *words, "--settings", file)
        start = f"{file}, line 2: {name}"
    else:
        said, start = refused(capsys, *words, option, BELOW[name]), option
        assert name not in said.replace(option, "").split()
    assert said.startswith(f"shapeshift train: {start} is {float(BELOW[name]):g}")
    assert "\n" not in said


@pytest.mark.parametrize(
    ("command", "more", "said"),
    [
        ("train", ("--blended-shapes", "1.1"), "--blended-shapes is 1.1; it is a share, 0 to 1."),
        ("train", ("--gpus", "-1"), "--gpus is -1, expected the GPUs of this machine"),
        ("train", ("--block-photos", "-1"), "--block-photos is -1; it has to be at least 0."),
        ("train", ("--model", "splats", "--seconds", "nan"), "--seconds is nan;"),
        ("fit", ("--iterations", "0"), "--iterations is 0;"),
        ("fit", ("--final-iterations", "0"), "--final-iterations is 0;"),
        ("fit", ("--final-seconds", "-1"), "--final-seconds is -1"),
        ("fit", ("--tolerance-db", "nan"), "--tolerance-db is nan;"),
        ("fit", ("--seeds", "0"), "--seeds is 0;"),
        ("fit", ("--gpus", "-1"), "--gpus is -1, expected the GPUs of this machine"),
        ("table", ("--seconds", "nan"), "--seconds is nan;"),
        ("table", ("--iterations", "0"), "--iterations is 0;"),
        ("table", ("--iterations", "1", "--downscale", "0"), "--downscale is 0;"),
        ("table", ("--iterations", "1", "--max-anchors", "0"), "--max-anchors is 0;"),
        ("poses", ("--frames", "2"), "--frames is 2; give 3 or more."),
    ],
)
def test_a_command_names_the_option(tmp_path, capsys, command, more, said):
    out = tmp_path / ("a" if "splats" in more else "a.shift")
    assert refused(capsys, command, tmp_path, "--out", out, *more).startswith(
        f"shapeshift {command}: {said}"
    )


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--coarse-iterations", "0"), "--coarse-iterations is 0;"),
        (("--block-photos", "-1"), "--block-photos is -1;"),
        (("--iterations", "0"), "--iterations is 0;"),
    ],
)
def test_blocks_are_refused_before_the_coarse_run(tmp_path, capsys, more, said):
    words = ("train", tmp_path, "--out", tmp_path / "a.blocks", "--blocks", "2", *more)
    assert refused(capsys, *words).startswith(f"shapeshift train: {said}")


@pytest.mark.parametrize("command", ["train", "fit", "table", "splats", "separate", "blocks"])
@pytest.mark.parametrize("memory", ["0", "-1", "nan", "inf", "1000001"])
def test_no_training_has_such_memory(tmp_path, capsys, command, memory):
    """Before anything is read: the folder holds no capture, which is not said."""
    more = {"table": ["--iterations", "1"], "splats": ["--model", "splats"],
            "separate": ["--separate"], "blocks": ["--blocks", "2"]}.get(command, [])  # fmt: skip
    typed = command if command in ("fit", "table") else "train"
    out = tmp_path / {"blocks": "a.blocks"}.get(command, "a" if more else "a.shift")
    said = refused(capsys, typed, tmp_path, "--out", out, "--memory", memory, *more)
    assert said == (
        f"shapeshift {typed}: --memory is {float(memory):.12g}, expected GB above 0, at most "
        "1,000,000; leave it out for what is usual."
    )


@pytest.mark.parametrize("memory", ["1e-9", "1000000"])
def test_the_least_and_the_most_memory_are_taken(tmp_path, capsys, monkeypatch, memory):
    """What fails is the folder, which holds no capture."""
    monkeypatch.setenv("SHAPESHIFT_MEMORY", "")  # the command sets it
    words = ("train", tmp_path, "--out", tmp_path / "a.shift", "--memory", memory)
    assert "neither photos nor poses" in refused(capsys, *words)


def test_of_a_reader_0_is_what_is_usual(tmp_path, capsys):
    (tmp_path / "a.ply").write_bytes(b"ply")
    words = ("eval", tmp_path / "a.ply", tmp_path, "--memory")
    assert "neither photos nor poses" in refused(capsys, *words, "0")
    assert refused(capsys, *words, "-1").startswith("shapeshift eval: --memory is -1, expected GB")


@pytest.mark.parametrize(
    ("name", "most"), [("depth_share", 1000), ("normal_share", 1000), ("min_scale_px", 1000)]
)
def test_the_most_is_taken_and_what_is_next_is_not(name, most):
    assert getattr(TrainSettings(**{name: most}), name) == most
    with pytest.raises(ValueError, match=f"^{name} is .*, 0 to {most}[.]$"):
        TrainSettings(**{name: np.nextafter(most, np.inf)})
    if name != "min_scale_px":
        with pytest.raises(ValueError, match=f"^{name} is .*, 0 to {most}[.]$"):
            PlainSettings(**{name: np.nextafter(most, np.inf)})


def test_a_sentence_keeps_what_is_no_setting():
    """A field's name is only taken for one where the sentence begins with it."""
    for sentence in (
        "A run needs an end: give iterations or seconds.",
        "--resume goes on with the settings of the checkpoint, where seed is 1.",
        "points of nothing",  # a field of these settings
        "",
    ):
        expected = f"--{sentence}" if sentence.startswith("points") else sentence
        assert str(as_typed(ValueError(sentence), TrainSettings)) == expected
    assert str(as_typed(ValueError("hidden is 0."), PlainSettings)) == "hidden is 0."
    known = {"iterations": "final_iterations"}
    said = as_typed(ValueError("iterations is 0."), TrainSettings, known)
    assert str(said) == "--final-iterations is 0."
    assert str(as_typed(ValueError("seed is -1."), TrainSettings, said="")) == "seed is -1."
