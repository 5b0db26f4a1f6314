"""The gate before packages: networks that ask for splats as large as the scene."""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.evaluate import evaluate
from shapeshift.runtime_models.lint import lint_whole
from shapeshift.runtime_models.lint.lint_whole import fill_ratio, sample_of
from shapeshift.runtime_models.model import AnchorModel, BadFile
from shapeshift.runtime_models.package.write_package import write_package
from shapeshift.runtime_models.read_scene import read_model, refuse_filling
from shapeshift.runtime_models.splats.plain_splats import Reading
from tests.support.models import make_random_model


def huge(anchors: int, gain: float) -> AnchorModel:
    model = make_random_model(anchors)
    scale = replace(model.networks["scale"], gain=gain)
    return replace(model, networks=model.networks | {"scale": scale})


def test_a_package_of_huge_splats_is_refused_unless_asked_for(tmp_path):
    path = tmp_path / "a.shift"
    write_package(huge(2000, 50.0), path)
    with pytest.raises(BadFile, match=r"a.shift: .* splats would lie over every pixel.*allow-huge"):
        read_model(path)
    assert read_model(path, Reading(allow_huge=True)).splat_count == 10_000
    write_package(huge(2000, 0.02), path)
    assert read_model(path, Reading(strict=True)).splat_count == 10_000


@pytest.mark.parametrize("anchors, tolerance", [(1, 1e-6), (500, 1e-5), (12_000, 0.1)])
def test_the_fullest_stop_counts(monkeypatch, anchors, tolerance):
    model, ratios = huge(anchors, 0.5), []
    for stop in model.stops:
        splats = evaluate(model, stop.x, np.zeros(3))
        there = splats.opacity > 0
        ratios.append(
            fill_ratio(
                sample_of(*(getattr(splats, n)[there] for n in ("means", "scales", "opacity")))
            )
            if there.any()
            else 0.0
        )
    most = max(ratios)
    monkeypatch.setattr(lint_whole, "MOST_LAYERS", most * (1 + tolerance))
    refuse_filling(model, "a")
    monkeypatch.setattr(lint_whole, "MOST_LAYERS", most * (1 - tolerance))
    with pytest.raises(BadFile, match="splats would lie over every pixel"):
        refuse_filling(model, "a")


def test_networks_that_give_nothing_drawable_pass_the_gate():
    refuse_filling(huge(50, np.inf), "a")


def test_places_beyond_any_scene_are_refused():
    model = make_random_model(50)
    far = replace(model.networks["offset"], gain=1e15)
    with pytest.raises(BadFile, match="positions spread over"):
        refuse_filling(replace(model, networks=model.networks | {"offset": far}), "a")
