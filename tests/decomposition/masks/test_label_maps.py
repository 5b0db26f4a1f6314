"""Label maps: the values of a file as they stand there, or one sentence."""

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from shapeshift.decomposition.masks.label_maps import (
    SILENT,
    read_label_map,
    read_mask,
    write_label_map,
)
from shapeshift.runtime_models.model import BadFile


def some_labels(width=12, height=8) -> np.ndarray:
    labels = np.zeros((height, width), np.uint8)
    labels[2:5, 3:9], labels[5:, :4], labels[0, 0] = 1, 254, SILENT
    return labels


def raw_png(path, rows: np.ndarray, bits: int, kind: int, width: int) -> None:
    """A PNG by the letter of its specification, rows already packed."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    head = struct.pack(">IIBBBBB", width, len(rows), bits, kind, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
    )


def test_what_is_written_comes_back(tmp_path):
    labels = some_labels()
    write_label_map(labels, tmp_path / "a.png")
    assert (read_label_map(tmp_path / "a.png", (12, 8)) == labels).all()
    with Image.open(tmp_path / "a.png") as image:  # as any other program sees it
        assert image.mode == "L" and (np.asarray(image) == labels).all()


@pytest.mark.parametrize("factor", [2, 3, 5])
def test_another_size_is_resized_without_new_labels(tmp_path, factor):
    """Larger: each label becomes a square.  Smaller again: what it was, exactly, for odd factors
    whose nearest centre is the square's own."""
    labels = some_labels()
    write_label_map(labels, tmp_path / "a.png")
    large = read_label_map(tmp_path / "a.png", (12 * factor, 8 * factor))
    assert (large == np.kron(labels, np.ones((factor, factor), np.uint8))).all()
    write_label_map(large, tmp_path / "b.png")
    assert (read_label_map(tmp_path / "b.png", (12, 8)) == labels).all()


@pytest.mark.parametrize(
    ("size", "fits"),
    [((13, 8), True), ((14, 8), False), ((24, 17), True), ((24, 19), False), ((8, 12), False),
     ((1, 1), True), ((6, 4), True), ((6, 6), False)],
)  # fmt: skip
def test_only_the_aspect_of_the_photo_is_taken(tmp_path, size, fits):
    """A pixel off by rounding is the same aspect (one of the coarser image); more is another."""
    write_label_map(some_labels(), tmp_path / "a.png")
    if fits:
        assert read_label_map(tmp_path / "a.png", size).shape == size[::-1]
    else:
        with pytest.raises(BadFile, match="12x8 pixels, its photo"):
            read_label_map(tmp_path / "a.png", size)


def test_wrong_pngs_are_refused_in_a_sentence(tmp_path):
    path = tmp_path / "a.png"
    labels = some_labels()
    for image, word in (
        (Image.fromarray(labels).convert("P"), "a palette"),
        (Image.fromarray(labels).convert("RGB"), "RGB"),
        (Image.fromarray(labels).convert("LA"), "grey with alpha"),
        (Image.fromarray(labels).convert("RGBA"), "RGB with alpha"),
        (Image.fromarray(labels.astype(np.uint16)), "16 bits"),
        (Image.fromarray(labels).convert("1"), "1 bits"),
    ):
        image.save(path)
        with pytest.raises(BadFile, match=word):
            read_label_map(path, (12, 8))
    Image.fromarray(labels).save(tmp_path / "a.jpg")
    (tmp_path / "a.jpg").rename(path)
    with pytest.raises(BadFile, match="not a PNG"):
        read_label_map(path, (12, 8))
    path.write_bytes(b"")
    with pytest.raises(BadFile, match="not a PNG"):
        read_label_map(path, (12, 8))
    with pytest.raises(BadFile, match="missing"):
        read_label_map(tmp_path / "none.png", (12, 8))
    with pytest.raises(BadFile, match="missing"):
        read_label_map(tmp_path, (12, 8))


@pytest.mark.parametrize("bits", [2, 4])
def test_values_of_few_bits_are_not_stretched(tmp_path, bits):
    """Pillow turns the 1 of two bits into 85: labels would change without a word."""
    path = tmp_path / "a.png"
    raw_png(path, np.full((2, 1), 0b01000000 if bits == 2 else 0b00010000, np.uint8), bits, 0, 2)
    with Image.open(path) as image:
        assert image.mode == "L" and np.asarray(image).max() > 1
    with pytest.raises(BadFile, match=f"{bits} bits"):
        read_label_map(path, (2, 2))


@pytest.mark.parametrize(("most", "silent", "value", "fits"), [
    (254, True, 254, True), (254, True, 255, True), (254, False, 255, False),
    (3, True, 3, True), (3, True, 4, False), (3, True, 255, True), (3, False, 255, False),
])  # fmt: skip
def test_labels_have_bounds(tmp_path, most, silent, value, fits):
    labels = np.zeros((4, 4), np.uint8)
    labels[1, 2] = value
    write_label_map(labels, tmp_path / "a.png")
    if fits:
        assert read_label_map(tmp_path / "a.png", (4, 4), most, silent)[1, 2] == value
    else:
        with pytest.raises(BadFile, match=f"the label {value}"):
            read_label_map(tmp_path / "a.png", (4, 4), most, silent)


def test_a_cut_file_is_refused(tmp_path):
    write_label_map(
        np.random.default_rng(0).integers(0, 255, (64, 64), np.uint8), tmp_path / "a.png"
    )
    data = (tmp_path / "a.png").read_bytes()
    for keep in (25, 26, 40, len(data) // 2):
        (tmp_path / "b.png").write_bytes(data[:keep])
        with pytest.raises(BadFile):
            read_label_map(tmp_path / "b.png", (64, 64))


def test_masks_of_other_programs(tmp_path):
    labels = some_labels()
    labels[0, 0] = 0
    write_label_map(labels, tmp_path / "a.png")
    assert (read_mask(tmp_path / "a.png", (12, 8), 254) == (labels == 254)).all()
    with pytest.raises(BadFile, match="3 values, 0, 1, 254; say with 'mask_label'"):
        read_mask(tmp_path / "a.png", (12, 8))
    with pytest.raises(BadFile, match="no pixel has the label 7"):
        read_mask(tmp_path / "a.png", (12, 8), 7)
    for low, high in ((0, 255), (0, 1), (7, 9)):
        write_label_map(np.where(labels == 1, high, low).astype(np.uint8), tmp_path / "b.png")
        assert (read_mask(tmp_path / "b.png", (12, 8)) == (labels == 1)).all()
    for value, word in ((0, "no pixel is white"), (255, "every pixel")):
        write_label_map(np.full((8, 12), value, np.uint8), tmp_path / "c.png")
        with pytest.raises(BadFile, match=word):
            read_mask(tmp_path / "c.png", (12, 8))
