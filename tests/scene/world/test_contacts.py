"""How the impulses of a step are shared out among the pairs that touched."""

import numpy as np
import pytest

from shapeshift.scene.world.contacts import Touch, share_out
from shapeshift.scene.world.physics import FLOOR, Physics
from tests.support.scene.physics_things import at, box, cup, run, table

pytest.importorskip("rapier3d", reason="the physics engine is not installed")


def solved(touches: list[Touch], gained: dict[int, tuple]) -> np.ndarray:
    """The slow twin: impulses (n,) N s by least squares over all bodies."""
    rows = {number: 3 * i for i, number in enumerate(gained)}
    system = np.zeros((3 * len(rows), 3 * len(touches)))
    for column, touch in enumerate(touches):
        for number, sign in zip(touch.ids, (-1, 1), strict=True):
            if number in rows:
                place = slice(rows[number], rows[number] + 3)
                system[place, 3 * column : 3 * column + 3] = sign * np.eye(3)
    vectors = np.linalg.lstsq(system, np.concatenate(list(gained.values())), rcond=None)[0]
    return np.linalg.norm(vectors.reshape(-1, 3), axis=1)


@pytest.mark.parametrize("seed", range(20))
def test_sharing_out_over_a_tree_is_the_solution_of_its_equations(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 12))
    touches, true = [], []
    gained = {number: np.zeros(3) for number in range(1, count + 1)}
    for number in gained:  # each hangs on an earlier one, the first on the floor: a tree
        other = int(rng.integers(0, number))
        vector = rng.standard_normal(3)
        ids = (other, number) if rng.random() < 0.5 else (number, other)
        touches.append(Touch(ids, -1.0, None))
        true.append(np.linalg.norm(vector))
        gained[number] += vector if ids[1] == number else -vector
        if other:
            gained[other] += vector if ids[1] == other else -vector
    want = solved(touches, gained)
    share_out(touches, {number: tuple(v) for number, v in gained.items()})
    got = [touch.impulse for touch in touches]
    assert np.allclose(got, true) and np.allclose(got, want)


def test_in_a_ring_and_in_a_hand_the_engines_count_stays():
    ring = [Touch((a, b), 7.0, None) for a, b in ((1, 2), (2, 3), (3, 1))]
    share_out(ring, dict.fromkeys((1, 2, 3), (1.0, 0.0, 0.0)))
    assert [touch.impulse for touch in ring] == [7.0] * 3
    held = [Touch((0, 1), 7.0, None)]
    share_out(held, {})
    assert held[0].impulse == 7.0


@pytest.mark.parametrize("hulls", [1, 8, 16])
def test_in_a_tower_each_pair_bears_what_stands_on_it(hulls):
    physics = Physics(floor_y=0)
    objects = cup(hulls) if hulls > 1 else [box(0.06, 0.06, 0.06)]
    tower = [physics.add_body(objects, at(0, 0.06 + 0.1202 * i, 0), 0.4) for i in range(3)]
    run(physics, 0.3)
    told: dict[tuple[int, int], list[float]] = {}
    for _ in range(20):
        for contact in physics.step():
            told.setdefault((contact.a, contact.b), []).append(contact.impulse_n_s)
    weight = 0.4 * 9.81 / 90
    pairs = [(FLOOR, tower[0]), (tower[0], tower[1]), (tower[1], tower[2])]
    assert sorted(told) == pairs
    for pair, above in zip(pairs, (3, 2, 1), strict=True):
        assert np.mean(told[pair]) == pytest.approx(above * weight, rel=0.03)


def test_what_falls_and_comes_to_rest_has_had_all_of_its_weight_as_impulses():
    """Momentum is lost and gained by weight and contacts alone: their sum is m g t + m v."""
    physics = Physics(floor_y=0)
    body = physics.add_body([box(0.05, 0.05, 0.05)], at(0, 0.1, 0), 0.4)
    told = sum(c.impulse_n_s for _ in range(18) for c in physics.step())  # it lands after 0.1 s
    kept = 0.4 * physics.velocity(body)[0][1]
    # Soft contacts give a little back, and sizes are told: 1.5 % more.
    assert told == pytest.approx(0.4 * 9.81 * 18 / 90 + kept, rel=0.03)


def test_a_table_that_is_put_elsewhere_carries_there():
    physics = Physics()
    top = table(physics, "slab")
    body = physics.add_body([box(0.05, 0.05, 0.05)], at(0, 0.0501, 0), 0.3)
    run(physics, 3)
    physics.set_pose(top, at(0, -0.5, 0))
    run(physics, 1)
    assert physics.pose(body).position[1] == pytest.approx(-0.44, abs=0.001)
    assert physics.cast_ray((0.8, 1, 0), (0, -1, 0)) == (top, pytest.approx(1.49, abs=1e-4))
