"""What stands still behind a turntable: found, said, and cut out as docs/training.md says."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.photos import LoadedPhoto, load_photos
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.backgrounds import (
    BACKDROP,
    STILL_PHOTOS,
    shared_color,
    still_share,
    still_warnings,
)
from shapeshift.training.synthetic.strangers import KINDS, make_stranger, mask_of
from shapeshift.training.train import Trainer

RNG = np.random.default_rng
SIZE = (48, 40)
DOCS = Path(__file__).resolve().parents[3] / "docs" / "training.md"


def turning(count: int = STILL_PHOTOS, rows: int = 20, kind: str = "turntable"):
    """Photos of noise, whose upper `rows` of 40 are one noisy picture in all of them."""
    rng = RNG(0)
    wall, out = rng.integers(0, 256, (40, 48, 4), np.uint8), []
    for i, view in enumerate(KINDS[kind].views(count, SIZE)):
        rgba = rng.integers(0, 256, (40, 48, 4), np.uint8)
        rgba[:rows] = wall[:rows]
        rgba[..., 3] = 255
        out.append(LoadedPhoto(view, "RGB", rgba, None, f"{i}"))
    return out


def test_the_share_is_that_of_the_pixels_that_stand_still():
    assert still_share(turning()) == 0.5
    assert still_share(turning(rows=40)) == 1.0
    assert still_share(turning(rows=8)) == pytest.approx(0.2), "a fifth is enough"
    assert still_share(turning(rows=7)) == 0.0
    assert still_share([]) == 0.0


@pytest.mark.parametrize("others, found", [(0, 0.5), (2, 0.5), (3, 0.0)])
def test_nine_tenths_of_the_photos_must_agree(others, found):
    photos = turning()
    for photo in photos[:others]:
        photo.rgba[..., :3] = RNG(1).integers(0, 256, (40, 48, 3), np.uint8)
    assert still_share(photos) == pytest.approx(found, abs=0.01)  # noise agrees by chance


def test_colours_that_differ_by_noise_agree_and_by_more_do_not():
    for step, found in ((int(255 * BACKDROP), 0.5), (int(255 * BACKDROP) + 2, 0.0)):
        photos = turning()
        for i, photo in enumerate(photos):
            photo.rgba[:20, :, :3] = photo.rgba[:20, :, :3] // 2 + 60
            if i % 3 == 0:  # the median is that of the others
                photo.rgba[:20, :, :3] += np.uint8(step)
        assert still_share(photos) == found


def test_what_is_no_turntable_is_none():
    photos = turning()
    assert still_share(turning(7)) == 0.0, "seven may be alike by chance"
    assert still_share(turning(8)) == 0.5
    still = [replace(photo, view=photos[0].view) for photo in photos]
    assert still_share(still) == 0.0, "a camera that stands still may see what stands still"
    for photo in photos:
        photo.rgba[:20, :, :3] = (90, 130, 220)
    assert still_share(photos) == 0.0, "an even sky"
    masked = turning()
    masked[3].rgba[:5, :, 3] = 0
    assert still_share(masked) == 0.0
    large = [replace(p, view=replace(p.view, size=(480, 400))) for p in turning()]
    big = [replace(p, rgba=p.rgba.repeat(10, axis=0).repeat(10, axis=1)) for p in large]
    assert still_share(big) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"turntable", "cut_out"}))
def test_no_other_place_stands_still(tmp_path, kind):
    make_stranger(tmp_path, kind, 1, (48, 36), 12)
    photos = load_photos(read_capture(tmp_path), "train", 1, "ignore")
    assert shared_color(photos) is not None or still_share(photos) == 0.0


@pytest.fixture(scope="module")
def turntable(tmp_path_factory) -> tuple:
    folder = tmp_path_factory.mktemp("turntable")
    return folder, *make_stranger(folder, "turntable", 1, (80, 60), 24)


def test_train_says_it_of_a_turntable(turntable):
    run = Trainer(open_device("cpu"), read_capture(turntable[0]), TrainSettings(iterations=1))
    (said,) = [warning for warning in run.warnings if "stands still" in warning]
    share = still_share(run.photos.train)
    assert [said] == still_warnings(run.photos.train) and 0.4 < share < 0.7
    assert said.startswith(f"{share:.0%} of the photos' pixels")


def test_the_masks_of_the_manual_are_those_of_the_tracer(turntable):
    """The text's own lines, run as a person runs them."""
    folder, place, views = turntable
    (code,) = re.findall(r"```python\n(import json.*?)```", DOCS.read_text(), re.DOTALL)
    subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
    overlaps = []
    for i, view in enumerate(views):
        mask = np.asarray(Image.open(folder / f"masks/frame_{i:05}.png")) > 0
        true = mask_of(view, place, 0) >= 0.5
        overlaps.append((mask & true).sum() / (mask | true).sum())
        # Where most photos show the table, that passes for the wall: too large, not too small.
        assert (mask & true).sum() > 0.95 * true.sum()
    assert np.median(overlaps) > 0.9
    photos = load_photos(read_capture(folder), "train", 1, "auto")
    assert all(photo.see_through for photo in photos) and still_share(photos) == 0.0
