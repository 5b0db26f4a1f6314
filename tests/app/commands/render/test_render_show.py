"""render --show, and show= in Python: the same pictures, in the view of the whole."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import shapeshift as ss
from shapeshift.app import cli
from shapeshift.runtime_models.model import ObjectLabel
from shapeshift.runtime_models.package.write_package import write_package
from tests.support.models import make_random_model

SIZE = (96, 64)


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    path = tmp_path_factory.mktemp("show") / "room.shift"
    model = make_random_model(60)
    labels = (model.anchors[:, 0] > 0).astype(np.uint8)
    write_package(replace(model, labels=labels, objects=(ObjectLabel(1, "mug"),)), path, "float32")
    return path


def render(path, out, *words) -> int:
    size = f"{SIZE[0]}x{SIZE[1]}"
    arguments = ("render", path, "--out", out, "--size", size, "--drawing", "tiles", *words)
    return cli.main([str(word) for word in arguments])


@pytest.mark.parametrize("show", ["full", "overlay", "background", "isolated", "isolated:mug"])
def test_the_command_and_python_draw_the_same(room, tmp_path, show):
    assert render(room, tmp_path, "--show", show) == 0
    (path,) = tmp_path.glob("*.png")
    picture = np.asarray(Image.open(path), np.float32) / 255
    same = ss.load(room).render(x=0, size=SIZE, drawing="tiles", show=show)
    assert np.abs(picture - same).max() < 0.003
    whole = ss.load(room).render(x=0, size=SIZE, drawing="tiles")
    assert (np.abs(picture - whole).max() < 0.003) == (show == "full")


def test_what_is_no_view_is_refused_before_and_after_opening(room, tmp_path, capsys):
    for words, told in (
        (("--show", "all"), "--show: 'all' is no view; expected full, overlay"),
        (("--show", "isolated:cup"), "it has 0, 1 mug"),
        (("--show", "isolated", "--select", "sphere:0,0,0:1:1"), "goes without --select"),
    ):
        assert render(room, tmp_path / "out", *words) == 2
        said = capsys.readouterr().err.strip().splitlines()[-1]
        assert said.startswith("shapeshift render: ") and told in said
    assert not list(tmp_path.rglob("*.png"))
    with pytest.raises(ss.UsageError, match=r"show overlay: .*has no objects beside"):
        ss.load(ss.DEMO).render(show="overlay")
