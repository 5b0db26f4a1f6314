"""CLIP from a folder, patches, and the loss of equations 10 to 13, on made models."""

import json

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.training.style_features.clip_model import FILES, ClipModel
from shapeshift.training.style_features.clip_pictures import (
    ClipPictureLoss,
    PatchSettings,
    clip_pictures,
    patch_matrix,
    picture_direction,
    text_direction,
)
from shapeshift.training.styles.style_pictures import StyleView
from tests.support.training.clip_files import (
    COLORS,
    GREY,
    write_clip,
    write_clip_with_transformer,
)
from tests.support.training.onnx_files import write_model

RNG = np.random.default_rng
WHOLE = slice(0, 24), slice(0, 32)


def unit(row):
    return np.asarray(row) / np.linalg.norm(row)


def view_of(picture, number=0):
    ones = np.ones(picture.shape[:2], np.float32)
    return StyleView(number, None, picture, ones, ones, picture)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return ClipModel(write_clip(tmp_path_factory.mktemp("clip")))


@pytest.mark.parametrize(
    "how", [{}, {"inner": "onnx"}, {"mask": True}, {"length": 77}, {"length": 77, "mask": True},
            {"crop": 16}],
)  # fmt: skip
def test_the_forms_in_which_exporters_write_a_clip(tmp_path, how):
    clip = ClipModel(write_clip(tmp_path / "clip", **how))
    assert clip.side == 16
    for word, color in COLORS.items():
        # The made tower sums 10,000 of a colour and 0.6 of grey for each other letter.
        np.testing.assert_allclose(clip.read([word]), unit(color), atol=1e-5)
        picture = np.broadcast_to(np.array(color, np.float32), (2, 16, 16, 3))
        np.testing.assert_allclose(clip.see(picture), [unit(color)] * 2, atol=1e-5)


def test_the_side_by_the_shortest_edge(tmp_path):
    folder = write_clip(tmp_path / "clip")
    config = {"size": {"shortest_edge": 24}, "image_mean": [0] * 3, "image_std": [1] * 3}
    (folder / "preprocessor_config.json").write_text(json.dumps(config))
    assert ClipModel(folder).side == 24


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(tmp_path, name):
    folder = write_clip(tmp_path / "clip")
    (folder / name).unlink()
    with pytest.raises(BadFile, match=f"has no {name}; an exported CLIP is"):
        ClipModel(folder)
    with pytest.raises(BadFile, match="is no folder; --clip-model names one with"):
        ClipModel(folder / name)


CONFIGS = {
    "no mean": ({"crop_size": 16, "image_std": [1, 1, 1]}, "'image_mean' is missing"),
    "deviation 0": (
        {"crop_size": 16, "image_mean": [0, 0, 0], "image_std": [1, 0, 1]}, "numbers above 0",
    ),
    "a huge side": (
        {"crop_size": 4096, "image_mean": [0, 0, 0], "image_std": [1, 1, 1]}, "from 8 to 1,024",
    ),
    "a side of text": (
        {"crop_size": "16", "image_mean": [0, 0, 0], "image_std": [1, 1, 1]}, "a whole number",
    ),
}  # fmt: skip


@pytest.mark.parametrize("how", CONFIGS)
def test_other_preprocessing_is_refused(tmp_path, how):
    config, words = CONFIGS[how]
    folder = write_clip(tmp_path / "clip")
    (folder / "preprocessor_config.json").write_text(json.dumps(config))
    with pytest.raises(BadFile, match=words):
        ClipModel(folder)


def test_towers_with_other_inputs_and_outputs(tmp_path):
    folder = write_clip(tmp_path / "clip")
    rows = [("Exp", ["pixel_values"], ["hidden"], {})]
    shape = {"pixel_values": ["b", 3, 16, 16]}
    write_model(folder / "vision_model.onnx", rows, shape, ["hidden"], {})
    with pytest.raises(BadFile, match="gives no 'image_embeds'; it ends in 'hidden'"):
        ClipModel(folder).see(np.zeros((1, 16, 16, 3), np.float32))
    write_model(folder / "text_model.onnx", rows, shape, ["hidden"], {})
    with pytest.raises(BadFile, match="has the inputs pixel_values and the outputs hidden; input"):
        ClipModel(folder)


def test_a_tower_that_gives_no_numbers(tmp_path):
    folder = write_clip(tmp_path / "clip")
    rows = [
        ("GlobalAveragePool", ["pixel_values"], ["p"], {}),
        ("Flatten", ["p"], ["f"], {"axis": 1}), ("Log", ["f"], ["image_embeds"], {}),
    ]  # fmt: skip
    shape = {"pixel_values": ["b", 3, 16, 16]}
    write_model(folder / "vision_model.onnx", rows, shape, ["image_embeds"], {})
    with pytest.raises(BadFile, match=r"vision_model.onnx gives no finite rows, \(1, 3\)"):
        ClipModel(folder).see(np.zeros((1, 16, 16, 3), np.float32))


def test_directions_of_words_and_of_pictures(clip):
    """Equation 10: from "A Photo", which the made tower sees as grey, to the colour."""
    for word, color in COLORS.items():
        by_text = text_direction(clip, word)
        assert np.linalg.norm(by_text) == pytest.approx(1, abs=1e-5)
        wanted = unit(unit(color) - unit(GREY))
        # Beside 10,000 of the colour the grey letters of the templates are next to nothing.
        np.testing.assert_allclose(by_text, wanted, atol=2e-3)
        flat = np.broadcast_to(np.array(color, np.float32), (40, 30, 3))
        np.testing.assert_allclose(picture_direction(clip, flat), wanted, atol=1e-4)


@pytest.mark.parametrize("text", ["", "   ", "x" * 201, "two\nlines"])
def test_texts_that_say_nothing_or_too_much(clip, text):
    with pytest.raises(BadFile, match="1 to 200 are wanted"):
        text_direction(clip, text)


def test_words_that_are_no_style_to_this_clip(clip):
    with pytest.raises(BadFile, match="to this CLIP 'qq' is the same as 'A Photo'"):
        text_direction(clip, "qq")


def test_the_first_patch_is_the_whole_and_every_row_is_a_mean():
    settings = PatchSettings(count=6)
    matrix = patch_matrix((32, 24), WHOLE, 8, settings, RNG(0))
    assert matrix.shape == (6 * 64, 32 * 24)
    np.testing.assert_allclose(np.asarray(matrix.sum(axis=1)).ravel(), 1, atol=1e-5)
    assert matrix.data.min() >= 0
    # A picture that is x or y everywhere tells where each patch looks.
    down, across = np.mgrid[:24, :32] + 0.5
    seen = [(matrix @ p.ravel().astype(np.float32)).reshape(6, 8, 8) for p in (across, down)]
    np.testing.assert_allclose(seen[0][0], np.tile((np.arange(8) + 0.5) * 4, (8, 1)), atol=1e-4)
    np.testing.assert_allclose(seen[1][0].T, np.tile((np.arange(8) + 0.5) * 3, (8, 1)), atol=1e-4)
    spans = [float(np.ptp(seen[0][k])) for k in range(1, 6)]
    assert max(spans) < 32 and min(spans) > 0.25 * 32 and np.ptp(spans) > 1


def test_patches_stay_about_their_part_and_follow_the_seed():
    part = slice(8, 16), slice(12, 28)
    first, again, other = (
        patch_matrix((32, 24), part, 8, PatchSettings(8, bend=0.0), RNG(s)) for s in (0, 0, 1)
    )
    assert (first != again).nnz == 0 and (first != other).nnz > 0
    looked_at = np.asarray(first.sum(axis=0)).reshape(24, 32)
    rows, columns = np.nonzero(looked_at)
    assert rows.min() >= 7 and rows.max() <= 16 and columns.min() >= 11 and columns.max() <= 28


def test_a_picture_of_one_pixel_has_patches():
    matrix = patch_matrix((1, 1), (slice(0, 1), slice(0, 1)), 8, PatchSettings(3), RNG(0))
    np.testing.assert_allclose(matrix.toarray(), np.ones((3 * 64, 1)))


@pytest.mark.parametrize("count", [0, 65])
def test_numbers_of_patches(count):
    with pytest.raises(ValueError, match="1 to 64 are wanted"):
        PatchSettings(count)


def test_the_loss_is_equations_11_to_13(clip):
    """On the tower that sees mean colours, by numpy in float64."""
    towards = text_direction(clip, "red")
    patches, photo = RNG(1).random((5, 16, 16, 3)), RNG(2).random((1, 16, 16, 3))
    value, _ = clip.slope(patches.astype(np.float32), clip.see(photo)[0], towards)
    base = unit(photo[0].mean(axis=(0, 1)))
    distances = []
    for patch in patches:
        moved = unit(patch.mean(axis=(0, 1))) - base
        distances.append(1 - moved @ towards / np.sqrt((moved**2).sum() + 1e-4))
    assert value == pytest.approx(np.mean(distances), abs=1e-4)


def test_the_gradient_through_patches_and_a_vision_transformer(tmp_path):
    clip = ClipModel(write_clip_with_transformer(tmp_path / "clip"))
    towards = unit(RNG(0).normal(size=16)).astype(np.float32)
    source, shown = RNG(1).random((2, 24, 32, 3)).astype(np.float32)
    loss = ClipPictureLoss(clip, towards, PatchSettings(3), seed=4)
    slope = loss.at(view_of(source))
    value, gradient = slope(shown)
    assert 0 < value < 2 and gradient.shape == shown.shape
    step = 2e-3 * np.sign(gradient)
    ends = [slope((shown + way * step).astype(np.float32))[0] for way in (1, -1)]
    # 1 %: float32 differences of a loss of order 1 along a direction that adds up
    assert (gradient * step).sum() == pytest.approx((ends[0] - ends[1]) / 2, rel=0.01)


def test_a_picture_that_is_still_the_photo_has_a_gradient(clip):
    """Its direction is nothing divided by nothing: what is added to its length decides."""
    source = RNG(1).random((24, 32, 3)).astype(np.float32)
    towards = text_direction(clip, "red")
    slope = ClipPictureLoss(clip, towards, PatchSettings(1)).at(view_of(source))
    value, gradient = slope(source)
    assert value == pytest.approx(1, abs=1e-3) and np.isfinite(gradient).all()
    # The way to red is less of green and blue.
    means = gradient.mean(axis=(0, 1))
    assert means[0] < 0 < min(means[1:])


def test_descent_makes_a_grey_picture_red_and_repeats(clip):
    towards = text_direction(clip, "red")
    grey = np.full((24, 32, 3), 0.5, np.float32) + 0.02 * RNG(0).random((24, 32, 3), np.float32)
    runs = [clip_pictures(clip, towards, seed=3).make([view_of(grey)], 0.0)[0] for _ in range(2)]
    np.testing.assert_array_equal(*runs)
    red, green, blue = runs[0].mean(axis=(0, 1))
    assert red > green + 0.15 and red > blue + 0.15
