"""Photos of several bands: every layout of TIFF, channels of pictures, captures that name bands."""

import json
from collections import Counter

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.photo import load_photo, open_image
from shapeshift.scene.captures.radiometric import tiff_bands
from shapeshift.scene.captures.radiometric.tiff_bands import band_header, open_band
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from tests.support.scene.band_files import DEFLATE, write_bands
from tests.support.scene.captures import colmap_model, simple, write_transforms

SIZE = (12, 16)  # rows, columns
NDVI = {"name": "NDVI", "x": 1, "kind": "values", "palette": "turbo", "value_range": [-1, 1],
        "formula": "(nir - red) / (nir + red)"}  # fmt: skip


def numbers(dtype, bands: int = 3, size=SIZE) -> np.ndarray:
    random = np.random.default_rng(3)
    if np.dtype(dtype).kind == "f":
        return random.normal(0, 1e3, (bands, *size)).astype(dtype)
    ends = np.iinfo(dtype)
    return random.integers(ends.min, ends.max, (bands, *size), dtype=dtype, endpoint=True)


def assert_bands(path, wanted) -> None:
    """Every band is read as it was written, as far as float32 holds its numbers."""
    header = band_header(path)
    assert header.size == wanted.shape[:0:-1] and header.info["bands"] == len(wanted)
    for number, band in enumerate(wanted, 1):
        found = np.asarray(open_band(path, number))
        held = band.astype(np.float32) if band.dtype in (np.float64, np.uint32) else band
        np.testing.assert_array_equal(found, held)


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"])
@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
def test_every_type_and_order(tmp_path, dtype, beside, order):
    wanted = numbers(dtype)
    for big in (False, True):
        path = write_bands(tmp_path / f"{big}.tif", wanted, beside=beside, order=order, big=big)
        assert_bands(path, wanted)


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"])
def test_one_band_needs_no_number(tmp_path, dtype):
    """Pillow takes some of these for other numbers, or does not open them."""
    wanted = numbers(dtype, 1)
    held = wanted[0].astype(np.float32) if dtype in ("u4", "f8") else wanted[0]
    for beside in (False, True):
        path = write_bands(tmp_path / "a.tif", wanted, beside=beside)
        with open_image(path) as image:
            np.testing.assert_array_equal(np.asarray(image), held)


@pytest.mark.parametrize(("dtype", "predictor"), [("u1", 2), ("i1", 2), ("u2", 2), ("i4", 2),
                                                  ("f4", 3), ("f8", 3), ("u2", 1)])  # fmt: skip
@pytest.mark.parametrize("beside", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("tile", [None, (16, 16), (32, 16)])
def test_every_predictor_and_tile(tmp_path, dtype, predictor, beside, order, tile):
    """Tiles that the picture fills to a part: 20 columns and 18 rows of 16 and 32."""
    wanted = numbers(dtype, size=(18, 20))
    path = write_bands(tmp_path / "a.tif", wanted, beside=beside, order=order, packing=DEFLATE,
                       predictor=predictor, tile=tile)  # fmt: skip
    assert_bands(path, wanted)


def test_pages_are_bands_and_smaller_copies_are_none(tmp_path):
    wanted = numbers("u2", 4)
    assert_bands(write_bands(tmp_path / "a.tif", wanted, pages=True), wanted)
    whole = write_bands(tmp_path / "b.tif", wanted)
    pages = tiff_bands.read_pages(whole)[1]
    copy = tiff_bands.Page({**pages[0].tags, tiff_bands.KIND: (1,), tiff_bands.WIDTH: (8,)})
    assert len(tiff_bands.bands_of(whole, pages)) == 4
    path = write_bands(tmp_path / "c.tif", wanted, more={tiff_bands.KIND: ("I", [1])})
    with pytest.raises(BadFile, match="without a picture"):
        band_header(path)
    with pytest.raises(BadFile, match=r"bands of 16x12 and of 8x12 pixels"):
        tiff_bands.bands_of(whole, [*pages, copy])


def test_what_stands_for_no_value_is_of_each_band(tmp_path):
    path = write_bands(tmp_path / "a.tif", numbers("f4"), no_data="-9999")
    assert open_band(path, 2).tag_v2[tiff_bands.GDAL_NODATA] == "-9999"


def test_channels_of_pictures(tmp_path):
    pixels = np.moveaxis(numbers("u1"), 0, 2)
    for name in ("a.png", "a.tif"):
        Image.fromarray(pixels).save(tmp_path / name)
        for band in (1, 2, 3):
            found = np.asarray(open_band(tmp_path / name, band))
            np.testing.assert_array_equal(found, pixels[..., band - 1])
    Image.fromarray(pixels[..., 0]).save(tmp_path / "grey.png")
    assert np.array_equal(open_band(tmp_path / "grey.png", 1), pixels[..., 0])
    with pytest.raises(BadFile, match="'band' is 2; the file has one band"):
        open_band(tmp_path / "grey.png", 2)
    with pytest.raises(BadFile, match="'band' is 4; the file has bands 1 to 3"):
        open_band(tmp_path / "a.png", 4)


@pytest.mark.parametrize("cut", [3, 8, 12, 60, 400, -40, -4, -1])
def test_files_that_are_cut_off(tmp_path, cut):
    path = write_bands(tmp_path / "a.tif", numbers("u2"), packing=DEFLATE, predictor=2)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(BadFile) as error:
        open_image(path, 2)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "more",
    [{256: ("I", [1 << 31])}, {257: ("I", [0])}, {277: ("H", [65535])}, {258: ("H", [12] * 3)},
     {273: ("I", [1 << 30] * 9)}, {322: ("I", [1 << 31]), 323: ("I", [16]),
     324: ("I", [8]), 325: ("I", [9])}, {278: ("I", [0])}, {259: ("H", [34712])},
     {339: ("H", [7] * 3)}],
)  # fmt: skip
def test_headers_that_lie(tmp_path, more):
    path = write_bands(tmp_path / "a.tif", numbers("u2"), more=more)
    with pytest.raises(BadFile) as error:
        open_image(path, 2)
    assert "\n" not in str(error.value)


def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path):
    zeros = np.zeros((2, 4096, 4096), np.float64)  # 268 MB in 262 kB
    path = write_bands(tmp_path / "a.tif", zeros[:, :64], packing=DEFLATE,
                       more={256: ("I", [1 << 16]), 257: ("I", [1 << 14])})  # fmt: skip
    with pytest.raises(BadFile, match="at most 64 a byte"):
        open_band(path, 1)


# ---- captures


def capture_of(folder, modalities, name="a.tif", **rest):
    """Two places with one photo each, of which every modality is a band."""
    frames, more = simple(folder, 2)
    for i, frame in enumerate(frames):
        frame["file_path"] = name.replace("a.", f"{i}.")
    write_transforms(folder, frames, **more, **rest, modalities=modalities)
    return read_capture(folder)


def of_bands(*names: str) -> list[dict]:
    return [
        {"name": name, "x": i / 9, "kind": "values", "band": i + 1, "value_range": [0, 1],
         "counts": [0, 60000]} for i, name in enumerate(names)
    ]  # fmt: skip


@pytest.mark.parametrize("beside", [False, True])
def test_one_file_is_the_photo_of_every_modality(tmp_path, beside):
    wanted = [numbers("u2", 4) // (i + 1) for i in range(2)]
    for i, bands in enumerate(wanted):
        write_bands(tmp_path / f"{i}.tif", bands, beside=beside)
    capture = capture_of(tmp_path, [*of_bands("Blue", "Green", "Red", "NIR"), NDVI])
    assert [stop.name for stop in capture.stops] == ["Blue", "Green", "Red", "NIR"]
    assert [stop.formula for stop in capture.formulas] == [NDVI["formula"]]
    assert len(capture.photos) == 8
    for photo in capture.photos:
        bands = wanted[int(photo.path.stem)][photo.band - 1]
        shown = load_photo(photo).rgb
        assert (shown == shown[..., :1]).all()
        assert np.abs(shown[..., 0] - np.clip(bands / 60000, 0, 1) * 255).max() <= 0.5
    assert len({photo.name for photo in capture.photos}) == 8
    write_capture(capture)
    again = read_capture(tmp_path)
    assert {p.name for p in again.photos} == {p.name for p in capture.photos}
    assert again.formulas == capture.formulas


def test_bands_of_a_colmap_model_share_a_folder(tmp_path):
    """Channels of its colour photos beside its thermal ones; all three name the folder rgb."""
    colmap_model(tmp_path, text=True)
    names = ("Red", "Green", "Blue")
    said = [
        {"name": name, "x": i / 4, "kind": "values", "band": i + 1, "folder": "rgb"}
        for i, name in enumerate(names)
    ]
    said += [{"name": "Heat", "x": 0.9, "kind": "thermal", "folder": "thermal"}]
    said += [NDVI | {"formula": "(green - red) / (green + red)"}]
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": said}), encoding="utf-8")
    capture = read_capture(tmp_path)
    counts = Counter(photo.modality for photo in capture.photos)
    assert counts == {"Red": 4, "Green": 4, "Blue": 4, "Heat": 3}
    assert [stop.value_range for stop in capture.stops[:3]] == [(0, 255)] * 3
    for photo in capture.photos:
        if photo.modality in names:
            with Image.open(photo.path) as image:
                wanted = np.asarray(image)[..., names.index(photo.modality)]
            np.testing.assert_array_equal(load_photo(photo).rgb[..., 0], wanted)
    assert [stop.name for stop in capture.formulas] == ["NDVI"]


def test_capture_json_says_the_bands_of_frames_beside_it(tmp_path):
    wanted = [numbers("u2", 4) // (i + 1) for i in range(2)]
    frames, rest = simple(tmp_path, 2)
    for i, frame in enumerate(frames):
        write_bands(tmp_path / f"{i}.tif", wanted[i])
        frame["file_path"] = f"{i}.tif"
    write_transforms(tmp_path, frames, **rest)
    said = [band | {"folder": ""} for band in of_bands("Blue", "Green")] + [
        NDVI | {"formula": "blue / green"}
    ]
    (tmp_path / "capture.json").write_text(json.dumps({"modalities": said}), encoding="utf-8")
    capture = read_capture(tmp_path)
    counts = Counter(photo.modality for photo in capture.photos)
    assert counts == {"Blue": 2, "Green": 2} and len(capture.formulas) == 1
    for photo in capture.photos:
        shown = load_photo(photo).rgb[..., 0]
        bands = wanted[int(photo.path.stem)][photo.band - 1]
        assert np.abs(shown - np.clip(bands / 60000, 0, 1) * 255).max() <= 0.5


def test_a_tiff_of_bands_without_a_band_is_refused(tmp_path):
    write_bands(tmp_path / "0.tif", numbers("u2", 4))
    write_bands(tmp_path / "1.tif", numbers("u2", 4))
    for kind in ("rgb", "values"):
        with pytest.raises(BadFile, match="a TIFF of 4 bands; say with its modality's 'band'"):
            load_photo(capture_of(tmp_path, [{"name": "A", "x": 0, "kind": kind}]).photos[0])


@pytest.mark.parametrize(
    ("band", "words"), [(0, "'band'|band"), (5, "bands 1 to 4"), ("red", "band"), (1.5, "band")]
)
def test_bands_that_there_are_not(tmp_path, band, words):
    for i in range(2):
        write_bands(tmp_path / f"{i}.tif", numbers("u2", 4))
    said = of_bands("Red")
    said[0]["band"] = band
    with pytest.raises(BadFile, match=words):
        load_photo(capture_of(tmp_path, said).photos[0])


def test_a_formula_of_a_capture_names_its_stops(tmp_path):
    for i in range(2):
        write_bands(tmp_path / f"{i}.tif", numbers("u2", 4))
    wrong = {"nir / blue": "no stop 'blue'", "1 + 1": "names no stop", "ndvi": "no stop 'ndvi'",
             "__import__('os')": "none of|before"}  # fmt: skip
    for formula, words in wrong.items():
        with pytest.raises(BadFile, match=words):
            capture_of(tmp_path, [*of_bands("Red", "NIR"), NDVI | {"formula": formula}])
    said = json.loads((tmp_path / "transforms.json").read_text())
    assert said["modalities"][-1]["formula"] == "__import__('os')"  # what was read stays
