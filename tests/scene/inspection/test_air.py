"""The air before a camera: against Magnus' formula for its water, and flyr's temperatures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.captures.radiometric.number_photos import radiometric_celsius
from shapeshift.scene.inspection.air import NO_AIR, Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation, camera_settings
from shapeshift.scene.inspection.marks_file import MarksFile, read_marks_file, write_marks_file
from tests.support.scene import flir_files


def magnus(celsius: float) -> float:
    """g / m^3 of saturated air: Magnus' pressure (WMO 2018) and the ideal gas law."""
    pascal = 611.2 * math.exp(17.62 * celsius / (243.12 + celsius))
    return 1000 * 18.016e-3 * pascal / (8.314462 * (celsius + 273.15))


@pytest.mark.parametrize("celsius", [-10.0, 0.0, 10.0, 20.0, 30.0, 45.0])
def test_its_water_is_that_of_another_formula(celsius):
    """They differ by 2.4 % at -10 °C, by 2.0 at 0, and by less where air holds more water."""
    assert Air(1, 100, celsius).water == pytest.approx(magnus(celsius), rel=0.025)


def test_more_of_it_and_wetter_lets_less_through():
    shares = [Air(d, 50, 20).transmission for d in (0.0, 1.0, 10.0, 100.0, 1000.0)]
    assert shares[0] == 1 and shares == sorted(shares, reverse=True)
    assert [round(share, 3) for share in shares[1:4]] == [0.994, 0.981, 0.937]
    wetter = [Air(50, h, 30).transmission for h in (0, 30, 60, 100)]
    assert wetter == sorted(wetter, reverse=True) and Air(0, 100, 60).transmission == 1
    assert 0 < Air(1000, 100, 60).transmission < 0.5


def set_to(monkeypatch, surface: tuple[float, float], air: tuple[float, float, float]) -> None:
    """The camera of radiometric photos: emissivity, °C reflected; metres, 0..1 of humidity, °C."""
    record = bytearray(flir_files.camera_record())
    values = ((32, surface[0]), (36, air[0]), (40, surface[1] + 273.15), (44, air[2] + 273.15),
              (48, air[2] + 273.15), (60, air[1]))  # fmt: skip
    for offset, value in values:
        flir_files.struct.pack_into("<f", record, offset, value)
    monkeypatch.setattr(flir_files, "camera_record", lambda: bytes(record))


@pytest.mark.parametrize(
    ("celsius", "off"), [(0.0, 0.15), (35.0, 0.15), (60.0, 0.15), (120.0, 0.3)]
)
def test_surfaces_are_what_a_photo_of_the_same_air_says(tmp_path, monkeypatch, celsius, off):
    """What is left: the photo's Planck curve is this camera's, of 10.3 micrometres, ours of 9.8."""
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    metres, humidity, air_c, emissivity, mirrored = 20.0, 0.7, 12.0, 0.9, 15.0
    set_to(monkeypatch, (emissivity, mirrored), (metres, humidity, air_c))
    path = flir_files.write_flir(tmp_path / "a.jpg", np.full((3, 4), celsius), (4, 3))
    want = float(radiometric_celsius(path, (4, 3))[0, 0])
    air = Air(metres, 100 * humidity, air_c)
    emission = Emission(SurfaceRadiation(emissivity, mirrored), air=air)
    got = float(emission.corrected(np.array(celsius), "°C"))
    assert got == pytest.approx(want, abs=off) and abs(want - celsius) > 0.3


@pytest.mark.parametrize("metres", [0.0, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("emissivity", [1.0, 0.8])
def test_a_photo_is_read_through_air_of_its_whole_distance(
    tmp_path, monkeypatch, metres, emissivity
):
    """Counts by FLIR's S = E t B(T) + (1 - E) t B(reflected) + (1 - t) B(air), forwards; a count is
    0.02 °C of a black body, more where less of it arrives.
    """
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    surfaces, air_c, mirrored, humidity = np.array([[-20.0, 20, 50, 120]] * 3), 20.0, 15.0, 0.5
    set_to(monkeypatch, (emissivity, mirrored), (metres, humidity, air_c))
    grams = humidity * math.exp(1.5587 + 0.06939 * 20 - 0.00027816 * 400 + 6.8455e-7 * 8000)
    share = 1.9 * math.exp(-(metres**0.5) * (0.006569 - 0.002276 * grams**0.5))
    share -= 0.9 * math.exp(-(metres**0.5) * (0.01262 - 0.00667 * grams**0.5))
    radiation = flir_files.radiation
    arrives = (
        emissivity * share * radiation(surfaces)
        + (1 - emissivity) * share * radiation(mirrored)
        + (1 - share) * radiation(air_c)
    )
    counts = np.rint(arrives).astype(np.uint16)
    monkeypatch.setattr(flir_files, "raw_counts", lambda celsius: counts)
    path = flir_files.write_flir(tmp_path / "a.jpg", surfaces, (4, 3))
    np.testing.assert_allclose(radiometric_celsius(path, (4, 3)), surfaces, atol=0.05)


def test_what_the_camera_was_set_to_is_put_back():
    values = np.array([5.0, 20.0, 90.0])
    air, other = Air(40, 80, 10), Air(5, 30, 25)
    told = Emission(air=air).corrected(values, "°C")
    np.testing.assert_allclose(Emission(taken_air=air).corrected(told, "°C"), values, atol=1e-9)
    same = Emission(air=other, taken_air=other).corrected(values, "°C")
    np.testing.assert_allclose(same, values, atol=1e-9)
    assert Emission(air=Air(40, 80, 20)).corrected(np.array(20.0), "°C") == pytest.approx(20.0)
    kelvins = Emission(air=air).corrected(values + 273.15, "K")
    np.testing.assert_allclose(kelvins, told + 273.15, atol=1e-9)
    np.testing.assert_allclose(Emission().corrected(values, "°C"), values, atol=1e-9)


@pytest.mark.parametrize(
    ("numbers", "said"),
    [((-1, 50, 20), "distance"), ((1001, 50, 20), "distance"), ((math.nan, 50, 20), "distance"),
     ((1, 100.1, 20), "humidity"), ((1, 50, 61), "temperature"),
     ((1, 50, -math.inf), "temperature")],
)  # fmt: skip
def test_what_is_no_air_is_refused(numbers, said):
    with pytest.raises(ValueError, match=f"the air's {said} is"):
        Air(*numbers)


def test_marks_keep_it(tmp_path):
    path = tmp_path / "a.marks.json"
    emission = Emission(SurfaceRadiation(0.9, 12.0), air=Air(12, 60, 5), taken_air=Air(1, 50, 20))
    write_marks_file(MarksFile(emission=emission), path)
    assert read_marks_file(path).emission == emission
    write_marks_file(MarksFile(emission=replace(emission, air=NO_AIR, taken_air=NO_AIR)), path)
    assert "air" not in path.read_text()
    for bad in ("[1, 2]", "[1, 50, 900]", '"x"', "[1, null, 2]"):
        head = '{"shapeshift_marks": 1, "marks": [], "emission": {"emissivity": 1, "air": '
        path.write_text(head + bad + "}}")
        with pytest.raises(BadFile):
            read_marks_file(path)


RAMP = np.linspace(10.0, 60.0, 12).reshape(3, 4)


def test_what_a_camera_was_set_to_is_read_from_its_photo(tmp_path, monkeypatch):
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    set_to(monkeypatch, (0.93, 17.0), (4.0, 0.6, 11.0))
    surface, air = camera_settings(flir_files.write_flir(tmp_path / "a.jpg", RAMP, (4, 3)))
    assert vars(surface) == pytest.approx({"emissivity": 0.93, "reflected": 17.0}, abs=1e-4)
    assert vars(air) == pytest.approx(
        {"distance_m": 4.0, "humidity": 60.0, "celsius": 11.0}, abs=1e-4
    )


@pytest.mark.parametrize(
    ("surface", "air"),
    [
        ((0.0, 17.0), (4.0, 0.6, 11.0)), ((0.93, math.nan), (4.0, 0.6, 11.0)),
        ((0.93, 17.0), (math.inf, 0.6, 11.0)), ((0.93, 17.0), (4.0, 1.7, 11.0)),
    ],
)  # fmt: skip
def test_a_photo_of_a_camera_set_to_nonsense_is_one_sentence(tmp_path, monkeypatch, surface, air):
    pytest.importorskip("flyr", reason="the optional extra thermal is not installed")
    set_to(monkeypatch, surface, air)
    path = flir_files.write_flir(tmp_path / "a.jpg", RAMP, (4, 3))
    with pytest.raises(BadFile, match=r"a\.jpg: [^\n]+\.$"):
        camera_settings(path)


def test_other_files_say_nothing_of_a_camera(tmp_path):
    with pytest.raises(BadFile, match="no such photo"):
        camera_settings(tmp_path / "none.jpg")
    Image.new("RGB", (4, 3)).save(tmp_path / "b.jpg")
    with pytest.raises(BadFile, match="no radiometric JPEG"):
        camera_settings(tmp_path / "b.jpg")
