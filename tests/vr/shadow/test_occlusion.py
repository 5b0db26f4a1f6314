"""The light that an object keeps off its plane, against closed forms and against rays."""

import numpy as np
import pytest

from shapeshift.vr.shadow import CELLS, FADES, Shadow, blocks_of, shadow_on
from tests.support.vr.shadow_shapes import (
    disc,
    disc_occlusion,
    sphere,
    sphere_occlusion,
    surface_splats,
    traced,
)

PLANE_Y = 1.0


def moved(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def places(shadow: Shadow) -> tuple[np.ndarray, np.ndarray]:
    """x and z of the cells from the object's own place, (CELLS,) metres each."""
    at = (np.arange(CELLS) + 0.5) / CELLS * shadow.side_m
    return at + shadow.corner[0], at + shadow.corner[1]


def unfaded(shadow: Shadow) -> np.ndarray:
    at = (np.arange(CELLS) + 0.5) / CELLS * 2 - 1
    return np.hypot.outer(at, at) < FADES


@pytest.mark.parametrize("height", [0.1, 0.12, 0.2, 0.4])
def test_a_sphere_hides_what_the_closed_form_says(height):
    """Within 0.11, 0.05 in the root mean square: a cell is an eighth of the radius where it stands
    on the plane, and every cell that its surface meets is taken for full.
    """
    shadow = shadow_on(blocks_of(*sphere(0.1)), moved(0.3, PLANE_Y + height, -0.2), PLANE_Y)
    x, z = places(shadow)
    true = sphere_occlusion(height, 0.1, np.hypot(x[None], z[:, None]))
    error = (shadow.occlusion - true)[unfaded(shadow)]
    assert np.abs(error).max() < 0.11 and np.sqrt((error**2).mean()) < 0.05
    assert shadow.occlusion.max() == pytest.approx(true.max(), abs=0.1)


@pytest.mark.parametrize("height", [0.05, 0.1, 0.2])
def test_a_level_disc_hides_what_the_closed_form_says(height):
    shadow = shadow_on(blocks_of(*disc(0.1)), moved(0.0, PLANE_Y + height, 0.0), PLANE_Y)
    x, z = places(shadow)
    true = disc_occlusion(height, 0.1, np.hypot(x[None], z[:, None]))
    error = (shadow.occlusion - true)[unfaded(shadow)]
    assert np.abs(error).max() < 0.06 and np.sqrt((error**2).mean()) < 0.03


def test_a_standing_wall_hides_what_rays_say():
    """Its sides count, not only what is seen from above; within 0.1 at each place."""
    rng = np.random.default_rng(5)
    wide, tall = 0.2, 0.3
    points = np.stack([
        wide * (rng.random(8000) - 0.5), tall * rng.random(8000), np.zeros(8000)
    ], 1)  # fmt: skip
    shadow = shadow_on(blocks_of(*surface_splats(points, 0.003)), moved(0, PLANE_Y, 0), PLANE_Y)
    x, z = places(shadow)

    def blocked(origin: np.ndarray, ways: np.ndarray) -> np.ndarray:
        far = -origin[2] / ways[:, 2]
        at = origin + far[:, None] * ways
        return (far > 0) & (np.abs(at[:, 0]) < wide / 2) & (at[:, 1] < tall)

    for column, row in ((32, 40), (32, 48), (40, 44), (20, 36), (32, 24)):
        true = traced(blocked, np.array([x[column], z[row]]))
        assert shadow.occlusion[row, column] == pytest.approx(true, abs=0.1), (column, row)
        assert true > 0.02


def test_a_veil_of_half_opacity_hides_half_of_what_a_solid_one_does():
    """One layer of splats side by side, straight above: T is 1 - mean of their alpha."""
    at = (np.arange(60) - 29.5) * 0.02
    points = np.stack(np.meshgrid(at, [0.0], at, indexing="ij"), -1).reshape(-1, 3)
    mean_opacity, covariance = surface_splats(points, 0.008)
    wide = {}
    for opacity in (0.2, 0.95):
        mean_opacity[:, 3] = opacity
        shadow = shadow_on(blocks_of(mean_opacity, covariance), moved(0, 1.05, 0), PLANE_Y)
        wide[opacity] = shadow.occlusion[CELLS // 2, CELLS // 2]
    # Optical depth 2 pi o sigma^2 / 0.02^2 = 0.2 along the normal, 0.2 / cos aside of it.
    share = (np.arange(1000) + 0.5) / 1000
    true = (1 - np.exp(-2 * np.pi * 0.2 * 0.008**2 / 0.02**2 / np.sqrt(1 - share))).mean()
    assert wide[0.2] == pytest.approx(true, abs=0.05)
    assert wide[0.95] > 1.8 * wide[0.2]


def test_higher_is_paler_and_wider_and_the_edge_is_nothing():
    blocks = blocks_of(*sphere(0.1))
    shadows = [shadow_on(blocks, moved(0, PLANE_Y + h, 0), PLANE_Y) for h in (0.1, 0.2, 0.4)]
    most = [s.occlusion.max() for s in shadows]
    assert most[0] > 0.95 and most == sorted(most, reverse=True)
    assert [s.side_m for s in shadows] == sorted(s.side_m for s in shadows)
    for shadow in shadows:
        edge = np.concatenate(
            [shadow.occlusion[[0, -1]].ravel(), shadow.occlusion[:, [0, -1]].ravel()]
        )
        assert edge.max() < 1e-2 and shadow.occlusion.min() >= 0 and shadow.occlusion.max() <= 1


def test_it_goes_with_the_object_and_turns_with_it():
    """The picture is of the object's own place: somewhere else it is the same to the bit."""
    mean_opacity, covariance = disc(0.1)
    mean_opacity[:, 0] *= 0.3  # a strip along z
    blocks = blocks_of(mean_opacity, covariance)
    here = shadow_on(blocks, moved(0, 1.1, 0), PLANE_Y)
    there = shadow_on(blocks, moved(1000.0, 1.1, -500.0), PLANE_Y)
    np.testing.assert_array_equal(here.occlusion, there.occlusion)
    quarter = moved(0, 1.1, 0)
    quarter[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    turned = shadow_on(blocks, quarter, PLANE_Y)
    # A quarter turn of directions that are no quarter turn of themselves.
    np.testing.assert_allclose(turned.occlusion, here.occlusion.T[::-1, :], atol=0.06)
    middle = CELLS // 2
    along, across = here.occlusion[middle - 12, middle], here.occlusion[middle, middle - 12]
    assert along > 1.3 * across > 0.05, "rows go along z"


def test_what_is_below_hazy_or_no_number_hides_nothing():
    mean_opacity, covariance = sphere(0.1, 50)
    assert shadow_on(blocks_of(mean_opacity, covariance), moved(0, 0.5, 0), PLANE_Y) is None
    faint = mean_opacity.copy()
    faint[:, 3] = 0.05  # exactly the bound
    assert shadow_on(blocks_of(faint, covariance), moved(0, 1.5, 0), PLANE_Y) is None
    assert shadow_on(blocks_of(mean_opacity[:0], covariance[:0]), moved(0, 2, 0), PLANE_Y) is None
    for wrong in (np.nan, np.inf):
        broken, bent = mean_opacity.copy(), covariance.copy()
        broken[:10, 1], bent[10:20, 3] = wrong, wrong
        blocks = blocks_of(broken, bent)
        assert len(blocks.points) == 7 * 30 and np.isfinite(blocks.points).all()
    one = shadow_on(blocks_of(mean_opacity[:1], covariance[:1]), moved(0, 1.5, 0), PLANE_Y)
    assert one is None or np.isfinite(one.occlusion).all()
