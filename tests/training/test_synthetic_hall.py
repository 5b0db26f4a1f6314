"""The plant hall: where its cameras walk, what they see, what its capture says."""

import numpy as np
import pytest
from PIL import Image

from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import View
from shapeshift.training.synthetic.tracer import Place, at_edges, blocked, pixel_rays, trace
from tools.synthetic.hall import hall

FREE = 0.2  # metres round a camera where nothing is
LEAST_VIEWS = 3  # that show a fault from nearby: two give its place, a third confirms it
RAYS = 60
NEARBY = 9.0  # metres
CELSIUS_STEP = (hall.HOT - hall.COLD) / 255  # of an 8-bit photo


@pytest.fixture(scope="module")
def solids():
    return hall.solids()


def rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """From all over the hall to all sides."""
    rng = np.random.default_rng(3)
    o = rng.uniform((-16, 0.3, -10), (16, 8, 10), (count, 3))
    d = rng.standard_normal((count, 3))
    return o, d / np.linalg.norm(d, axis=1, keepdims=True)


def test_walls_met_first_change_no_hit(solids):
    """The order of the tree decides how long it takes, not what is met."""
    o, d = rays(4000)
    usual, sorted_ = Place.of(solids), Place.of(solids, hall.LARGE)
    distance, index = trace(sorted_, o, d)
    plain_distance, plain_index = trace(usual, o, d)
    np.testing.assert_allclose(distance, plain_distance, rtol=1e-12)
    # Surfaces that lie on each other may change places; their distance is the same.
    assert (index != plain_index).mean() < 0.01
    np.testing.assert_array_equal(blocked(sorted_, o, d), blocked(usual, o, d))
    np.testing.assert_array_equal(np.isfinite(distance), blocked(usual, o, d))


def test_what_is_met_is_the_nearest_of_all_solids_one_by_one(solids):
    o, d = rays(300)
    alone = np.min([solid.nearest(o, d) for solid in solids], axis=0)
    np.testing.assert_allclose(trace(Place.of(solids, hall.LARGE), o, d)[0], alone, rtol=1e-12)


def test_nobody_walks_through_a_machine(solids):
    eyes = np.array([pose.position for pose in hall.walk(320)])
    nearest = np.min([np.abs(solid.distance(eyes)) for solid in solids], axis=0)
    assert nearest.min() > FREE, eyes[nearest < FREE]
    inside = (np.abs(eyes[:, 0]) < hall.HALF_X) & (np.abs(eyes[:, 2]) < hall.HALF_Z)
    assert inside.all() and (eyes[:, 1] > 1.2).all() and (eyes[:, 1] < 2.3).all()


def test_it_is_as_large_and_full_as_it_says(solids):
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for solid in solids[1 : hall.LARGE]:  # walls and roof
        low = np.minimum(low, solid.centre)
        high = np.maximum(high, solid.centre)
    assert high[0] - low[0] >= 30 and high[2] - low[2] >= 20
    assert sum(len(groups) for groups in hall.GROUPS) == 12
    assert len({group.__name__ for groups in hall.GROUPS for group in groups}) == 12
    # Beyond the windows it goes on: ground to 900 metres, then the sky.
    eye = np.array([[0.0, 1.6, 40.0], [0.0, 1.6, 40.0]])
    ahead = np.array([[0.6, -0.01, -0.1], [0.0, 1.0, 0.0]])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    distance, index = trace(Place.of(solids, hall.LARGE), eye, ahead)
    assert distance[0] > 100 and index[1] == -1


def test_an_unknown_group_is_an_error():
    with pytest.raises(KeyError):
        hall.world_from_group("pomps")


def views_near(views: list[View], fault: hall.Fault) -> list[View]:
    """Those that have its place in their frame, from no farther than NEARBY."""
    out = []
    for view in views:
        turn = view.world_from_eye.matrix()[:3, :3]
        local = np.subtract(fault.place, view.world_from_eye.position) @ turn
        _, right, _, up = view.tangents
        sides = -local[2] * np.array([right, up])
        if -NEARBY < local[2] < -0.3 and (np.abs(local[:2]) < sides).all():
            out.append(view)
    return out


@pytest.mark.slow
def test_each_fault_is_hot_and_seen(solids):
    """Every view may be asked where a fault is: rays at RAYS places round it."""
    rng = np.random.default_rng(0)
    scatter = 0.12 * rng.standard_normal((RAYS, 3))
    here, _ = hall.place()
    views = hall.photo_views(320, (32, 24))[1]
    for fault in hall.faults():
        nearby = views_near(views, fault)
        o = np.repeat([view.world_from_eye.position for view in nearby], RAYS, axis=0)
        d = np.tile(fault.place + scatter, (len(nearby), 1)) - o
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        celsius, _ = hall.degrees(o, d)
        points = o + np.minimum(trace(here, o, d)[0], 1e6)[:, None] * d
        near = np.linalg.norm(points - fault.place, axis=1) < 0.35
        hottest = np.where(near, celsius, -np.inf).reshape(-1, RAYS).max(axis=1)  # (views,)
        assert (hottest > fault.celsius - 15).sum() >= LEAST_VIEWS, fault.name
        assert fault.celsius - 6 < hottest.max() < fault.celsius + 3, fault.name


@pytest.mark.slow
def test_a_small_capture_of_it(tmp_path):
    heard = []
    made = hall.make_hall(
        tmp_path / "hall", (32, 24), 18, 16, 1, lambda done, count: heard.append((done, count))
    )
    assert heard[-1] == (36, 36)
    capture = read_capture(made.folder)
    assert [stop.name for stop in capture.stops] == ["RGB", "Thermal"]
    assert capture.stops[1].value_range == (hall.COLD, hall.HOT)
    assert [len(capture.of(name, "test")) for name in ("RGB", "Thermal")] == [1, 1]
    assert [len(capture.of(name, "train")) for name in ("RGB", "Thermal")] == [17, 17]
    assert not (made.folder / "masks").exists()
    assert len(capture.points) == len(capture.point_colors) == 60000
    photo = capture.of("Thermal", "train")[4]
    share = np.asarray(Image.open(photo.path))[..., 0] / 255.0
    o = np.broadcast_to(np.asarray(photo.view.world_from_eye.position), (24 * 32, 3))
    rows, columns = (g.ravel() + 0.5 for g in np.mgrid[:24, :32])
    celsius, index = hall.degrees(o, pixel_rays(photo.view, columns, rows))
    wanted = np.clip((celsius - hall.COLD) / (hall.HOT - hall.COLD), 0, 1).reshape(24, 32)
    edge = at_edges(wanted[..., None], index.reshape(24, 32))
    found = hall.COLD + (hall.HOT - hall.COLD) * share[~edge]
    truth = hall.COLD + (hall.HOT - hall.COLD) * wanted[~edge]
    assert np.abs(found - truth).max() <= 0.51 * CELSIUS_STEP  # rounded to 8 bits
    right = capture.of("RGB", "train")[4].view.world_from_eye
    apart = np.subtract(photo.view.world_from_eye.position, right.position)
    assert np.linalg.norm(apart) == pytest.approx(hall.RIG, rel=1e-5)
