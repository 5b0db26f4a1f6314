"""spz written: what comes back is within half a code's step, at the ends of every code."""

import gzip
from dataclasses import replace

import numpy as np
import pytest

from shapeshift.runtime_models.splats.formats import read_plain
from shapeshift.runtime_models.splats.plain_splats import PlainSplats, Reading
from shapeshift.runtime_models.splats.spz.read_spz import read_raw_spz
from shapeshift.runtime_models.splats.spz.write_spz import write_spz

SLACK = 1.001  # of a bound: float32 rounding


def splats(count: int, degree: int = 0, seed: int = 0, wide: float = 3.0) -> PlainSplats:
    """Splats that fill the codes: colours to their ends, scales from 5e-5 m to 300 m."""
    rng = np.random.default_rng(seed)
    wxyz = rng.normal(size=(count, 4))
    sh = rng.uniform(-127 / 128, 127 / 128, (count, (degree + 1) ** 2, 3))
    sh[:, 0] = rng.uniform(-3.3, 3.3, (count, 3))
    arrays = (
        rng.uniform(-wide, wide, (count, 3)),
        np.exp(rng.uniform(-9.9, 5.9, (count, 3))),
        wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True),
        rng.uniform(0, 1, count),
        sh,
    )
    return PlainSplats(*(a.astype(np.float32) for a in arrays))


def back(tmp_path, wanted: PlainSplats, version: int = 3, axes: str = "ply") -> PlainSplats:
    write_spz(wanted, tmp_path / "a.spz", version, axes)
    return read_plain(tmp_path / "a.spz")


def places(splats: PlainSplats) -> np.ndarray:
    """(N, 3) float64 metres from the file's zero, wherever the reader put its own."""
    return splats.means.astype(np.float64) + splats.origin


def largest_angle(a: np.ndarray, b: np.ndarray) -> float:
    """Radians between the rotations of unit quaternions."""
    dot = np.abs((a.astype(np.float64) * b).sum(1)).clip(0, 1)
    return float(2 * np.arccos(dot).max())


@pytest.mark.parametrize("axes", ["ply", "rub"])
@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("count", [1, 255, 3000])
def test_what_comes_back_is_within_half_a_step(tmp_path, version, degree, count, axes):
    wanted = splats(count, degree, seed=count + degree)
    got = back(tmp_path, wanted, version, axes)
    assert got.sh.shape == wanted.sh.shape and got.findings == () and not got.antialiased
    assert np.abs(places(got) - places(wanted)).max() <= 2.0**-17 * SLACK
    assert np.abs(np.log(got.scales) - np.log(wanted.scales)).max() <= 1 / 32 * SLACK
    assert np.abs(got.opacity - wanted.opacity).max() <= 1 / 510 * SLACK
    assert np.abs(got.sh[:, 0] - wanted.sh[:, 0]).max() <= 0.5 / 255 / 0.15 * SLACK
    if degree:
        assert np.abs(got.sh[:, 1:] - wanted.sh[:, 1:]).max() <= 1 / 256 * SLACK
    # Three entries off by 7e-4 each and the fourth by as much as they make it: 4 mrad.  Of x y z
    # in bytes, w near 0 loses the most: sqrt(1 - |xyz|^2) where |xyz| is off by 0.004.
    assert largest_angle(got.wxyz, wanted.wxyz) <= (0.004 if version >= 3 else 0.25)


def test_a_second_time_changes_nothing(tmp_path):
    """Codes are taken back to the same codes, so that a file does not wear out."""
    for version in (3, 4):
        once = back(tmp_path, splats(2000, 3), version)
        first = (tmp_path / "a.spz").read_bytes()
        twice = back(tmp_path, once, version)
        for name in ("means", "scales", "opacity", "sh"):
            np.testing.assert_array_equal(getattr(once, name), getattr(twice, name))
        assert largest_angle(once.wxyz, twice.wxyz) < 0.003
        write_spz(splats(2000, 3), tmp_path / "b.spz", version)
        assert (tmp_path / "b.spz").read_bytes() == first, "the same splats, the same bytes"


def test_what_lies_beyond_a_code_is_held_at_its_end(tmp_path):
    wanted = splats(4, 1)
    wanted.scales[:] = [[0, 1e-30, 1e-6], [1e3, 1e30, 400], [1, 1, 1], [1, 1, 1]]
    wanted.sh[:, 0], wanted.sh[:2, 1:], wanted.sh[2:, 1:] = 9.0, 5.0, -5.0
    wanted.opacity[:] = [0, 1, 0.5, 0.002]
    got = back(tmp_path, wanted, axes="rub")  # whose harmonics keep their signs
    np.testing.assert_allclose(np.log(got.scales[0]), -10, atol=1e-6)
    np.testing.assert_allclose(np.log(got.scales[1]), 255 / 16 - 10, atol=1e-6)
    np.testing.assert_allclose(got.sh[:, 0], 0.5 / 0.15, rtol=1e-6)
    np.testing.assert_array_equal(got.sh[:2, 1:], np.float32(127 / 128))
    np.testing.assert_array_equal(got.sh[2:, 1:], -1)
    np.testing.assert_allclose(got.opacity, [0, 1, 128 / 255, 1 / 255], atol=1e-6)


@pytest.mark.parametrize("version", [2, 3, 4])
def test_quaternions_at_the_edges_of_the_code(tmp_path, version):
    half = np.sqrt(0.5)
    rows = [np.eye(4)[i] * sign for i in range(4) for sign in (1, -1)]
    rows += [np.full(4, 0.5) * sign for sign in (1, -1)] + [[half, half, 0, 0], [0, 0, -half, half]]
    rows += [[half, 0, -half, 1e-8], [0.5, -0.5, 0.5, -0.5], [1e-9, 0, 0, -1]]
    wanted = splats(len(rows))
    wanted.wxyz[:] = rows
    got = back(tmp_path, wanted, version)
    assert largest_angle(got.wxyz, wanted.wxyz) <= (0.004 if version >= 3 else 0.2)


@pytest.mark.parametrize(
    "wide, bits", [(1e-3, 16), (100, 16), (128.1, 15), (1000, 13), (1e5, 6), (8e6, 0)]
)
def test_the_bits_of_a_place_follow_from_how_far_they_reach(tmp_path, wide, bits):
    wanted = replace(splats(500, wide=wide), scales=np.full((500, 3), 0.5, np.float32))
    if bits == 0:
        wanted.scales[:] = 2.0
    wanted.means[0] = [wide, -wide, wide]
    got = back(tmp_path, wanted)
    data = (tmp_path / "a.spz").read_bytes()
    assert gzip.decompress(data)[13] == bits
    assert np.abs(places(got) - places(wanted)).max() <= 2.0 ** (-bits - 1) * SLACK


def test_the_origin_is_put_back(tmp_path):
    wanted = replace(splats(300), origin=(500.25, -20.5, 3.0))
    write_spz(wanted, tmp_path / "a.spz")
    raw = read_raw_spz(tmp_path / "a.spz", Reading())
    want = (wanted.means + np.array(wanted.origin)) * (1, -1, -1)  # as a PLY has it
    assert np.abs(raw.means - want).max() <= 2.0**-14 * SLACK  # 13 bits below the metre


def test_places_that_do_not_fit_are_refused(tmp_path):
    far = replace(splats(3), origin=(9e6, 0.0, 0.0))
    with pytest.raises(
        ValueError, match=r"up to 9e\+06 m from the origin, an .spz reaches 8,388,607"
    ):
        write_spz(far, tmp_path / "a.spz")
    coarse = replace(splats(50), origin=(5e5, 0, 0), scales=np.full((50, 3), 0.01, np.float32))
    with pytest.raises(ValueError, match=r"steps of 0\.0625 m.*move"):
        write_spz(coarse, tmp_path / "a.spz")
    nowhere = splats(3)
    nowhere.means[1, 1] = np.nan
    with pytest.raises(ValueError, match="nan m from the origin"):
        write_spz(nowhere, tmp_path / "a.spz")
    with pytest.raises(ValueError, match="version 1 was asked for"):
        write_spz(splats(3), tmp_path / "a.spz", 1)
    with pytest.raises(ValueError, match="axes 'luf' were asked for"):
        write_spz(splats(3), tmp_path / "a.spz", 3, "luf")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("version", [2, 3, 4])
def test_antialiased_comes_back(tmp_path, version):
    assert back(tmp_path, replace(splats(3), antialiased=True), version).antialiased
