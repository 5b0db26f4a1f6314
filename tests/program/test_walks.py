"""What a person hands over goes straight through the program: no file is come back to thrice.

A step is a function that is given the thing itself: the options or the capture of a training, the
path or the splats of a file.  See tests/support/walks.py.
"""

from pathlib import Path

import pytest

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.app.training.train_options import Options
from shapeshift.runtime_models.model import AnchorModel, SplatLayers
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, RawSplats
from shapeshift.runtime_models.splats.write_plain import writer_of
from shapeshift.scene.captures.capture import Capture
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.splats.ply_files import some_splats
from tests.support.walks import returns, walk

MOST_RETURNS = 2  # to a file that the walk has left


def test_a_capture_goes_straight_from_the_command_line_to_the_first_step(tmp_path):
    make_balls(tmp_path / "balls", size=32, views=4, test_views=1)
    words = ["train", str(tmp_path / "balls"), "--out", str(tmp_path / "a.shift")]
    words += ["--iterations", "1", "--max-anchors", "20"]
    steps = walk(lambda: cli.main(words), (Options, Capture, Trainer), end="Run.steps")
    assert 10 < len(steps) < 40, "the walk has lost the capture, or follows too much"
    assert steps[-1] == ("training/run.py", "Run.steps")
    assert max(returns(steps).values()) <= MOST_RETURNS, steps


@pytest.mark.parametrize("name", ["shift", "ply", "compressed.ply", "splat", "spz", "glb"])
def test_a_file_goes_straight_from_load_to_a_model(name, tmp_path):
    path = ss.DEMO
    if name != "shift":
        path = tmp_path / f"a.{name}"
        writer_of(path).write(some_splats(300), path)
    kinds = (Path, RawSplats, PlainSplats, AnchorModel, SplatLayers)
    steps = walk(lambda: ss.load(path), kinds)
    assert 10 < len(steps)
    assert max(returns(steps).values()) <= MOST_RETURNS, steps
