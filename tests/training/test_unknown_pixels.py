"""Pixels without a value count for nothing, from the loss to the scores.

The oracle is the same capture with any other number where there is none: all must be the same bits.
"""

from dataclasses import replace

import numpy as np
import pytest

from shapeshift.rasterizer.device import open_device
from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import load_photo
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from shapeshift.scene.metrics import ssim_map
from shapeshift.training.evaluation.evaluate import evaluate_model
from shapeshift.training.evaluation.metrics import psnr, ssim
from shapeshift.training.first_anchors.hull import UNKNOWN, silhouette, uncovered, visual_hulls
from shapeshift.training.photos import load_photos
from shapeshift.training.settings import TrainSettings
from shapeshift.training.supervision.backgrounds import rim_of, shared_color
from shapeshift.training.supervision.still_background import as_others_show
from shapeshift.training.synthetic.balls import make_balls
from shapeshift.training.train import Trainer
from tests.support.scene.gaps import border, write_tiff
from tests.support.training.training_runs import bits, run

SIDE = 32
SETTINGS = TrainSettings(iterations=12, max_anchors=300, seed=1, points="random")


def lacking(number: int) -> np.ndarray:
    """(SIDE, SIDE) bool: a border, and of every second photo its left half."""
    out = border((SIDE, SIDE))
    out[:, : SIDE // 2 * (number % 2)] = True
    return out


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """Light, and heat of floats of which the same pixels are no value: three numbers stand there.
    The last one has values everywhere.
    """
    found = []
    for name, value in {"far": -9999.0, "zero": 0.0, "nan": np.nan, "clean": None}.items():
        folder = tmp_path_factory.mktemp(name)
        capture, photos, number = make_balls(folder, SIDE, 5, 2), [], 0
        for photo in capture.photos:
            if photo.modality == "Thermal":
                values = 20 + 80 * load_photo(photo).rgb[..., 0] / np.float32(255)
                if value is not None:
                    values = np.where(lacking(number), np.float32(value), values)
                path = photo.path.with_suffix(".tif")
                write_tiff(path, values, None if value is None else repr(value))
                photo, number = replace(photo, path=path, counts=(20.0, 100.0)), number + 1
            photos.append(photo)
        write_capture(replace(capture, photos=tuple(photos)))
        found.append(read_capture(folder))
    return found


def test_what_stands_there_changes_no_bit_of_a_run_and_no_score(captures):
    device, found = open_device(), []
    for capture in captures[:3]:
        trainer = run(Trainer(device, capture, SETTINGS))
        said = [line for line in trainer.warnings if "have no value" in line]
        share = 100 * np.mean([lacking(number).mean() for number in range(7)])
        assert len(said) == 1
        assert said[0].startswith(f"Thermal: {share:.2g} % of the pixels, in 7 photos, have no ")
        scores = evaluate_model(device, trainer.model(), capture)
        assert scores["Thermal"].unknown > 0.2 and scores["RGB"].unknown == 0
        found.append((bits(trainer), scores))
    for other in found[1:]:
        assert other == found[0]


def test_known_pixels_are_those_of_the_photos_that_have_all(captures):
    """So a picture has the same PSNR as against the whole photo, over the same pixels."""
    ours, clean = (
        [p for p in load_photos(captures[i], "train", 1, "auto") if p.modality == "Thermal"]
        for i in (0, 3)
    )
    for photo, whole in zip(ours, clean, strict=True):
        known = photo.weight > 0
        assert whole.weight is None and 0.2 < known.mean() < 0.9
        np.testing.assert_array_equal(photo.rgba[known], whole.rgba[known])
        image = np.clip(whole.over((0, 0, 0)) + 0.1, 0, 1)
        error = ((image - whole.over((0, 0, 0))) ** 2)[known].mean(dtype=np.float64)
        measured = psnr(image, photo.over((0, 0, 0)), photo.weight)
        assert measured == pytest.approx(-10 * np.log10(error), abs=1e-4)


def test_ssim_knows_nothing_of_what_is_unknown():
    """Each window by itself, from the pixels in it that are known, is the oracle."""
    rng = np.random.default_rng(0)
    a, b, weight = rng.random((20, 14, 3)), rng.random((20, 14, 3)), np.ones((20, 14))
    weight[:, :5], weight[9, 9] = 0, 0
    for poison in (0.0, 7.0, np.nan):
        spoilt = np.where(weight[..., None] > 0, b, poison)
        assert ssim(a, spoilt, weight) == ssim(a, b, weight)
        assert psnr(a, spoilt, weight) == psnr(a, b, weight)
    whole = np.ones((20, 14), bool)
    np.testing.assert_allclose(ssim_map(a, b, whole), ssim_map(a, b), rtol=1e-12)
    taps = np.exp(-((np.arange(11) - 5) ** 2) / 4.5)
    taps = np.outer(taps, taps) / taps.sum() ** 2
    y, x = 10, 7
    part = np.s_[y - 5 : y + 6, x - 5 : x + 6]
    share = taps * weight[part] / (taps * weight[part]).sum()
    p, q = a[part][..., 1], b[part][..., 1]
    mean = [(share * v).sum() for v in (p, q)]
    var = [(share * v * v).sum() - m * m for v, m in zip((p, q), mean, strict=True)]
    both = (share * p * q).sum() - mean[0] * mean[1]
    wanted = (2 * mean[0] * mean[1] + 1e-4) * (2 * both + 9e-4)
    wanted /= (mean[0] ** 2 + mean[1] ** 2 + 1e-4) * (var[0] + var[1] + 9e-4)
    assert ssim_map(a, b, weight > 0)[y, x, 1] == pytest.approx(wanted, rel=1e-9)


def test_a_backdrop_is_seen_behind_a_border_without_values(captures):
    """The rim of what is known has its colour, and the border of the file has none."""
    photos = [p for p in load_photos(captures[3], "train", 1, "auto") if p.modality == "Thermal"]
    plain = [replace(p, rgba=np.full_like(p.rgba, 255)) for p in photos]
    for photo in plain:
        photo.rgba[10:22, 10:22, :3] = np.random.default_rng(0).integers(0, 200, (12, 12, 3))
    wanted = shared_color(plain)
    assert wanted == (1, 1, 1)
    weight = (~border((SIDE, SIDE), 3)).astype(np.float32)
    spoilt = [replace(p, rgba=p.rgba.copy(), weight=weight, unknown=1) for p in plain]
    for photo in spoilt:
        photo.rgba[weight == 0, :3] = 17
    assert shared_color(spoilt) == wanted
    counts = weight > 0
    assert len(rim_of(plain[0].rgba[..., :3], counts)) == 4 * (SIDE - 6) - 4
    hole = counts.copy()
    hole[14:18, 14:18] = False  # within: no rim of the photo
    assert len(rim_of(plain[0].rgba[..., :3], hole)) == 4 * (SIDE - 6) - 4
    assert shared_color([replace(p, weight=np.zeros_like(weight)) for p in spoilt]) is None


def test_what_is_unknown_carves_nothing_and_asks_for_nothing(captures):
    """A hull of silhouettes with a hole of unknown is the one without it, or holds it; and a photo
    of which much is unknown contradicts no other.
    """
    photos = [p for p in load_photos(captures[3], "train", 1, "auto") if p.modality == "Thermal"]
    black = (0.0, 0.0, 0.0)
    weights = [np.where(lacking(i), 0, 1).astype(np.float32) for i in range(len(photos))]
    gaps = [
        replace(p, weight=w, unknown=1, rgba=np.where(w[..., None] > 0, p.rgba, np.uint8(255)))
        for p, w in zip(photos, weights, strict=True)
    ]
    for photo, gap in zip(photos, gaps, strict=True):
        whole, shape = silhouette(photo, black), silhouette(gap, black)
        assert (shape[gap.weight == 0] == UNKNOWN).all()
        np.testing.assert_array_equal(shape[gap.weight > 0], whole[gap.weight > 0])
        alone = uncovered([(gap.view, np.full_like(shape, UNKNOWN))], np.zeros((0, 3)), 1.0)
        assert (alone == 0).all()
    hulls, doubts = visual_hulls(gaps, black)
    assert not doubts and len(hulls[0]) > 0


def test_pixels_that_stand_still_are_judged_by_photos_that_know_them(captures):
    photos = load_photos(captures[3], "train", 1, "auto")[:3]
    rgb = np.random.default_rng(0).integers(0, 255, (3, SIDE, SIDE, 4)).astype(np.uint8)
    weights = [np.ones((SIDE, SIDE), np.float32) for _ in photos]
    weights[0][:4], weights[1][:2], weights[2][0] = 0, 0, 0
    photos = [replace(p, rgba=c, weight=w) for p, c, w in zip(photos, rgb, weights, strict=True)]
    found = as_others_show(photos)
    for i, weight in enumerate(weights):
        np.testing.assert_array_equal(found[i][weight > 0], rgb[i][weight > 0, :3])
    assert not any(of[0].any() for of in found)  # nobody knows it
    np.testing.assert_array_equal(found[0][1], rgb[2][1, :, :3])
    np.testing.assert_array_equal(found[0][2], np.minimum(rgb[1], rgb[2])[2, :, :3])


def test_scores_leave_out_photos_without_any_value(captures):
    device, capture = open_device(), captures[0]
    model = Trainer(device, capture, SETTINGS).model()
    held = [p.path for p in capture.photos if p.split == "test" and p.modality == "Thermal"]
    empty = capture.folder / "empty.tif"
    write_tiff(empty, np.full((SIDE, SIDE), np.nan, np.float32), None)
    usual = evaluate_model(device, model, capture)["Thermal"]
    one, every = (
        replace(
            capture,
            photos=tuple(replace(p, path=empty) if p.path in blank else p for p in capture.photos),
        )
        for blank in (held[:1], held)
    )
    score = evaluate_model(device, model, one)["Thermal"]
    assert score.photos == usual.photos - 1 and score.blank == ("empty.tif",)
    assert np.isfinite([score.psnr_db, score.ssim, score.fitted_db]).all()
    with pytest.raises(BadFile, match="no pixel of the photos of 'Thermal'"):
        evaluate_model(device, model, every)
