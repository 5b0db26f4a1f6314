"""The bundled demo: what lies in assets/ is what `launch.py demo` makes, and it can be made."""

from pathlib import Path

import numpy as np
import pytest

from app.training import demo
from runtime_models.evaluate import evaluate
from runtime_models.read_package import read_package
from training.synthetic.workshop import STOPS

BUNDLED = Path(__file__).resolve().parents[1] / "assets" / "workshop.shift"


def test_the_bundled_package_is_small_whole_and_of_these_stops():
    assert BUNDLED.stat().st_size <= demo.MOST_BYTES
    model = read_package(BUNDLED)
    assert model.stops == STOPS
    settings = model.provenance["settings"]
    assert settings["anchors"] == demo.ANCHORS
    assert model.provenance["iterations"] == settings["iterations"] == demo.ITERATIONS
    alive = []
    for stop in STOPS:
        splats = evaluate(model, stop.x, np.array([0.0, 0.5, 2.0]))
        assert np.isfinite(splats.means).all()
        alive.append((splats.opacity > 0).sum())
    assert min(alive) > 5000
    low, high = splats.means.min(0), splats.means.max(0)
    assert (high - low > (1.0, 0.3, 0.6)).all()  # metres: a bench


@pytest.mark.slow
def test_a_tiny_demo_from_start_to_end_and_again(tmp_path, capsys):
    options = demo.Options(
        out=tmp_path, size="48x36", views=4, test_views=1, processes=1, iterations=20
    )
    assert demo.run(options) == 0
    package = tmp_path / "workshop.shift"
    first = read_package(package)
    assert first.stops == STOPS
    assert "Using the photos" not in capsys.readouterr().err
    assert demo.run(options) == 0
    assert "Using the photos" in capsys.readouterr().err
    again = read_package(package)
    np.testing.assert_array_equal(first.anchors, again.anchors)
    np.testing.assert_array_equal(first.features, again.features)
