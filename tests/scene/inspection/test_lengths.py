"""Lengths, angles, areas: known figures, and their errors against a cloud of random points."""

import numpy as np
import pytest

from shapeshift.scene.inspection.lengths import KINDS, Point, Scale, measure
from tests.support.scene.warm_wall import traced

SQUARE = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], float)


def exact(places) -> list[Point]:
    return [Point(np.array(place, float), np.zeros((3, 3))) for place in places]


def test_known_figures():
    assert measure("distance", exact(SQUARE[:2])).value == 2
    assert measure("polyline", exact(SQUARE)).value == 5
    assert measure("angle", exact(SQUARE[:3])).value == pytest.approx(90)
    assert measure("angle", exact([(1, 0, 0), (0, 0, 0), (-1, 0, 0)])).value == pytest.approx(180)
    assert measure("area", exact(SQUARE)).value == pytest.approx(2)
    assert measure("area", exact(SQUARE[::-1] + 5e3)).value == pytest.approx(2)
    turned = SQUARE @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    assert measure("area", exact(turned)).value == pytest.approx(2)
    assert all(measure(kind, exact(SQUARE[:least])).uncertainty == 0
               for kind, (_, least, *_) in KINDS.items())  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_uncertainty_is_the_spread_of_random_points(kind):
    """4,000 draws: the standard deviation of theirs is known to 1.1 %; 5 % are allowed."""
    rng = np.random.default_rng(3)
    count = KINDS[kind][1]
    spreads = [np.diag([1e-3, 2e-3, 5e-4]) ** 2 for _ in range(count)]
    places = SQUARE[:count] + rng.normal(size=(count, 3)) * 0.1
    told = measure(kind, [Point(p, c) for p, c in zip(places, spreads, strict=True)])
    noise = rng.normal(size=(4000, count, 3)) @ np.diag([1e-3, 2e-3, 5e-4])
    values = [KINDS[kind][0](places + each) for each in noise]
    assert told.uncertainty == pytest.approx(np.std(values), rel=0.05)


def test_a_known_length_scales_everything():
    scale = Scale.of_known(exact([(0, 0, 0), (0, 0, 4)]), 2.0)
    assert scale == Scale(0.5, 0.0)
    assert measure("distance", exact(SQUARE[:2]), scale).value == 1
    assert measure("area", exact(SQUARE), scale).value == pytest.approx(0.5)
    assert measure("angle", exact(SQUARE[:3]), scale).value == pytest.approx(90)
    sloppy = Scale(1.0, 0.01)
    assert measure("distance", exact(SQUARE[:2]), sloppy).uncertainty == pytest.approx(0.02)
    assert measure("area", exact(SQUARE), sloppy).uncertainty == pytest.approx(0.04)
    assert measure("angle", exact(SQUARE[:3]), sloppy).uncertainty == 0


@pytest.mark.parametrize(
    ("kind", "places"),
    [("distance", SQUARE[:1]), ("distance", SQUARE), ("angle", SQUARE), ("area", SQUARE[:2]),
     ("volume", SQUARE), ("polyline", [(0, 0, 0), (np.nan, 0, 0)])],
)  # fmt: skip
def test_what_cannot_be_measured_is_one_sentence(kind, places):
    with pytest.raises(ValueError, match=r"^[^\n]+\.$"):
        measure(kind, exact(places))
    for metres in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="known length"):
            Scale.of_known(exact(SQUARE[:2]), metres)
    with pytest.raises(ValueError, match="apart"):
        Scale.of_known(exact(SQUARE[[0, 0]]), 1.0)


def test_points_of_a_picture_have_their_pixel_and_their_depth():
    """Across: half a pixel; along: 0.6 % of the depth, on a plane that is flat."""
    picture = traced()
    point = picture.picked((48.5, 36.5))
    _, fx, _, _, _ = picture.view.pinhole()
    sigma = np.sqrt(np.diag(point.covariance))
    assert sigma[:2] == pytest.approx([0.5 * 1.5 / fx] * 2, rel=0.02)
    assert sigma[2] == pytest.approx(0.006 * 1.5, rel=0.02)
    wide = measure("distance", [picture.picked((20, 36)), picture.picked((76, 36))])
    truth = picture.points[36, 76, 0] - picture.points[36, 20, 0]
    assert abs(wide.value - truth) <= wide.uncertainty
