"""Many photos of one modality are trained with anchors of their own kind, whoever starts it."""

from dataclasses import replace

import pytest

import shapeshift as ss
from shapeshift.app.cli import main
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.training.baselines.plain import one_modality
from shapeshift.training.synthetic.balls import make_balls


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    """(both modalities, RGB alone)"""
    both, alone = (tmp_path_factory.mktemp(name) for name in ("both", "alone"))
    capture = make_balls(both, size=32, views=6, test_views=1)
    write_capture(replace(one_modality(make_balls(alone, 32, 16, 1), "RGB"), folder=alone))
    return capture.folder, alone


def kind_of(model) -> tuple[int, bool]:
    return model.splats_per_anchor, model.light is not None


def test_train_says_nothing_and_has_more_anchors_with_light(balls, tmp_path):
    both, alone = balls
    cases = ((alone, (), (2, True)), (both, (), (2, False)),
             (alone, ("--max-anchors", "200"), (5, False)))  # fmt: skip
    for number, (folder, more, kind) in enumerate(cases):
        out = str(tmp_path / f"{number}.shift")
        assert main(["train", str(folder), "--out", out, "--iterations", "2", *more]) == 0
        assert kind_of(read_model(out)) == kind
    again = ["train", str(alone), "--out", str(tmp_path / "0.shift"), "--resume"]
    assert main([*again, "--iterations", "3"]) == 0
    assert kind_of(read_model(tmp_path / "0.shift")) == (2, True)
    assert read_model(tmp_path / "0.shift").provenance["iterations"] == 3


def test_so_do_the_library_and_the_table(balls, tmp_path):
    _, alone = balls
    trained = ss.train(str(alone), iterations=1)
    trained.save(tmp_path / "a.shift")
    assert kind_of(read_model(tmp_path / "a.shift")) == (2, True)
    fewer = ss.train(str(alone), iterations=1, splats_per_anchor=3)
    fewer.save(tmp_path / "b.shift")
    assert kind_of(read_model(tmp_path / "b.shift")) == (3, False)
    words = ["table", str(alone), "--out", str(tmp_path / "t"), "--iterations", "2"]
    assert main([*words, "--methods", "joint", "separate"]) == 0
    made = sorted((tmp_path / "t").rglob("*.shift"))
    assert len(made) == 2 and all(kind_of(read_model(path)) == (2, True) for path in made)
