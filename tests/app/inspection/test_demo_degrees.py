"""The demo's degrees against its ray tracer's own, in views that no training has seen."""

import numpy as np
import pytest

from shapeshift.app.document import Document
from shapeshift.app.drawing import open_renderer
from shapeshift.app.inspection.draw_values import draw_values, measured_scene
from shapeshift.app.paths import DEMO
from shapeshift.runtime_models.package.read_package import read_package
from shapeshift.scene.inspection.marks import read_mark, spot_at
from shapeshift.scene.inspection.value_picture import world_points
from shapeshift.training.synthetic.tracer import photograph, trace
from shapeshift.training.synthetic.workshop import COLD, HOT, dome, place, radiance

SIZE = (384, 288)  # as the photos of its training
VIEWS = dome(8, 1 / 3 + 0.17, SIZE)  # the held-out ones of the stop Thermal


@pytest.fixture(scope="module")
def measured():
    """(values, the tracer's degrees, its share of the scene) of the first six."""
    document = Document.of(read_package(DEMO))
    found = []
    with open_renderer("none", "tiles") as (renderer, _):
        for view in VIEWS[:6]:
            color, share = photograph(view, radiance("Thermal"))
            celsius = COLD + (HOT - COLD) * color[..., 0].astype(np.float64)
            values = draw_values(renderer, measured_scene(document), view)
            found.append((values, celsius, share))
    return found


@pytest.mark.slow
def test_degrees_of_four_views(measured):
    """0.474 °C in the mean and 94.96 % within 2 °C were measured, of 0.5 °C that it is to have; the
    slack is for rounding.

    Where a pixel of the tracer is of the scene by less than a half, neither knows a value.
    """
    errors = [
        np.abs(values.values - celsius)[values.known & (share >= 0.5)]
        for values, celsius, share in measured[:4]
    ]
    assert np.mean([each.mean() for each in errors]) <= 0.5
    assert np.mean([(each <= 2).mean() for each in errors]) >= 0.945
    covered = [(values.known & (s >= 0.5)).sum() / (s >= 0.5).sum() for values, _, s in measured]
    assert min(covered) > 0.98  # it does not win by knowing little


@pytest.mark.slow
def test_one_mark_from_five_views(measured):
    """Spots on what is even around them (1 °C in 9x9 pixels of the tracer): every view that sees
    one again reads the tracer's own degrees there, to 1 °C in 95 of 100.
    """
    first, celsius, share = measured[0]
    errors, views = [], []
    for row in range(20, SIZE[1] - 20, 12):
        for column in range(20, SIZE[0] - 20, 12):
            around = np.s_[row - 4 : row + 5, column - 4 : column + 5]
            if (
                np.ptp(celsius[around]) > 1
                or share[around].min() < 1
                or not first.known[row, column]
            ):
                continue
            spot = spot_at("Sp1", first, (column + 0.5, row + 0.5))
            seen = 0
            for values, wanted, _ in measured[:5]:
                reading = read_mark(spot, values)
                if not reading.samples:
                    continue
                pixel = values.pixel_of(spot.points)[0]
                truth = float(values.at(wanted, pixel)[0])
                errors.append(abs(reading.mean - truth))
                seen += 1
            views.append(seen)
    errors = np.array(errors)
    print(len(views), np.mean(views), errors.mean(), (errors <= 1).mean(), errors.max())
    assert len(views) >= 50 and np.mean(views) >= 3
    assert (errors <= 1).mean() >= 0.98 and errors.mean() <= 0.15  # 0.994 and 0.12 measured


@pytest.mark.slow
def test_hottest_pixels_and_depths(measured):
    """Measured in these six views: the hottest off by 0.07 to 0.34 °C in three, 1.8, 3.2 and 4.1 °C
    in the others; depths off by 5.3 to 7.4 mm in the median, 5.0 to 7.1 mm too far.  A twentieth of
    slack for rounding.
    """
    here, _ = place(opened=False)
    hot, middle, lean = [], [], []
    for values, celsius, share in measured:
        hot.append(abs(values.hottest()[1] - float(celsius[share >= 0.5].max())))
        rows, columns = np.mgrid[: SIZE[1] : 3, : SIZE[0] : 3]
        pixels = np.stack([columns, rows], axis=2).reshape(-1, 2) + 0.5
        eye = values.view.world_from_eye.position
        rays = world_points(values.view, pixels, np.ones(len(pixels))) - eye  # 1 along the view
        length = np.linalg.norm(rays, axis=1)
        far, _ = trace(here, np.broadcast_to(eye, rays.shape), rays / length[:, None])
        shown = values.depth_m[rows.ravel(), columns.ravel()]
        known = np.isfinite(shown) & np.isfinite(far)
        away = (shown - far / length)[known]
        middle.append(float(np.median(np.abs(away))))
        lean.append(float(np.median(away)))
    assert sorted(hot)[2] <= 0.36 and sorted(hot)[3] <= 1.91 and max(hot) <= 4.36
    assert max(middle) <= 0.0078 and np.mean(middle) <= 0.0069
    assert 0 < min(lean) and max(lean) <= 0.0075
