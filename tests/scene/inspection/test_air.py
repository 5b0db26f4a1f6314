"""The air before a camera: against Magnus' formula for its water, and flyr's temperatures."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.air import NO_AIR, Air
from shapeshift.scene.inspection.emissivity import Emission, SurfaceRadiation
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


@pytest.mark.parametrize(
    ("celsius", "off"), [(0.0, 0.15), (35.0, 0.15), (60.0, 0.15), (120.0, 0.3)]
)
def test_surfaces_are_what_flyr_makes_of_the_same_air(tmp_path, monkeypatch, celsius, off):
    """flyr takes the way in two halves, so its share is the square of ours of half the distance.

    What is left: flyr's Planck curve is this camera's, of 10.3 micrometres, ours of 9.8.
    """
    flyr = pytest.importorskip("flyr")
    metres, humidity, air_c, emissivity, mirrored = 20.0, 0.7, 12.0, 0.9, 15.0
    record = bytearray(flir_files.camera_record())
    values = ((32, emissivity), (36, metres), (40, mirrored + 273.15), (44, air_c + 273.15),
              (48, air_c + 273.15), (60, humidity))  # fmt: skip
    for offset, value in values:
        flir_files.struct.pack_into("<f", record, offset, value)
    monkeypatch.setattr(flir_files, "camera_record", lambda: bytes(record))
    path = flir_files.write_flir(tmp_path / "a.jpg", np.full((3, 4), celsius), (4, 3))
    want = float(flyr.unpack(str(path)).celsius[0, 0])

    class TwoHalves(Air):
        @property
        def transmission(self) -> float:
            return Air(self.distance_m / 2, self.humidity, self.celsius).transmission ** 2

    air = TwoHalves(metres, 100 * humidity, air_c)
    emission = Emission(SurfaceRadiation(emissivity, mirrored), air=air)
    got = float(emission.corrected(np.array(celsius), "°C"))
    assert got == pytest.approx(want, abs=off) and abs(want - celsius) > 0.3


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
