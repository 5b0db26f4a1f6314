"""Numbers that no training can have: one sentence that names the option as it was typed."""

import pytest

from shapeshift.app import cli
from shapeshift.app.errors import as_typed
from shapeshift.app.training.train_options import EXPERTS, USUAL
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
    assert {*BELOW} | TEXTS == {*USUAL, *EXPERTS}


@pytest.mark.parametrize("name", BELOW)
def test_train_names_the_option(tmp_path, capsys, name):
    option = "--" + name.replace("_", "-")
    words = ("train", tmp_path, "--out", tmp_path / "a.shift", option, BELOW[name])
    said = refused(capsys, *words)
    assert said.startswith(f"shapeshift train: {option} is {float(BELOW[name]):g}")
    assert "\n" not in said and name not in said.replace(option, "").split()


@pytest.mark.parametrize(
    ("command", "more", "said"),
    [
        ("train", ("--depth-share", "nan"), "--depth-share is nan; it has to be at least 0."),
        ("train", ("--blended-shapes", "1.1"), "--blended-shapes is 1.1; it is a share, 0 to 1."),
        ("train", ("--fixed", "shape"), "--fixed: there is no head 'shape'"),
        ("train", ("--anchor-attributes", "hat"), "--anchor-attributes: anchors have no attribute"),
        ("train", ("--model", "splats", "--max-splats", "0"), "--max-splats is 0;"),
        ("train", ("--model", "splats", "--sh-degree", "4"), "--sh-degree is 4;"),
        ("train", ("--model", "splats", "--seconds", "nan"), "--seconds is nan;"),
        ("fit", ("--splats-per-anchor", "0"), "--splats-per-anchor is 0;"),
        ("fit", ("--iterations", "0"), "--iterations is 0;"),
        ("fit", ("--final-iterations", "0"), "--final-iterations is 0;"),
        ("fit", ("--final-seconds", "-1"), "--final-seconds is -1"),
        ("fit", ("--tolerance-db", "nan"), "--tolerance-db is nan;"),
        ("fit", ("--seeds", "0"), "--seeds is 0;"),
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
        (("--splats-per-anchor", "0"), "--splats-per-anchor is 0;"),
    ],
)
def test_blocks_are_refused_before_the_coarse_run(tmp_path, capsys, more, said):
    words = ("train", tmp_path, "--out", tmp_path / "a.blocks", "--blocks", "2", *more)
    assert refused(capsys, *words).startswith(f"shapeshift train: {said}")


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
