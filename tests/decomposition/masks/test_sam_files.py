"""Segmenters out of ONNX files: places go to the network and come back; what is none is refused.

The networks are stand-ins of the test: nothing here says what real weights give.
"""

import numpy as np
import pytest

pytest.importorskip("onnxruntime")

from shapeshift.decomposition.masks.clip_words import ClipWords, read_words
from shapeshift.decomposition.masks.sam import Square
from shapeshift.decomposition.masks.sam_files import open_segmenter
from shapeshift.decomposition.masks.segmenter import Prompt
from shapeshift.runtime_models.model import BadFile
from tests.support.decomposition.sam_stand_ins import (
    SURE,
    passed_on,
    write_sam,
    write_sam3,
    write_transformers,
    write_words,
)
from tests.support.models import make_random_model

SIZES = [(320, 200), (150, 300), (256, 256), (1, 1), (40, 401)]


def middle(mask: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(mask)
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])


@pytest.mark.parametrize("kind", ["sam", "sam rows", "sam 2"])
@pytest.mark.parametrize("size", SIZES[:3])
def test_a_click_comes_back_where_it_was(tmp_path, kind, size):
    """The disc's middle within a pixel of the small logits, its area within a tenth."""
    side = 1024 if kind == "sam rows" else 256  # that one cannot say its side: SAM's is meant
    radius = write_sam(tmp_path, kind, side)
    segmenter = open_segmenter(tmp_path)
    assert segmenter.name.startswith("SAM 2" if kind == "sam 2" else "SAM of")
    assert not segmenter.reads_text and segmenter.takes_boxes
    width, height = size
    encoded = segmenter.encode(np.zeros((height, width, 3), np.uint8))
    at = np.array([0.4 * width, 0.55 * height])
    (found,) = segmenter.candidates(encoded, Prompt(inside=at[None], outside=np.zeros((1, 2))))
    assert found.mask.shape == (height, width) and found.score == pytest.approx(SURE)
    filled = np.array(Square(size, side, kind != "sam 2").filled)
    pixel = size / filled  # of the photo, a pixel of the square
    assert np.abs(middle(found.mask) - at).max() < 4 * pixel.max()
    assert found.mask.sum() == pytest.approx(np.pi * np.prod(radius * pixel), rel=0.05)


def test_a_box_goes_as_its_corners(tmp_path):
    """The stand-in's disc is at the second place: the box's far corner, the clicks before it."""
    write_sam(tmp_path, "sam")
    segmenter = open_segmenter(tmp_path)
    square = Square((320, 200), 256, True)
    places, labels = segmenter.points_of(
        Prompt((10, 20, 30, 40), np.array([[5.0, 6.0]]), np.array([[7.0, 8.0]])), square
    )
    assert labels.tolist() == [1, 0, 2, 3]
    np.testing.assert_allclose(places, np.array([[5, 6], [7, 8], [10, 20], [30, 40]]) * 0.8)
    places, labels = segmenter.points_of(Prompt(inside=np.array([[5.0, 6.0]])), square)
    assert labels.tolist() == [1, -1]  # as SAM's own predictor pads
    places, labels = segmenter.points_of(Prompt(text="mug"), square)
    assert labels.tolist() == [-1]


def test_the_mask_before_lies_in_the_square_as_the_photo_does(tmp_path):
    write_sam(tmp_path, "sam")
    segmenter = open_segmenter(tmp_path)
    square = Square((320, 200), 256, True)
    mask = np.zeros((200, 320), bool)
    mask[100:, :160] = True
    given = segmenter.mask_of(Prompt(mask=mask), square)
    before = given["mask_input"][0, 0]
    assert given["has_mask_input"].tolist() == [1] and before.shape == (64, 64)
    assert (before[40:] == -10).all()  # below the photo
    assert (before[21:40, :31] == 10).all() and (before[:19] == -10).all()
    assert (square.stretch(before) > 0).mean() == pytest.approx(mask.mean(), abs=0.01)
    assert segmenter.mask_of(Prompt(), square)["has_mask_input"].tolist() == [0]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("padded", [False, True])
def test_what_is_shrunk_and_stretched_again_stays_in_its_place(size, padded):
    square = Square(size, 256, padded)
    width, height = square.filled
    assert max(width, height) == 256 and (padded or (width, height) == (256, 256))
    corners = square.places(np.array([[0, 0], size]))
    np.testing.assert_allclose(corners, [[0, 0], [width, height]])
    image = np.zeros((size[1], size[0], 3), np.uint8)
    image[:, size[0] // 2 :] = 255
    whole = square.pad(square.shrink(image))[0, 0]
    assert whole.shape == (256, 256)
    back = square.stretch(whole)
    assert back.shape == image.shape[:2]
    assert np.abs(back - image[..., 0]).mean() < 16  # a blurred edge, no shift


def test_exports_of_transformers(tmp_path):
    for third, boxes, name in (
        (False, False, "SAM of"),
        (False, True, "SAM 2"),
        (True, True, "SAM 3"),
    ):
        folder = tmp_path / f"{third}{boxes}"
        folder.mkdir()
        write_transformers(folder, third, boxes)
        segmenter = open_segmenter(folder)
        assert segmenter.name.startswith(name)
        assert segmenter.takes_boxes == boxes
        encoded = segmenter.encode(np.zeros((200, 320, 3), np.uint8))
        (found,) = segmenter.candidates(encoded, Prompt(box=(100, 80, 140, 120)))
        assert np.abs(middle(found.mask) - (120, 100)).max() < 1
        if not boxes:
            (found,) = segmenter.candidates(encoded, Prompt(inside=np.array([[60.0, 90]])))
            assert np.abs(middle(found.mask) - (60, 90)).max() < 1


@pytest.mark.parametrize("raw", [False, True])
def test_sam_3_reads_and_takes_boxes(tmp_path, raw):
    """`mug` is the token 512 + 1 of the stand-in's vocabulary, 5.13 as its score: cut to 1."""
    write_sam3(tmp_path, raw)
    write_words(tmp_path)
    segmenter = open_segmenter(tmp_path)
    assert segmenter.reads_text
    encoded = segmenter.encode(np.zeros((200, 320, 4), np.uint8))
    (found,) = segmenter.candidates(encoded, Prompt((100, 80, 140, 120), text="Mug"))
    assert np.abs(middle(found.mask) - (120, 100)).max() < 3 and found.mask.shape == (200, 320)
    assert found.score == pytest.approx(1 / (1 + np.exp(-5.13)) if raw else 1, abs=1e-4)


def test_sam_3_has_as_many_places_as_it_was_made_with(tmp_path):
    write_sam3(tmp_path, True, room=4)
    write_words(tmp_path)
    segmenter = open_segmenter(tmp_path)
    square = Square((320, 200), 112, False)
    given = segmenter.boxes_of(
        Prompt((0, 0, 32, 20), np.array([[160.0, 100]]), np.array([[0.0, 0]])), square
    )
    assert given["box_coords"].shape == (4, 1, 4)
    np.testing.assert_allclose(given["box_coords"][0, 0], [0.05, 0.05, 0.1, 0.1])
    np.testing.assert_allclose(given["box_coords"][1, 0], [0.5, 0.5, 0.01, 0.01])
    assert given["box_labels"].ravel().tolist() == [1, 1, 0, 1]
    assert given["box_masks"].tolist() == [[False, False, False, True]]
    many = segmenter.boxes_of(Prompt(inside=np.zeros((9, 2))), square)
    assert many["box_coords"].shape == (4, 1, 4) and not many["box_masks"].any()


def test_words_as_numbers(tmp_path):
    write_words(tmp_path)
    words = read_words(tmp_path)
    assert (words.first, words.last) == (516, 517)
    row = words.tokens("  A MUG,\tcan ")
    letters = {"a": 320, ",": 267}  # OpenAI's own tokenizer gives these, whatever the merges
    assert row[0, :6].tolist() == [516, letters["a"], 513, letters[","], 515, 517]
    assert not row[0, 6:].any() and row.shape == (1, 32) and row.dtype == np.int64
    long = words.tokens("mug " * 99)
    assert long[0, -1] == 517 and (long[0, 1:-1] == 513).all()
    assert words.tokens("")[0, :3].tolist() == [516, 517, 0]
    assert words.tokens("ü火")[0, 0] == 516  # any letter has bytes
    assert ClipWords([]).pieces("abc") == ["a", "b", "c</w>"]


def test_vocabularies(tmp_path):
    import gzip
    import json

    assert read_words(tmp_path) is None
    (tmp_path / "tokenizer.json").write_text(
        json.dumps({"model": {"merges": [["m", "u"], "mu g</w>"]}})
    )
    assert read_words(tmp_path).tokens("mug")[0, 1] == 513
    for data, word in (
        (b"no gzip", "not a gzip"),
        (gzip.compress(b"#\na b\n" * 99)[:-9], "cut off"),
        (gzip.compress(b"#\na b c\n"), "pairs"),
        (gzip.compress(bytes(17 << 20)), "unpacked"),
    ):
        (tmp_path / "bpe_simple_vocab_16e6.txt.gz").write_bytes(data)
        with pytest.raises(BadFile, match=word):
            read_words(tmp_path)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [("nan", "'masks' holds NaN"), ("scores", "1 masks of 64x64 pixels and 2 scores"),
     ("rank", "'masks' has the shape"), ("names", "'masks' is wanted")],
)  # fmt: skip
def test_answers_that_are_no_masks_are_refused(tmp_path, spoil, word):
    write_sam(tmp_path, "sam", spoil=spoil)
    segmenter = open_segmenter(tmp_path)
    encoded = segmenter.encode(np.zeros((20, 30, 3), np.uint8))
    with pytest.raises(BadFile) as caught:
        segmenter.candidates(encoded, Prompt(inside=np.array([[3.0, 4.0]])))
    assert word in str(caught.value) and "a.decoder.onnx" in str(caught.value)


def test_folders_without_a_segmenter(tmp_path):
    def refused(word: str) -> None:
        with pytest.raises(BadFile) as caught:
            open_segmenter(tmp_path)
        assert word in str(caught.value) and "\n" not in str(caught.value)
        assert len(str(caught.value)) < 400

    with pytest.raises(BadFile, match="no folder"):
        open_segmenter(tmp_path / "none")
    refused("no .onnx file")
    (tmp_path / "a.onnx").write_bytes(b"\x08" * 5000)
    refused("not a network that opens")
    (tmp_path / "a.onnx").write_bytes(b"")
    refused("not a network that opens")
    (tmp_path / "a.onnx").unlink()
    write_sam(tmp_path, "sam")
    (tmp_path / "a.decoder.onnx").rename(tmp_path / "b.txt")
    refused("a.encoder.onnx (image encoder)")
    (tmp_path / "b.txt").rename(tmp_path / "a.decoder.onnx")
    passed_on(tmp_path / "z.onnx", "image", [1, 3, 8, 8], ["y"])
    refused("two files that are a SAM's image encoder")
    passed_on(tmp_path / "z.onnx", "features", [1, 3], ["y"])
    refused("it takes 'features'")
    for i in range(9):
        (tmp_path / f"{i}.onnx").write_bytes(b"")
    refused("holds 12 ONNX files")


def test_a_package_is_no_segmenter(tmp_path):
    """What a stranger tries first: the folder of a scene."""
    from shapeshift.runtime_models.package.write_package import write_package

    write_package(make_random_model(anchors=3, k=1, features=4, hidden=(4,)), tmp_path / "scene")
    with pytest.raises(BadFile, match="no part of a segmenter"):
        open_segmenter(tmp_path / "scene")


def test_sam_3_without_its_words(tmp_path):
    write_sam3(tmp_path)
    with pytest.raises(BadFile, match="without its vocabulary; put bpe_simple_vocab"):
        open_segmenter(tmp_path)
    write_words(tmp_path)
    (tmp_path / "sam3_language_encoder.onnx").unlink()
    with pytest.raises(BadFile, match="without its text encoder"):
        open_segmenter(tmp_path)


def test_an_encoder_of_another_decoder(tmp_path):
    """SAM 2's encoder beside SAM's decoder: a sentence with the names, when it runs."""
    write_sam(tmp_path, "sam 2")
    (tmp_path / "a.encoder.onnx").rename(tmp_path / "kept")
    write_sam(tmp_path, "sam")
    (tmp_path / "kept").replace(tmp_path / "a.encoder.onnx")
    segmenter = open_segmenter(tmp_path)
    with pytest.raises(BadFile, match=r"'image_embeddings' is what a\.decoder\.onnx asks for"):
        segmenter.candidates(
            segmenter.encode(np.zeros((9, 9, 3), np.uint8)), Prompt(box=(1, 1, 4, 4))
        )
