"""How much memory the photos of a training may take, and what --memory does to them."""

import os
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.app import cli
from shapeshift.app.opening import open_capture
from shapeshift.runtime_models.files import memory
from shapeshift.runtime_models.model import Stop
from shapeshift.scene.captures.capture import Capture, Photo
from shapeshift.scene.pose import View, look_at, perspective
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.photo_store.open_photos import PhotoRoom, open_photos
from shapeshift.training.photos import (
    PHOTOS,
    bytes_a_pixel,
    choose_downscale,
    load_photos,
    memory_of,
)
from shapeshift.training.supervision.targets import CACHE_BYTES, Targets
from shapeshift.training.synthetic.balls import make_balls

SIZE = (64, 48)


@pytest.fixture(autouse=True)
def no_variable(monkeypatch):
    """What --memory sets goes with the test."""
    monkeypatch.setenv(memory.VARIABLE, "")


def capture_of(folder: Path, count: int, size: tuple[int, int] = SIZE) -> Capture:
    pixels = np.random.default_rng(0).integers(0, 256, (size[1], size[0], 3), np.uint8)
    Image.fromarray(pixels).save(folder / "a.png")
    view = View(look_at(np.ones(3), np.zeros(3)), perspective(0.7, size), 0.05, 100.0, size)
    photo = Photo(view, folder / "a.png", "RGB")
    return Capture(folder, (Stop("RGB", 0.0),), (photo,) * count)


def allow(monkeypatch, for_photos: float) -> None:
    """So many bytes are the photos' part of what files may take."""
    monkeypatch.setenv(memory.VARIABLE, repr((for_photos / PHOTOS + 0.5) / memory.GB))


def test_photos_take_what_is_counted_for_them(tmp_path):
    """By Python's own count, of the arrays that stay."""
    capture = capture_of(tmp_path, 40)
    load_photos(capture, "train", 1, "object")
    tracemalloc.start()
    photos = load_photos(capture, "train", 1, "object")
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    counted = memory_of(capture.photos, 1)
    assert counted == sum(photo.rgba.nbytes for photo in photos) == 40 * 64 * 48 * 4
    assert counted <= taken < 1.1 * counted + 40_000  # 1 kB of objects a photo
    one = capture.photos[0]
    assert bytes_a_pixel(replace(one, mask=one.path, depth=one.path)) == 12


@pytest.mark.parametrize("bytes_over", [0, -1])
def test_photos_that_do_not_fit_are_kept_on_disk(tmp_path, monkeypatch, bytes_over):
    """At the limit exactly all are in memory; a byte less, and they are read when needed."""
    capture = capture_of(tmp_path, 40)
    allow(monkeypatch, memory_of(capture.photos, 1) + bytes_over)
    assert choose_downscale(capture.photos) == 1  # they are not made smaller for it
    photos = open_photos(capture, 1, "object", PhotoRoom(folder=tmp_path / "a.photos"))
    said = photos.warnings()
    assert (photos.store is None) == (bytes_over == 0) == (not said)
    if said:
        assert said[0].startswith("40 photos of 64x48 pixels take 1 MB, in memory they may take")
        assert "--memory GB or --photo-mb MB allows more" in said[0]
    photos.close()
    assert not (tmp_path / "a.photos").exists()


def test_what_losses_keep_fits_too(device, monkeypatch):
    monkeypatch.setenv(memory.VARIABLE, "1")
    assert Targets(device).most == 250_000_000
    monkeypatch.setenv(memory.VARIABLE, "1000")
    assert Targets(device).most == CACHE_BYTES
    assert Targets(device, 1000).most == 1000


def test_the_option_is_the_variable_for_what_is_read_from_then_on(tmp_path, capsys):
    make_balls(tmp_path / "balls", 16, 4, 1)
    open_capture(tmp_path / "balls")
    assert os.environ[memory.VARIABLE] == ""
    words = ["train", str(tmp_path / "balls"), "--out", str(tmp_path / "a.shift")]
    for wrong in ("-1", "nan", "inf"):
        assert cli.main([*words, "--memory", wrong]) == 2
        assert "expected GB" in capsys.readouterr().err
    assert os.environ[memory.VARIABLE] == ""
    few = [*words, "--memory", "0.00001", "--iterations", "1"]  # 10 kB
    assert cli.main(few) == 2
    said = capsys.readouterr().err
    assert "--memory" in said and "Traceback" not in said
    assert float(os.environ[memory.VARIABLE]) == 1e-5


def test_scores_have_one_photo_at_a_time_in_memory(device, tmp_path, monkeypatch):
    """Twice as many held-out photos take no more."""
    from tests.support.models import make_random_model

    model, peaks = replace(make_random_model(), stops=(Stop("RGB", 0.0),)), []
    for count in (1, 4, 8):
        capture = capture_of(tmp_path, count, (256, 192))
        held_out = tuple(replace(photo, split="test") for photo in capture.photos)
        tracemalloc.start()
        scores = evaluate_model(device, model, replace(capture, photos=held_out))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert scores["RGB"].photos == count
    assert peaks[2] - peaks[1] < 100_000  # a photo's float picture alone has 590 kB
