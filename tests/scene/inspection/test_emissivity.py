"""Emissivity against the integral of Planck's law over a camera's band, and against itself."""

import numpy as np
import pytest

from shapeshift.runtime_models.model import BadFile
from shapeshift.scene.inspection.emissivity import (
    LEAST_EMISSIVITY,
    Emission,
    SurfaceRadiation,
    radiance,
    temperature,
)
from shapeshift.scene.inspection.marks import Mark, read_mark
from shapeshift.scene.inspection.marks_file import (
    MarksFile,
    marks_rows,
    read_marks_file,
    write_marks_file,
)
from tests.support.scene.warm_wall import traced

BLACK = SurfaceRadiation()


def band(celsius: np.ndarray) -> np.ndarray:
    """Planck's law integrated from 7.5 to 14 micrometres, by Simpson's rule over 400 steps."""
    wavelength = np.linspace(7.5, 14, 401)
    weight = np.ones(401)
    weight[1:-1:2], weight[2:-1:2] = 4, 2
    kelvins = np.asarray(celsius, float)[..., None] + 273.15
    return (weight * wavelength**-5.0 / np.expm1(14387.77 / (wavelength * kelvins))).sum(axis=-1)


def of_band(sent: float) -> float:
    """°C of the black body that sends so much in the band, by bisection."""
    low, high = -100.0, 500.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if band(middle) < sent else (low, middle)
    return low


@pytest.mark.parametrize("emissivity", [0.5, 0.7, 0.9, 0.95])
@pytest.mark.parametrize("true", [0.0, 25.0, 60.0, 100.0, 150.0])
@pytest.mark.parametrize("mirrored", [0.0, 20.0])
def test_a_surface_is_found_as_a_camera_of_the_whole_band_sees_it(emissivity, true, mirrored):
    """One wavelength stands for the band; the docstring promises 0.2 °C (0.206 at the most)."""
    sent = emissivity * band(true) + (1 - emissivity) * band(mirrored)
    seen = of_band(float(sent))
    got = Emission(SurfaceRadiation(emissivity, mirrored)).corrected(np.array(seen), "°C")
    assert abs(float(got) - true) < 0.21


def test_a_black_body_and_what_is_as_warm_as_its_room_stay_as_they_are():
    values = np.array([-40.0, 0.0, 20.0, 95.0, 400.0])
    np.testing.assert_allclose(Emission().corrected(values, "°C"), values, atol=1e-9)
    for share in (LEAST_EMISSIVITY, 0.5, 1.0):
        same = Emission(SurfaceRadiation(share, 20.0)).corrected(np.array(20.0), "°C")
        assert float(same) == pytest.approx(20.0, abs=1e-9)


def test_a_correction_takes_the_cameras_own_back():
    """A camera that was told 0.8 and 15 °C already made surfaces of what it saw."""
    surface = SurfaceRadiation(0.8, 15.0)
    seen = np.array([30.0, 70.0])
    told = Emission(surface).corrected(seen, "°C")
    np.testing.assert_allclose(Emission(BLACK, surface).corrected(told, "°C"), seen, atol=1e-9)
    np.testing.assert_allclose(Emission(surface, surface).corrected(told, "°C"), told, atol=1e-9)


def test_units_say_the_same():
    celsius = np.array([35.0, 80.0])
    want = Emission(SurfaceRadiation(0.6, 20.0)).corrected(celsius, "°C")
    kelvins = Emission(SurfaceRadiation(0.6, 293.15)).corrected(celsius + 273.15, "K")
    np.testing.assert_allclose(kelvins - 273.15, want, atol=1e-9)
    warm = Emission(SurfaceRadiation(0.6, 68.0)).corrected(celsius * 1.8 + 32, "°F")
    np.testing.assert_allclose((warm - 32) / 1.8, want, atol=1e-9)
    with pytest.raises(ValueError, match="'bar'; emissivity is of temperatures"):
        radiance(1.0, "bar")


def test_what_cannot_be_is_nothing_or_refused():
    mirror = Emission(SurfaceRadiation(0.1, 80.0))
    assert np.isnan(mirror.corrected(np.array([20.0, np.nan]), "°C")).all()
    assert np.isnan(radiance(np.array([0.0, -5.0, np.nan]), "K")).all()
    assert np.isnan(temperature(np.array([0.0, -1.0, np.nan]), "K")).all()
    for share in (np.nextafter(0.1, 0), np.nextafter(1, 2), np.nan, np.inf, -0.5):
        with pytest.raises(ValueError, match=r"0\.1 to 1"):
            SurfaceRadiation(share)
    for mirrored in (-100.1, 3000.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="reflected"):
            SurfaceRadiation(0.9, mirrored)
    assert SurfaceRadiation(0.1, -100) and SurfaceRadiation(1.0, 3000)


@pytest.mark.parametrize("share", [0.3, 0.95, 1.0])
def test_an_error_grows_as_the_values_around_it_do(share):
    emission = Emission(SurfaceRadiation(share, 20.0))
    around = emission.corrected(np.array([59.0, 61.0]), "°C")
    assert emission.growth(60.0, "°C") == pytest.approx(float(np.diff(around)[0]) / 2, rel=1e-3)


def test_a_picture_is_corrected_and_comes_back():
    picture = traced()
    emission = Emission(SurfaceRadiation(0.7, 10.0))
    got = picture.corrected(emission)
    np.testing.assert_array_equal(got.values, emission.corrected(picture.values, "°C"))
    assert got.value_range == tuple(emission.corrected(np.array([0.0, 100.0]), "°C"))
    again = got.corrected(Emission(SurfaceRadiation(0.9, 20.0)))  # of what was photographed
    np.testing.assert_array_equal(
        again.values, Emission(SurfaceRadiation(0.9, 20.0)).corrected(picture.values, "°C")
    )
    back = again.as_photographed()
    np.testing.assert_array_equal(back.values, picture.values)
    assert back.value_range == picture.value_range and back.emission is None
    assert picture.as_photographed() is picture


def test_a_mark_may_have_its_own(tmp_path):
    picture = traced()
    place = picture.pick((48.0, 36.0))[None]
    plain = read_mark(Mark("a", "spot", place), picture).mean
    own = Mark("b", "spot", place, emissivity=0.5)
    want = float(Emission(SurfaceRadiation(0.5)).corrected(np.array(plain), "°C"))
    assert read_mark(own, picture).mean == pytest.approx(want, abs=0.01)  # between four pixels
    emission = Emission(SurfaceRadiation(0.9, 5.0))
    corrected = picture.corrected(emission)
    want = float(emission.corrected(np.array(plain), "°C", 0.5))
    assert read_mark(own, corrected).mean == pytest.approx(want, abs=0.01)
    file = MarksFile((own,), emission=Emission(SurfaceRadiation(0.9, 5.0), BLACK))
    path = tmp_path / "a.marks.json"
    write_marks_file(file, path)
    read = read_marks_file(path)
    assert read.emission == file.emission and read.marks[0].emissivity == 0.5
    assert marks_rows(read) == marks_rows(file)
    with pytest.raises(ValueError, match=r"'b' has the emissivity 0\.05; 0\.1 to 1 is wanted"):
        Mark("b", "spot", place, emissivity=0.05)


@pytest.mark.parametrize(
    "wrong", ['{"emissivity": 0}', '{"emissivity": "x"}', '{"reflected": 1e9}', "3",
              '{"taken": {"emissivity": 2}}', '{"humidity": 0.5}'],
)  # fmt: skip
def test_a_wrong_emission_of_a_file_is_one_sentence(tmp_path, wrong):
    path = tmp_path / "a.marks.json"
    path.write_text(f'{{"shapeshift_marks": 1, "marks": [], "emission": {wrong}}}')
    with pytest.raises(BadFile, match=r"a\.marks\.json"):
        read_marks_file(path)
