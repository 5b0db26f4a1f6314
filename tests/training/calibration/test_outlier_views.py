"""Photos with wrong poses or another exposure are named; good ones are not."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.pose import Pose
from shapeshift.training.calibration.extrinsics import moved_by, offset_view
from shapeshift.training.calibration.outlier_views import (
    LEAST_DB,
    drawn,
    find_outlier_views,
    judge,
    recolored,
    report,
)
from shapeshift.training.settings import TrainSettings
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    folder = tmp_path_factory.mktemp("balls")
    make_balls(folder, size=64, views=20, test_views=1)
    return read_capture(folder)


def found_in(capture) -> list:
    trainer = Trainer(open_device("cpu"), capture, TrainSettings(iterations=400, max_anchors=2500))
    for _ in trainer.steps():
        pass
    return find_outlier_views(trainer)


@pytest.mark.slow
def test_no_good_photo_is_named(balls):
    assert found_in(balls) == []


@pytest.mark.slow
def test_wrong_poses_and_another_exposure_are_named(balls, tmp_path):
    photos = list(balls.photos)
    wrong = {3, 11}  # two of twenty poses of RGB: 8 degrees beside
    turn = moved_by(np.array([0.0, np.deg2rad(8), 0, 0, 0, 0]))
    for at in wrong:
        photos[at] = replace(photos[at], view=offset_view(photos[at].view, turn))
    dark = np.asarray(Image.open(photos[7].path).convert("RGB")) * 0.45
    Image.fromarray(dark.astype(np.uint8)).save(tmp_path / "dark.png")
    photos[7] = replace(photos[7], path=tmp_path / "dark.png")
    assert all(isinstance(photos[at].view.world_from_eye, Pose) for at in wrong)
    found = found_in(replace(balls, photos=tuple(photos)))
    by_name = {outlier.name: outlier for outlier in found}
    assert set(by_name) == {str(photos[at].path) for at in (*wrong, 7)}
    assert by_name[str(photos[7].path)].exposure
    assert not any(by_name[str(photos[at].path)].exposure for at in wrong)
    # Two poses that are equally wrong: chance decides which fits worse, so the order is that of
    # the decibels, and the photo that another exposure explains is never the worst.
    fits = [outlier.psnr_db for outlier in found]
    assert fits == sorted(fits) and not found[0].exposure
    for outlier, line in zip(found, report(found), strict=True):
        assert outlier.name in line
        assert outlier.psnr_db < outlier.median_db - LEAST_DB


@pytest.mark.parametrize(("background", "shown"), [("random", 0.5), ("black", 0.0), ("white", 1.0)])
def test_model_and_photo_are_compared_over_one_background(balls, background, shown):
    """Mid grey where training draws a random one: it favours neither bright nor dark edges.

    A photo without anything in it, of a camera that sees nothing of the scene, is just that.
    """
    settings = TrainSettings(iterations=1, max_anchors=20, background=background)
    trainer = Trainer(open_device("cpu"), balls, settings)
    photo = trainer.schedule.photos["RGB"][0]
    eye = photo.view.world_from_eye
    away = moved_by(np.array([0.0, np.pi, 0, 0, 0, 0]))
    empty = replace(
        photo, view=offset_view(photo.view, away), rgba=np.zeros_like(photo.rgba), weight=None
    )
    assert -eye.matrix()[:3, 2] @ -empty.view.world_from_eye.matrix()[:3, 2] < -0.99
    image, wanted = drawn(trainer, empty)
    assert np.array_equal(image, np.full((64, 64, 3), shown, np.float32))
    assert np.array_equal(wanted, image)


def test_few_photos_and_even_spreads_name_none(balls):
    assert judge("RGB", [None] * 4, [(30, 30), (30, 30), (30, 30), (5, 5)]) == []
    even = np.linspace(20, 30, 11)
    assert judge("RGB", [None] * 11, [(v, v) for v in even]) == []


def test_recoloring_undoes_an_exposure_and_nothing_else():
    random = np.random.default_rng(0)
    photo = random.uniform(0, 1, (9, 8, 3))
    np.testing.assert_allclose(recolored(0.5 * photo + 0.1, photo, None), photo, atol=1e-9)
    other = random.uniform(0, 1, (9, 8, 3))
    assert np.abs(recolored(other, photo, None) - photo).mean() > 0.1
    weight = np.zeros((9, 8))
    weight[:4] = 1
    spoilt = 0.5 * photo
    spoilt[4:] = 0.9
    again = recolored(spoilt, photo, weight)
    np.testing.assert_allclose(again[:4], photo[:4], atol=1e-9)
