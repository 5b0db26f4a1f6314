"""Hostile and broken SOG: names outside, bombs, lying counts; one sentence, little memory."""

import io
import json
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.runtime_models.read_scene import read_model
from shapeshift.runtime_models.splats.plain_splats import Reading
from shapeshift.runtime_models.splats.sog.read_sog import read_raw_sog
from shapeshift.runtime_models.splats.sog.sog_files import file_inside, is_file_without_links
from tests.support.splats.sog_scenes import random_sog, webp, write_folder, write_zip


def refused(path: Path, words: str, megabytes: float = 20) -> None:
    """Reading ends in one sentence with those words, and takes little memory."""
    tracemalloc.start()
    with pytest.raises(BadFile, match=words) as caught:
        read_model(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "\n" not in str(caught.value) and peak < megabytes * 1e6, (str(caught.value), peak)


@pytest.mark.parametrize(
    "name",
    ["../secret.webp", "/etc/passwd", "a/../../secret.webp", "..\\secret.webp", "C:secret.webp",
     "", ".", "./means_l.webp", "a//b", "means\0_l.webp"],
)  # fmt: skip
def test_names_that_leave_the_folder(tmp_path, name):
    meta, pictures = random_sog(20)
    (tmp_path / "secret.webp").write_bytes(webp(pictures["means_l.webp"]))
    meta["means"]["files"] = [name, "means_u.webp"]
    refused(write_folder(tmp_path / "scene", meta, pictures), "none of its own")
    zipped = tmp_path / "scene.sog"
    with zipfile.ZipFile(zipped, "w") as archive:
        archive.writestr("meta.json", json.dumps(meta))
        for each, picture in pictures.items():
            archive.writestr(each, webp(picture))
        if name and "\0" not in name:
            archive.writestr(name, webp(pictures["means_l.webp"]))
    refused(zipped, "none of its own")


def test_files_without_links_are_told_by_a_look_at_each_part(tmp_path):
    """Beside resolving the whole path, which says the same of what holds no link."""
    folder = tmp_path / "scene"
    (folder / "below").mkdir(parents=True)
    for name in ("a", "below/b"):
        (folder / name).write_bytes(b"")
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "c").write_bytes(b"")
    (folder / "out").symlink_to(tmp_path / "outside")
    (folder / "in").symlink_to(folder / "below")
    (folder / "d").symlink_to(folder / "a")
    plain = [n for n in ("a", "below/b", "below", "none", "out/c", "in/b", "d", "a/b")
             if is_file_without_links(folder, n)]  # fmt: skip
    assert plain == ["a", "below/b"]
    assert file_inside(folder, "in/b", "x") == folder / "in" / "b"
    assert file_inside(folder, "d", "x").is_file()
    for name, why in (("out/c", "none of its own"), ("below", "lacks"), ("none", "lacks")):
        with pytest.raises(BadFile, match=why):
            file_inside(folder, name, "x")
    (tmp_path / "other").symlink_to(folder)  # a link to the scene's own folder is none of these
    assert is_file_without_links(tmp_path / "other", "below/b")


def test_a_link_out_of_the_folder(tmp_path):
    meta, pictures = random_sog(20)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    outside = tmp_path / "outside.webp"
    (folder / "sh0.webp").rename(outside)
    (folder / "sh0.webp").symlink_to(outside)
    refused(folder, "none of its own")


def test_a_missing_or_doubled_file(tmp_path):
    meta, pictures = random_sog(20)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    (folder / "quats.webp").unlink()
    refused(folder, "lacks 'quats.webp'")
    path = write_zip(tmp_path / "scene.sog", meta, pictures)
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
        warnings.simplefilter("ignore")
        archive.writestr("sh0.webp", b"again")
    refused(path, "just once")


@pytest.mark.parametrize("count", [21 * 10**6, 2**31, 2**62, 10**30])
def test_counts_that_the_files_cannot_hold(tmp_path, count):
    meta, pictures = random_sog(20)
    refused(write_folder(tmp_path / "scene", meta | {"count": count}, pictures), "of memory")
    refused(write_zip(tmp_path / "a.sog", meta | {"count": count}, pictures), "of memory")
    meta, pictures = random_sog(20, version=1)
    meta["means"]["shape"][0] = count
    refused(write_folder(tmp_path / "first", meta, pictures), "of memory")


def test_a_picture_smaller_or_larger_than_its_splats(tmp_path):
    meta, pictures = random_sog(20)
    refused(write_folder(tmp_path / "short", meta | {"count": 33}, pictures), "pixels")
    for name in ("means_l.webp", "means_u.webp", "quats.webp", "scales.webp", "sh0.webp"):
        other = pictures | {name: np.zeros((300, 400, 4), np.uint8)}
        refused(write_folder(tmp_path / name, meta, other), "400 x 300 pixels")


def test_picture_bombs_are_refused_before_they_are_decoded(tmp_path):
    meta, pictures = random_sog(20)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    width = height = 16383  # as large as a WebP gets: a gigabyte of pixels in 30 bytes of header
    bits = (width - 1) | (height - 1) << 14
    lossless = b"VP8L" + (26).to_bytes(4, "little") + b"\x2f" + bits.to_bytes(4, "little")
    bomb = b"RIFF" + (46).to_bytes(4, "little") + b"WEBP" + lossless + bytes(30)
    (folder / "sh0.webp").write_bytes(bomb)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        refused(folder, "16383 x 16383 pixels", 1)
    assert Image.MAX_IMAGE_PIXELS == 89_478_485  # Pillow's own guard stays as it is


def test_a_zip_bomb(tmp_path):
    meta, pictures = random_sog(20)
    path = write_zip(tmp_path / "scene.sog", meta, pictures | {})
    with zipfile.ZipFile(path) as archive:
        held = {e.filename: archive.read(e) for e in archive.infolist()}
    for name in ("sh0.webp", "meta.json"):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for each, data in held.items():
                archive.writestr(each, bytes(50_000_000) if each == name else data)
        assert path.stat().st_size < 100_000
        refused(path, "more than", 2)


def test_a_zip_that_states_less_than_it_unpacks_to(tmp_path):
    meta, pictures = random_sog(20)
    path = write_zip(tmp_path / "scene.sog", meta, pictures, compression=zipfile.ZIP_DEFLATED)
    whole = path.read_bytes()
    for field in (18, 22, 20, 24):  # sizes in the local and the central header of a member
        data = bytearray(whole)
        for mark in (b"PK\x03\x04", b"PK\x01\x02"):
            at = data.find(mark)
            data[at + field : at + field + 4] = (5).to_bytes(4, "little")
        path.write_bytes(data)
        try:
            read_model(path)
        except BadFile as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize("kind", ["PNG", "JPEG", "GIF", "BMP", "TIFF"])
def test_only_webp_is_decoded(tmp_path, kind):
    meta, pictures = random_sog(20)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    out = io.BytesIO()
    Image.fromarray(pictures["sh0.webp"][..., :3]).save(out, kind)
    (folder / "sh0.webp").write_bytes(out.getvalue())
    refused(folder, "no WebP")


def test_pictures_cut_off_or_damaged(tmp_path):
    meta, pictures = random_sog(500)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    whole = (folder / "means_l.webp").read_bytes()
    for length in (0, 3, 20, 29, 30, 60, len(whole) // 2, len(whole) - 8):
        (folder / "means_l.webp").write_bytes(whole[:length])
        refused(folder, "WebP")


CHANGES = [
    (("version",), 3, "version 3"),
    (("version",), "2", "version .2"),
    (("count",), 0, "how many"),
    (("count",), True, "how many"),
    (("count",), 2.5, "how many"),
    (("count",), None, "how many"),
    (("means",), None, "'means' is null; an object"),
    (("means", "files"), ["means_l.webp"], "2 files"),
    (("means", "files"), "means_l.webp", "'files' is .*; a list of texts"),
    (("means", "files"), [1, 2], "'files' is .*; a list of texts"),
    (("means", "mins"), [0, 0], "means needs 3 numbers as its mins"),
    (("means", "maxs"), [0, 0, "1"], "3 numbers as its maxs"),
    (("means", "maxs"), [0, 0, float("nan")], "not finite"),
    (("means", "maxs"), [0, 0, 10**400], "not finite"),
    (("means", "maxs"), [1.0, None, 2.0], "has a null: its writer met an infinite number"),
    (("scales", "codebook"), [], "1 to 256 numbers"),
    (("scales", "codebook"), [0.0] * 257, "1 to 256 numbers"),
    (("scales", "codebook"), [0.0] * 255, "some codes more"),
    (("scales", "codebook"), [None] * 256, "1 to 256 numbers"),
    (("sh0", "codebook"), None, "1 to 256 numbers"),
    (("sh0",), [], "'sh0' is .*; an object"),
    (("shN", "bands"), 4, "bands"),
    (("shN", "bands"), 2, "bands need a picture"),
    (("shN", "count"), 129, "count of 1 to 128"),
    (("shN", "count"), 0, "count of 1 to 128"),
]  # fmt: skip


@pytest.mark.parametrize(("where", "value", "words"), CHANGES)
def test_a_meta_json_that_says_what_cannot_be(tmp_path, where, value, words):
    meta, pictures = random_sog(20, bands=1)
    inner = meta if len(where) == 1 else meta[where[0]]
    inner[where[-1]] = value
    folder = write_folder(tmp_path / "scene", meta, pictures)
    with pytest.raises(BadFile, match=words) as caught:
        read_raw_sog(folder, Reading())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ['{"means"', '["means"]', '"means"', "[" * 100_000 + '"means"', '{"means": ' * 50_000]
)
def test_a_meta_json_that_is_none(tmp_path, text):
    meta, pictures = random_sog(20)
    folder = write_folder(tmp_path / "scene", meta, pictures)
    (folder / "meta.json").write_text(text)
    with pytest.raises(BadFile):
        read_raw_sog(folder, Reading())
    with pytest.raises(BadFile):
        read_model(folder)


def test_a_range_of_places_beyond_float32_is_refused_with_its_width(tmp_path):
    meta, pictures = random_sog(400)
    meta["means"]["maxs"] = [1000.0, 3.0, 0.5]  # e to the 1000
    folder = write_folder(tmp_path / "scene", meta, pictures)
    raw = read_raw_sog(folder, Reading())  # decodes, without a warning of numpy's
    assert raw.means.shape == (400, 3) and np.isinf(raw.means[:, 0]).any()
    assert np.isfinite(raw.means[:, 1:]).all()
    refused(folder, r"scene: its positions spread over .*e\+\d\d m, at most 1e\+12 m")


def test_one_place_beyond_float32_is_dropped_alone(tmp_path):
    """All splats at x = 0 but one, which stands at the end of a range of e to the 700 metres."""
    meta, pictures = random_sog(400)
    meta["means"]["mins"][0], meta["means"]["maxs"][0] = 0.0, 700.0
    kept = read_model(write_folder(tmp_path / "before", meta, pictures | at_end(pictures, ())))
    layers = read_model(write_folder(tmp_path / "after", meta, pictures | at_end(pictures, (7,))))
    assert kept.splat_count == 400 and layers.splat_count == 399
    np.testing.assert_array_equal(layers.means, np.delete(kept.means, 7, axis=0))
    (dropped,) = [finding for finding in layers.findings if finding.done == "dropped"]
    assert dropped.count == 1 and dropped.rows == (7,)


def at_end(pictures, rows):
    """The pictures of the places with x at the start of its range, or at its end in some rows."""
    changed = {}
    for name in ("means_l.webp", "means_u.webp"):
        changed[name] = pictures[name].copy()
        changed[name][..., 0] = 0
        changed[name].reshape(-1, pictures[name].shape[-1])[list(rows), 0] = 255
    return changed
