"""When colours run again and for whom: nothing that shows may be left out."""

from dataclasses import replace

import numpy as np

from shapeshift.renderer.colors.color_cache import (
    ColorCache,
    centre_of,
    color_key,
    reach_of,
    visible_anchors,
)
from shapeshift.renderer.settings import RenderSettings
from shapeshift.scene.pose import Pose, View, look_at
from tests.support.splat_scenes import (
    alone,
    front_view,
    psnr_db,
    random_layers,
    random_model,
    stereo_views,
)

TURNED = Pose(np.array([0.1, 0.2, 0.3]), np.array([0.8, 0, 0.6, 0]))
NARROW = (-0.08, 0.12, -0.1, 0.05)


def looking(yaw: float, size=(96, 72), tangents=NARROW) -> View:
    """From one place, turned by `yaw` degrees."""
    angle = np.radians(yaw)
    at = np.array([0.2, 0.1, 2.0])
    return View(
        look_at(at, at + np.array([np.sin(angle), -0.05, -np.cos(angle)])), tangents, 0.05, 50, size
    )


def film(renderer, model, views, **settings) -> list[tuple[np.ndarray, int]]:
    """Image and colour runs of each frame."""
    renderer.settings = RenderSettings(**settings)
    renderer.update(alone(model, x=0.3, world_from_object=TURNED))
    frames = []
    for view in views:
        runs = renderer.draw(view if isinstance(view, list) else [view]).color_runs
        frames.append((renderer.image().copy(), runs))
    return frames


def test_what_is_skipped_is_never_seen(renderer):
    model = random_model(800)
    path = [looking(yaw) for yaw in (0, 4, 8, 30, -20, 0)]
    path += [front_view((96, 72), distance=d) for d in (4.0, 3.0, 0.5)] + [looking(170)]
    path += [stereo_views((96, 72)), looking(10, tangents=(-4, 5, -3, 6))]
    skipping = film(renderer, model, path, skip_unseen=True)
    renderer.update(alone(random_layers(1)))  # forgets
    for (got, _), (want, _) in zip(skipping, film(renderer, model, path), strict=True):
        np.testing.assert_array_equal(got, want)


def decoded(renderer, monkeypatch) -> list[int]:
    """How many anchors each call of decode_color was asked for; filled while frames are drawn."""
    asked, whole = [], renderer.drawing.decode_color

    def count(i, shade, eye, seen=None, *how):
        asked.append(-1 if seen is None else int(np.count_nonzero(seen)))
        whole(i, shade, eye, seen, *how)

    monkeypatch.setattr(renderer.drawing, "decode_color", count)
    return asked


def test_a_turning_head_colours_newcomers_alone(renderer, monkeypatch):
    model = random_model(800, seed=1)
    asked = decoded(renderer, monkeypatch)
    # Beside the cloud: less than half of it is seen, else all of it would be coloured.
    first, moved = looking(30), looking(31)
    moved = replace(
        moved, world_from_eye=Pose(np.array([0.2, 0.1, 2.1]), moved.world_from_eye.wxyz)
    )
    views = [first, moved, moved, first, looking(32), looking(32), looking(27)]
    frames = film(renderer, model, views, skip_unseen=True)
    runs = [run for _, run in frames]
    assert runs[:4] == [1, 1, 0, 1] and runs[5] == 0
    assert asked[0] == -1, "how far splats reach is not known while x changes"
    assert 0 < asked[1] < 800 and 0 < asked[2] < 800, "an eye that moved: all that is seen"
    assert sum(asked[3:]) < 800, "a head that turned: what came into view"
    assert film(renderer, model, [looking(27)])[0][1] == 1, "without skipping the rest follows"
    assert film(renderer, model, [looking(27), looking(90)])[1][1] == 0


def test_layers_are_coloured_as_a_whole(renderer, monkeypatch):
    asked = decoded(renderer, monkeypatch)
    film(renderer, random_layers(300), [looking(0), front_view((96, 72))], skip_unseen=True)
    assert asked == [-1, -1]


def test_colours_stay_until_the_eye_has_gone_around_by_so_much(renderer):
    model = random_model(300, seed=2)
    centre = TURNED.matrix() @ [*centre_of(model), 1]

    def around(degrees: float, distance: float = 3.0) -> View:
        angle = np.radians(degrees)
        eye = centre[:3] + distance * np.array([np.sin(angle), 0, np.cos(angle)])
        return View(look_at(eye, centre[:3]), (-0.4, 0.4, -0.3, 0.3), 0.05, 50, (96, 72))

    path = [around(a) for a in (0, 4, 9, 11, 15, 20, 22)] + [around(22, 2.0)]
    frames = film(renderer, model, path, recolor_degrees=10.0)
    assert [runs for _, runs in frames] == [1, 0, 0, 1, 0, 0, 1, 0]
    exact = film(renderer, model, path)
    for (got, runs), (want, _) in list(zip(frames, exact, strict=True))[:-1]:
        if runs:
            np.testing.assert_array_equal(got, want)
        else:
            assert 25 < psnr_db(got, want) < 100, "a little wrong, and it shows"


def test_a_new_control_value_colours_whatever_the_angle():
    colored = ColorCache(np.zeros(3), (0.5, (0.0, 0.0, 2.0)))
    assert not colored.is_stale((0.5, (0.1, 0.0, 2.0)), 10.0)
    assert colored.is_stale((0.6, (0.0, 0.0, 2.0)), 10.0)
    assert colored.is_stale((0.5, (0.1, 0.0, 2.0)), 0.0)
    assert not colored.is_stale((0.5, (0.0, 0.0, 2.0)), 0.0)
    assert colored.is_stale((0.5, (0.0, 0.0, 0.0)), 10.0), "from the centre itself: no direction"
    assert ColorCache(np.zeros(3)).is_stale((None, None), 10.0)


def test_visible_anchors_hold_every_drawn_splat(renderer):
    """Against what projection draws, anchor by anchor, from many places and with wide splats."""
    model = random_model(500, seed=3)
    rng = np.random.default_rng(0)
    drawing, left_out = renderer.drawing, {False: 0, True: 0}
    for number in range(60):
        eye = rng.normal(size=3) * 1.5
        tangents = np.array([-1, 1, -1, 1]) * rng.uniform(0.05, 1.5, 4)
        beside = number >= 40
        if beside:  # the axis: splats are long there
            tangents = tangents + np.repeat(rng.uniform(-1.5, 1.5, 2), 2)
        tangents = tuple(tangents.tolist())
        view = View(look_at(eye, rng.normal(size=3)), tangents, 0.05, 50, (64, 48))
        settings = RenderSettings(low_pass=float(rng.choice([0, 0.3, 30.0])))
        renderer.settings = settings
        renderer.update(alone(model, x=0.3, world_from_object=TURNED))
        renderer.draw([view])
        # What project culls is of one pass: a picture shows less, since splats hide each other.
        depth = drawing.device.download(drawing._projected[0].depth)
        drawn = (depth < 1e30).reshape(500, -1).any(axis=1)
        mean_opacity, _, covariance = drawing.splat_points()
        reach = reach_of(model.anchors, mean_opacity, covariance, np.sqrt(2 * np.log(255)))
        seen = visible_anchors(model.anchors, reach, TURNED.matrix(), [view], settings)
        assert (seen | ~drawn).all()
        left_out[beside] += np.count_nonzero(~seen)
    told = "it must leave out something to be of use"
    assert left_out[False] > 40 * 60 and left_out[True] > 20 * 20, told


def test_keys_are_equal_where_colours_are():
    model = random_model(3)
    assert color_key(model, 0.1, np.zeros(3)) == color_key(model, 0.1, np.zeros(3))
    assert color_key(model, 0.1, np.zeros(3)) != color_key(model, 0.2, np.zeros(3))
    assert color_key(random_layers(3), 0.1, np.ones(3)) == color_key(
        random_layers(3), 0.9, np.ones(3)
    )
