"""Gains of photos: their sums, when they count, what targets become, and what a training finds."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.losses.losses import ImageLoss
from shapeshift.training.photos import LoadedPhoto
from shapeshift.training.schedule import LIGHT_FROM
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.exposure import (
    BY_PLACE,
    FEWEST,
    FROM,
    LIKE,
    MOST,
    NOISE,
    NONE,
    NORMAL,
    Exposures,
    by_place,
    common,
    fitted_psnr,
    log_gain,
)
from shapeshift.training.supervision.targets import Targets
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.training.training_runs import run

RNG = np.random.default_rng


def photo_of(rgba: np.ndarray, weight=None, name="a", modality="RGB") -> LoadedPhoto:
    size = (rgba.shape[1], rgba.shape[0])
    view = View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, size), 0.05, 100.0, size)
    return LoadedPhoto(view, modality, rgba, weight, name)


def opaque(rgb: np.ndarray) -> np.ndarray:
    return np.concatenate([rgb, np.full_like(rgb[..., :1], 255)], axis=2)


@pytest.fixture(scope="module")
def device():
    return open_device("cpu")


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (8, 8), (9, 5), (64, 33)])
@pytest.mark.parametrize("masked", [False, True])
def test_the_gain_of_a_look_is_least_squares_over_what_counts(device, size, masked):
    """The twin: the slope through zero of photo against drawing, saturated pixels left out."""
    width, height = size
    rng = RNG(width)
    rgba = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
    image = rng.uniform(-0.2, 1.2, (3, height, width)).astype(np.float32)
    weight = rng.random((height, width)).astype(np.float32) if masked else None
    photo = photo_of(rgba, weight)
    exposures = Exposures(device, {"RGB": [photo]})
    exposures.update(photo, device.upload(image), device.upload(rgba))
    counts = rgba[..., 3] / 255 * (rgba[..., :3] < 254).all(axis=2)
    counts = counts * (1 if weight is None else weight)
    drawn, wanted = np.clip(image, 0, 1), rgba[..., :3].transpose(2, 0, 1) / 255
    product, square = ((counts * drawn * v).sum(axis=(1, 2)) for v in (wanted, drawn))
    np.testing.assert_allclose(
        exposures.log_gain[0], log_gain(product, square), rtol=1e-4, atol=1e-5
    )
    weights = counts / max(counts.sum(), 1e-9)
    a, b = (v - (weights * v).sum(axis=(1, 2), keepdims=True) for v in (drawn, wanted))
    both, ours, own = ((weights * v).sum() for v in (a * b, a * a, b * b))
    like = both * abs(both) / (ours * own) if min(ours, own) > 1e-5 else 0.0
    assert exposures.correlation[0] == pytest.approx(like, abs=1e-4)


def test_nothing_drawn_or_shown_is_no_gain():
    zero, one = np.zeros(3), np.ones(3)
    np.testing.assert_array_equal(log_gain(zero, zero), zero)
    np.testing.assert_array_equal(log_gain(zero, one), zero)
    np.testing.assert_array_equal(log_gain(one * np.nan, one), zero)
    np.testing.assert_allclose(log_gain(one * 99, one), np.log(MOST))


def known(device, logs: np.ndarray) -> tuple[Exposures, list[LoadedPhoto]]:
    rgba = opaque(np.full((4, 4, 3), 128, np.uint8))
    photos = [photo_of(rgba, name=str(i)) for i in range(len(logs))]
    exposures = Exposures(device, {"RGB": photos})
    exposures.log_gain[:], exposures.correlation[:] = logs, LIKE
    return exposures, photos


@pytest.mark.parametrize("spread", [0.0, NOISE - 1e-6, NOISE + 1e-6, 0.2])
def test_gains_count_from_the_noise_on(device, spread):
    """A share of 1 - (noise / spread)^2 of each, their median over the photos 1."""
    logs = 0.3 + spread / NORMAL * np.array([-1.0, 1] * 5)[:, None] * np.ones(3)
    exposures, photos = known(device, logs)
    gains = np.array([exposures.gain(photo) for photo in photos])
    assert exposures.alike("RGB") == (spread < NOISE)  # then light may be learned
    if spread < NOISE:
        assert (gains == 1).all() and exposures.warnings() == []
        return
    share = 1 - (NOISE / spread) ** 2
    np.testing.assert_allclose(np.log(gains), share * (logs - 0.3), atol=1e-9)
    assert f"differ in brightness by {100 * spread:.0f} %" in exposures.warnings()[0]


def test_single_photos_change_no_others(device):
    """Dark ones, or wrong poses, are what suspects are for."""
    logs = np.repeat(np.linspace(-0.02, 0.02, 20)[:, None], 3, axis=1)
    logs[:4] = -0.8
    exposures, photos = known(device, logs)
    assert all(exposures.gain(photo) == NONE for photo in photos) and exposures.warnings() == []


@pytest.mark.parametrize("count", [7, 8, 24, 72])
def test_what_places_foretell_is_a_fit_to_all_other_photos(count):
    """The twin: each photo left out in turn, and foretold by numpy's least squares."""
    rng = RNG(count)
    eyes, values = rng.normal(size=(count, 3)) + 5, rng.normal(size=(count, 3))
    values += (eyes[:, :1] - 4) ** 2 / 2
    terms = np.column_stack([np.ones(count), eyes, (eyes**2).sum(axis=1)])
    left = np.empty_like(values)
    for row in range(count):
        others = np.arange(count) != row
        fit = np.linalg.lstsq(terms[others], values[others], rcond=None)[0]
        left[row] = values[row] - terms[row] @ fit
    want = 1 - (left**2).sum() / ((values - values.mean(axis=0)) ** 2).sum()
    assert by_place(values, eyes) == pytest.approx(want, rel=1e-6)


def test_places_that_are_one_or_gains_that_are_one_foretell_nothing():
    assert by_place(np.ones((9, 3)), RNG(0).normal(size=(9, 3))) == 0
    assert by_place(RNG(0).normal(size=(9, 3)), np.ones((9, 3))) < 0
    assert by_place(np.zeros((1, 3)), np.zeros((1, 3))) == 0


@pytest.mark.parametrize("count", [24, 72])
def test_gains_that_follow_the_cameras_channel_by_channel_are_no_exposure(device, count):
    """Each channel's with the distance to another point, as of normal maps: its own side.

    The same gains in any other order are a camera's (at most one in a hundred not), and so are
    gains that follow the cameras alike in all channels: photos of a thing by a window.
    """
    rng, points = RNG(count), 0.3 * np.eye(3)
    eyes = rng.normal(size=(count, 3))
    eyes *= rng.uniform(1.2, 2, (count, 1)) / np.linalg.norm(eyes, axis=1, keepdims=True)
    away = np.linalg.norm(eyes[:, None] - points, axis=2)
    away /= away.mean(axis=1, keepdims=True)
    logs = -0.8 * np.log(away) + rng.normal(scale=0.01, size=(count, 3))
    logs[: count // 50] = -1.0  # a dark photo of 72 changes nothing of it
    exposures, photos = known(device, logs)
    exposures.eyes[:] = eyes
    assert all(exposures.gain(photo) == NONE for photo in photos) and exposures.warnings() == []
    chance = [by_place(rng.permutation(logs), eyes) for _ in range(200)]
    assert np.mean(np.array(chance) > BY_PLACE) <= 0.01
    exposures.log_gain[:] = logs[:, :1]
    assert exposures.gain(photos[-1]) != NONE and exposures.warnings()
    exposures.log_gain[:], exposures.eyes[:] = logs, rng.permutation(eyes)
    assert exposures.gain(photos[-1]) != NONE and exposures.warnings()


@pytest.mark.parametrize(("values", "share"), [
    (np.zeros((4, 3)), 1.0),
    (np.arange(4.0)[:, None] * np.ones(3), 1.0),
    (np.array([[1.0, -1, 0], [-1, 1, 0]]), 0.0),
    (np.array([[1.0, 0, 0], [-1, 0, 0]]), 1 / 3),
])  # fmt: skip
def test_what_channels_have_in_common(values, share):
    assert common(values) == pytest.approx(share, abs=1e-12)


@pytest.mark.parametrize(("sign", "like"), [(1, 1.0), (-1, -1.0), (0, 0.0)])
def test_likeness_has_a_sign_and_knows_no_gain(device, sign, like):
    """Half as bright is as like; a negative is not like; a sheet of one colour is like nothing."""
    rgb = RNG(1).integers(20, 230, (6, 9, 3)).astype(np.uint8)
    photo = photo_of(opaque(rgb))
    image = 0.5 + sign * 0.5 * (rgb.transpose(2, 0, 1) / np.float32(255) - 0.5)
    exposures = Exposures(device, {"RGB": [photo]})
    exposures.update(photo, device.upload(image.astype(np.float32)), device.upload(photo.rgba))
    assert exposures.correlation[0] == pytest.approx(like, abs=1e-4)


@pytest.mark.parametrize(("like", "counts"), [(LIKE, True), (LIKE - 1e-9, False), (-1.0, False)])
def test_a_model_that_does_not_show_the_photos_says_nothing_of_them(device, like, counts):
    logs = 0.2 * np.array([-1.0, 1] * 5)[:, None] * np.ones(3)
    exposures, photos = known(device, logs)
    exposures.correlation[4:] = like  # the median of ten, four of which are at the bound
    assert (exposures.gain(photos[0]) != NONE) == counts == bool(exposures.warnings())
    assert not exposures.alike("RGB"), "they differ, or nobody knows"
    exposures.light_stands = True
    assert exposures.light_rests("RGB", 1.0) == counts


def test_photos_of_one_exposure_are_not_looked_at(device):
    """However far the run is: what the model shows wrongly must not become a gain."""
    photos = {"RGB": [photo_of(opaque(np.full((4, 4, 3), 128, np.uint8)))]}
    assert Exposures(device, photos).has_begun(FROM, 0)
    assert not Exposures(device, photos, one_exposure=True).has_begun(1.0, 1 << 30)
    many = {"RGB": [photo_of(photos["RGB"][0].rgba, name=str(i)) for i in range(FEWEST)]}
    assert Exposures(device, many, one_exposure=True).alike("RGB")
    assert not Exposures(device, many).alike("RGB"), "not looked at yet"
    fresh = Exposures(device, many, one_exposure=True)
    assert fresh.light_rests("RGB", np.nextafter(LIGHT_FROM, 0)), "too early"
    assert not fresh.light_rests("RGB", LIGHT_FROM)
    goes_on = Exposures(device, many)
    assert goes_on.light_rests("RGB", 1.0), "nobody knows"
    goes_on.light_stands = True  # learned before
    assert not goes_on.light_rests("RGB", 0.0)
    assert Exposures(device, {"RGB": many["RGB"][1:]}).alike("RGB"), "too few to tell"


def test_few_or_unknown_photos_are_left_as_they_are(device):
    logs = np.array([-0.5, 0.5] * FEWEST)[:FEWEST, None] * np.ones(3)
    exposures, photos = known(device, logs)
    assert exposures.gain(photos[0]) != NONE
    exposures.log_gain[2] = np.nan
    assert exposures.gain(photos[0]) == exposures.gain(photos[2]) == NONE  # five are known
    again, _ = known(device, logs)
    again.load(exposures.state())
    np.testing.assert_array_equal(again.log_gain, exposures.log_gain)
    again.load({})  # of a run before there were any
    other, _ = known(device, np.zeros((2, 3)))
    again.load(other.state())
    np.testing.assert_array_equal(again.log_gain, exposures.log_gain)
    assert again.begin == FROM
    again.reset(0.25, 100)
    assert np.isnan(again.log_gain).all() and again.begin == 0.25 + FROM
    last, _ = known(device, logs)
    last.load(again.state())
    assert last.begin == again.begin and np.isnan(last.log_gain).all()


@pytest.mark.parametrize("form", ["cpu", "gpu"])
def test_targets_are_photos_over_their_gain(device, form):
    rgba, behind, gain = RNG(0).integers(0, 256, (5, 11, 4)), (0.1, 0.5, 0.9), (0.5, 1.0, 2.0)
    rgba = rgba.astype(np.uint8)
    target = ImageLoss(device, (11, 5), form).target(device.upload(rgba), behind, None, gain)
    alpha = rgba[..., 3:] / 255
    want = alpha * (rgba[..., :3] / 255 / gain) + (1 - alpha) * behind
    got = device.download(target.planes)[..., :11].transpose(1, 2, 0)
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_only_targets_without_a_gain_are_kept(device):
    exposures, photos = known(device, np.array([-0.5, 0.5] * 5)[:, None] * np.ones(3))
    targets, image = Targets(device), device.upload(np.full((3, 4, 4), 0.5, np.float32))
    plain = targets.target(photos[0], (0.0, 0.0, 0.0))
    assert targets.target(photos[0], (0.0, 0.0, 0.0)) is plain
    evened = targets.target(photos[1], (0.0, 0.0, 0.0), exposures, image)
    assert evened is not plain and len(targets.kept) == 1
    gain = exposures.gain(photos[1])[0]
    np.testing.assert_allclose(device.download(evened.planes)[0, 0, 0], 128 / 255 / gain, rtol=1e-5)


def test_a_held_out_photo_is_scored_where_its_colours_were_not_fitted():
    rng = RNG(0)
    image = rng.uniform(0.1, 0.9, (20, 30, 3))
    darker = np.rint(255 * image * (0.5, 0.7, 0.9)).astype(np.uint8)
    photo = photo_of(opaque(darker))
    assert fitted_psnr(image, photo, darker / 255) > 50  # bytes are all that is left
    spoiled = darker.copy()
    spoiled[:, :15] = rng.integers(0, 200, (20, 15, 3))  # another left half: colours do not fit
    assert fitted_psnr(image, photo_of(opaque(spoiled)), spoiled / 255) < 25
    weight = np.ones((20, 30), np.float32)
    weight[:, 15:] = 0  # nothing counts on the right: all of it is scored as it is
    masked = photo_of(opaque(darker), weight)
    assert 5 < fitted_psnr(image, masked, darker / 255) < 20
    narrow = photo_of(opaque(darker[:, :1]))
    assert 5 < fitted_psnr(image[:, :1], narrow, darker[:, :1] / 255) < 20


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return make_balls(tmp_path_factory.mktemp("balls"), 64, 24, 4)


def uneven(capture, folder, gains: np.ndarray):
    """The capture with its training photos of RGB at other brightness."""
    photos, each = [], iter(gains)
    for number, photo in enumerate(capture.photos):
        if (photo.modality, photo.split) == ("RGB", "train"):
            pixels = np.clip(np.rint(next(each) * load_photo(photo).rgb), 0, 255).astype(np.uint8)
            path = folder / f"{number}.png"
            Image.fromarray(pixels).save(path)
            photo = replace(photo, path=path)
        else:
            photo = replace(photo, path=folder / photo.path.relative_to(capture.folder))
        photos.append(photo)
    capture = replace(capture, folder=folder, photos=tuple(photos))
    write_capture(capture)
    return read_capture(folder)


@pytest.mark.slow
def test_a_training_finds_the_brightness_of_its_photos(device, balls, tmp_path):
    """Planted gains of a tenth come back to a third of that; even heat stays as it is."""
    for name in ("rgb", "thermal"):
        (tmp_path / name).symlink_to(balls.folder / name)
    planted = np.exp(RNG(1).normal(size=24) / 6)  # of these 24 a standard deviation of 0.103
    capture = uneven(balls, tmp_path, planted)
    settings = TrainSettings(iterations=500, max_anchors=1200)
    trainer = run(Trainer(device, capture, settings))
    photos = trainer.schedule.photos
    names = [int(photo.name.rpartition("/")[2].removesuffix(".png")) for photo in photos["RGB"]]
    want = np.log(planted[np.argsort(np.argsort(names))])
    got = trainer.exposures.log_gain[trainer.exposures.rows["RGB"]].mean(axis=1)
    away = (got - got.mean()) - (want - want.mean())
    assert np.std(away) < np.std(want) / 2.5, np.round(away, 3)
    assert trainer.exposures.spread("Thermal") < NOISE
    (remark,) = trainer.exposures.warnings()
    assert remark.startswith("RGB: its photos differ in brightness by")
