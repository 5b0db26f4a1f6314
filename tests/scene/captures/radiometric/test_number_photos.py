"""Thermal photos that are numbers: grids, TIFF, radiometric JPEG, and the range that they give."""

import sys

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.capture import Capture
from shapeshift.scene.captures.photo import load_photo, open_image
from shapeshift.scene.captures.radiometric.number_photos import (
    is_radiometric,
    open_grid,
    radiometric_celsius,
    saturation_kelvin,
)
from shapeshift.scene.captures.read_capture import read_capture
from shapeshift.scene.captures.write_capture import write_capture
from tests.support.scene.captures import simple, write_transforms
from tests.support.scene.flir_files import camera_record, write_flir

RAMP = np.linspace(20.0, 80.0, 12 * 16).reshape(12, 16)


def write_numbers(path, values: np.ndarray) -> None:
    kind = path.suffix
    if kind == ".npy":
        np.save(path, values)
    elif kind == ".csv":
        np.savetxt(path, values, fmt="%.6f", delimiter=",")
    elif kind == ".tif":
        Image.fromarray(values.astype(np.float32)).save(path)
    elif kind == ".png":
        Image.fromarray(np.rint(values * 100).astype(np.uint16)).save(path)
    else:
        write_flir(path, values, (16, 12), png=True)


def capture_of(folder, ending: str, count: int = 4, **heat) -> Capture:
    """Photos of heat, each two degrees hotter than the one before."""
    frames, rest = simple(folder, count + 1)
    for i in range(count):
        name = f"heat{i}{ending}"
        write_numbers(folder / name, RAMP + 2 * i)
        frames[i] |= {"modality": "Heat", "file_path": name}
    frames[count] |= {"modality": "RGB"}
    stop = {"name": "Heat", "x": 1, "kind": "thermal"} | heat
    write_transforms(folder, frames, **rest, modalities=[{"name": "RGB", "x": 0}, stop])
    return read_capture(folder)


@pytest.mark.parametrize("ending", [".npy", ".csv", ".tif", ".png", ".jpg"])
def test_a_range_that_nobody_states_is_that_of_the_photos(tmp_path, ending):
    """All values from 20 to 86 lie in it, and no more than the margin beyond them."""
    if ending == ".jpg":
        pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    capture = capture_of(tmp_path, ending)
    heat = capture.stops[-1]
    scale = 100.0 if ending == ".png" else 1.0  # 16 bits: counts, whatever they mean
    low, high = np.array(heat.value_range) / scale
    assert 20 - 4 < low < 20 and 86 < high < 86 + 4
    assert heat.palette == "ironbow"
    assert heat.unit == ("°C" if ending == ".jpg" else "")
    for i in (0, 3):
        grey = load_photo(capture.photos[i]).rgb[..., 0].astype(float)
        shown = low + (high - low) * grey / 255
        assert np.abs(shown - RAMP - 2 * i).max() < 0.5 * (high - low) / 255 + 0.02  # a count
    shown = 100.0 if ending == ".png" else 1.0
    assert heat.value_range == (1690 * shown / 100, 8910 * shown / 100)  # in three digits
    write_capture(capture)  # says the range from now on
    assert read_capture(tmp_path).stops[-1].value_range == heat.value_range


@pytest.mark.parametrize("ending", [".npy", ".tif"])
def test_numbers_in_a_range_that_is_stated_are_values(tmp_path, ending):
    capture = capture_of(tmp_path, ending, value_range=[20, 80], unit="°C", palette="ironbow")
    assert capture.stops[-1].value_range == (20.0, 80.0)
    grey = load_photo(capture.photos[0]).rgb[..., 0]
    np.testing.assert_allclose(grey, 255 * (RAMP - 20) / 60, atol=0.51)


@pytest.mark.parametrize("png", [False, True])
def test_degrees_of_a_radiometric_photo_are_those_of_planck(tmp_path, png):
    """A raw number is about 0.02 °C there."""
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    celsius = np.linspace(-10, 120, 60 * 80).reshape(60, 80)
    path = write_flir(tmp_path / "a.jpg", celsius, (80, 60), png)
    assert is_radiometric(path)
    np.testing.assert_allclose(radiometric_celsius(path, (80, 60)), celsius, atol=0.05)
    larger = radiometric_celsius(path, (160, 120))  # the picture has more pixels
    assert larger.shape == (120, 160)
    np.testing.assert_allclose(larger.reshape(60, 2, 80, 2).mean(axis=(1, 3)), celsius, atol=1.5)
    with pytest.raises(BadFile, match="field of view"):
        radiometric_celsius(path, (100, 60))
    data = path.read_bytes()
    for broken in (data[:2000], data.replace(b"FFF\0", b"XXX\0", 1)[:-3000]):
        path.write_bytes(broken)
        with pytest.raises(BadFile, match="thermal numbers") as refused:
            radiometric_celsius(path, (80, 60))
        assert "\n" not in str(refused.value)


def test_a_png_of_more_bytes_than_numbers_is_not_called_damaged(tmp_path):
    """Noise does not shrink; flyr reads two bytes a number."""
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    noise = np.random.default_rng(0).uniform(-20, 500, (60, 80))
    path = write_flir(tmp_path / "a.jpg", noise, (80, 60), png=True)
    with pytest.raises(BadFile, match="a PNG of more bytes than numbers"):
        radiometric_celsius(path, (80, 60))


def test_without_the_reader_a_sentence_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "flyr", None)
    path = write_flir(tmp_path / "a.jpg", RAMP, (16, 12))
    with pytest.raises(BadFile, match=r"launch\.py extras thermal`"):
        radiometric_celsius(path, (16, 12))
    monkeypatch.setattr(
        "shapeshift.scene.captures.value_ranges.cannot_read_radiometric",
        lambda path: "for degrees: another package",
    )
    capture = capture_of(tmp_path, ".jpg")  # their colours, as before
    assert capture.stops[-1].value_range is None
    assert any("another package" in doubt for doubt in capture.doubts)
    assert not is_radiometric(tmp_path / "images" / "000.png")


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("\ufeff1;2,5\r\n3;4\r\n", [[1, 2.5], [3, 4]]),
        ("Camera,E8\nunit,C\n\n1,2,\n3,,\n", [[1, 2], [3, np.nan]]),
        ("Camera,E8,,\n,,,\n1,2,,\n3,4,,\n", [[1, 2, np.nan, np.nan], [3, 4, np.nan, np.nan]]),
        (",\n1,2\n,\n", [[np.nan] * 2, [1, 2], [np.nan] * 2]),
        ("1;--;n/a\n;NaN;2,5\n", [[1, np.nan, np.nan], [np.nan, np.nan, 2.5]]),
        ("1,2,3\n4,5\n", None),
        (",,\n,,\n", [[np.nan] * 3] * 2),
        ("Camera,E8\nunit,C\n\n1,2,\n3,4,\n", [[1, 2], [3, 4]]),
        ("1\tnan\n3\t4", [[1, np.nan], [3, 4]]),
        ("1,#VALUE!\n1.#QNAN,2\n", [[1, np.nan], [np.nan, 2]]),
        ("1;1,#INF00\n-1,#IND;#¡DIV/0!\n#NV;#N/D\n", [[1, np.nan], *[[np.nan] * 2] * 2]),
        ("-nan(ind),>150\n1,<-20.5\n****,Err:502\n", [[np.nan] * 2, [1, np.nan], [np.nan] * 2]),
        ("E8\n****\n1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("y,1,2\n1,2,3\n4,5,6\n", [[1, 2, 3], [4, 5, 6]]),
        ("1,x,3\n1,2,3\n4,5,6\n", None),
        ("1,#1\n1,2\n3,#\n4,#VALUE\n", None),
        ("1,2\n3\n", None),
        ("1,2\n3,x\n", None),
        ("words\n", None),
        ("", None),
        ("1,2\n", None),
        ("1\n2\n", None),
    ],
)
def test_a_csv_is_lines_of_numbers(tmp_path, text, wanted):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding="utf-8")
    if wanted is None:
        with pytest.raises(BadFile, match=r"a\.csv: ") as refused:
            open_grid(path)
        assert "\n" not in str(refused.value)
    else:
        np.testing.assert_array_equal(np.asarray(open_grid(path)), np.float32(wanted))


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((2, 3, 4)), np.zeros(5), np.zeros((0, 3)), np.zeros((2, 2), complex),
        np.array([["a", "b"]]), np.array([[None, 1]], object),
    ],
)  # fmt: skip
def test_an_npy_that_is_no_grid_is_refused(tmp_path, values):
    np.save(tmp_path / "a.npy", values, allow_pickle=True)
    with pytest.raises(BadFile, match=r"a\.npy: ") as refused:
        open_grid(tmp_path / "a.npy")
    assert "\n" not in str(refused.value)
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY\x01\x00")
    with pytest.raises(BadFile, match=r"^a\.npy: |/a\.npy: ") as refused:
        open_image(tmp_path / "a.npy")
    assert "PNG" not in str(refused.value)  # its own sentence, not that of a picture
    with pytest.raises(BadFile, match="missing"):
        open_image(tmp_path / "b.npy")


def test_what_a_flir_camera_calls_saturated_is_no_value(tmp_path):
    """Its limits are of black bodies, whatever emissivity it is set to: at 0.5 the surface is
    hotter than what saturates.  A limit belongs to what is beyond, the float next to it does not.
    """
    celsius = np.linspace(-40, 160, 192, dtype=np.float32).reshape(12, 16)
    for emissivity in (1.0, 0.5):
        camera = camera_record((-20, 120), emissivity)
        path = write_flir(tmp_path / "a.jpg", celsius, (16, 12), camera=camera)
        found = radiometric_celsius(path, (16, 12))
        away = np.minimum(np.abs(celsius - 120), np.abs(celsius + 20)) > 0.1  # but for a count
        away &= (emissivity == 1) | (celsius > 20)  # below what it mirrors no surface is known
        inside = (celsius > -20) & (celsius < 120)
        np.testing.assert_array_equal(np.isfinite(found)[away], inside[away])
    assert np.nanmax(found) > 150
    plain = write_flir(tmp_path / "b.jpg", celsius, (16, 12))
    np.testing.assert_allclose(radiometric_celsius(plain, (16, 12)), celsius, atol=0.1)
    assert saturation_kelvin(plain.read_bytes()) == (-np.inf, np.inf)
    low, high = saturation_kelvin(path.read_bytes())
    assert (low, high) == (pytest.approx(253.15), pytest.approx(393.15))
    for wrong in [(-20, np.nan), (np.nan, 120), (120, -20), (50, 50), (-300, 120), (0, np.inf)]:
        path = write_flir(tmp_path / "c.jpg", celsius, (16, 12), camera=camera_record(wrong))
        assert saturation_kelvin(path.read_bytes()) == (-np.inf, np.inf)
    whole = path.read_bytes()
    for end in range(0, len(whole), 97):  # cut anywhere: nothing stated, and no fault
        assert saturation_kelvin(whole[:end]) == (-np.inf, np.inf)
