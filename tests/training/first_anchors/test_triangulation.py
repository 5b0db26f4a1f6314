"""Points out of photos and their poses alone, against the surfaces that the tracer photographed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.first_anchors import initial, triangulation
from shapeshift.training.first_anchors.first_anchors import first_anchors
from shapeshift.training.first_anchors.initial import initial_points
from shapeshift.training.first_anchors.triangulation import (
    EFFORTS,
    SHARE,
    choose_effort,
    choose_pairs,
    cost_s,
    thinned,
    triangulated_points,
)
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.synthetic.solids import Ball, Disc
from shapeshift.training.synthetic.tracer import (
    Material,
    Place,
    Solid,
    look,
    pattern_at,
    pixel_rays,
)

pytest.importorskip("pycolmap", reason="pycolmap is not installed")

RNG = np.random.default_rng
SIZE = (112, 112)
RADIUS, MIDDLE = 0.4, np.array([0.0, 0.4, 0.0])  # of the ball on the disc, metres
CAPTURE = Capture(Path("a"), (), ())


def speckles(p: np.ndarray) -> np.ndarray:
    """Cells of 8 cm in a colour of their own, as noise has: SIFT finds their corners."""
    cells = np.floor(p / 0.08 + 0.5).astype(np.int64) @ np.array([73856093, 19349663, 83492791])
    return RNG(5).random(4096)[cells % 4096][:, None] * np.ones(3)


def place() -> Place:
    ball = np.eye(4)
    ball[:3, 3] = MIDDLE
    return Place.of(
        [Solid(Disc(1.5), Material(speckles)), Solid(Ball(RADIUS), Material(speckles), ball)]
    )


def ring(count: int, turn_deg: float, away: float = 2.2) -> list[View]:
    """Views from a circle, as far apart as that, towards the ball."""
    turns = np.deg2rad(turn_deg) * np.arange(count)
    eyes = [away * np.array([np.cos(t), 0.55, np.sin(t)]) for t in turns]
    return [
        View(look_at(eye, np.array([0, 0.25, 0])), perspective(0.75, SIZE), 0.05, 100.0, SIZE)
        for eye in eyes
    ]


def photo_of(view: View, masked: bool = False) -> LoadedPhoto:
    """The mean of 3 x 3 rays a pixel; masked: the ball alone."""
    many = 3
    width, height = view.size
    row, column = np.mgrid[: height * many, : width * many]
    fine = view.resized((width * many, height * many))
    directions = pixel_rays(fine, column.ravel(), row.ravel())
    hits = look(place(), np.tile(view.world_from_eye.position, (len(directions), 1)), directions)
    color = np.where(hits.index[:, None] >= 0, pattern_at(place(), hits, "color", 3), 0.5)
    there = hits.index == 1 if masked else np.ones(len(color), bool)
    whole = np.concatenate([color, there[:, None]], axis=1)
    fine_rgba = whole.reshape(height, many, width, many, 4)
    return LoadedPhoto(
        view, "RGB", np.rint(255 * fine_rgba.mean((1, 3))).astype(np.uint8), None, ""
    )


@pytest.fixture(scope="module")
def photos() -> list[LoadedPhoto]:
    return [photo_of(view) for view in ring(6, 9.0)]


def found(photos: list[LoadedPhoto]) -> np.ndarray:
    return triangulated_points(photos, None, lambda stage, done, of: None)


def off_surface(points: np.ndarray) -> np.ndarray:
    """(P,) metres to the disc or the ball, whichever is nearer."""
    ball = np.linalg.norm(points - MIDDLE, axis=1) - RADIUS
    return np.abs([points[:, 1], ball]).min(axis=0)


def test_points_lie_on_what_was_photographed(photos):
    said = []
    points = triangulated_points(photos, None, lambda stage, done, of: said.append((stage, of)))
    assert len(points) >= 100
    away = off_surface(points)
    # a pixel is 15 mm there, and rays meet at 9 to 45 degrees: a pixel's error is 2 cm of depth
    assert np.median(away) < 0.01 and np.percentile(away, 95) < 0.04
    ball = np.linalg.norm(points - MIDDLE, axis=1) < RADIUS + 0.04
    assert ball.sum() > 20 and (~ball).sum() > 20  # of both
    assert set(said) >= {("features", 6), ("matches", 15), ("triangulation", 6)}
    assert found(photos).tobytes() == points.tobytes()


def test_masks_keep_the_object_alone():
    masked = [photo_of(view, masked=True) for view in ring(6, 9.0)]
    points = found(masked)
    assert len(points) > 10
    assert (np.abs(np.linalg.norm(points - MIDDLE, axis=1) - RADIUS) < 0.05).all()


def test_what_does_not_count_gives_no_points(photos):
    half = np.ones(SIZE[::-1], np.float32)
    half[: SIZE[1] // 2] = 0  # the upper half, where the ball is
    points = found([replace(photo, weight=half) for photo in photos])
    assert len(points) > 20
    for photo in photos:
        pixel, inside = triangulation.pixel_of(photo.view, points)
        row = pixel[inside, 1]
        assert (row > SIZE[1] // 2 - 3).all()  # 2 px of reprojection error, half a feature's own


def test_two_photos_are_enough_and_one_is_not(photos):
    assert len(found(photos[:2])) > 30  # nobody else can say that they are wrong
    assert found(photos[:1]).shape == (0, 3)
    one_place = [replace(photos[0], view=photos[0].view) for _ in range(4)]
    assert found(one_place).shape == (0, 3)  # no depth without another place


def test_without_texture_the_run_starts_at_random_and_says_so(photos):
    blank = [
        replace(p, rgba=np.tile(np.array([90, 90, 90, 255], np.uint8), (*SIZE, 1)))
        for p in photos[:3]
    ]
    said: list[str] = []
    start = initial_points(CAPTURE, blank, RNG(0), report=said.append)
    assert start.origin == "random" and "only 0 points" in start.doubts[0]
    assert any("features" in words for words in said)
    with pytest.raises(BadFile, match="only 0 points could be triangulated"):
        initial_points(CAPTURE, blank, RNG(0), "triangulated")


def test_photos_that_are_all_come_before_random_places(photos):
    start = initial_points(CAPTURE, photos, RNG(0))
    assert start.origin.endswith("triangulated points and guesses") and not start.doubts
    assert len(start.guesses) and start.points.tobytes() == found(photos).tobytes()


@pytest.mark.parametrize("code, said", [(3, "is not installed"), (7, "ended with code 7")])
def test_a_process_that_fails_is_one_sentence(photos, monkeypatch, tmp_path, code, said):
    (tmp_path / "run.py").write_text(f"raise SystemExit({code})")
    monkeypatch.setattr(triangulation, "SCRIPT", tmp_path / "run.py")
    with pytest.raises(BadFile, match=said):
        initial_points(CAPTURE, photos, RNG(0), "triangulated")
    assert said in initial_points(CAPTURE, photos, RNG(0)).doubts[0]


def test_interrupted_it_ends_the_process(photos):
    def stop(stage: str, done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        triangulated_points(photos, None, stop)


def test_photos_are_matched_with_those_that_see_the_same_from_aside():
    views = ring(72, 5.0)
    pairs = choose_pairs(views)
    assert len(pairs) <= 72 * triangulation.NEIGHBOURS
    assert pairs == sorted(set(pairs)) and all(i < j for i, j in pairs)
    apart = np.array([min(j - i, 72 - (j - i)) * 5 for i, j in pairs])
    assert apart.max() <= 45  # degrees about the ball: beyond, SIFT knows nothing again
    each = np.bincount(np.ravel(pairs), minlength=72)
    assert each.min() >= triangulation.NEIGHBOURS
    few = triangulation.NEIGHBOURS + 1
    assert len(choose_pairs(views[:few])) == few * (few - 1) // 2
    assert choose_pairs(views[:1]) == choose_pairs([]) == []


def test_views_of_other_things_are_not_matched():
    """Two groups back to back: what one sees the other cannot."""
    ahead, behind = (
        [
            View(
                look_at(np.array([0.1 * i, 0, 0]), np.array([0.1 * i, 0, 9.0 * side])),
                perspective(0.75, SIZE), 0.05, 100.0, SIZE,
            )
            for i in range(8)
        ]
        for side in (-1, 1)
    )  # fmt: skip
    pairs = choose_pairs(ahead + behind)
    assert pairs and all((i < 8) == (j < 8) for i, j in pairs)


@pytest.mark.parametrize("count", [0, 1, 59, 60, 61, 500])
def test_of_many_photos_some_are_taken_evenly(count):
    view = ring(1, 1.0)[0]
    pixel = np.zeros((1, 1, 4), np.uint8)
    rgb = [LoadedPhoto(view, "RGB", pixel, None, str(i)) for i in range(count)]
    heat = [LoadedPhoto(view, "Thermal", pixel, None, "t")]
    taken = [int(photo.name) for photo in thinned(rgb + heat) if photo.modality == "RGB"]
    assert len(taken) == min(count, triangulation.MOST_PHOTOS // (1 + (count > 0)))
    steps = np.diff([*taken, count])
    assert not count or (steps.min() >= 1 and steps.max() - steps.min() <= 1)


def test_masks_give_a_hull_beside_the_points(monkeypatch):
    masked = [photo_of(view, masked=True) for view in ring(10, 36.0)[:5] + ring(6, 9.0)]
    hull = initial_points(CAPTURE, masked, RNG(0), "hull")
    few = initial_points(CAPTURE, masked, RNG(0))  # the ball alone gives 57
    assert few.origin == "hull" and "on the hull alone" in few.doubts[0]
    assert few.points.tobytes() == hull.points.tobytes()
    monkeypatch.setattr(initial, "FEWEST", 40)
    both = initial_points(CAPTURE, masked, RNG(0))
    assert both.origin.endswith("triangulated points and the hull") and not both.doubts
    assert both.guesses.tobytes() == hull.points.tobytes()
    assert both.points.tobytes() == found(masked).tobytes()
    start = first_anchors(both, 100, masked, None)
    assert len(start.anchors) == int(initial.ON_HULL * 100) + min(len(both.points), 70)


def test_a_small_budget_takes_a_cheaper_look(photos):
    """What costs no more than the share at each threshold exactly; no clock has a say in it."""
    many = photos * 12  # each look is cheaper than the one before
    costs = [cost_s(many, effort) for effort in EFFORTS]
    assert costs == sorted(costs, reverse=True) and len(set(costs)) == len(costs)
    assert choose_effort(many, None) == EFFORTS[0] == choose_effort(many, 1e9)
    assert EFFORTS[0] == triangulation.Effort(-1, triangulation.NEIGHBOURS, 120)  # as without one
    for effort, cost, less in zip(EFFORTS, costs, [*EFFORTS[1:], EFFORTS[-1]], strict=True):
        assert choose_effort(many, np.nextafter(cost / SHARE, np.inf)) == effort
        assert choose_effort(many, 0.999 * cost / SHARE) == less
    assert choose_effort(many, 0.1) == EFFORTS[-1]


def test_what_a_cheaper_look_finds_is_as_right(photos):
    """Fewer points, from photos that are not doubled, whose features are placed to a pixel, not to
    half of one: a pixel's error is 2 cm of depth."""
    seconds = 1.001 * cost_s(photos, EFFORTS[2]) / SHARE
    assert choose_effort(photos, seconds) == EFFORTS[2]
    points = triangulated_points(photos, None, lambda stage, done, of: None, seconds)
    assert 10 < len(points) < len(found(photos))
    assert np.median(off_surface(points)) < 0.02 and np.percentile(off_surface(points), 90) < 0.05
