"""The parts of training that are plain numpy: first points, photos, growing, schedule, Adam."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile, Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.first_anchors.hull import (
    choose_voxel,
    median_neighbour,
    voxel_centres,
)
from shapeshift.training.first_anchors.initial import (
    filler_points,
    initial_points,
)
from shapeshift.training.first_anchors.views import pixel_of
from shapeshift.training.heads.networks import HeadLayout
from shapeshift.training.heads.optimizer import Adam
from shapeshift.training.photos import LoadedPhoto, choose_downscale, load_photos
from shapeshift.training.schedule import Budget, Schedule
from shapeshift.training.settings import (
    LONG,
    ONE_MODALITY,
    SHORT,
    TrainSettings,
    adjusted,
    suited,
)
from shapeshift.training.step import DivergenceGuard
from shapeshift.training.supervision.backgrounds import choose_background

RNG = np.random.default_rng


def test_voxel_centres_are_unique_and_near():
    points = RNG(0).uniform(-1, 1, (5000, 3))
    centres = voxel_centres(points, 0.2)
    assert len(np.unique(centres, axis=0)) == len(centres)
    distance = np.abs(points[:, None] - centres[None]).max(axis=2).min(axis=1)
    assert distance.max() <= 0.1 + 1e-6


@pytest.mark.parametrize("most", [10, 300, 4000])
def test_the_voxel_gives_about_as_many_anchors_as_wanted(most):
    points = RNG(0).uniform(-1, 1, (5000, 3))
    found = len(voxel_centres(points, choose_voxel(points, most, RNG(1))))
    assert 0.8 * most <= found <= most


def test_median_neighbour_of_a_grid_is_its_spacing():
    axis = np.arange(10) * 0.3
    grid = np.stack(np.meshgrid(axis, axis, axis), -1).reshape(-1, 3)
    assert median_neighbour(grid, RNG(0)) == pytest.approx(0.3)


def sphere_photos(background, alpha: bool) -> list[LoadedPhoto]:
    """Twelve pictures of a ball of radius 0.5 at the origin, seen from 3 m."""
    size, photos = (64, 64), []
    for turn in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        eye = 3 * np.array([np.cos(turn), 0.6 * np.sin(2 * turn), np.sin(turn)])
        view = View(look_at(eye, np.zeros(3)), perspective(0.7, size), 0.05, 100.0, size)
        axis = (np.arange(64) + 0.5) / 32 - 1
        tangent = np.hypot(*np.meshgrid(axis, axis)) * np.tan(0.35)
        inside = tangent < np.tan(np.arcsin(0.5 / np.linalg.norm(eye)))
        rgba = np.zeros((64, 64, 4), np.uint8)
        rgba[..., :3] = np.where(inside[..., None], (200, 80, 20), np.array(background) * 255)
        rgba[..., 3] = np.where(inside, 255, 0) if alpha else 255
        photos.append(LoadedPhoto(view, "RGB", rgba, None, f"{turn:.2f}"))
    return photos


@pytest.mark.parametrize("alpha", [True, False])
def test_the_visual_hull_of_a_ball_is_nearly_a_ball(tmp_path, alpha):
    capture = Capture(tmp_path, (Stop("RGB", 0.0),), (), background=(1.0, 1.0, 1.0))
    points, origin, *_ = initial_points(capture, sphere_photos((1, 1, 1), alpha), RNG(0))
    radius = np.linalg.norm(points, axis=1)
    assert origin == "hull" and len(points) > 500
    assert 0.44 < np.percentile(radius, 5) and np.percentile(radius, 95) < 0.62


def test_photos_that_tell_nothing_give_random_points_where_cameras_look(tmp_path):
    capture = Capture(tmp_path, (Stop("RGB", 0.0),), ())
    points, origin, *_ = initial_points(capture, sphere_photos((1, 1, 1), False), RNG(0))
    assert origin == "random" and len(points) > 1000
    assert np.abs(points).max() < 4 and np.abs(np.median(points, axis=0)).max() < 0.2


def test_masks_without_a_common_volume_are_refused(tmp_path):
    photos = sphere_photos((0, 0, 0), True)
    for photo in photos:
        photo.rgba[..., 3] = 0
    with pytest.raises(BadFile, match="no volume in common"):
        initial_points(Capture(tmp_path, (), ()), photos, RNG(0))


def capture_of(tmp_path, image: np.ndarray, mask: np.ndarray | None = None) -> Capture:
    """One photo, its file of `image` (H, W, 3 or 4) uint8."""
    size = (image.shape[1], image.shape[0])
    Image.fromarray(image).save(tmp_path / "a.png")
    if mask is not None:
        Image.fromarray(mask).save(tmp_path / "m.png")
    view = View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, size), 0.05, 100.0, size)
    place = tmp_path / "m.png" if mask is not None else None
    photo = Photo(view, tmp_path / "a.png", "RGB", place)
    return Capture(tmp_path, (Stop("RGB", 0.0),), (photo,))


def test_photos_are_made_smaller_with_their_view(tmp_path):
    image = RNG(0).integers(0, 256, (9, 13, 3)).astype(np.uint8)
    capture = capture_of(tmp_path, image)
    small = load_photos(capture, "train", 3, "object")[0]
    assert small.view.size == (4, 3) and small.rgba.shape == (3, 4, 4)
    left, right, down, up = capture.photos[0].view.tangents
    np.testing.assert_allclose(
        small.view.tangents, (left, left + (right - left) * 12 / 13, down, up)
    )
    whole = load_photos(capture, "train", 1, "object")[0]
    np.testing.assert_array_equal(whole.rgba[..., :3], image)
    assert not whole.see_through


def test_large_photos_are_halved_by_default(tmp_path):
    for side, factor in ((640, 1), (641, 2), (1280, 2), (1281, 3)):
        capture = capture_of(tmp_path, np.zeros((5, side, 3), np.uint8))
        assert choose_downscale(capture.photos) == factor


@pytest.mark.parametrize("masks", ["object", "valid", "ignore"])
def test_what_masks_mean(tmp_path, masks):
    image = RNG(0).integers(1, 256, (8, 8, 3)).astype(np.uint8)
    mask = np.zeros((8, 8), np.uint8)
    mask[2:6, 2:6] = 255
    photo = load_photos(capture_of(tmp_path, image, mask), "train", 1, masks)[0]
    np.testing.assert_array_equal(photo.rgba[..., :3], image)
    if masks == "object":
        np.testing.assert_array_equal(photo.rgba[..., 3], mask)
    assert (photo.weight is not None) == (masks == "valid")
    if masks == "valid":
        np.testing.assert_array_equal(photo.weight, mask / 255)


def test_alpha_is_taken_from_the_file(tmp_path):
    image = RNG(0).integers(100, 256, (6, 6, 4)).astype(np.uint8)
    photo = load_photos(capture_of(tmp_path, image), "train", 1, "object")[0]
    assert np.abs(photo.rgba.astype(int) - image).max() <= 1


def schedule(count: int, names=("RGB", "Thermal")) -> Schedule:
    photos = sphere_photos((1, 1, 1), True)[:count]
    return Schedule({name: photos for name in names}, seed=3, background=None)


def test_every_photo_comes_once_an_epoch_and_modalities_take_turns():
    plan = schedule(5)
    for epoch in range(3):
        for which in range(2):
            steps = range(epoch * 10 + which, epoch * 10 + 10, 2)
            names = [plan.photo(i).name for i in steps]
            assert sorted(names) == sorted(p.name for p in plan.photos["RGB"])
    orders = [[plan.photo(i).name for i in range(e * 10, e * 10 + 10)] for e in range(3)]
    assert orders[0] != orders[1]


def test_random_backgrounds_only_where_they_show():
    plan = schedule(2)
    photo = plan.photo(0)
    first, second = plan.background_of(0, photo), plan.background_of(1, photo)
    assert first != second and first == plan.background_of(0, photo)
    photo.rgba[..., 3] = 255
    assert plan.background_of(0, photo) == (0, 0, 0)
    assert choose_background("auto", (1, 1, 1)) == (1, 1, 1)
    assert choose_background("random", (1, 1, 1)) is None
    with pytest.raises(ValueError, match="no background 'pink'"):
        choose_background("pink", None)


def test_budget_follows_whichever_ends_first():
    assert Budget(100, None).fraction(25, 1e9) == 0.25
    assert Budget(None, 20.0).fraction(10**9, 5.0) == 0.25
    assert Budget(100, 20.0).fraction(10, 15.0) == 0.75


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"iterations": None}, "needs an end"), ({"iterations": 0}, "iterations is 0"),
        ({"seconds": float("nan")}, "seconds is nan"), ({"blended_shapes": 1.1}, "0 to 1"),
        ({"blended_shapes": -0.1}, "blended_shapes is -0.1"), ({"seed": -1}, "seed"),
        ({"hidden": -3}, "at least 1"), ({"anchor_attributes": "size"}, "no attribute 'size'"),
        ({"depth_share": float("inf")}, "depth_share is inf"),
        ({"seconds": "10"}, "seconds is '10'; a number"), ({"max_anchors": None}, "a number"),
        ({"iterations": 1.5}, "iterations is 1.5; a whole number"), ({"downscale": 2.5}, "whole"),
        ({"masks": "x"}, "masks is 'x'; choose auto, object, valid, ignore"),
        ({"poses": ""}, "choose stated, refine"), ({"background": "pink"}, "auto, random, black"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_refused(changes, sentence):
    with pytest.raises(ValueError, match=sentence):
        TrainSettings(**changes)


def test_settings_name_the_networks():
    settings = TrainSettings(fixed="scale, offset", view_dependent=False)
    assert settings.layout(7) == HeadLayout(5, 16, 32, 7, ("scale", "offset"), False)
    assert TrainSettings(anchor_attributes="").layout(2).per_anchor == ("anchors", "features")
    assert TrainSettings(**settings.as_dict()) == settings
    assert TrainSettings().layout(16) == HeadLayout(5)
    with pytest.raises(ValueError, match="no head 'shape' to fix; they are offset"):
        TrainSettings(fixed="shape")


def a_view(size: tuple[int, int] = (4, 4)) -> View:
    return View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, size), 0.05, 9.0, size)


@pytest.mark.parametrize(
    ("asked", "stops", "photos", "own"),
    [
        ((), 1, 16, True),
        ((), 1, 15, False),
        ((), 1, 500, True),
        (("iterations", "points", "seed", "features", "downscale"), 1, 16, True),
        *(((name,), 1, 60, False) for name in (*ONE_MODALITY, "max_mb")),
    ],
)
def test_a_scene_that_never_changes_has_more_anchors_with_light(asked, stops, photos, own):
    """Unless there are few training photos, or somebody says how many or of what kind; nothing else
    differs.
    """
    view = a_view()
    splits = ["train"] * photos + ["test"] * 20
    taken = tuple(Photo(view, Path(f"{i}.png"), "0", split=s) for i, s in enumerate(splits))
    capture = Capture(Path(), tuple(Stop(str(i), 0.1 * i) for i in range(stops)), taken)
    settings = TrainSettings(seed=7, iterations=300)
    found = suited(settings, asked, capture)
    if not own:
        assert found == settings
        return
    assert found == replace(settings, **ONE_MODALITY)
    assert found.max_anchors * found.splats_per_anchor == 60000  # as many splats as without
    assert found.layout(2).per_anchor[-1] == "light"


@pytest.mark.parametrize(
    ("asked", "stops", "counted"),
    [((), 1, False), ((), 2, True), (("seed", "seconds"), 7, True)]
    + [((name,), 3, False) for name in (*ONE_MODALITY, "max_mb")],
)
def test_anchors_of_several_modalities_are_counted_for_each_shape(asked, stops, counted):
    """Unless somebody says how many there may be, or of what kind; nothing else differs."""
    taken = tuple(Photo(a_view((640, 480)), Path(f"{i}.png"), "0", split="train") for i in range(9))
    capture = Capture(Path(), tuple(Stop(str(i), 0.1 * i) for i in range(stops)), taken)
    settings = TrainSettings(seed=7)
    assert suited(settings, asked, capture) == replace(settings, max_by_shape=counted)


@pytest.mark.parametrize(
    ("sizes", "downscale", "asked", "splats"),
    [
        ([(300, 200)], None, (), 5), ([(599, 100)], None, (), 4), ([(200, 200)], None, (), 3),
        ([(192, 144)], None, (), 2), ([(1, 1)], None, (), 2), ([(4096, 4096)], None, (), 5),
        ([(192, 144), (300, 200)], None, (), 5),  # the largest counts
        ([(600, 400)], 2, (), 5), ([(600, 400)], 3, (), 2),
        ([(1200, 100)], None, (), 2),  # halved by itself: 600x50
        *(([(192, 144)], None, (name,), 5) for name in (*ONE_MODALITY, "max_mb")),
    ],
)  # fmt: skip
def test_small_photos_of_several_modalities_have_no_more_splats_than_pixels(
    sizes, downscale, asked, splats
):
    taken = tuple(Photo(a_view(s), Path(f"{s[0]}.png"), "0", split="train") for s in sizes)
    capture = Capture(Path(), (Stop("0", 0.0), Stop("1", 1.0)), taken)
    settings = TrainSettings(seed=7, downscale=downscale)
    found = suited(settings, asked, capture)
    assert found == replace(settings, max_by_shape=not asked, splats_per_anchor=splats)
    pixels = max(w * h for w, h in sizes) / (downscale or 1) ** 2
    if splats > 2 and not asked:  # 2 at least
        assert found.max_anchors * splats <= pixels


def test_no_photos_ask_for_no_fewer_splats():
    """A capture that training refuses later, by name."""
    nothing = Capture(Path(), (Stop("0", 0.0), Stop("1", 1.0)), ())
    assert suited(TrainSettings(), (), nothing).splats_per_anchor == 5


def test_rates_decay_further_in_long_runs():
    assert TrainSettings().rates(4000) is SHORT and TrainSettings().rates(4001) is LONG


def test_a_budget_of_one_kind_takes_the_place_of_the_other():
    timed = adjusted(TrainSettings(), {"seconds": 5.0})
    assert (timed.seconds, timed.iterations) == (5.0, None)
    assert adjusted(timed, {"iterations": 9}) == TrainSettings(iterations=9)
    both = adjusted(TrainSettings(), {"iterations": 9, "seconds": 5.0})
    assert (both.seconds, both.iterations) == (5.0, 9)
    assert adjusted(timed, {"seed": 2}).seconds == 5.0


def test_the_guard_goes_further_back_each_time():
    guard = DivergenceGuard({"a": np.array(0)})
    for i in range(1, 6):
        guard.save_snapshot({"a": np.array(i)})
    assert [int(guard.rollback()["a"]) for _ in range(4)] == [5, 4, 3, 3]


@pytest.mark.parametrize(
    ("visible", "shown", "healthy"),
    [
        (0.5, 1.0, True), (0.0, 1.0, False), (0.009, 1.0, False), (0.011, 1.0, True),
        (0.5, 0.29, False), (0.5, 0.31, True), (0.5, np.nan, False), (np.nan, 1.0, False),
    ],
)  # fmt: skip
def test_what_the_guard_calls_healthy(visible, shown, healthy):
    guard = DivergenceGuard({})
    guard.observe("RGB", 0.5, 1.0, 1.2)
    looks = [guard.is_healthy("RGB", 0.1, visible, shown) for _ in range(4)]
    assert looks == ([True] * 4 if healthy else [True, True, False, False])
    assert guard.stable == healthy
    guard.rollback()
    assert guard.is_healthy("RGB", 0.1, visible, shown)
    for loss in (np.nan, np.inf, -np.inf):
        assert not DivergenceGuard({}).is_healthy("RGB", loss, 0.5, 1.0)


@pytest.mark.parametrize(("loss", "healthy"), [(0.29, True), (0.31, False), (np.nan, False)])
def test_after_falling_back_the_loss_has_to_fall(loss, healthy):
    guard = DivergenceGuard({})
    guard.observe("RGB", 0.5, 1.0, 1.0)
    assert all(guard.is_healthy("RGB", 0.6, 1.0, 1.0) for _ in range(50))  # never fell: no demands
    guard.rollback()
    looks = [guard.is_healthy("RGB", loss, 1.0, 1.0) for _ in range(8)]
    assert looks[-1] == healthy


def test_adam_equals_its_definition():
    device = open_device("cpu")
    rng = RNG(0)
    start = {n: rng.normal(size=(7, 3)) for n in ("a", "light")} | {"b": rng.normal(size=70)}
    start = {n: v.astype(np.float32) for n, v in start.items()}
    rates = {"a": np.array([0.01]), "b": rng.random(70), "light": np.array([0.02])}
    adam = Adam(device, start, rates)
    value = {n: v.astype(np.float64) for n, v in start.items()}
    mean, square = ({n: np.zeros_like(v) for n, v in value.items()} for _ in range(2))
    for t in range(1, 20):
        grads = {n: rng.normal(size=v.shape).astype(np.float32) for n, v in start.items()}
        if t == 5:
            grads["a"][:] = 0  # a gradient of nothing must not divide by zero
            grads["light"][3:] = 0  # nor pulls it
        adam.step({n: device.upload(g) for n, g in grads.items()}, 0.5)
        for n, g in grads.items():
            mean[n] = 0.9 * mean[n] + 0.1 * g
            square[n] = 0.999 * square[n] + 0.001 * g.astype(np.float64) ** 2
            root = np.sqrt(square[n] / (1 - 0.999**t)) + 1e-15
            pull = 0.25 * value[n] * (g != 0) if n == "light" else 0  # AdamW: not over the root
            value[n] -= 0.5 * rates[n] * (mean[n] / (1 - 0.9**t) / root + pull)
    for n in value:
        np.testing.assert_allclose(device.download(adam[n]), value[n], atol=1e-5)
    copy = Adam(device, start, rates)
    copy.load(adam.state())
    for name, array in adam.state().items():
        np.testing.assert_array_equal(copy.state()[name], array)


def test_guesses_stand_where_photos_have_no_points(tmp_path):
    photos = sphere_photos((1, 1, 1), False)[:1]
    view = photos[0].view
    world_from_eye = view.world_from_eye.matrix()
    across = np.stack(np.meshgrid(np.linspace(-0.36, 0, 40), np.linspace(-0.36, 0.36, 80)), -1)
    eye = np.concatenate([across, np.full((80, 40, 1), -1.0), np.full((80, 40, 1), 0.5)], axis=2)
    points = (eye.reshape(-1, 4) * [2, 2, 2, 2] @ world_from_eye.T)[:, :3]  # 2 m away, left half
    guesses = filler_points(points, photos, RNG(0))
    pixel, inside = pixel_of(view, guesses)
    assert inside.all() and (pixel[:, 0] > 32).all() and len(guesses) >= 16 * 7
    distance = (guesses - view.world_from_eye.position) @ -world_from_eye[:3, 2]
    assert (distance >= 1.99).all() and (distance <= 2.61).all()
    known = Capture(tmp_path, (), (), points=points, background=(0.0, 0.0, 0.0))
    assert initial_points(known, photos, RNG(0))[1] == "points"
    unknown = Capture(tmp_path, (), (), points=points)
    assert initial_points(unknown, photos, RNG(0))[1] == "points and guesses"
