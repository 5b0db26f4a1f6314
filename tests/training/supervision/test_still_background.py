"""What stands still behind a turntable: found, told from what stands before, and cut out."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import zoom

from shapeshift.rasterizer.device import open_device
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.training.baselines.plain import PlainTrainer
from shapeshift.training.baselines.plain_settings import PlainSettings
from shapeshift.training.blocks import block_start
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.evaluation.metrics import psnr
from shapeshift.training.photo_store.open_photos import PhotoRoom, open_photos
from shapeshift.training.photos import LoadedPhoto, load_photos, memory_of
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision import still_background as still
from shapeshift.training.supervision.backgrounds import BACKDROP, shared_color
from shapeshift.training.supervision.still_background import (
    STILL_PHOTOS,
    StillBackground,
    leave_out_still,
    still_background,
    still_share,
)
from shapeshift.training.train import Trainer
from tools.synthetic.strangers import KINDS, make_stranger, mask_of

RNG = np.random.default_rng
SIZE = (48, 40)


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


# A camera's own rim, textured: a helmet's or a porthole's, and a car's bonnet.
def rims(height: int, width: int) -> dict[str, np.ndarray]:
    y, x = np.mgrid[:height, :width] + 0.5
    oval = (2 * x / width - 1) ** 2 + (2 * y / height - 1) ** 2 > 0.8
    return {"rim": oval, "bonnet": y > (0.75 - 0.07 * np.cos(6 * x / width)) * height}


def carried(photos: list[LoadedPhoto], where: np.ndarray) -> list[LoadedPhoto]:
    """The photos with something textured that stands still, with noise, before them."""
    rng, (height, width) = RNG(0), where.shape
    cloth = zoom(rng.uniform(0, 253, (6, 8, 3)), (height / 6, width / 8, 1), order=1)
    out = []
    for photo in photos:
        rgba = photo.rgba.copy()
        rgba[where, :3] = (cloth + rng.integers(0, 3, cloth.shape))[where].astype(np.uint8)
        out.append(replace(photo, rgba=rgba))
    return out


@pytest.fixture(scope="module")
def turntable(tmp_path_factory) -> tuple:
    folder = tmp_path_factory.mktemp("turntable")
    return folder, *make_stranger(folder, "turntable", 1, (80, 60), 32)


@pytest.fixture(scope="module")
def photos_of(turntable, tmp_path_factory) -> Callable[[str], list[LoadedPhoto]]:
    """Of a kind 28 photos or more, traced once."""

    @cache
    def photos(kind: str) -> list[LoadedPhoto]:
        folder = turntable[0]
        if kind != "turntable":
            make_stranger(folder := tmp_path_factory.mktemp(kind), kind, 1, (80, 60), 28)
        return load_photos(read_capture(folder), "train", 1, "ignore")

    return photos


@pytest.mark.parametrize("what", ["rim", "bonnet"])
@pytest.mark.parametrize("kind", ["room", "corridor", "aerial"])
def test_what_a_camera_carries_before_it_is_said_and_kept(photos_of, kind, what):
    """A photo without it would be wrong: behind the rim there is something."""
    photos = carried(photos_of(kind), rims(60, 80)[what])
    found = still_background(photos)
    assert found.share > 0.2 and not found.pictures
    (said,) = found.warnings()
    assert "belongs to the camera and cannot be learned" in said
    assert said.startswith(f"{found.share:.0%} of the photos' pixels")


def test_one_photo_again_and_again_hides_nothing(photos_of):
    photos = photos_of("turntable")
    same = [replace(photo, rgba=photos[0].rgba) for photo in photos]
    assert still_share(same) == 1.0
    assert not still_background(same).pictures


@pytest.mark.parametrize("kind", ["room", "turntable"])
def test_dirt_and_vignette_of_a_lens_change_nothing(photos_of, kind):
    """Dark corners have one colour, specks are few."""
    y, x = np.mgrid[:60, :80]
    away = np.hypot(x - 40, y - 30)
    light = np.clip(1.6 - away / 35, 0, 1)  # black from 1.6 of the height away
    specks = RNG(0).random((60, 80)) < 0.02
    photos = photos_of(kind)
    dirty = []
    for photo in photos:
        rgba = photo.rgba.copy()
        rgba[..., :3] = (rgba[..., :3] * light[..., None]).astype(np.uint8)
        rgba[specks, :3] = 40
        dirty.append(replace(photo, rgba=rgba))
    assert bool(still_background(dirty).pictures) == (kind == "turntable")


@pytest.mark.parametrize("more, found", [(0.0, True), (1e-9, False)])
def test_enough_must_be_hidden_at_times(photos_of, monkeypatch, more, found):
    photos = photos_of("turntable")
    (picture,) = still_background(photos).pictures.values()
    assert picture.hidden > 1.5 * still.HIDDEN
    monkeypatch.setattr(still, "HIDDEN", picture.hidden + more)
    assert bool(still_background(photos).pictures) is found


def test_outlines_must_belong_to_one_object(photos_of):
    """Poses of other photos: nothing is where all of them show something."""
    photos = photos_of("turntable")
    views = [photo.view for photo in photos]
    apart = [replace(p, view=views[(5 * i) % len(views)]) for i, p in enumerate(photos)]
    assert still_background(photos).pictures
    shapes = [(p.view, np.zeros((60, 80), bool)) for p in photos]
    assert not still.fit_together(shapes), "nothing is no object"
    y, x = np.mgrid[:60, :80]
    rng = RNG(0)
    shapes = [(p.view, np.hypot(x - rng.integers(80), y - rng.integers(60)) < 12) for p in apart]
    assert not still.fit_together(shapes)


def true_masks(turntable: tuple) -> dict[str, np.ndarray]:
    """By the tracer, which knows the subject: (H, W) bool of each photo's name."""
    _, place, views = turntable
    return {f"frame_{i:05}": mask_of(view, place, 0) >= 0.5 for i, view in enumerate(views)}


def test_the_masks_are_those_of_the_tracer(turntable):
    photos = open_photos(read_capture(turntable[0]), 1, "auto")
    cut, found = leave_out_still(photos, "auto", None)
    assert cut is not photos and not photos.train[0].masked
    assert leave_out_still(cut, "auto", None) == (cut, found), "looked at once"
    overlaps, masks = [], true_masks(turntable)
    for photo, before in zip(cut.train + cut.test, photos.train + photos.test, strict=True):
        mask, true = photo.rgba[..., 3] == 255, masks[Path(photo.name).stem]
        assert photo.masked and np.array_equal(photo.rgba[..., :3], before.rgba[..., :3])
        overlaps.append((mask & true).sum() / (mask | true).sum())
        # Where hardly any photo shows the wall nothing is known: too large, not too small.
        assert (mask & true).sum() > 0.95 * true.sum()
    assert np.median(overlaps) > 0.95 and min(overlaps) > 0.75


@pytest.mark.parametrize("known, setting", [((0, 0, 0), "auto"), (None, "random"), (None, "black")])
def test_a_background_that_is_named_is_left(turntable, known, setting):
    photos = open_photos(read_capture(turntable[0]), 1, "auto")
    assert leave_out_still(photos, setting, known) == (photos, StillBackground())


def test_one_even_colour_is_the_background_before_anything_else(turntable):
    """A backdrop whose colour drifts is still, and not quite plain."""
    photos = load_photos(read_capture(turntable[0]), "train", 1, "auto")
    masks, drift = true_masks(turntable), np.linspace(-14, 14, 80).astype(np.int16)
    for photo in photos:
        even = np.broadcast_to(200 + drift[None, :, None], (60, 80, 3)).astype(np.uint8)
        photo.rgba[..., :3] = np.where(
            masks[Path(photo.name).stem][..., None], photo.rgba[..., :3], even
        )
    photos[0].rgba[:30, :30, :3] = 0
    assert shared_color(photos) is not None
    assert still_background(photos) == StillBackground()


def test_cameras_of_several_modalities_have_pictures_of_their_own(turntable):
    photos = load_photos(read_capture(turntable[0]), "train", 1, "auto")
    other = []
    for photo in photos:
        rgba = photo.rgba.copy()
        rgba[..., :3] = 255 - rgba[..., :3]
        other.append(replace(photo, modality="Heat", rgba=rgba))
    found = still_background(photos + other)
    assert set(found.pictures) == {("RGB", (80, 60)), ("Heat", (80, 60))}
    first, second = (picture.rgb.astype(int) for picture in found.pictures.values())
    assert np.abs(first + second - 255).max() <= 1  # means are rounded
    alone = still_background(photos + other[:7])
    assert list(alone.pictures) == [("RGB", (80, 60))], "seven may be alike by chance"
    assert alone.cut(other[0]) is other[0]


def test_photos_on_disk_are_cut_alike(turntable, tmp_path):
    capture = read_capture(turntable[0])
    room = PhotoRoom(memory_of(capture.photos, 1) // 3, tmp_path / "kept")
    kept, found = leave_out_still(open_photos(capture, 1, "auto", room), "auto", None)
    usual, _ = leave_out_still(open_photos(capture, 1, "auto"), "auto", None)
    assert kept.store is not None and found.pictures
    for one, other in zip(kept.train + kept.test, usual.train + usual.test, strict=True):
        assert one.masked and one.see_through
        assert np.array_equal(one.rgba, other.rgba)
    kept.close()


def test_both_trainers_learn_the_subject_alone(turntable):
    capture, device = read_capture(turntable[0]), open_device("cpu")
    for run in (
        Trainer(device, capture, TrainSettings(iterations=1, points="hull")),
        PlainTrainer(device, capture, PlainSettings(iterations=1, points="hull")),
    ):
        (said,) = [warning for warning in run.warnings if "stands still" in warning]
        assert 0.4 < run.still.share < 0.7 and said.startswith(f"{run.still.share:.0%} of the")
        photos = run.schedule.photos["RGB"] + run.held_out
        assert len(photos) == 32 and all(photo.see_through for photo in photos)
        assert run.schedule.background is None, "a random one, so that nothing looks like it"
        assert run.origin == "hull" and run.start_s > 0
    random = Trainer(device, capture, TrainSettings(iterations=1, background="random"))
    assert not any(p.see_through for p in random.photos.train)


def test_scores_are_of_the_subject_and_of_whole_photos(turntable):
    """A model that shows nothing: what is left is the cut photo, and the still picture."""
    capture, device = read_capture(turntable[0]), open_device("cpu")
    run = Trainer(device, capture, TrainSettings(iterations=1, points="hull", max_anchors=50))
    model = run.model()
    assert model.provenance["still_background"] is True
    model = replace(model, anchors=model.anchors + np.float32(1e4))  # metres: out of sight
    score = evaluate_model(device, model, capture)["RGB"]
    (picture,) = run.still.pictures.values()
    plain = load_photos(capture, "test", 1, "auto")
    whole = np.mean([psnr(picture.rgb / 255, p.rgba[..., :3] / 255) for p in plain])
    black = np.mean([psnr(np.zeros((60, 80, 3)), p.over((0, 0, 0))) for p in run.held_out])
    assert score.whole_db == pytest.approx(whole, abs=0.01)
    assert score.psnr_db == pytest.approx(black, abs=0.01)
    unsaid = replace(model, provenance={})
    assert evaluate_model(device, unsaid, capture)["RGB"].whole_db == score.whole_db
    without = replace(model, provenance={"still_background": False})
    assert evaluate_model(device, without, capture)["RGB"].whole_db is None


@pytest.mark.parametrize("said, background", [(True, "auto"), (False, "random"), (None, "random")])
def test_blocks_look_for_it_where_the_coarse_run_found_it(turntable, monkeypatch, said, background):
    """A part of the photos may look otherwise than all do: elsewhere nothing is looked for."""

    known = {"background": None, "downscale": 1, "still_background": said}
    start = SimpleNamespace(notes={}, provenance=known)
    monkeypatch.setattr(block_start, "BlockTrainer", lambda device, start, of, given, *_: given)
    capture = read_capture(turntable[0])
    asked = TrainSettings(iterations=1)
    given = block_start.begin_block(open_device("cpu"), start, capture, asked)
    assert given.background == background
