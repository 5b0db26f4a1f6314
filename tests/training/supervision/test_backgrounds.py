"""The one colour that photos show about their subject, and where there is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.evaluation.evaluate import known_background
from shapeshift.training.photos import LoadedPhoto, load_photos
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.backgrounds import (
    DARK,
    EMPTY,
    background_warning,
    choose_background,
    has_one_exposure,
    rim_of,
    shared_color,
)
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.models import make_random_model

RNG = np.random.default_rng
SIZE = (60, 40)
VIEW = View(look_at((0, 0, 3), (0, 0, 0)), perspective(0.7, SIZE), 0.05, 100.0, SIZE)


def photo(rgb: tuple = (255, 255, 255), modality: str = "RGB", subject=(10, 30, 15, 45)):
    """A noisy subject (rows from, to, columns from, to) before an even colour."""
    rgba = np.full((SIZE[1], SIZE[0], 4), 255, np.uint8)
    rgba[..., :3] = rgb
    top, bottom, left, right = subject
    part = rgba[top:bottom, left:right, :3]
    part[:] = RNG(0).integers(0, 256, part.shape)
    return LoadedPhoto(VIEW, modality, rgba, None, "p")


def noisy(one: LoadedPhoto, levels: int) -> LoadedPhoto:
    more = RNG(1).integers(-levels, levels + 1, one.rgba.shape)
    return replace(
        one,
        rgba=np.clip(one.rgba + more, 0, 255).astype(np.uint8) | np.array([0, 0, 0, 255], np.uint8),
    )


@pytest.mark.parametrize("rgb", [(255, 255, 255), (0, 0, 0), (30, 200, 90)])
def test_a_subject_before_one_colour(rgb):
    photos = [photo(rgb), photo(rgb, "Depth"), photo(rgb, subject=(0, 30, 25, 35))]
    np.testing.assert_allclose(shared_color(photos), np.array(rgb) / 255)
    assert choose_background("auto", None, photos) == shared_color(photos)
    assert choose_background("auto", (0.5, 0, 0), photos) == (0.5, 0, 0)
    assert choose_background("random", None, photos) is None


@pytest.mark.parametrize("level", [0, round(255 * DARK) - 1, round(255 * DARK), 255])
def test_a_bright_backdrop_tells_that_all_photos_have_one_exposure(level):
    """A dark one does not: black is black at every exposure."""
    photos = [photo((level, 0, 0), subject=(0, 30, 25, 35 + i)) for i in range(3)]
    assert has_one_exposure(photos) == (level >= 255 * DARK)
    brighter = replace(photos[0], rgba=photos[0].rgba // 2)
    assert not has_one_exposure([*photos[1:], brighter])
    assert not has_one_exposure([])


def test_light_that_differs_by_up_to_six_hundredths_is_the_same_colour():
    found = shared_color([noisy(photo((128, 128, 128)), 15)] * 3)
    np.testing.assert_allclose(found, 128 / 255, atol=1.5 / 255)
    assert shared_color([noisy(photo((128, 128, 128)), 20)] * 3) is None  # (31 / 41)^3 < ALIKE


def test_what_is_no_background():
    gradient = photo()
    gradient.rgba[..., 0] = np.linspace(0, 255, SIZE[0]).astype(np.uint8)
    cut = photo(subject=(0, 40, 0, 20))
    rim = photo((0, 0, 0), subject=(2, 38, 2, 58))  # as an undistorted photo has
    masked = photo()
    masked.rgba[0, 0, 3] = 0
    for photos in ([gradient], [cut], [rim], [masked], [photo(), photo((0, 0, 0), "Depth")], []):
        assert shared_color(photos) is None
    assert 1 - 36 * 56 / 2400 < EMPTY  # of the rim, as it stands there


def test_the_rim_is_the_edge_and_each_pixel_once():
    marks = np.arange(40 * 60).reshape(40, 60, 1).repeat(3, axis=2)
    rim = rim_of(marks)[:, 0]
    assert len(np.unique(rim)) == len(rim) == 2400 - 38 * 58
    assert len(rim_of(marks[:1, :1])) == 1


def test_what_is_said_of_it():
    assert "#ff8000" in background_warning((1.0, 0.5, 0.0))
    assert "--background random" in background_warning((0.0, 0.0, 0.0))


def test_a_capture_of_which_nothing_is_known_starts_from_its_hull(tmp_path):
    """Balls on a disc before black, without points, depth, masks and a stated background."""
    known = make_balls(tmp_path, size=64, views=12, test_views=2)
    bare = replace(known, points=None, background=None)
    photos = {split: load_photos(bare, split, 1, "object") for split in ("train", "test")}
    photos = {split: [replace(p, depth=None) for p in mine] for split, mine in photos.items()}
    settings = TrainSettings(iterations=9, max_anchors=300)
    trainer = Trainer(open_device("cpu"), bare, settings, loaded=photos)
    assert trainer.origin == "hull" and trainer.schedule.background == (0.0, 0.0, 0.0)
    assert [doubt for doubt in trainer.warnings if "#000000" in doubt]
    assert trainer.model().provenance["background"] == (0.0, 0.0, 0.0)
    left_open = Trainer(
        open_device("cpu"), bare, replace(settings, background="random"), loaded=photos
    )
    # No backdrop, no hull: few points, and guesses beside them, which photos do show.
    assert left_open.origin.endswith(" triangulated points and guesses"), left_open.origin
    assert left_open.schedule.background is None


@pytest.mark.parametrize(
    "found", [None, "white", [1, 1], [0, 0, 2], [0, 0, float("nan")], [[], 1, 1]]
)
def test_a_background_in_a_package_that_is_none(found):
    model = replace(make_random_model(3), provenance={"background": found})
    bare = Capture(Path("here"), (), ())
    assert known_background(model, bare) is None
    good = replace(model, provenance={"background": [1, 0.5, 0]})
    assert known_background(good, bare) == (1.0, 0.5, 0.0)
    assert known_background(good, replace(bare, background=(0.1, 0.1, 0.1))) == (0.1, 0.1, 0.1)
