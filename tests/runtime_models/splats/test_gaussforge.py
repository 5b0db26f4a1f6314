"""spz, ksplat and splat against gaussforge: what it writes we read, what we write it reads.

It keeps the axes of a PLY in an .spz, as we do.  Where it does not do as a format's own sources do:
it cuts bytes off where rounding is nearer, and puts the harmonics of a
.ksplat of degree 2 in another order than GaussianSplats3D reads.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapeshift.renderer.reference import reference_image
from shapeshift.runtime_models.lint.lint import judge
from shapeshift.runtime_models.model import SplatLayers, Stop
from shapeshift.runtime_models.splats.formats import read_raw
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.ply.write_ply import write_ply
from shapeshift.runtime_models.splats.spz.write_spz import write_spz
from shapeshift.runtime_models.splats.write_splat import write_splat
from tests.support.splat_scenes import alone, front_view, psnr_db

gaussforge = pytest.importorskip("gaussforge", reason="the other converter is not installed")


def splats(count: int, degree: int, seed: int = 0) -> PlainSplats:
    """Splats within the codes of every format: colours in 0..1, harmonics in -1..1."""
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=(count, 4))
    sh = rng.uniform(-0.9, 0.9, (count, (degree + 1) ** 2, 3))
    sh[:, 1:] *= 0.3
    arrays = (
        rng.normal(size=(count, 3)) * 0.6,
        np.exp(rng.uniform(-6, -2.5, (count, 3))),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.uniform(0.02, 0.98, count),
        sh,
    )
    return PlainSplats(*(a.astype(np.float32) for a in arrays))


def theirs(path: Path, form: str, folder: Path, **kind) -> Path:
    """The file as they convert it."""
    ending = path.name.partition(".")[2]
    made = gaussforge.GaussForge().convert(path.read_bytes(), ending, form, **kind)
    assert "data" in made, made
    out = folder / f"theirs.{form}"
    out.write_bytes(made["data"])
    return out


def read(path: Path, up: str = "") -> PlainSplats:
    reading = Reading(up=up)
    return judge(read_raw(path, reading), reading)


def check(got: PlainSplats, want: PlainSplats, steps: dict[str, float]) -> None:
    """Within the largest differences of place, log scale, opacity, colour, harmonics; radians."""
    assert got.means.shape == want.means.shape and got.findings == ()
    assert np.abs(got.means + got.origin - want.means).max() <= steps["place"]
    assert np.abs(np.log(got.scales) - np.log(want.scales)).max() <= steps["scale"]
    assert np.abs(got.opacity - want.opacity).max() <= steps["opacity"]
    assert np.abs(got.sh[:, 0] - want.sh[:, 0]).max() <= steps["color"]
    if got.sh.shape[1] > 1:
        assert got.sh.shape == want.sh.shape
        assert np.abs(got.sh[:, 1:] - want.sh[:, 1:]).max() <= steps["sh"]
    dot = np.abs((got.wxyz.astype(np.float64) * want.wxyz).sum(1)).clip(0, 1)
    assert 2 * np.arccos(dot).max() <= steps["radians"]


BYTE = 1.001 / 255  # they cut off: a whole step
SPZ = {
    "place": 2.0**-13 * 1.01,
    "scale": 0.0313,
    "opacity": 0.51 * BYTE,
    "color": 0.51 * BYTE / 0.15,
}


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_their_spz_is_what_they_were_given(tmp_path, version, degree):
    want = splats(3000, degree)
    write_ply(want, tmp_path / "a.ply")
    got = read(theirs(tmp_path / "a.ply", "spz", tmp_path, spz_version=version), up="-Y")
    assert got.format == f"spz v{version}"
    # Their harmonics have 4 bits, of degree 1 5: half a bucket of 16 codes, and one of rounding.
    steps = {"sh": 9 / 128 + 0.001, "radians": 0.004 if version > 2 else 0.25}
    check(got, want, SPZ | steps)


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_our_spz_is_read_by_them(tmp_path, version, degree):
    want = splats(3000, degree, seed=1)
    write_spz(want, tmp_path / "a.spz", version)
    got = read(theirs(tmp_path / "a.spz", "ply", tmp_path))
    steps = {"place": 2.0**-17 * 1.01, "sh": 1.01 / 256, "radians": 0.004 if version > 2 else 0.25}
    check(got, want, SPZ | steps)


def test_antialiased_survives_both_ways(tmp_path):
    """Their PLY has no word for it, so that their spz is asked itself."""
    want = replace(splats(20, 0), antialiased=True)
    write_spz(want, tmp_path / "a.spz", 3)
    made = theirs(tmp_path / "a.spz", "spz", tmp_path, spz_version=4)
    assert read(made).antialiased and read(made).format == "spz v4"


FLOATS = {"place": 1e-6, "scale": 2e-6, "opacity": BYTE, "color": BYTE / 0.282, "sh": 1e-6}


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_their_ksplat_is_what_they_were_given(tmp_path, degree):
    want = splats(3000, degree, seed=2)
    write_ply(want, tmp_path / "a.ply")
    got = read(theirs(tmp_path / "a.ply", "ksplat", tmp_path))
    check(got, want, FLOATS | {"radians": 1e-3})


def test_their_ksplat_of_degree_two_has_its_harmonics_in_another_order(tmp_path):
    """All of red first, where GaussianSplats3D reads degree 1 of all colours, then degree 2."""
    want = splats(50, 2, seed=2)
    write_ply(want, tmp_path / "a.ply")
    got = read_raw(theirs(tmp_path / "a.ply", "ksplat", tmp_path), Reading())
    given = read_raw(tmp_path / "a.ply", Reading())
    as_filed = given.sh[:, 1:].transpose(0, 2, 1).reshape(50, 24)
    first, second = as_filed[:, :9].reshape(50, 3, 3), as_filed[:, 9:].reshape(50, 3, 5)
    np.testing.assert_array_equal(got.sh[:, 1:4], first.transpose(0, 2, 1))
    np.testing.assert_array_equal(got.sh[:, 4:], second.transpose(0, 2, 1))


def test_splat_files_agree_both_ways(tmp_path):
    want = splats(3000, 0, seed=3)
    write_ply(want, tmp_path / "a.ply")
    steps = FLOATS | {"radians": 0.04}  # quaternions in bytes
    got = read(theirs(tmp_path / "a.ply", "splat", tmp_path))
    check(in_order(got), in_order(want), steps)
    write_splat(want, tmp_path / "b.splat")
    check(in_order(read(theirs(tmp_path / "b.splat", "ply", tmp_path))), in_order(want), steps)


def in_order(splats: PlainSplats) -> PlainSplats:
    """By x: a .splat is sorted by what shows most."""
    order = np.argsort(splats.means[:, 0])
    names = ("means", "scales", "wxyz", "opacity", "sh")
    return replace(splats, **{name: getattr(splats, name)[order] for name in names})


def picture(splats: PlainSplats) -> np.ndarray:
    """(72, 96, 4) by the slow oracle."""
    arrays = [getattr(splats, name) for name in ("means", "scales", "wxyz", "opacity", "sh")]
    arrays[0] = arrays[0] + np.array(splats.origin, np.float32)
    layer = np.zeros(len(arrays[0]), np.int32)
    scene = alone(SplatLayers(*arrays, layer, (Stop("only", 0.0),)))
    return reference_image(scene, front_view((96, 72)))


@pytest.mark.parametrize("degree", [0, 3])
def test_pictures_of_our_reading_and_theirs_are_the_same(tmp_path, degree):
    """Of either's .spz and of their .ksplat and .splat: 50 dB and more between the two readers."""
    want = splats(1500, degree, seed=4)
    write_ply(want, tmp_path / "a.ply")
    write_spz(want, tmp_path / "ours.spz")
    files = [(tmp_path / "ours.spz", "", "")]
    for form in ("spz", "ksplat") + (("splat",) if degree == 0 else ()):
        made = theirs(tmp_path / "a.ply", form, tmp_path)
        files.append((made.rename(tmp_path / f"made.{form}"), "-Y" if form == "spz" else "", ""))
    original = picture(want)
    for path, up, their_up in files:
        ours = picture(read(path, up=up))
        again = picture(read(theirs(path, "ply", tmp_path), up=their_up))
        assert psnr_db(ours, again) > 50, path.name
        # Their .spz has 4 bits a harmonic; the rest is what bytes cost.
        coarse = path.name == "made.spz" and degree == 3
        assert psnr_db(ours, original) > (38 if coarse else 50), path.name
